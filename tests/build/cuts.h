/* Cuts through a built model and their distance from its finest surface, in lattice units. */
#ifndef STRL_TESTS_BUILD_CUTS_H
#define STRL_TESTS_BUILD_CUTS_H

#include "build/built.h"
#include "build/surface_distance.h"

/* The leaves: the input, as the lattice has it. */
typedef struct cut_input {
    uint64_t count;
    int64_t (*triangle)[3][3];
    double (*corner)[3][3];
    surface surface;
} cut_input;

void cut_input_load(const built_model *model, cut_input *in);
void cut_input_free(cut_input *in);

/* Zero-initialise; strl__free the triangles. */
typedef struct cut_mesh {
    int64_t (*triangle)[3][3];
    size_t count, capacity;
    uint32_t worst_rung; /* strl_rung, of the active nodes */
    uint32_t dependent;  /* active nodes whose group has several members */
} cut_mesh;

void cut_mesh_add(const built_model *model, uint32_t node, uint32_t state, cut_mesh *cut);
/* length: model units. */
void cut_uniform(const built_model *model, double length, cut_mesh *cut);

/* Uniformly distributed over the triangle. */
void cut_random_point(const double corner[3][3], uint64_t *random, double p[3]);

/* `cuts` of them, from the finest claim to the coarsest; `samples` points each way. Fails the
 * test where one lies farther away. */
void assert_uniform_cuts_hold(const built_model *model, const char *name, unsigned cuts, uint32_t samples);

#endif
