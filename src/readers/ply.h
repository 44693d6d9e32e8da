/* The header of a PLY file: elements, each a sequence of records made of the same properties. */
#ifndef STRL_READERS_PLY_H
#define STRL_READERS_PLY_H

#include <stdbool.h>
#include <stdint.h>

#include "readers/input.h"
#include "readers/record.h"
#include "stroll/error.h"

#define STRL__PLY_ELEMENTS_MAX 64u
#define STRL__PLY_PROPERTIES_MAX 512u /* of all elements */
#define STRL__PLY_NAME_BYTES 48u      /* longer names are cut, in error messages only */

/* What a property means to us. The order of the first ten is the order of attributes in a corner. */
typedef enum strl__ply_role {
    STRL__PLY_X, STRL__PLY_Y, STRL__PLY_Z,
    STRL__PLY_NORMAL_X, STRL__PLY_NORMAL_Y, STRL__PLY_NORMAL_Z,
    STRL__PLY_RED, STRL__PLY_GREEN, STRL__PLY_BLUE, STRL__PLY_ALPHA,
    STRL__PLY_INDICES, /* a list */
    STRL__PLY_OTHER
} strl__ply_role;

#define STRL__PLY_ATTRIBUTES 10u

typedef enum strl__ply_kind {
    STRL__PLY_VERTEX, STRL__PLY_FACE, STRL__PLY_TRISTRIPS, STRL__PLY_EDGE, STRL__PLY_UNKNOWN
} strl__ply_kind;

typedef struct strl__ply_property {
    strl__ply_role role;
    strl__scalar type;       /* of the scalar, or of a list's items */
    strl__scalar count_type; /* of a list */
    bool is_list;
    uint32_t offset;         /* in a record without lists */
} strl__ply_property;

typedef struct strl__ply_element {
    char name[STRL__PLY_NAME_BYTES];
    strl__ply_kind kind;
    uint64_t count;                       /* as announced: not to be trusted */
    const strl__ply_property *properties; /* in the header */
    uint32_t property_count;
    bool has_list;
    uint32_t stride;      /* bytes of a binary record; of its scalars and list counts where it has lists */
    uint32_t roles;       /* bit 1 << role of the properties it has */
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

/* Reads the header at the start of the input. What it promises is checked against the file's size. */
strl_status strl__ply_header_read(strl__ply_header *header, strl__input *input, strl_error *err);

static inline bool strl__ply_has(const strl__ply_element *element, strl__ply_role first, unsigned count)
{
    uint32_t wanted = ((1u << count) - 1) << first;
    return (element->roles & wanted) == wanted;
}

#endif
