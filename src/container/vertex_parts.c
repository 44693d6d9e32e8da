/* What belongs to a vertex and is not drawn. */
#include <inttypes.h>

#include "base/fail.h"
#include "container/opened.h"

static void copy_palette(const strl_pm *mesh, uint32_t own_part, uint32_t *parts, uint32_t *materials)
{
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        const strl_palette_entry *entry = &mesh->palette[mesh->palette_index ? mesh->palette_index[v] : 0];
        if (parts)
            parts[v] = own_part ? own_part - 1 : entry->part;
        if (materials)
            materials[v] = entry->material;
    }
}

/* Its mesh, in the arena. */
static strl_status find_mesh(strl_container *container, uint32_t placement, uint32_t node, uint32_t vertex_count,
                             strl_arena *arena, strl_pm *mesh, uint32_t *own_part, strl_error *err)
{
    strl_placement placed;
    strl_node record;
    strl_status status = strl_container_placement(container, placement, &placed, err);
    *own_part = placed.own_part;
    if (status == STRL_OK)
        status = strl_container_node(container, placed.tree, node, &record, err);
    if (status == STRL_OK && record.vertex_count != vertex_count)
        status = strl__fail(err, STRL_ERR_ARGUMENT,
                            "node %" PRIu32 " of placement %" PRIu32 " has %" PRIu32 " vertices, asked for %" PRIu32,
                            node, placement, record.vertex_count, vertex_count);
    return status == STRL_OK ? strl_container_mesh(container, placed.tree, &record, arena, mesh, err) : status;
}

strl_status strl_container_vertex_parts(strl_container *container, uint32_t placement, uint32_t node,
                                        uint32_t vertex_count, uint32_t *parts, uint32_t *materials, strl_error *err)
{
    strl_pm mesh;
    strl_arena arena;
    uint32_t own_part;
    strl_arena_init(&arena, 0); /* the limits of a payload bound it */
    strl_status status = find_mesh(container, placement, node, vertex_count, &arena, &mesh, &own_part, err);
    if (status == STRL_OK)
        copy_palette(&mesh, own_part, parts, materials);
    strl_arena_deinit(&arena);
    return status;
}

strl_status strl_container_vertex_texcoords(strl_container *container, uint32_t placement, uint32_t node,
                                            uint32_t vertex_count, uint16_t (*texcoords)[2], strl_error *err)
{
    strl_pm mesh;
    strl_arena arena;
    uint32_t own_part;
    strl_arena_init(&arena, 0);
    strl_status status = find_mesh(container, placement, node, vertex_count, &arena, &mesh, &own_part, err);
    for (uint32_t v = 0; status == STRL_OK && v < vertex_count; v++)
        for (unsigned k = 0; k < 2; k++)
            texcoords[v][k] = mesh.texcoord ? (uint16_t)(mesh.texcoord[v] >> 16 * k) : 0;
    strl_arena_deinit(&arena);
    return status;
}
