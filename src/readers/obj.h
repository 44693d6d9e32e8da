/* What the files of the OBJ reader share. */
#ifndef STRL_READERS_OBJ_H
#define STRL_READERS_OBJ_H

#include "readers/internal.h"

typedef struct strl__obj_name {
    char text[STRL__NAME_BYTES_MAX + 1];
    size_t length;
} strl__obj_name;

typedef struct strl__obj {
    strl__names library;    /* materials that the mtllibs define */
    bool has_library;       /* the names were initialised */
    bool has_colour;        /* some vertex has one */
    bool has_images;        /* of materials of the library; and there are coordinates for them */
    uint64_t vertices_seen; /* of this pass, so far: what negative indices count from */
    uint64_t normals_seen, texcoords_seen;
    uint64_t others; /* lines that no statement read here begins */
    strl__obj_name object, group, material;
    uint32_t part_index, material_index;
    bool part_known, material_known; /* the indices fit the names */
    strl__footprint *footprints;     /* owned; of the texture coordinates; NULL: all have the same */
} strl__obj;

/* ---- obj.c */
strl_status strl__obj_start(strl_reader *reader, strl_error *err);
strl_status strl__obj_fill(strl_reader *reader, strl_error *err);

/* ---- obj_paint.c: corners under an image */
/* For the reader's textures; context: the reader. */
strl_status strl__obj_open_picture(void *context, const strl__picture *picture, const char *ending,
                                   strl__picture_place *found, strl_error *err);
/* What each texture coordinate stands for of its image, by a pass over all faces. Needs the batch
 * and the table of texture coordinates. */
strl_status strl__obj_measure(strl_reader *reader, strl_error *err);
/* The images times the colours of the batch's corners, which are resolved. */
strl_status strl__obj_paint(strl_reader *reader, strl_error *err);

#endif
