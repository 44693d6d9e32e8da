#include "build/clusters/node_mesh.h"

#include <string.h>

#include "base/fail.h"
#include "base/hash.h"

#define NO_INDEX UINT32_MAX

/* Open addressing from content to index; slot value index + 1. */
typedef struct index_table {
    uint32_t *slots;
    uint32_t mask;
} index_table;

static bool table_create(index_table *table, uint32_t items, strl_arena *arena)
{
    uint32_t size = 16;
    while (size < 2 * items)
        size *= 2;
    table->mask = size - 1;
    table->slots = strl_arena_alloc_zero(arena, size, sizeof *table->slots);
    return table->slots != NULL;
}

static uint32_t weld_point(index_table *table, strl_mesh *mesh, const int32_t position[3])
{
    uint64_t hash = strl__mix64(((uint64_t)(uint32_t)position[0] << 32 | (uint32_t)position[1]) ^
                                strl__mix64((uint32_t)position[2]));
    uint32_t at = (uint32_t)hash & table->mask;
    while (table->slots[at]) {
        if (!memcmp(mesh->position[table->slots[at] - 1], position, sizeof *mesh->position))
            return table->slots[at] - 1;
        at = (at + 1) & table->mask;
    }
    memcpy(mesh->position[mesh->point_count], position, sizeof *mesh->position);
    table->slots[at] = ++mesh->point_count;
    return mesh->point_count - 1;
}

static uint32_t weld_wedge(index_table *table, strl_mesh *mesh, const strl_wedge *wedge)
{
    uint64_t hash =
        strl__mix64(((uint64_t)wedge->point << 32 | (uint32_t)wedge->normal[0] << 16 | wedge->normal[1]) ^
                    strl__mix64(((uint64_t)wedge->colour << 32 | wedge->palette) ^ (uint64_t)wedge->texcoord << 16));
    uint32_t at = (uint32_t)hash & table->mask;
    while (table->slots[at]) {
        const strl_wedge *other = &mesh->wedge[table->slots[at] - 1];
        if (other->point == wedge->point && other->normal[0] == wedge->normal[0] &&
            other->normal[1] == wedge->normal[1] && other->colour == wedge->colour &&
            other->palette == wedge->palette && other->texcoord == wedge->texcoord)
            return table->slots[at] - 1;
        at = (at + 1) & table->mask;
    }
    mesh->wedge[mesh->wedge_count] = *wedge;
    table->slots[at] = ++mesh->wedge_count;
    return mesh->wedge_count - 1;
}

static bool merge_one(const strl_node_mesh *node, uint32_t which, strl_node_mesh *merged, index_table *points,
                      index_table *wedges, uint32_t *owner, uint32_t *point_of, strl_arena *arena)
{
    const strl_mesh *from = &node->mesh;
    strl_mesh *to = &merged->mesh;
    uint32_t *wedge_of = strl_arena_alloc(arena, from->wedge_count, sizeof *wedge_of);
    if (!wedge_of)
        return false;
    for (uint32_t p = 0; p < from->point_count; p++) {
        int32_t position[3];
        for (int k = 0; k < 3; k++)
            position[k] = (int32_t)(from->position[p][k] + (node->anchor[k] - merged->anchor[k]));
        point_of[p] = weld_point(points, to, position);
    }
    for (uint32_t w = 0; w < from->wedge_count; w++) {
        strl_wedge wedge = from->wedge[w];
        wedge.point = point_of[wedge.point];
        wedge_of[w] = weld_wedge(wedges, to, &wedge);
    }
    for (uint32_t t = 0; t < from->triangle_count; t++) {
        uint32_t at = to->triangle_count++;
        for (int c = 0; c < 3; c++)
            to->triangle[at][c] = wedge_of[from->triangle[t][c]];
        to->drift[at] = from->drift[t];
        to->deviation[at] = from->deviation[t];
        to->shift[at] = from->shift[t];
        owner[at] = which;
    }
    return true;
}

strl_status strl_node_mesh_merge(const strl_node_mesh *const *nodes, uint32_t count, strl_arena *arena,
                                 strl_node_mesh *merged, uint32_t **owner, uint32_t **point_of, strl_error *err)
{
    uint32_t points = 0, wedges = 0, triangles = 0;
    index_table point_table, wedge_table;
    for (uint32_t i = 0; i < count; i++) {
        points += nodes[i]->mesh.point_count;
        wedges += nodes[i]->mesh.wedge_count;
        triangles += nodes[i]->mesh.triangle_count;
    }
    *merged = (strl_node_mesh){0};
    memcpy(merged->anchor, nodes[0]->anchor, sizeof merged->anchor);
    bool good = strl_mesh_create(&merged->mesh, points, wedges, triangles, arena) &&
                table_create(&point_table, points, arena) && table_create(&wedge_table, wedges, arena);
    *owner = good ? strl_arena_alloc(arena, triangles, sizeof **owner) : NULL;
    merged->mesh.start_error = nodes[0]->mesh.start_error;
    merged->mesh.point_count = merged->mesh.wedge_count = merged->mesh.triangle_count = 0;
    for (uint32_t i = 0; i < count && good && *owner; i++) {
        point_of[i] = strl_arena_alloc(arena, nodes[i]->mesh.point_count, sizeof **point_of);
        good = point_of[i] && merge_one(nodes[i], i, merged, &point_table, &wedge_table, *owner, point_of[i], arena);
    }
    return good && *owner ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "no memory to merge %u triangles", triangles);
}

strl_status strl_mesh_extract(const strl_mesh *mesh, const uint32_t *owner, uint32_t which, strl_arena *arena,
                              strl_mesh *part, uint32_t *point_of, strl_error *err)
{
    uint32_t *wedge_of = strl_arena_alloc(arena, mesh->wedge_count, sizeof *wedge_of);
    uint32_t points = 0, wedges = 0, triangles = 0;
    if (!wedge_of)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a part of %u triangles", mesh->triangle_count);
    memset(point_of, 0xff, mesh->point_count * sizeof *point_of);
    memset(wedge_of, 0xff, mesh->wedge_count * sizeof *wedge_of);
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        for (int c = 0; c < 3 && owner[t] == which; c++)
            wedge_of[mesh->triangle[t][c]] = point_of[mesh->wedge[mesh->triangle[t][c]].point] = 0;
    for (uint32_t p = 0; p < mesh->point_count; p++)
        point_of[p] = point_of[p] == 0 ? points++ : NO_INDEX;
    for (uint32_t w = 0; w < mesh->wedge_count; w++)
        wedge_of[w] = wedge_of[w] == 0 ? wedges++ : NO_INDEX;
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        triangles += owner[t] == which;
    if (!strl_mesh_create(part, points, wedges, triangles, arena))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a part of %u triangles", triangles);
    part->start_error = mesh->start_error;
    part->most_error = mesh->most_error;
    for (uint32_t p = 0; p < mesh->point_count; p++)
        if (point_of[p] != NO_INDEX)
            memcpy(part->position[point_of[p]], mesh->position[p], sizeof *part->position);
    for (uint32_t w = 0; w < mesh->wedge_count; w++)
        if (wedge_of[w] != NO_INDEX) {
            part->wedge[wedge_of[w]] = mesh->wedge[w];
            part->wedge[wedge_of[w]].point = point_of[mesh->wedge[w].point];
        }
    triangles = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        if (owner[t] != which)
            continue;
        for (int c = 0; c < 3; c++)
            part->triangle[triangles][c] = wedge_of[mesh->triangle[t][c]];
        part->drift[triangles] = mesh->drift[t];
        part->deviation[triangles] = mesh->deviation[t];
        part->shift[triangles++] = mesh->shift[t];
    }
    return STRL_OK;
}
