/* Drawing samples (Klein et al. 2005, 4.1 and 5.2). */
#include <math.h>
#include <stdlib.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"
#include "build/samples/octree.h"

/* Cells in which much more lies than can be seen would need samples as large as themselves. */
#define MOST_DRAWS 8192u

typedef struct random_state {
    uint64_t state;
} random_state;

static double random_unit(random_state *random)
{
    random->state += 0x9e3779b97f4a7c15u;
    return (double)(strl__mix64(random->state) >> 11) * 0x1p-53;
}

uint32_t strl_octree_draws(const strl_octree *octree, uint32_t depth, double area)
{
    double side = strl_octree_side(octree->ingest, depth), groups = ceil(area / (side * side));
    if (!(groups >= 1))
        return 0;
    double draws = ceil(groups * log(groups) + octree->coupons * groups); /* below 1 where the probability is */
    uint32_t most = octree->most_draws ? octree->most_draws : MOST_DRAWS;
    return draws < 1 ? 1 : draws < most ? (uint32_t)draws : most;
}

/* Running sums over the items of all children, so that those of a child sum up to its area. */
static strl_status sum_weights(strl_octree *octree, const strl_octant *octant, uint32_t *count, double *total,
                               strl_error *err)
{
    *count = 0;
    *total = 0;
    for (uint32_t i = 0; i < octant->child_count; i++)
        *count += octree->octant[octant->child[i]].item_count;
    if (!strl__grow(&octree->sums, &octree->sums_capacity, *count, sizeof *octree->sums))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to draw from %u triangles", *count);
    uint32_t at = 0;
    for (uint32_t i = 0; i < octant->child_count; i++) {
        const strl_octant *child = &octree->octant[octant->child[i]];
        const strl_sample_item *item = &octree->item[child->first_item];
        double sum = 0;
        for (uint32_t k = 0; k < child->item_count; k++)
            sum += (double)item[k].weight;
        double scale = sum > 0 ? child->sums.area / sum : 0;
        for (uint32_t k = 0; k < child->item_count; k++)
            octree->sums[at++] = *total += scale * (double)item[k].weight;
    }
    return STRL_OK;
}

/* The item number `at` of all children. */
static uint32_t triangle_at(const strl_octree *octree, const strl_octant *octant, uint32_t at)
{
    uint32_t i = 0;
    while (at >= octree->octant[octant->child[i]].item_count)
        at -= octree->octant[octant->child[i++]].item_count;
    return octree->item[octree->octant[octant->child[i]].first_item + at].triangle;
}

static uint32_t find_sum(const double *sums, uint32_t count, double wanted)
{
    uint32_t low = 0, high = count - 1;
    while (low < high) {
        uint32_t middle = low + (high - low) / 2;
        if (sums[middle] > wanted)
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

/* Where each draw fell, ascending, becomes an item: items then lie in the order of their triangles. */
static int compare_numbers(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return x < y ? -1 : x > y;
}

static strl_status take_drawn(strl_octree *octree, uint32_t index, const uint32_t *drawn, uint32_t count,
                              strl_error *err)
{
    strl_octant *octant = &octree->octant[index];
    strl_status status = STRL_OK;
    octant->first_item = (uint32_t)octree->item_count;
    for (uint32_t i = 0; i < count && !status; i++) {
        uint32_t triangle = drawn[i];
        status = strl_octree_add_item(octree, triangle, (float)octree->hits[triangle], err);
        octree->hits[triangle] = 0;
        octree->owner[triangle] = index;
    }
    octant->item_count = count;
    return status;
}

strl_status strl_octree_sample(strl_octree *octree, uint32_t index, strl_error *err)
{
    strl_octant *octant = &octree->octant[index];
    strl_octree_sum_children(octree, octant);
    random_state random = {strl__mix64(octant->prefix ^ (uint64_t)(octant->depth + 1) << 58)};
    uint32_t draws = strl_octree_draws(octree, octant->depth, octant->sums.area), items, different = 0;
    double total;
    strl_status status = sum_weights(octree, octant, &items, &total, err);
    if (status)
        return status;
    uint32_t *drawn = strl__alloc(draws ? draws : 1, sizeof *drawn);
    if (!drawn)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %u draws", draws);
    for (uint32_t i = 0; i < draws && total > 0; i++) {
        uint32_t triangle = triangle_at(octree, octant, find_sum(octree->sums, items, random_unit(&random) * total));
        if (octree->hits[triangle]++ == 0)
            drawn[different++] = triangle;
    }
    qsort(drawn, different, sizeof *drawn, compare_numbers);
    status = take_drawn(octree, index, drawn, different, err);
    strl__free(drawn);
    return status;
}
