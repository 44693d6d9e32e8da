/* See shuffle.h.
 *
 * Two passes, so that a disk is never asked for one record at a time. The output is cut into windows that fit in
 * memory. How many records fall into each is known beforehand, so one spill holds all windows side by side: the first
 * pass appends each record with its place to its window, the second loads one window after the other and lays its
 * records out. */
#include "scenes/shuffle.h"

#include <inttypes.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"

#define LEAST_BUFFER_BYTES 1024u

enum { PLACE_BYTES = 4 };

strl__permutation strl__permutation_of(uint64_t count, uint64_t seed)
{
    strl__permutation made = {.count = count};
    unsigned bits = 2;
    while (bits < 64 && (count - 1) >> bits)
        bits++;
    made.low_bits = bits / 2;
    made.high_bits = bits - made.low_bits;
    for (int i = 0; i < STRL__PERMUTATION_ROUNDS; i++)
        made.keys[i] = strl__mix64(strl__mix64(seed) + 0x9e3779b97f4a7c15u * (uint64_t)(i + 1));
    return made;
}

/* Either half is changed by a function of the other alone, so every round can be undone. */
static uint64_t feistel(const strl__permutation *permutation, uint64_t value)
{
    uint64_t low_mask = ((uint64_t)1 << permutation->low_bits) - 1,
             high_mask = ((uint64_t)1 << permutation->high_bits) - 1;
    uint64_t low = value & low_mask, high = value >> permutation->low_bits;
    for (int i = 0; i < STRL__PERMUTATION_ROUNDS; i += 2) {
        high ^= strl__mix64(low + permutation->keys[i]) & high_mask;
        low ^= strl__mix64(high + permutation->keys[i + 1]) & low_mask;
    }
    return high << permutation->low_bits | low;
}

uint64_t strl__permutation_at(const strl__permutation *permutation, uint64_t index)
{
    do
        index = feistel(permutation, index);
    while (index >= permutation->count);
    return index;
}

typedef struct window {
    uint8_t *buffer; /* part of windows.buffers */
    size_t used;
    uint64_t offset; /* in the spill, of what comes next */
} window;

typedef struct windows {
    window *items;
    uint8_t *buffers;
    uint64_t count;
    uint64_t records; /* of a whole window */
    size_t entry_bytes, buffer_bytes;
} windows;

static strl_status windows_init(windows *all, const strl__shuffle *shuffle, const strl__records *records,
                                strl_error *err)
{
    uint64_t half = shuffle->memory_bytes / 2;
    all->entry_bytes = PLACE_BYTES + records->bytes;
    /* The second pass holds a window's entries and its records. */
    all->records = half / (all->entry_bytes + records->bytes) + 1;
    all->records = all->records < UINT32_MAX ? all->records : UINT32_MAX;
    all->records = all->records < records->count ? all->records : records->count;
    all->count = (records->count + all->records - 1) / all->records;
    uint64_t each = half / (all->count ? all->count : 1);
    all->buffer_bytes = (size_t)(each < (1u << 18) ? each : 1u << 18) / all->entry_bytes * all->entry_bytes;
    if (all->buffer_bytes < LEAST_BUFFER_BYTES)
        return strl__fail(err, STRL_ERR_MEMORY,
                          "%s: a memory budget of %" PRIu64 " bytes is too small to shuffle %" PRIu64
                          " records of %zu bytes: %" PRIu64 " parts would have %zu bytes each, expected %u",
                          shuffle->path, shuffle->memory_bytes, records->count, records->bytes, all->count,
                          (size_t)each, LEAST_BUFFER_BYTES);
    all->items = strl__alloc_zero((size_t)all->count, sizeof *all->items);
    all->buffers = strl__alloc((size_t)all->count, all->buffer_bytes);
    if (!all->items || !all->buffers)
        return strl__fail(err, STRL_ERR_MEMORY, "%s: no memory to shuffle %" PRIu64 " records", shuffle->path,
                          records->count);
    for (uint64_t i = 0; i < all->count; i++) {
        all->items[i].buffer = all->buffers + i * all->buffer_bytes;
        all->items[i].offset = i * all->records * all->entry_bytes;
    }
    return STRL_OK;
}

static strl_status flush_window(const strl__shuffle *shuffle, window *to, strl_error *err)
{
    strl_status status = strl_file_write(shuffle->spill, to->offset, to->buffer, to->used, err);
    to->offset += to->used;
    to->used = 0;
    return status;
}

static strl_status put_record(const strl__shuffle *shuffle, windows *all, uint64_t place, const uint8_t *record,
                              strl_error *err)
{
    window *to = &all->items[place / all->records];
    uint32_t inside = (uint32_t)(place % all->records);
    memcpy(to->buffer + to->used, &inside, PLACE_BYTES);
    memcpy(to->buffer + to->used + PLACE_BYTES, record, all->entry_bytes - PLACE_BYTES);
    to->used += all->entry_bytes;
    return to->used == all->buffer_bytes ? flush_window(shuffle, to, err) : STRL_OK;
}

static strl_status report(const strl__shuffle *shuffle, const strl__records *records, uint64_t done, strl_error *err)
{
    return shuffle->report
               ? shuffle->report(shuffle->context, done * records->bytes, 2 * records->count * records->bytes, err)
               : STRL_OK;
}

static strl_status distribute(const strl__shuffle *shuffle, windows *all, const strl__records *records, strl_error *err)
{
    uint8_t *batch = strl__alloc(STRL__RECORD_BATCH, records->bytes);
    strl_status status = batch ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "%s: no memory to shuffle", shuffle->path);
    for (uint64_t first = 0; status == STRL_OK && first < records->count;) {
        uint64_t left = records->count - first;
        size_t count = left < STRL__RECORD_BATCH ? (size_t)left : STRL__RECORD_BATCH;
        status = records->read(records->context, first, count, batch, err);
        for (size_t i = 0; status == STRL_OK && i < count; i++)
            status = put_record(shuffle, all, strl__permutation_at(shuffle->order, first + i),
                                batch + i * records->bytes, err);
        first += count;
        if (status == STRL_OK)
            status = report(shuffle, records, first, err);
    }
    for (uint64_t i = 0; status == STRL_OK && i < all->count; i++)
        status = flush_window(shuffle, &all->items[i], err);
    strl__free(batch);
    return status;
}

static strl_status lay_out(const strl__shuffle *shuffle, const windows *all, const strl__records *records,
                           strl__stream *out, strl_error *err)
{
    uint8_t *entries = strl__alloc((size_t)all->records, all->entry_bytes);
    uint8_t *placed = strl__alloc((size_t)all->records, records->bytes);
    strl_status status =
        entries && placed ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "%s: no memory to shuffle", shuffle->path);
    for (uint64_t first = 0; status == STRL_OK && first < records->count; first += all->records) {
        uint64_t left = records->count - first, count = left < all->records ? left : all->records;
        status =
            strl_file_read(shuffle->spill, first * all->entry_bytes, entries, (size_t)count * all->entry_bytes, err);
        strl_file_punch(shuffle->spill, first * all->entry_bytes, count * all->entry_bytes);
        for (uint64_t i = 0; status == STRL_OK && i < count; i++) {
            uint32_t inside;
            memcpy(&inside, entries + i * all->entry_bytes, PLACE_BYTES);
            memcpy(placed + inside * records->bytes, entries + i * all->entry_bytes + PLACE_BYTES, records->bytes);
        }
        if (status == STRL_OK)
            status = strl__stream_write(out, placed, count * records->bytes, err);
        if (status == STRL_OK)
            status = report(shuffle, records, records->count + first + count, err);
    }
    strl__free(entries);
    strl__free(placed);
    return status;
}

strl_status strl__shuffle_write(const strl__shuffle *shuffle, const strl__records *records, strl__stream *out,
                                strl_error *err)
{
    windows all = {0};
    strl_status status = windows_init(&all, shuffle, records, err);
    if (status == STRL_OK)
        status = distribute(shuffle, &all, records, err);
    strl__free(all.buffers); /* the second pass needs their room */
    strl__free(all.items);
    return status == STRL_OK ? lay_out(shuffle, &all, records, out, err) : status;
}
