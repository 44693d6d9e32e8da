/* A binary tree of boxes: items split at the median of their centres along the longest axis. */
#ifndef STRL_VERIFY_BVH_H
#define STRL_VERIFY_BVH_H

#include <stdint.h>

typedef struct strl__bvh_node {
    float min[3];
    uint32_t first; /* leaf: place of its first item; else index of its first child, the other one follows */
    float max[3];
    uint32_t count; /* leaf: its items; else 0 */
} strl__bvh_node;

#define STRL__BVH_LEAF 4u
#define STRL__BVH_STACK 64u
/* Nodes that a tree of so many items never exceeds. */
static inline uint64_t strl__bvh_nodes(uint64_t items)
{
    return items < STRL__BVH_LEAF ? 1 : items; /* leaves of a median split hold at least half of STRL__BVH_LEAF */
}

/* boxes: [count] min xyz, max xyz; order: [count] receives the items in the order of the leaves. count >= 1.
 * Returns the number of nodes; the root is nodes[0]. */
uint32_t strl__v_bvh_build(const float (*boxes)[6], uint32_t count, uint32_t *order, strl__bvh_node *nodes);

/* Rearranges order[0, count) so that no item before `middle` has a larger key on the axis than one from there
 * on; the key of an item is the sum of its box's sides there. */
void strl__v_bvh_select(const float (*boxes)[6], uint32_t *order, uint32_t count, uint32_t middle, unsigned axis);
/* The axis along which the centres of order[0, count) spread the most. */
unsigned strl__v_bvh_axis(const float (*boxes)[6], const uint32_t *order, uint32_t count);

static inline double strl__bvh_distance2(const strl__bvh_node *node, const double p[3])
{
    double sum = 0;
    for (unsigned k = 0; k < 3; k++) {
        double low = (double)node->min[k] - p[k], high = p[k] - (double)node->max[k];
        double outside = low > high ? low : high;
        outside = outside > 0 ? outside : 0;
        sum += outside * outside;
    }
    return sum;
}

#endif
