#include <jansson.h>
#include <stdio.h>
#include <string.h>

#include "build/build.h"
#include "interrupt.h"
#include "options.h"
#include "progress.h"

static bool show_progress(void *context, const strl_build_progress *progress)
{
    strl_cli_progress_update(context, progress->stage, progress->done, progress->total, "items");
    return !strl_cli_interrupted();
}

static double per_second(uint64_t count, double seconds)
{
    return seconds > 0 ? (double)count / seconds : 0;
}

static int print_json(const strl_build_result *r)
{
    uint64_t dropped = r->dropped_nonfinite + r->dropped_degenerate;
    json_t *object = json_pack(
        "{s:I, s:I, s:{s:I, s:I, s:I, s:I, s:I}, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:f, s:f, s:I, s:I}",
        "triangles_in", (json_int_t)r->triangles_in, "triangles_leaf", (json_int_t)r->triangles_leaf, "dropped",
        "triangles", (json_int_t)dropped, "nonfinite", (json_int_t)r->dropped_nonfinite, "degenerate",
        (json_int_t)r->dropped_degenerate, "lines", (json_int_t)r->dropped_lines, "points",
        (json_int_t)r->dropped_points, "vertices", (json_int_t)r->vertices, "parts", (json_int_t)r->parts, "materials",
        (json_int_t)r->materials, "placements", (json_int_t)r->placements, "nodes", (json_int_t)r->nodes, "groups",
        (json_int_t)r->groups, "levels", (json_int_t)r->levels, "root_triangles", (json_int_t)r->root_triangles,
        "bytes_out", (json_int_t)r->bytes_out, "seconds", r->seconds, "cpu_seconds", r->cpu_seconds, "peak_rss_bytes",
        (json_int_t)r->peak_rss_bytes, "scratch_bytes", (json_int_t)r->scratch_bytes);
    if (!object)
        return strl_cli_fail(&(strl_error){STRL_ERR_MEMORY, "no memory to print the result"});
    json_dumpf(object, stdout, JSON_COMPACT);
    putchar('\n');
    json_decref(object);
    return 0;
}

static void print_text(const strl_build_result *r, const char *output)
{
    printf("%s: %llu triangles in %llu nodes on %u levels, %.1f MB (%.2f bytes a triangle)\n", output,
           (unsigned long long)r->triangles_leaf, (unsigned long long)r->nodes, r->levels, (double)r->bytes_out / 1e6,
           (double)r->bytes_out / (double)r->triangles_leaf);
    if (r->dropped_nonfinite + r->dropped_degenerate + r->dropped_lines + r->dropped_points)
        printf("left out: %llu triangles that are not finite, %llu without area on the lattice, %llu lines, %llu points\n",
               (unsigned long long)r->dropped_nonfinite, (unsigned long long)r->dropped_degenerate,
               (unsigned long long)r->dropped_lines, (unsigned long long)r->dropped_points);
    printf("%.1f s, %.2f M triangles a second (%.2f a second of processor), peak memory %.0f MB, scratch %.0f MB\n",
           r->seconds, per_second(r->triangles_in, r->seconds) / 1e6, per_second(r->triangles_in, r->cpu_seconds) / 1e6,
           (double)r->peak_rss_bytes / 1e6, (double)r->scratch_bytes / 1e6);
}

static int run(strl_cli_args *args)
{
    strl_build_desc desc = {0};
    strl_cli_list inputs;
    uint64_t jobs = 0;
    bool json = false;
    const strl_cli_option options[] = {
        {.name = "output", .letter = 'o', .kind = STRL_CLI_STRING, .value = &desc.output, .argument = "OUT.stroll",
         .help = "the container to write; an older one is replaced only when the new one is whole", .required = true},
        {.name = "structure", .kind = STRL_CLI_ENUM, .value = &(int){0}, .argument = "clusters",
         .help = "how detail is arranged (clusters)"},
        {.name = "memory", .letter = 'm', .kind = STRL_CLI_BYTES, .value = &desc.memory_bytes,
         .help = "peak memory of the build (1G)", .least = (double)STRL_BUILD_LEAST_MEMORY, .most = 1e15},
        {.name = "jobs", .letter = 'j', .kind = STRL_CLI_COUNT, .value = &jobs, .help = "threads (one per processor)",
         .least = 1, .most = 256},
        {.name = "scratch", .kind = STRL_CLI_STRING, .value = &desc.scratch, .argument = "DIR",
         .help = "folder in which OUT.stroll.tmp is made for the time of the build (beside the output)"},
        {.name = "grid", .kind = STRL_CLI_REAL, .value = &desc.grid, .argument = "STEP",
         .help = "largest lattice step, model units (chosen from the model)", .least = 1e-300, .most = 1e300},
        {.name = "up", .kind = STRL_CLI_ENUM, .value = &desc.up_axis, .argument = "auto|x|y|z",
         .help = "which axis points up; stored, never applied (auto: what the format says)"},
        {.name = "unit", .kind = STRL_CLI_STRING, .value = &desc.unit, .argument = "m|cm|mm|in|...",
         .help = "length unit; stored, never applied (unknown)"},
        {.name = "no-dependencies", .kind = STRL_CLI_FLAG, .value = &desc.no_dependencies,
         .help = "no shared boundaries simplified before their nodes merge: to measure what that brings"},
        {.name = "json", .kind = STRL_CLI_FLAG, .value = &json, .help = "print one JSON object"},
    };
    const strl_cli_usage usage = {.positional = "INPUT...", .least = 1, .most = UINT32_MAX, .options = options,
                                  .option_count = STRL_CLI_COUNT_OF(options)};
    int stop = strl_cli_parse(args, &usage, &inputs);
    if (stop >= 0)
        return stop;
    strl_cli_progress progress;
    strl_build_result result;
    strl_error err = {0};
    strl_cli_progress_init(&progress, args->quiet);
    desc.inputs = (const char *const *)inputs.items;
    desc.input_count = (uint32_t)inputs.count;
    desc.jobs = (unsigned)jobs;
    desc.progress = show_progress;
    desc.context = &progress;
    strl_cli_catch_interrupts();
    strl_status status = strl_build_clusters(&desc, &result, &err);
    strl_cli_progress_end(&progress);
    if (status)
        return strl_cli_fail(&err);
    if (json)
        return print_json(&result);
    if (!args->quiet)
        print_text(&result, desc.output);
    return 0;
}

STRL_CLI_COMMAND(build, "turn mesh files into one container", run);
