/* Cuts through a tree. A uniform cut splits the groups whose geometric error is above a length. A view-
 * dependent one splits those whose error, seen from an eye, is above an angle (or only those that some node asks
 * for), all of whose members are active and have children, and that do not refuse to split (as a group does whose
 * children have not arrived). */
#ifndef STRL_VERIFY_CUTS_H
#define STRL_VERIFY_CUTS_H

#include "verify/mesh.h"

/* One random view. Lattice units. */
typedef struct strl__vview {
    double eye[3];
    double angle;    /* allowed error over distance */
    double refusing; /* share of groups that refuse to split */
    /* only what a node too coarse asks for splits, and what is above it; else all that bounds allow */
    bool by_demand;
    bool any_state; /* nodes take any state that is fine enough, not the coarsest */
    uint64_t seed;
} strl__vview;

void strl__v_view_random(const strl__vtree *tree, uint64_t seed, uint32_t number, strl__vview *view);

/* Error over distance, for the nearest point of the box; infinite within the error. */
double strl__v_view_angle(const strl__vview *view, const int64_t box[2][3], double error);
/* The state that an active node takes in a view. */
uint32_t strl__v_view_state(const strl__vview *view, const strl__vnode *node, uint32_t id, const strl__vmesh *mesh);

/* Sets bit id of active ([(node_count + 63) / 64] words) for every node of the cut. groups: scratch,
 * [group_count]. */
void strl__v_cut_view(const strl__vtree *tree, const strl__vview *view, uint32_t *groups, uint64_t *active);
/* length: lattice units. */
void strl__v_cut_uniform(const strl__vtree *tree, double length, uint64_t *active);
/* All nodes of a level, and the leaves above it. */
void strl__v_cut_level(const strl__vtree *tree, uint32_t level, uint64_t *active);

static inline bool strl__bit(const uint64_t *bits, uint32_t index)
{
    return bits[index / 64] >> (index % 64) & 1;
}

static inline void strl__bit_set(uint64_t *bits, uint32_t index)
{
    bits[index / 64] |= (uint64_t)1 << (index % 64);
}

static inline size_t strl__bit_words(const strl__vtree *tree)
{
    return ((size_t)tree->node_count + 63) / 64;
}

/* A number in [0, 1) from a seed and two indices. */
static inline double strl__random(uint64_t seed, uint64_t a, uint64_t b)
{
    uint64_t bits =
        strl__mix64(strl__mix64(seed + a * 0x9e3779b97f4a7c15u) ^ (b * 0xd1b54a32d192ed03u + 0x8cb92ba72f3d8dd7u));
    return (double)(bits >> 11) * 0x1p-53;
}

#endif
