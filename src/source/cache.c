#include "source/cache.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/fail.h"
#include "platform/file.h"
#include "platform/shelf.h"

#define BLOCK_BYTES 4096u              /* a file takes whole ones */
#define PART_AGE_NS 3600000000000u     /* a file being written is not touched for as long */
#define MOST_ENTRIES ((size_t)1 << 20) /* that are looked at in one count */
#define RECOUNT_SHARE 16u /* of the cap, written since the last count, before the folder is looked through again */
#define LARGEST_SHARE 4u  /* of the cap; a larger entry is not kept */
#define KEPT_SHARE 0.875  /* of the cap, left by making room: so that it does not have to be made each time */

struct strl__cache {
    char *folder;
    uint64_t most_bytes;
    uint64_t bytes;     /* as counted, and what was put since */
    uint64_t put_bytes; /* since the count */
    bool counted, full; /* full: nothing is written any more */
};

/* An entry as the folder lists it. */
typedef struct listed {
    strl__cache_key key;
    uint64_t bytes, used_ns;
} listed;

typedef struct listing {
    const strl__cache *cache;
    listed *items;
    size_t count, capacity;
    uint64_t bytes, now_ns;
} listing;

strl_status strl__cache_open(const char *folder, uint64_t most_bytes, strl__cache **cache, strl_error *err)
{
    *cache = NULL;
    strl_status status = strl_path_make_directory(folder, err);
    if (status != STRL_OK)
        return status;
    strl__cache *made = strl__alloc_zero(1, sizeof *made);
    char *copy = strl__strdup(folder);
    if (!made || !copy) {
        strl__free(made);
        strl__free(copy);
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a cache");
    }
    made->folder = copy;
    made->most_bytes = most_bytes;
    *cache = made;
    return STRL_OK;
}

void strl__cache_close(strl__cache *cache)
{
    if (!cache)
        return;
    strl__free(cache->folder);
    strl__free(cache);
}

static uint64_t on_disk(uint64_t bytes)
{
    return bytes > UINT64_MAX - BLOCK_BYTES ? bytes : (bytes + BLOCK_BYTES - 1) / BLOCK_BYTES * BLOCK_BYTES;
}

/* ---- removing */

/* Whether the file is ours: what is too short for the signature is, as far as it goes. */
static bool is_signed(const char *path)
{
    strl_file *file = NULL;
    uint8_t found[STRL__CACHE_SIGNATURE_BYTES];
    size_t got = 0;
    bool is = strl_file_open(path, &file, NULL) == STRL_OK &&
              strl_file_read_some(file, 0, found, sizeof found, &got, NULL) == STRL_OK &&
              memcmp(found, strl__cache_signature, got) == 0;
    strl_file_close(file, NULL);
    return is;
}

static bool remove_named(const strl__cache *cache, const char *name)
{
    char *path = strl_path_join(cache->folder, name);
    bool removed = path && is_signed(path) && strl_path_remove(path, NULL) == STRL_OK;
    strl__free(path);
    return removed;
}

void strl__cache_drop(strl__cache *cache, const strl__cache_key *key)
{
    char name[STRL__CACHE_NAME_BYTES];
    strl__cache_entry_name(key, name);
    remove_named(cache, name);
}

static bool list_one(void *context, const strl_shelf_entry *entry)
{
    listing *all = context;
    strl__cache_key key;
    strl__cache_name kind = strl__cache_parse_name(entry->name, &key);
    if (kind == STRL__CACHE_FOREIGN)
        return true;
    bool is_left =
        kind == STRL__CACHE_PART && entry->used_ns < all->now_ns && all->now_ns - entry->used_ns > PART_AGE_NS;
    if (is_left && remove_named(all->cache, entry->name))
        return true;
    all->bytes += on_disk(entry->bytes);
    if (kind == STRL__CACHE_PART)
        return true;
    if (!strl__grow(&all->items, &all->capacity, all->count + 1, sizeof *all->items))
        return false;
    all->items[all->count++] = (listed){key, on_disk(entry->bytes), entry->used_ns};
    return all->count < MOST_ENTRIES;
}

static int by_use(const void *left, const void *right)
{
    const listed *a = left, *b = right;
    return a->used_ns < b->used_ns ? -1 : a->used_ns > b->used_ns;
}

static void shrink(const strl__cache *cache, listing *all, uint64_t target)
{
    if (all->count > 1)
        qsort(all->items, all->count, sizeof *all->items, by_use);
    for (size_t i = 0; i < all->count && all->bytes > target; i++) {
        char name[STRL__CACHE_NAME_BYTES];
        strl__cache_entry_name(&all->items[i].key, name);
        if (remove_named(cache, name))
            all->bytes -= all->items[i].bytes;
    }
}

static uint64_t kept_bytes(const strl__cache *cache)
{
    return (uint64_t)(KEPT_SHARE * (double)cache->most_bytes);
}

/* Counts what is there; where that is more than `most`, what was used least lately goes until `target` is left. */
static void recount(strl__cache *cache, uint64_t most, uint64_t target)
{
    listing all = {.cache = cache, .now_ns = strl_shelf_now_ns()};
    strl_shelf_visit(cache->folder, list_one, &all, NULL);
    if (all.bytes > most)
        shrink(cache, &all, target);
    cache->bytes = all.bytes;
    cache->put_bytes = 0;
    cache->counted = true;
    strl__free(all.items);
}

void strl__cache_trim(strl__cache *cache)
{
    recount(cache, cache->most_bytes, kept_bytes(cache));
}

/* False where there is none to be had. */
static bool make_room(strl__cache *cache, uint64_t bytes)
{
    if (bytes > cache->most_bytes / LARGEST_SHARE)
        return false;
    uint64_t most = cache->most_bytes - bytes, kept = kept_bytes(cache);
    if (!cache->counted || cache->put_bytes > cache->most_bytes / RECOUNT_SHARE || cache->bytes > most)
        recount(cache, most, kept < most ? kept : most);
    return cache->bytes <= most;
}

/* ---- entries */

static bool read_entry(const char *path, const strl__cache_key *key, void *data, bool *is_there)
{
    strl_file *file = NULL;
    uint8_t head[STRL__CACHE_HEAD_BYTES];
    *is_there = strl_file_open(path, &file, NULL) == STRL_OK;
    bool good = *is_there && strl_file_bytes(file) == (uint64_t)sizeof head + key->size &&
                strl_file_read(file, 0, head, sizeof head, NULL) == STRL_OK &&
                strl_file_read(file, sizeof head, data, key->size, NULL) == STRL_OK &&
                strl__cache_entry_check(key, head, data);
    strl_file_close(file, NULL);
    return good;
}

bool strl__cache_get(strl__cache *cache, const strl__cache_key *key, void *data)
{
    char name[STRL__CACHE_NAME_BYTES];
    strl__cache_entry_name(key, name);
    char *path = strl_path_join(cache->folder, name);
    bool is_there = false, good = path && read_entry(path, key, data, &is_there);
    strl__free(path);
    if (good)
        strl_shelf_touch(cache->folder, name);
    else if (is_there)
        remove_named(cache, name);
    return good;
}

void strl__cache_put(strl__cache *cache, const strl__cache_key *key, const void *data)
{
    uint8_t head[STRL__CACHE_HEAD_BYTES];
    char name[STRL__CACHE_NAME_BYTES];
    uint64_t bytes = on_disk((uint64_t)sizeof head + key->size);
    if (cache->full || !make_room(cache, bytes))
        return;
    strl__cache_entry_name(key, name);
    strl__cache_entry_head(key, data, head);
    const strl_shelf_piece pieces[] = {{head, sizeof head}, {data, key->size}};
    if (strl_shelf_put(cache->folder, name, pieces, 2, NULL) != STRL_OK) {
        cache->full = true;
        return;
    }
    cache->bytes += bytes;
    cache->put_bytes += bytes;
}
