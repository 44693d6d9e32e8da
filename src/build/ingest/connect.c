/* Pairs (position, cell), in spills by hash of position, become the edges of the cell graph and the list of shared
 * positions. */
#include <stdlib.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"
#include "build/ingest/internal.h"

#define SHARED_WEIGHT 4u /* of one shared position, against 1 of a neighbour on the curve */
#define CURVE_REACH 2u
#define BYTES_OF_PAIR 64u /* while pairs are connected: the pair, its place in the chains, shared positions, edges */

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

/* Which pairs of a spill have one position: chains through them, begun at the first. */
typedef struct chains {
    uint32_t *slots; /* by hash of position: first pair + 1; 0 = free */
    uint32_t mask;
    uint32_t *next;  /* [count] the next pair of the position; NO_PAIR = none */
    uint32_t *last;  /* [count] of a first pair: the last one of its position; NO_PAIR = it is no first pair */
    uint32_t *cells; /* [count] of one chain */
} chains;

#define NO_PAIR UINT32_MAX

static void release_chains(chains *c)
{
    strl__free(c->slots);
    strl__free(c->next);
    strl__free(c->last);
    strl__free(c->cells);
}

static bool make_chains(chains *c, const pair *pairs, uint32_t count)
{
    uint32_t size = 16;
    while (size / 2 < count)
        size *= 2;
    *c = (chains){.slots = strl__alloc_zero(size, sizeof *c->slots),
                  .mask = size - 1,
                  .next = strl__alloc(count, sizeof *c->next),
                  .last = strl__alloc(count, sizeof *c->last),
                  .cells = strl__alloc(count, sizeof *c->cells)};
    if (!c->slots || !c->next || !c->last || !c->cells)
        return false;
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t *p = pairs[i].position;
        uint32_t at = (uint32_t)strl__mix64(p[0] ^ strl__mix64((uint64_t)p[1] << 32 | p[2])) & c->mask;
        while (c->slots[at] && memcmp(pairs[c->slots[at] - 1].position, p, sizeof pairs[i].position))
            at = (at + 1) & c->mask;
        c->next[i] = c->last[i] = NO_PAIR;
        if (!c->slots[at]) {
            c->slots[at] = i + 1;
            c->last[i] = i;
        } else {
            uint32_t first = c->slots[at] - 1;
            c->next[c->last[first]] = i;
            c->last[first] = i;
        }
    }
    return true;
}

/* A position of n cells adds n - 1 edges along the curve's order and, where n is small, all others too. */
static bool add_position(connected *out, const uint32_t position[3], const uint32_t *cells, size_t count)
{
    if (!strl__grow(&out->shared, &out->shared_capacity, out->shared_count + 4 + count, sizeof *out->shared))
        return false;
    memcpy(out->shared + out->shared_count, position, 12);
    out->shared[out->shared_count + 3] = (uint32_t)count;
    memcpy(out->shared + out->shared_count + 4, cells, count * sizeof *cells);
    out->shared_count += 4 + count;
    for (size_t i = 0; i + 1 < count; i++) {
        size_t end = count <= 8 ? count : i + 2;
        if (!strl__grow(&out->edges, &out->edge_capacity, out->edge_count + (end - i), sizeof *out->edges))
            return false;
        for (size_t k = i + 1; k < end; k++)
            out->edges[out->edge_count++] = (uint64_t)cells[i] << 32 | cells[k];
    }
    return true;
}

/* Cells ascend along a chain, as they do in the spill. */
static bool add_positions(connected *out, const pair *pairs, uint32_t count)
{
    chains c;
    bool good = make_chains(&c, pairs, count);
    for (uint32_t i = 0; i < count && good; i++) {
        size_t cells = 0;
        for (uint32_t k = c.last[i] == NO_PAIR || c.next[i] == NO_PAIR ? NO_PAIR : i; k != NO_PAIR; k = c.next[k])
            c.cells[cells++] = pairs[k].cell;
        good = cells == 0 || add_position(out, pairs[i].position, c.cells, cells);
    }
    release_chains(&c);
    return good;
}

static strl_status connect_spill(void *context, uint64_t index, unsigned slot, unsigned worker, strl_error *err)
{
    connecting *c = context;
    connected *out = &c->slots[slot];
    pair *pairs;
    size_t count;
    (void)worker;
    *out = (connected){0};
    strl_status status = strl__pair_spills_read(c->pairs, (uint32_t)index, &pairs, &count, err);
    if (status)
        return status;
    if (count > UINT32_MAX / 4)
        status = strl__fail(err, STRL_ERR_INTERNAL, "%zu positions are too many to connect at once", count);
    else if (!add_positions(out, pairs, (uint32_t)count))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory to connect %zu positions", count);
    strl__free(pairs);
    return status;
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
    strl_status status =
        strl_spill_append(c->ingest->shared, out->shared, out->shared_count * sizeof *out->shared, err);
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

/* Cells that follow each other on the curve are near each other, if not connected: a weak edge keeps them together
 * where nothing else decides (the paper's inverse distance). */
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
    uint64_t largest = 0;
    for (uint32_t i = 0; i < pairs->count; i++)
        largest = pairs->stream[i].count > largest ? pairs->stream[i].count : largest;
    unsigned window = strl__ingest_window(context, BYTES_OF_PAIR * largest);
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
