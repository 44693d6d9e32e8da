#include "render/gl45/store.h"

#include <string.h>

#include "render/glcommon/item.h"

/* Room for the largest node: 65536 vertices and 131072 triangles. */
#define LEAST_SLAB_BYTES (2200u << 10)
#define MOST_SLAB_BYTES (64u << 20)

void strl__gl_store_init(strl_gl_store *store, uint64_t budget_bytes)
{
    uint64_t bytes = budget_bytes / 8;
    bytes = bytes < LEAST_SLAB_BYTES ? LEAST_SLAB_BYTES : bytes > MOST_SLAB_BYTES ? MOST_SLAB_BYTES : bytes;
    /* Large budgets: fewer, larger slabs, still below 2 GiB each. */
    if (budget_bytes / bytes > STRL_MOST_SLABS)
        bytes = budget_bytes / STRL_MOST_SLABS;
    if (bytes > (1u << 30))
        bytes = 1u << 30;
    *store = (strl_gl_store){.slab_bytes = bytes / STRL_GRANULE_BYTES * STRL_GRANULE_BYTES};
    uint64_t most = budget_bytes / bytes;
    store->slab_most = most > STRL_MOST_SLABS ? STRL_MOST_SLABS : (uint32_t)most;
}

static void deinit_slab(strl_gl_slab *slab)
{
    strl__ranges_deinit(&slab->ranges);
    glDeleteVertexArrays(1, &slab->array);
    glDeleteBuffers(1, &slab->buffer);
}

void strl__gl_store_deinit(strl_gl_store *store)
{
    for (uint32_t s = 0; s < store->slab_count; s++)
        deinit_slab(&store->slabs[s]);
    store->slab_count = 0;
}

uint64_t strl__gl_store_bytes(const strl_gl_store *store)
{
    return store->slab_count * store->slab_bytes;
}

static void set_array(const strl_gl_slab *slab)
{
    GLuint array = slab->array;
    glVertexArrayVertexBuffer(array, 0, slab->buffer, 0, sizeof(strl_vertex));
    glVertexArrayBindingDivisor(array, 1, 1);
    glVertexArrayElementBuffer(array, slab->buffer);
    glVertexArrayAttribIFormat(array, 0, 3, GL_INT, offsetof(strl_vertex, position));
    glVertexArrayAttribIFormat(array, 1, 2, GL_UNSIGNED_SHORT, offsetof(strl_vertex, normal));
    glVertexArrayAttribFormat(array, 2, 4, GL_UNSIGNED_BYTE, GL_TRUE, offsetof(strl_vertex, rgba));
    for (GLuint row = 0; row < 6; row++)
        glVertexArrayAttribFormat(array, 3 + row, 4, GL_FLOAT, GL_FALSE, row * (GLuint)sizeof(float[4]));
    for (GLuint word = 0; word < 2; word++)
        glVertexArrayAttribIFormat(array, 9 + word, 4, GL_INT,
                                   (GLuint)offsetof(strl_gl_item, base) + word * (GLuint)sizeof(int32_t[4]));
    for (GLuint attribute = 0; attribute < 11; attribute++) {
        glVertexArrayAttribBinding(array, attribute, attribute >= 3);
        glEnableVertexArrayAttrib(array, attribute);
    }
}

static bool add_slab(strl_gl_store *store)
{
    if (store->slab_count == store->slab_most)
        return false;
    strl_gl_slab *slab = &store->slabs[store->slab_count];
    memset(slab, 0, sizeof *slab);
    if (!strl__ranges_init(&slab->ranges, (uint32_t)(store->slab_bytes / STRL_GRANULE_BYTES)))
        return false;
    glCreateBuffers(1, &slab->buffer);
    glNamedBufferStorage(slab->buffer, (GLsizeiptr)store->slab_bytes, NULL, 0);
    GLint64 made = 0;
    glGetNamedBufferParameteri64v(slab->buffer, GL_BUFFER_SIZE, &made);
    if (made < (GLint64)store->slab_bytes) {
        /* The system has less than the budget: go on with what there is. */
        glGetError();
        store->slab_most = store->slab_count;
        deinit_slab(slab);
        return false;
    }
    glCreateVertexArrays(1, &slab->array);
    set_array(slab);
    store->slab_count++;
    return true;
}

static uint32_t granules(uint64_t bytes)
{
    uint64_t count = (bytes + STRL_GRANULE_BYTES - 1) / STRL_GRANULE_BYTES;
    return count > 0 ? (uint32_t)count : 1;
}

static bool place_in(strl_gl_store *store, uint32_t slab, strl_cache_entry *entry, uint32_t vertex_granules,
                     uint32_t index_granules)
{
    strl_ranges *ranges = &store->slabs[slab].ranges;
    uint32_t vertices = strl__ranges_take(ranges, vertex_granules);
    if (vertices == STRL_RANGES_NONE)
        return false;
    uint32_t indices = strl__ranges_take(ranges, index_granules);
    if (indices == STRL_RANGES_NONE) {
        strl__ranges_give(ranges, vertices, vertex_granules);
        return false;
    }
    entry->place.range.slab = slab;
    entry->place.range.vertex_at = vertices, entry->place.range.vertex_granules = vertex_granules;
    entry->place.range.index_at = indices, entry->place.range.index_granules = index_granules;
    entry->index_capacity = index_granules * (STRL_GRANULE_BYTES / sizeof(uint16_t));
    return true;
}

bool strl__gl_store_place(strl_gl_store *store, strl_cache_entry *entry, uint32_t vertex_count, uint32_t index_capacity)
{
    uint32_t vertex_granules = granules(vertex_count * sizeof(strl_vertex)),
             index_granules = granules(index_capacity * sizeof(uint16_t));
    for (uint32_t s = 0; s < store->slab_count; s++)
        if (place_in(store, s, entry, vertex_granules, index_granules))
            return true;
    return add_slab(store) && place_in(store, store->slab_count - 1, entry, vertex_granules, index_granules);
}

bool strl__gl_store_grow_indices(strl_gl_store *store, strl_cache_entry *entry, uint32_t index_capacity)
{
    strl_ranges *ranges = &store->slabs[entry->place.range.slab].ranges;
    uint32_t count = granules(index_capacity * sizeof(uint16_t)), first = strl__ranges_take(ranges, count);
    if (first == STRL_RANGES_NONE)
        return false;
    strl__ranges_give(ranges, entry->place.range.index_at, entry->place.range.index_granules);
    entry->place.range.index_at = first;
    entry->place.range.index_granules = count;
    entry->index_capacity = count * (STRL_GRANULE_BYTES / sizeof(uint16_t));
    return true;
}

void strl__gl_store_release(strl_gl_store *store, strl_cache_entry *entry)
{
    strl_ranges *ranges = &store->slabs[entry->place.range.slab].ranges;
    strl__ranges_give(ranges, entry->place.range.vertex_at, entry->place.range.vertex_granules);
    strl__ranges_give(ranges, entry->place.range.index_at, entry->place.range.index_granules);
}

void strl__gl_store_upload(strl_gl_store *store, strl_gl_ring *ring, uint32_t slab, uint64_t at_bytes, const void *data,
                           size_t bytes)
{
    const uint8_t *from = data;
    while (bytes > 0) {
        size_t piece = bytes < ring->segment_bytes ? bytes : ring->segment_bytes, offset;
        memcpy(strl__gl_ring_take(ring, piece, &offset), from, piece);
        glCopyNamedBufferSubData(ring->buffer, store->slabs[slab].buffer, (GLintptr)offset, (GLintptr)at_bytes,
                                 (GLsizeiptr)piece);
        from += piece, at_bytes += piece, bytes -= piece;
    }
}
