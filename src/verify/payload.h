/* The payload decoder's parts, each a section of docs/format-payload.md. Internal to it. */
#ifndef STRL_VERIFY_PAYLOAD_H
#define STRL_VERIFY_PAYLOAD_H

#include <string.h>

#include "base/cursor.h"
#include "verify/mesh.h"

enum strl__v_stream_number {
    STRL__V_OPERATION = 0, /* one a context */
    STRL__V_SEED = 6,
    STRL__V_REFERENCE,
    STRL__V_TWIN,
    STRL__V_BASE,
    STRL__V_STEP = 12,
    STRL__V_PARENT = 15,
    STRL__V_WEDGE,
    STRL__V_KIND,
    STRL__V_START,
    STRL__V_ARC,
    STRL__V_GENERAL,
    STRL__V_GEOMETRIC,
    STRL__V_APPEARANCE,
    STRL__V_NORMAL,
    STRL__V_INDEX = 25,
    STRL__V_COLOUR,
    STRL__V_PALETTE = 30,
    STRL__V_SELECT = 33, /* one a context */
    STRL__V_COPY_NORMAL = 37,
    STRL__V_TEXCOORD = 39, /* only where flag bit 3 is set */
    STRL__V_STREAMS = 41
};

typedef struct strl__v_stream {
    const uint32_t *values;
    uint32_t count, at;
} strl__v_stream;

typedef struct strl__v_payload {
    strl__vmesh *mesh;
    strl_arena *arena; /* for what stays and what does not */
    strl_error *err;
    uint32_t flags, normal_bits, words, coder[4];
    uint32_t base_vertices, base_triangles, vertices, triangles, steps, entries; /* Vb, Tb, V, T, S, P */
    const strl__vmesh *told_by; /* the parent's mesh; NULL: self-contained */
    uint32_t offset[3];         /* to be added to its positions */
    uint32_t copied;            /* vertices copied from it, the first ones */
    uint16_t *copied_from;      /* [Vb] its vertices */
    strl__v_stream stream[STRL__V_STREAMS];
    bool starved; /* a value was asked for that is not there */
    /* The mesh while it grows. */
    uint32_t vertex_count, triangle_count;
    uint32_t *first; /* [V] newest corner at a vertex, UINT32_MAX = none; corner k of triangle t is 3 t + k */
    uint32_t *next;  /* [3 T] */
    uint16_t *ring;  /* [V] the vertex behind in the ring of a position */
    uint16_t *from;  /* [Vb] */
} strl__v_payload;

/* All fail with STRL_ERR_FORMAT and a sentence, or STRL_ERR_MEMORY. */
/* All that is left of cursor, behind the words' number and the states; payload_bytes: with what stands before. */
strl_status strl__v_payload_streams(strl__v_payload *self, strl_cursor *cursor, size_t payload_bytes,
                                    unsigned stream_count);
strl_status strl__v_payload_copies(strl__v_payload *self);
strl_status strl__v_payload_base(strl__v_payload *self);
strl_status strl__v_payload_steps(strl__v_payload *self);
/* with_looks: normals and colours too; else their streams are only counted. */
strl_status strl__v_payload_attributes(strl__v_payload *self, bool with_looks);

static inline uint32_t strl__v_pull(strl__v_payload *self, unsigned number)
{
    strl__v_stream *stream = &self->stream[number];
    if (stream->at < stream->count)
        return stream->values[stream->at++];
    self->starved = true;
    return 0;
}

/* A value was asked for that is not there, or one that is was not. */
strl_status strl__v_payload_ends(const strl__v_payload *self);

/* A residual, modulo 2^32. */
static inline uint32_t strl__v_residual(strl__v_payload *self, unsigned number)
{
    uint32_t value = strl__v_pull(self, number);
    return value % 2 ? 0u - value / 2 - 1 : value / 2;
}

static inline bool strl__v_same_position(const strl__v_payload *self, uint32_t a, uint32_t b)
{
    return memcmp(self->mesh->position[a], self->mesh->position[b], sizeof *self->mesh->position) == 0;
}

/* Puts a corner in front of its vertex's list. */
static inline void strl__v_list_corner(strl__v_payload *self, uint32_t corner, uint32_t vertex)
{
    self->mesh->triangle[corner / 3][corner % 3] = (uint16_t)vertex;
    self->next[corner] = self->first[vertex];
    self->first[vertex] = corner;
}

/* False where there are too many triangles, or two corners share a position. */
bool strl__v_add_triangle(strl__v_payload *self, uint32_t a, uint32_t b, uint32_t c);
void strl__v_join(strl__v_payload *self, uint32_t vertex, uint32_t to);

#endif
