/* The encoder's parts: it runs the decoder's mesh, in the decoder's numbers, beside the caller's. Internal to the
 * payload codec. */
#ifndef STRL_GEOMETRY_PAYLOAD_ENCODE_H
#define STRL_GEOMETRY_PAYLOAD_ENCODE_H

#include "geometry/payload.h"
#include "geometry/payload_mesh.h"
#include "geometry/payload_streams.h"

struct strl__encoder {
    const strl_pm *pm;
    const strl_payload_reference *reference; /* or NULL */
    uint32_t copied;                         /* vertices copied from it: the first numbers */
    uint16_t *copied_from;                   /* [copied], vertices of the reference */
    struct strl__streams_out out;
    struct strl__mesh mesh;  /* vertices and triangles as the decoder numbers them */
    uint16_t *number;        /* [pm vertices], the decoder's number of a vertex; steps' vertices keep theirs */
    uint16_t *vertex;        /* the inverse of number */
    uint32_t *triangle_of;   /* [triangles], the decoder's number of a triangle, STRL__NONE where not yet written */
    uint8_t *rotation;       /* [triangles], pm's corner k is the decoder's corner (k + rotation) % 3 */
    uint16_t (*birth)[3];    /* [triangles], pm's corners in the state in which the triangle appears */
    uint32_t *arrival;       /* 4 t + k: pm's corners that come to a vertex by its step, vertex by vertex */
    uint32_t *arrival_first; /* [vertices + 2], a vertex's are from here to the next one's */
    uint16_t *from;          /* [base vertices], by the decoder's numbers */
    strl_arena *scratch;
    strl_error *err;
};

/* What the base mesh has of the reference. */
strl_status strl__encode_copies(struct strl__encoder *encoder);
strl_status strl__encode_base(struct strl__encoder *encoder);
strl_status strl__encode_steps(struct strl__encoder *encoder);
strl_status strl__encode_attributes(struct strl__encoder *encoder);

/* 8 where that is enough for all normals, else 10. */
unsigned strl__normal_bits(const strl_pm *pm);

/* All that a payload says, for strl__streams_write; *streams is the caller's to deinit, on failure too. */
strl_status strl__payload_collect(const strl_pm *pm, const strl_payload_reference *reference, strl_arena *scratch,
                                  struct strl__streams_out *streams, const strl_payload_order *order, strl_error *err);

/* Writes vertex's position, which the mesh holds already, as a residual. */
static inline void strl__push_position(struct strl__encoder *encoder, unsigned id, const uint32_t predicted[3],
                                       uint32_t vertex)
{
    for (unsigned k = 0; k < 3; k++)
        strl__push(&encoder->out, id + k, strl__zigzag((uint32_t)encoder->mesh.position[vertex][k] - predicted[k]));
}

/* Adds pm's triangle t to the mesh with corner `first` of pm in front: the vertices are the decoder's. */
static inline void strl__encode_triangle(struct strl__encoder *encoder, uint32_t t, unsigned first,
                                         const uint32_t corner[3])
{
    encoder->triangle_of[t] = encoder->mesh.triangle_count;
    encoder->rotation[t] = (uint8_t)((3 - first) % 3);
    strl__mesh_add_triangle(&encoder->mesh, corner[0], corner[1], corner[2]);
}

#endif
