#include "verify/cuts.h"

#include <math.h>
#include <string.h>

/* Angles between 1e-3 (two thirds of a pixel at 60 degrees and 720 lines) and 0.3. */
#define LEAST_ANGLE 1e-3
#define ANGLE_RANGE 300.0

/* Half of the eyes hover over a random leaf, the others are anywhere in and around the model. */
void strl__v_view_random(const strl__vtree *tree, uint64_t seed, uint32_t number, strl__vview *view)
{
    *view = (strl__vview){.seed = strl__mix64(seed + 0x51ed270b0a1f39c1u * (number + 1))};
    bool near = number % 2;
    uint32_t id = (uint32_t)(strl__random(view->seed, 1, 0) * tree->node_count);
    while (near && tree->nodes[id].child_count)
        id = tree->nodes[id].first_child + (uint32_t)(strl__random(view->seed, 2, id) * tree->nodes[id].child_count);
    const int64_t(*box)[3] = near ? tree->nodes[id].box : tree->box;
    for (unsigned k = 0; k < 3; k++) {
        double low = (double)box[0][k], high = (double)box[1][k], reach = near ? 4 : 1.6;
        view->eye[k] = (low + high) / 2 + (strl__random(view->seed, 3, k) - 0.5) * reach * (high - low + 1);
    }
    view->angle = LEAST_ANGLE * pow(ANGLE_RANGE, strl__random(view->seed, 4, 0));
    view->refusing = number % 4 < 2 ? 0 : 0.4 * strl__random(view->seed, 5, 0);
    view->any_state = number % 8 >= 5;
    view->by_demand = number % 3 != 0;
}

double strl__v_view_angle(const strl__vview *view, const int64_t box[2][3], double error)
{
    double distance2 = 0;
    for (unsigned k = 0; k < 3; k++) {
        double outside = fmax(0, fmax((double)box[0][k] - view->eye[k], view->eye[k] - (double)box[1][k]));
        distance2 += outside * outside;
    }
    double distance = sqrt(distance2);
    return error <= 0 ? 0 : distance <= error ? INFINITY : error / (distance - error);
}

uint32_t strl__v_view_state(const strl__vview *view, const strl__vnode *node, uint32_t id, const strl__vmesh *mesh)
{
    uint32_t low = 0, high = mesh->step_count;
    while (low < high) {
        uint32_t middle = low + (high - low) / 2;
        double error = fmaxf(mesh->geometric_error[middle], mesh->appearance_error[middle]);
        if (strl__v_view_angle(view, node->box, error) <= view->angle)
            high = middle;
        else
            low = middle + 1;
    }
    if (!view->any_state)
        return low;
    return low + (uint32_t)(strl__random(view->seed, 6, id) * (mesh->step_count - low + 1));
}

/* What is known of a group while its level is visited. */
#define MEMBERS 0x3fffffffu
#define ASKED 0x40000000u
#define SPLITS 0x80000000u

/* The end of the level that begins with node `first`. */
static uint32_t level_end(const strl__vtree *tree, uint32_t first)
{
    uint32_t end = first;
    while (end < tree->node_count && tree->nodes[end].level == tree->nodes[first].level)
        end++;
    return end;
}

static bool node_asks(const strl__vview *view, const strl__vnode *n)
{
    return n->child_count && strl__v_view_angle(view, n->box, fmaxf(n->geometric_min, n->appearance_min)) > view->angle;
}

/* Marks the groups of nodes that are too coarse, and those of all their members' ancestors, from the leaves up. */
static void mark_asked(const strl__vtree *tree, const strl__vview *view, uint32_t *groups)
{
    for (uint32_t end = tree->node_count, first; end > 0; end = first) {
        for (first = end; first > 0 && tree->nodes[first - 1].level == tree->nodes[end - 1].level; first--)
            if (node_asks(view, &tree->nodes[first - 1]))
                groups[tree->nodes[first - 1].group] |= ASKED;
        for (uint32_t id = first > 0 ? first : 1; id < end; id++)
            if (groups[tree->nodes[id].group] & ASKED)
                groups[tree->nodes[tree->nodes[id].parent].group] |= ASKED;
    }
}

static bool wants_split(const strl__vtree *tree, const strl__vview *view, uint32_t group, bool asked)
{
    const strl__vnode *n = &tree->nodes[tree->group_first[group]];
    double error = fmaxf(n->group_geometric, n->group_appearance);
    bool wants = view->by_demand ? asked : strl__v_view_angle(view, n->group_box, error) > view->angle;
    return wants && strl__random(view->seed, 7, group) >= view->refusing;
}

void strl__v_cut_view(const strl__vtree *tree, const strl__vview *view, uint32_t *groups, uint64_t *active)
{
    memset(groups, 0, (size_t)tree->group_count * sizeof *groups);
    memset(active, 0, strl__bit_words(tree) * sizeof *active);
    if (view->by_demand)
        mark_asked(tree, view, groups);
    /* Levels fall with the id: all members of a group are met before the first child of any. */
    for (uint32_t first = 0, end; first < tree->node_count; first = end) {
        end = level_end(tree, first);
        for (uint32_t id = first; id < end; id++) {
            const strl__vnode *n = &tree->nodes[id];
            bool here = id == 0 || groups[tree->nodes[n->parent].group] & SPLITS;
            if (here)
                strl__bit_set(active, id);
            groups[n->group] += here && n->child_count > 0;
        }
        for (uint32_t id = first; id < end; id++) {
            const strl__vnode *n = &tree->nodes[id];
            if (strl__bit(active, id) && (groups[n->group] & MEMBERS) == n->group_size &&
                wants_split(tree, view, n->group, groups[n->group] & ASKED))
                groups[n->group] |= SPLITS;
        }
    }
    for (uint32_t id = 0; id < tree->node_count; id++)
        if (groups[tree->nodes[id].group] & SPLITS)
            active[id / 64] &= ~((uint64_t)1 << (id % 64));
}

void strl__v_cut_uniform(const strl__vtree *tree, double length, uint64_t *active)
{
    memset(active, 0, strl__bit_words(tree) * sizeof *active);
    /* First the nodes whose ancestors all split, then of them those that do not. */
    for (uint32_t id = 0; id < tree->node_count; id++) {
        const strl__vnode *n = &tree->nodes[id];
        if (id == 0 || (strl__bit(active, n->parent) && tree->nodes[n->parent].group_geometric > length))
            strl__bit_set(active, id);
    }
    for (uint32_t id = 0; id < tree->node_count; id++) {
        const strl__vnode *n = &tree->nodes[id];
        if (n->child_count && n->group_geometric > length)
            active[id / 64] &= ~((uint64_t)1 << (id % 64));
    }
}

void strl__v_cut_level(const strl__vtree *tree, uint32_t level, uint64_t *active)
{
    memset(active, 0, strl__bit_words(tree) * sizeof *active);
    for (uint32_t id = 0; id < tree->node_count; id++)
        if (tree->nodes[id].level == level || (tree->nodes[id].level > level && tree->nodes[id].child_count == 0))
            strl__bit_set(active, id);
}
