/* A vertex of a step is told by its parent, a corner by the first vertex of its step; the rest by what is mostly
 * the same (store/pack.h). */
#include "build/clusters/pm_spill.h"

#include <string.h>

#include "base/fail.h"
#include "geometry/payload.h"
#include "store/pack.h"

/* The first byte. */
#define PACKED 0u
#define ENCODED 1u

#define HAS_COLOURS 1u
#define HAS_PALETTE 2u
#define HAS_TEXCOORDS 4u

typedef struct models {
    strl_pack_points base;
    strl_pack_model step_vertices, step_triangles, parent, position[3];
    strl_pack_model base_corner[3], is_new[3], new_corner[3], old_corner[3], part, material;
    strl_pack_steps normal[2];
    strl_pack_rgba colour;
    strl_pack_steps texcoord[2];
    strl_pack_same palette, geometric_error, appearance_error;
} models;

static void models_init(models *m)
{
    memset(m, 0, sizeof *m);
    strl_pack_points_init(&m->base);
}

/* What a vertex is told by: its parent, or the one before it. */
static inline uint32_t guide_of(const strl_pm *pm, uint32_t vertex)
{
    return vertex < pm->vertex_end[0] ? (vertex ? vertex - 1 : 0) : pm->parent[vertex];
}

/* ---- writing */

static void write_ends(const strl_pm *pm, models *m, strl_packer *packer)
{
    for (uint32_t s = 1; s <= pm->step_count; s++) {
        strl_pack(packer, &m->step_vertices, pm->vertex_end[s] - pm->vertex_end[s - 1] - 1);
        strl_pack(packer, &m->step_triangles, pm->triangle_end[s] - pm->triangle_end[s - 1]);
    }
}

static void write_errors(const strl_pm *pm, models *m, strl_packer *packer)
{
    strl_pack_floats(packer, &m->geometric_error, pm->geometric_error, (size_t)pm->step_count + 1);
    strl_pack_floats(packer, &m->appearance_error, pm->appearance_error, (size_t)pm->step_count + 1);
}

/* Vertices of a step are at one place. */
static void write_positions(const strl_pm *pm, models *m, strl_packer *packer)
{
    for (uint32_t v = 0; v < pm->vertex_end[0]; v++) {
        uint32_t position[3];
        memcpy(position, pm->position[v], sizeof position);
        strl_pack_point(packer, &m->base, position);
    }
    for (uint32_t s = 1; s <= pm->step_count; s++) {
        uint32_t v = pm->vertex_end[s - 1];
        for (unsigned k = 0; k < 3; k++)
            strl_pack(packer, &m->position[k],
                      strl_pack_zigzag((uint32_t)pm->position[v][k] - (uint32_t)pm->position[pm->parent[v]][k]));
    }
}

static void write_parents(const strl_pm *pm, models *m, strl_packer *packer)
{
    for (uint32_t s = 1; s <= pm->step_count; s++)
        for (uint32_t first = pm->vertex_end[s - 1], v = first; v < pm->vertex_end[s]; v++)
            strl_pack(packer, &m->parent, first - 1 - pm->parent[v]);
}

static void write_attributes(const strl_pm *pm, models *m, strl_packer *packer)
{
    for (uint32_t v = 0; v < pm->vertex_count; v++) {
        uint32_t guide = guide_of(pm, v);
        for (unsigned k = 0; k < 2; k++)
            strl_pack_step(packer, &m->normal[k], pm->normal[v][k], v ? pm->normal[guide][k] : 0);
        if (pm->colour)
            strl_pack_colour(packer, &m->colour, pm->colour[v], v ? pm->colour[guide] : 0);
        for (unsigned k = 0; k < 2 && pm->texcoord; k++)
            strl_pack_step(packer, &m->texcoord[k], pm->texcoord[v] >> 16 * k & 0xffff,
                           v ? pm->texcoord[guide] >> 16 * k & 0xffff : 0);
        if (pm->palette_index)
            strl_pack_beside(packer, &m->palette, pm->palette_index[v], v ? pm->palette_index[guide] : 0);
    }
}

static void write_triangles(const strl_pm *pm, models *m, strl_packer *packer)
{
    uint32_t next = 0;
    for (uint32_t t = 0; t < pm->triangle_end[0]; t++)
        for (unsigned c = 0; c < 3; c++)
            strl_pack_corner(packer, &m->base_corner[c], pm->triangle[t][c], &next);
    for (uint32_t s = 1; s <= pm->step_count; s++)
        for (uint32_t t = pm->triangle_end[s - 1], first = pm->vertex_end[s - 1]; t < pm->triangle_end[s]; t++)
            for (unsigned c = 0; c < 3; c++) {
                uint32_t vertex = pm->triangle[t][c];
                strl_pack(packer, &m->is_new[c], vertex >= first);
                strl_pack(packer, vertex >= first ? &m->new_corner[c] : &m->old_corner[c],
                          vertex >= first ? vertex - first : first - 1 - vertex);
            }
}

static void write_palette(const strl_pm *pm, models *m, strl_packer *packer)
{
    strl_palette_entry last = {0};
    for (uint32_t i = 0; i < pm->palette_count; i++) {
        const strl_palette_entry *entry = &pm->palette[i];
        strl_pack(packer, &m->part, strl_pack_zigzag(entry->part - last.part));
        strl_pack(packer, &m->material, strl_pack_zigzag(entry->material - last.material));
        strl__pack_bits(packer, 32, entry->rgba);
        last = *entry;
    }
}

/* Faces apart have three vertices each. */
bool strl_pm_spill_keeps_order(const strl_pm *pm)
{
    return pm->vertex_count / 9 <= pm->triangle_count / 4;
}

static void write_packed(const strl_pm *pm, strl_writer *writer)
{
    models m;
    strl_packer packer = {.out = writer};
    models_init(&m);
    strl_writer_u32(writer, pm->vertex_count);
    strl_writer_u32(writer, pm->triangle_count);
    strl_writer_u32(writer, pm->step_count);
    strl_writer_u32(writer, pm->palette_count);
    strl_writer_u32(writer, pm->vertex_end[0]);
    strl_writer_u32(writer, pm->triangle_end[0]);
    strl_writer_u32(writer, (pm->colour ? HAS_COLOURS : 0) | (pm->palette_index ? HAS_PALETTE : 0) |
                                (pm->texcoord ? HAS_TEXCOORDS : 0));
    write_ends(pm, &m, &packer);
    write_errors(pm, &m, &packer);
    write_parents(pm, &m, &packer);
    write_positions(pm, &m, &packer);
    write_attributes(pm, &m, &packer);
    write_triangles(pm, &m, &packer);
    write_palette(pm, &m, &packer);
    strl_pack_finish(&packer);
}

strl_status strl_pm_spill_write(const strl_pm *pm, strl_arena *scratch, strl_writer *writer, strl_error *err)
{
    bool packed = strl_pm_spill_keeps_order(pm);
    strl_writer_u8(writer, packed ? PACKED : ENCODED);
    if (!packed)
        return strl_payload_encode(pm, NULL, scratch, writer, NULL, err);
    write_packed(pm, writer);
    return writer->failed ? strl__fail(err, STRL_ERR_MEMORY, "no memory for a node of %u triangles", pm->triangle_count)
                          : STRL_OK;
}

/* ---- reading: the same in the same order; everything that is used as an index is checked before */

static bool read_ends(strl_pm *pm, models *m, strl_unpacker *unpacker)
{
    for (uint32_t s = 1; s <= pm->step_count; s++) {
        uint32_t vertices = strl_unpack(unpacker, &m->step_vertices),
                 triangles = strl_unpack(unpacker, &m->step_triangles);
        if (vertices >= pm->vertex_count - pm->vertex_end[s - 1] ||
            triangles > pm->triangle_count - pm->triangle_end[s - 1])
            return false;
        pm->vertex_end[s] = pm->vertex_end[s - 1] + vertices + 1;
        pm->triangle_end[s] = pm->triangle_end[s - 1] + triangles;
    }
    return pm->vertex_end[pm->step_count] == pm->vertex_count && pm->triangle_end[pm->step_count] == pm->triangle_count;
}

static void read_errors(strl_pm *pm, models *m, strl_unpacker *unpacker)
{
    strl_unpack_floats(unpacker, &m->geometric_error, pm->geometric_error, (size_t)pm->step_count + 1);
    strl_unpack_floats(unpacker, &m->appearance_error, pm->appearance_error, (size_t)pm->step_count + 1);
}

static bool read_parents(strl_pm *pm, models *m, strl_unpacker *unpacker)
{
    memset(pm->parent, 0, pm->vertex_end[0] * sizeof *pm->parent);
    for (uint32_t s = 1; s <= pm->step_count; s++)
        for (uint32_t first = pm->vertex_end[s - 1], v = first; v < pm->vertex_end[s]; v++) {
            uint32_t back = strl_unpack(unpacker, &m->parent);
            if (back >= first)
                return false;
            pm->parent[v] = (uint16_t)(first - 1 - back);
        }
    return true;
}

static void read_positions(strl_pm *pm, models *m, strl_unpacker *unpacker)
{
    for (uint32_t v = 0; v < pm->vertex_end[0]; v++) {
        uint32_t position[3];
        strl_unpack_point(unpacker, &m->base, position);
        memcpy(pm->position[v], position, sizeof position);
    }
    for (uint32_t s = 1; s <= pm->step_count; s++) {
        uint32_t first = pm->vertex_end[s - 1];
        for (unsigned k = 0; k < 3; k++)
            pm->position[first][k] = (int32_t)((uint32_t)pm->position[pm->parent[first]][k] +
                                               strl_unpack_zigzag(strl_unpack(unpacker, &m->position[k])));
        for (uint32_t v = first + 1; v < pm->vertex_end[s]; v++)
            memcpy(pm->position[v], pm->position[first], sizeof *pm->position);
    }
}

static void read_attributes(strl_pm *pm, models *m, strl_unpacker *unpacker)
{
    for (uint32_t v = 0; v < pm->vertex_count; v++) {
        uint32_t guide = guide_of(pm, v);
        for (unsigned k = 0; k < 2; k++)
            pm->normal[v][k] = (uint16_t)strl_unpack_step(unpacker, &m->normal[k], v ? pm->normal[guide][k] : 0);
        if (pm->colour)
            pm->colour[v] = strl_unpack_colour(unpacker, &m->colour, v ? pm->colour[guide] : 0);
        if (pm->texcoord)
            pm->texcoord[v] = 0;
        for (unsigned k = 0; k < 2 && pm->texcoord; k++)
            pm->texcoord[v] |=
                (strl_unpack_step(unpacker, &m->texcoord[k], v ? pm->texcoord[guide] >> 16 * k & 0xffff : 0) & 0xffff)
                << 16 * k;
        if (pm->palette_index)
            pm->palette_index[v] =
                (uint16_t)strl_unpack_beside(unpacker, &m->palette, v ? pm->palette_index[guide] : 0);
    }
}

static bool read_triangles(strl_pm *pm, models *m, strl_unpacker *unpacker)
{
    uint32_t next = 0;
    for (uint32_t t = 0; t < pm->triangle_end[0]; t++)
        for (unsigned c = 0; c < 3; c++) {
            uint32_t vertex = strl_unpack_corner(unpacker, &m->base_corner[c], &next);
            if (vertex >= pm->vertex_count)
                return false;
            pm->triangle[t][c] = (uint16_t)vertex;
        }
    for (uint32_t s = 1; s <= pm->step_count; s++)
        for (uint32_t t = pm->triangle_end[s - 1], first = pm->vertex_end[s - 1]; t < pm->triangle_end[s]; t++)
            for (unsigned c = 0; c < 3; c++) {
                bool is_new = strl_unpack(unpacker, &m->is_new[c]);
                uint32_t told = strl_unpack(unpacker, is_new ? &m->new_corner[c] : &m->old_corner[c]);
                uint32_t vertex = is_new ? first + told : first - 1 - told;
                if (vertex >= pm->vertex_count)
                    return false;
                pm->triangle[t][c] = (uint16_t)vertex;
            }
    return true;
}

static void read_palette(strl_pm *pm, models *m, strl_unpacker *unpacker)
{
    strl_palette_entry last = {0};
    for (uint32_t i = 0; i < pm->palette_count; i++) {
        last.part += strl_unpack_zigzag(strl_unpack(unpacker, &m->part));
        last.material += strl_unpack_zigzag(strl_unpack(unpacker, &m->material));
        last.rgba = strl__unpack_bits(unpacker, 32);
        pm->palette[i] = last;
    }
}

static bool read_arrays(strl_pm *pm, strl_unpacker *unpacker)
{
    models m;
    models_init(&m);
    if (!read_ends(pm, &m, unpacker))
        return false;
    read_errors(pm, &m, unpacker);
    if (!read_parents(pm, &m, unpacker))
        return false;
    read_positions(pm, &m, unpacker);
    read_attributes(pm, &m, unpacker);
    if (!read_triangles(pm, &m, unpacker))
        return false;
    read_palette(pm, &m, unpacker);
    return !unpacker->failed;
}

strl_status strl_pm_spill_read(const void *data, size_t size, strl_arena *arena, strl_pm *pm, strl_error *err)
{
    strl_cursor cursor = strl_cursor_make(data, size);
    uint8_t kind = strl_cursor_u8(&cursor);
    if (!cursor.failed && kind == ENCODED)
        return strl_payload_decode((const uint8_t *)data + 1, size - 1, NULL, arena, pm, err);
    *pm = (strl_pm){0};
    pm->vertex_count = strl_cursor_u32(&cursor);
    pm->triangle_count = strl_cursor_u32(&cursor);
    pm->step_count = strl_cursor_u32(&cursor);
    pm->palette_count = strl_cursor_u32(&cursor);
    uint32_t vertices = strl_cursor_u32(&cursor), triangles = strl_cursor_u32(&cursor),
             flags = strl_cursor_u32(&cursor);
    if (cursor.failed || kind != PACKED || pm->vertex_count > STRL_PM_MAX_VERTICES ||
        pm->triangle_count > STRL_PM_MAX_TRIANGLES || pm->palette_count == 0 ||
        pm->palette_count > STRL_PM_MAX_PALETTE || vertices > pm->vertex_count || triangles > pm->triangle_count ||
        pm->step_count > pm->vertex_count - vertices)
        return strl__fail(err, STRL_ERR_INTERNAL, "a node's progressive mesh in scratch is damaged");
    if (!strl_pm_create(pm, flags & HAS_COLOURS, flags & HAS_PALETTE, flags & HAS_TEXCOORDS, arena))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a node of %u triangles", pm->triangle_count);
    pm->vertex_end[0] = vertices;
    pm->triangle_end[0] = triangles;
    strl_unpacker unpacker = strl_unpacker_make((const uint8_t *)data + cursor.at, size - cursor.at);
    if (!read_arrays(pm, &unpacker) || strl_pm_check(pm, NULL))
        return strl__fail(err, STRL_ERR_INTERNAL, "a node's progressive mesh in scratch is cut off or damaged");
    return STRL_OK;
}
