/* Node meshes in scratch: what repeats from element to element is told by one bit, the rest as differences. */
#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "build/clusters/node_mesh.h"
#include "store/pack.h"

#define NO_SHARES UINT32_MAX
#define DRIFT_STEPS 250.f /* below 255: quotients may round up by one */

typedef struct models {
    strl_pack_model vertex, point, palette, corner[3], drift_repeats, drift[6], share_count, share;
    strl_pack_steps normal[2];
    strl_pack_rgba colour;
    strl_pack_steps texcoord[2];
    strl_pack_same deviation, shift;
} models;

/* Open addressing from position to base vertex; slot value vertex + 1. */
typedef struct place_table {
    const strl_pm *payload;
    uint32_t *slots;
    uint32_t mask;
} place_table;

static uint32_t *find_place(const place_table *table, const int32_t position[3])
{
    uint64_t hash = strl__mix64(((uint64_t)(uint32_t)position[0] << 32 | (uint32_t)position[1]) ^
                                strl__mix64((uint32_t)position[2]));
    uint32_t at = (uint32_t)hash & table->mask;
    while (table->slots[at] &&
           memcmp(table->payload->position[table->slots[at] - 1], position, sizeof *table->payload->position))
        at = (at + 1) & table->mask;
    return &table->slots[at];
}

static bool list_places(place_table *table, const strl_pm *payload, strl_arena *arena)
{
    uint32_t size = 16;
    while (size < 2 * payload->vertex_end[0])
        size *= 2;
    *table = (place_table){.payload = payload, .mask = size - 1};
    table->slots = strl_arena_alloc_zero(arena, size, sizeof *table->slots);
    for (uint32_t v = 0; table->slots && v < payload->vertex_end[0]; v++) {
        uint32_t *slot = find_place(table, payload->position[v]);
        *slot = *slot ? *slot : v + 1;
    }
    return table->slots != NULL;
}

static void write_positions(const strl_mesh *mesh, strl_packer *packer)
{
    strl_pack_points points;
    strl_pack_points_init(&points);
    for (uint32_t p = 0; p < mesh->point_count; p++) {
        uint32_t position[3];
        memcpy(position, mesh->position[p], sizeof position);
        strl_pack_point(packer, &points, position);
    }
}

static void read_positions(strl_mesh *mesh, strl_unpacker *unpacker)
{
    strl_pack_points points;
    strl_pack_points_init(&points);
    for (uint32_t p = 0; p < mesh->point_count; p++) {
        uint32_t position[3];
        strl_unpack_point(unpacker, &points, position);
        memcpy(mesh->position[p], position, sizeof position);
    }
}

/* A point is told by the first base vertex at its position. False where there is none. */
static bool write_points(const strl_mesh *mesh, const place_table *places, models *m, strl_packer *packer)
{
    uint32_t next = 0;
    for (uint32_t p = 0; p < mesh->point_count; p++) {
        uint32_t vertex = *find_place(places, mesh->position[p]);
        if (!vertex)
            return false;
        strl_pack(packer, &m->vertex, strl_pack_zigzag(vertex - 1 - next));
        next = vertex;
    }
    return true;
}

static bool read_points(strl_mesh *mesh, const strl_pm *payload, models *m, strl_unpacker *unpacker)
{
    uint32_t next = 0;
    for (uint32_t p = 0; p < mesh->point_count; p++) {
        uint32_t vertex = next + strl_unpack_zigzag(strl_unpack(unpacker, &m->vertex));
        if (vertex >= payload->vertex_end[0])
            return false;
        memcpy(mesh->position[p], payload->position[vertex], sizeof *mesh->position);
        next = vertex + 1;
    }
    return true;
}

static void write_wedges(const strl_mesh *mesh, models *m, strl_packer *packer)
{
    strl_wedge last = {.point = UINT32_MAX};
    bool has_texcoords = false;
    for (uint32_t w = 0; w < mesh->wedge_count && !has_texcoords; w++)
        has_texcoords = mesh->wedge[w].texcoord != 0;
    strl__pack_bits(packer, 1, has_texcoords);
    for (uint32_t w = 0; w < mesh->wedge_count; w++) {
        const strl_wedge *wedge = &mesh->wedge[w];
        strl_pack(packer, &m->point, strl_pack_zigzag(wedge->point - last.point - 1));
        for (int k = 0; k < 2; k++)
            strl_pack_step(packer, &m->normal[k], wedge->normal[k], last.normal[k]);
        strl_pack_colour(packer, &m->colour, wedge->colour, last.colour);
        for (unsigned k = 0; k < 2 && has_texcoords; k++)
            strl_pack_step(packer, &m->texcoord[k], wedge->texcoord >> 16 * k & 0xffff,
                           last.texcoord >> 16 * k & 0xffff);
        strl_pack(packer, &m->palette, strl_pack_zigzag(wedge->palette - last.palette));
        last = *wedge;
    }
}

static bool read_wedges(strl_mesh *mesh, models *m, strl_unpacker *unpacker)
{
    strl_wedge last = {.point = UINT32_MAX};
    bool good = true, has_texcoords = strl__unpack_bits(unpacker, 1);
    for (uint32_t w = 0; w < mesh->wedge_count; w++) {
        last.point += 1 + strl_unpack_zigzag(strl_unpack(unpacker, &m->point));
        for (int k = 0; k < 2; k++)
            last.normal[k] = (uint16_t)strl_unpack_step(unpacker, &m->normal[k], last.normal[k]);
        last.colour = strl_unpack_colour(unpacker, &m->colour, last.colour);
        uint32_t texcoord = 0;
        for (unsigned k = 0; k < 2 && has_texcoords; k++)
            texcoord |= (strl_unpack_step(unpacker, &m->texcoord[k], last.texcoord >> 16 * k & 0xffff) & 0xffff)
                        << 16 * k;
        last.texcoord = texcoord;
        last.palette += strl_unpack_zigzag(strl_unpack(unpacker, &m->palette));
        good &= last.point < mesh->point_count;
        mesh->wedge[w] = last;
    }
    return good;
}

static void write_triangles(const strl_mesh *mesh, models *m, strl_packer *packer)
{
    uint32_t next = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        for (int c = 0; c < 3; c++)
            strl_pack_corner(packer, &m->corner[c], mesh->triangle[t][c], &next);
}

/* The wedges have been read. A triangle has three points. */
static bool read_triangles(strl_mesh *mesh, models *m, strl_unpacker *unpacker)
{
    uint32_t next = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        uint32_t point[3];
        for (int c = 0; c < 3; c++) {
            uint32_t wedge = mesh->triangle[t][c] = strl_unpack_corner(unpacker, &m->corner[c], &next);
            if (wedge >= mesh->wedge_count)
                return false;
            point[c] = mesh->wedge[wedge].point;
        }
        if (point[0] == point[1] || point[1] == point[2] || point[2] == point[0])
            return false;
    }
    return true;
}

/* Drifts are rounded outward to steps of a 250th of the largest: six small numbers, and still boxes that hold them. */
static float drift_step(const strl_mesh *mesh)
{
    float largest = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        for (int k = 0; k < 3; k++)
            largest = fmaxf(largest, fmaxf(-mesh->drift[t].least[k], mesh->drift[t].most[k]));
    return nextafterf(largest / DRIFT_STEPS, INFINITY);
}

static void write_drifts(const strl_mesh *mesh, float step, models *m, strl_packer *packer)
{
    uint8_t last[6] = {0};
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        uint8_t drift[6];
        for (int k = 0; k < 3; k++) {
            drift[k] = (uint8_t)ceilf(-mesh->drift[t].least[k] / step);
            drift[3 + k] = (uint8_t)ceilf(mesh->drift[t].most[k] / step);
        }
        bool differs = memcmp(drift, last, sizeof drift) != 0;
        strl_pack(packer, &m->drift_repeats, differs);
        for (int k = 0; k < 6 && differs; k++)
            strl_pack(packer, &m->drift[k], drift[k]);
        memcpy(last, drift, sizeof drift);
    }
}

static void read_drifts(strl_mesh *mesh, float step, models *m, strl_unpacker *unpacker)
{
    uint32_t drift[6] = {0};
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        bool differs = strl_unpack(unpacker, &m->drift_repeats) != 0;
        for (int k = 0; k < 6 && differs; k++)
            drift[k] = strl_unpack(unpacker, &m->drift[k]);
        for (int k = 0; k < 3; k++) {
            mesh->drift[t].least[k] = -step * (float)drift[k];
            mesh->drift[t].most[k] = step * (float)drift[3 + k];
        }
    }
}

static void write_shares(const strl_node_mesh *node, models *m, strl_packer *packer)
{
    uint32_t last = 0;
    for (uint32_t p = 0; p < node->mesh.point_count; p++) {
        strl_pack(packer, &m->share_count, node->share_first[p + 1] - node->share_first[p]);
        for (uint32_t i = node->share_first[p]; i < node->share_first[p + 1]; i++) {
            strl_pack(packer, &m->share, strl_pack_zigzag(node->share[i] - last));
            last = node->share[i];
        }
    }
}

static bool read_shares(strl_node_mesh *node, uint32_t shares, models *m, strl_unpacker *unpacker)
{
    uint32_t last = 0, at = 0;
    for (uint32_t p = 0; p < node->mesh.point_count; p++) {
        uint32_t count = strl_unpack(unpacker, &m->share_count);
        if (count > shares - at)
            return false;
        node->share_first[p] = at;
        for (; count > 0; count--)
            node->share[at++] = last += strl_unpack_zigzag(strl_unpack(unpacker, &m->share));
    }
    node->share_first[node->mesh.point_count] = at;
    return at == shares;
}

strl_status strl_node_mesh_write(const strl_node_mesh *node, const strl_pm *payload, strl_arena *arena,
                                 strl_writer *writer, strl_error *err)
{
    const strl_mesh *mesh = &node->mesh;
    strl_packer packer = {.out = writer};
    float step = drift_step(mesh);
    models m = {0};
    place_table places;
    if (payload && !list_places(&places, payload, arena))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a node of %u triangles", mesh->triangle_count);
    strl_writer_u32(writer, mesh->point_count);
    strl_writer_u32(writer, mesh->wedge_count);
    strl_writer_u32(writer, mesh->triangle_count);
    strl_writer_u32(writer, node->share_first ? node->share_first[mesh->point_count] : NO_SHARES);
    strl_writer_bytes(writer, node->anchor, sizeof node->anchor);
    strl_writer_f32(writer, mesh->start_error);
    strl_writer_f32(writer, step);
    if (payload && !write_points(mesh, &places, &m, &packer))
        return strl__fail(err, STRL_ERR_INTERNAL, "a node's payload lacks a point of its base mesh");
    if (!payload)
        write_positions(mesh, &packer);
    write_wedges(mesh, &m, &packer);
    write_triangles(mesh, &m, &packer);
    write_drifts(mesh, step, &m, &packer);
    strl_pack_floats(&packer, &m.deviation, mesh->deviation, mesh->triangle_count);
    strl_pack_floats(&packer, &m.shift, mesh->shift, mesh->triangle_count);
    if (node->share_first)
        write_shares(node, &m, &packer);
    strl_pack_finish(&packer);
    return writer->failed
               ? strl__fail(err, STRL_ERR_MEMORY, "no memory for a node of %u triangles", mesh->triangle_count)
               : STRL_OK;
}

static bool read_arrays(strl_node_mesh *node, const strl_pm *payload, uint32_t shares, float step,
                        strl_unpacker *unpacker)
{
    strl_mesh *mesh = &node->mesh;
    models m = {0};
    bool good = !payload || read_points(mesh, payload, &m, unpacker);
    if (!payload)
        read_positions(mesh, unpacker);
    good = read_wedges(mesh, &m, unpacker) && good;
    good = good && read_triangles(mesh, &m, unpacker);
    read_drifts(mesh, step, &m, unpacker);
    strl_unpack_floats(unpacker, &m.deviation, mesh->deviation, mesh->triangle_count);
    strl_unpack_floats(unpacker, &m.shift, mesh->shift, mesh->triangle_count);
    if (node->share_first)
        good = read_shares(node, shares, &m, unpacker) && good;
    return good && !unpacker->failed;
}

strl_status strl_node_mesh_read(const void *data, size_t size, const strl_pm *payload, strl_arena *arena,
                                strl_node_mesh *node, strl_error *err)
{
    strl_cursor cursor = strl_cursor_make(data, size);
    uint32_t points = strl_cursor_u32(&cursor), wedges = strl_cursor_u32(&cursor);
    uint32_t triangles = strl_cursor_u32(&cursor), shares = strl_cursor_u32(&cursor);
    const uint8_t *anchor = strl_cursor_take(&cursor, sizeof node->anchor);
    float start_error = strl_cursor_f32(&cursor), step = strl_cursor_f32(&cursor);
    uint64_t bits = strl_cursor_left(&cursor) * 8;
    *node = (strl_node_mesh){0};
    /* every number takes a bit at least, so a damaged count costs no more memory than some times the bytes read */
    if (cursor.failed || points > bits || wedges > bits || triangles > bits || (shares != NO_SHARES && shares > bits))
        return strl__fail(err, STRL_ERR_INTERNAL, "a node's mesh in scratch is damaged");
    bool good = strl_mesh_create(&node->mesh, points, wedges, triangles, arena);
    if (good && shares != NO_SHARES) {
        node->share_first = strl_arena_alloc(arena, (size_t)points + 1, sizeof *node->share_first);
        node->share = strl_arena_alloc(arena, shares, sizeof *node->share);
        good = node->share_first && node->share;
    }
    if (!good)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a node of %u triangles", triangles);
    memcpy(node->anchor, anchor, sizeof node->anchor);
    node->mesh.start_error = start_error;
    strl_unpacker unpacker = strl_unpacker_make((const uint8_t *)data + cursor.at, size - cursor.at);
    return read_arrays(node, payload, shares, step, &unpacker)
               ? STRL_OK
               : strl__fail(err, STRL_ERR_INTERNAL, "a node's mesh in scratch is cut off or damaged");
}
