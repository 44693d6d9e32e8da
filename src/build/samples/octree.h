/* The octree of one piece of a model while its sample tree is made (docs/algorithms/samples.md): the triangles of a
 * range of the space-filling curve, or, at the top, what the pieces below have handed up.
 *
 *   sorted triangles -> strl_octree_build -> cells -> strl_octree_sample, bottom-up -> each triangle stored in one cell
 *
 * Cells are named by their Morton code, three bits a level from the root cell (depth 0) down to STRL_OCTREE_DEPTH. A
 * cell whose triangles all lie in one of its children is left out: the child takes its place. */
#ifndef STRL_BUILD_SAMPLES_OCTREE_H
#define STRL_BUILD_SAMPLES_OCTREE_H

#include <stdbool.h>
#include <stdint.h>

#include "build/ingest/ingest.h"

#define STRL_OCTREE_DEPTH 21u
/* Eight cells, and what is too large for them. */
#define STRL_OCTANT_MAX_CHILDREN 9u

/* Sums over all triangles of a cell, weighted by area, lattice units: what its splat is made of. */
typedef struct strl_splat_sums {
    double area;
    double linear[4]; /* red, green, blue in linear light; alpha */
    double normal[3]; /* area vectors, all turned to one side of the first */
    double centre[3];
} strl_splat_sums;

/* A triangle of a cell and what it counts when the cell above draws: how often it was drawn itself, or, at leaves, its
 * area. */
typedef struct strl_sample_item {
    uint32_t triangle;
    float weight;
} strl_sample_item;

typedef struct strl_octant {
    uint64_t prefix; /* Morton code of the cell, 3 * depth bits */
    uint32_t depth;
    bool is_leaf;  /* its items are all there is of it */
    bool is_large; /* a leaf: the triangles that are too large for the cells beside it */
    /* lattice units: the longest of the triangles below that their cells do not hold; 0 = there is none */
    float extent;
    uint32_t first_item, item_count;
    uint32_t child_count, child[STRL_OCTANT_MAX_CHILDREN];
    uint32_t total; /* triangles in it */
    uint32_t chunk; /* the piece whose root it is, at the top; else STRL_NO_CHUNK */
    strl_splat_sums sums;
} strl_octant;

#define STRL_NO_CHUNK UINT32_MAX
#define STRL_NO_OCTANT UINT32_MAX

typedef struct strl_octree {
    const strl_ingest *ingest;
    uint32_t leaf_triangles; /* most of a leaf */
    double coupons;          /* c of the sample size */
    uint32_t most_draws;     /* of the cell that is sampled now; 0 = as many as draws of any cell */
    bool has_pieces;         /* the top of a tree: leaves may be roots of pieces */
    uint32_t triangle_count;
    strl_soup_triangle *triangle; /* [triangle_count], owned with all that follows */
    uint64_t *key;                /* [triangle_count] ascending */
    uint8_t *limit;               /* [triangle_count] depth of the smallest cell that holds it */
    uint32_t *owner;              /* [triangle_count] octant that stores it */
    uint32_t *hits;               /* [triangle_count] zero between two draws */
    double *sums;                 /* [sums_capacity] */
    size_t sums_capacity;
    strl_octant *octant;
    size_t octant_count, octant_capacity;
    strl_sample_item *item;
    size_t item_count, item_capacity;
} strl_octree;

/* Side of a cell, lattice units. */
double strl_octree_side(const strl_ingest *ingest, uint32_t depth);
/* The corner of a cell with the least coordinates, lattice units. */
void strl_octree_corner(const strl_ingest *ingest, uint64_t prefix, uint32_t depth, double corner[3]);
/* Depth of the smallest cell whose neighbourhood (a ball of one side round its centre) holds the triangle, the cell
 * being that of its centroid. The ball of half a diagonal, as of the paper, would let small triangles near corners of
 * cells rise to the root. */
uint8_t strl_octree_limit(const strl_ingest *ingest, const strl_soup_triangle *triangle, uint64_t key);
/* Longest edge, lattice units. */
float strl_octree_extent(const strl_soup_triangle *triangle);

/* The arrays for so many triangles. */
strl_status strl_octree_create(strl_octree *octree, const strl_ingest *ingest, uint32_t triangle_count,
                               strl_error *err);
void strl_octree_deinit(strl_octree *octree);

/* Cells over the triangles order[0 .. count), ascending by key, all of one cell of `depth`: limits below that count as
 * it. Each inner cell is sampled from its children. order is put into another. *root: the octant, STRL_NO_OCTANT where
 * there is no triangle. */
strl_status strl_octree_build(strl_octree *octree, uint32_t *order, uint32_t count, uint32_t depth, uint32_t *root,
                              strl_error *err);
/* A leaf of these triangles: prefix, depth and is_large of *leaf are taken. */
strl_status strl_octree_add_leaf(strl_octree *octree, const uint32_t *order, uint32_t count, strl_octant *leaf,
                                 uint32_t *index, strl_error *err);

/* A new octant without children. */
strl_status strl_octree_add(strl_octree *octree, const strl_octant *octant, uint32_t *index, strl_error *err);
strl_status strl_octree_add_item(strl_octree *octree, uint32_t triangle, float weight, strl_error *err);
/* Draws from the direct children, with replacement: a child by the area of all that lies in it, one of its draws by its
 * weight. What is drawn moves up. Area and sums of the octant are its children's. */
strl_status strl_octree_sample(strl_octree *octree, uint32_t index, strl_error *err);
/* Sets area, sums and extent of the octant to those of its children. */
void strl_octree_sum_children(strl_octree *octree, strl_octant *octant);
/* How many draws a cell of this depth and area needs (Theorem 1). */
uint32_t strl_octree_draws(const strl_octree *octree, uint32_t depth, double area);

#endif
