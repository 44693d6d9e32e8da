/* PLY: vertices first (where they lie, or spilled), then one pass over all elements in file order that turns faces and
 * strips into batches. What cannot be understood is passed over by its announced shape and must be there. */
#include "readers/ply.h"

#include <inttypes.h>
#include <string.h>

#include "base/fail.h"
#include "readers/internal.h"
#include "readers/text.h"

#define NO_ELEMENT UINT32_MAX

typedef struct ply_state {
    strl__ply_header header;
    uint32_t vertex_element; /* NO_ELEMENT where there is none */
    uint64_t vertex_count;
    uint64_t vertices_end;   /* byte after the last vertex */
    uint64_t vertices_end_line;
    bool has_colour;         /* of vertices */
    uint32_t element;        /* the pass stands here: */
    uint64_t record;
    uint32_t property;       /* of a strips record, which may span batches */
    bool in_strip;
    uint64_t strip_left;     /* items */
    uint64_t strip[2];       /* the last two */
    uint32_t strip_length;   /* items since the last restart, at most 2 */
    bool strip_odd;          /* the next triangle is turned round */
} ply_state;

static bool ply_recognises(const strl__input *input, uint64_t file_bytes)
{
    (void)file_bytes;
    return input->end - input->at >= 4 && memcmp(input->at, "ply", 3) == 0 && (strl__is_line_end(input->at[3]) || strl__is_blank(input->at[3]));
}

static bool is_face_like(const strl__ply_element *element)
{
    return element->kind == STRL__PLY_FACE || element->kind == STRL__PLY_TRISTRIPS;
}

static strl_status check_elements(strl_reader *reader, strl_error *err)
{
    ply_state *ply = reader->state;
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
    for (uint32_t i = 0; i < ply->header.element_count; i++)
        if (is_face_like(&ply->header.elements[i]) && ply->header.elements[i].count && ply->vertex_element == NO_ELEMENT)
            return strl__fail(err, STRL_ERR_FORMAT, "%s: expected an element 'vertex' beside element '%s', found none",
                              reader->path, ply->header.elements[i].name);
    return STRL_OK;
}

static strl_status ply_open(strl_reader *reader, strl_error *err)
{
    ply_state *ply = reader->state;
    ply->vertex_element = NO_ELEMENT;
    strl_status status = strl__ply_header_read(&ply->header, &reader->input, err);
    return status ? status : check_elements(reader, err);
}

/* "PATH, line (byte) N: expected WHAT (record R of N in element 'E'), found .." */
static strl_status record_fail(strl_reader *reader, const char *what, strl_error *err)
{
    ply_state *ply = reader->state;
    const strl__ply_element *element = &ply->header.elements[ply->element];
    if (ply->header.ascii)
        return strl__text_expected(&reader->input, what, err);
    strl_status failed = strl__input_status(&reader->input, err);
    return failed ? failed
                  : strl__fail(err, STRL_ERR_FORMAT, "%s, byte %" PRIu64 ": expected %s, found the end of the file in "
                               "record %" PRIu64 " of %" PRIu64 " of element '%s'", reader->path,
                               strl__input_offset(&reader->input), what, ply->record + 1, element->count,
                               element->name);
}

static strl_status value_fail(strl_reader *reader, const char *what, uint64_t limit, double found, strl_error *err)
{
    ply_state *ply = reader->state;
    uint64_t place = ply->header.ascii ? reader->input.line : strl__input_offset(&reader->input);
    strl_status failed = strl__input_status(&reader->input, err);
    if (failed)
        return failed;
    return strl__fail(err, STRL_ERR_FORMAT, "%s, %s %" PRIu64 ": expected %s below %" PRIu64 ", found %.17g",
                      reader->path, ply->header.ascii ? "line" : "before byte", place, what, limit, found);
}

/* In a text each record is a line; words beyond what the header announces are passed over, as Turk's own reader does
 * (some programs write such). Only a strip may go on in the next line. */
static void begin_record(strl_reader *reader)
{
    const ply_state *ply = reader->state;
    if (ply->header.ascii)
        strl__text_skip_space(&reader->input);
}

static void end_record(strl_reader *reader)
{
    const ply_state *ply = reader->state;
    if (ply->header.ascii)
        strl__text_skip_line(&reader->input);
}

static inline bool next_scalar(const ply_state *ply, strl__input *input, strl__scalar type, double *value)
{
    if (ply->header.ascii) {
        strl__text_skip_blanks(input);
        return strl__text_number(input, value);
    }
    unsigned bytes = strl__scalar_bytes(type);
    if (!strl__input_want(input, bytes))
        return false;
    *value = strl__scalar_load(type, input->at, ply->header.big_endian);
    input->at += bytes;
    return true;
}

/* The count of a list, checked against what is left of the file. */
static strl_status read_count(strl_reader *reader, const strl__ply_property *property, uint64_t *count, strl_error *err)
{
    ply_state *ply = reader->state;
    double value;
    if (!next_scalar(ply, &reader->input, property->count_type, &value))
        return record_fail(reader, "the length of a list", err);
    uint64_t item_bytes = ply->header.ascii ? 2 : strl__scalar_bytes(property->type);
    uint64_t limit = (strl__input_left(&reader->input) + 1) / item_bytes + 1;
    if (!(value >= 0 && value < (double)limit) || value != (double)(uint64_t)value)
        return value_fail(reader, "the length of a list", limit, value, err);
    *count = (uint64_t)value;
    return STRL_OK;
}

static strl_status skip_items(strl_reader *reader, strl__scalar type, uint64_t count, strl_error *err)
{
    ply_state *ply = reader->state;
    if (!ply->header.ascii)
        return strl__input_skip(&reader->input, count * strl__scalar_bytes(type)) ? STRL_OK
                                                                                   : record_fail(reader, "a list", err);
    double ignored;
    for (uint64_t i = 0; i < count; i++)
        if (!next_scalar(ply, &reader->input, type, &ignored))
            return record_fail(reader, "a number", err);
    return STRL_OK;
}

static strl_status skip_property(strl_reader *reader, const strl__ply_property *property, strl_error *err)
{
    uint64_t count = 1;
    strl_status status = property->is_list ? read_count(reader, property, &count, err) : STRL_OK;
    return status ? status : skip_items(reader, property->type, count, err);
}

/* All records of the element at which the pass stands, from its first. */
static strl_status skip_element(strl_reader *reader, strl_error *err)
{
    ply_state *ply = reader->state;
    const strl__ply_element *element = &ply->header.elements[ply->element];
    if (element->property_count == 0)
        return STRL_OK;
    if (!ply->header.ascii && !element->has_list) /* the product was checked with the header */
        return strl__input_skip(&reader->input, element->count * element->stride) ? STRL_OK
                                                                                  : record_fail(reader, "a record", err);
    strl_status status = STRL_OK;
    for (ply->record = 0; !status && ply->record < element->count; ply->record++) {
        begin_record(reader);
        for (uint32_t i = 0; !status && i < element->property_count; i++)
            status = skip_property(reader, &element->properties[i], err);
        end_record(reader);
    }
    return status;
}

/* Where the file's own vertex records have their attributes. */
static void layout_in_place(const ply_state *ply, const strl__ply_element *element, strl__layout *layout)
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
            i < 3 || layout->has_alpha ? strl__colour_channel(types[STRL__PLY_RED + i], values[STRL__PLY_RED + i]) : 255;
}

static strl_status spill_vertex(strl_reader *reader, const strl__ply_element *element, strl_error *err)
{
    ply_state *ply = reader->state;
    double values[STRL__PLY_ATTRIBUTES] = {0};
    strl__scalar types[STRL__PLY_ATTRIBUTES] = {0};
    for (uint32_t i = 0; i < element->property_count; i++) {
        const strl__ply_property *property = &element->properties[i];
        if (property->role >= STRL__PLY_ATTRIBUTES) {
            strl_status status = skip_property(reader, property, err);
            if (status)
                return status;
            continue;
        }
        types[property->role] = property->type;
        if (!next_scalar(ply, &reader->input, property->type, &values[property->role]))
            return record_fail(reader, "a number", err);
    }
    uint8_t record[40];
    pack_record(&reader->vertices.layout, values, types, record);
    return strl__table_append(&reader->vertices, record, err);
}

static strl_status spill_vertices(strl_reader *reader, const strl__ply_element *element, strl_error *err)
{
    ply_state *ply = reader->state;
    strl_status status = STRL_OK;
    for (ply->record = 0; !status && ply->record < element->count; ply->record++) {
        begin_record(reader);
        status = spill_vertex(reader, element, err);
        end_record(reader);
    }
    return status ? status : strl__table_finish(&reader->vertices, err);
}

static strl_status take_vertices(strl_reader *reader, strl_error *err)
{
    ply_state *ply = reader->state;
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
    return skip_element(reader, err);
}

/* Finds the vertices, which stand behind other elements in some files. */
static strl_status ply_prepare(strl_reader *reader, strl_error *err)
{
    ply_state *ply = reader->state;
    strl__input_seek(&reader->input, ply->header.data_offset, ply->header.data_line);
    strl_status status = STRL_OK;
    if (ply->vertex_element != NO_ELEMENT && ply->vertex_count > 0) {
        for (ply->element = 0; !status && ply->element < ply->vertex_element; ply->element++)
            status = skip_element(reader, err);
        if (!status)
            status = take_vertices(reader, err);
    }
    ply->vertices_end = strl__input_offset(&reader->input);
    ply->vertices_end_line = reader->input.line;
    return status ? status : strl__reader_init_batch(reader, true, err);
}

static strl_status ply_start(strl_reader *reader, strl_error *err)
{
    ply_state *ply = reader->state;
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
    return next_scalar(reader->state, &reader->input, type, value) ? STRL_OK
                                                                   : record_fail(reader, "a vertex index", err);
}

static bool is_index(const ply_state *ply, double value)
{
    return value >= 0 && value < (double)ply->vertex_count && value == (double)(uint64_t)value;
}

/* The corners of a face, to the end of the batch. */
static strl_status read_corners(strl_reader *reader, const strl__ply_property *property, uint32_t *corner_count,
                                strl_error *err)
{
    ply_state *ply = reader->state;
    uint64_t count;
    strl_status status = read_count(reader, property, &count, err);
    if (status)
        return status;
    if (count > STRL__POLYGON_CORNERS_MAX)
        return value_fail(reader, "a number of corners", STRL__POLYGON_CORNERS_MAX + 1, (double)count, err);
    uint64_t *indices = reader->batch.vertex + reader->batch.corner_count;
    for (uint64_t i = 0; i < count; i++) {
        double value;
        status = read_index(reader, property->type, &value, err);
        if (status)
            return status;
        if (!is_index(ply, value))
            return value_fail(reader, "a vertex index", ply->vertex_count, value, err);
        indices[i] = (uint64_t)value;
    }
    *corner_count = (uint32_t)count;
    return STRL_OK;
}

static strl_status read_face(strl_reader *reader, const strl__ply_element *element, strl_error *err)
{
    ply_state *ply = reader->state;
    strl__face face = {0};
    uint8_t colour[4] = {255, 255, 255, 255};
    for (uint32_t i = 0; i < element->property_count; i++) {
        const strl__ply_property *property = &element->properties[i];
        strl_status status = STRL_OK;
        if (property->role == STRL__PLY_INDICES) {
            status = read_corners(reader, property, &face.corner_count, err);
        } else if (property->role >= STRL__PLY_RED && property->role <= STRL__PLY_ALPHA) {
            double value;
            if (!next_scalar(ply, &reader->input, property->type, &value))
                return record_fail(reader, "a colour", err);
            colour[property->role - STRL__PLY_RED] = strl__colour_channel(property->type, value);
        } else {
            status = skip_property(reader, property, err);
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

/* The shape that nearly all binary files have: nothing but a list with one byte for its length and 32-bit indices. */
static bool is_plain(const ply_state *ply, const strl__ply_element *element)
{
    const strl__ply_property *list = element->properties;
    bool wraps = list->type == STRL__I32 && ply->vertex_count > INT32_MAX;
    return !ply->header.ascii && element->property_count == 1 && list->count_type == STRL__U8 &&
           (list->type == STRL__I32 || list->type == STRL__U32) && !wraps;
}

/* Reads plain faces while nothing is odd about them; the first odd one, or the last ones, are read_face's. */
static void read_plain_faces(strl_reader *reader, const strl__ply_element *element)
{
    ply_state *ply = reader->state;
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
    ply_state *ply = reader->state;
    const bool plain = is_plain(ply, element);
    while (!strl__batch_is_full(&reader->batch)) {
        if (plain)
            read_plain_faces(reader, element);
        if (ply->record == element->count || strl__batch_is_full(&reader->batch))
            break;
        begin_record(reader);
        strl_status status = read_face(reader, element, err);
        if (status)
            return status;
        end_record(reader);
        ply->record++;
    }
    return STRL_OK;
}

/* One item of a strip: a vertex, or a negative number that begins the strip anew. */
static strl_status add_strip_item(strl_reader *reader, double value, strl_error *err)
{
    ply_state *ply = reader->state;
    if (value < 0) {
        ply->strip_length = 0;
        ply->strip_odd = false;
        return STRL_OK;
    }
    if (!is_index(ply, value))
        return value_fail(reader, "a vertex index", ply->vertex_count, value, err);
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
    ply_state *ply = reader->state;
    strl_status status = STRL_OK;
    if (!ply->in_strip) {
        status = read_count(reader, property, &ply->strip_left, err);
        ply->in_strip = !status;
        ply->strip_length = 0;
        ply->strip_odd = false;
    }
    for (; !status && ply->strip_left > 0 && !strl__batch_is_full(&reader->batch); ply->strip_left--) {
        double value;
        if (ply->header.ascii)
            strl__text_skip_space(&reader->input);
        status = read_index(reader, property->type, &value, err);
        if (!status)
            status = add_strip_item(reader, value, err);
    }
    ply->in_strip = ply->in_strip && ply->strip_left > 0;
    return status;
}

static strl_status fill_strips(strl_reader *reader, const strl__ply_element *element, strl_error *err)
{
    ply_state *ply = reader->state;
    strl_status status = STRL_OK;
    while (!status && ply->record < element->count && !strl__batch_is_full(&reader->batch)) {
        const strl__ply_property *property = &element->properties[ply->property];
        if (ply->property == 0 && !ply->in_strip)
            begin_record(reader);
        if (property->role == STRL__PLY_INDICES)
            status = fill_strip(reader, property, err);
        else
            status = skip_property(reader, property, err);
        if (status || ply->in_strip)
            continue;
        ply->property = (ply->property + 1) % element->property_count;
        if (ply->property == 0) {
            end_record(reader);
            ply->record++;
        }
    }
    return status;
}

/* Passes an element that makes no faces. */
static strl_status pass_element(strl_reader *reader, const strl__ply_element *element, strl_error *err)
{
    ply_state *ply = reader->state;
    if (element->kind == STRL__PLY_VERTEX && element->count > 0) {
        strl__input_seek(&reader->input, ply->vertices_end, ply->vertices_end_line);
        return STRL_OK;
    }
    strl_status status = skip_element(reader, err);
    if (!status && element->kind == STRL__PLY_EDGE)
        reader->drops.lines += element->count;
    return status;
}

/* Padding may follow the last record. Anything else means that a count was too small: faces would be lost unseen. */
static strl_status check_end(strl_reader *reader, strl_error *err)
{
    ply_state *ply = reader->state;
    strl__input *input = &reader->input;
    do
        strl__text_skip_space(input);
    while (input->at < input->end && *input->at == 0 && strl__input_skip(input, 1));
    strl_status failed = strl__input_status(input, err);
    if (failed || input->at == input->end)
        return failed;
    if (ply->header.ascii)
        return strl__text_expected(input, "the end of the file after the last record that the header announces", err);
    return strl__fail(err, STRL_ERR_FORMAT, "%s, byte %" PRIu64 ": expected the end of the file after the last record "
                      "that the header announces, found %" PRIu64 " more bytes", reader->path,
                      strl__input_offset(input), strl__input_left(input));
}

static strl_status ply_fill(strl_reader *reader, strl_error *err)
{
    ply_state *ply = reader->state;
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
    return check_end(reader, err);
}

const strl__format strl__format_ply = {
    .name = "ply",
    .default_up = STRL_AXIS_Z,
    .state_bytes = sizeof(ply_state),
    .recognises = ply_recognises,
    .open = ply_open,
    .prepare = ply_prepare,
    .start = ply_start,
    .fill = ply_fill,
};
