#include "build/clusters/node_mesh.h"

#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"

#define NO_INDEX UINT32_MAX
#define DRIFT_STEPS 250.f /* below 255: quotients may round up by one */

static void write_triangles(const strl_mesh *mesh, strl_writer *writer)
{
    unsigned bytes = mesh->wedge_count <= 65536 ? 2 : 4;
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        for (int c = 0; c < 3; c++)
            strl_writer_le(writer, bytes, mesh->triangle[t][c]);
}

static bool read_triangles(strl_cursor *cursor, strl_mesh *mesh)
{
    unsigned bytes = mesh->wedge_count <= 65536 ? 2 : 4;
    const uint8_t *from = strl_cursor_take(cursor, (size_t)mesh->triangle_count * 3 * bytes);
    for (uint32_t i = 0; from && i < 3 * mesh->triangle_count; i++)
        mesh->triangle[i / 3][i % 3] = (uint32_t)strl__load_le(from + (size_t)i * bytes, bytes);
    return from != NULL;
}

/* Drifts are rounded outward to steps of a 250th of the largest: six bytes instead of 24, and still boxes that hold them. */
static void write_drifts(const strl_mesh *mesh, strl_writer *writer)
{
    float largest = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        for (int k = 0; k < 3; k++)
            largest = fmaxf(largest, fmaxf(-mesh->drift[t].least[k], mesh->drift[t].most[k]));
    float step = nextafterf(largest / DRIFT_STEPS, INFINITY);
    strl_writer_f32(writer, step);
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        for (int k = 0; k < 3; k++) {
            float least = ceilf(-mesh->drift[t].least[k] / step), most = ceilf(mesh->drift[t].most[k] / step);
            strl_writer_u8(writer, (uint8_t)least);
            strl_writer_u8(writer, (uint8_t)most);
        }
}

static bool read_drifts(strl_cursor *cursor, strl_mesh *mesh)
{
    float step = strl_cursor_f32(cursor);
    const uint8_t *from = strl_cursor_take(cursor, (size_t)mesh->triangle_count * 6);
    for (uint32_t t = 0; from && t < mesh->triangle_count; t++)
        for (int k = 0; k < 3; k++) {
            mesh->drift[t].least[k] = -step * *from++;
            mesh->drift[t].most[k] = step * *from++;
        }
    return from != NULL;
}

void strl_node_mesh_write(const strl_node_mesh *node, strl_writer *writer)
{
    const strl_mesh *mesh = &node->mesh;
    uint32_t shares = node->share_first ? node->share_first[mesh->point_count] : 0;
    strl_writer_u32(writer, mesh->point_count);
    strl_writer_u32(writer, mesh->wedge_count);
    strl_writer_u32(writer, mesh->triangle_count);
    strl_writer_u32(writer, node->share_first ? shares : NO_INDEX);
    strl_writer_bytes(writer, node->anchor, sizeof node->anchor);
    strl_writer_bytes(writer, mesh->position, mesh->point_count * sizeof *mesh->position);
    strl_writer_bytes(writer, mesh->wedge, mesh->wedge_count * sizeof *mesh->wedge);
    write_triangles(mesh, writer);
    strl_writer_f32(writer, mesh->start_error);
    write_drifts(mesh, writer);
    strl_writer_bytes(writer, mesh->deviation, mesh->triangle_count * sizeof *mesh->deviation);
    strl_writer_bytes(writer, mesh->shift, mesh->triangle_count * sizeof *mesh->shift);
    if (node->share_first) {
        strl_writer_bytes(writer, node->share_first, (mesh->point_count + 1) * sizeof *node->share_first);
        strl_writer_bytes(writer, node->share, shares * sizeof *node->share);
    }
}

static bool copy_out(strl_cursor *cursor, void *to, size_t count, size_t size)
{
    const uint8_t *from = strl_cursor_take(cursor, count * size);
    if (from && count)
        memcpy(to, from, count * size);
    return from != NULL;
}

strl_status strl_node_mesh_read(const void *data, size_t size, strl_arena *arena, strl_node_mesh *node, strl_error *err)
{
    strl_cursor cursor = strl_cursor_make(data, size);
    uint32_t points = strl_cursor_u32(&cursor), wedges = strl_cursor_u32(&cursor);
    uint32_t triangles = strl_cursor_u32(&cursor), shares = strl_cursor_u32(&cursor);
    strl_mesh *mesh = &node->mesh;
    *node = (strl_node_mesh){0};
    if (cursor.failed || points > size / 12 || wedges > size / sizeof(strl_wedge) || triangles > size / 20)
        return strl__fail(err, STRL_ERR_INTERNAL, "a node's mesh in scratch is damaged");
    if (!strl_mesh_create(mesh, points, wedges, triangles, arena))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a node of %u triangles", triangles);
    bool good = copy_out(&cursor, node->anchor, 1, sizeof node->anchor) &&
                copy_out(&cursor, mesh->position, points, sizeof *mesh->position) &&
                copy_out(&cursor, mesh->wedge, wedges, sizeof *mesh->wedge) &&
                read_triangles(&cursor, mesh) &&
                copy_out(&cursor, &mesh->start_error, 1, sizeof mesh->start_error) &&
                read_drifts(&cursor, mesh) &&
                copy_out(&cursor, mesh->deviation, triangles, sizeof *mesh->deviation) &&
                copy_out(&cursor, mesh->shift, triangles, sizeof *mesh->shift);
    if (good && shares != NO_INDEX) {
        node->share_first = strl_arena_alloc(arena, (size_t)points + 1, sizeof *node->share_first);
        node->share = strl_arena_alloc(arena, shares, sizeof *node->share);
        if (!node->share_first || !node->share)
            return strl__fail(err, STRL_ERR_MEMORY, "no memory for a node of %u triangles", triangles);
        good = copy_out(&cursor, node->share_first, (size_t)points + 1, sizeof *node->share_first) &&
               copy_out(&cursor, node->share, shares, sizeof *node->share);
    }
    return good ? STRL_OK : strl__fail(err, STRL_ERR_INTERNAL, "a node's mesh in scratch is cut off");
}

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
    uint64_t hash = strl__mix64(((uint64_t)wedge->point << 32 | (uint32_t)wedge->normal[0] << 16 | wedge->normal[1]) ^
                                strl__mix64((uint64_t)wedge->colour << 32 | wedge->palette));
    uint32_t at = (uint32_t)hash & table->mask;
    while (table->slots[at]) {
        const strl_wedge *other = &mesh->wedge[table->slots[at] - 1];
        if (other->point == wedge->point && other->normal[0] == wedge->normal[0] &&
            other->normal[1] == wedge->normal[1] && other->colour == wedge->colour && other->palette == wedge->palette)
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
