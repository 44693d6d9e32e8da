/* Which nodes are on the GPU: a table by key with an order of last use. Knows no GL; the backend owns what an entry's
 * `place` stands for and releases it before it removes the entry. */
#ifndef STRL_RENDER_CACHE_H
#define STRL_RENDER_CACHE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "stroll/error.h"
#include "stroll/frame.h"

typedef struct strl_cache_entry {
    uint64_t key;
    uint32_t vertex_count, index_count; /* as uploaded */
    uint32_t index_capacity;            /* indices that the place has room for */
    uint32_t state;                     /* of the uploaded indices */
    uint32_t placement;                 /* null's: of the item that came last */
    uint64_t frame;                     /* the list whose indices these are; 0 = unknown */
    uint64_t batch;                     /* the backend's: the batch of draws that uses it last */
    uint64_t bytes;
    bool translucent;           /* some vertex has alpha below 255, or they are splats */
    uint64_t styles_version;    /* of the uploaded vertices, counted from 1; 0 = without */
    bool styled, hides, hidden; /* as uploaded: some vertex is not plain; some, all vertices are hidden */
    bool lines;                 /* indices are expanded to lines */
    union {
        struct {
            uint32_t slab, vertex_at, vertex_granules, index_at, index_granules;
        } range; /* gl45 */
        struct {
            uint32_t array, vertices, indices;
        } names; /* gl3 */
    } place;
    struct strl_cache_entry *newer, *older; /* by last use */
    struct strl_cache_entry *next;          /* in the same bucket */
} strl_cache_entry;

typedef struct strl_cache {
    strl_cache_entry **buckets; /* power of two */
    size_t bucket_count, count;
    strl_cache_entry *newest, *oldest;
} strl_cache;

strl_status strl__cache_init(strl_cache *cache, strl_error *err);
/* Frees the entries; their places must have been released. */
void strl__cache_deinit(strl_cache *cache);
/* NULL where the key is not there. */
strl_cache_entry *strl__cache_find(const strl_cache *cache, uint64_t key);
/* A new zeroed entry, newest in use; NULL without memory. The key must not be there. */
strl_cache_entry *strl__cache_add(strl_cache *cache, uint64_t key);
void strl__cache_touch(strl_cache *cache, strl_cache_entry *entry);
void strl__cache_remove(strl_cache *cache, strl_cache_entry *entry);

/* What has to be copied so that the entry holds the item. */
typedef struct strl_cache_upload {
    bool vertices;
    uint32_t first_index, index_count; /* 0 = none */
} strl_cache_upload;

/* list_frame: strl_draw_list.frame. A dirty range is relative to the list before, so it counts only where the entry
 * holds that list's indices; otherwise a changed state costs all indices. */
strl_cache_upload strl__cache_plan(const strl_cache_entry *entry, const strl_draw_item *item, uint64_t list_frame);
/* The entry now holds the item of that list. */
void strl__cache_commit(strl_cache_entry *entry, const strl_draw_item *item, uint64_t list_frame);

bool strl__item_is_translucent(const strl_draw_item *item);

#endif
