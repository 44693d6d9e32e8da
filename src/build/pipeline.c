/* What every build does round its stages: check the request, lock scratch, clean up, count. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "build/context.h"
#include "platform/file.h"
#include "platform/thread.h"

strl_status strl__build_report(strl_build_context *context, uint64_t done, uint64_t total, strl_error *err)
{
    context->progress.done = done;
    context->progress.total = total;
    if (context->desc->progress && !context->desc->progress(context->desc->context, &context->progress))
        return strl__fail(err, STRL_ERR_CANCELLED, "the build was cancelled");
    return STRL_OK;
}

void strl__build_stage(strl_build_context *context, const char *stage)
{
    context->progress.stage = stage;
    context->progress.stage_index++;
    context->progress.done = context->progress.total = 0;
}

static strl_status check_request(const strl_build_desc *desc, strl_error *err)
{
    if (desc->input_count == 0 || !desc->output)
        return strl__fail(err, STRL_ERR_ARGUMENT, "a build needs at least one input and an output");
    if (desc->memory_bytes && desc->memory_bytes < STRL_BUILD_LEAST_MEMORY)
        return strl__fail(err, STRL_ERR_ARGUMENT, "--memory %" PRIu64 " is below the least that a build needs, %llu",
                          desc->memory_bytes, STRL_BUILD_LEAST_MEMORY);
    strl_file_info output, input;
    bool exists = strl_path_exists(desc->output);
    if (exists) {
        strl_status status = strl_path_stat(desc->output, &output, err);
        if (status)
            return status;
        if (output.is_directory)
            return strl__fail(err, STRL_ERR_ARGUMENT, "%s is a folder, expected the name of a file to write", desc->output);
    }
    for (uint32_t i = 0; i < desc->input_count; i++) {
        strl_status status = strl_path_stat(desc->inputs[i], &input, err);
        if (status)
            return status;
        if (exists && input.device == output.device && input.inode == output.inode)
            return strl__fail(err, STRL_ERR_ARGUMENT, "the output %s is the input %s: choose another name", desc->output,
                              desc->inputs[i]);
    }
    return STRL_OK;
}

/* The folder is locked by a file in it, so that two builds of one output do not meet. */
static strl_status open_scratch(const strl_build_desc *desc, char **directory, strl_lock **lock, strl_error *err)
{
    const char *slash = strrchr(desc->output, '/'), *name = slash ? slash + 1 : desc->output;
    size_t size = strlen(desc->scratch ? desc->scratch : "") + strlen(desc->output) + sizeof "/.tmp";
    char *lock_path;
    *directory = strl__alloc(size, 1);
    if (!*directory)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a path");
    if (desc->scratch) /* a folder of our own in the user's, because ours is cleared */
        snprintf(*directory, size, "%s/%s.tmp", desc->scratch, name);
    else
        snprintf(*directory, size, "%s.tmp", desc->output);
    lock_path = strl_path_join(*directory, "lock");
    if (!lock_path)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a path");
    bool was_there = strl_path_exists(*directory);
    strl_status status = desc->scratch ? strl_path_make_directory(desc->scratch, err) : STRL_OK;
    if (!status)
        status = strl_path_make_directory(*directory, err);
    if (!status)
        status = strl_lock_acquire(lock_path, lock, err);
    if (status == STRL_ERR_MEMORY && !was_there) /* nobody else has locked it yet */
        strl_path_remove_directory(*directory, NULL);
    strl__free(lock_path);
    return status;
}

/* What a worker holds at most, measured on soups and scans: a group's meshes, merged, and what simplifies them. */
#define WORKER_BYTES (24ull << 20)
#define SHARED_BYTES (32ull << 20)

/* As many threads as were asked for, but no more than the memory feeds. The output does not depend on their number. */
static unsigned count_workers(const strl_build_desc *desc, uint64_t memory_bytes)
{
    unsigned wanted = desc->jobs ? desc->jobs : strl_cpu_count();
    uint64_t fed = (memory_bytes - SHARED_BYTES) / WORKER_BYTES;
    return wanted < fed ? wanted : (unsigned)fed;
}

strl_status strl_build_clusters(const strl_build_desc *desc, strl_build_result *result, strl_error *err)
{
    char *directory = NULL;
    strl_lock *lock = NULL;
    uint64_t started = strl_clock_ns(), cpu_started = strl_clock_cpu_ns();
    strl_build_context context = {.desc = desc, .result = result,
                                  .memory_bytes = desc->memory_bytes ? desc->memory_bytes : 1ull << 30};
    *result = (strl_build_result){.inputs = desc->input_count};
    strl_status status = check_request(desc, err);
    if (status)
        return status;
    unsigned jobs = count_workers(desc, context.memory_bytes);
    status = open_scratch(desc, &directory, &lock, err);
    if (!status)
        status = strl_pool_create(jobs - 1, &context.pool, err);
    if (!status)
        status = strl_spill_set_create(directory, 0, &context.spills, err);
    if (!status) {
        context.scratch_dir = directory;
        status = strl__clusters_run(&context, err);
        result->scratch_bytes = strl_spill_set_peak_bytes(context.spills);
    }
    strl_spill_set_destroy(context.spills);
    strl_pool_destroy(context.pool);
    if (lock) { /* ours to clear */
        strl_path_remove_directory(directory, NULL);
        strl_lock_release(lock);
    }
    strl__free(directory);
    result->seconds = (double)(strl_clock_ns() - started) * 1e-9;
    result->cpu_seconds = (double)(strl_clock_cpu_ns() - cpu_started) * 1e-9;
    result->peak_rss_bytes = strl_process_peak_rss_bytes();
    return status;
}
