#include "render/gl45/ring.h"

#include "base/fail.h"

#define ALIGNMENT 256u /* whole cache lines; more than any offset needs */
#define WAIT_NS 1000000000u

strl_status strl__gl_ring_init(strl_gl_ring *ring, size_t segment_bytes, strl_error *err)
{
    *ring = (strl_gl_ring){.segment_bytes = segment_bytes};
    const GLbitfield access = GL_MAP_WRITE_BIT | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
    GLsizeiptr bytes = (GLsizeiptr)(segment_bytes * STRL_RING_SEGMENTS);
    glCreateBuffers(1, &ring->buffer);
    glNamedBufferStorage(ring->buffer, bytes, NULL, access);
    ring->mapped = glMapNamedBufferRange(ring->buffer, 0, bytes, access);
    if (ring->mapped)
        return STRL_OK;
    strl__gl_ring_deinit(ring);
    return strl__fail(err, STRL_ERR_MEMORY, "the GL system cannot map %lld bytes for uploads", (long long)bytes);
}

void strl__gl_ring_deinit(strl_gl_ring *ring)
{
    for (unsigned s = 0; s < STRL_RING_SEGMENTS; s++)
        glDeleteSync(ring->fences[s]);
    glDeleteBuffers(1, &ring->buffer);
    *ring = (strl_gl_ring){0};
}

static void next_segment(strl_gl_ring *ring)
{
    ring->fences[ring->segment] = glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
    ring->segment = (ring->segment + 1) % STRL_RING_SEGMENTS;
    ring->at = 0;
    GLsync *fence = &ring->fences[ring->segment];
    if (!*fence)
        return;
    while (glClientWaitSync(*fence, GL_SYNC_FLUSH_COMMANDS_BIT, WAIT_NS) == GL_TIMEOUT_EXPIRED)
        continue;
    glDeleteSync(*fence);
    *fence = NULL;
}

void *strl__gl_ring_take(strl_gl_ring *ring, size_t bytes, size_t *offset)
{
    if (bytes > ring->segment_bytes - ring->at)
        next_segment(ring);
    *offset = ring->segment * ring->segment_bytes + ring->at;
    ring->at += (bytes + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
    if (ring->at > ring->segment_bytes)
        ring->at = ring->segment_bytes;
    return ring->mapped + *offset;
}
