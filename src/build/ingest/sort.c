/* Buckets are sorted along the curve, one a worker, and cut into cells. */
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"
#include "build/ingest/internal.h"

#define LEAST_CELL_TRIANGLES 32u
#define CELL_BYTES_OF_MEMORY 1536u /* what a cell costs in cell table, graph and partition, generously */

/* A lattice position and the cell that has it: one record of a pair spill. */
typedef struct pair {
    uint32_t position[3];
    uint32_t cell;
} pair;

typedef struct sorted_bucket {
    uint8_t *records;  /* sorted */
    uint64_t count;
    uint32_t *cells;   /* [cell_count] triangles of each */
    size_t cell_count, cell_capacity;
    pair *pairs;       /* [pair_count] with cells counted from the bucket's first */
    size_t pair_count, pair_capacity;
} sorted_bucket;

typedef struct sorting {
    strl_build_context *context;
    strl_ingest *ingest;
    bucket_set *buckets;
    pair_spills *pairs;
    sorted_bucket *slots; /* per pipeline slot */
    uint32_t cell_triangles; /* most triangles of a cell */
    size_t cell_capacity;
} sorting;

typedef struct keyed {
    uint64_t key;
    uint64_t index;
} keyed;

/* Stable least-significant-digit radix sort; digits that are all equal cost one counting pass. */
static void radix_sort(keyed *items, keyed *other, uint64_t count)
{
    keyed *from = items, *to = other;
    for (unsigned shift = 0; shift < 64; shift += 11) {
        uint64_t start[2049] = {0};
        for (uint64_t i = 0; i < count; i++)
            start[(from[i].key >> shift & 2047) + 1]++;
        bool single = false;
        for (unsigned d = 1; d <= 2048 && !single; d++)
            single = start[d] == count;
        if (single)
            continue;
        for (unsigned d = 0; d < 2048; d++)
            start[d + 1] += start[d];
        for (uint64_t i = 0; i < count; i++)
            to[start[from[i].key >> shift & 2047]++] = from[i];
        keyed *swap = from;
        from = to;
        to = swap;
    }
    if (from != items)
        memcpy(items, from, count * sizeof *items);
}

static strl_status load_sorted(sorting *s, uint32_t bucket, sorted_bucket *out, keyed **keys_out, strl_error *err)
{
    size_t bytes = strl_soup_bytes(s->ingest);
    strl_spill *spill = s->buckets->spill[bucket];
    strl_status status = STRL_OK;
    out->count = strl_spill_bytes(spill) / bytes;
    uint8_t *raw = strl__alloc(out->count, bytes);
    keyed *keys = strl__alloc(out->count, sizeof *keys), *other = strl__alloc(out->count, sizeof *keys);
    out->records = strl__alloc(out->count, bytes);
    if (!raw || !keys || !other || !out->records) {
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory to sort %llu triangles", (unsigned long long)out->count);
        goto done;
    }
    status = strl_spill_read(spill, 0, raw, out->count * bytes, err);
    for (uint64_t i = 0; i < out->count && !status; i++) {
        strl_soup_triangle triangle;
        strl__soup_unpack(s->ingest, raw + i * bytes, &triangle);
        keys[i] = (keyed){strl__curve_key_of_triangle(s->ingest, &triangle), i};
    }
    if (!status) {
        radix_sort(keys, other, out->count);
        for (uint64_t i = 0; i < out->count; i++)
            memcpy(out->records + i * bytes, raw + keys[i].index * bytes, bytes);
    }
done:
    strl__free(raw);
    strl__free(other);
    if (status)
        strl__free(keys);
    *keys_out = status ? NULL : keys;
    return status;
}

/* Cuts where the curve makes its largest step in reach, so that cells are compact. */
static bool cut_cells(const sorting *s, sorted_bucket *out, const keyed *keys)
{
    uint64_t at = 0;
    while (at < out->count) {
        uint64_t end = at + s->cell_triangles, best = out->count;
        if (end < out->count) {
            uint64_t widest = 0;
            best = end;
            for (uint64_t i = at + s->cell_triangles / 2; i <= end; i++) {
                uint64_t step = keys[i - 1].key ^ keys[i].key;
                if (step > widest) {
                    widest = step;
                    best = i;
                }
            }
        }
        if (!strl__grow(&out->cells, &out->cell_capacity, out->cell_count + 1, sizeof *out->cells))
            return false;
        out->cells[out->cell_count++] = (uint32_t)(best - at);
        at = best;
    }
    return true;
}

/* The different positions of one cell, found by a small table that is cleared from cell to cell. */
static bool collect_pairs(const sorting *s, sorted_bucket *out)
{
    size_t bytes = strl_soup_bytes(s->ingest), table_size = 16;
    while (table_size < (size_t)s->cell_triangles * 6)
        table_size *= 2;
    size_t *table = strl__alloc(table_size, sizeof *table); /* pair index + 1 */
    uint64_t at = 0;
    bool good = table != NULL;
    for (uint32_t cell = 0; cell < out->cell_count && good; cell++) {
        memset(table, 0, table_size * sizeof *table);
        for (uint64_t end = at + out->cells[cell]; at < end && good; at++)
            for (int c = 0; c < 3 && good; c++) {
                pair found = {.cell = cell};
                memcpy(found.position, out->records + at * bytes + 12 * c, 12);
                size_t slot = strl__mix64(found.position[0] ^ strl__mix64((uint64_t)found.position[1] << 32 |
                                                                          found.position[2])) & (table_size - 1);
                while (table[slot] && memcmp(out->pairs[table[slot] - 1].position, found.position, 12))
                    slot = (slot + 1) & (table_size - 1);
                if (table[slot])
                    continue;
                good = strl__grow(&out->pairs, &out->pair_capacity, out->pair_count + 1, sizeof *out->pairs);
                if (good) {
                    out->pairs[out->pair_count++] = found;
                    table[slot] = out->pair_count;
                }
            }
    }
    strl__free(table);
    return good;
}

static strl_status sort_bucket(void *context, uint64_t index, unsigned slot, unsigned worker, strl_error *err)
{
    sorting *s = context;
    sorted_bucket *out = &s->slots[slot];
    keyed *keys = NULL;
    (void)worker;
    *out = (sorted_bucket){0};
    strl_status status = load_sorted(s, (uint32_t)index, out, &keys, err);
    if (!status && (!cut_cells(s, out, keys) || !collect_pairs(s, out)))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory to sort %llu triangles", (unsigned long long)out->count);
    strl__free(keys);
    return status;
}

static void release(sorted_bucket *out)
{
    strl__free(out->records);
    strl__free(out->cells);
    strl__free(out->pairs);
    *out = (sorted_bucket){0};
}

/* Which pair spill a position goes to. */
static uint32_t pair_spill_of(const pair_spills *pairs, const uint32_t position[3])
{
    uint64_t hash = strl__mix64(((uint64_t)position[0] << 32 | position[1]) ^ strl__mix64(position[2] + 1));
    return (uint32_t)(hash >> 40) & (pairs->count - 1);
}

static strl_status append_bucket(void *context, uint64_t index, unsigned slot, unsigned worker, strl_error *err)
{
    sorting *s = context;
    sorted_bucket *out = &s->slots[slot];
    strl_ingest *ingest = s->ingest;
    size_t bytes = strl_soup_bytes(ingest);
    uint64_t first = strl_spill_bytes(ingest->soup) / bytes;
    uint32_t base = ingest->cell_count;
    (void)worker;
    strl_status status = strl_spill_append(ingest->soup, out->records, out->count * bytes, err);
    if (!status && !strl__grow(&ingest->cells, &s->cell_capacity, base + out->cell_count, sizeof *ingest->cells))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu cells", base + out->cell_count);
    for (size_t i = 0; i < out->cell_count && !status; i++) {
        ingest->cells[ingest->cell_count++] = (strl_cell){first, out->cells[i]};
        first += out->cells[i];
    }
    for (size_t i = 0; i < out->pair_count && !status; i++) {
        out->pairs[i].cell += base;
        uint32_t to = pair_spill_of(s->pairs, out->pairs[i].position);
        status = strl_spill_append(s->pairs->spill[to], &out->pairs[i], sizeof *out->pairs, err);
    }
    release(out);
    if (!status)
        status = strl_spill_close_and_delete(s->buckets->spill[index], err);
    s->buckets->spill[index] = status ? s->buckets->spill[index] : NULL;
    return status ? status : strl__build_report(s->context, first, ingest->triangle_count, err);
}

static strl_status open_pair_spills(const sorting *s, strl_error *err)
{
    uint64_t bytes = s->ingest->triangle_count * 14, each = strl__bucket_bytes(s->context) / 4;
    s->pairs->count = 1;
    while (s->pairs->count < 256 && bytes / s->pairs->count > each)
        s->pairs->count *= 2;
    s->pairs->spill = strl__alloc_zero(s->pairs->count, sizeof(strl_spill *));
    strl_status status = s->pairs->spill ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "no memory for %u spills",
                                                                s->pairs->count);
    for (uint32_t i = 0; i < s->pairs->count && !status; i++) {
        char name[32];
        snprintf(name, sizeof name, "pairs-%03u", i);
        status = strl_spill_open(s->context->spills, name, 32u << 10, &s->pairs->spill[i], err);
    }
    return status;
}

void strl__pair_spills_deinit(pair_spills *pairs)
{
    for (uint32_t i = 0; pairs->spill && i < pairs->count; i++)
        strl_spill_close_and_delete(pairs->spill[i], NULL);
    strl__free(pairs->spill);
    *pairs = (pair_spills){0};
}

strl_status strl__sort_buckets(strl_build_context *context, strl_ingest *ingest, bucket_set *buckets, pair_spills *pairs,
                               strl_error *err)
{
    sorting s = {.context = context, .ingest = ingest, .buckets = buckets, .pairs = pairs};
    uint64_t most_cells = context->memory_bytes / CELL_BYTES_OF_MEMORY;
    uint64_t least = ingest->triangle_count * 4 / 3 / most_cells + 1;
    s.cell_triangles = least < 2 * LEAST_CELL_TRIANGLES ? 2 * LEAST_CELL_TRIANGLES : (uint32_t)least;
    unsigned window = strl_pool_workers(context->pool);
    s.slots = strl__alloc_zero(strl_pool_window(context->pool, window), sizeof *s.slots);
    strl_status status = s.slots ? strl_spill_open(context->spills, "soup", 0, &ingest->soup, err)
                                 : strl__fail(err, STRL_ERR_MEMORY, "no memory to sort");
    if (!status)
        status = open_pair_spills(&s, err);
    for (uint32_t i = 0; i < buckets->count && !status; i++)
        status = strl_spill_flush(buckets->spill[i], err);
    if (!status)
        status = strl_pool_ordered(context->pool, buckets->count, window, sort_bucket, append_bucket, &s, NULL, err);
    if (!status)
        status = strl_spill_flush(ingest->soup, err);
    for (uint32_t i = 0; i < pairs->count && !status; i++)
        status = strl_spill_flush(pairs->spill[i], err);
    for (unsigned i = 0; s.slots && i < strl_pool_window(context->pool, window); i++)
        release(&s.slots[i]);
    strl__free(s.slots);
    return status;
}
