/* The table of a PLY file's vertices: in place where their records have a fixed size, else parsed
 * and spilled. */
#include "readers/ply.h"

#include <string.h>

/* Where the file's own vertex records have their attributes. */
static void layout_in_place(const strl__ply_state *ply, const strl__ply_element *element, strl__layout *layout)
{
    *layout = (strl__layout){.stride = element->stride, .big_endian = ply->header.big_endian};
    strl__field fields[STRL__PLY_ATTRIBUTES] = {0};
    for (uint32_t i = 0; i < element->property_count; i++) {
        const strl__ply_property *property = &element->properties[i];
        if (property->role < STRL__PLY_ATTRIBUTES)
            fields[property->role] = (strl__field){property->offset, property->type};
    }
    memcpy(layout->position, fields + STRL__PLY_X, sizeof layout->position);
    memcpy(layout->normal, fields + STRL__PLY_NORMAL_X, sizeof layout->normal);
    memcpy(layout->colour, fields + STRL__PLY_RED, sizeof layout->colour);
}

/* Of a record that was parsed and spilled: doubles, floats, bytes, in this machine's byte order. */
static void layout_spilled(const strl__ply_element *element, strl__layout *layout)
{
    *layout = (strl__layout){.big_endian = __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__};
    for (uint32_t i = 0; i < 3; i++)
        layout->position[i] = (strl__field){8 * i, STRL__F64};
    layout->stride = 24;
    for (uint32_t i = 0; i < 3; i++)
        layout->normal[i] = (strl__field){layout->stride + 4 * i, STRL__F32};
    layout->stride += strl__ply_has(element, STRL__PLY_NORMAL_X, 3) ? 12 : 0;
    for (uint32_t i = 0; i < 4; i++)
        layout->colour[i] = (strl__field){layout->stride + i, STRL__U8};
    layout->stride += strl__ply_has(element, STRL__PLY_RED, 3) ? 4 : 0;
}

static void pack_record(const strl__layout *layout, const double values[STRL__PLY_ATTRIBUTES],
                        const strl__scalar types[STRL__PLY_ATTRIBUTES], uint8_t *record)
{
    memcpy(record, values, 24);
    for (unsigned i = 0; layout->has_normal && i < 3; i++) {
        float component = (float)values[STRL__PLY_NORMAL_X + i];
        memcpy(record + layout->normal[i].offset, &component, sizeof component);
    }
    for (unsigned i = 0; layout->has_colour && i < 4; i++)
        record[layout->colour[i].offset] =
            i < 3 || layout->has_alpha ? strl__colour_channel(types[STRL__PLY_RED + i], values[STRL__PLY_RED + i])
                                       : 255;
}

static strl_status spill_vertex(strl_reader *reader, const strl__ply_element *element, strl_error *err)
{
    strl__ply_state *ply = reader->state;
    double values[STRL__PLY_ATTRIBUTES] = {0};
    strl__scalar types[STRL__PLY_ATTRIBUTES] = {0};
    for (uint32_t i = 0; i < element->property_count; i++) {
        const strl__ply_property *property = &element->properties[i];
        if (property->role >= STRL__PLY_ATTRIBUTES) {
            strl_status status = strl__ply_skip_property(reader, property, err);
            if (status)
                return status;
            continue;
        }
        types[property->role] = property->type;
        if (!strl__ply_next_scalar(ply, &reader->input, property->type, &values[property->role]))
            return strl__ply_record_fail(reader, "a number", err);
    }
    uint8_t record[40];
    pack_record(&reader->vertices.layout, values, types, record);
    return strl__table_append(&reader->vertices, record, err);
}

static strl_status spill_vertices(strl_reader *reader, const strl__ply_element *element, strl_error *err)
{
    strl__ply_state *ply = reader->state;
    strl_status status = STRL_OK;
    for (ply->record = 0; !status && ply->record < element->count; ply->record++) {
        strl__ply_begin_record(reader);
        status = spill_vertex(reader, element, err);
        strl__ply_end_record(reader);
    }
    return status ? status : strl__table_finish(&reader->vertices, err);
}

strl_status strl__ply_take_vertices(strl_reader *reader, strl_error *err)
{
    strl__ply_state *ply = reader->state;
    const strl__ply_element *element = &ply->header.elements[ply->element];
    bool in_place = !ply->header.ascii && !element->has_list;
    strl__layout layout;
    if (in_place)
        layout_in_place(ply, element, &layout);
    else
        layout_spilled(element, &layout);
    layout.has_position = true;
    layout.has_normal = strl__ply_has(element, STRL__PLY_NORMAL_X, 3);
    layout.has_colour = strl__ply_has(element, STRL__PLY_RED, 3);
    layout.has_alpha = layout.has_colour && strl__ply_has(element, STRL__PLY_ALPHA, 1);
    ply->has_colour = layout.has_colour;
    size_t window = (size_t)(reader->memory_bytes / 2);
    if (!in_place) {
        strl__table_build(&reader->vertices, &layout, reader->scratch_dir, window);
        return spill_vertices(reader, element, err);
    }
    strl__table_place(&reader->vertices, &layout, reader->file, strl__input_offset(&reader->input), element->count,
                      window);
    return strl__ply_skip_element(reader, err);
}
