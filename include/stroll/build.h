/* Building a container from input files, under a memory budget, out of core from the first byte. It is in a
 * library of its own, libstroll_build (CMake: the component build, target stroll::build; pkg-config:
 * stroll-build), because who walks through models needs none of what reads and partitions them. */
#ifndef STROLL_BUILD_H
#define STROLL_BUILD_H

#include <stdbool.h>
#include <stdint.h>

#include "stroll/error.h"

#ifdef __cplusplus
extern "C" {
#endif

#define STRL_BUILD_LEAST_MEMORY (64ull << 20)
#define STRL_ROOT_MAX_TRIANGLES 16384u

typedef struct strl_build_progress {
    const char *stage; /* "read", "sort", "level 3", ...; static */
    /* from 1; all levels are one stage; index 0 = a resumed build checks what it has */
    uint32_t stage_index, stage_count;
    uint64_t done, total;   /* items of the stage; total 0 = unknown */
    uint64_t triangles_in;  /* as announced by the inputs, until they have been read once */
    double share;           /* of the whole build, 0 to 1 */
    double seconds_left;    /* estimated; 0 = unknown */
    double triangles_per_s; /* of the whole build so far; 0 = unknown */
    uint64_t scratch_bytes; /* on disk now */
    uint64_t memory_bytes;  /* the budget; the operating system knows what is used of it */
} strl_build_progress;

/* What a build will take, guessed from the inputs' headers and sizes before they are read. */
typedef struct strl_build_estimate {
    uint64_t triangles;          /* 0 = unknown */
    uint64_t scratch_bytes;      /* at most */
    uint64_t scratch_free_bytes; /* of that disk now. The build is refused where the triangles, counted, do not fit */
    double seconds;              /* roughly */
} strl_build_estimate;

/* How to build. Zero-initialise: every 0 takes its default. */
typedef struct strl_build_desc {
    const char *const *inputs;
    uint32_t input_count;
    const char *output; /* as the inputs: UTF-8 paths */
    /* folder in which OUTPUT.tmp is made, itself made where missing; NULL = beside the output */
    const char *scratch;
    uint64_t memory_bytes; /* 0 = 1 GiB; least STRL_BUILD_LEAST_MEMORY */
    unsigned jobs;         /* threads that work; 0 = one per processor */
    /* lattice step wanted, model units; 0 = chosen; rounded down to a power of two; refused where it is less than
     * about a 2^30th of the extent */
    double grid;
    bool compact;         /* for the network: a coarser lattice where grid is 0, normals of 2 x 8 bits */
    int up_axis;          /* 1 x, 2 y, 3 z; 0 = the inputs' own */
    const char *unit;     /* NULL = unknown */
    const char *importer; /* the program that reads foreign formats (readers/reader.h); NULL = as installed */
    bool certify;         /* measure what nodes claim, and claim no more */
    /* A build that is stopped leaves its scratch folder, with the stages that are finished, for a later one
     * that resumes. Not set: nothing is left. */
    bool keep;
    uint64_t keep_triangles; /* of models of fewer nothing is kept: they are built at once; 0 = 65,536 */
    bool resume; /* goes on with what an earlier build of the same request has left, if anything; keeps, too */
    /* of sample trees: that a cell of a pixel shows one of its visible triangles; 0 = 1 - 1e-6. 0 of clusters */
    double probability;
    bool no_dependencies; /* for measuring what dependencies bring: every group has one member */
    /* Called on the caller's thread, often; false cancels. May be NULL. */
    bool (*progress)(void *context, const strl_build_progress *progress);
    /* Told on the caller's thread, once for each thing amiss that does not stop the build; the sentence is
     * borrowed for the call. May be NULL; the result has the counts. */
    void (*warn)(void *context, const char *sentence);
    /* Told on the caller's thread, once, before the inputs are read. May be NULL. */
    void (*estimate)(void *context, const strl_build_estimate *estimate);
    void *context; /* of all three */
} strl_build_desc;

/* The stages that people are told of, in order; all levels are one. */
enum { STRL_BUILD_STAGES = 7 };
/* "survey", ...; stage < STRL_BUILD_STAGES. Static. */
STRL_API const char *strl_build_stage_name(uint32_t stage);

/* What a stage took, of this run alone; zero where it was resumed behind it. cpu_seconds: of all threads. */
typedef struct strl_build_stage {
    double seconds, cpu_seconds;
} strl_build_stage;

typedef struct strl_build_result {
    uint64_t triangles_in, triangles_leaf;
    uint64_t dropped_nonfinite, dropped_degenerate, dropped_lines, dropped_points;
    /* the longest edge of a triangle without area on the lattice, model units: claims leave these out */
    double dropped_longest;
    uint64_t missing_libraries; /* material libraries that could not be read: what they define is white */
    uint64_t missing_images;    /* images of materials that could not be used: these have their colours alone */
    uint32_t coarse_lattices;   /* 1 where the step had to be more than a sixteenth of the 1st-percentile edge */
    uint64_t vertices, nodes, groups, bytes_out, scratch_bytes;
    uint32_t parts, materials, inputs;
    /* what is used again and again is a tree of its own, whose triangles are counted once above */
    uint32_t trees;
    uint32_t levels;         /* of the tree that has most */
    uint32_t root_triangles; /* of all roots */
    uint64_t placements;
    uint64_t triangles_placed;       /* of the trees, as often as each is placed */
    double step, quantisation_error; /* of the coarsest lattice; how far it moves a point at most; model units */
    double seconds, cpu_seconds;
    strl_build_stage stages[STRL_BUILD_STAGES];
    uint64_t peak_rss_bytes;
    bool resumed;      /* an earlier build's stages were used; seconds and cpu_seconds are of this run alone */
    bool scratch_kept; /* of a failed build: there is something to resume */
} strl_build_result;

/* Builds the structure of clusters. Works on threads of its own, desc->jobs at most, and returns when they
 * are done; several builds at a time are legal, of different outputs. What desc points at is borrowed for
 * the call. result is filled in as far as the build came, also on failure. Fails with STRL_ERR_ARGUMENT where
 * there is no input or no output, one is the other, memory_bytes is below the least or a resumed build was
 * asked for something else, STRL_ERR_UNSUPPORTED, STRL_ERR_FORMAT where an input cannot be read,
 * STRL_ERR_LIMIT where memory or scratch do not suffice, STRL_ERR_DISK_FULL, STRL_ERR_IO, STRL_ERR_CANCELLED.
 *
 * Writes desc->output, which appears only when whole. On failure nothing is left of it but what desc->keep
 * asks for, and an older file of that name stays. The bytes are the same whether the build was stopped and
 * resumed, however often, or not. */
STRL_API strl_status strl_build_clusters(const strl_build_desc *desc, strl_build_result *result, strl_error *err);
/* The same of a sample tree, for what cannot be simplified: every triangle is stored once, and what is far away is
 * drawn by a random part of its triangles and by splats. desc->certify and no_dependencies are refused. */
STRL_API strl_status strl_build_samples(const strl_build_desc *desc, strl_build_result *result, strl_error *err);

#ifdef __cplusplus
}
#endif
#endif
