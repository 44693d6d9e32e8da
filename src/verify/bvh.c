#include "verify/bvh.h"

#include <math.h>

static float key(const float (*boxes)[6], uint32_t item, unsigned axis)
{
    return boxes[item][axis] + boxes[item][3 + axis];
}

unsigned strl__v_bvh_axis(const float (*boxes)[6], const uint32_t *order, uint32_t count)
{
    float low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (uint32_t i = 0; i < count; i++)
        for (unsigned k = 0; k < 3; k++) {
            float value = key(boxes, order[i], k);
            low[k] = value < low[k] ? value : low[k];
            high[k] = value > high[k] ? value : high[k];
        }
    unsigned axis = high[1] - low[1] > high[0] - low[0] ? 1 : 0;
    return high[2] - low[2] > high[axis] - low[axis] ? 2 : axis;
}

static void swap_items(uint32_t *a, uint32_t *b)
{
    uint32_t other = *a;
    *a = *b;
    *b = other;
}

static float median_of_three(float a, float b, float c)
{
    return a < b ? (b < c ? b : a < c ? c : a) : (a < c ? a : b < c ? c : b);
}

/* Quickselect (Hoare); equal keys are divided, so that many equal centres cost no more. */
void strl__v_bvh_select(const float (*boxes)[6], uint32_t *order, uint32_t count, uint32_t middle, unsigned axis)
{
    int64_t low = 0, high = (int64_t)count - 1;
    while (low < high) {
        float pivot = median_of_three(key(boxes, order[low], axis), key(boxes, order[(low + high) / 2], axis),
                                      key(boxes, order[high], axis));
        int64_t i = low, j = high;
        while (i <= j) {
            while (key(boxes, order[i], axis) < pivot)
                i++;
            while (key(boxes, order[j], axis) > pivot)
                j--;
            if (i <= j)
                swap_items(&order[i++], &order[j--]);
        }
        if ((int64_t)middle <= j)
            high = j;
        else if ((int64_t)middle >= i)
            low = i;
        else
            return;
    }
}

typedef struct builder {
    const float (*boxes)[6];
    uint32_t *order;
    strl__bvh_node *nodes;
    uint32_t node_count;
} builder;

static void enclose(const builder *self, uint32_t first, uint32_t count, strl__bvh_node *node)
{
    for (unsigned k = 0; k < 3; k++) {
        node->min[k] = INFINITY;
        node->max[k] = -INFINITY;
    }
    for (uint32_t i = first; i < first + count; i++)
        for (unsigned k = 0; k < 3; k++) {
            const float *box = self->boxes[self->order[i]];
            node->min[k] = box[k] < node->min[k] ? box[k] : node->min[k];
            node->max[k] = box[3 + k] > node->max[k] ? box[3 + k] : node->max[k];
        }
}

/* Depth is the logarithm of count: each half is half. */
static void split(builder *self, uint32_t at, uint32_t first, uint32_t count)
{
    strl__bvh_node *node = &self->nodes[at];
    enclose(self, first, count, node);
    if (count <= STRL__BVH_LEAF) {
        node->first = first;
        node->count = count;
        return;
    }
    uint32_t half = count / 2, children = self->node_count;
    strl__v_bvh_select(self->boxes, self->order + first, count, half,
                       strl__v_bvh_axis(self->boxes, self->order + first, count));
    self->node_count += 2;
    node->first = children;
    node->count = 0;
    split(self, children, first, half);
    split(self, children + 1, first + half, count - half);
}

uint32_t strl__v_bvh_build(const float (*boxes)[6], uint32_t count, uint32_t *order, strl__bvh_node *nodes)
{
    builder self = {boxes, order, nodes, 1};
    for (uint32_t i = 0; i < count; i++)
        order[i] = i;
    split(&self, 0, 0, count);
    return self.node_count;
}
