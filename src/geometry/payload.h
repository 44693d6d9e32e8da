/* The payload codec: a progressive mesh to bytes and back. docs/format-payload.md is normative.
 * Lossless for all of strl_pm but the errors, which are rounded up to a logarithmic scale (the claim stays a bound: at
 * most 4.5 % more). What strl_pm leaves open is not kept: base vertices come back in another order, triangles in
 * another order within their step, and corners rotated; steps, their vertices, the palette and every state stay what
 * they were. */
#ifndef STRL_GEOMETRY_PAYLOAD_H
#define STRL_GEOMETRY_PAYLOAD_H

#include <stddef.h>
#include <stdint.h>

#include "base/cursor.h"
#include "base/memory.h"
#include "geometry/progressive.h"
#include "stroll/error.h"

/* The finest state of another mesh, by which a payload is told: what the base mesh has of it is copied. Borrowed arrays
 * of a mesh that satisfies the invariants of progressive.h, all of it the same when the payload is decoded; strides in
 * bytes. */
typedef struct strl_payload_reference {
    uint32_t vertex_count, triangle_count;
    const void *position; /* int32_t[3] a vertex */
    const void *normal;   /* uint16_t[2] a vertex, octahedral, 10 bits each */
    size_t position_stride, normal_stride;
    const uint16_t (*triangle)[3]; /* [triangle_count] */
    int32_t offset[3];             /* to be added to its positions, modulo 2^32: its anchor less the payload's */
} strl_payload_reference;

/* offset stays 0. */
strl_payload_reference strl_payload_reference_of(const strl_pm *pm);

/* How a decoder will have a mesh that was encoded: its vertex i is `vertex[i]` of the encoder's mesh, its triangle t is
 * triangle[t] / 4 with corner triangle[t] % 4 in front. The caller's arrays. */
typedef struct strl_payload_order {
    uint16_t *vertex;   /* [vertices] */
    uint32_t *triangle; /* [triangles] */
} strl_payload_order;

/* Appends the payload of pm to writer. pm must satisfy the invariants of progressive.h, which is checked; scratch is
 * rewound on return. On failure writer keeps its size. reference: NULL = the payload is self-contained. order: filled
 * in, or NULL. */
strl_status strl_payload_encode(const strl_pm *pm, const strl_payload_reference *reference, strl_arena *scratch,
                                strl_writer *writer, const strl_payload_order *order, strl_error *err);

/* Sizes announced by a payload's head, checked against the limits of progressive.h and against `size`. */
typedef struct strl_payload_sizes {
    uint32_t vertex_count, triangle_count, step_count, palette_count;
    uint32_t base_vertex_count, base_triangle_count;
} strl_payload_sizes;
strl_status strl_payload_peek(const void *data, size_t size, strl_payload_sizes *sizes, strl_error *err);

/* Decodes a payload of exactly `size` bytes; the arrays of *pm live in `arena`. Hostile bytes fail with
 * STRL_ERR_FORMAT; whatever is accepted satisfies every invariant of progressive.h. Scratch memory comes and goes apart
 * from the arena, within what its limit leaves. reference: what the payload was encoded with; another one gives another
 * mesh or a failure. Thread-safe on different arenas. */
strl_status strl_payload_decode(const void *data, size_t size, const strl_payload_reference *reference,
                                strl_arena *arena, strl_pm *pm, strl_error *err);

#endif
