/* Copying from another mesh: how encoder and decoder of a node payload go through the reference's triangles.
 * docs/format-payload.md, "Copies", is normative. Internal to the payload codec. */
#ifndef STRL_GEOMETRY_PAYLOAD_REFERENCE_H
#define STRL_GEOMETRY_PAYLOAD_REFERENCE_H

#include <string.h>

#include "base/memory.h"
#include "geometry/payload.h"

#define STRL__NO_NUMBER 0xffffu /* a payload has at most 65535 vertices */

struct strl__copy {
    const strl_payload_reference *from;
    uint16_t *number; /* [its vertices], the number of the copy, or STRL__NO_NUMBER */
    uint8_t *seen;    /* [its vertices], bit 0: a triangle at it was taken; bit 1: one was left */
};

static inline bool strl__copy_init(struct strl__copy *copy, const strl_payload_reference *from, strl_arena *scratch)
{
    copy->from = from;
    copy->number = strl_arena_alloc(scratch, from->vertex_count, sizeof *copy->number);
    copy->seen = strl_arena_alloc_zero(scratch, from->vertex_count, sizeof *copy->seen);
    if (!copy->number || !copy->seen)
        return false;
    memset(copy->number, 0xff, from->vertex_count * sizeof *copy->number);
    return true;
}

/* 0: nothing is known but from mixed corners; bit 0: a corner has taken triangles alone; bit 1: left ones alone. */
static inline unsigned strl__copy_context(const struct strl__copy *copy, const uint16_t corner[3])
{
    const uint8_t *seen = copy->seen;
    unsigned a = 1u << seen[corner[0]], b = 1u << seen[corner[1]], c = 1u << seen[corner[2]];
    return (a | b | c) >> 1 & 3;
}

static inline void strl__copy_mark(struct strl__copy *copy, const uint16_t corner[3], unsigned left)
{
    for (unsigned k = 0; k < 3; k++)
        copy->seen[corner[k]] |= (uint8_t)(1u << left);
}

static inline const int32_t *strl__reference_position(const strl_payload_reference *from, uint32_t vertex)
{
    return (const int32_t *)(const void *)((const char *)from->position + vertex * from->position_stride);
}

static inline const uint16_t *strl__reference_normal(const strl_payload_reference *from, uint32_t vertex)
{
    return (const uint16_t *)(const void *)((const char *)from->normal + vertex * from->normal_stride);
}

static inline void strl__reference_place(const strl_payload_reference *from, uint32_t vertex, int32_t position[3])
{
    const int32_t *there = strl__reference_position(from, vertex);
    for (unsigned k = 0; k < 3; k++)
        position[k] = (int32_t)((uint32_t)there[k] + (uint32_t)from->offset[k]);
}

#endif
