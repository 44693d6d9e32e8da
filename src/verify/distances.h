/* Distances between cuts and the input, both ways. */
#ifndef STRL_VERIFY_DISTANCES_H
#define STRL_VERIFY_DISTANCES_H

#include "verify/cuts.h"
#include "verify/input.h"

/* Measures the uniform cuts and the levels of the only tree against the input. */
strl_status strl__v_check_distances(strl__model *model, const strl__vtree *tree, strl__vinput *input,
                                    strl_verify_report *report, strl_error *err);

/* A cut as a surface: one chunk for each active node. */
typedef struct strl__cut_surface {
    strl__model *model;
    const strl__vtree *tree;
    bool base_states;    /* else the coarsest state with an error of at most limit */
    double limit;        /* lattice units */
    uint32_t *nodes;     /* [surface.count], owned */
    uint64_t *triangles; /* [surface.count] of the state drawn, known once it was loaded; owned */
    strl__worker *workers;
    strl__surface surface;
} strl__cut_surface;

/* active as in verify/cuts.h. */
strl_status strl__v_cut_surface_init(strl__cut_surface *cut, strl__model *model, const strl__vtree *tree,
                                     const uint64_t *active, strl_error *err);
void strl__v_cut_surface_deinit(strl__cut_surface *cut);

/* What was measured from one chunk. */
typedef struct strl__measured {
    double most, sum; /* lattice units; squared, summed */
    double worst[3];  /* where the largest was */
    double excess;    /* the largest excess over what the nearest chunks claim; at least 0 */
    double most_excessive[3];
    double claimed; /* of the chunk */
    uint64_t points;
} strl__measured;

/* From all vertices of `from`, and from one random point for two of its triangles, by area, to `to`. results:
 * [from->count]. */
strl_status strl__v_measure(strl__model *model, strl__surface *from, strl__surface *to, uint64_t seed,
                            strl__measured *results, strl_error *err);

#endif
