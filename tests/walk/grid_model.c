#include "walk/grid_model.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "base/hash.h"
#include "base/memory.h"
#include "container/writer.h"
#include "geometry/payload.h"
#include "geometry/record.h"
#include "geometry/simplify.h"

#define SIDE (GRID_QUADS + 1)
#define VERTICES (SIDE * SIDE)
#define TRIANGLES (2 * GRID_QUADS * GRID_QUADS)
#define NOBODY UINT32_MAX
#define SHARED (UINT32_MAX - 1)

typedef struct triangle {
    uint32_t corner[3]; /* grid vertices */
    uint32_t owner;     /* node index within the level */
    strl_drift drift;
    float deviation, shift;
} triangle;

typedef struct built_node {
    strl_node record;
    uint8_t *payload;
    uint32_t payload_bytes;
} built_node;

typedef struct builder {
    triangle *triangles; /* of the level in work */
    uint32_t triangle_count;
    uint32_t owner[VERTICES]; /* node that alone has the vertex, SHARED or NOBODY */
    uint32_t local[VERTICES]; /* index in the mesh in work */
    uint32_t groups;          /* so far, over all levels */
    built_node nodes[GRID_NODES];
    strl_arena arena;
} builder;

static const strl_palette_entry palette = {0, 0, 0xffffffffu};

static bool on_rim(uint32_t vertex)
{
    uint32_t x = vertex % SIDE, y = vertex / SIDE;
    return x == 0 || y == 0 || x == GRID_QUADS || y == GRID_QUADS;
}

static int32_t height(uint32_t vertex)
{
    int32_t x = (int32_t)(vertex % SIDE), y = (int32_t)(vertex / SIDE);
    int32_t hill = 6000 - (x - 40) * (x - 40) * 3 - (y - 50) * (y - 50) * 2;
    return (hill > 0 ? hill : 0) + (int32_t)(strl__mix64(vertex) % 700);
}

static void position_of(uint32_t vertex, int64_t position[3])
{
    position[0] = (int64_t)(vertex % SIDE) * GRID_SPACING;
    position[1] = (int64_t)(vertex / SIDE) * GRID_SPACING;
    position[2] = height(vertex);
}

uint32_t grid_vertex_at(const int64_t position[3])
{
    int64_t x = position[0] / GRID_SPACING, y = position[1] / GRID_SPACING;
    if (position[0] % GRID_SPACING || position[1] % GRID_SPACING || x < 0 || y < 0 || x > GRID_QUADS || y > GRID_QUADS)
        return UINT32_MAX;
    uint32_t vertex = (uint32_t)(y * SIDE + x);
    return position[2] == height(vertex) ? vertex : UINT32_MAX;
}

/* Bit by bit from the root: x, y, x, ... */
static uint32_t leaf_of(uint32_t x, uint32_t y)
{
    uint32_t leaf = 0, low[2] = {0, 0}, high[2] = {GRID_QUADS, GRID_QUADS}, at[2] = {x, y};
    for (unsigned bit = 0; bit < GRID_DEPTH; bit++) {
        unsigned axis = bit & 1;
        uint32_t middle = (low[axis] + high[axis]) / 2;
        leaf = 2 * leaf + (at[axis] >= middle);
        *(at[axis] >= middle ? &low[axis] : &high[axis]) = middle;
    }
    return leaf;
}

static void make_leaves(builder *b)
{
    for (uint32_t y = 0; y < GRID_QUADS; y++)
        for (uint32_t x = 0; x < GRID_QUADS; x++) {
            uint32_t v = y * SIDE + x, leaf = leaf_of(x, y);
            const uint32_t corners[2][3] = {{v, v + 1, v + SIDE + 1}, {v, v + SIDE + 1, v + SIDE}};
            for (unsigned k = 0; k < 2; k++) {
                triangle *t = &b->triangles[b->triangle_count++];
                memcpy(t->corner, corners[k], sizeof t->corner);
                t->owner = leaf;
                t->drift = (strl_drift){0};
                t->deviation = t->shift = 0;
            }
        }
}

static void find_owners(builder *b)
{
    memset(b->owner, 0xff, sizeof b->owner);
    for (uint32_t t = 0; t < b->triangle_count; t++)
        for (unsigned k = 0; k < 3; k++) {
            uint32_t *owner = &b->owner[b->triangles[t].corner[k]];
            *owner = *owner == NOBODY || *owner == b->triangles[t].owner ? b->triangles[t].owner : SHARED;
        }
}

/* ---- pieces of the level as meshes */

typedef struct piece {
    strl_mesh mesh;
    uint32_t *source; /* per triangle: index in the level */
    uint32_t *vertex; /* per point: grid vertex */
} piece;

/* The triangles of nodes [first, end), every point kept. */
static piece take_piece(builder *b, uint32_t first, uint32_t end)
{
    piece p = {.source = strl_arena_alloc(&b->arena, TRIANGLES, sizeof(uint32_t)),
               .vertex = strl_arena_alloc(&b->arena, VERTICES, sizeof(uint32_t))};
    uint32_t triangles = 0, points = 0;
    memset(b->local, 0xff, sizeof b->local);
    for (uint32_t t = 0; t < b->triangle_count; t++) {
        if (b->triangles[t].owner < first || b->triangles[t].owner >= end)
            continue;
        p.source[triangles++] = t;
        for (unsigned k = 0; k < 3; k++)
            if (b->local[b->triangles[t].corner[k]] == NOBODY) {
                p.vertex[points] = b->triangles[t].corner[k];
                b->local[b->triangles[t].corner[k]] = points++;
            }
    }
    assert_true(strl_mesh_create(&p.mesh, points, points, triangles, &b->arena));
    p.mesh.start_error = 0.9f; /* half a cell's diagonal */
    for (uint32_t v = 0; v < points; v++) {
        int64_t position[3];
        position_of(p.vertex[v], position);
        for (unsigned i = 0; i < 3; i++)
            p.mesh.position[v][i] = (int32_t)position[i];
        p.mesh.flags[v] = STRL_POINT_KEPT;
        p.mesh.wedge[v] =
            (strl_wedge){v, {512, 512}, 0xff000000u | (uint32_t)strl__mix64(p.vertex[v]) % 0xffffffu, 0, 0};
    }
    for (uint32_t i = 0; i < triangles; i++) {
        const triangle *t = &b->triangles[p.source[i]];
        for (unsigned k = 0; k < 3; k++)
            p.mesh.triangle[i][k] = b->local[t->corner[k]];
        p.mesh.drift[i] = t->drift, p.mesh.deviation[i] = t->deviation, p.mesh.shift[i] = t->shift;
    }
    return p;
}

static strl_simplified simplify(builder *b, const piece *p, uint32_t target)
{
    const strl_simplify_desc desc = {
        .target_triangles = target, .error_limit = INFINITY, .last_rung = STRL_SIMPLIFY_TOPOLOGY};
    strl_simplified done;
    strl_error err = {0};
    if (strl_simplify(&p->mesh, &desc, &b->arena, &done, &err) != STRL_OK)
        fail_msg("%s", err.message);
    return done;
}

/* The simplified piece takes the place of its triangles in the level. */
static void put_back(builder *b, const piece *p, const strl_simplified *done)
{
    for (uint32_t i = 0; i < p->mesh.triangle_count; i++) {
        triangle *t = &b->triangles[p->source[i]];
        if (done->removed_at[i] != UINT32_MAX) {
            t->owner = NOBODY;
            continue;
        }
        for (unsigned k = 0; k < 3; k++)
            t->corner[k] = p->vertex[p->mesh.wedge[done->corner[i][k]].point];
        t->drift = done->drift[i], t->deviation = done->deviation[i], t->shift = done->shift[i];
    }
}

static void compact(builder *b)
{
    uint32_t kept = 0;
    for (uint32_t t = 0; t < b->triangle_count; t++)
        if (b->triangles[t].owner != NOBODY)
            b->triangles[kept++] = b->triangles[t];
    b->triangle_count = kept;
}

/* ---- levels */

/* Simplifies the boundary inside a group before its members' meshes are made. */
static uint32_t simplify_boundary(builder *b, uint32_t first, uint32_t end)
{
    strl_arena_mark mark = strl_arena_get_mark(&b->arena);
    piece p = take_piece(b, first, end);
    /* A vertex that only members share: in the piece all its triangles, outside of it none. */
    uint32_t *uses = strl_arena_alloc_zero(&b->arena, VERTICES, sizeof *uses);
    for (uint32_t t = 0; t < b->triangle_count; t++)
        for (unsigned k = 0; k < 3; k++)
            uses[b->triangles[t].corner[k]]++;
    for (uint32_t i = 0; i < p.mesh.triangle_count; i++)
        for (unsigned k = 0; k < 3; k++)
            uses[p.vertex[p.mesh.triangle[i][k]]]--;
    for (uint32_t v = 0; v < p.mesh.point_count; v++)
        if (b->owner[p.vertex[v]] == SHARED && uses[p.vertex[v]] == 0 && !on_rim(p.vertex[v]))
            p.mesh.flags[v] = 0;
    strl_simplified done = simplify(b, &p, 0);
    put_back(b, &p, &done);
    compact(b);
    strl_arena_rewind(&b->arena, mark);
    return done.collapse_count;
}

static uint32_t group_end(uint32_t level, uint32_t first, uint32_t count)
{
    if (level == 0)
        return first + 1;
    uint32_t size = 1 + (uint32_t)(strl__mix64(level * 1000 + first) % 3);
    return first + size < count ? first + size : count;
}

static void include_box(int64_t low[3], int64_t high[3], const int64_t other_low[3], const int64_t other_high[3])
{
    for (unsigned i = 0; i < 3; i++) {
        low[i] = other_low[i] < low[i] ? other_low[i] : low[i];
        high[i] = other_high[i] > high[i] ? other_high[i] : high[i];
    }
}

/* Encodes node `index` of the level and leaves its base mesh in its place. */
static void make_node(builder *b, uint32_t level, uint32_t index)
{
    uint32_t id = (GRID_LEAVES >> level) - 1 + index;
    strl_node *record = &b->nodes[id].record;
    strl_arena_mark mark = strl_arena_get_mark(&b->arena);
    piece p = take_piece(b, index, index + 1);
    for (unsigned i = 0; i < 3; i++)
        record->box_min[i] = INT64_MAX, record->box_max[i] = INT64_MIN;
    for (uint32_t v = 0; v < p.mesh.point_count; v++) {
        int64_t at[3];
        position_of(p.vertex[v], at);
        include_box(record->box_min, record->box_max, at, at);
        if (b->owner[p.vertex[v]] != SHARED && !on_rim(p.vertex[v]))
            p.mesh.flags[v] = 0;
        else
            record->shared_vertices++;
    }
    strl_simplified done = simplify(b, &p, p.mesh.triangle_count / 2);
    strl_pm pm;
    strl_error err = {0};
    strl_writer payload = {0};
    for (unsigned i = 0; i < 3; i++)
        record->anchor[i] = record->box_min[i];
    for (uint32_t v = 0; v < p.mesh.point_count; v++)
        for (unsigned i = 0; i < 3; i++)
            p.mesh.position[v][i] -= (int32_t)record->anchor[i];
    if (strl_pm_record(&p.mesh, &done, &palette, 1, &b->arena, &pm, &err) != STRL_OK ||
        strl_payload_encode(&pm, NULL, &b->arena, &payload, NULL, &err) != STRL_OK)
        fail_msg("%s", err.message);
    b->nodes[id].payload = payload.data;
    b->nodes[id].payload_bytes = (uint32_t)payload.size;
    record->vertex_count = pm.vertex_count, record->base_vertex_count = pm.vertex_end[0];
    record->triangle_count = pm.triangle_count, record->base_triangle_count = pm.triangle_end[0];
    record->step_count = pm.step_count;
    record->geometric_min = pm.geometric_error[pm.step_count], record->geometric_max = pm.geometric_error[0];
    record->appearance_min = pm.appearance_error[pm.step_count], record->appearance_max = pm.appearance_error[0];
    put_back(b, &p, &done);
    strl_arena_rewind(&b->arena, mark);
}

static void link_node(builder *b, uint32_t level, uint32_t index)
{
    uint32_t id = (GRID_LEAVES >> level) - 1 + index;
    strl_node *record = &b->nodes[id].record;
    record->parent = id == 0 ? STRL_NONE : (id - 1) / 2;
    record->first_child = level == 0 ? STRL_NONE : 2 * id + 1;
    record->child_count = level == 0 ? 0 : 2;
    record->level = level;
    record->decode_parent = STRL_NONE;
    for (uint32_t k = 0; k < record->child_count; k++) {
        const strl_node *child = &b->nodes[2 * id + 1 + k].record;
        include_box(record->box_min, record->box_max, child->box_min, child->box_max);
    }
}

/* Group [first, end) of the level: errors and boxes that hold those of all groups of the members'
 * children. */
static void make_group(builder *b, uint32_t level, uint32_t first, uint32_t end, uint32_t boundary_steps)
{
    uint32_t base = (GRID_LEAVES >> level) - 1;
    strl_node sum = b->nodes[base + first].record;
    memcpy(sum.group_box_min, sum.box_min, sizeof sum.box_min);
    memcpy(sum.group_box_max, sum.box_max, sizeof sum.box_max);
    sum.group_geometric = sum.group_appearance = 0;
    for (uint32_t index = first; index < end; index++) {
        const strl_node *record = &b->nodes[base + index].record;
        include_box(sum.group_box_min, sum.group_box_max, record->box_min, record->box_max);
        sum.group_geometric = fmaxf(sum.group_geometric, record->geometric_min);
        sum.group_appearance = fmaxf(sum.group_appearance, record->appearance_min);
        for (uint32_t k = 0; k < record->child_count; k++) {
            const strl_node *child = &b->nodes[record->first_child + k].record;
            include_box(sum.group_box_min, sum.group_box_max, child->group_box_min, child->group_box_max);
            sum.group_geometric = fmaxf(sum.group_geometric, child->group_geometric);
            sum.group_appearance = fmaxf(sum.group_appearance, child->group_appearance);
        }
    }
    for (uint32_t index = first; index < end; index++) {
        strl_node *record = &b->nodes[base + index].record;
        record->group = b->groups;
        record->group_size = end - first;
        record->boundary_steps = boundary_steps;
        record->group_geometric = sum.group_geometric, record->group_appearance = sum.group_appearance;
        memcpy(record->group_box_min, sum.group_box_min, sizeof sum.group_box_min);
        memcpy(record->group_box_max, sum.group_box_max, sizeof sum.group_box_max);
    }
    b->groups++;
}

static void make_level(builder *b, uint32_t level)
{
    uint32_t count = GRID_LEAVES >> level, steps[GRID_LEAVES];
    find_owners(b);
    for (uint32_t first = 0; first < count; first = group_end(level, first, count)) {
        uint32_t end = group_end(level, first, count);
        steps[first] = end - first > 1 ? simplify_boundary(b, first, end) : 0;
    }
    find_owners(b);
    for (uint32_t index = 0; index < count; index++) {
        make_node(b, level, index);
        link_node(b, level, index);
    }
    for (uint32_t first = 0; first < count; first = group_end(level, first, count))
        make_group(b, level, first, group_end(level, first, count), steps[first]);
    compact(b);
    for (uint32_t t = 0; t < b->triangle_count; t++)
        b->triangles[t].owner /= 2;
}

/* ---- the file */

static void must(strl_status status, const strl_error *err)
{
    if (status != STRL_OK)
        fail_msg("%s", err->message);
}

static void write_model(const builder *b, const char *folder, const char *path, unsigned placements)
{
    strl_error err = {0};
    strl_container_writer *writer = NULL;
    uint64_t bytes;
    const strl_container_writer_desc desc = {.path = path, .scratch_dir = folder, .info = {.unit = "m", .up_axis = 2}};
    const strl_tree tree = {.structure = STRL_STRUCTURE_CLUSTERS,
                            .step = GRID_STEP,
                            .node_count = GRID_NODES,
                            .level_count = GRID_DEPTH + 1,
                            .leaf_geometric = 0.9f};
    const strl_placement placed[2] = {{.transform = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}},
                                      {.transform = {0, -0.5, 0, -20, 0.5, 0, 0, 0, 0, 0, 0.5, 3}}};
    must(strl_container_writer_create(&desc, &writer, &err), &err);
    must(strl_container_writer_begin_tree(writer, &tree, &err), &err);
    for (uint32_t id = 0; id < GRID_NODES; id++)
        must(strl_container_writer_add_node(writer, &b->nodes[id].record, b->nodes[id].payload,
                                            b->nodes[id].payload_bytes, &err),
             &err);
    must(strl_container_writer_end_tree(writer, &err), &err);
    for (unsigned i = 0; i < placements; i++)
        must(strl_container_writer_add_placement(writer, &placed[i], &err), &err);
    must(strl_container_writer_finish(writer, &bytes, &err), &err);
    strl_container_writer_destroy(writer);
}

static uint8_t *read_all(const char *path, size_t *size)
{
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    assert_int_equal(fseek(file, 0, SEEK_END), 0);
    *size = (size_t)ftell(file);
    rewind(file);
    uint8_t *data = strl__alloc(*size, 1);
    assert_non_null(data);
    assert_int_equal(fread(data, 1, *size, file), *size);
    fclose(file);
    return data;
}

uint8_t *grid_model_create(unsigned placements, size_t *size)
{
    builder *b = strl__alloc_zero(1, sizeof *b);
    b->triangles = strl__alloc(TRIANGLES, sizeof *b->triangles);
    strl_arena_init(&b->arena, 0);
    make_leaves(b);
    for (uint32_t level = 0; level <= GRID_DEPTH; level++)
        make_level(b, level);
    char folder[] = "/tmp/stroll-walk-XXXXXX", path[64];
    assert_non_null(mkdtemp(folder));
    snprintf(path, sizeof path, "%s/grid.stroll", folder);
    write_model(b, folder, path, placements);
    uint8_t *data = read_all(path, size);
    unlink(path);
    rmdir(folder);
    for (uint32_t id = 0; id < GRID_NODES; id++)
        strl__free(b->nodes[id].payload);
    strl_arena_deinit(&b->arena);
    strl__free(b->triangles);
    strl__free(b);
    return data;
}
