#include "build/container_facts.h"

#include <inttypes.h>
#include <string.h>

#include "base/fail.h"

strl_status strl_write_names(const strl_ingest *ingest, strl_container_writer *writer, strl_error *err)
{
    strl_status status = STRL_OK;
    for (size_t i = 0; i < ingest->parts.count && !status; i++)
        status = strl_container_writer_add_part(writer, ingest->parts.items[i], err);
    for (size_t i = 0; i < ingest->materials.count && !status; i++)
        status = strl_container_writer_add_material(writer, ingest->materials.items[i], ingest->materials.rgba[i], err);
    for (size_t i = 0; ingest->materials.images && i < ingest->materials.count && !status; i++)
        status = strl_container_writer_add_image(writer, &ingest->materials.images[i], err);
    return status;
}

bool strl__shows_colour(const strl_ingest *ingest)
{
    bool coloured = ingest->has_colours;
    for (size_t i = 0; i < ingest->materials.count; i++)
        coloured |= ingest->materials.rgba[i] != 0xffffffffu;
    return coloured;
}

strl_container_writer_desc strl_describe_container(const strl_build_context *context, const strl_ingest *ingest)
{
    const strl_build_result *result = context->result;
    strl_container_writer_desc desc = {
        .path = context->desc->output, .scratch_dir = context->scratch_dir, .part_dir = context->part_dir};
    memcpy(desc.info.unit, ingest->unit, sizeof desc.info.unit);
    desc.info.up_axis = (uint32_t)ingest->up;
    desc.info.has_colour = strl__shows_colour(ingest);
    desc.info.triangles_in = result->triangles_in;
    desc.info.dropped_nonfinite = result->dropped_nonfinite;
    desc.info.dropped_degenerate = result->dropped_degenerate;
    desc.info.dropped_lines = result->dropped_lines;
    desc.info.dropped_points = result->dropped_points;
    return desc;
}

strl_status strl_check_counts(const strl_build_result *result, strl_error *err)
{
    uint64_t dropped = result->dropped_nonfinite + result->dropped_degenerate;
    if (result->triangles_in >= dropped && result->triangles_in - dropped == result->triangles_leaf)
        return STRL_OK;
    return strl__fail(err, STRL_ERR_INTERNAL,
                      "%" PRIu64 " triangles came in and %" PRIu64 " were dropped, but the leaves have %" PRIu64,
                      result->triangles_in, dropped, result->triangles_leaf);
}
