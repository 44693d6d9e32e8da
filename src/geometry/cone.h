/* Cones that hold the normals of faces (Shirman and Abi-Ezzi 1993): where all directions of a cone point away from the
 * eye, so do all faces. Whatever is rounded here is rounded so that the cone gets wider. Pure functions; thread-safe.
 */
#ifndef STRL_GEOMETRY_CONE_H
#define STRL_GEOMETRY_CONE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define STRL_CONE_SCALE 65535

/* As docs/format.md has it: all directions d with d . axis >= cosine / STRL_CONE_SCALE * |d| |axis|. */
typedef struct strl_cone {
    int16_t axis[3]; /* of any length; zero where there is no cone */
    uint16_t cosine; /* of half its angle; 0: no cone, any direction may be there */
} strl_cone;

/* Of no face at all: joined with another cone it is that one. No record has it. */
strl_cone strl_cone_empty(void);
bool strl_cone_is_empty(const strl_cone *cone);

/* The unit normal of the face with these two edges, which lie counter-clockwise where it is seen from. Edges of whole
 * numbers up to 2^53 are taken exactly. False where the face has no area. */
bool strl_cone_normal(const double edge[3], const double next[3], double normal[3]);
/* A cone round these unit vectors, close to the smallest. */
strl_cone strl_cone_around(const double (*normal)[3], size_t count);
/* A cone round both, the smallest but for rounding. */
strl_cone strl_cone_join(const strl_cone *a, const strl_cone *b);

#endif
