/* What belongs to a vertex and is not drawn. */
#include <inttypes.h>

#include "base/fail.h"
#include "container/opened.h"

static void copy_palette(const strl_pm *mesh, uint32_t *parts, uint32_t *materials)
{
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        const strl_palette_entry *entry = &mesh->palette[mesh->palette_index ? mesh->palette_index[v] : 0];
        if (parts)
            parts[v] = entry->part;
        if (materials)
            materials[v] = entry->material;
    }
}

strl_status strl_container_vertex_parts(strl_container *container, uint32_t placement, uint32_t node,
                                        uint32_t vertex_count, uint32_t *parts, uint32_t *materials, strl_error *err)
{
    strl_placement placed;
    strl_node record;
    strl_pm mesh;
    strl_arena arena;
    strl_arena_init(&arena, 0); /* the limits of a payload bound it */
    strl_status status = strl_container_placement(container, placement, &placed, err);
    if (status == STRL_OK)
        status = strl_container_node(container, placed.tree, node, &record, err);
    if (status == STRL_OK && record.vertex_count != vertex_count)
        status = strl__fail(err, STRL_ERR_ARGUMENT,
                            "node %" PRIu32 " of placement %" PRIu32 " has %" PRIu32 " vertices, asked for %" PRIu32,
                            node, placement, record.vertex_count, vertex_count);
    if (status == STRL_OK)
        status = strl_container_mesh(container, placed.tree, &record, &arena, &mesh, err);
    if (status == STRL_OK)
        copy_palette(&mesh, parts, materials);
    strl_arena_deinit(&arena);
    return status;
}
