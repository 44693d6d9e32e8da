#include "build/clusters/partition.h"

#include <stdlib.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"

#define LEAST_GRAPH 24u /* smaller pieces are divided along the curve */

typedef struct splitter {
    const strl_ingest *ingest;
    uint32_t *order;                 /* [cell_count] cells; a piece is a range of it */
    uint32_t *other;                 /* [cell_count] */
    int32_t *local;                  /* [cell_count] index within the piece at hand; -1 = not in it */
    size_t *edge_first;              /* [cell_count + 1] */
    uint32_t *edge_to, *edge_weight; /* both directions */
    /* METIS' arrays, as large as the whole graph needs */
    int32_t *first, *neighbour, *vertex_weight, *metis_weight, *side;
} splitter;

static bool build_adjacency(splitter *s)
{
    const strl_ingest *ingest = s->ingest;
    uint32_t cells = ingest->cell_count;
    s->edge_first = strl__alloc_zero((size_t)cells + 2, sizeof *s->edge_first);
    s->edge_to = strl__alloc(2 * ingest->edge_count, sizeof *s->edge_to);
    s->edge_weight = strl__alloc(2 * ingest->edge_count, sizeof *s->edge_weight);
    if (!s->edge_first || !s->edge_to || !s->edge_weight)
        return false;
    for (size_t i = 0; i < ingest->edge_count; i++) {
        s->edge_first[ingest->edges[i].a + 2]++;
        s->edge_first[ingest->edges[i].b + 2]++;
    }
    for (uint32_t c = 0; c <= cells; c++)
        s->edge_first[c + 1] += s->edge_first[c];
    for (size_t i = 0; i < ingest->edge_count; i++) {
        const strl_cell_edge *edge = &ingest->edges[i];
        for (int way = 0; way < 2; way++) {
            size_t at = s->edge_first[(way ? edge->b : edge->a) + 1]++;
            s->edge_to[at] = way ? edge->a : edge->b;
            s->edge_weight[at] = edge->weight;
        }
    }
    return true;
}

static bool allocate(splitter *s)
{
    uint32_t cells = s->ingest->cell_count;
    s->order = strl__alloc(cells, sizeof *s->order);
    s->other = strl__alloc(cells, sizeof *s->other);
    s->local = strl__alloc(cells, sizeof *s->local);
    s->first = strl__alloc((size_t)cells + 1, sizeof *s->first);
    s->neighbour = strl__alloc(2 * s->ingest->edge_count, sizeof *s->neighbour);
    s->metis_weight = strl__alloc(2 * s->ingest->edge_count, sizeof *s->metis_weight);
    s->vertex_weight = strl__alloc(cells, sizeof *s->vertex_weight);
    s->side = strl__alloc(cells, sizeof *s->side);
    return s->order && s->other && s->local && s->first && s->neighbour && s->metis_weight && s->vertex_weight &&
           s->side && build_adjacency(s);
}

static void release(splitter *s)
{
    strl__free(s->order);
    strl__free(s->other);
    strl__free(s->local);
    strl__free(s->edge_first);
    strl__free(s->edge_to);
    strl__free(s->edge_weight);
    strl__free(s->first);
    strl__free(s->neighbour);
    strl__free(s->metis_weight);
    strl__free(s->vertex_weight);
    strl__free(s->side);
}

/* The first half of the weight along the curve against the rest. */
static void split_along_curve(splitter *s, uint32_t begin, uint32_t count, uint64_t weight)
{
    uint64_t sum = 0;
    for (uint32_t i = 0; i < count; i++) {
        uint32_t triangles = s->ingest->cells[s->order[begin + i]].count;
        s->side[i] = 2 * sum + triangles > weight;
        sum += triangles;
    }
    s->side[0] = 0;
    if (count > 1)
        s->side[count - 1] = 1;
}

static bool split_by_graph(splitter *s, uint32_t begin, uint32_t count, uint64_t weight)
{
    int32_t edges = 0;
    for (uint32_t i = 0; i < count; i++)
        s->local[s->order[begin + i]] = (int32_t)i;
    for (uint32_t i = 0; i < count; i++) {
        uint32_t cell = s->order[begin + i];
        s->first[i] = edges;
        s->vertex_weight[i] = (int32_t)s->ingest->cells[cell].count;
        for (size_t e = s->edge_first[cell]; e < s->edge_first[cell + 1]; e++)
            if (s->local[s->edge_to[e]] >= 0) {
                s->neighbour[edges] = s->local[s->edge_to[e]];
                s->metis_weight[edges++] = (int32_t)s->edge_weight[e];
            }
    }
    s->first[count] = edges;
    bool good = strl__metis_bisect((int32_t)count, s->first, s->neighbour, s->vertex_weight, s->metis_weight, s->side);
    for (uint32_t i = 0; i < count; i++)
        s->local[s->order[begin + i]] = -1;
    uint64_t left = 0;
    for (uint32_t i = 0; i < count && good; i++)
        left += s->side[i] ? 0 : s->ingest->cells[s->order[begin + i]].count;
    return good && left * 10 >= weight * 4 && left * 10 <= weight * 6;
}

/* Orders the piece by side, stably. Returns the size of the first side. */
static uint32_t divide(splitter *s, uint32_t begin, uint32_t count)
{
    uint64_t weight = 0;
    uint32_t left = 0, right = 0;
    for (uint32_t i = 0; i < count; i++)
        weight += s->ingest->cells[s->order[begin + i]].count;
    if (count < LEAST_GRAPH || !split_by_graph(s, begin, count, weight))
        split_along_curve(s, begin, count, weight);
    for (uint32_t i = 0; i < count; i++)
        if (s->side[i])
            s->other[right++] = s->order[begin + i];
        else
            s->order[begin + left++] = s->order[begin + i];
    memcpy(s->order + begin + left, s->other, right * sizeof *s->other);
    return left;
}

static int compare_words(const void *a, const void *b)
{
    uint32_t x, y;
    memcpy(&x, a, sizeof x);
    memcpy(&y, b, sizeof y);
    return x < y ? -1 : x > y;
}

uint32_t strl_partition_depth(const strl_ingest *ingest)
{
    uint32_t depth = 0;
    while (ingest->triangle_count >> depth > STRL_CLUSTER_TRIANGLES && ingest->cell_count >> (depth + 1) >= 4)
        depth++;
    return depth;
}

strl_status strl_partition_create(const strl_ingest *ingest, strl_partition *partition, strl_error *err)
{
    splitter s = {.ingest = ingest};
    uint32_t cells = ingest->cell_count;
    *partition = (strl_partition){0};
    partition->depth = strl_partition_depth(ingest);
    uint32_t clusters = 1u << partition->depth;
    partition->cluster = strl__alloc(cells, sizeof *partition->cluster);
    partition->cluster_first = strl__alloc((size_t)clusters + 1, sizeof *partition->cluster_first);
    if (!partition->cluster || !partition->cluster_first || !allocate(&s)) {
        release(&s);
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to partition %u cells", cells);
    }
    for (uint32_t c = 0; c < cells; c++) {
        s.order[c] = c;
        s.local[c] = -1;
    }
    partition->cluster_first[0] = 0;
    partition->cluster_first[clusters] = cells;
    for (uint32_t level = 0; level < partition->depth; level++) {
        uint32_t stride = clusters >> level;
        for (uint32_t piece = 0; piece < clusters; piece += stride) {
            uint32_t begin = partition->cluster_first[piece], end = partition->cluster_first[piece + stride];
            partition->cluster_first[piece + stride / 2] = begin + (end > begin ? divide(&s, begin, end - begin) : 0);
        }
    }
    for (uint32_t i = 0; i < clusters; i++) {
        uint32_t begin = partition->cluster_first[i], end = partition->cluster_first[i + 1];
        qsort(s.order + begin, end - begin, sizeof *s.order, compare_words);
        for (uint32_t c = begin; c < end; c++)
            partition->cluster[s.order[c]] = i;
    }
    partition->cell = s.order;
    s.order = NULL;
    release(&s);
    return STRL_OK;
}

void strl_partition_deinit(strl_partition *partition)
{
    strl__free(partition->cluster);
    strl__free(partition->cell);
    strl__free(partition->cluster_first);
    *partition = (strl_partition){0};
}
