/* stroll bench: how fast this program is on this machine, on a generated model in a temporary folder. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "bench.h"
#include "interrupt.h"
#include "options.h"
#include "platform/file.h"
#include "platform/thread.h"

#define SCENE_LEAST 1000.0
#define SCENE_MOST 4e9

static const strl_bench_entry entries[] = {
    {"scene", "writing a generated model", strl_bench_scene},
    {"read", "reading it as triangles", strl_bench_read},
    {"build", "building its container: on one thread, on all, peak memory", strl_bench_build},
    {"decode", "decoding the payloads of the container's nodes", strl_bench_decode},
    {"select", "selecting and refining the front, per frame of a smooth path", strl_bench_select},
    {"draw", "whole frames of the same path, from camera to finished pixels", strl_bench_draw},
};

/* ---- what the measurements share */

strl_status strl_bench_add_figure(strl_bench *bench, const char *name, const char *unit, strl_bench_figure **figure,
                                  strl_error *err)
{
    if (bench->figure_count == STRL_BENCH_MOST_FIGURES)
        return strl__fail(err, STRL_ERR_INTERNAL, "more than %u figures", STRL_BENCH_MOST_FIGURES);
    *figure = &bench->figures[bench->figure_count];
    **figure = (strl_bench_figure){.name = name, .unit = unit, .values = strl__alloc(bench->runs, sizeof(double))};
    if (!(*figure)->values)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %u runs", bench->runs);
    bench->figure_count++;
    return STRL_OK;
}

strl_status strl_bench_check(const strl_bench *bench, const char *what, unsigned run, strl_error *err)
{
    strl_cli_progress_update(bench->progress, what, run, bench->runs, "runs");
    return bench->stopped() ? strl__fail(err, STRL_ERR_CANCELLED, "stopped while measuring %s", what) : STRL_OK;
}

/* ---- the temporary folder */

static strl_status make_folder(strl_bench *bench, const char *parent, strl_error *err)
{
    bench->folder = strl_path_join(parent, "stroll-bench-XXXXXX");
    if (!bench->folder)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a path");
    strl_status status = strl_path_make_temporary(bench->folder, err);
    if (status != STRL_OK) {
        strl__free(bench->folder);
        bench->folder = NULL;
        return status;
    }
    bench->scene = strl_path_join(bench->folder, "scene.ply");
    bench->container = strl_path_join(bench->folder, "scene.stroll");
    return bench->scene && bench->container ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "no memory for a path");
}

/* An interrupted build keeps its scratch folder, which is inside ours. */
static strl_status remove_folder(const strl_bench *bench, strl_error *err)
{
    char *scratch = strl_path_join(bench->folder, "scene.stroll.tmp");
    strl_status status =
        scratch ? strl_path_remove_directory(scratch, err) : strl__fail(err, STRL_ERR_MEMORY, "no memory for a path");
    if (status == STRL_OK)
        status = strl_path_remove_directory(bench->folder, err);
    strl__free(scratch);
    return status;
}

static void bench_deinit(strl_bench *bench)
{
    for (size_t f = 0; f < bench->figure_count; f++)
        strl__free(bench->figures[f].values);
    strl__free(bench->scene);
    strl__free(bench->container);
    strl__free(bench->folder);
}

/* ---- the command */

/* wanted: a bit for each entry. */
static strl_status run_entries(strl_bench *bench, unsigned wanted, const char *parent, strl_error *err)
{
    strl_error leftover;
    strl_status status = make_folder(bench, parent, err);
    for (size_t e = 0; status == STRL_OK && e < STRL_CLI_COUNT_OF(entries); e++)
        if (wanted & 1u << e)
            status = entries[e].run(bench, err);
    strl_cli_progress_end(bench->progress);
    if (bench->folder && remove_folder(bench, &leftover) != STRL_OK && status == STRL_OK) {
        *err = leftover;
        status = leftover.status;
    }
    return status;
}

/* The entries of the words, all where there are none. Returns -1 to go on, else the exit status. */
static int choose(const strl_cli_args *args, const strl_cli_list *names, unsigned *wanted)
{
    *wanted = names->count ? 0 : (1u << STRL_CLI_COUNT_OF(entries)) - 1;
    for (size_t n = 0; n < names->count; n++) {
        size_t e = 0;
        while (e < STRL_CLI_COUNT_OF(entries) && strcmp(entries[e].name, names->items[n]))
            e++;
        if (e == STRL_CLI_COUNT_OF(entries))
            return strl_cli_usage_error(args, "there is no benchmark \"%s\"", names->items[n]);
        *wanted |= 1u << e;
    }
    return -1;
}

static void describe_entries(char *text, size_t size)
{
    size_t used = (size_t)snprintf(text, size, "Without a name all are run, in this order:\n");
    for (size_t e = 0; used < size && e < STRL_CLI_COUNT_OF(entries); e++)
        used += (size_t)snprintf(text + used, size - used, "  %-8s %s\n", entries[e].name, entries[e].summary);
}

static int run_and_print(strl_cli_args *args, strl_bench *bench, unsigned wanted, const char *parent, bool json)
{
    strl_error err = {0};
    strl_cli_progress progress;
    strl_cli_progress_init(&progress, args->quiet);
    bench->progress = &progress;
    bench->stopped = strl_cli_interrupted;
    strl_cli_catch_interrupts();
    strl_status status = run_entries(bench, wanted, parent, &err);
    if (status == STRL_OK && json)
        status = strl_bench_print_json(bench, &err);
    else if (status == STRL_OK)
        strl_bench_print_text(bench);
    bench_deinit(bench);
    return status == STRL_OK ? 0 : strl_cli_fail(&err);
}

static int run(strl_cli_args *args)
{
    char notes[1024];
    describe_entries(notes, sizeof notes);
    const char *temporary = getenv("TMPDIR"), *parent = temporary && *temporary ? temporary : "/tmp";
    uint64_t triangles = 1000000, runs = 3, jobs = strl_cpu_count();
    int cull = STRL_CULL_NONE;
    bool json = false;
    unsigned wanted;
    strl_cli_list names;
    const strl_cli_option options[] = {
        {.name = "triangles",
         .letter = 'n',
         .kind = STRL_CLI_COUNT,
         .value = &triangles,
         .help = "of the model, K M G are powers of 1000 (1M)",
         .least = SCENE_LEAST,
         .most = SCENE_MOST},
        {.name = "runs",
         .kind = STRL_CLI_COUNT,
         .value = &runs,
         .help = "of each measurement (3)",
         .least = 1,
         .most = 1000},
        {.name = "jobs",
         .letter = 'j',
         .kind = STRL_CLI_COUNT,
         .value = &jobs,
         .help = "threads of scene and build (all processors)",
         .least = 1,
         .most = 256},
        {.name = "cull",
         .kind = STRL_CLI_ENUM,
         .value = &cull,
         .argument = "none|back",
         .help = "faces that select and draw leave out (none)"},
        {.name = "scratch",
         .kind = STRL_CLI_STRING,
         .value = &parent,
         .argument = "DIR",
         .help = "where the temporary folder is made (TMPDIR or /tmp)"},
        {.name = "json", .kind = STRL_CLI_FLAG, .value = &json, .help = "print one JSON object"},
    };
    const strl_cli_usage usage = {.positional = "[NAME...]",
                                  .most = SIZE_MAX,
                                  .notes = notes,
                                  .options = options,
                                  .option_count = STRL_CLI_COUNT_OF(options)};
    int stop = strl_cli_parse(args, &usage, &names);
    if (stop < 0)
        stop = choose(args, &names, &wanted);
    if (stop >= 0)
        return stop;
    strl_bench bench = {
        .triangles = triangles, .runs = (unsigned)runs, .jobs = (unsigned)jobs, .cull = (strl_cull)cull};
    return run_and_print(args, &bench, wanted, parent, json);
}

STRL_CLI_COMMAND(bench, "measure this machine on a generated model", run);
