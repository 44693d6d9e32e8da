/* Meshes for the simplifier's tests: small, seeded, of every kind that it must bear. */
#ifndef STRL_TESTS_BUILD_MESHES_H
#define STRL_TESTS_BUILD_MESHES_H

#include "geometry/mesh.h"

/* Arrays are the arena's. One wedge per point, white, its normal upward, palette 0; errors are zero. */
typedef struct mesh_kind {
    const char *name;
    void (*make)(strl_mesh *mesh, uint64_t seed, strl_arena *arena);
    bool closed, manifold;
} mesh_kind;

/* Ends with a NULL name. */
extern const mesh_kind mesh_kinds[];

void mesh_make_hills(strl_mesh *mesh, uint64_t seed, strl_arena *arena);
void mesh_make_sphere(strl_mesh *mesh, uint64_t seed, strl_arena *arena);
void mesh_make_boxes(strl_mesh *mesh, uint32_t boxes, uint64_t seed, strl_arena *arena);
/* A flat square of some thousand triangles, black, with a white disc of radius 400 about its middle. */
void mesh_make_disc(strl_mesh *mesh, uint64_t seed, strl_arena *arena);
/* A wedge more for the points at x = 0, with another palette for triangles beyond it, and colours that differ at
 * random. */
void mesh_add_seam(strl_mesh *mesh, bool other_palette, uint64_t seed, strl_arena *arena);
/* As if the mesh were so far from some input, everywhere. */
void mesh_begin_with_error(strl_mesh *mesh, float error);

uint64_t mesh_random(uint64_t *state);
/* Uniform in 0 .. bound - 1. */
uint32_t mesh_below(uint64_t *state, uint32_t bound);

#endif
