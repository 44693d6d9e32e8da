#include "readers/record.h"

uint8_t strl__colour_channel(strl__scalar type, double value)
{
    if (value != value)
        return 255;
    if (type == STRL__F32 || type == STRL__F64)
        value *= 255;
    else if (type == STRL__I16 || type == STRL__U16)
        value /= 257;
    if (value <= 0)
        return 0;
    return value >= 255 ? 255 : (uint8_t)(value + 0.5);
}

static void decode_position(const strl__layout *layout, const uint8_t *record, double position[3])
{
    const strl__field *field = layout->position;
    if (field[0].type == STRL__F32 && field[1].type == STRL__F32 && field[2].type == STRL__F32) {
        for (unsigned axis = 0; axis < 3; axis++)
            position[axis] = (double)strl__load_f32(record + field[axis].offset, layout->big_endian);
    } else if (field[0].type == STRL__F64 && field[1].type == STRL__F64 && field[2].type == STRL__F64) {
        for (unsigned axis = 0; axis < 3; axis++)
            position[axis] = strl__load_f64(record + field[axis].offset, layout->big_endian);
    } else {
        for (unsigned axis = 0; axis < 3; axis++)
            position[axis] = strl__scalar_load(field[axis].type, record + field[axis].offset, layout->big_endian);
    }
}

static void decode_normal(const strl__layout *layout, const uint8_t *record, float normal[3])
{
    bool finite = true;
    for (unsigned axis = 0; axis < 3; axis++) {
        const strl__field *field = &layout->normal[axis];
        normal[axis] = (float)strl__scalar_load(field->type, record + field->offset, layout->big_endian);
        finite = finite && __builtin_isfinite(normal[axis]);
    }
    if (!finite)
        memset(normal, 0, 3 * sizeof *normal);
}

static uint32_t decode_colour(const strl__layout *layout, const uint8_t *record)
{
    uint8_t channel[4] = {255, 255, 255, 255};
    for (unsigned i = 0; i < (layout->has_alpha ? 4u : 3u); i++) {
        const strl__field *field = &layout->colour[i];
        const uint8_t *bytes = record + field->offset;
        channel[i] = field->type == STRL__U8
                         ? *bytes
                         : strl__colour_channel(field->type, strl__scalar_load(field->type, bytes, layout->big_endian));
    }
    return strl__pack_colour(channel[0], channel[1], channel[2], channel[3]);
}

void strl__layout_decode(const strl__layout *layout, const uint8_t *record, strl__corner *corner)
{
    if (layout->has_position)
        decode_position(layout, record, corner->position);
    if (layout->has_normal)
        decode_normal(layout, record, corner->normal);
    if (layout->has_colour)
        corner->colour = decode_colour(layout, record);
    for (unsigned axis = 0; layout->has_texcoord && axis < 2; axis++)
        corner->texcoord[axis] = (float)strl__scalar_load(layout->texcoord[axis].type,
                                                          record + layout->texcoord[axis].offset, layout->big_endian);
}
