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
#define MOST_ENTRIES ((size_t)1 << 20) /* that are looked at in one count, ours or not */
#define STEP_ENTRIES 64u               /* looked at or removed in a step */
#define RECOUNT_SHARE 16u /* of the cap, written since the last count, before the folder is looked through again */
#define LARGEST_SHARE 4u  /* of the cap; a larger entry is not kept */
#define KEPT_SHARE 0.875  /* of the cap, left by making room: so that it does not have to be made each time */

/* An entry as the folder lists it. */
typedef struct listed {
    strl__cache_key key;
    uint64_t bytes, used_ns;
} listed;

/* A count under way. */
typedef struct listing {
    strl_shelf *shelf; /* owned; NULL once all of it was listed */
    listed *items;     /* owned */
    size_t count, capacity;
    size_t looked_at, removed; /* removed: of the items, in the order of their use */
    uint64_t bytes, now_ns;
} listing;

struct strl__cache {
    char *folder;
    uint64_t most_bytes;
    uint64_t bytes;     /* as counted, and what was put since */
    uint64_t put_bytes; /* since the count */
    bool counted, full; /* full: nothing is written any more */
    bool counting;
    listing listing; /* while counting */
};

strl_status strl__cache_open(const char *folder, uint64_t most_bytes, strl__cache **cache, strl_error *err)
{
    *cache = NULL;
    strl_status status = strl_path_make_private_directory(folder, err); /* what was looked at is nobody's business */
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

static void end_listing(listing *all)
{
    strl_shelf_close(all->shelf);
    strl__free(all->items);
    *all = (listing){0};
}

void strl__cache_close(strl__cache *cache)
{
    if (!cache)
        return;
    end_listing(&cache->listing);
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

/* False without memory. */
static bool list_one(const strl__cache *cache, listing *all, const strl_shelf_entry *entry)
{
    strl__cache_key key;
    strl__cache_name kind = strl__cache_parse_name(entry->name, &key);
    if (kind == STRL__CACHE_FOREIGN)
        return true;
    bool is_left =
        kind == STRL__CACHE_PART && entry->used_ns < all->now_ns && all->now_ns - entry->used_ns > PART_AGE_NS;
    if (is_left && remove_named(cache, entry->name))
        return true;
    all->bytes += on_disk(entry->bytes);
    if (kind == STRL__CACHE_PART)
        return true;
    if (!strl__grow(&all->items, &all->capacity, all->count + 1, sizeof *all->items))
        return false;
    all->items[all->count++] = (listed){key, on_disk(entry->bytes), entry->used_ns};
    return true;
}

static int by_use(const void *left, const void *right)
{
    const listed *a = left, *b = right;
    return a->used_ns < b->used_ns ? -1 : a->used_ns > b->used_ns;
}

static bool begin_listing(const strl__cache *cache, listing *all)
{
    *all = (listing){.now_ns = strl_shelf_now_ns()};
    return strl_shelf_open(cache->folder, &all->shelf, NULL) == STRL_OK;
}

/* Lists some; true when that was the last. */
static bool list_some(strl__cache *cache, listing *all)
{
    for (unsigned i = 0; i < STEP_ENTRIES; i++) {
        strl_shelf_entry entry = {0};
        bool failed = strl_shelf_next(all->shelf, &entry, NULL) != STRL_OK;
        if (!failed && entry.name && all->looked_at++ < MOST_ENTRIES) {
            failed = !list_one(cache, all, &entry);
            if (!failed)
                continue;
        }
        cache->full |= failed; /* nobody knows how much is there */
        strl_shelf_close(all->shelf);
        all->shelf = NULL;
        return true;
    }
    return false;
}

/* Removes some of what was used least lately; true when `target` is left, or nothing more to remove. */
static bool remove_some(const strl__cache *cache, listing *all, uint64_t target)
{
    if (all->removed == 0 && all->count > 1)
        qsort(all->items, all->count, sizeof *all->items, by_use);
    for (unsigned i = 0; i < STEP_ENTRIES; i++) {
        if (all->removed == all->count || all->bytes <= target)
            return true;
        char name[STRL__CACHE_NAME_BYTES];
        const listed *oldest = &all->items[all->removed++];
        strl__cache_entry_name(&oldest->key, name);
        if (remove_named(cache, name))
            all->bytes -= oldest->bytes;
    }
    return false;
}

static uint64_t kept_bytes(const strl__cache *cache)
{
    return (uint64_t)(KEPT_SHARE * (double)cache->most_bytes);
}

/* Counts what is there; where that is more than `most`, what was used least lately goes until `target` is left. A step
 * of that; false when it is done. */
static bool count_step(strl__cache *cache, uint64_t most, uint64_t target)
{
    listing *all = &cache->listing;
    if (!cache->counting) {
        cache->counting = begin_listing(cache, all);
        cache->put_bytes = 0; /* what is put meanwhile may be listed, or not */
        if (cache->counting)
            return true;
    } else if (all->shelf) {
        if (!list_some(cache, all) || all->bytes > most)
            return true;
    } else if (!remove_some(cache, all, target)) {
        return true;
    }
    cache->bytes = all->bytes + cache->put_bytes;
    cache->counted = true;
    cache->counting = false;
    cache->full |= all->bytes > most; /* it would be counted again and again */
    end_listing(all);
    return false;
}

bool strl__cache_trim_step(strl__cache *cache)
{
    return count_step(cache, cache->most_bytes, kept_bytes(cache));
}

void strl__cache_trim(strl__cache *cache)
{
    while (strl__cache_trim_step(cache))
        ;
}

static uint64_t entry_bytes(uint32_t size)
{
    return on_disk((uint64_t)STRL__CACHE_HEAD_BYTES + size);
}

static bool may_write(const strl__cache *cache, uint64_t bytes)
{
    return !cache->full && bytes <= cache->most_bytes / LARGEST_SHARE;
}

bool strl__cache_room_step(strl__cache *cache, uint32_t size)
{
    uint64_t bytes = entry_bytes(size);
    if (!may_write(cache, bytes))
        return false;
    uint64_t most = cache->most_bytes - bytes, kept = kept_bytes(cache);
    bool is_due = !cache->counted || cache->put_bytes > cache->most_bytes / RECOUNT_SHARE || cache->bytes > most;
    return (cache->counting || is_due) && count_step(cache, most, kept < most ? kept : most);
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
    uint64_t bytes = entry_bytes(key->size);
    while (strl__cache_room_step(cache, key->size))
        ;
    if (!may_write(cache, bytes) || cache->bytes > cache->most_bytes - bytes)
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
