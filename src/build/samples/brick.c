#include "build/samples/brick.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "build/ingest/buckets.h"
#include "geometry/colour.h"
#include "geometry/far.h"
#include "geometry/octahedral.h"
#include "geometry/payload.h"
#include "geometry/sample_payload.h"

#define LEAVES_BESIDE 7u

/* A cell whose triangles are no more goes into one brick as a whole. */
#define COMPACT_TRIANGLES 8000u

/* Triangles of one brick on their way to a payload. */
typedef struct brick_content {
    uint32_t *triangle; /* [count] of the octree */
    uint8_t *level;     /* [count] as of strl_brick_run */
    uint32_t count;
    uint32_t level_count;
    uint32_t *cell[STRL_BRICK_LEVELS]; /* octants of level s + 1 */
    uint32_t cell_count[STRL_BRICK_LEVELS];
    uint32_t cell_capacity;        /* of each */
    float size[STRL_BRICK_LEVELS]; /* the largest of a level's cells, lattice units */
} brick_content;

void strl_bricks_deinit(strl_brick_set *set)
{
    strl__free(set->brick);
    strl__free(set->bytes.data);
    *set = (strl_brick_set){0};
}

/* ---- mesh */

typedef struct welding {
    const strl_octree *octree;
    const brick_content *content;
    uint32_t *slot; /* [mask + 1] vertex + 1 */
    uint32_t mask;
    const strl_soup_corner **corner; /* [vertices] */
    uint32_t *palette;               /* [vertices] of the model */
    uint32_t vertices;
    uint16_t (*triangle)[3];
} welding;

static bool same_vertex(const welding *weld, uint32_t vertex, const strl_soup_corner *corner, uint32_t palette)
{
    const strl_soup_corner *other = weld->corner[vertex];
    return memcmp(other->position, corner->position, sizeof corner->position) == 0 &&
           other->normal[0] == corner->normal[0] && other->normal[1] == corner->normal[1] &&
           other->colour == corner->colour && other->texcoord == corner->texcoord && weld->palette[vertex] == palette;
}

static uint16_t weld_corner(welding *weld, const strl_soup_corner *corner, uint32_t palette)
{
    uint64_t hash =
        strl__mix64(corner->position[0] ^ strl__mix64((uint64_t)corner->position[1] << 32 | corner->position[2]));
    uint64_t normal = (uint64_t)corner->normal[0] << 16 | corner->normal[1];
    hash = strl__mix64(hash ^ (normal << 32 | (corner->colour ^ corner->texcoord)));
    uint32_t at = (uint32_t)hash & weld->mask;
    while (weld->slot[at] && !same_vertex(weld, weld->slot[at] - 1, corner, palette))
        at = (at + 1) & weld->mask;
    if (!weld->slot[at]) {
        weld->corner[weld->vertices] = corner;
        weld->palette[weld->vertices] = palette;
        weld->slot[at] = ++weld->vertices;
    }
    return (uint16_t)(weld->slot[at] - 1);
}

static bool weld_all(welding *weld, strl_arena *arena)
{
    uint32_t count = weld->content->count;
    for (weld->mask = 63; weld->mask < 5 * count; weld->mask = 2 * weld->mask + 1)
        ;
    weld->slot = strl_arena_alloc_zero(arena, (size_t)weld->mask + 1, sizeof *weld->slot);
    weld->corner = strl_arena_alloc(arena, 3 * (size_t)count, sizeof *weld->corner);
    weld->palette = strl_arena_alloc(arena, 3 * (size_t)count, sizeof *weld->palette);
    weld->triangle = strl_arena_alloc(arena, count, sizeof *weld->triangle);
    if (!weld->slot || !weld->corner || !weld->palette || !weld->triangle)
        return false;
    for (uint32_t i = 0; i < count; i++) {
        const strl_soup_triangle *triangle = &weld->octree->triangle[weld->content->triangle[i]];
        for (int c = 0; c < 3; c++)
            weld->triangle[i][c] = weld_corner(weld, &triangle->corner[c], triangle->palette);
    }
    return true;
}

/* Palette entries in the order in which vertices need them. */
static bool make_palette(const welding *weld, strl_pm *pm, strl_arena *arena)
{
    uint32_t *known = strl_arena_alloc(arena, weld->vertices + 1, sizeof *known), last = 0;
    uint16_t *index = strl_arena_alloc(arena, weld->vertices + 1, sizeof *index);
    if (!known || !index)
        return false;
    pm->palette_count = 0;
    for (uint32_t v = 0; v < weld->vertices; v++) {
        if (v == 0 || known[last] != weld->palette[v]) {
            for (last = 0; last < pm->palette_count && known[last] != weld->palette[v]; last++)
                ;
            if (last == pm->palette_count)
                known[pm->palette_count++] = weld->palette[v];
        }
        index[v] = (uint16_t)last;
    }
    pm->palette_index = index;
    pm->palette = strl_arena_alloc(arena, pm->palette_count + 1, sizeof *pm->palette);
    for (uint32_t i = 0; pm->palette && i < pm->palette_count; i++)
        pm->palette[i] = weld->octree->ingest->palette[known[i]];
    return pm->palette != NULL;
}

/* Positions are relative to the least corner of their box; where all triangles have been drawn by cells above, it is a
 * point of theirs. */
static void set_box(const welding *weld, const int64_t alone[3], strl_node *record)
{
    for (int k = 0; k < 3; k++) {
        record->box_min[k] = INT64_MAX;
        record->box_max[k] = INT64_MIN;
    }
    for (uint32_t v = 0; v < weld->vertices; v++)
        for (int k = 0; k < 3; k++) {
            int64_t at = weld->corner[v]->position[k];
            record->box_min[k] = at < record->box_min[k] ? at : record->box_min[k];
            record->box_max[k] = at > record->box_max[k] ? at : record->box_max[k];
        }
    for (int k = 0; k < 3 && weld->vertices == 0; k++)
        record->box_min[k] = record->box_max[k] = alone[k];
    memcpy(record->anchor, record->box_min, sizeof record->anchor);
}

static bool make_mesh(const welding *weld, const strl_node *record, strl_pm *pm, strl_arena *arena)
{
    const strl_ingest *ingest = weld->octree->ingest;
    strl_pm palette = {0};
    if (!make_palette(weld, &palette, arena))
        return false;
    *pm = (strl_pm){.vertex_count = weld->vertices,
                    .triangle_count = weld->content->count,
                    .palette_count = palette.palette_count ? palette.palette_count : 1};
    if (!strl_pm_create(pm, ingest->has_colours, palette.palette_count > 1, ingest->has_texcoords, arena))
        return false;
    pm->palette[0] = (strl_palette_entry){.rgba = UINT32_MAX};
    memcpy(pm->palette, palette.palette, palette.palette_count * sizeof *pm->palette);
    for (uint32_t v = 0; v < weld->vertices; v++) {
        const strl_soup_corner *corner = weld->corner[v];
        for (int k = 0; k < 3; k++)
            pm->position[v][k] = (int32_t)(corner->position[k] - record->anchor[k]);
        memcpy(pm->normal[v], corner->normal, sizeof pm->normal[v]);
        pm->parent[v] = 0;
        if (pm->colour)
            pm->colour[v] = corner->colour;
        if (pm->texcoord)
            pm->texcoord[v] = corner->texcoord;
        if (pm->palette_index)
            pm->palette_index[v] = palette.palette_index[v];
    }
    memcpy(pm->triangle, weld->triangle, weld->content->count * sizeof *pm->triangle);
    pm->vertex_end[0] = pm->vertex_count;
    pm->triangle_end[0] = pm->triangle_count;
    pm->geometric_error[0] = ingest->leaf_error;
    pm->appearance_error[0] = 0;
    return true;
}

/* ---- splats */

static uint8_t to_byte(double share)
{
    return (uint8_t)lrint(255 * fmin(fmax(share, 0), 1));
}

static uint32_t splat_colour(const strl_splat_sums *sums)
{
    uint32_t rgba = (uint32_t)to_byte(sums->linear[3] / sums->area) << 24;
    for (int k = 0; k < 3; k++)
        rgba |= strl_srgb_encode((float)fmin(sums->linear[k] / sums->area, 1)) << 8 * k;
    return rgba;
}

static int encode_line(const double normal[3], float sign, const uint8_t near[2], uint8_t line[2])
{
    uint16_t code[2];
    int distance = 0;
    strl_oct_encode((const float[3]){sign * (float)normal[0], sign * (float)normal[1], sign * (float)normal[2]}, code);
    for (int k = 0; k < 2; k++) {
        line[k] = (uint8_t)((code[k] * 255u + STRL_OCT_MAX / 2) / STRL_OCT_MAX);
        distance += abs((int8_t)(uint8_t)(line[k] - near[k]));
    }
    return distance;
}

/* The sign means nothing: what costs less behind the splat before. */
static void set_line(const double normal[3], const uint8_t near[2], uint8_t line[2])
{
    uint8_t other[2];
    if (encode_line(normal, -1, near, other) < encode_line(normal, 1, near, line))
        memcpy(line, other, sizeof other);
}

static strl_splat make_splat(const strl_octree *octree, const strl_octant *octant, const int64_t anchor[3],
                             const uint8_t near[2])
{
    const strl_splat_sums *sums = &octant->sums;
    double side = strl_octree_side(octree->ingest, octant->depth), length = 0;
    strl_splat splat = {.side = (uint8_t)(octree->ingest->curve_shift + STRL_OCTREE_DEPTH - octant->depth),
                        .rgba = UINT32_MAX};
    bool has_area = sums->area > 0;
    for (int k = 0; k < 3; k++) {
        double centre = has_area ? sums->centre[k] / sums->area - (double)anchor[k] : 0;
        splat.centre[k] = strl_splat_place((int32_t)lrint(centre), splat.side);
        length += sums->normal[k] * sums->normal[k];
    }
    if (!has_area)
        return splat;
    set_line(sums->normal, near, splat.normal);
    double walls = sums->area / (side * side), parallel = sqrt(length) / sums->area;
    splat.parallel = to_byte(parallel);
    /* any direction, turned to one side, has half the length */
    splat.coverage = to_byte(strl_hidden_share(walls, walls, fmax(0, 2 * parallel - 1)));
    splat.rgba = splat_colour(sums);
    return splat;
}

static void find_centre(const strl_octree *octree, const strl_octant *octant, int64_t centre[3])
{
    double corner[3];
    strl_octree_corner(octree->ingest, octant->prefix, octant->depth, corner);
    for (int k = 0; k < 3; k++)
        centre[k] = (int64_t)(octant->sums.area > 0 ? octant->sums.centre[k] / octant->sums.area : corner[k]);
}

static float size_of(const strl_octree *octree, const strl_octant *octant)
{
    float side = (float)strl_octree_side(octree->ingest, octant->depth) * (float)STRL_SQUARE_OF_CUBE;
    return fmaxf(side, octant->extent);
}

/* ---- one brick */

/* Decoded, triangles come in another order. */
static strl_status set_runs(const brick_content *content, const strl_payload_order *order, strl_arena *arena,
                            strl_brick_head *head, strl_error *err)
{
    head->run = strl_arena_alloc(arena, content->count + 1, sizeof *head->run);
    head->run_count = 0;
    if (!head->run)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a brick of %u triangles", content->count);
    for (uint32_t t = 0; t < content->count; t++) {
        uint32_t level = content->level[order->triangle[t] / 4];
        if (head->run_count == 0 || head->run[head->run_count - 1].level != level)
            head->run[head->run_count++] = (strl_brick_run){level, 0};
        head->run[head->run_count - 1].count++;
    }
    return STRL_OK;
}

/* What a splat stands for may have moved up as a whole: the box of the brick's own triangles need not have it. */
static void widen_box(const strl_brick_head *head, strl_node *record)
{
    for (uint32_t i = 0; i < strl_brick_splats(head); i++)
        for (int k = 0; k < 3; k++) {
            int64_t at = record->anchor[k] + head->splat[i].centre[k];
            record->box_min[k] = at < record->box_min[k] ? at : record->box_min[k];
            record->box_max[k] = at > record->box_max[k] ? at : record->box_max[k];
        }
}

static strl_status set_splats(const strl_octree *octree, const brick_content *content, const int64_t anchor[3],
                              strl_arena *arena, strl_brick_head *head, strl_error *err)
{
    uint32_t count = 0;
    head->level_count = content->level_count;
    for (uint32_t s = 0; s < content->level_count; s++)
        count += content->cell_count[s];
    head->splat = strl_arena_alloc(arena, count, sizeof *head->splat);
    if (!head->splat)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %u splats", count);
    count = 0;
    for (uint32_t s = 0; s < content->level_count; s++) {
        for (uint32_t i = 0; i < content->cell_count[s]; i++, count++)
            head->splat[count] = make_splat(octree, &octree->octant[content->cell[s][i]], anchor,
                                            count ? head->splat[count - 1].normal : (const uint8_t[2]){0});
        head->splat_end[s] = count;
        head->error[s] = content->size[s];
    }
    return STRL_OK;
}

static strl_status encode(strl_brick_set *set, const strl_pm *pm, const brick_content *content, strl_brick_head *head,
                          strl_brick *brick, strl_arena *arena, strl_error *err)
{
    strl_payload_order order = {strl_arena_alloc(arena, pm->vertex_count + 1, sizeof *order.vertex),
                                strl_arena_alloc(arena, pm->triangle_count + 1, sizeof *order.triangle)};
    strl_writer mesh = {0};
    brick->payload_at = set->bytes.size;
    strl_status status =
        order.vertex && order.triangle
            ? strl_payload_encode(pm, NULL, arena, &mesh, &order, err)
            : strl__fail(err, STRL_ERR_MEMORY, "no memory for a brick of %u triangles", content->count);
    if (!status)
        status = set_runs(content, &order, arena, head, err);
    if (!status)
        status = strl_brick_head_write(head, &set->bytes, err);
    if (!status) {
        strl_writer_bytes(&set->bytes, mesh.data, mesh.size);
        brick->payload_bytes = (uint32_t)(set->bytes.size - brick->payload_at);
        if (set->bytes.failed)
            status = strl__fail(err, STRL_ERR_MEMORY, "no memory for bricks of %zu bytes", set->bytes.size);
    }
    strl__free(mesh.data);
    return status;
}

static strl_status push(strl_brick_set *set, const strl_brick *brick, uint32_t *index, strl_error *err)
{
    if (!strl__grow(&set->brick, &set->capacity, set->count + 1, sizeof *set->brick))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu bricks", set->count);
    *index = (uint32_t)set->count;
    set->brick[set->count++] = *brick;
    if (brick->parent != STRL_NO_BRICK)
        set->brick[brick->parent].child_count++;
    return STRL_OK;
}

static strl_brick start_brick(const strl_brick_set *set, uint32_t parent)
{
    return (strl_brick){
        .parent = parent, .depth = parent == STRL_NO_BRICK ? 0 : set->brick[parent].depth + 1, .chunk = STRL_NO_CHUNK};
}

/* Of the brick's own triangles. */
static bool set_cone(const welding *weld, strl_arena *arena, strl_cone *cone)
{
    uint32_t count = 0;
    double(*normal)[3] = strl_arena_alloc(arena, weld->content->count + 1, sizeof *normal);
    for (uint32_t i = 0; normal && i < weld->content->count; i++) {
        const strl_soup_corner *corner = weld->octree->triangle[weld->content->triangle[i]].corner;
        double edge[3], next[3];
        for (int k = 0; k < 3; k++) {
            edge[k] = (double)corner[1].position[k] - corner[0].position[k];
            next[k] = (double)corner[2].position[k] - corner[0].position[k];
        }
        count += strl_cone_normal(edge, next, normal[count]);
    }
    if (normal)
        *cone = strl_cone_around((const double(*)[3])normal, count);
    return normal != NULL;
}

/* Along the curve, whatever the level: what lies side by side is told by each other. */
static bool sort_triangles(const strl_octree *octree, const brick_content *content, strl_arena *arena)
{
    strl_keyed *keys = strl_arena_alloc(arena, content->count, sizeof *keys),
               *other = strl_arena_alloc(arena, content->count, sizeof *keys);
    if (!keys || !other)
        return false;
    for (uint32_t i = 0; i < content->count; i++)
        keys[i] =
            (strl_keyed){octree->key[content->triangle[i]], (uint64_t)content->triangle[i] << 8 | content->level[i]};
    strl__sort_keys(keys, other, content->count);
    for (uint32_t i = 0; i < content->count; i++) {
        content->triangle[i] = (uint32_t)(keys[i].index >> 8);
        content->level[i] = (uint8_t)keys[i].index;
    }
    return true;
}

static strl_status add_brick(strl_brick_set *set, const strl_octree *octree, const brick_content *content,
                             uint32_t parent, strl_arena *arena, uint32_t *index, strl_error *err)
{
    strl_arena_mark mark = strl_arena_get_mark(arena);
    strl_brick brick = start_brick(set, parent);
    strl_brick_head head = {0};
    int64_t alone[3] = {0};
    welding weld = {.octree = octree, .content = content};
    strl_pm pm;
    strl_status status =
        sort_triangles(octree, content, arena) && weld_all(&weld, arena)
            ? STRL_OK
            : strl__fail(err, STRL_ERR_MEMORY, "no memory for a brick of %u triangles", content->count);
    if (!status) {
        if (content->cell_count[0])
            find_centre(octree, &octree->octant[content->cell[0][0]], alone);
        set_box(&weld, alone, &brick.record);
        if (!make_mesh(&weld, &brick.record, &pm, arena) || !set_cone(&weld, arena, &brick.record.cone))
            status = strl__fail(err, STRL_ERR_MEMORY, "no memory for a brick of %u triangles", content->count);
    }
    if (!status)
        status = set_splats(octree, content, brick.record.anchor, arena, &head, err);
    if (!status) {
        widen_box(&head, &brick.record);
        status = encode(set, &pm, content, &head, &brick, arena, err);
    }
    strl_node *record = &brick.record;
    record->vertex_count = record->base_vertex_count = weld.vertices;
    record->triangle_count = record->base_triangle_count = content->count;
    record->geometric_min = record->geometric_max = record->group_geometric =
        fmaxf(head.error[0], octree->ingest->leaf_error);
    record->group_size = 1;
    record->rung = STRL_RUNG_SAMPLED;
    record->decode_parent = STRL_NONE;
    set->triangles += content->count;
    set->vertices += weld.vertices;
    strl_arena_rewind(arena, mark);
    return status ? status : push(set, &brick, index, err);
}

/* ---- what a brick holds */

static void gather(const strl_octree *octree, uint32_t child, uint32_t level, brick_content *content)
{
    const strl_octant *octant = &octree->octant[child];
    for (uint32_t i = 0; i < octant->item_count; i++) {
        uint32_t at = octree->item[octant->first_item + i].triangle;
        if (octree->owner[at] != child)
            continue;
        content->triangle[content->count] = at;
        content->level[content->count++] = (uint8_t)level;
    }
}

/* What the children of an octant at `level` store, and with is_whole all that is below them. */
static void gather_children(const strl_octree *octree, const strl_octant *octant, uint32_t level, bool is_whole,
                            brick_content *content)
{
    /* Large triangles first: they are drawn as soon as the brick is. */
    for (uint32_t i = 0; i < octant->child_count; i++)
        if (octree->octant[octant->child[i]].is_large)
            gather(octree, octant->child[i], level, content);
    for (uint32_t i = 0; i < octant->child_count; i++) {
        const strl_octant *child = &octree->octant[octant->child[i]];
        if (child->is_large)
            continue;
        content->level_count = level + 1 > content->level_count ? level + 1 : content->level_count;
        content->cell[level][content->cell_count[level]++] = octant->child[i];
        content->size[level] = fmaxf(content->size[level], size_of(octree, child));
        gather(octree, octant->child[i], level + 1, content);
        if (is_whole)
            gather_children(octree, child, level + 1, is_whole, content);
    }
}

static void count_below(const strl_octree *octree, const strl_octant *octant, bool is_whole, uint32_t *items,
                        uint32_t *cells)
{
    for (uint32_t i = 0; i < octant->child_count; i++) {
        const strl_octant *child = &octree->octant[octant->child[i]];
        *items += child->item_count;
        (*cells)++;
        if (is_whole)
            count_below(octree, child, is_whole, items, cells);
    }
}

/* ---- the preview */

uint32_t strl_preview_depth(const strl_ingest *ingest)
{
    uint32_t depth = ingest->curve_spare + STRL_PREVIEW_DEPTH;
    return depth < STRL_OCTREE_DEPTH ? depth : STRL_OCTREE_DEPTH;
}

/* How many cells a cut through the octree at `depth` has; with content they become those of `level`. */
static uint32_t cut_cells(const strl_octree *octree, uint32_t index, uint32_t depth, uint32_t level,
                          brick_content *content)
{
    const strl_octant *octant = &octree->octant[index];
    uint32_t count = 0;
    if (octant->depth < depth)
        for (uint32_t i = 0; i < octant->child_count; i++)
            count += cut_cells(octree, octant->child[i], depth, level, content);
    if (count)
        return count;
    if (content) {
        content->cell[level][content->cell_count[level]++] = index;
        content->size[level] = fmaxf(content->size[level], size_of(octree, octant));
    }
    return 1;
}

/* The second level of the first brick. Large triangles are in no splat but that of their cell. */
static strl_status add_preview(const strl_octree *octree, uint32_t root, strl_arena *arena, brick_content *content,
                               strl_error *err)
{
    uint32_t count = 0, depth = strl_preview_depth(octree->ingest) + 1;
    while (depth > octree->octant[root].depth && (count == 0 || count >= STRL_BRICK_SPLATS))
        count = cut_cells(octree, root, --depth, 0, NULL);
    if (octree->octant[root].is_leaf || depth <= octree->octant[root].depth)
        return STRL_OK;
    content->cell[content->level_count] = strl_arena_alloc(arena, count, sizeof **content->cell);
    if (!content->cell[content->level_count])
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %u cells", count);
    cut_cells(octree, root, depth, content->level_count++, content);
    return STRL_OK;
}

static strl_status find_content(const strl_octree *octree, const strl_octant *octant, bool is_whole, strl_arena *arena,
                                brick_content *content, strl_error *err)
{
    uint32_t items = 0;
    *content = (brick_content){.level_count = 1};
    count_below(octree, octant, is_whole, &items, &content->cell_capacity);
    content->triangle = strl_arena_alloc(arena, items + 1, sizeof *content->triangle);
    content->level = strl_arena_alloc(arena, items + 1, sizeof *content->level);
    bool good = content->triangle && content->level;
    for (uint32_t s = 0; s < (is_whole ? STRL_BRICK_LEVELS : 1) && good; s++) {
        content->cell[s] = strl_arena_alloc(arena, content->cell_capacity, sizeof *content->cell[s]);
        good = content->cell[s] != NULL;
    }
    if (!good)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a cell of %u triangles", items);
    gather_children(octree, octant, 0, is_whole, content);
    return STRL_OK;
}

/* ---- the bricks of a cell */

/* A part of it, from its front. */
static brick_content cut_front(brick_content *whole)
{
    brick_content front = *whole;
    front.count = whole->count < STRL_BRICK_TRIANGLES ? whole->count : STRL_BRICK_TRIANGLES;
    whole->triangle += front.count;
    whole->level += front.count;
    whole->count -= front.count;
    return front;
}

/* Large triangles that go to bricks below open these while they are longer than the allowed error, as cells do. */
static void open_for_large(const strl_octree *octree, const brick_content *left, brick_content *front)
{
    for (uint32_t i = 0; i < left->count && left->level[i] == 0; i++)
        front->size[0] = fmaxf(front->size[0], strl_octree_extent(&octree->triangle[left->triangle[i]]));
}

/* Too much for one brick: some leaves beside the next one, which goes on in the same way. The splats are with those
 * that have something below. *parent: the last. */
static strl_status add_beside(strl_brick_set *set, const strl_octree *octree, brick_content *whole, uint32_t *parent,
                              strl_arena *arena, strl_error *err)
{
    brick_content front = cut_front(whole);
    uint32_t leaf;
    open_for_large(octree, whole, &front);
    strl_status status = add_brick(set, octree, &front, *parent, arena, parent, err);
    for (uint32_t i = 0; i < LEAVES_BESIDE && whole->count > STRL_BRICK_TRIANGLES && !status; i++) {
        front = cut_front(whole);
        memset(front.cell_count, 0, sizeof front.cell_count);
        status = add_brick(set, octree, &front, *parent, arena, &leaf, err);
    }
    return status;
}

static strl_status add_place(strl_brick_set *set, uint32_t chunk, uint32_t parent, strl_error *err)
{
    strl_brick place = start_brick(set, parent);
    uint32_t index;
    place.chunk = chunk;
    return push(set, &place, &index, err);
}

strl_status strl_bricks_add(strl_brick_set *set, const strl_octree *octree, uint32_t index, uint32_t parent,
                            strl_arena *arena, strl_error *err)
{
    const strl_octant *octant = &octree->octant[index];
    strl_arena_mark mark = strl_arena_get_mark(arena);
    bool is_whole = octant->total <= COMPACT_TRIANGLES && !octree->has_pieces;
    brick_content content;
    uint32_t brick = parent;
    if (octant->chunk != STRL_NO_CHUNK)
        return add_place(set, octant->chunk, parent, err);
    strl_status status = find_content(octree, octant, is_whole, arena, &content, err);
    while (!status && content.count > STRL_BRICK_TRIANGLES)
        status = add_beside(set, octree, &content, &brick, arena, err);
    if (!status)
        status = add_brick(set, octree, &content, brick, arena, &brick, err);
    strl_arena_rewind(arena, mark);
    for (uint32_t i = 0; i < octant->child_count && !status && !is_whole; i++)
        if (!octree->octant[octant->child[i]].is_leaf)
            status = strl_bricks_add(set, octree, octant->child[i], brick, arena, err);
    return status;
}

strl_status strl_bricks_add_root(strl_brick_set *set, const strl_octree *octree, uint32_t root, strl_arena *arena,
                                 strl_error *err)
{
    strl_octant above = {.child_count = 1, .child = {root}};
    strl_arena_mark mark = strl_arena_get_mark(arena);
    brick_content content;
    uint32_t brick;
    strl_status status = find_content(octree, &above, false, arena, &content, err);
    if (!status)
        status = add_preview(octree, root, arena, &content, err);
    if (!status)
        status = add_brick(set, octree, &content, STRL_NO_BRICK, arena, &brick, err);
    strl_arena_rewind(arena, mark);
    return status;
}

void strl_bricks_close(strl_brick_set *set)
{
    for (size_t i = set->count; i-- > 0;) {
        strl_node *record = &set->brick[i].record;
        memcpy(record->group_box_min, record->box_min, sizeof record->box_min);
        memcpy(record->group_box_max, record->box_max, sizeof record->box_max);
        if (set->brick[i].parent == STRL_NO_BRICK)
            continue;
        strl_node *above = &set->brick[set->brick[i].parent].record;
        for (int k = 0; k < 3; k++) {
            above->box_min[k] = record->box_min[k] < above->box_min[k] ? record->box_min[k] : above->box_min[k];
            above->box_max[k] = record->box_max[k] > above->box_max[k] ? record->box_max[k] : above->box_max[k];
        }
        above->cone = strl_cone_join(&above->cone, &record->cone);
        above->group_geometric = fmaxf(above->group_geometric, record->group_geometric);
        above->geometric_min = above->geometric_max = above->group_geometric;
    }
}
