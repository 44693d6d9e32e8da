/* The disk thread: looks new reads up in the cache and sends on to the network what is not there; between times
 * writes what the network brought. */
#include <string.h>

#include "base/memory.h"
#include "source/http.h"

/* that wait to be written: what comes faster than the disk takes it is not kept */
#define MOST_KEPT_BYTES ((size_t)16 << 20)

static strl__cache_key key_of(const strl__http *http, uint64_t offset, size_t size)
{
    strl__cache_key key = {.offset = offset, .size = (uint32_t)size};
    memcpy(key.model, http->model, sizeof key.model);
    return key;
}

static strl__http_kept *make_item(uint64_t offset, const uint8_t *data, size_t size)
{
    strl__http_kept *item = strl__alloc(1, sizeof *item + (data ? size : 0));
    if (!item)
        return NULL;
    item->next = NULL;
    item->offset = offset;
    item->size = size;
    if (data)
        memcpy(item->data, data, size);
    return item;
}

void strl__http_keep(strl__http *http, uint64_t offset, const uint8_t *data, size_t size)
{
    if (!http->cache || size > UINT32_MAX || size > MOST_KEPT_BYTES - http->kept_bytes)
        return;
    strl__http_kept *item = make_item(offset, data, size);
    if (!item)
        return;
    *http->kept_end = item;
    http->kept_end = &item->next;
    http->kept_bytes += size;
    strl_condition_signal(&http->disk_work);
}

static void forget_kept(strl__http *http, uint64_t offset, size_t size)
{
    strl__http_kept **at = &http->kept;
    while (*at) {
        strl__http_kept *item = *at;
        if (item->offset != offset || item->size != size) {
            at = &item->next;
            continue;
        }
        *at = item->next;
        http->kept_bytes -= item->size;
        strl__free(item);
    }
    http->kept_end = at;
}

void strl__http_forget(strl__http *http, uint64_t offset, size_t size)
{
    if (!http->cache || size > UINT32_MAX)
        return;
    forget_kept(http, offset, size);
    strl__http_kept *item = make_item(offset, NULL, size);
    if (!item)
        return;
    item->next = http->doubted;
    http->doubted = item;
    strl_condition_signal(&http->disk_work);
}

static void free_list(strl__http_kept *item)
{
    while (item) {
        strl__http_kept *next = item->next;
        strl__free(item);
        item = next;
    }
}

void strl__http_disk_deinit(strl__http *http)
{
    free_list(http->kept);
    free_list(http->doubted);
}

/* The steps are called with the mutex held, and let go of it while they are at the disk. */

static void drop_one(strl__http *http)
{
    strl__http_kept *item = http->doubted;
    const strl__cache_key key = key_of(http, item->offset, item->size);
    http->doubted = item->next;
    strl_mutex_unlock(&http->mutex);
    strl__cache_drop(http->cache, &key);
    strl__free(item);
    strl_mutex_lock(&http->mutex);
}

static void write_one(strl__http *http)
{
    strl__http_kept *item = http->kept;
    const strl__cache_key key = key_of(http, item->offset, item->size);
    http->kept = item->next;
    if (!http->kept)
        http->kept_end = &http->kept;
    strl_mutex_unlock(&http->mutex);
    strl__cache_put(http->cache, &key, item->data);
    strl_mutex_lock(&http->mutex);
    http->kept_bytes -= item->size; /* only now: until here it took memory */
    strl__free(item);
}

static void answer(strl__http *http, strl__http_read *read, uint8_t *data)
{
    read->begin = read->offset; /* that was in the cache, not what lies round it */
    read->end = read->offset + read->size;
    read->filled = read->size;
    read->result.data = data;
    read->result.status = STRL_OK;
    http->stats.cache_hits++;
    http->stats.cache_bytes += read->size;
    strl__http_read_finish(http, read);
}

static void look_up(strl__http *http, strl__http_read *read)
{
    const strl__cache_key key = key_of(http, read->offset, read->size);
    uint64_t serial = read->serial;
    bool may_be_there = read->size <= UINT32_MAX;
    read->state = STRL__HTTP_LOOKED_UP;
    strl_mutex_unlock(&http->mutex);
    uint8_t *data = may_be_there ? strl__alloc(key.size, 1) : NULL;
    bool hit = data && strl__cache_get(http->cache, &key, data);
    strl_mutex_lock(&http->mutex);
    read = strl__http_read_find(http, serial); /* it may have been cancelled meanwhile */
    strl__pace_add_lookup(&http->pace, hit);
    if (read && hit) {
        answer(http, read, data);
        return;
    }
    strl__free(data);
    if (read) {
        read->state = STRL__HTTP_WAITING;
        curl_multi_wakeup(http->multi);
    }
}

/* Once, when there is time: the cap may be a smaller one than last time. In steps, for a read may come. */
static bool trim_some(strl__http *http)
{
    strl_mutex_unlock(&http->mutex);
    bool more = strl__cache_trim_step(http->cache);
    strl_mutex_lock(&http->mutex);
    return more;
}

/* Room first, in steps, so that no read waits behind looking a large folder through. Meanwhile what was to be written
 * may have been forgotten: what comes after it may need more room than was made. */
static void keep_some(strl__http *http)
{
    size_t size = http->kept->size;
    strl_mutex_unlock(&http->mutex);
    bool more = strl__cache_room_step(http->cache, (uint32_t)size);
    strl_mutex_lock(&http->mutex);
    if (!more && http->kept && http->kept->size <= size)
        write_one(http);
}

void strl__http_disk_run(void *context)
{
    strl__http *http = context;
    bool trimmed = false;
    strl_mutex_lock(&http->mutex);
    while (!http->disk_closing || http->doubted || http->kept) {
        strl__http_read *read = NULL;
        if (http->doubted)
            drop_one(http);
        else if (!http->disk_closing && (read = strl__http_read_most_urgent(http, STRL__HTTP_NEW, UINT64_MAX)))
            look_up(http, read);
        else if (http->kept)
            keep_some(http);
        else if (!trimmed)
            trimmed = !trim_some(http);
        else
            strl_condition_wait(&http->disk_work, &http->mutex);
    }
    strl_mutex_unlock(&http->mutex);
}
