/* STL, ascii and binary. Binary is recognised by its size, 84 + 50 n, because binary files may
 * begin with "solid" too. The facets' normals are not passed on: they follow from the corners, are
 * often zero or wrong, and would make every corner of a smooth model its own vertex. The two
 * attribute bytes have no agreed meaning and are skipped. */
#include <inttypes.h>
#include <string.h>

#include "base/fail.h"
#include "readers/internal.h"
#include "readers/text.h"

#define HEADER_BYTES 84u
#define FACET_BYTES 50u

typedef struct stl_state {
    bool binary;
    uint64_t facet_count; /* announced */
    uint64_t facet;       /* binary: the next one */
    bool in_solid, in_facet;
    uint32_t part;                       /* of the solid */
    bool part_known;                     /* the solid had a facet already */
    char name[STRL__NAME_BYTES_MAX + 1]; /* of the solid */
    size_t name_length;
    uint32_t vertex_count; /* of the facet */
} stl_state;

static bool has_binary_size(const strl__input *input, uint64_t file_bytes, uint64_t *facet_count)
{
    if (input->end - input->at < (ptrdiff_t)HEADER_BYTES)
        return false;
    *facet_count = strl__load_32(input->at + HEADER_BYTES - 4, false);
    return file_bytes == HEADER_BYTES + FACET_BYTES * *facet_count;
}

static bool begins_with_solid(const strl__input *input)
{
    const char *at = input->at;
    if (input->end - at >= 3 && memcmp(at, "\xef\xbb\xbf", 3) == 0)
        at += 3;
    while (strl__is_blank(*at) || strl__is_line_end(*at))
        at++;
    for (const char *word = "solid"; *word; word++, at++)
        if ((*at | 0x20) != *word)
            return false;
    return strl__is_blank(*at) || strl__is_line_end(*at) || at == input->end;
}

static bool stl_recognises(const strl__input *input, uint64_t file_bytes)
{
    uint64_t facet_count;
    return has_binary_size(input, file_bytes, &facet_count) || begins_with_solid(input);
}

static strl_status stl_open(strl_reader *reader, strl_error *err)
{
    stl_state *stl = reader->state;
    strl__input *input = &reader->input;
    uint64_t file_bytes = reader->opened.bytes;
    strl__input_want(input, STRL__TOKEN_BYTES);
    strl_status status = strl__input_status(input, err);
    if (status)
        return status;
    size_t seen = (size_t)(input->end - input->at);
    bool has_zero = memchr(input->at, 0, seen < 1024 ? seen : 1024) != NULL;
    stl->binary = has_binary_size(input, file_bytes, &stl->facet_count) || has_zero;
    if (!stl->binary) {
        reader->triangles_hint = file_bytes / 240 + 1;
        return STRL_OK;
    }
    if (file_bytes < HEADER_BYTES)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "%s: expected the 84 bytes of a binary STL header, found a file of %" PRIu64 " bytes",
                          reader->path, file_bytes);
    uint64_t expected = HEADER_BYTES + FACET_BYTES * stl->facet_count;
    if (file_bytes != expected)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "%s, byte 80: announces %" PRIu64 " triangles, for which %" PRIu64
                          " bytes were expected, found a file of %" PRIu64 " bytes",
                          reader->path, stl->facet_count, expected, file_bytes);
    reader->triangles_hint = stl->facet_count;
    return STRL_OK;
}

static strl_status stl_prepare(strl_reader *reader, strl_error *err)
{
    return strl__reader_init_batch(reader, false, err);
}

static strl_status stl_start(strl_reader *reader, strl_error *err)
{
    stl_state *stl = reader->state;
    stl->facet = 0;
    stl->in_solid = stl->in_facet = stl->part_known = false;
    stl->name_length = 0;
    (void)err;
    strl__input_seek(&reader->input, stl->binary ? HEADER_BYTES : 0, 1);
    if (!stl->binary)
        strl__text_skip_byte_order_mark(&reader->input);
    return STRL_OK;
}

static void set_corner(strl__corner *corner, const double position[3])
{
    memcpy(corner->position, position, sizeof corner->position);
    memset(corner->normal, 0, sizeof corner->normal);
    corner->colour = 0xffffffffu;
}

static strl_status fill_binary(strl_reader *reader, strl_error *err)
{
    stl_state *stl = reader->state;
    strl__batch *batch = &reader->batch;
    strl__input *input = &reader->input;
    for (; stl->facet < stl->facet_count && !strl__batch_is_full(batch); stl->facet++) {
        if (!strl__input_want(input, FACET_BYTES)) {
            strl_status failed = strl__input_status(input, err);
            return failed ? failed
                          : strl__fail(err, STRL_ERR_FORMAT,
                                       "%s, byte %" PRIu64 ": expected triangle %" PRIu64 " of %" PRIu64
                                       ", found the end of the file",
                                       reader->path, strl__input_offset(input), stl->facet + 1, stl->facet_count);
        }
        for (unsigned corner = 0; corner < 3; corner++) {
            double position[3];
            for (unsigned axis = 0; axis < 3; axis++)
                position[axis] = (double)strl__load_f32(input->at + 12 + 12 * corner + 4 * axis, false);
            set_corner(&batch->corners[batch->corner_count + corner], position);
        }
        input->at += FACET_BYTES;
        strl__batch_add(batch, &(strl__face){.corner_count = 3, .colour = 0xffffffffu});
    }
    reader->ended = stl->facet == stl->facet_count;
    return STRL_OK;
}

static strl_status end_facet(strl_reader *reader, strl_error *err)
{
    stl_state *stl = reader->state;
    stl->in_facet = false;
    if (stl->vertex_count < 3) {
        reader->drops.degenerate_faces++;
        return STRL_OK;
    }
    if (!stl->part_known) {
        strl_status status = strl__names_add(&reader->parts, stl->name, stl->name_length, &stl->part, err);
        if (status)
            return strl__fail_context(err, status, "%s, line %" PRIu64, reader->path, reader->input.line);
        stl->part_known = true;
    }
    strl__batch_add(&reader->batch, &(strl__face){stl->vertex_count, stl->part, 0, 0xffffffffu});
    return STRL_OK;
}

static strl_status read_vertex(strl_reader *reader, strl_error *err)
{
    stl_state *stl = reader->state;
    double position[3];
    for (unsigned axis = 0; axis < 3; axis++) {
        strl__text_skip_space(&reader->input);
        if (!strl__text_number(&reader->input, &position[axis]))
            return strl__text_expected(&reader->input, "a coordinate", err);
    }
    if (stl->vertex_count == STRL__POLYGON_CORNERS_MAX)
        return strl__fail(err, STRL_ERR_LIMIT, "%s, line %" PRIu64 ": expected at most %u vertices in a facet",
                          reader->path, reader->input.line, STRL__POLYGON_CORNERS_MAX);
    set_corner(&reader->batch.corners[reader->batch.corner_count + stl->vertex_count++], position);
    return STRL_OK;
}

static void begin_solid(strl_reader *reader)
{
    stl_state *stl = reader->state;
    strl__text_skip_blanks(&reader->input);
    size_t length = strl__text_rest_of_line(&reader->input);
    stl->name_length = length < sizeof stl->name ? length : sizeof stl->name - 1;
    memcpy(stl->name, reader->input.at, stl->name_length);
    stl->in_solid = true;
    stl->part_known = false;
    strl__text_skip_line(&reader->input);
}

/* "normal x y z", which may be missing. */
static strl_status begin_facet(strl_reader *reader, strl_error *err)
{
    stl_state *stl = reader->state;
    strl__input *input = &reader->input;
    stl->in_facet = true;
    stl->vertex_count = 0;
    strl__text_skip_blanks(input);
    if (!strl__text_token_is_caseless(input, "normal"))
        return STRL_OK;
    input->at += 6;
    for (unsigned axis = 0; axis < 3; axis++) {
        strl__text_skip_space(input);
        if (input->at == input->end)
            return strl__text_expected(input, "a component of the normal", err);
        input->at += strl__text_token(input);
    }
    return STRL_OK;
}

/* One statement outside a facet. */
static strl_status read_solid(strl_reader *reader, strl_error *err)
{
    stl_state *stl = reader->state;
    strl__input *input = &reader->input;
    if (!stl->in_solid) {
        if (!strl__text_token_is_caseless(input, "solid"))
            return strl__text_expected(input, "'solid'", err);
        input->at += 5;
        begin_solid(reader);
    } else if (strl__text_token_is_caseless(input, "facet")) {
        input->at += 5;
        return begin_facet(reader, err);
    } else if (strl__text_token_is_caseless(input, "endsolid")) {
        stl->in_solid = false;
        strl__text_skip_line(input);
    } else if (strl__text_token_is_caseless(input, "color")) { /* an extension of some programs */
        strl__text_skip_line(input);
    } else {
        return strl__text_expected(input, "'facet' or 'endsolid'", err);
    }
    return STRL_OK;
}

/* One statement inside a facet. */
static strl_status read_facet(strl_reader *reader, strl_error *err)
{
    strl__input *input = &reader->input;
    if (strl__text_token_is_caseless(input, "vertex")) {
        input->at += 6;
        return read_vertex(reader, err);
    }
    if (strl__text_token_is_caseless(input, "endfacet")) {
        input->at += 8;
        return end_facet(reader, err);
    }
    if (!strl__text_token_is_caseless(input, "outer") && !strl__text_token_is_caseless(input, "endloop"))
        return strl__text_expected(input, "'outer loop', 'vertex', 'endloop' or 'endfacet'", err);
    input->at += strl__text_token(input);
    strl__text_skip_blanks(input);
    if (strl__text_token_is_caseless(input, "loop"))
        input->at += 4;
    return STRL_OK;
}

static strl_status fill_ascii(strl_reader *reader, strl_error *err)
{
    stl_state *stl = reader->state;
    strl__input *input = &reader->input;
    /* A facet under way keeps its corners at the end of the batch, so the batch is left only
     * between facets. */
    while (stl->in_facet || !strl__batch_is_full(&reader->batch)) {
        strl__text_skip_space(input);
        strl_status status = STRL_OK;
        if (*input->at == '#')
            strl__text_skip_line(input);
        else if (input->at == input->end && !stl->in_solid)
            break;
        else
            status = stl->in_facet ? read_facet(reader, err) : read_solid(reader, err);
        if (status)
            return status;
    }
    if (input->at != input->end || strl__input_left(input) > 0)
        return STRL_OK;
    reader->ended = !stl->in_solid;
    return strl__input_status(input, err);
}

static strl_status stl_fill(strl_reader *reader, strl_error *err)
{
    stl_state *stl = reader->state;
    return stl->binary ? fill_binary(reader, err) : fill_ascii(reader, err);
}

const strl__format strl__format_stl = {
    .name = "stl",
    .default_up = STRL_AXIS_Z,
    .state_bytes = sizeof(stl_state),
    .weak = true,
    .recognises = stl_recognises,
    .open = stl_open,
    .prepare = stl_prepare,
    .start = stl_start,
    .fill = stl_fill,
};
