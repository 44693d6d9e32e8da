/* PLY: a header that names elements, each a sequence of records made of the same properties; and
 * the pass over them. */
#ifndef STRL_READERS_PLY_H
#define STRL_READERS_PLY_H

#include <stdbool.h>
#include <stdint.h>

#include "readers/internal.h"
#include "readers/text.h"

#define STRL__PLY_ELEMENTS_MAX 64u
#define STRL__PLY_PROPERTIES_MAX 512u /* of all elements */
#define STRL__PLY_NAME_BYTES 48u      /* longer names are cut, in error messages only */

/* What a property means to us. The order of the first ten is the order of attributes in a corner.
 */
typedef enum strl__ply_role {
    STRL__PLY_X,
    STRL__PLY_Y,
    STRL__PLY_Z,
    STRL__PLY_NORMAL_X,
    STRL__PLY_NORMAL_Y,
    STRL__PLY_NORMAL_Z,
    STRL__PLY_RED,
    STRL__PLY_GREEN,
    STRL__PLY_BLUE,
    STRL__PLY_ALPHA,
    STRL__PLY_INDICES, /* a list */
    STRL__PLY_OTHER
} strl__ply_role;

#define STRL__PLY_ATTRIBUTES 10u

typedef enum strl__ply_kind {
    STRL__PLY_VERTEX,
    STRL__PLY_FACE,
    STRL__PLY_TRISTRIPS,
    STRL__PLY_EDGE,
    STRL__PLY_UNKNOWN
} strl__ply_kind;

typedef struct strl__ply_property {
    strl__ply_role role;
    strl__scalar type;       /* of the scalar, or of a list's items */
    strl__scalar count_type; /* of a list */
    bool is_list;
    uint32_t offset; /* in a record without lists */
} strl__ply_property;

typedef struct strl__ply_element {
    char name[STRL__PLY_NAME_BYTES];
    strl__ply_kind kind;
    uint64_t count;                       /* as announced: not to be trusted */
    const strl__ply_property *properties; /* in the header */
    uint32_t property_count;
    bool has_list;
    uint32_t stride; /* bytes of a binary record; of its scalars and list counts where it has lists */
    uint32_t roles;  /* bit 1 << role of the properties it has */
} strl__ply_element;

typedef struct strl__ply_header {
    bool ascii, big_endian;
    strl__ply_element elements[STRL__PLY_ELEMENTS_MAX];
    uint32_t element_count;
    strl__ply_property properties[STRL__PLY_PROPERTIES_MAX];
    uint32_t property_count;
    uint64_t data_offset; /* of the first record */
    uint64_t data_line;   /* ascii: its line */
} strl__ply_header;

/* Reads the header at the start of the input. What it promises is checked against the file's size.
 */
strl_status strl__ply_header_read(strl__ply_header *header, strl__input *input, strl_error *err);

static inline bool strl__ply_has(const strl__ply_element *element, strl__ply_role first, unsigned count)
{
    uint32_t wanted = ((1u << count) - 1) << first;
    return (element->roles & wanted) == wanted;
}

#define STRL__PLY_NO_ELEMENT UINT32_MAX

typedef struct strl__ply_state {
    strl__ply_header header;
    uint32_t vertex_element; /* STRL__PLY_NO_ELEMENT where there is none */
    uint64_t vertex_count;
    uint64_t vertices_end; /* byte after the last vertex */
    uint64_t vertices_end_line;
    bool has_colour;  /* of vertices */
    uint32_t element; /* the pass stands here: */
    uint64_t record;
    uint32_t property; /* of a strips record, which may span batches */
    bool in_strip;
    uint64_t strip_left;   /* items */
    uint64_t strip[2];     /* the last two */
    uint32_t strip_length; /* items since the last restart, at most 2 */
    bool strip_odd;        /* the next triangle is turned round */
} strl__ply_state;

/* The value that comes next. False where there is none; binary values are never wrong. */
static inline bool strl__ply_next_scalar(const strl__ply_state *ply, strl__input *input, strl__scalar type,
                                         double *value)
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

/* A record's first value comes next. In a text each record is a line; words beyond what the header
 * announces are passed over at its end, as Turk's own reader does (some programs write such). Only
 * a strip may go on in the next line. Comments may stand between lines: they are of the header, but
 * some programs write them here, and no record begins with a word. */
void strl__ply_begin_record(strl_reader *reader);
void strl__ply_end_record(strl_reader *reader);
/* The length of a list, checked against what is left of the file. */
strl_status strl__ply_read_count(strl_reader *reader, const strl__ply_property *property, uint64_t *count,
                                 strl_error *err);
strl_status strl__ply_skip_property(strl_reader *reader, const strl__ply_property *property, strl_error *err);
/* All records of the element at which the pass stands, from its first. */
strl_status strl__ply_skip_element(strl_reader *reader, strl_error *err);

/* "PATH, line (byte) N: expected WHAT, found .." at the element and record of the pass; or the
 * failed read. */
strl_status strl__ply_record_fail(strl_reader *reader, const char *what, strl_error *err);
/* "PATH, line (byte) N: expected WHAT below LIMIT, found FOUND", or the failed read. */
strl_status strl__ply_value_fail(strl_reader *reader, const char *what, uint64_t limit, double found, strl_error *err);

/* Fills the reader's table of vertices from the element at which the pass stands, and passes it. */
strl_status strl__ply_take_vertices(strl_reader *reader, strl_error *err);

#endif
