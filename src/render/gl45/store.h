/* Where nodes live on the GPU: a few slabs of one size, each both vertex and index buffer, suballocated in granules. A
 * node's vertices and indices share a slab, so all nodes of a slab are drawn by one call. */
#ifndef STRL_RENDER_GL45_STORE_H
#define STRL_RENDER_GL45_STORE_H

#include "render/cache.h"
#include "render/gl45/ranges.h"
#include "render/gl45/ring.h"

/* A multiple of the vertex size and of the index size. */
#define STRL_GRANULE_BYTES 320u
#define STRL_MOST_SLABS 64u

typedef struct strl_gl_slab {
    GLuint buffer;
    /* binding 0: the slab's vertices; binding 1: item records, one an instance, bound anew for each batch */
    GLuint array;
    strl_ranges ranges;
} strl_gl_slab;

typedef struct strl_gl_store {
    strl_gl_slab slabs[STRL_MOST_SLABS];
    uint32_t slab_count, slab_most;
    uint64_t slab_bytes;
} strl_gl_store;

/* Divides budget_bytes into slabs; makes none yet. */
void strl__gl_store_init(strl_gl_store *store, uint64_t budget_bytes);
void strl__gl_store_deinit(strl_gl_store *store);
uint64_t strl__gl_store_bytes(const strl_gl_store *store);

/* Finds room for the entry: a free range, else a new slab. False: the caller evicts and asks again. */
bool strl__gl_store_place(strl_gl_store *store, strl_cache_entry *entry, uint32_t vertex_count,
                          uint32_t index_capacity);
/* More room for indices in the entry's slab; what was there is lost. False where there is none (the entry is as it
 * was). */
bool strl__gl_store_grow_indices(strl_gl_store *store, strl_cache_entry *entry, uint32_t index_capacity);
void strl__gl_store_release(strl_gl_store *store, strl_cache_entry *entry);

void strl__gl_store_upload(strl_gl_store *store, strl_gl_ring *ring, uint32_t slab, uint64_t at_bytes, const void *data,
                           size_t bytes);

#endif
