#include "render/cache.h"

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"

#define FIRST_BUCKETS 256u

strl_status strl__cache_init(strl_cache *cache, strl_error *err)
{
    *cache = (strl_cache){.bucket_count = FIRST_BUCKETS};
    cache->buckets = strl__alloc_zero(FIRST_BUCKETS, sizeof *cache->buckets);
    return cache->buckets ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "no memory for the renderer's table of nodes");
}

void strl__cache_deinit(strl_cache *cache)
{
    while (cache->oldest)
        strl__cache_remove(cache, cache->oldest);
    strl__free(cache->buckets);
    *cache = (strl_cache){0};
}

static strl_cache_entry **bucket_of(const strl_cache *cache, uint64_t key)
{
    return &cache->buckets[strl__mix64(key) & (cache->bucket_count - 1)];
}

strl_cache_entry *strl__cache_find(const strl_cache *cache, uint64_t key)
{
    strl_cache_entry *entry = *bucket_of(cache, key);
    while (entry && entry->key != key)
        entry = entry->next;
    return entry;
}

static void link_newest(strl_cache *cache, strl_cache_entry *entry)
{
    entry->newer = NULL;
    entry->older = cache->newest;
    if (cache->newest)
        cache->newest->newer = entry;
    else
        cache->oldest = entry;
    cache->newest = entry;
}

static void unlink_use(strl_cache *cache, strl_cache_entry *entry)
{
    *(entry->newer ? &entry->newer->older : &cache->newest) = entry->older;
    *(entry->older ? &entry->older->newer : &cache->oldest) = entry->newer;
}

/* A table that cannot grow stays correct, only slower. */
static void grow(strl_cache *cache)
{
    size_t count = cache->bucket_count * 2;
    strl_cache_entry **buckets = strl__alloc_zero(count, sizeof *buckets);
    if (!buckets)
        return;
    strl__free(cache->buckets);
    cache->buckets = buckets;
    cache->bucket_count = count;
    for (strl_cache_entry *entry = cache->newest; entry; entry = entry->older) {
        strl_cache_entry **bucket = bucket_of(cache, entry->key);
        entry->next = *bucket;
        *bucket = entry;
    }
}

strl_cache_entry *strl__cache_add(strl_cache *cache, uint64_t key)
{
    strl_cache_entry *entry = strl__alloc_zero(1, sizeof *entry);
    if (!entry)
        return NULL;
    if (cache->count >= cache->bucket_count)
        grow(cache);
    entry->key = key;
    strl_cache_entry **bucket = bucket_of(cache, key);
    entry->next = *bucket;
    *bucket = entry;
    cache->count++;
    link_newest(cache, entry);
    return entry;
}

void strl__cache_touch(strl_cache *cache, strl_cache_entry *entry)
{
    unlink_use(cache, entry);
    link_newest(cache, entry);
}

void strl__cache_remove(strl_cache *cache, strl_cache_entry *entry)
{
    strl_cache_entry **at = bucket_of(cache, entry->key);
    while (*at != entry)
        at = &(*at)->next;
    *at = entry->next;
    unlink_use(cache, entry);
    cache->count--;
    strl__free(entry);
}

strl_cache_upload strl__cache_plan(const strl_cache_entry *entry, const strl_draw_item *item, uint64_t list_frame)
{
    strl_cache_upload all = {true, 0, item->index_count};
    if (!entry || entry->vertex_count != item->vertex_count)
        return all;
    if (entry->state == item->state && entry->index_count == item->index_count)
        return (strl_cache_upload){false, 0, 0};
    if (entry->frame != 0 && entry->frame + 1 == list_frame)
        return (strl_cache_upload){false, item->dirty_first, item->dirty_count};
    return (strl_cache_upload){false, 0, item->index_count};
}

void strl__cache_commit(strl_cache_entry *entry, const strl_draw_item *item, uint64_t list_frame)
{
    entry->vertex_count = item->vertex_count;
    entry->index_count = item->index_count;
    entry->state = item->state;
    entry->frame = list_frame;
}

bool strl__item_is_translucent(const strl_draw_item *item)
{
    if (item->point_px > 0)
        return true;
    for (uint32_t v = 0; v < item->vertex_count; v++)
        if (item->vertices[v].rgba[3] != 255)
            return true;
    return false;
}
