/* Pairs (position, cell), in spills by hash of position, become the edges of the cell graph and the list of shared positions. */
#include <stdlib.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"
#include "build/ingest/internal.h"

#define SHARED_WEIGHT 4u /* of one shared position, against 1 of a neighbour on the curve */
#define CURVE_REACH 2u

typedef struct connected {
    uint64_t *edges; /* a << 32 | b, one for each position that both have */
    size_t edge_count, edge_capacity;
    uint32_t *shared; /* words, as in strl_ingest.shared */
    size_t shared_count, shared_capacity;
} connected;

typedef struct connecting {
    strl_build_context *context;
    strl_ingest *ingest;
    pair_spills *pairs;
    connected *slots;
    /* edge -> weight, open addressing */
    uint64_t *key; /* 0 = free: no edge is (0, 0) */
    uint32_t *weight;
    size_t size, used;
} connecting;

static int compare_pairs(const void *a, const void *b)
{
    const pair *x = a, *y = b;
    for (int k = 0; k < 3; k++)
        if (x->position[k] != y->position[k])
            return x->position[k] < y->position[k] ? -1 : 1;
    return x->cell < y->cell ? -1 : x->cell > y->cell;
}

/* A position of n cells adds n - 1 edges along the curve's order and, where n is small, all others too. */
static bool add_position(connected *out, const pair *pairs, size_t count)
{
    if (!strl__grow(&out->shared, &out->shared_capacity, out->shared_count + 4 + count, sizeof *out->shared))
        return false;
    memcpy(out->shared + out->shared_count, pairs[0].position, 12);
    out->shared[out->shared_count + 3] = (uint32_t)count;
    for (size_t i = 0; i < count; i++)
        out->shared[out->shared_count + 4 + i] = pairs[i].cell;
    out->shared_count += 4 + count;
    for (size_t i = 0; i + 1 < count; i++) {
        size_t end = count <= 8 ? count : i + 2;
        if (!strl__grow(&out->edges, &out->edge_capacity, out->edge_count + (end - i), sizeof *out->edges))
            return false;
        for (size_t k = i + 1; k < end; k++)
            out->edges[out->edge_count++] = (uint64_t)pairs[i].cell << 32 | pairs[k].cell;
    }
    return true;
}

static strl_status connect_spill(void *context, uint64_t index, unsigned slot, unsigned worker, strl_error *err)
{
    connecting *c = context;
    connected *out = &c->slots[slot];
    pair *pairs;
    size_t count;
    bool good = true;
    (void)worker;
    *out = (connected){0};
    strl_status status = strl__pair_spills_read(c->pairs, (uint32_t)index, &pairs, &count, err);
    if (status)
        return status;
    qsort(pairs, count, sizeof *pairs, compare_pairs);
    for (size_t i = 0, end; i < count && good; i = end) {
        for (end = i + 1; end < count && !memcmp(pairs[i].position, pairs[end].position, 12);)
            end++;
        if (end - i > 1)
            good = add_position(out, pairs + i, end - i);
    }
    strl__free(pairs);
    return good ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "no memory to connect %zu positions", count);
}

static bool count_edge(connecting *c, uint64_t key, uint32_t weight)
{
    if (2 * (c->used + 1) > c->size) {
        connecting bigger = {.size = c->size ? 2 * c->size : 1024};
        bigger.key = strl__alloc_zero(bigger.size, sizeof *bigger.key);
        bigger.weight = strl__alloc(bigger.size, sizeof *bigger.weight);
        bool good = bigger.key && bigger.weight;
        for (size_t i = 0; i < c->size && good; i++)
            if (c->key[i])
                good = count_edge(&bigger, c->key[i], c->weight[i]);
        strl__free(good ? c->key : bigger.key);
        strl__free(good ? c->weight : bigger.weight);
        if (!good)
            return false;
        c->key = bigger.key, c->weight = bigger.weight, c->size = bigger.size;
    }
    size_t at = strl__mix64(key) & (c->size - 1);
    while (c->key[at] && c->key[at] != key)
        at = (at + 1) & (c->size - 1);
    if (!c->key[at]) {
        c->key[at] = key;
        c->weight[at] = 0;
        c->used++;
    }
    c->weight[at] += weight;
    return true;
}

static void release(connected *out)
{
    strl__free(out->edges);
    strl__free(out->shared);
    *out = (connected){0};
}

static strl_status take_connected(void *context, uint64_t index, unsigned slot, unsigned worker, strl_error *err)
{
    connecting *c = context;
    connected *out = &c->slots[slot];
    (void)worker;
    strl_status status = strl_spill_append(c->ingest->shared, out->shared, out->shared_count * sizeof *out->shared, err);
    for (size_t i = 0; i < out->edge_count && !status; i++)
        if (!count_edge(c, out->edges[i], SHARED_WEIGHT))
            status = strl__fail(err, STRL_ERR_MEMORY, "no memory for the graph of %u cells", c->ingest->cell_count);
    release(out);
    if (!status)
        status = strl__pair_spills_delete(c->pairs, (uint32_t)index, err);
    return status ? status : strl__build_report(c->context, index + 1, c->pairs->count, err);
}

static int compare_edges(const void *a, const void *b)
{
    const strl_cell_edge *x = a, *y = b;
    if (x->a != y->a)
        return x->a < y->a ? -1 : 1;
    return x->b < y->b ? -1 : x->b > y->b;
}

/* Cells that follow each other on the curve are near each other, if not connected: a weak edge keeps them together where
 * nothing else decides (the paper's inverse distance). */
static bool add_curve_edges(connecting *c)
{
    for (uint32_t cell = 0; cell + 1 < c->ingest->cell_count; cell++)
        for (uint32_t ahead = 1; ahead <= CURVE_REACH && cell + ahead < c->ingest->cell_count; ahead++)
            if (!count_edge(c, (uint64_t)cell << 32 | (cell + ahead), 1))
                return false;
    return true;
}

static strl_status list_edges(connecting *c, strl_error *err)
{
    strl_ingest *ingest = c->ingest;
    if (!add_curve_edges(c))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the graph of %u cells", ingest->cell_count);
    ingest->edges = strl__alloc(c->used, sizeof *ingest->edges);
    if (!ingest->edges)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the graph of %u cells", ingest->cell_count);
    for (size_t i = 0; i < c->size; i++)
        if (c->key[i])
            ingest->edges[ingest->edge_count++] =
                (strl_cell_edge){(uint32_t)(c->key[i] >> 32), (uint32_t)c->key[i], c->weight[i]};
    qsort(ingest->edges, ingest->edge_count, sizeof *ingest->edges, compare_edges);
    return STRL_OK;
}

strl_status strl__connect_cells(strl_build_context *context, strl_ingest *ingest, pair_spills *pairs, strl_error *err)
{
    connecting c = {.context = context, .ingest = ingest, .pairs = pairs};
    unsigned window = strl_pool_workers(context->pool);
    c.slots = strl__alloc_zero(strl_pool_window(context->pool, window), sizeof *c.slots);
    strl_status status = c.slots ? strl__build_open_stream(context, "shared", &ingest->shared, err)
                                 : strl__fail(err, STRL_ERR_MEMORY, "no memory to connect cells");
    if (!status)
        status = strl_pool_ordered(context->pool, pairs->count, window, connect_spill, take_connected, &c, NULL, err);
    if (!status)
        status = strl_spill_flush(ingest->shared, err);
    if (!status)
        status = list_edges(&c, err);
    for (unsigned i = 0; c.slots && i < strl_pool_window(context->pool, window); i++)
        release(&c.slots[i]);
    strl__free(c.slots);
    strl__free(c.key);
    strl__free(c.weight);
    return status;
}
