/* Bricks of sample trees as meshes of some states (geometry/sample_payload.h). The states' errors are the sizes of cells, so a state
 * is chosen as that of any mesh (refine.c); from one to the next no vertex comes, only triangles, and other splats stand for what is
 * finer. Seen from afar, of a brick without children only the states are kept that show: a brick that covers some pixels shows a hundredth of
 * itself. Who comes nearer has it decoded anew, with more of them. */
#include "walk/internal.h"

#include <inttypes.h>
#include <string.h>

/* What a mesh has of the brick. */
typedef struct brick_part {
    uint32_t state, vertices, triangles, splats;
    uint16_t *from, *to; /* numbers of vertices: the brick's by the mesh's, and back; NULL = the same ones */
} brick_part;

/* The coarsest state whose closed cells are no larger than that; the finest where that is not much more. A brick above others is asked for
 * as a whole: it has but one level. */
static uint32_t choose_state(const strl_node *record, const strl_pm *pm, const strl_brick_head *head, float closed_size)
{
    uint32_t state = 0;
    uint64_t triangles = 0;
    if (record->child_count > 0 || !(closed_size > 0))
        return head->level_count;
    while (state < head->level_count && head->error[state] > closed_size)
        state++;
    for (uint32_t i = 0; i < head->run_count; i++)
        triangles += head->run[i].level <= state ? head->run[i].count : 0;
    return 2 * triangles > pm->triangle_count ? head->level_count : state;
}

/* Vertices keep their order. */
static bool number_vertices(const strl_pm *pm, const strl_brick_head *head, strl_arena *arena, brick_part *part)
{
    part->to = strl_arena_alloc(arena, (size_t)pm->vertex_count + 1, sizeof *part->to);
    part->from = strl_arena_alloc(arena, (size_t)pm->vertex_count + 1, sizeof *part->from);
    uint8_t *used = strl_arena_alloc_zero(arena, (size_t)pm->vertex_count + 1, 1);
    if (!part->to || !part->from || !used)
        return false;
    for (uint32_t i = 0, t = 0; i < head->run_count; t += head->run[i++].count)
        for (uint32_t k = 0; k < head->run[i].count && head->run[i].level <= part->state; k++, part->triangles++)
            for (int c = 0; c < 3; c++)
                used[pm->triangle[t + k][c]] = 1;
    for (uint32_t v = 0; v < pm->vertex_count; v++) {
        if (!used[v])
            continue;
        part->to[v] = (uint16_t)part->vertices;
        part->from[part->vertices++] = (uint16_t)v;
    }
    return true;
}

static strl_status choose_part(const strl_node *record, const strl_pm *pm, const strl_brick_head *head, float closed_size, strl_arena *arena,
                               brick_part *part, strl_error *err)
{
    *part = (brick_part){.state = choose_state(record, pm, head, closed_size)};
    if (part->state == head->level_count) {
        part->vertices = pm->vertex_count;
        part->triangles = pm->triangle_count;
        part->splats = strl_brick_splats(head);
        return STRL_OK;
    }
    part->splats = head->splat_end[part->state];
    return number_vertices(pm, head, arena, part) ? STRL_OK
                                                  : strl__fail(err, STRL_ERR_MEMORY, "no memory for a brick of %" PRIu32 " vertices",
                                                               pm->vertex_count);
}

static strl_status allocate(const strl_node *record, const brick_part *part, const strl_brick_head *head, bool labels, strl__mesh *mesh,
                            strl_error *err)
{
    size_t vertices = part->vertices, corners = 3 * (size_t)part->triangles, states = (size_t)head->level_count + 1;
    size_t bytes = vertices * (sizeof(strl_vertex) + (labels ? sizeof(strl_vertex_label) : 0)) +
                   part->splats * sizeof(strl_splat) + states * (sizeof(uint32_t) + sizeof(float) + 2 * sizeof(uint16_t)) +
                   corners * sizeof(uint16_t);
    if (bytes > strl__node_bytes(record, labels))
        return strl__fail(err, STRL_ERR_FORMAT, "a brick takes %zu bytes, expected at most %" PRIu64 ": it has too many splats", bytes,
                          strl__node_bytes(record, labels));
    uint8_t *block = strl__alloc(1, bytes);
    if (!block)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a brick of %" PRIu32 " vertices", part->vertices);
    *mesh = (strl__mesh){.vertex_count = part->vertices,
                         .base_vertices = part->vertices,
                         .triangle_count = part->triangles,
                         .step_count = head->level_count,
                         .held = part->state,
                         .spare_bytes = part->from ? strl__node_bytes(record, labels) - bytes : 0};
    mesh->vertices = (strl_vertex *)block;
    mesh->labels = labels ? (strl_vertex_label *)(mesh->vertices + vertices) : NULL;
    mesh->splats = labels ? (strl_splat *)(mesh->labels + vertices) : (strl_splat *)(mesh->vertices + vertices);
    mesh->triangle_end = (uint32_t *)(mesh->splats + part->splats);
    mesh->errors = (float *)(mesh->triangle_end + states);
    mesh->vertex_end = (uint16_t *)(mesh->errors + states);
    mesh->splat_end = mesh->vertex_end + states;
    mesh->indices = mesh->splat_end + states;
    return STRL_OK;
}

static void put_triangle(const uint16_t corner[3], const uint16_t *to, uint16_t *indices)
{
    for (int c = 0; c < 3; c++)
        indices[c] = to ? to[corner[c]] : corner[c];
}

/* By level, so that those of a state are a run from the front. Finer states than the part's have no more than that. */
static void order_triangles(const strl_pm *pm, const strl_brick_head *head, const brick_part *part, strl__mesh *mesh)
{
    uint32_t count[STRL_BRICK_LEVELS + 2] = {0};
    for (uint32_t i = 0; i < head->run_count; i++)
        if (head->run[i].level <= part->state)
            count[head->run[i].level + 1] += head->run[i].count;
    for (uint32_t level = 0; level <= head->level_count; level++) {
        count[level + 1] += count[level];
        mesh->triangle_end[level] = count[level + 1];
    }
    for (uint32_t i = 0, t = 0; i < head->run_count; t += head->run[i++].count)
        for (uint32_t k = 0; k < head->run[i].count && head->run[i].level <= part->state; k++)
            put_triangle(pm->triangle[t + k], part->to, mesh->indices + 3 * (size_t)count[head->run[i].level]++);
}

strl_status strl__brick_create(const strl_node *record, const strl_pm *pm, const strl_brick_head *head, bool labels, float closed_size,
                               strl_arena *arena, strl__mesh *mesh, const uint16_t **from, strl_error *err)
{
    brick_part part;
    if (pm->step_count != 0)
        return strl__fail(err, STRL_ERR_FORMAT, "a brick has %u steps, expected none", pm->step_count);
    strl_status status = choose_part(record, pm, head, closed_size, arena, &part, err);
    if (status == STRL_OK)
        status = allocate(record, &part, head, labels, mesh, err);
    if (status != STRL_OK)
        return status;
    *from = part.from;
    memcpy(mesh->splats, head->splat, part.splats * sizeof *mesh->splats);
    order_triangles(pm, head, &part, mesh);
    for (uint32_t s = 0; s < head->level_count; s++) {
        mesh->errors[s] = head->error[s];
        mesh->splat_end[s] = (uint16_t)(head->splat_end[s] < part.splats ? head->splat_end[s] : part.splats);
        mesh->vertex_end[s] = (uint16_t)part.vertices;
    }
    mesh->errors[head->level_count] = pm->geometric_error[0];
    mesh->vertex_end[head->level_count] = (uint16_t)part.vertices;
    return STRL_OK;
}
