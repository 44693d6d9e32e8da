/* What every build does round its stages: check the request, make scratch, clean up, count. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "build/checkpoint.h"
#include "build/context.h"
#include "build/model.h"
#include "platform/file.h"
#include "platform/output.h"
#include "platform/scratch.h"
#include "platform/thread.h"

strl_status strl__build_report(strl_build_context *context, uint64_t done, uint64_t total, strl_error *err)
{
    strl_build_progress *progress = &context->progress;
    strl__estimate_update(&context->estimate, done, total, strl_clock_ns());
    progress->done = done;
    progress->total = total;
    progress->share = context->estimate.share;
    progress->seconds_left = context->estimate.seconds_left;
    progress->triangles_per_s = strl__estimate_rate(&context->estimate, progress->triangles_in);
    progress->scratch_bytes = strl_spill_set_bytes(context->spills);
    if (context->desc->progress && !context->desc->progress(context->desc->context, progress))
        return strl__fail(err, STRL_ERR_CANCELLED, "the build was cancelled");
    return STRL_OK;
}

/* What the stage under way has taken until now goes to its account. */
static void end_stage(strl_build_context *context)
{
    uint64_t now = strl_clock_ns(), cpu_now = strl_clock_cpu_ns();
    if (context->progress.stage_index) {
        strl_build_stage *stage = &context->result->stages[context->progress.stage_index - 1];
        stage->seconds += (double)(now - context->stage_ns) * 1e-9;
        stage->cpu_seconds += (double)(cpu_now - context->stage_cpu_ns) * 1e-9;
    }
    context->stage_ns = now;
    context->stage_cpu_ns = cpu_now;
}

void strl__build_stage(strl_build_context *context, const char *stage)
{
    end_stage(context);
    strl__estimate_stage(&context->estimate, stage);
    context->progress.stage = stage;
    context->progress.stage_index = context->estimate.stage_index;
    context->progress.stage_count = STRL_BUILD_STAGES;
    context->progress.done = context->progress.total = 0;
}

void strl__build_expect(strl_build_context *context, uint64_t triangles)
{
    context->progress.triangles_in = triangles;
    strl__estimate_guess(&context->estimate,
                         strl__estimate_seconds(context->estimate.kind, triangles, strl_pool_workers(context->pool)));
}

strl_status strl__build_open_stream(strl_build_context *context, const char *name, strl_spill **spill, strl_error *err)
{
    return context->keep ? strl_spill_open_kept(context->spills, name, 0, spill, err)
                         : strl_spill_open(context->spills, name, 0, spill, err);
}

/* What the build puts into its scratch folder: the streams of the stages, a reader's, the unfinished container or
 * checkpoint, and the checkpoint. */
static const char *const scratch_names[] = {"*" STRL_SPILL_SUFFIX, "*.part", STRL_CHECKPOINT_NAME, NULL};

static strl_status check_inputs(const strl_build_desc *desc, const char *target, strl_error *err)
{
    strl_file_info output, input;
    bool exists = strl_path_exists(target);
    strl_status status = exists ? strl_path_stat(target, &output, err) : STRL_OK;
    for (uint32_t i = 0; i < desc->input_count && status == STRL_OK; i++) {
        if (!*desc->inputs[i])
            return strl__fail(err, STRL_ERR_ARGUMENT, "an input's name is empty, expected the name of a file to read");
        status = strl_path_stat(desc->inputs[i], &input, err);
        if (status == STRL_OK && exists && input.device == output.device && input.inode == output.inode)
            return strl__fail(err, STRL_ERR_ARGUMENT, "the output %s is the input %s: choose another name",
                              desc->output, desc->inputs[i]);
    }
    return status;
}

/* *target: the file that the output's name stands for, owned by the caller. */
static strl_status check_request(const strl_build_desc *desc, char **target, strl_error *err)
{
    *target = NULL;
    if (desc->input_count == 0 || !desc->output)
        return strl__fail(err, STRL_ERR_ARGUMENT, "a build needs at least one input and an output");
    if (desc->memory_bytes && desc->memory_bytes < STRL_BUILD_LEAST_MEMORY)
        return strl__fail(err, STRL_ERR_ARGUMENT, "--memory %" PRIu64 " is below the least that a build needs, %llu",
                          desc->memory_bytes, STRL_BUILD_LEAST_MEMORY);
    strl_status status = strl_output_target(desc->output, target, err);
    return status == STRL_OK ? check_inputs(desc, *target, err) : status;
}

/* A folder of our own, in the user's where there is one: two builds of one output do not meet, and nobody else's files
 * are in it. */
static strl_status open_scratch(const strl_build_desc *desc, const char *target, strl_scratch **scratch,
                                strl_error *err)
{
    const char *slash = strrchr(target, '/'), *name = slash ? slash + 1 : target;
    size_t size = strlen(desc->scratch ? desc->scratch : "") + strlen(target) + sizeof "/.tmp";
    char *path = strl__alloc(size, 1);
    if (!path)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a path");
    if (desc->scratch)
        snprintf(path, size, "%s/%s.tmp", desc->scratch, name);
    else
        snprintf(path, size, "%s.tmp", target);
    const strl_scratch_desc wanted = {
        .path = path, .parent = desc->scratch, .names = scratch_names, .keep = desc->resume};
    strl_status status = strl_scratch_create(&wanted, scratch, err);
    strl__free(path);
    return status;
}

/* Where scratch is elsewhere, what is unfinished of the output still lies beside it, to be renamed: in a folder of ours
 * too, so that the next build removes what a kill has left. *scratch: NULL where the build's own scratch is that
 * folder. */
static strl_status open_part_scratch(const char *target, const char *own, strl_scratch **scratch, strl_error *err)
{
    strl_file_info there, here;
    size_t size = strlen(target) + sizeof ".tmp";
    char *path = strl__alloc(size, 1);
    *scratch = NULL;
    if (!path)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a path");
    snprintf(path, size, "%s.tmp", target);
    strl_status status = strl_path_stat(own, &there, err);
    bool is_own = !status && strl_path_exists(path) && strl_path_stat(path, &here, NULL) == STRL_OK &&
                  here.device == there.device && here.inode == there.inode;
    if (!status && !is_own)
        status = strl_scratch_create(&(strl_scratch_desc){.path = path, .names = scratch_names}, scratch, err);
    strl__free(path);
    return status;
}

/* What a worker holds at most, measured on soups, scans and plants: a group's meshes, merged, and what simplifies them.
 */
#define WORKER_BYTES (36ull << 20)
#define SHARED_BYTES (28ull << 20)

/* As many threads as were asked for, but no more than the memory feeds. The output does not depend on their number. */
static unsigned count_workers(const strl_build_desc *desc, uint64_t memory_bytes)
{
    unsigned wanted = desc->jobs ? desc->jobs : strl_cpu_count();
    uint64_t fed = (memory_bytes - SHARED_BYTES) / WORKER_BYTES;
    return wanted < fed ? wanted : (unsigned)fed;
}

static bool is_needed(void *context, const char *name)
{
    strl_build_context *build = context;
    return strcmp(name, STRL_CHECKPOINT_NAME) == 0 || strl_spill_set_uses(build->spills, name);
}

/* Takes up what an earlier build has left, and removes what it had begun; all of it where there is no checkpoint. */
static strl_status resume(strl_build_context *context, strl_scratch *scratch, strl_error *err)
{
    strl_status status = context->has_checkpoint ? strl__checkpoint_read(context, err) : STRL_OK;
    if (!status)
        status = strl_scratch_sweep(scratch, context->has_checkpoint ? is_needed : NULL, context, err);
    if (!status && context->has_checkpoint)
        strl__build_expect(context, context->progress.triangles_in);
    if (!status && !context->has_checkpoint && context->desc->warn) {
        char text[1200];
        snprintf(
            text, sizeof text,
            "%.1000s holds no finished stage of an earlier build (one with another --scratch lies there): building from the beginning",
            context->scratch_dir);
        context->desc->warn(context->desc->context, text);
    }
    return status;
}

/* Whether the same command may come further another time. What an earlier build has left and cannot be read is of no
 * use. */
static bool is_stopped(const strl_build_context *context, bool resumes, strl_status status)
{
    return status == STRL_ERR_DISK_FULL || status == STRL_ERR_CANCELLED || status == STRL_ERR_MEMORY ||
           (status == STRL_ERR_IO && (!resumes || context->result->resumed));
}

/* What failed and left its scratch tells how to go on. */
static strl_status tell_way_on(const strl_build_context *context, bool resumes, strl_status status, strl_error *err)
{
    if (!err || !context->result->scratch_kept)
        return status;
    char sentence[sizeof err->message];
    const char *way = ": leave --resume out to begin anew";
    if (is_stopped(context, resumes, status))
        way = status == STRL_ERR_DISK_FULL
                  ? "; what is finished is kept: make room, then the same command with --resume goes on"
                  : "; what is finished is kept: the same command with --resume goes on";
    else if (status == STRL_ERR_ARGUMENT && !context->result->resumed)
        way = ": give what the earlier build was given, or leave --resume out to begin anew";
    snprintf(sentence, sizeof sentence, "%.380s%s", err->message, way);
    return strl__fail(err, status, "%s", sentence);
}

void strl__build_note_scratch(strl_build_context *context)
{
    uint64_t taken = context->spool_bytes + strl_spill_set_peak_bytes(context->spills);
    if (taken > context->result->scratch_bytes)
        context->result->scratch_bytes = taken;
}

static strl_status run_in_scratch(strl_build_context *context, strl_scratch *scratch, strl_error *err)
{
    const strl_build_desc *desc = context->desc;
    strl_status status = strl_pool_create(count_workers(desc, context->memory_bytes) - 1, &context->pool, err);
    if (!status)
        status = strl_spill_set_create(context->scratch_dir, 0, &context->spills, err);
    if (!status && desc->resume)
        status = resume(context, scratch, err);
    if (!status)
        status = strl__model_run(context, err);
    end_stage(context);
    if (context->spills)
        strl__build_note_scratch(context);
    strl_spill_set_destroy(context->spills);
    strl_pool_destroy(context->pool);
    strl__free(context->resumed.data);
    strl__free(context->beside.data);
    return status;
}

/* Everything between a checked request and its end. */
static strl_status run(strl_build_context *context, const char *target, strl_error *err)
{
    strl_scratch *scratch = NULL, *parts = NULL;
    strl_status status = open_scratch(context->desc, target, &scratch, err);
    if (status)
        return status;
    context->scratch_dir = strl_scratch_path(scratch);
    bool resumes = context->desc->resume && strl__checkpoint_exists(context->scratch_dir);
    context->has_checkpoint = resumes;
    status = open_part_scratch(target, context->scratch_dir, &parts, err);
    context->part_dir = parts ? strl_scratch_path(parts) : context->scratch_dir;
    if (!status)
        status = run_in_scratch(context, scratch, err);
    strl_scratch_destroy(parts);
    context->result->scratch_kept =
        status && context->has_checkpoint && (resumes || is_stopped(context, resumes, status));
    if (context->result->scratch_kept)
        strl_scratch_leave(scratch);
    else
        strl_scratch_destroy(scratch);
    return status ? tell_way_on(context, resumes, status, err) : STRL_OK;
}

static strl_status build_with(strl_status (*stages)(strl_build_context *, strl_error *), const strl_build_desc *desc,
                              strl_build_result *result, strl_error *err)
{
    char *target = NULL;
    uint64_t started = strl_clock_ns(), cpu_started = strl_clock_cpu_ns();
    strl_build_context context = {.desc = desc,
                                  .result = result,
                                  .run = stages,
                                  .keep = desc->keep || desc->resume,
                                  .memory_bytes = desc->memory_bytes ? desc->memory_bytes : 1ull << 30};
    *result = (strl_build_result){.inputs = desc->input_count};
    strl__estimate_start(&context.estimate,
                         stages == strl__samples_run ? STRL_BUILD_SAMPLES
                         : desc->certify             ? STRL_BUILD_CERTIFIED
                                                     : STRL_BUILD_CLUSTERS,
                         started);
    context.progress.memory_bytes = context.memory_bytes;
    strl_status status = check_request(desc, &target, err);
    if (!status)
        status = run(&context, target, err);
    strl__free(target);
    result->seconds = (double)(strl_clock_ns() - started) * 1e-9;
    result->cpu_seconds = (double)(strl_clock_cpu_ns() - cpu_started) * 1e-9;
    uint64_t peak = strl_process_peak_rss_bytes();
    result->peak_rss_bytes = peak > result->peak_rss_bytes ? peak : result->peak_rss_bytes;
    return status;
}

strl_status strl_build_clusters(const strl_build_desc *desc, strl_build_result *result, strl_error *err)
{
    if (desc->probability > 0)
        return strl__fail(
            err, STRL_ERR_ARGUMENT,
            "--probability is of sample trees: clusters are simplified, and nothing of them is left to chance");
    return build_with(strl__clusters_run, desc, result, err);
}

strl_status strl_build_samples(const strl_build_desc *desc, strl_build_result *result, strl_error *err)
{
    if (desc->certify || desc->no_dependencies)
        return strl__fail(err, STRL_ERR_ARGUMENT, "a sample tree takes no %s",
                          desc->certify ? "--certify: it claims no error" : "--no-dependencies: it has none");
    if (!(desc->probability >= 0 && desc->probability < 1))
        return strl__fail(err, STRL_ERR_ARGUMENT, "the probability of a sample is %g, expected one between 0 and 1",
                          desc->probability);
    return build_with(strl__samples_run, desc, result, err);
}
