/* One simplification and what must hold of it, measured by the tests' own means. */
#ifndef STRL_TESTS_BUILD_SIMPLIFY_RUN_H
#define STRL_TESTS_BUILD_SIMPLIFY_RUN_H

#include "build/meshes.h"
#include "build/surface_distance.h"
#include "geometry/simplify.h"

/* States of a run that are measured. */
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define RUN_STATES 5u
#else
#define RUN_STATES 16u
#endif
#define RUN_NEVER UINT32_MAX

/* One mesh, simplified. */
typedef struct run {
    const mesh_kind *kind;
    strl_arena arena;
    strl_mesh mesh;
    strl_simplify_desc desc;
    strl_simplified result;
    uint32_t *removed_by; /* per point: the collapse that took it away, or RUN_NEVER */
} run;

/* To the last triangle, without any limit of error. */
strl_simplify_desc run_desc(strl_simplify_rung last);
void run_begin(run *r, const mesh_kind *kind, uint64_t seed, strl_simplify_rung last);
void run_end(run *r);
/* Every eighth point or so must stay. */
void run_keep_some(run *r, uint64_t seed);
/* Fails the test where that fails. */
void run_simplify(run *r);

/* The wedge that stands for `wedge` after `state` collapses. */
uint32_t run_resolve(const run *r, uint32_t wedge, uint32_t state);
/* The triangles that are left after `state` collapses, as points. */
uint32_t run_points_of_state(const run *r, uint32_t state, uint32_t (*triangle)[3]);
/* malloc */
double (*run_corners_of_mesh(const strl_mesh *mesh))[3][3];

/* Both ways: the new surface from the start, and the start from the new surface, no farther than `claim`. */
void run_compare(const run *r, uint32_t seed, const surface *start, const double (*corner)[3][3], uint32_t count,
                 double claim);
/* spare: so much of the claim belongs to the error of the start */
void run_compare_with_start(const run *r, uint32_t state, const surface *start, double spare);
/* The claims of RUN_STATES states. */
void run_measure(const run *r);

/* Errors and counts go one way, targets are there, kept points stay. */
void run_check_order(const run *r);
/* A wedge falls onto one of the point that its own fell onto, of its own palette below rung DISJOINT. */
void run_check_wedges(const run *r);

#endif
