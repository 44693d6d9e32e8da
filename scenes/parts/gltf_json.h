/* Pieces of glTF's JSON, onto a stream. */
#ifndef STRL_SCENES_PARTS_GLTF_JSON_H
#define STRL_SCENES_PARTS_GLTF_JSON_H

#include "scenes/parts/writer.h"
#include "scenes/stream.h"

/* At most 400 characters. */
strl_status strl__json_print(strl__stream *stream, strl_error *err, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
/* ,"name":[..] with as few digits as tell each float from its neighbours. */
strl_status strl__json_floats(strl__stream *stream, const char *name, const float *values, int count, strl_error *err);
/* ,"translation":[..] and what else the place needs, nothing for the identity. Straight places get a scale, turned
 * parts a quaternion, turned groups a matrix: readers meet all of them. */
strl_status strl__json_place(strl__stream *stream, const strl__affine *place, bool as_matrix, strl_error *err);
strl_status strl__json_material(strl__stream *stream, const strl__material *material, strl_error *err);
/* A file's name as an URI: everything but letters, digits and -._~ is escaped. */
strl_status strl__json_uri(strl__stream *stream, const char *name, strl_error *err);

#endif
