/* Writing a node payload: every array as it is, little-endian. docs/format-payload.md is normative. */
#include "geometry/payload.h"

#include "base/fail.h"

static void write_u16s(strl_writer *writer, const uint16_t *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        strl_writer_u16(writer, values[i]);
}

strl_status strl_payload_encode(const strl_pm *pm, strl_arena *scratch, strl_writer *writer, strl_error *err)
{
    (void)scratch;
    strl_status status = strl_pm_check(pm, err);
    if (status)
        return status;
    strl_writer_u8(writer, 0);
    strl_writer_u8(writer, (uint8_t)((pm->colour ? 1 : 0) | (pm->palette_index ? 2 : 0)));
    const uint32_t counts[] = {pm->vertex_count, pm->triangle_count, pm->step_count, pm->palette_count, pm->vertex_end[0],
                               pm->triangle_end[0]};
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++)
        strl_writer_u32(writer, counts[i]);
    for (size_t i = 0; i < (size_t)pm->vertex_count * 3; i++)
        strl_writer_u32(writer, (uint32_t)pm->position[i / 3][i % 3]);
    write_u16s(writer, pm->vertex_count ? pm->normal[0] : NULL, (size_t)pm->vertex_count * 2);
    for (size_t i = 0; pm->colour && i < pm->vertex_count; i++)
        strl_writer_u32(writer, pm->colour[i]);
    if (pm->palette_index)
        write_u16s(writer, pm->palette_index, pm->vertex_count);
    write_u16s(writer, pm->parent, pm->vertex_count);
    write_u16s(writer, pm->triangle_count ? pm->triangle[0] : NULL, (size_t)pm->triangle_count * 3);
    for (size_t i = 0; i <= pm->step_count; i++) {
        strl_writer_u32(writer, pm->vertex_end[i]);
        strl_writer_u32(writer, pm->triangle_end[i]);
        strl_writer_f32(writer, pm->geometric_error[i]);
        strl_writer_f32(writer, pm->appearance_error[i]);
    }
    for (size_t i = 0; i < pm->palette_count; i++) {
        strl_writer_u32(writer, pm->palette[i].part);
        strl_writer_u32(writer, pm->palette[i].material);
        strl_writer_u32(writer, pm->palette[i].rgba);
    }
    return writer->failed ? strl__fail(err, STRL_ERR_MEMORY, "no memory for a node payload") : STRL_OK;
}
