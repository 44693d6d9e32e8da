/* PLY: vertices first (where they lie, or spilled), then one pass over all elements in file order
 * that turns faces and strips into batches. What cannot be understood is passed over by its
 * announced shape and must be there. */
#include "readers/ply.h"

#include <inttypes.h>
#include <string.h>

#include "base/fail.h"

static bool ply_recognises(const strl__input *input, uint64_t file_bytes)
{
    (void)file_bytes;
    return input->end - input->at >= 4 && memcmp(input->at, "ply", 3) == 0 &&
           (strl__is_line_end(input->at[3]) || strl__is_blank(input->at[3]));
}

static bool is_face_like(const strl__ply_element *element)
{
    return element->kind == STRL__PLY_FACE || element->kind == STRL__PLY_TRISTRIPS;
}

static strl_status check_elements(strl_reader *reader, strl_error *err)
{
    strl__ply_state *ply = reader->state;
    for (uint32_t i = 0; i < ply->header.element_count; i++) {
        const strl__ply_element *element = &ply->header.elements[i];
        if (element->kind == STRL__PLY_VERTEX) {
            ply->vertex_element = i;
            ply->vertex_count = element->count;
            if (element->count && !strl__ply_has(element, STRL__PLY_X, 3))
                return strl__fail(err, STRL_ERR_FORMAT, "%s: expected properties x, y and z in element 'vertex'",
                                  reader->path);
        }
        if (is_face_like(element) && element->count && !strl__ply_has(element, STRL__PLY_INDICES, 1))
            return strl__fail(err, STRL_ERR_FORMAT, "%s: expected a list property vertex_indices in element '%s'",
                              reader->path, element->name);
        if (element->kind == STRL__PLY_FACE)
            reader->triangles_hint += element->count;
        else if (element->kind == STRL__PLY_TRISTRIPS)
            reader->triangles_hint += reader->opened.bytes / 10; /* half the bytes, a little over an item each */
    }
    for (uint32_t i = 0; i < ply->header.element_count && ply->vertex_element == STRL__PLY_NO_ELEMENT; i++)
        if (is_face_like(&ply->header.elements[i]) && ply->header.elements[i].count)
            return strl__fail(err, STRL_ERR_FORMAT, "%s: expected an element 'vertex' beside element '%s', found none",
                              reader->path, ply->header.elements[i].name);
    return STRL_OK;
}

static strl_status ply_open(strl_reader *reader, strl_error *err)
{
    strl__ply_state *ply = reader->state;
    ply->vertex_element = STRL__PLY_NO_ELEMENT;
    strl_status status = strl__ply_header_read(&ply->header, &reader->input, err);
    return status ? status : check_elements(reader, err);
}

/* Finds the vertices, which stand behind other elements in some files. */
static strl_status ply_prepare(strl_reader *reader, strl_error *err)
{
    strl__ply_state *ply = reader->state;
    strl__input_seek(&reader->input, ply->header.data_offset, ply->header.data_line);
    strl_status status = STRL_OK;
    if (ply->vertex_element != STRL__PLY_NO_ELEMENT && ply->vertex_count > 0) {
        for (ply->element = 0; !status && ply->element < ply->vertex_element; ply->element++)
            status = strl__ply_skip_element(reader, err);
        if (!status)
            status = strl__ply_take_vertices(reader, err);
    }
    ply->vertices_end = strl__input_offset(&reader->input);
    ply->vertices_end_line = reader->input.line;
    return status ? status : strl__reader_init_batch(reader, true, err);
}

static strl_status ply_start(strl_reader *reader, strl_error *err)
{
    strl__ply_state *ply = reader->state;
    (void)err;
    ply->element = ply->property = 0;
    ply->record = 0;
    ply->in_strip = false;
    strl__input_seek(&reader->input, ply->header.data_offset, ply->header.data_line);
    reader->batch.has_corner_colour = ply->has_colour;
    return STRL_OK;
}

static strl_status read_index(strl_reader *reader, strl__scalar type, double *value, strl_error *err)
{
    return strl__ply_next_scalar(reader->state, &reader->input, type, value)
               ? STRL_OK
               : strl__ply_record_fail(reader, "a vertex index", err);
}

static bool is_index(const strl__ply_state *ply, double value)
{
    return value >= 0 && value < (double)ply->vertex_count && value == (double)(uint64_t)value;
}

/* The corners of a face, to the end of the batch. */
static strl_status read_corners(strl_reader *reader, const strl__ply_property *property, uint32_t *corner_count,
                                strl_error *err)
{
    strl__ply_state *ply = reader->state;
    uint64_t count;
    strl_status status = strl__ply_read_count(reader, property, &count, err);
    if (status)
        return status;
    if (count > STRL__POLYGON_CORNERS_MAX)
        return strl__ply_value_fail(reader, "a number of corners", STRL__POLYGON_CORNERS_MAX + 1, (double)count, err);
    uint64_t *indices = reader->batch.vertex + reader->batch.corner_count;
    for (uint64_t i = 0; i < count; i++) {
        double value;
        status = read_index(reader, property->type, &value, err);
        if (status)
            return status;
        if (!is_index(ply, value))
            return strl__ply_value_fail(reader, "a vertex index", ply->vertex_count, value, err);
        indices[i] = (uint64_t)value;
    }
    *corner_count = (uint32_t)count;
    return STRL_OK;
}

static strl_status read_face(strl_reader *reader, const strl__ply_element *element, strl_error *err)
{
    strl__ply_state *ply = reader->state;
    strl__face face = {0};
    uint8_t colour[4] = {255, 255, 255, 255};
    for (uint32_t i = 0; i < element->property_count; i++) {
        const strl__ply_property *property = &element->properties[i];
        strl_status status = STRL_OK;
        if (property->role == STRL__PLY_INDICES) {
            status = read_corners(reader, property, &face.corner_count, err);
        } else if (property->role >= STRL__PLY_RED && property->role <= STRL__PLY_ALPHA) {
            double value;
            if (!strl__ply_next_scalar(ply, &reader->input, property->type, &value))
                return strl__ply_record_fail(reader, "a colour", err);
            colour[property->role - STRL__PLY_RED] = strl__colour_channel(property->type, value);
        } else {
            status = strl__ply_skip_property(reader, property, err);
        }
        if (status)
            return status;
    }
    face.colour = strl__pack_colour(colour[0], colour[1], colour[2], colour[3]);
    if (face.corner_count < 3)
        reader->drops.degenerate_faces++;
    else
        strl__batch_add(&reader->batch, &face);
    return STRL_OK;
}

/* The shape that nearly all binary files have: nothing but a list with one byte for its length and
 * 32-bit indices. */
static bool is_plain(const strl__ply_state *ply, const strl__ply_element *element)
{
    const strl__ply_property *list = element->properties;
    bool wraps = list->type == STRL__I32 && ply->vertex_count > INT32_MAX;
    return !ply->header.ascii && element->property_count == 1 && list->count_type == STRL__U8 &&
           (list->type == STRL__I32 || list->type == STRL__U32) && !wraps;
}

/* Reads plain faces while nothing is odd about them; the first odd one, or the last ones, are
 * read_face's. */
static void read_plain_faces(strl_reader *reader, const strl__ply_element *element)
{
    strl__ply_state *ply = reader->state;
    strl__batch *batch = &reader->batch;
    strl__input *input = &reader->input;
    const bool big_endian = ply->header.big_endian;
    while (ply->record < element->count && !strl__batch_is_full(batch)) {
        if (!strl__input_want(input, 1 + 4 * 255))
            return;
        const uint32_t count = (uint8_t)*input->at;
        uint64_t *indices = batch->vertex + batch->corner_count;
        bool good = count >= 3;
        for (uint32_t i = 0; i < count; i++) {
            indices[i] = strl__load_32(input->at + 1 + 4 * i, big_endian);
            good = good && indices[i] < ply->vertex_count;
        }
        if (!good)
            return;
        input->at += 1 + 4 * count;
        strl__batch_add(batch, &(strl__face){.corner_count = count, .colour = 0xffffffffu});
        ply->record++;
    }
}

static strl_status fill_faces(strl_reader *reader, const strl__ply_element *element, strl_error *err)
{
    strl__ply_state *ply = reader->state;
    const bool plain = is_plain(ply, element);
    while (!strl__batch_is_full(&reader->batch)) {
        if (plain)
            read_plain_faces(reader, element);
        if (ply->record == element->count || strl__batch_is_full(&reader->batch))
            break;
        strl__ply_begin_record(reader);
        strl_status status = read_face(reader, element, err);
        if (status)
            return status;
        strl__ply_end_record(reader);
        ply->record++;
    }
    return STRL_OK;
}

/* One item of a strip: a vertex, or a negative number that begins the strip anew. */
static strl_status add_strip_item(strl_reader *reader, double value, strl_error *err)
{
    strl__ply_state *ply = reader->state;
    if (value < 0) {
        ply->strip_length = 0;
        ply->strip_odd = false;
        return STRL_OK;
    }
    if (!is_index(ply, value))
        return strl__ply_value_fail(reader, "a vertex index", ply->vertex_count, value, err);
    uint64_t index = (uint64_t)value;
    if (ply->strip_length == 2) {
        uint64_t *corners = reader->batch.vertex + reader->batch.corner_count;
        corners[0] = ply->strip[ply->strip_odd];
        corners[1] = ply->strip[!ply->strip_odd];
        corners[2] = index;
        strl__batch_add(&reader->batch, &(strl__face){.corner_count = 3, .colour = 0xffffffffu});
        ply->strip_odd = !ply->strip_odd;
        ply->strip_length = 1;
        ply->strip[0] = ply->strip[1];
    }
    ply->strip[ply->strip_length++] = index;
    return STRL_OK;
}

static strl_status fill_strip(strl_reader *reader, const strl__ply_property *property, strl_error *err)
{
    strl__ply_state *ply = reader->state;
    strl_status status = STRL_OK;
    if (!ply->in_strip) {
        status = strl__ply_read_count(reader, property, &ply->strip_left, err);
        ply->in_strip = !status;
        ply->strip_length = 0;
        ply->strip_odd = false;
    }
    for (; !status && ply->strip_left > 0 && !strl__batch_is_full(&reader->batch); ply->strip_left--) {
        double value;
        strl__ply_begin_record(reader); /* of the line */
        status = read_index(reader, property->type, &value, err);
        if (!status)
            status = add_strip_item(reader, value, err);
    }
    ply->in_strip = ply->in_strip && ply->strip_left > 0;
    return status;
}

static strl_status fill_strips(strl_reader *reader, const strl__ply_element *element, strl_error *err)
{
    strl__ply_state *ply = reader->state;
    strl_status status = STRL_OK;
    while (!status && ply->record < element->count && !strl__batch_is_full(&reader->batch)) {
        const strl__ply_property *property = &element->properties[ply->property];
        if (ply->property == 0 && !ply->in_strip)
            strl__ply_begin_record(reader);
        if (property->role == STRL__PLY_INDICES)
            status = fill_strip(reader, property, err);
        else
            status = strl__ply_skip_property(reader, property, err);
        if (status || ply->in_strip)
            continue;
        ply->property = (ply->property + 1) % element->property_count;
        if (ply->property == 0) {
            strl__ply_end_record(reader);
            ply->record++;
        }
    }
    return status;
}

/* Passes an element that makes no faces. */
static strl_status pass_element(strl_reader *reader, const strl__ply_element *element, strl_error *err)
{
    strl__ply_state *ply = reader->state;
    if (element->kind == STRL__PLY_VERTEX && element->count > 0) {
        strl__input_seek(&reader->input, ply->vertices_end, ply->vertices_end_line);
        return STRL_OK;
    }
    strl_status status = strl__ply_skip_element(reader, err);
    if (!status && element->kind == STRL__PLY_EDGE)
        reader->drops.lines += element->count;
    return status;
}

/* Padding may follow the last record. What else follows is not read, as other programs do it, but told: a count of the
 * header may be too small. */
static strl_status pass_rest(strl_reader *reader, strl_error *err)
{
    strl__input *input = &reader->input;
    strl__ply_begin_record(reader);
    do
        strl__text_skip_space(input);
    while (input->at < input->end && *input->at == 0 && strl__input_skip(input, 1));
    reader->drops.unread_bytes = strl__input_left(input);
    return strl__input_status(input, err);
}

static strl_status ply_fill(strl_reader *reader, strl_error *err)
{
    strl__ply_state *ply = reader->state;
    while (ply->element < ply->header.element_count && !strl__batch_is_full(&reader->batch)) {
        const strl__ply_element *element = &ply->header.elements[ply->element];
        bool makes_faces = is_face_like(element) && element->count > 0;
        strl_status status;
        if (!makes_faces) {
            status = pass_element(reader, element, err);
        } else if (element->kind == STRL__PLY_FACE) {
            reader->batch.has_face_colour = !ply->has_colour && strl__ply_has(element, STRL__PLY_RED, 3);
            status = fill_faces(reader, element, err);
        } else {
            status = fill_strips(reader, element, err);
        }
        if (status)
            return status;
        if (makes_faces && ply->record < element->count)
            continue;
        ply->element++;
        ply->record = 0;
        if (reader->batch.face_count > 0)
            return STRL_OK; /* the faces of the next element may differ in having colours */
    }
    if (ply->element < ply->header.element_count)
        return STRL_OK;
    reader->ended = true;
    return pass_rest(reader, err);
}

const strl__format strl__format_ply = {
    .name = "ply",
    .default_up = STRL_AXIS_Z,
    .state_bytes = sizeof(strl__ply_state),
    .recognises = ply_recognises,
    .open = ply_open,
    .prepare = ply_prepare,
    .start = ply_start,
    .fill = ply_fill,
};
