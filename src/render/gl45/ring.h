/* Persistently mapped memory through which everything goes to the GPU: a ring of segments, each guarded by a fence. */
#ifndef STRL_RENDER_GL45_RING_H
#define STRL_RENDER_GL45_RING_H

#include <epoxy/gl.h>
#include <stddef.h>
#include <stdint.h>

#include "stroll/error.h"

#define STRL_RING_SEGMENTS 4u

typedef struct strl_gl_ring {
    GLuint buffer;
    uint8_t *mapped;
    size_t segment_bytes, at; /* at: within the current segment */
    unsigned segment;
    GLsync fences[STRL_RING_SEGMENTS]; /* NULL: nothing uses the segment */
} strl_gl_ring;

strl_status strl__gl_ring_init(strl_gl_ring *ring, size_t segment_bytes, strl_error *err);
void strl__gl_ring_deinit(strl_gl_ring *ring);
/* `bytes` (at most segment_bytes) of mapped memory at *offset of the buffer, a multiple of 256. What reads it must be
 * issued before the next take. */
void *strl__gl_ring_take(strl_gl_ring *ring, size_t bytes, size_t *offset);

#endif
