/* Bricks of sample trees as meshes of two states: in state 0 splats stand for what lies in the cells and only triangles too large
 * for them are drawn, in state 1 all triangles are. The states' errors are the size of the cells and what the lattice moves, so the
 * state is chosen as that of any mesh (refine.c). */
#include "walk/internal.h"

#include <string.h>

static bool allocate(const strl_pm *pm, const strl_sample_head *head, bool labels, strl__mesh *mesh)
{
    size_t vertices = pm->vertex_count, corners = 3 * (size_t)pm->triangle_count;
    size_t bytes = vertices * (sizeof(strl_vertex) + (labels ? sizeof(strl_vertex_label) : 0)) +
                   head->splat_count * sizeof(strl_splat) + 2 * (sizeof(uint32_t) + sizeof(float) + sizeof(uint16_t)) +
                   corners * sizeof(uint16_t);
    uint8_t *block = strl__alloc(1, bytes);
    *mesh = (strl__mesh){.vertex_count = pm->vertex_count,
                         .base_vertices = pm->vertex_count,
                         .triangle_count = pm->triangle_count,
                         .step_count = 1,
                         .splat_count = head->splat_count};
    if (!block)
        return false;
    mesh->vertices = (strl_vertex *)block;
    mesh->labels = labels ? (strl_vertex_label *)(mesh->vertices + vertices) : NULL;
    mesh->splats = labels ? (strl_splat *)(mesh->labels + vertices) : (strl_splat *)(mesh->vertices + vertices);
    mesh->triangle_end = (uint32_t *)(mesh->splats + head->splat_count);
    mesh->errors = (float *)(mesh->triangle_end + 2);
    mesh->vertex_end = (uint16_t *)(mesh->errors + 2);
    mesh->indices = mesh->vertex_end + 2;
    return true;
}

/* Large ones first: they are drawn in both states. Returns how many they are. */
static uint32_t order_triangles(const strl_pm *pm, const strl_sample_head *head, uint16_t *indices)
{
    uint32_t large = 0, at[2];
    for (uint32_t i = 1; i < head->run_count; i += 2)
        large += head->run[i];
    at[0] = large, at[1] = 0;
    for (uint32_t i = 0, t = 0; i < (head->run_count ? head->run_count : 1); i++) {
        uint32_t end = head->run_count ? t + head->run[i] : pm->triangle_count;
        for (; t < end; t++)
            memcpy(indices + 3 * (size_t)at[i & 1]++, pm->triangle[t], sizeof pm->triangle[t]);
    }
    return large;
}

strl_status strl__brick_create(const strl_node *record, const strl_pm *pm, const strl_sample_head *head, bool labels,
                               strl__mesh *mesh, strl_error *err)
{
    if (pm->step_count != 0)
        return strl__fail(err, STRL_ERR_FORMAT, "a brick has %u steps, expected none", pm->step_count);
    if (!allocate(pm, head, labels, mesh))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a brick of %u vertices", pm->vertex_count);
    memcpy(mesh->splats, head->splat, head->splat_count * sizeof *mesh->splats);
    mesh->triangle_end[0] = order_triangles(pm, head, mesh->indices);
    mesh->triangle_end[1] = pm->triangle_count;
    mesh->errors[0] = record->group_geometric;
    mesh->errors[1] = pm->geometric_error[0];
    mesh->vertex_end[0] = mesh->vertex_end[1] = (uint16_t)pm->vertex_count;
    return STRL_OK;
}
