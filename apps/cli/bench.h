/* The named measurements of `stroll bench` and what they share. Each makes what it needs in one temporary folder, runs
 * `runs` times and adds figures, whose values the report turns into median and spread. */
#ifndef STRL_CLI_BENCH_H
#define STRL_CLI_BENCH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "progress.h"
#include "stroll/error.h"
#include "stroll/frame.h"

#define STRL_BENCH_MOST_FIGURES 16u

/* What one measurement says. Without a value `note` says why. */
typedef struct strl_bench_figure {
    const char *name, *unit; /* static */
    double *values;          /* [runs], owned; the first `count` are measured */
    size_t count;
    char note[160]; /* what it was taken with; may be empty */
} strl_bench_figure;

typedef struct strl_bench {
    uint64_t triangles; /* wanted */
    unsigned runs;      /* at least 1 */
    unsigned jobs;      /* threads of scene and build, at least 1 */
    strl_cull cull;     /* of select and draw */
    strl_cli_progress *progress;
    bool (*stopped)(void);            /* the user asked to stop */
    char *folder, *scene, *container; /* paths, owned by cmd_bench.c */
    bool has_scene, has_container;    /* the files are there and whole */
    uint64_t scene_triangles;         /* written */
    strl_bench_figure figures[STRL_BENCH_MOST_FIGURES];
    size_t figure_count;
} strl_bench;

typedef struct strl_bench_entry {
    const char *name, *summary;
    strl_status (*run)(strl_bench *bench, strl_error *err);
} strl_bench_entry;

strl_status strl_bench_scene(strl_bench *bench, strl_error *err);
strl_status strl_bench_read(strl_bench *bench, strl_error *err);
strl_status strl_bench_build(strl_bench *bench, strl_error *err);
strl_status strl_bench_decode(strl_bench *bench, strl_error *err);
strl_status strl_bench_select(strl_bench *bench, strl_error *err);
strl_status strl_bench_draw(strl_bench *bench, strl_error *err);

/* Makes the container where it is not there yet, without measuring. */
strl_status strl_bench_need_container(strl_bench *bench, strl_error *err);

/* A figure with room for all runs. */
strl_status strl_bench_add_figure(strl_bench *bench, const char *name, const char *unit, strl_bench_figure **figure,
                                  strl_error *err);
/* Sorts values and returns their median; count at least 1. */
double strl_bench_median(double *values, size_t count);
/* Shows run `run` of `what` on the progress line; STRL_ERR_CANCELLED where the user asked to stop. */
strl_status strl_bench_check(const strl_bench *bench, const char *what, unsigned run, strl_error *err);

void strl_bench_print_text(const strl_bench *bench);
strl_status strl_bench_print_json(const strl_bench *bench, strl_error *err);

#endif
