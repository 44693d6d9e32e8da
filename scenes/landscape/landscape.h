/* What the makers of the landscape's pieces share. Lengths are metres, z is up. */
#ifndef STRL_SCENES_LANDSCAPE_LANDSCAPE_H
#define STRL_SCENES_LANDSCAPE_LANDSCAPE_H

#include "scenes/generator.h"

typedef enum strl__landscape_material {
    STRL__GRASS,
    STRL__BARK,
    STRL__LEAVES, /* and the next ones, of each kind of tree */
    STRL__WALL = STRL__LEAVES + 5,
    STRL__LANDSCAPE_MATERIALS = STRL__WALL + 3
} strl__landscape_material;

extern const strl__material strl__landscape_materials[STRL__LANDSCAPE_MATERIALS];

enum { STRL__TREE_KINDS = 5, STRL__HOUSE_KINDS = 3 };

/* Uniform in [0, 1). */
double strl__landscape_random(uint64_t key);
/* The ground's height, a smooth function of the place. */
double strl__landscape_height(uint64_t seed, double x, double y);

/* Wood and leaves of a tree that stands in the origin, some 6,000 to 30,000 triangles. */
void strl__landscape_tree(uint64_t seed, int kind, strl__part_mesh *wood, strl__part_mesh *leaves);
/* A house of at least 256 triangles round the origin. */
void strl__landscape_house(uint64_t seed, int kind, strl__part_mesh *mesh);

#endif
