#include "geometry/near.h"

#include <math.h>

#define STACK_MAX 72u

static double key(const strl_near *tree, uint32_t facet, unsigned axis)
{
    return tree->facet[facet].least[axis] + tree->facet[facet].most[axis];
}

/* Quickselect (Hoare): what belongs before `middle` comes before it. */
static void divide(const strl_near *tree, uint32_t *order, uint32_t count, uint32_t middle, unsigned axis)
{
    int64_t low = 0, high = (int64_t)count - 1;
    while (low < high) {
        double pivot = key(tree, order[low + (high - low) / 2], axis);
        int64_t i = low, j = high;
        while (i <= j) {
            while (key(tree, order[i], axis) < pivot)
                i++;
            while (key(tree, order[j], axis) > pivot)
                j--;
            if (i <= j) {
                uint32_t other = order[i];
                order[i++] = order[j];
                order[j--] = other;
            }
        }
        if ((int64_t)middle <= j)
            high = j;
        else if ((int64_t)middle >= i)
            low = i;
        else
            return;
    }
}

static unsigned longest_axis(const double least[3], const double most[3])
{
    unsigned axis = most[1] - least[1] > most[0] - least[0] ? 1 : 0;
    return most[2] - least[2] > most[axis] - least[axis] ? 2 : axis;
}

static void enclose(const strl_near *tree, const uint32_t *order, uint32_t count, strl_near_node *node)
{
    for (unsigned k = 0; k < 3; k++) {
        node->least[k] = INFINITY;
        node->most[k] = -INFINITY;
        for (uint32_t i = 0; i < count; i++) {
            const strl_facet *f = &tree->facet[order[i]];
            node->least[k] = f->least[k] < node->least[k] ? f->least[k] : node->least[k];
            node->most[k] = f->most[k] > node->most[k] ? f->most[k] : node->most[k];
        }
    }
}

/* Halves are halves, so the depth is the logarithm of the count. */
static void split(strl_near *tree, uint32_t at, uint32_t first, uint32_t count, uint32_t *used)
{
    strl_near_node *node = &tree->nodes[at];
    enclose(tree, tree->order + first, count, node);
    if (count <= STRL_NEAR_LEAF) {
        node->first = first;
        node->count = count;
        for (uint32_t i = first; i < first + count; i++)
            tree->leaf[tree->order[i]] = at;
        return;
    }
    uint32_t half = count / 2, children = *used;
    divide(tree, tree->order + first, count, half, longest_axis(node->least, node->most));
    *used += 2;
    node->first = children;
    node->count = 0;
    tree->nodes[children].parent = tree->nodes[children + 1].parent = at;
    split(tree, children, first, half, used);
    split(tree, children + 1, first + half, count - half, used);
}

void strl_near_build(strl_near *tree, uint32_t count)
{
    uint32_t used = 1;
    for (uint32_t i = 0; i < count; i++)
        tree->order[i] = i;
    tree->nodes[0].parent = 0;
    split(tree, 0, 0, count, &used);
}

bool strl_near_create(strl_near *tree, const strl_facet *facet, uint32_t count, strl_arena *arena)
{
    tree->facet = facet;
    tree->order = strl_arena_alloc(arena, count, sizeof *tree->order);
    tree->leaf = strl_arena_alloc(arena, count, sizeof *tree->leaf);
    tree->nodes = strl_arena_alloc(arena, strl_near_nodes(count), sizeof *tree->nodes);
    if (!tree->order || !tree->leaf || !tree->nodes)
        return false;
    strl_near_build(tree, count);
    return true;
}

void strl_near_update(strl_near *tree, uint32_t facet)
{
    const strl_facet *f = &tree->facet[facet];
    for (uint32_t at = tree->leaf[facet];; at = tree->nodes[at].parent) {
        strl_near_node *node = &tree->nodes[at];
        bool grows = false;
        for (unsigned k = 0; k < 3; k++) {
            grows |= f->least[k] < node->least[k] || f->most[k] > node->most[k];
            node->least[k] = f->least[k] < node->least[k] ? f->least[k] : node->least[k];
            node->most[k] = f->most[k] > node->most[k] ? f->most[k] : node->most[k];
        }
        if (!grows || at == 0)
            return;
    }
}

static double box_distance2(const strl_near_node *node, const double p[3])
{
    double sum = 0;
    for (unsigned k = 0; k < 3; k++) {
        double below = node->least[k] - p[k], above = p[k] - node->most[k], outside = below > above ? below : above;
        sum += outside > 0 ? outside * outside : 0;
    }
    return sum;
}

uint32_t strl_near_find(const strl_near *tree, const double p[3], uint32_t guess, double *distance)
{
    uint32_t stack[STACK_MAX], top = 0, found = guess;
    double best = strl_facet_distance2(&tree->facet[guess], p);
    stack[top++] = 0;
    while (top) {
        const strl_near_node *node = &tree->nodes[stack[--top]];
        if (box_distance2(node, p) >= best)
            continue;
        for (uint32_t i = node->first; i < node->first + node->count; i++) {
            double squared = strl_facet_distance2(&tree->facet[tree->order[i]], p);
            if (squared < best) {
                best = squared;
                found = tree->order[i];
            }
        }
        if (node->count)
            continue;
        uint32_t near =
            box_distance2(&tree->nodes[node->first], p) <= box_distance2(&tree->nodes[node->first + 1], p) ? 0 : 1;
        stack[top++] = node->first + 1 - near;
        stack[top++] = node->first + near;
    }
    *distance = sqrt(best);
    return found;
}

static bool meets(const double least[3], const double most[3], const strl_facet *facet, double reach)
{
    for (unsigned k = 0; k < 3; k++)
        if (least[k] > facet->most[k] + reach || most[k] < facet->least[k] - reach)
            return false;
    return true;
}

uint32_t strl_near_list(const strl_near *tree, const strl_facet *facet, double reach, uint32_t *found, uint32_t most)
{
    uint32_t stack[STACK_MAX], top = 0, count = 0;
    stack[top++] = 0;
    while (top && count < most) {
        const strl_near_node *node = &tree->nodes[stack[--top]];
        if (!meets(node->least, node->most, facet, reach))
            continue;
        for (uint32_t i = node->first; i < node->first + node->count && count < most; i++) {
            const strl_facet *other = &tree->facet[tree->order[i]];
            if (meets(other->least, other->most, facet, reach))
                found[count++] = tree->order[i];
        }
        if (node->count)
            continue;
        stack[top++] = node->first + 1;
        stack[top++] = node->first;
    }
    return count;
}
