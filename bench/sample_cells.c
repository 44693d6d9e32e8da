#include "sample_cells.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

#define KEY_BITS 21u /* of an axis */
#define NO_SIDE 64u

/* ---- from bricks to triangles, each with the cell that stores it */

static uint64_t key_of(const model *m, const int64_t at[3])
{
    uint64_t key = 0;
    for (int k = 0; k < 3; k++)
        for (unsigned bit = 0; bit < KEY_BITS; bit++)
            key |= ((uint64_t)at[k] >> m->shift >> bit & 1) << (3 * bit + (unsigned)k);
    return key;
}

static bool has(const cell *c, const int64_t at[3])
{
    return at[0] >> c->side == c->at[0] && at[1] >> c->side == c->at[1] && at[2] >> c->side == c->at[2];
}

/* The cell of [first, end) that has the point; NULL = none. */
static const cell *cell_at(const model *m, size_t first, size_t end, const int64_t at[3])
{
    for (size_t i = first; i < end; i++)
        if (has(&m->cells[i], at))
            return &m->cells[i];
    return NULL;
}

static bool add_cells(model *m, const strl_node *node, const strl_brick_head *head, brick *to)
{
    uint32_t levels = node->parent == STRL_NONE ? 1 : head->level_count; /* behind it the first brick has a preview */
    uint32_t splats = head->splat_end[levels - 1], level = 0;
    if (!strl__grow(&m->cells, &m->cell_capacity, m->cell_count + splats, sizeof *m->cells))
        return false;
    to->levels = levels;
    for (uint32_t i = 0; i <= splats; i++) {
        while (level < levels && (level == 0 ? 0 : head->splat_end[level - 1]) <= i)
            to->first[level++] = m->cell_count;
        if (i == splats)
            break;
        cell *c = &m->cells[m->cell_count++];
        c->side = head->splat[i].side;
        for (int k = 0; k < 3; k++)
            c->at[k] = (node->anchor[k] + head->splat[i].centre[k]) >> c->side;
    }
    to->first[levels] = m->cell_count;
    return true;
}

/* The children of which cell a brick holds. One that goes on with a brick too full for its triangles has cells of the
 * same place. */
static uint32_t owner_of(const model *m, const brick *above, const brick *own, const int64_t at[3])
{
    const cell *first = &m->cells[own->first[0]];
    bool is_empty = own->first[0] == own->first[own->levels];
    const cell *below = cell_at(m, above->first[0], above->first[1], at);
    if (!below || (!is_empty && below->side == first->side && memcmp(below->at, first->at, sizeof first->at) == 0))
        return above->owner;
    return below->side;
}

static void centroid(const face *f, int64_t at[3])
{
    for (int k = 0; k < 3; k++)
        at[k] = ((int64_t)f->corner[0][k] + f->corner[1][k] + f->corner[2][k]) / 3;
}

static bool add_faces(model *m, const strl_node *node, const strl_pm *mesh, const uint8_t *levels, uint32_t id)
{
    brick *own = &m->bricks[id];
    const brick *above = id ? &m->bricks[node->parent] : NULL;
    const brick *cells = above && own->first[0] == own->first[own->levels] ? above : own; /* a leaf beside has none */
    if (!strl__grow(&m->faces, &m->face_capacity, m->face_count + mesh->triangle_count, sizeof *m->faces))
        return false;
    own->owner = NO_SIDE;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        face *f = &m->faces[m->face_count++];
        int64_t at[3];
        for (int c = 0; c < 3; c++)
            for (int k = 0; k < 3; k++)
                f->corner[c][k] = (int32_t)(node->anchor[k] + mesh->position[mesh->triangle[t][c]][k]);
        centroid(f, at);
        f->key = key_of(m, at);
        if (t == 0 && above)
            own->owner = owner_of(m, above, own, at);
        uint32_t level = levels[t];
        const cell *storing =
            level && level <= cells->levels ? cell_at(m, cells->first[level - 1], cells->first[level], at) : NULL;
        m->lost += level && !storing;
        f->stored = storing ? storing->side : own->owner;
    }
    return true;
}

static strl_status load_node(model *m, uint32_t id, strl_arena *arena, strl_error *err)
{
    strl_node node;
    strl_brick_head head;
    strl_pm mesh;
    uint8_t *levels = NULL;
    strl_status status = strl_container_node(m->container, 0, id, &node, err);
    uint8_t *page = status ? NULL : strl_arena_alloc(arena, node.page.bytes, 1);
    if (!status && !page)
        status = STRL_ERR_MEMORY;
    if (!status)
        status = strl_source_read(strl_container_source(m->container), node.page.offset, page, node.page.bytes, err);
    if (!status)
        status = strl_page_mesh(&node, page, node.page.bytes, NULL, arena, &head, &mesh, err);
    if (!status)
        levels = strl_arena_alloc(arena, mesh.triangle_count + 1, 1);
    if (!status && !levels)
        status = STRL_ERR_MEMORY;
    for (uint32_t i = 0, t = 0; !status && i < head.run_count; t += head.run[i++].count)
        memset(levels + t, (int)head.run[i].level, head.run[i].count);
    if (!status && !(add_cells(m, &node, &head, &m->bricks[id]) && add_faces(m, &node, &mesh, levels, id)))
        status = STRL_ERR_MEMORY;
    return status;
}

static int by_key(const void *a, const void *b)
{
    const face *x = a, *y = b;
    return x->key < y->key ? -1 : x->key > y->key;
}

static int by_place(const void *a, const void *b)
{
    const cell *x = a, *y = b;
    if (x->side != y->side)
        return x->side < y->side ? -1 : 1;
    for (int k = 0; k < 3; k++)
        if (x->at[k] != y->at[k])
            return x->at[k] < y->at[k] ? -1 : 1;
    return 0;
}

strl_status load_model(model *m, strl_error *err)
{
    strl_arena arena = {0};
    strl_status status = STRL_OK;
    m->tree = strl_container_tree(m->container, 0);
    if (!m->tree || m->tree->structure != STRL_STRUCTURE_SAMPLES) {
        snprintf(err->message, sizeof err->message, "its first tree is none of samples");
        return STRL_ERR_ARGUMENT;
    }
    for (int k = 0; k < 3; k++) {
        if (m->tree->box_min[k] < 0 || m->tree->box_max[k] > INT32_MAX) {
            snprintf(err->message, sizeof err->message, "its lattice passes 31 bits");
            return STRL_ERR_ARGUMENT;
        }
        while (m->tree->box_max[k] >> m->shift >> KEY_BITS)
            m->shift++;
    }
    m->bricks = strl__alloc_zero(m->tree->node_count, sizeof *m->bricks);
    if (!m->bricks)
        status = STRL_ERR_MEMORY;
    for (uint32_t id = 0; id < m->tree->node_count && !status; id++) {
        strl_arena_mark mark = strl_arena_get_mark(&arena);
        status = load_node(m, id, &arena, err);
        strl_arena_rewind(&arena, mark);
    }
    strl_arena_deinit(&arena);
    if (status)
        return status;
    qsort(m->faces, m->face_count, sizeof *m->faces, by_key);
    qsort(m->cells, m->cell_count, sizeof *m->cells, by_place);
    size_t count = 0;
    for (size_t i = 0; i < m->cell_count; i++)
        if (count == 0 || by_place(&m->cells[count - 1], &m->cells[i]))
            m->cells[count++] = m->cells[i];
    m->cell_count = count;
    return STRL_OK;
}

/* ---- the content of a cell */

void content_deinit(content *c)
{
    for (int k = 0; k < 3; k++) {
        strl__free(c->at[k]);
        strl__free(c->image[k]);
    }
    strl__free(c->drawn);
    strl__free(c->drawn_face);
    *c = (content){0};
}

static bool make_room(content *c, size_t count)
{
    if (count <= c->capacity)
        return true;
    content_deinit(c);
    bool good = true;
    for (int k = 0; k < 3; k++) {
        c->at[k] = strl__alloc(3 * count, sizeof *c->at[k]);
        c->image[k] = strl__alloc(3 * count, sizeof *c->image[k]);
        good = good && c->at[k] && c->image[k];
    }
    c->drawn = strl__alloc(count, sizeof *c->drawn);
    c->drawn_face = strl__alloc(count, sizeof *c->drawn_face);
    c->capacity = good && c->drawn && c->drawn_face ? count : 0;
    return c->capacity != 0;
}

static size_t lower_bound(const model *m, uint64_t key)
{
    size_t low = 0, high = m->face_count;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (m->faces[middle].key < key)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* False where the cell is smaller than what keys tell apart. */
static bool find_range(const model *m, const cell *c, size_t *first, size_t *end)
{
    if (c->side < m->shift)
        return false;
    int64_t corner[3] = {c->at[0] << c->side, c->at[1] << c->side, c->at[2] << c->side};
    uint64_t key = key_of(m, corner);
    unsigned bits = 3 * (c->side - m->shift);
    *first = lower_bound(m, key);
    *end = bits >= 63 ? m->face_count : lower_bound(m, key + ((uint64_t)1 << bits));
    return true;
}

void area_vector(const content *c, uint32_t t, float out[3])
{
    float a[3], b[3];
    for (int k = 0; k < 3; k++) {
        a[k] = c->at[k][3 * (size_t)t + 1] - c->at[k][3 * (size_t)t];
        b[k] = c->at[k][3 * (size_t)t + 2] - c->at[k][3 * (size_t)t];
    }
    cross(a, b, out);
}

/* The triangle after the last; true where all its corners lie within one side of the centre. */
static bool localise(const cell *at, const face *f, content *c)
{
    double side = ldexp(1, (int)at->side);
    bool within = true;
    for (size_t i = 0; i < 3; i++) {
        float sum = 0;
        for (int k = 0; k < 3; k++) {
            float way = (float)((double)f->corner[i][k] / side - ((double)at->at[k] + 0.5));
            c->at[k][3 * (size_t)c->count + i] = way;
            sum += way * way;
        }
        within = within && sum <= 1;
    }
    return within;
}

bool gather(const model *m, const cell *c, content *to)
{
    size_t first, end;
    to->count = to->drawn_count = 0;
    to->area = 0;
    if (!find_range(m, c, &first, &end))
        return true;
    if (!make_room(to, end - first))
        return false;
    for (size_t i = first; i < end; i++) {
        const face *f = &m->faces[i];
        bool within = localise(c, f, to);
        if (f->stored > c->side && !within)
            continue;
        to->drawn[to->count] = (uint8_t)(f->stored > c->side ? 2 : f->stored == c->side);
        if (to->drawn[to->count])
            to->drawn_face[to->drawn_count++] = to->count;
        float vector[3];
        area_vector(to, to->count++, vector);
        to->area += sqrt((double)dot(vector, vector)) / 2;
    }
    return true;
}

void model_deinit(model *m)
{
    strl_container_close(m->container);
    strl__free(m->faces);
    strl__free(m->cells);
    strl__free(m->bricks);
    *m = (model){0};
}
