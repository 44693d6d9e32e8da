/* See progress.h. */
#include "build/progress.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

/* Isosurfaces, scans and terrain on two cores. */
#define TRIANGLES_PER_CORE_SECOND 1.4e5
#define TIMES_CERTIFIED 1.3
#define SAMPLED_PER_CORE_SECOND 1.3e6 /* isosurfaces, boxes, chessboards */

#define MEMORY_OF_WORK 0.1 /* share of the build after which what was counts 1/e */
#define WORK_OF_GUESS 0.03 /* a guess counts as much as this share measured */

typedef struct stage_share {
    const char *name;
    uint32_t index;
    double share;
} stage_share;

/* Measured on isosurfaces, in order, shuffled and as STL. They sum to 1. */
static const stage_share cluster_stages[] = {{"survey", 1, 0.013},
                                             {"read", 2, 0.043},
                                             {"sort", 3, 0.052},
                                             {"connect", 4, 0.07},
                                             {"partition", 5, 0.005},
                                             {"level 0", 6, 0.355},
                                             {"level 1", 6, 0.152},
                                             {"level 2", 6, 0.095},
                                             {"level 3", 6, 0.039},
                                             {"level 4", 6, 0.018},
                                             {"level 5", 6, 0.009},
                                             {"level 6", 6, 0.004},
                                             {"level 7", 6, 0.003},
                                             {"level 8", 6, 0.002},
                                             {"level 9", 6, 0.002},
                                             {"higher levels", 6, 0.003},
                                             {"write", STRL_BUILD_STAGES, 0.135}};

static const stage_share sample_stages[] = {
    {"survey", 1, 0.11}, {"read", 2, 0.17}, {"sort", 3, 0.7}, {"write", STRL_BUILD_STAGES, 0.02}};

const char *strl_build_stage_name(uint32_t stage)
{
    static const char *const names[STRL_BUILD_STAGES] = {"survey",    "read",   "sort", "connect",
                                                         "partition", "levels", "write"};
    return names[stage];
}

double strl__estimate_seconds(strl_build_kind kind, uint64_t triangles, unsigned workers)
{
    double rate = kind == STRL_BUILD_SAMPLES ? SAMPLED_PER_CORE_SECOND : TRIANGLES_PER_CORE_SECOND;
    double seconds = (double)triangles / (rate * (workers ? workers : 1));
    return kind == STRL_BUILD_CERTIFIED ? seconds * TIMES_CERTIFIED : seconds;
}

void strl__estimate_start(strl_estimate *estimate, strl_build_kind kind, uint64_t now_ns)
{
    *estimate = (strl_estimate){.kind = kind, .started_ns = now_ns, .updated_ns = now_ns, .tree_share = 1};
}

void strl__estimate_tree(strl_estimate *estimate, double first, double share)
{
    estimate->tree_first = first;
    estimate->tree_share = share;
}

static void set_seconds_left(strl_estimate *estimate)
{
    estimate->seconds_left = estimate->work > 0 ? (1 - estimate->share) * estimate->seconds / estimate->work : 0;
}

void strl__estimate_guess(strl_estimate *estimate, double seconds)
{
    if (estimate->share - estimate->first_share > WORK_OF_GUESS)
        return;
    estimate->seconds = seconds * WORK_OF_GUESS;
    estimate->work = WORK_OF_GUESS;
    set_seconds_left(estimate);
}

void strl__estimate_stage(strl_estimate *estimate, const char *stage)
{
    bool is_sampled = estimate->kind == STRL_BUILD_SAMPLES;
    const stage_share *stages = is_sampled ? sample_stages : cluster_stages;
    size_t count =
        is_sampled ? sizeof sample_stages / sizeof *sample_stages : sizeof cluster_stages / sizeof *cluster_stages;
    double before = 0;
    for (size_t i = 0; i < count; before += stages[i++].share) {
        if (strcmp(stages[i].name, stage) != 0)
            continue;
        if (estimate->stage_index == 0)
            estimate->share = estimate->first_share = before;
        estimate->stage_index = stages[i].index;
        estimate->stage_first = before;
        estimate->stage_share = stages[i].share;
        return;
    }
    estimate->stage_first =
        estimate->tree_share > 0 ? (estimate->share - estimate->tree_first) / estimate->tree_share : 0;
    estimate->stage_share = 0;
}

void strl__estimate_update(strl_estimate *estimate, uint64_t done, uint64_t total, uint64_t now_ns)
{
    double part = total ? (done < total ? (double)done / (double)total : 1) : 0;
    double reached =
        fmin(estimate->tree_first + estimate->tree_share * (estimate->stage_first + part * estimate->stage_share), 1);
    double grown = reached - estimate->share;
    /* Without progress time only adds up, so that a stage that stands still is seen in the end. */
    if (grown > 0) {
        double kept = exp(-grown / MEMORY_OF_WORK);
        estimate->seconds *= kept;
        estimate->work = estimate->work * kept + grown;
        estimate->share = reached;
    }
    estimate->seconds += (double)(now_ns - estimate->updated_ns) * 1e-9;
    estimate->updated_ns = now_ns;
    set_seconds_left(estimate);
}

double strl__estimate_rate(const strl_estimate *estimate, uint64_t triangles)
{
    double seconds = (double)(estimate->updated_ns - estimate->started_ns) * 1e-9;
    return seconds > 0 ? (double)triangles * (estimate->share - estimate->first_share) / seconds : 0;
}
