/* From a page's payload to what the walk draws, and from one state to another.
 *
 * The corners that a vertex split moves are those of the vertex's subtree in the parent forest.
 * They are stored in preorder of that forest, so that each subtree is one run: three numbers a
 * corner and vertex bound the memory, whatever the mesh. */
#include "walk/internal.h"

#include <inttypes.h>
#include <string.h>

#include "geometry/colour.h"

/* Every mesh within the limits of progressive.h decodes in less. */
#define SCRATCH_BYTES ((size_t)64 << 20)

/* ---- vertices */

/* from: numbers of those to be made; NULL = all. */
static void make_vertices(const strl_pm *pm, const uint16_t *from, uint32_t count, strl_vertex *vertices)
{
    uint32_t last[2] = {UINT32_MAX, UINT32_MAX}, product = UINT32_MAX; /* neighbours often have one colour */
    for (uint32_t i = 0; i < count; i++) {
        uint32_t v = from ? from[i] : i;
        uint32_t colour = pm->colour ? pm->colour[v] : UINT32_MAX;
        uint32_t material = pm->palette[pm->palette_index ? pm->palette_index[v] : 0].rgba;
        if (colour != last[0] || material != last[1])
            product = strl_rgba_multiply(colour, material);
        last[0] = colour, last[1] = material;
        memcpy(vertices[i].position, pm->position[v], sizeof vertices[i].position);
        memcpy(vertices[i].normal, pm->normal[v], sizeof vertices[i].normal);
        for (unsigned k = 0; k < 4; k++)
            vertices[i].rgba[k] = (uint8_t)(product >> 8 * k);
    }
}

static void make_labels(const strl_pm *pm, const uint16_t *from, uint32_t count, strl_vertex_label *labels)
{
    for (uint32_t i = 0; i < count; i++) {
        uint32_t v = from ? from[i] : i;
        const strl_palette_entry *entry = &pm->palette[pm->palette_index ? pm->palette_index[v] : 0];
        const uint32_t texcoord = pm->texcoord ? pm->texcoord[v] : 0;
        labels[i] = (strl_vertex_label){entry->part, entry->material, {(uint16_t)texcoord, (uint16_t)(texcoord >> 16)}};
    }
}

/* ---- layout */

static bool has_preview(const strl_node *record)
{
    return record->rung == STRL_RUNG_SAMPLED && record->parent == STRL_NONE && record->child_count > 0;
}

uint64_t strl__node_bytes(const strl_node *record, bool labels)
{
    uint64_t splats = has_preview(record)                 ? STRL__PREVIEW_ROOM
                      : record->rung == STRL_RUNG_SAMPLED ? STRL__SPLAT_ROOM
                                                          : 0;
    return strl_node_decoded_bytes(record) + splats + (labels ? record->vertex_count * sizeof(strl_vertex_label) : 0);
}

static strl_status allocate(const strl_node *record, const strl_pm *pm, bool labels, strl__mesh *mesh, strl_error *err)
{
    size_t vertices = pm->vertex_count, added = vertices - pm->vertex_end[0], states = (size_t)pm->step_count + 1;
    size_t corners = 3 * (size_t)pm->triangle_count;
    size_t words = corners + 2 * added + 2 * states,
           halves = states + added + corners + (record->child_count ? corners : 0);
    size_t bytes = vertices * (sizeof(strl_vertex) + (labels ? sizeof(strl_vertex_label) : 0)) + words * 4 + halves * 2;
    if (bytes > strl__node_bytes(record, labels))
        return strl__fail(err, STRL_ERR_INTERNAL,
                          "a decoded node takes %zu bytes, expected at most the %" PRIu64 " reserved for it", bytes,
                          strl__node_bytes(record, labels));
    uint8_t *block = strl__alloc(1, bytes);
    if (!block)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a node of %" PRIu32 " vertices", pm->vertex_count);
    *mesh = (strl__mesh){.vertex_count = pm->vertex_count,
                         .base_vertices = pm->vertex_end[0],
                         .triangle_count = pm->triangle_count,
                         .step_count = pm->step_count,
                         .held = pm->step_count};
    /* Four-byte arrays come first, so that all are aligned. */
    mesh->vertices = (strl_vertex *)block;
    mesh->labels = labels ? (strl_vertex_label *)(mesh->vertices + vertices) : NULL;
    mesh->corners = labels ? (uint32_t *)(mesh->labels + vertices) : (uint32_t *)(mesh->vertices + vertices);
    mesh->moved_first = mesh->corners + corners;
    mesh->moved_count = mesh->moved_first + added;
    mesh->triangle_end = mesh->moved_count + added;
    mesh->errors = (float *)(mesh->triangle_end + states);
    mesh->vertex_end = (uint16_t *)(mesh->errors + states);
    mesh->parents = mesh->vertex_end + states;
    mesh->indices = mesh->parents + added;
    mesh->finest = record->child_count ? (uint16_t(*)[3])(mesh->indices + corners) : NULL;
    return STRL_OK;
}

/* ---- runs of moved corners */

/* fill[v]: where the next run or corner of v's subtree goes. */
static strl_status place_runs(const strl_pm *pm, strl__mesh *mesh, const uint32_t *own, uint32_t *fill, strl_error *err)
{
    uint32_t base = mesh->base_vertices, end = 0;
    uint64_t moves = 0;
    for (uint32_t v = mesh->vertex_count; v-- > base;) {
        mesh->moved_count[v - base] += own[v];
        moves += mesh->moved_count[v - base];
        if (pm->parent[v] >= base)
            mesh->moved_count[pm->parent[v] - base] += mesh->moved_count[v - base];
    }
    if (moves > STRL_PM_MAX_MOVES)
        return strl__fail(err, STRL_ERR_FORMAT, "refining a node moves %" PRIu64 " corners, expected at most %u", moves,
                          STRL_PM_MAX_MOVES);
    for (uint32_t v = base; v < mesh->vertex_count; v++) { /* parents before children */
        uint32_t *from = pm->parent[v] < base ? &end : &fill[pm->parent[v]];
        mesh->moved_first[v - base] = *from;
        *from += mesh->moved_count[v - base];
        fill[v] = mesh->moved_first[v - base] + own[v];
    }
    return STRL_OK;
}

static strl_status find_moves(const strl_pm *pm, strl__mesh *mesh, strl_arena *arena, strl_error *err)
{
    uint32_t base = mesh->base_vertices, corners = 3 * pm->triangle_count;
    const uint16_t *corner = pm->triangle ? &pm->triangle[0][0] : NULL;
    uint32_t *own = strl_arena_alloc_zero(arena, (size_t)mesh->vertex_count + 1, sizeof *own);
    uint32_t *fill = strl_arena_alloc_zero(arena, (size_t)mesh->vertex_count + 1, sizeof *fill);
    uint16_t *first = strl_arena_alloc(arena, (size_t)mesh->vertex_count + 1, sizeof *first);
    if (!own || !fill || !first)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to decode a node of %" PRIu32 " vertices",
                          mesh->vertex_count);
    for (uint32_t k = 0; k < corners; k++)
        own[corner[k]]++;
    memset(mesh->moved_count, 0, (mesh->vertex_count - base) * sizeof *mesh->moved_count);
    strl_status status = place_runs(pm, mesh, own, fill, err);
    if (status != STRL_OK)
        return status;
    /* A vertex's own corners stand before the runs of its children. */
    for (uint32_t v = base; v < mesh->vertex_count; v++)
        fill[v] = mesh->moved_first[v - base];
    for (uint32_t k = 0; k < corners; k++)
        if (corner[k] >= base)
            mesh->corners[fill[corner[k]]++] = k;
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        first[v] = (uint16_t)(v < base ? v : first[pm->parent[v]]);
    for (uint32_t k = 0; k < corners; k++)
        mesh->indices[k] = first[corner[k]];
    return STRL_OK;
}

static void copy_states(const strl_pm *pm, strl__mesh *mesh)
{
    for (uint32_t s = 0; s <= pm->step_count; s++) {
        mesh->vertex_end[s] = (uint16_t)pm->vertex_end[s];
        mesh->triangle_end[s] = pm->triangle_end[s];
        mesh->errors[s] = fmaxf(pm->geometric_error[s], pm->appearance_error[s]);
    }
    for (uint32_t v = mesh->base_vertices; v < mesh->vertex_count; v++)
        mesh->parents[v - mesh->base_vertices] = pm->parent[v];
}

strl_payload_reference strl__mesh_reference(const strl__node *from, const strl_node *record)
{
    const strl__mesh *mesh = &from->mesh;
    strl_payload_reference reference = {.vertex_count = mesh->vertex_count,
                                        .triangle_count = mesh->triangle_count,
                                        .position = mesh->vertices->position,
                                        .normal = mesh->vertices->normal,
                                        .position_stride = sizeof *mesh->vertices,
                                        .normal_stride = sizeof *mesh->vertices,
                                        .triangle = (const uint16_t(*)[3])mesh->finest};
    strl_page_place(&reference, from->record->anchor, record);
    return reference;
}

static strl_status make_progressive(const strl_node *record, const strl_pm *pm, bool labels, strl_arena *arena,
                                    strl__mesh *mesh, strl_error *err)
{
    strl_status status = allocate(record, pm, labels, mesh, err);
    if (status == STRL_OK)
        status = find_moves(pm, mesh, arena, err);
    if (status == STRL_OK)
        copy_states(pm, mesh);
    return status;
}

/* ---- nodes that several placements draw */

#define SHARED_STATES 32u
/* of triangles from one state to the next coarser: all together have 2.7 times those of the finest */
#define SHARED_RATIO 0.62

/* From the finest down, each with at most so many of the triangles of the one before; the coarsest is the last. */
static uint32_t choose_states(const strl__mesh *mesh, uint32_t chosen[SHARED_STATES])
{
    uint32_t count = 1;
    chosen[0] = mesh->step_count;
    for (uint32_t state = mesh->step_count; state-- > 0 && count < SHARED_STATES;)
        if (state == 0 || (mesh->triangle_end[state] <= SHARED_RATIO * mesh->triangle_end[chosen[count - 1]] &&
                           count + 1 < SHARED_STATES))
            chosen[count++] = state;
    return count;
}

/* What the node becomes: some of its states, with the indices of each. */
static strl_status keep_states(strl__mesh *mesh, uint64_t most_bytes, strl_error *err)
{
    uint32_t chosen[SHARED_STATES], count = choose_states(mesh, chosen), triangles = 0;
    for (uint32_t i = 0; i < count; i++)
        triangles += mesh->triangle_end[chosen[i]];
    size_t vertices = mesh->vertex_count, label_bytes = mesh->labels ? vertices * sizeof *mesh->labels : 0;
    size_t bytes = vertices * sizeof *mesh->vertices + label_bytes + count * 3 * sizeof(uint32_t) +
                   3 * (size_t)triangles * sizeof(uint16_t);
    if (bytes > most_bytes)
        return strl__fail(err, STRL_ERR_INTERNAL, "the states of a node take %zu bytes, expected at most %" PRIu64,
                          bytes, most_bytes);
    uint8_t *block = strl__alloc(1, bytes);
    if (!block)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a node of %" PRIu32 " vertices", mesh->vertex_count);
    strl__mesh kept = {.vertex_count = mesh->vertex_count,
                       .base_vertices = mesh->base_vertices,
                       .triangle_count = mesh->triangle_count,
                       .step_count = count - 1,
                       .held = count - 1,
                       .index_total = 3 * triangles};
    kept.vertices = (strl_vertex *)block;
    kept.labels = mesh->labels ? (strl_vertex_label *)(kept.vertices + vertices) : NULL;
    kept.triangle_end = (uint32_t *)(block + vertices * sizeof *kept.vertices + label_bytes);
    kept.index_first = kept.triangle_end + count;
    kept.errors = (float *)(kept.index_first + count);
    kept.indices = (uint16_t *)(kept.errors + count);
    memcpy(kept.vertices, mesh->vertices, vertices * sizeof *kept.vertices + label_bytes);
    for (uint32_t s = 0, at = 0; s < count; s++) {
        uint32_t state = chosen[count - 1 - s], first = 0, end = 0;
        strl__mesh_set_state(mesh, state, &first, &end);
        kept.index_first[s] = at;
        kept.triangle_end[s] = mesh->triangle_end[state];
        kept.errors[s] = mesh->errors[state];
        memcpy(kept.indices + at, mesh->indices, 3 * (size_t)kept.triangle_end[s] * sizeof *kept.indices);
        at += 3 * kept.triangle_end[s];
    }
    kept.finest = (uint16_t(*)[3])(kept.indices + kept.index_first[count - 1]);
    strl__mesh_deinit(mesh);
    *mesh = kept;
    return STRL_OK;
}

/* Of a brick the indices of a state are the first ones of those of the next. */
static strl_status share(strl__mesh *mesh, uint64_t most_bytes, strl_error *err)
{
    strl_status status = STRL_OK;
    if (mesh->splat_end)
        mesh->index_total = 3 * mesh->triangle_count;
    else
        status = keep_states(mesh, most_bytes, err);
    mesh->shared = status == STRL_OK;
    return status;
}

strl_status strl__mesh_create(const strl_node *record, const void *page, size_t size,
                              const strl_payload_reference *reference, bool labels, bool shared, float closed_size,
                              strl__mesh *mesh, strl_error *err)
{
    const uint16_t *from = NULL;
    strl_arena arena;
    strl_pm pm;
    *mesh = (strl__mesh){0};
    strl_arena_init(&arena, SCRATCH_BYTES);
    strl_brick_head head;
    strl_status status = strl_page_mesh(record, page, size, reference, &arena, &head, &pm, err);
    if (status == STRL_OK)
        status = head.level_count ? strl__brick_create(record, &pm, &head, labels, shared ? 0 : closed_size, &arena,
                                                       mesh, &from, err)
                                  : make_progressive(record, &pm, labels, &arena, mesh, err);
    if (status == STRL_OK) {
        make_vertices(&pm, from, mesh->vertex_count, mesh->vertices);
        if (labels)
            make_labels(&pm, from, mesh->vertex_count, mesh->labels);
        if (mesh->finest)
            memcpy(mesh->finest, pm.triangle, pm.triangle_count * sizeof *pm.triangle);
        if (shared)
            status = share(mesh, strl__node_bytes(record, labels), err);
    }
    if (status != STRL_OK)
        strl__mesh_deinit(mesh);
    strl_arena_deinit(&arena);
    return status;
}

void strl__mesh_deinit(strl__mesh *mesh)
{
    strl__free(mesh->vertices);
    *mesh = (strl__mesh){0};
}

/* ---- states */

void strl__mesh_set_state(strl__mesh *mesh, uint32_t state, uint32_t *first, uint32_t *end)
{
    uint32_t low = *first, high = *end, base = mesh->base_vertices;
    bool refine = state > mesh->state;
    uint32_t from = mesh->vertex_end[mesh->state], to = mesh->vertex_end[state];
    uint32_t count = mesh->splat_end ? 0 : refine ? to - from : from - to; /* in a brick no vertex moves */
    for (uint32_t i = 0; i < count; i++) {
        uint32_t v = refine ? from + i : from - 1 - i;
        uint16_t value = refine ? (uint16_t)v : mesh->parents[v - base];
        const uint32_t *corner = mesh->corners + mesh->moved_first[v - base];
        for (uint32_t k = 0; k < mesh->moved_count[v - base]; k++) {
            mesh->indices[corner[k]] = value;
            low = corner[k] < low ? corner[k] : low;
            high = corner[k] + 1 > high ? corner[k] + 1 : high;
        }
    }
    mesh->state = state;
    *first = low;
    *end = high;
}
