/* How far a build is, and how long the rest will take.
 *
 * Every stage has a share of the whole, as measured, so that one figure grows from 0 to 1. Time per share is what the
 * last tenth of the work took, mostly: models differ in where their time goes, and a stage that is slower than it
 * should be must soon be believed. Before that there is a guess from the number of triangles. */
#ifndef STRL_BUILD_PROGRESS_H
#define STRL_BUILD_PROGRESS_H

#include <stdbool.h>
#include <stdint.h>

#include "stroll/build.h"

typedef enum strl_build_kind { STRL_BUILD_CLUSTERS, STRL_BUILD_CERTIFIED, STRL_BUILD_SAMPLES } strl_build_kind;

typedef struct strl_estimate {
    strl_build_kind kind;
    double share; /* of the whole build, 0 to 1; never shrinks */
    double seconds_left;
    double seconds, work;            /* of late: the older, the less they count */
    double stage_first, stage_share; /* of the stage under way */
    double first_share;              /* where this run began: 0 unless it resumed */
    double tree_first, tree_share;   /* of the tree under way, of all; 0 and 1 of a model of one tree */
    uint64_t started_ns, updated_ns;
    uint32_t stage_index; /* of STRL_BUILD_STAGES, 0 before the first */
} strl_estimate;

/* A rough time for this many triangles; no machine is known beforehand. */
double strl__estimate_seconds(strl_build_kind kind, uint64_t triangles, unsigned workers);
void strl__estimate_start(strl_estimate *estimate, strl_build_kind kind, uint64_t now_ns);
/* seconds: guessed for the whole build. Before the first update it is all that is known, later it counts little. */
void strl__estimate_guess(strl_estimate *estimate, double seconds);
/* An unknown name leaves share and index as they are. */
void strl__estimate_stage(strl_estimate *estimate, const char *stage);
/* The stages of another tree follow, which begin anew. */
void strl__estimate_tree(strl_estimate *estimate, double first, double share);
/* Items of the stage; total 0 = unknown. */
void strl__estimate_update(strl_estimate *estimate, uint64_t done, uint64_t total, uint64_t now_ns);
/* Triangles of the whole model a second, on average since this run began; 0 = not known yet. */
double strl__estimate_rate(const strl_estimate *estimate, uint64_t triangles);

#endif
