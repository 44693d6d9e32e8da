/* Buckets are sorted along the curve, one a worker, and cut into cells. */
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"
#include "build/ingest/internal.h"

#define CELL_TRIANGLES 48u
#define CELL_BYTES_OF_MEMORY 1536u /* what a cell costs in cell table, graph and partition, generously */

#define BYTES_OF_BUCKET 3u /* what sorting one takes, in its own size: records twice, keys twice, pairs */

#define BLOCK 512u        /* triangles within which sheets are told apart */
#define BLOCK_TABLE 4096u /* a power of two above 3 * BLOCK * 2 */

typedef struct sorted_bucket {
    uint8_t *records; /* sorted */
    uint64_t count;
    uint32_t *cells; /* [cell_count] triangles of each */
    size_t cell_count, cell_capacity;
    pair *pairs; /* [pair_count] with cells counted from the bucket's first */
    size_t pair_count, pair_capacity;
} sorted_bucket;

typedef struct sorting {
    strl_build_context *context;
    strl_ingest *ingest;
    strl_buckets *buckets;
    pair_spills *pairs;
    sorted_bucket *slots;    /* per pipeline slot */
    uint32_t cell_triangles; /* most triangles of a cell */
    size_t cell_capacity;
} sorting;

/* Stable least-significant-digit radix sort; digits that are all equal cost one counting pass. */
void strl__sort_keys(strl_keyed *items, strl_keyed *other, uint64_t count)
{
    strl_keyed *from = items, *to = other;
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
        strl_keyed *swap = from;
        from = to;
        to = swap;
    }
    if (from != items)
        memcpy(items, from, count * sizeof *items);
}

static strl_status load_sorted(sorting *s, uint32_t bucket, sorted_bucket *out, strl_keyed **keys_out, strl_error *err)
{
    size_t bytes = strl_soup_bytes(s->ingest), raw_bytes = strl__soup_bucket_bytes(s->ingest);
    strl_spill *spill = s->buckets->spill[bucket];
    strl_status status = STRL_OK;
    out->count = strl_spill_bytes(spill) / raw_bytes;
    uint8_t *raw = strl__alloc(out->count, raw_bytes);
    strl_keyed *keys = strl__alloc(out->count, sizeof *keys), *other = strl__alloc(out->count, sizeof *keys);
    out->records = strl__alloc(out->count, bytes);
    if (!raw || !keys || !other || !out->records) {
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory to sort %llu triangles", (unsigned long long)out->count);
        goto done;
    }
    status = strl_spill_read(spill, 0, raw, out->count * raw_bytes, err);
    for (uint64_t i = 0; i < out->count && !status; i++) {
        strl_soup_triangle triangle;
        strl__soup_unpack(s->ingest, raw + i * raw_bytes, &triangle);
        keys[i] = (strl_keyed){strl__curve_key_of_triangle(s->ingest, &triangle), i};
    }
    if (!status) {
        strl__sort_keys(keys, other, out->count);
        for (uint64_t i = 0; i < out->count; i++)
            memcpy(out->records + i * bytes, raw + keys[i].index * raw_bytes, bytes);
    }
done:
    strl__free(raw);
    strl__free(other);
    if (status)
        strl__free(keys);
    *keys_out = status ? NULL : keys;
    return status;
}

/* Where to end a run that begins at `at` and may have `most` items: where the curve makes its largest step in reach, so
 * that runs are compact. */
static uint64_t run_end(const strl_keyed *keys, uint64_t at, uint64_t most, uint64_t count)
{
    uint64_t widest = 0, best = at + most;
    if (count - at <= most)
        return count;
    for (uint64_t i = at + most / 2; i <= at + most; i++) {
        uint64_t step = keys[i - 1].key ^ keys[i].key;
        if (step > widest) {
            widest = step;
            best = i;
        }
    }
    return best;
}

/* Room for the triangles of one block. */
typedef struct block {
    uint32_t *component; /* [3 * BLOCK] union-find over corners; then, per triangle, its component */
    uint32_t *table;     /* [BLOCK_TABLE] corner + 1 by position */
    uint32_t *order;     /* [BLOCK] */
    strl_keyed *keys;    /* [BLOCK] */
    uint8_t *records;    /* [BLOCK] packed */
    uint32_t run[BLOCK]; /* triangles of each component, in new order */
    uint32_t runs;
} block;

static uint32_t component_root(uint32_t *component, uint32_t at)
{
    while (component[at] != at)
        at = component[at] = component[component[at]];
    return at;
}

/* Corners at one position and corners of one triangle belong together. */
static void find_components(block *b, const uint8_t *records, size_t bytes, uint32_t count)
{
    memset(b->table, 0, BLOCK_TABLE * sizeof *b->table);
    for (uint32_t corner = 0; corner < 3 * count; corner++) {
        uint32_t position[3], slot;
        memcpy(position, records + corner / 3 * bytes + 12 * (corner % 3), 12);
        slot = (uint32_t)strl__mix64(position[0] ^ strl__mix64((uint64_t)position[1] << 32 | position[2])) &
               (BLOCK_TABLE - 1);
        while (b->table[slot]) {
            uint32_t other = b->table[slot] - 1;
            if (!memcmp(records + other / 3 * bytes + 12 * (other % 3), position, 12))
                break;
            slot = (slot + 1) & (BLOCK_TABLE - 1);
        }
        if (!b->table[slot])
            b->table[slot] = corner + 1;
        b->component[corner] = corner;
        uint32_t partners[2] = {b->table[slot] - 1, corner - corner % 3};
        for (int i = 0; i < 2; i++) {
            uint32_t x = component_root(b->component, corner), y = component_root(b->component, partners[i]);
            b->component[x > y ? x : y] = x > y ? y : x;
        }
    }
}

/* Sheets that pass through one block are laid one after the other, each in the order of the curve: cells then hold
 * pieces of one sheet, and clusters of layered models keep short borders. */
static void separate_sheets(block *b, uint8_t *records, strl_keyed *keys, size_t bytes, uint32_t count)
{
    uint32_t placed = 0;
    find_components(b, records, bytes, count);
    for (uint32_t t = 0; t < count; t++)
        b->order[t] = component_root(b->component, 3 * t) / 3; /* the component's first triangle */
    b->runs = 0;
    for (uint32_t first = 0; first < count; first++) {
        if (b->order[first] != first)
            continue;
        uint32_t before = placed;
        for (uint32_t t = first; t < count; t++)
            if (b->order[t] == first) {
                memcpy(b->records + placed * bytes, records + t * bytes, bytes);
                b->keys[placed++] = keys[t];
            }
        b->run[b->runs++] = placed - before;
    }
    memcpy(records, b->records, count * bytes);
    memcpy(keys, b->keys, count * sizeof *keys);
}

/* Cells of one block: pieces of one component, small components together. */
static bool cut_block(const sorting *s, sorted_bucket *out, const block *b, const strl_keyed *keys)
{
    uint64_t at = 0, end = 0, pending = 0;
    for (uint32_t i = 0; i < b->runs; i++) {
        end += b->run[i];
        pending += b->run[i];
        if (pending < s->cell_triangles / 4 && i + 1 < b->runs)
            continue;
        while (at < end) {
            uint64_t cut = run_end(keys, at, s->cell_triangles, end);
            if (!strl__grow(&out->cells, &out->cell_capacity, out->cell_count + 1, sizeof *out->cells))
                return false;
            out->cells[out->cell_count++] = (uint32_t)(cut - at);
            at = cut;
        }
        pending = 0;
    }
    return true;
}

static bool cut_cells(const sorting *s, sorted_bucket *out, strl_keyed *keys)
{
    size_t bytes = strl_soup_bytes(s->ingest);
    block b = {.component = strl__alloc(3 * BLOCK, sizeof *b.component),
               .table = strl__alloc(BLOCK_TABLE, sizeof *b.table),
               .order = strl__alloc(BLOCK, sizeof *b.order),
               .keys = strl__alloc(BLOCK, sizeof *b.keys),
               .records = strl__alloc(BLOCK, bytes)};
    bool good = b.component && b.table && b.order && b.keys && b.records;
    for (uint64_t at = 0, end; at < out->count && good; at = end) {
        end = run_end(keys, at, BLOCK, out->count);
        separate_sheets(&b, out->records + at * bytes, keys + at, bytes, (uint32_t)(end - at));
        good = cut_block(s, out, &b, keys + at);
    }
    strl__free(b.component);
    strl__free(b.table);
    strl__free(b.order);
    strl__free(b.keys);
    strl__free(b.records);
    return good;
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
                size_t slot = strl__mix64(found.position[0] ^
                                          strl__mix64((uint64_t)found.position[1] << 32 | found.position[2])) &
                              (table_size - 1);
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
    strl_keyed *keys = NULL;
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

static strl_status append_bucket(void *context, uint64_t index, unsigned slot, unsigned worker, strl_error *err)
{
    sorting *s = context;
    sorted_bucket *out = &s->slots[slot];
    strl_ingest *ingest = s->ingest;
    size_t bytes = strl_soup_bytes(ingest);
    uint64_t first = strl_spill_bytes(ingest->soup) / bytes;
    uint32_t base = ingest->cell_count;
    (void)worker;
    /* its disk is needed for the soup */
    strl_status status = strl_spill_close_and_delete(s->buckets->spill[index], err);
    s->buckets->spill[index] = NULL; /* closed in any case */
    if (!status)
        status = strl_spill_append(ingest->soup, out->records, out->count * bytes, err);
    if (!status && !strl__grow(&ingest->cells, &s->cell_capacity, base + out->cell_count, sizeof *ingest->cells))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu cells", base + out->cell_count);
    for (size_t i = 0; i < out->cell_count && !status; i++) {
        ingest->cells[ingest->cell_count++] = (strl_cell){first, out->cells[i]};
        first += out->cells[i];
    }
    for (size_t i = 0; i < out->pair_count && !status; i++) {
        out->pairs[i].cell += base;
        status = strl__pair_spills_append(s->pairs, &out->pairs[i], err);
    }
    release(out);
    return status ? status : strl__build_report(s->context, first, ingest->triangle_count, err);
}

strl_status strl__sort_buckets(strl_build_context *context, strl_ingest *ingest, strl_buckets *buckets,
                               pair_spills *pairs, strl_error *err)
{
    sorting s = {.context = context, .ingest = ingest, .buckets = buckets, .pairs = pairs};
    uint64_t most_cells = context->memory_bytes / CELL_BYTES_OF_MEMORY;
    uint64_t least = ingest->triangle_count * 2 / most_cells + 1;
    s.cell_triangles = least < CELL_TRIANGLES ? CELL_TRIANGLES : (uint32_t)least;
    uint64_t largest = 0;
    for (uint32_t i = 0; i < buckets->count; i++)
        largest = strl_spill_bytes(buckets->spill[i]) > largest ? strl_spill_bytes(buckets->spill[i]) : largest;
    unsigned window = strl__ingest_window(context, BYTES_OF_BUCKET * largest);
    s.slots = strl__alloc_zero(strl_pool_window(context->pool, window), sizeof *s.slots);
    strl_status status = s.slots ? strl__build_open_stream(context, "soup", &ingest->soup, err)
                                 : strl__fail(err, STRL_ERR_MEMORY, "no memory to sort");
    if (!status)
        status = strl__pair_spills_open(context, ingest->triangle_count, pairs, err);
    for (uint32_t i = 0; i < buckets->count && !status; i++)
        status = strl_spill_flush(buckets->spill[i], err);
    if (!status)
        status = strl_pool_ordered(context->pool, buckets->count, window, sort_bucket, append_bucket, &s, NULL, err);
    if (!status)
        status = strl_spill_flush(ingest->soup, err);
    if (!status)
        status = strl__pair_spills_flush(pairs, err);
    for (unsigned i = 0; s.slots && i < strl_pool_window(context->pool, window); i++)
        release(&s.slots[i]);
    strl__free(s.slots);
    return status;
}
