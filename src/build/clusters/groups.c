#include <stdlib.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "build/clusters/hierarchy.h"

#define LEAST_SHARED 5u   /* the paper's j */
#define MERGED_SOON 1u    /* condition 1: not merged within so many levels anyway */
#define SIMILAR_ERROR 4.f /* condition 2: error ranges of the members differ by no more than this factor */

bool strl_adjacency_add(strl_adjacency *adjacency, uint32_t a, uint32_t b, uint32_t count)
{
    if (2 * (adjacency->used + 1) > adjacency->size) {
        strl_adjacency bigger = {.size = adjacency->size ? 2 * adjacency->size : 256};
        bigger.key = strl__alloc_zero(bigger.size, sizeof *bigger.key);
        bigger.count = strl__alloc(bigger.size, sizeof *bigger.count);
        bool good = bigger.key && bigger.count;
        for (size_t i = 0; i < adjacency->size && good; i++)
            if (adjacency->key[i])
                good = strl_adjacency_add(&bigger, (uint32_t)((adjacency->key[i] - 1) >> 32),
                                          (uint32_t)(adjacency->key[i] - 1), adjacency->count[i]);
        if (!good) {
            strl_adjacency_deinit(&bigger);
            return false;
        }
        strl_adjacency_deinit(adjacency);
        *adjacency = bigger;
    }
    uint64_t key = ((uint64_t)(a < b ? a : b) << 32 | (a < b ? b : a)) + 1;
    size_t at = strl__mix64(key) & (adjacency->size - 1);
    while (adjacency->key[at] && adjacency->key[at] != key)
        at = (at + 1) & (adjacency->size - 1);
    if (!adjacency->key[at]) {
        adjacency->key[at] = key;
        adjacency->count[at] = 0;
        adjacency->used++;
    }
    adjacency->count[at] += count;
    return true;
}

void strl_adjacency_deinit(strl_adjacency *adjacency)
{
    strl__free(adjacency->key);
    strl__free(adjacency->count);
    *adjacency = (strl_adjacency){0};
}

typedef struct neighbour {
    uint32_t node, shared;
} neighbour;

typedef struct chooser {
    const strl_level *children;
    uint32_t node_count, levels_above;
    uint32_t *first;       /* [node_count + 2] */
    neighbour *neighbours; /* most shared first, then by index */
    float *priority;
    uint32_t *group; /* per node; UINT32_MAX = none yet */
} chooser;

static int compare_neighbours(const void *a, const void *b)
{
    const neighbour *x = a, *y = b;
    if (x->shared != y->shared)
        return x->shared > y->shared ? -1 : 1;
    return x->node < y->node ? -1 : x->node > y->node;
}

static bool list_neighbours(chooser *c, const strl_adjacency *adjacency)
{
    c->first = strl__alloc_zero((size_t)c->node_count + 2, sizeof *c->first);
    c->neighbours = strl__alloc(2 * adjacency->used, sizeof *c->neighbours);
    if (!c->first || !c->neighbours)
        return false;
    for (int pass = 0; pass < 2; pass++) {
        for (size_t i = 0; i < adjacency->size; i++) {
            if (!adjacency->key[i])
                continue;
            uint32_t low = (uint32_t)((adjacency->key[i] - 1) >> 32), high = (uint32_t)(adjacency->key[i] - 1);
            if (pass == 0) {
                c->first[low + 2]++;
                c->first[high + 2]++;
            } else { /* every point is counted by both holders */
                c->neighbours[c->first[low + 1]++] = (neighbour){high, adjacency->count[i] / 2};
                c->neighbours[c->first[high + 1]++] = (neighbour){low, adjacency->count[i] / 2};
            }
        }
        for (uint32_t n = 0; n < c->node_count && pass == 0; n++)
            c->first[n + 2] += c->first[n + 1];
    }
    for (uint32_t n = 0; n < c->node_count; n++)
        qsort(c->neighbours + c->first[n], c->first[n + 1] - c->first[n], sizeof *c->neighbours, compare_neighbours);
    return true;
}

static uint32_t shared_between(const chooser *c, uint32_t a, uint32_t b)
{
    for (uint32_t i = c->first[a]; i < c->first[a + 1]; i++)
        if (c->neighbours[i].node == b)
            return c->neighbours[i].shared;
    return 0;
}

static float error_of(const chooser *c, uint32_t node)
{
    const strl_node *left = &c->children->nodes[2 * node].record, *right = &c->children->nodes[2 * node + 1].record;
    return left->geometric_max > right->geometric_max ? left->geometric_max : right->geometric_max;
}

/* Condition 1 is asked of the first partner alone: later ones may well be a member's sibling. Condition 3, no chains: a
 * node joins only where it shares vertices with at least half of the members. */
static bool may_join(const chooser *c, const uint32_t *members, uint32_t count, uint32_t node)
{
    uint32_t touching = 0, soon = c->levels_above < MERGED_SOON ? c->levels_above : MERGED_SOON;
    if (count == 1 && members[0] >> soon == node >> soon)
        return false;
    for (uint32_t i = 0; i < count; i++) {
        float a = error_of(c, members[i]), b = error_of(c, node);
        if (a > SIMILAR_ERROR * b || b > SIMILAR_ERROR * a)
            return false;
        touching += shared_between(c, members[i], node) >= LEAST_SHARED;
    }
    return 2 * touching >= count;
}

/* The node itself, then those that share most with it. */
static uint32_t gather(const chooser *c, uint32_t node, uint32_t members[STRL_GROUP_MAX])
{
    uint32_t count = 1;
    members[0] = node;
    for (uint32_t i = c->first[node]; i < c->first[node + 1] && count < STRL_GROUP_MAX; i++) {
        uint32_t other = c->neighbours[i].node;
        if (c->group[other] == UINT32_MAX && may_join(c, members, count, other))
            members[count++] = other;
    }
    return count;
}

typedef struct ranked {
    float priority;
    uint32_t node;
} ranked;

static int compare_ranked(const void *a, const void *b)
{
    const ranked *x = a, *y = b;
    if (x->priority != y->priority)
        return x->priority > y->priority ? -1 : 1;
    return x->node < y->node ? -1 : x->node > y->node;
}

/* The denser a node's border is against its inside, the sooner it chooses. */
static float priority_of(const chooser *c, uint32_t node)
{
    const strl_node_state *left = &c->children->nodes[2 * node], *right = left + 1;
    float points = (float)left->point_count + (float)right->point_count;
    return ((float)left->outer_shared + (float)right->outer_shared) / (points + 1);
}

static strl_status number_groups(const chooser *c, strl_groups *groups, strl_error *err)
{
    uint32_t *number = strl__alloc(c->node_count, sizeof *number);
    groups->first = strl__alloc_zero((size_t)c->node_count + 2, sizeof *groups->first);
    groups->member = strl__alloc(c->node_count, sizeof *groups->member);
    if (!number || !groups->first || !groups->member) {
        strl__free(number);
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the groups of %u nodes", c->node_count);
    }
    memset(number, 0xff, c->node_count * sizeof *number);
    for (uint32_t n = 0; n < c->node_count; n++) {
        if (number[c->group[n]] == UINT32_MAX)
            number[c->group[n]] = groups->count++;
        groups->first[number[c->group[n]] + 2]++;
    }
    for (uint32_t g = 0; g < groups->count; g++)
        groups->first[g + 2] += groups->first[g + 1];
    for (uint32_t n = 0; n < c->node_count; n++)
        groups->member[groups->first[number[c->group[n]] + 1]++] = n;
    strl__free(number);
    return STRL_OK;
}

strl_status strl_groups_choose(const strl_level *children, const strl_adjacency *adjacency, uint32_t node_count,
                               uint32_t levels_above, bool single, strl_groups *groups, strl_error *err)
{
    chooser c = {.children = children, .node_count = node_count, .levels_above = levels_above};
    ranked *order = strl__alloc(node_count, sizeof *order);
    *groups = (strl_groups){0};
    c.group = strl__alloc(node_count, sizeof *c.group);
    strl_status status = STRL_OK;
    if (!order || !c.group || !list_neighbours(&c, adjacency)) {
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for the groups of %u nodes", node_count);
        goto done;
    }
    for (uint32_t n = 0; n < node_count; n++) {
        c.group[n] = UINT32_MAX;
        order[n] = (ranked){priority_of(&c, n), n};
    }
    qsort(order, node_count, sizeof *order, compare_ranked);
    for (uint32_t i = 0; i < node_count; i++) {
        uint32_t members[STRL_GROUP_MAX], node = order[i].node;
        if (c.group[node] != UINT32_MAX)
            continue;
        members[0] = node;
        uint32_t count = single ? 1 : gather(&c, node, members);
        for (uint32_t k = 0; k < count; k++)
            c.group[members[k]] = node;
    }
    status = number_groups(&c, groups, err);
done:
    strl__free(order);
    strl__free(c.group);
    strl__free(c.first);
    strl__free(c.neighbours);
    return status;
}

void strl_groups_deinit(strl_groups *groups)
{
    strl__free(groups->first);
    strl__free(groups->member);
    *groups = (strl_groups){0};
}
