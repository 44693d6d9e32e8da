/* A small tree of boxes over facets: which are near? Only strl_near_create allocates. */
#ifndef STRL_GEOMETRY_NEAR_H
#define STRL_GEOMETRY_NEAR_H

#include "base/memory.h"
#include "geometry/cover.h"

#define STRL_NEAR_LEAF 4u

typedef struct strl_near_node {
    double least[3], most[3];
    uint32_t parent;       /* 0 at the root */
    uint32_t first, count; /* of a leaf, into order; count 0 = inner: the children are first and first + 1 */
} strl_near_node;

typedef struct strl_near {
    const strl_facet *facet;
    uint32_t *order;       /* [facets] */
    uint32_t *leaf;        /* [facets] the node that has it */
    strl_near_node *nodes; /* [strl_near_nodes(facets)] */
} strl_near;

static inline uint32_t strl_near_nodes(uint32_t facets)
{
    return facets < 1 ? 1 : 2 * facets - 1;
}

/* Builds the tree over `count` (at least 1) facets; the arrays are the caller's. */
void strl_near_build(strl_near *tree, uint32_t count);
/* The same with arrays of the arena. The facets are borrowed. False without memory. */
bool strl_near_create(strl_near *tree, const strl_facet *facet, uint32_t count, strl_arena *arena);
/* The facet has moved: boxes grow to hold it. */
void strl_near_update(strl_near *tree, uint32_t facet);
/* The facet nearest to p, and its distance, claims left out. guess: a facet that is likely near. */
uint32_t strl_near_find(const strl_near *tree, const double p[3], uint32_t guess, double *distance);
/* Facets whose boxes meet the box of `facet`, widened by `reach`: the first `most` of them. Returns how many there are
 * in found. */
uint32_t strl_near_list(const strl_near *tree, const strl_facet *facet, double reach, uint32_t *found, uint32_t most);

#endif
