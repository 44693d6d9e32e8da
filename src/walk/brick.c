/* Bricks of sample trees as meshes of some states (geometry/sample_payload.h). The states' errors are the sizes of cells, so a state
 * is chosen as that of any mesh (refine.c); from one to the next no vertex comes, only triangles, and other splats stand for what is
 * finer. */
#include "walk/internal.h"

#include <inttypes.h>
#include <string.h>

static strl_status allocate(const strl_node *record, const strl_pm *pm, const strl_brick_head *head, bool labels, strl__mesh *mesh,
                            strl_error *err)
{
    size_t vertices = pm->vertex_count, corners = 3 * (size_t)pm->triangle_count, states = (size_t)head->level_count + 1;
    size_t bytes = vertices * (sizeof(strl_vertex) + (labels ? sizeof(strl_vertex_label) : 0)) +
                   strl_brick_splats(head) * sizeof(strl_splat) + states * (sizeof(uint32_t) + sizeof(float) + 2 * sizeof(uint16_t)) +
                   corners * sizeof(uint16_t);
    if (bytes > strl__node_bytes(record, labels))
        return strl__fail(err, STRL_ERR_FORMAT, "a brick takes %zu bytes, expected at most %" PRIu64 ": it has too many splats", bytes,
                          strl__node_bytes(record, labels));
    uint8_t *block = strl__alloc(1, bytes);
    if (!block)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a brick of %" PRIu32 " vertices", pm->vertex_count);
    *mesh = (strl__mesh){.vertex_count = pm->vertex_count,
                         .base_vertices = pm->vertex_count,
                         .triangle_count = pm->triangle_count,
                         .step_count = head->level_count};
    mesh->vertices = (strl_vertex *)block;
    mesh->labels = labels ? (strl_vertex_label *)(mesh->vertices + vertices) : NULL;
    mesh->splats = labels ? (strl_splat *)(mesh->labels + vertices) : (strl_splat *)(mesh->vertices + vertices);
    mesh->triangle_end = (uint32_t *)(mesh->splats + strl_brick_splats(head));
    mesh->errors = (float *)(mesh->triangle_end + states);
    mesh->vertex_end = (uint16_t *)(mesh->errors + states);
    mesh->splat_end = mesh->vertex_end + states;
    mesh->indices = mesh->splat_end + states;
    return STRL_OK;
}

/* By level, so that those of a state are a run from the front. */
static void order_triangles(const strl_pm *pm, const strl_brick_head *head, strl__mesh *mesh)
{
    uint32_t count[STRL_BRICK_LEVELS + 2] = {0};
    for (uint32_t i = 0; i < head->run_count; i++)
        count[head->run[i].level + 1] += head->run[i].count;
    for (uint32_t level = 0; level <= head->level_count; level++) {
        count[level + 1] += count[level];
        mesh->triangle_end[level] = count[level + 1];
    }
    for (uint32_t i = 0, t = 0; i < head->run_count; i++)
        for (uint32_t k = 0; k < head->run[i].count; k++)
            memcpy(mesh->indices + 3 * (size_t)count[head->run[i].level]++, pm->triangle[t++], sizeof *pm->triangle);
}

strl_status strl__brick_create(const strl_node *record, const strl_pm *pm, const strl_brick_head *head, bool labels,
                               strl__mesh *mesh, strl_error *err)
{
    if (pm->step_count != 0)
        return strl__fail(err, STRL_ERR_FORMAT, "a brick has %u steps, expected none", pm->step_count);
    strl_status status = allocate(record, pm, head, labels, mesh, err);
    if (status != STRL_OK)
        return status;
    memcpy(mesh->splats, head->splat, strl_brick_splats(head) * sizeof *mesh->splats);
    order_triangles(pm, head, mesh);
    for (uint32_t s = 0; s < head->level_count; s++) {
        mesh->errors[s] = head->error[s];
        mesh->splat_end[s] = (uint16_t)head->splat_end[s];
        mesh->vertex_end[s] = (uint16_t)pm->vertex_count;
    }
    mesh->errors[head->level_count] = pm->geometric_error[0];
    mesh->vertex_end[head->level_count] = (uint16_t)pm->vertex_count;
    return STRL_OK;
}
