/* Building a container from input files, under a memory budget, out of core from the first byte. */
#ifndef STRL_BUILD_BUILD_H
#define STRL_BUILD_BUILD_H

#include <stdbool.h>
#include <stdint.h>

#include "jobs/pool.h"
#include "stroll/error.h"

#define STRL_BUILD_LEAST_MEMORY (64ull << 20)
#define STRL_ROOT_MAX_TRIANGLES 16384u

typedef struct strl_build_progress {
    const char *stage;   /* "read", "sort", "level 3 of 11", ...; static */
    uint32_t stage_index, stage_count;
    uint64_t done, total; /* items of the stage; total 0 = unknown */
    uint64_t triangles_in;
} strl_build_progress;

/* How to build. Zero-initialise: every 0 takes its default. */
typedef struct strl_build_desc {
    const char *const *inputs;
    uint32_t input_count;
    const char *output;
    const char *scratch;    /* folder in which OUTPUT.tmp is made, itself made where missing; NULL = beside the output */
    uint64_t memory_bytes;  /* 0 = 1 GiB; least STRL_BUILD_LEAST_MEMORY */
    unsigned jobs;          /* threads that work; 0 = one per processor */
    double grid;            /* lattice step wanted, model units; 0 = chosen; rounded down to a power of two; refused where it
                               is less than about a 2^30th of the extent */
    int up_axis;            /* 1 x, 2 y, 3 z; 0 = the inputs' own */
    const char *unit;       /* NULL = unknown */
    bool certify;           /* measure what nodes claim, and claim no more */
    bool no_dependencies;   /* for measuring what dependencies bring: every group has one member */
    /* Called on the caller's thread, often; false cancels. May be NULL. */
    bool (*progress)(void *context, const strl_build_progress *progress);
    /* Told on the caller's thread, once for each thing amiss that does not stop the build; the sentence is borrowed for the
     * call. May be NULL; the result has the counts. */
    void (*warn)(void *context, const char *sentence);
    void *context; /* of both */
} strl_build_desc;

typedef struct strl_build_result {
    uint64_t triangles_in, triangles_leaf;
    uint64_t dropped_nonfinite, dropped_degenerate, dropped_lines, dropped_points;
    uint64_t missing_libraries; /* material libraries that could not be read: what they define is white */
    uint32_t coarse_lattices;   /* 1 where the step had to be more than a sixteenth of the 1st-percentile edge */
    uint64_t vertices, nodes, groups, bytes_out, scratch_bytes;
    uint32_t parts, materials, levels, root_triangles, inputs;
    uint64_t placements;
    double seconds, cpu_seconds;
    uint64_t peak_rss_bytes;
} strl_build_result;

/* Writes desc->output, which appears only when whole. On failure nothing is left of it, and an older file of that name stays. */
strl_status strl_build_clusters(const strl_build_desc *desc, strl_build_result *result, strl_error *err);

#endif
