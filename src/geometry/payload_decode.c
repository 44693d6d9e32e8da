/* Reading a node payload. docs/format-payload.md is normative. */
#include "geometry/payload.h"

#include <inttypes.h>

#include "base/fail.h"

static strl_status read_head(strl_cursor *cursor, strl_payload_sizes *sizes, uint8_t *flags, strl_error *err)
{
    uint8_t version = strl_cursor_u8(cursor);
    *flags = strl_cursor_u8(cursor);
    sizes->vertex_count = strl_cursor_u32(cursor);
    sizes->triangle_count = strl_cursor_u32(cursor);
    sizes->step_count = strl_cursor_u32(cursor);
    sizes->palette_count = strl_cursor_u32(cursor);
    sizes->base_vertex_count = strl_cursor_u32(cursor);
    sizes->base_triangle_count = strl_cursor_u32(cursor);
    if (cursor->failed || version != 0 || *flags > 3)
        return strl__fail(err, STRL_ERR_FORMAT, "node payload has version %u and flags %u, expected 0 and at most 3", version,
                          *flags);
    if (sizes->vertex_count > STRL_PM_MAX_VERTICES || sizes->triangle_count > STRL_PM_MAX_TRIANGLES ||
        sizes->step_count > sizes->vertex_count || sizes->palette_count < 1 || sizes->palette_count > STRL_PM_MAX_PALETTE ||
        sizes->base_vertex_count > sizes->vertex_count || sizes->base_triangle_count > sizes->triangle_count)
        return strl__fail(err, STRL_ERR_FORMAT, "node payload announces %" PRIu32 " vertices, %" PRIu32 " triangles and %" PRIu32
                          " steps, which is past the limits", sizes->vertex_count, sizes->triangle_count, sizes->step_count);
    size_t need = (size_t)sizes->vertex_count * (size_t)(18 + (*flags & 1) * 4 + (*flags >> 1) * 2) + (size_t)sizes->triangle_count * 6 +
                  ((size_t)sizes->step_count + 1) * 16 + (size_t)sizes->palette_count * 12;
    if (need != strl_cursor_left(cursor))
        return strl__fail(err, STRL_ERR_FORMAT, "node payload has %zu bytes after its head, expected %zu",
                          strl_cursor_left(cursor), need);
    return STRL_OK;
}

strl_status strl_payload_peek(const void *data, size_t size, strl_payload_sizes *sizes, strl_error *err)
{
    strl_cursor cursor = strl_cursor_make(data, size);
    uint8_t flags;
    return read_head(&cursor, sizes, &flags, err);
}

static uint16_t *read_u16s(strl_cursor *cursor, strl_arena *arena, size_t count)
{
    uint16_t *values = strl_arena_alloc(arena, count, sizeof *values);
    for (size_t i = 0; values && i < count; i++)
        values[i] = strl_cursor_u16(cursor);
    return values;
}

static uint32_t *read_u32s(strl_cursor *cursor, strl_arena *arena, size_t count)
{
    uint32_t *values = strl_arena_alloc(arena, count, sizeof *values);
    for (size_t i = 0; values && i < count; i++)
        values[i] = strl_cursor_u32(cursor);
    return values;
}

strl_status strl_payload_decode(const void *data, size_t size, strl_arena *arena, strl_pm *pm, strl_error *err)
{
    strl_cursor cursor = strl_cursor_make(data, size);
    strl_payload_sizes sizes;
    uint8_t flags;
    *pm = (strl_pm){0};
    strl_status status = read_head(&cursor, &sizes, &flags, err);
    if (status)
        return status;
    size_t vertices = sizes.vertex_count, states = (size_t)sizes.step_count + 1;
    strl_pm mesh = {.vertex_count = sizes.vertex_count, .triangle_count = sizes.triangle_count, .step_count = sizes.step_count,
                    .palette_count = sizes.palette_count};
    mesh.position = (int32_t(*)[3])read_u32s(&cursor, arena, vertices * 3);
    mesh.normal = (uint16_t(*)[2])read_u16s(&cursor, arena, vertices * 2);
    mesh.colour = flags & 1 ? read_u32s(&cursor, arena, vertices) : NULL;
    mesh.palette_index = flags & 2 ? read_u16s(&cursor, arena, vertices) : NULL;
    mesh.parent = read_u16s(&cursor, arena, vertices);
    mesh.triangle = (uint16_t(*)[3])read_u16s(&cursor, arena, (size_t)sizes.triangle_count * 3);
    mesh.vertex_end = strl_arena_alloc(arena, states, 4);
    mesh.triangle_end = strl_arena_alloc(arena, states, 4);
    mesh.geometric_error = strl_arena_alloc(arena, states, sizeof(float));
    mesh.appearance_error = strl_arena_alloc(arena, states, sizeof(float));
    mesh.palette = strl_arena_alloc(arena, sizes.palette_count, sizeof *mesh.palette);
    if (!mesh.position || !mesh.normal || (flags & 1 && !mesh.colour) || (flags & 2 && !mesh.palette_index) || !mesh.parent ||
        !mesh.triangle || !mesh.vertex_end || !mesh.triangle_end || !mesh.geometric_error || !mesh.appearance_error || !mesh.palette)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to decode a node payload");
    for (size_t i = 0; i < states; i++) {
        mesh.vertex_end[i] = strl_cursor_u32(&cursor);
        mesh.triangle_end[i] = strl_cursor_u32(&cursor);
        mesh.geometric_error[i] = strl_cursor_f32(&cursor);
        mesh.appearance_error[i] = strl_cursor_f32(&cursor);
    }
    for (size_t i = 0; i < sizes.palette_count; i++) {
        mesh.palette[i].part = strl_cursor_u32(&cursor);
        mesh.palette[i].material = strl_cursor_u32(&cursor);
        mesh.palette[i].rgba = strl_cursor_u32(&cursor);
    }
    status = strl_pm_check(&mesh, err);
    if (!status && (mesh.vertex_end[0] != sizes.base_vertex_count || mesh.triangle_end[0] != sizes.base_triangle_count))
        status = strl__fail(err, STRL_ERR_FORMAT, "node payload's head and states disagree on the base mesh");
    if (status)
        return err && status != STRL_ERR_FORMAT ? (err->status = STRL_ERR_FORMAT) : STRL_ERR_FORMAT;
    *pm = mesh;
    return STRL_OK;
}
