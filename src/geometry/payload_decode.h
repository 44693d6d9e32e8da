/* The decoder's parts. Internal to the payload codec. */
#ifndef STRL_GEOMETRY_PAYLOAD_DECODE_H
#define STRL_GEOMETRY_PAYLOAD_DECODE_H

#include "geometry/payload.h"
#include "geometry/payload_mesh.h"
#include "geometry/payload_streams.h"

struct strl__decoder {
    strl_payload_sizes sizes;
    uint32_t normal_most; /* the largest coordinate of a normal, as the payload holds it */
    struct strl__streams_in in;
    struct strl__mesh mesh;
    strl_pm *pm;
    const strl_payload_reference *reference; /* or NULL */
    uint32_t copied;                         /* vertices copied from it: the first numbers */
    uint16_t *copied_from;                   /* [base vertices + 3], vertices of the reference; copied of them hold */
    uint16_t *from; /* [base vertices + 3], the vertex that predicts colour and palette index */
    strl_arena *scratch;
    strl_error *err;
};

/* What the base mesh has of the reference, then its other vertices and triangles. */
strl_status strl__decode_copies(struct strl__decoder *decoder);
strl_status strl__decode_base(struct strl__decoder *decoder);
/* All steps: vertices, parents, triangles. */
strl_status strl__decode_steps(struct strl__decoder *decoder);
/* Normals, colours, palette, errors. */
strl_status strl__decode_attributes(struct strl__decoder *decoder);

static inline void strl__pull_position(struct strl__streams_in *in, unsigned id, const uint32_t predicted[3],
                                       int32_t position[3])
{
    for (unsigned k = 0; k < 3; k++)
        position[k] = (int32_t)(predicted[k] + strl__unzigzag(strl__pull(in, id + k)));
}

#endif
