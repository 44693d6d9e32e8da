#include <jansson.h>
#include <stdio.h>
#include <string.h>

#include "stroll/build.h"
#include "build_progress.h"
#include "interrupt.h"
#include "options.h"
#include "remote.h"
#include "shared/importer.h"
#include "shared/units.h"

/* What the build calls back with. */
typedef struct build_watch {
    strl_cli_build_progress progress;
    bool quiet;
} build_watch;

static bool show_progress(void *context, const strl_build_progress *progress)
{
    build_watch *watch = context;
    strl_cli_build_progress_update(&watch->progress, progress);
    return !strl_cli_interrupted();
}

static void show_estimate(void *context, const strl_build_estimate *estimate)
{
    build_watch *watch = context;
    strl_cli_build_progress_estimate(&watch->progress, estimate);
}

static void show_warning(void *context, const char *sentence)
{
    build_watch *watch = context;
    if (watch->quiet)
        return;
    strl_cli_build_progress_end(&watch->progress);
    fprintf(stderr, "stroll: warning: %s\n", sentence);
}

static void format_rate(char text[16], uint64_t count, double seconds)
{
    strl_cli_format_amount(text, seconds > 0 ? (double)count / seconds : 0);
}

/* NULL without memory. */
static json_t *stages_json(const strl_build_result *r)
{
    json_t *stages = json_object();
    for (uint32_t i = 0; i < STRL_BUILD_STAGES; i++)
        if (json_object_set_new(
                stages, strl_build_stage_name(i),
                json_pack("{s:f, s:f}", "seconds", r->stages[i].seconds, "cpu_seconds", r->stages[i].cpu_seconds))) {
            json_decref(stages);
            return NULL;
        }
    return stages;
}

static int print_json(const strl_build_result *r)
{
    uint64_t dropped = r->dropped_nonfinite + r->dropped_degenerate;
    json_t *object = json_pack(
        "{s:I, s:I, s:{s:I, s:I, s:I, s:I, s:I}, s:f, s:{s:I, s:I, s:I}, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:f, s:f, s:f, s:f, s:o, s:I, s:I, s:b, s:I, s:I}",
        "triangles_in", (json_int_t)r->triangles_in, "triangles_leaf", (json_int_t)r->triangles_leaf, "dropped",
        "triangles", (json_int_t)dropped, "nonfinite", (json_int_t)r->dropped_nonfinite, "degenerate",
        (json_int_t)r->dropped_degenerate, "lines", (json_int_t)r->dropped_lines, "points",
        (json_int_t)r->dropped_points, "dropped_longest_edge", r->dropped_longest, "warnings", "missing_libraries",
        (json_int_t)r->missing_libraries, "missing_images", (json_int_t)r->missing_images, "coarse_lattices",
        (json_int_t)r->coarse_lattices, "vertices", (json_int_t)r->vertices, "parts", (json_int_t)r->parts, "materials",
        (json_int_t)r->materials, "placements", (json_int_t)r->placements, "nodes", (json_int_t)r->nodes, "groups",
        (json_int_t)r->groups, "levels", (json_int_t)r->levels, "root_triangles", (json_int_t)r->root_triangles,
        "bytes_out", (json_int_t)r->bytes_out, "step", r->step, "quantisation_error", r->quantisation_error, "seconds",
        r->seconds, "cpu_seconds", r->cpu_seconds, "stages", stages_json(r), "peak_rss_bytes",
        (json_int_t)r->peak_rss_bytes, "scratch_bytes", (json_int_t)r->scratch_bytes, "resumed", r->resumed, "trees",
        (json_int_t)r->trees, "triangles_placed",
        (json_int_t)(r->triangles_placed < INT64_MAX ? r->triangles_placed : INT64_MAX));
    if (!object)
        return strl_cli_fail(&(strl_error){STRL_ERR_MEMORY, "no memory to print the result"});
    json_dumpf(object, stdout, JSON_COMPACT);
    putchar('\n');
    json_decref(object);
    return 0;
}

/* Of a resumed build there is no rate: its seconds are those of the last run. */
static void print_time(const strl_build_result *r)
{
    char rate[16], processor_rate[16];
    format_rate(rate, r->triangles_in, r->seconds);
    format_rate(processor_rate, r->triangles_in, r->cpu_seconds);
    if (r->resumed)
        printf("%.1f s after it was resumed", r->seconds);
    else
        printf("%.1f s, %s triangles a second (%s a second of processor)", r->seconds, rate, processor_rate);
    printf(", peak memory %.0f MiB, scratch %.0f MiB\n", (double)r->peak_rss_bytes / 0x1p20,
           (double)r->scratch_bytes / 0x1p20);
}

static void print_text(const strl_build_result *r, const char *output)
{
    printf("%s: %llu triangle%s in %llu node%s on %u level%s, %.1f MiB", output, (unsigned long long)r->triangles_leaf,
           strl_cli_plural(r->triangles_leaf), (unsigned long long)r->nodes, strl_cli_plural(r->nodes), r->levels,
           strl_cli_plural(r->levels), (double)r->bytes_out / 0x1p20);
    if (r->triangles_leaf)
        printf(" (%.2f bytes a triangle)", (double)r->bytes_out / (double)r->triangles_leaf);
    putchar('\n');
    if (r->trees > 1 || r->placements != 1)
        printf("%u tree%s in %llu placement%s: %llu triangles to be seen\n", r->trees, strl_cli_plural(r->trees),
               (unsigned long long)r->placements, strl_cli_plural(r->placements),
               (unsigned long long)r->triangles_placed);
    if (r->dropped_nonfinite + r->dropped_degenerate + r->dropped_lines + r->dropped_points)
        printf("left out: %llu triangle%s not finite, %llu without area on the lattice, %llu line%s, %llu point%s\n",
               (unsigned long long)r->dropped_nonfinite, strl_cli_plural(r->dropped_nonfinite),
               (unsigned long long)r->dropped_degenerate, (unsigned long long)r->dropped_lines,
               strl_cli_plural(r->dropped_lines), (unsigned long long)r->dropped_points,
               strl_cli_plural(r->dropped_points));
    if (r->dropped_longest > 2 * r->step)
        printf(
            "of those without area the longest edge is %.3g: slivers thinner than the lattice, which claims leave out\n",
            r->dropped_longest);
    if (r->missing_libraries)
        printf("missing: %llu material librar%s, whose materials are white\n", (unsigned long long)r->missing_libraries,
               r->missing_libraries == 1 ? "y" : "ies");
    if (r->missing_images)
        printf("missing: %llu image%s, whose materials have their colours alone\n",
               (unsigned long long)r->missing_images, strl_cli_plural(r->missing_images));
    if (r->coarse_lattices)
        printf("the lattice is coarser than a sixteenth of the short edges\n");
    printf("lattice step %.9g: no point moves by more than %.3g\n", r->step, r->quantisation_error);
    print_time(r);
}

/* What was stopped by a signal says that it was, and how to go on. */
static int fail(const strl_build_result *result, const strl_error *err)
{
    if (err->status != STRL_ERR_CANCELLED || !result->scratch_kept)
        return strl_cli_fail(err);
    fflush(stdout);
    fprintf(stderr, "stroll: interrupted; what is finished is kept: the same command with --resume goes on\n");
    return 1;
}

static int run(strl_cli_args *args)
{
    strl_build_desc desc = {.keep = true};
    strl_cli_list inputs;
    uint64_t jobs = 0;
    bool json = false, unit_given = false;
    int unit = 0, structure = 0;
    const strl_cli_option options[] = {
        {.name = "output",
         .letter = 'o',
         .kind = STRL_CLI_STRING,
         .value = &desc.output,
         .argument = "OUT.stroll",
         .help = "the container to write; an older one is replaced only when the new one is whole",
         .required = true},
        {.name = "structure",
         .kind = STRL_CLI_ENUM,
         .value = &structure,
         .argument = "clusters|samples",
         .help =
             "how detail is arranged: clusters that are simplified, or for what cannot be, a tree of random samples (clusters)"},
        {.name = "probability",
         .kind = STRL_CLI_REAL,
         .value = &desc.probability,
         .argument = "P",
         .help = "of samples: that a cell of one pixel shows one of its visible triangles (1 - 1e-6)",
         .least = 0.01,
         .most = 1 - 1e-15},
        {.name = "memory",
         .letter = 'm',
         .kind = STRL_CLI_BYTES,
         .value = &desc.memory_bytes,
         .help = "peak memory of the build, at least 64M and 2 bytes for each triangle (1G)",
         .least = (double)STRL_BUILD_LEAST_MEMORY,
         .most = 0x1p50},
        {.name = "jobs",
         .letter = 'j',
         .kind = STRL_CLI_COUNT,
         .value = &jobs,
         .help = "threads (one per processor)",
         .least = 1,
         .most = 256},
        {.name = "scratch",
         .kind = STRL_CLI_STRING,
         .value = &desc.scratch,
         .argument = "DIR",
         .help =
             "folder in which OUT.stroll.tmp is made, with it where missing, until the build is done (beside the output)"},
        {.name = "resume",
         .kind = STRL_CLI_FLAG,
         .value = &desc.resume,
         .help =
             "go on where the same build was killed, interrupted or met a full disk; not of models with placements (from the beginning)"},
        {.name = "grid",
         .kind = STRL_CLI_REAL,
         .value = &desc.grid,
         .argument = "STEP",
         .help =
             "largest lattice step, model units; one below a 2^30th of the extent is refused (chosen from the model)",
         .least = 1e-300,
         .most = 1e300},
        {.name = "compact",
         .kind = STRL_CLI_FLAG,
         .value = &desc.compact,
         .help =
             "for the network: a lattice step of at most a 32nd of the median edge unless --grid is given, normals of 2 x 8 bits"},
        {.name = "up",
         .kind = STRL_CLI_ENUM,
         .value = &desc.up_axis,
         .argument = "auto|x|y|z",
         .help =
             "which axis points up; stored, never applied (auto: y for glTF and OBJ, z for PLY and STL, what the importer says for others)"},
        {.name = "unit",
         .kind = STRL_CLI_ENUM,
         .value = &unit,
         .given = &unit_given,
         .argument = STRL_UNITS,
         .help = "length unit; stored, never applied (metres for glTF, else unknown)"},
        {.name = "certify",
         .kind = STRL_CLI_FLAG,
         .value = &desc.certify,
         .help =
             "measure each node against older surfaces and claim what was found: errors that are mostly tighter, for 20 to 45 % more time"},
        {.name = "no-dependencies",
         .kind = STRL_CLI_FLAG,
         .value = &desc.no_dependencies,
         .help = "no shared boundaries simplified before their nodes merge: to measure what that brings"},
        {.name = "json", .kind = STRL_CLI_FLAG, .value = &json, .help = "print one JSON object"},
    };
    const strl_cli_usage usage = {.positional = "INPUT...",
                                  .least = 1,
                                  .most = UINT32_MAX,
                                  .options = options,
                                  .option_count = STRL_CLI_COUNT_OF(options)};
    int stop = strl_cli_parse(args, &usage, &inputs);
    if (stop >= 0)
        return stop;
    build_watch watch = {.quiet = args->quiet};
    strl_build_result result;
    strl_error err = {0};
    strl_cli_build_progress_init(&watch.progress, args->quiet);
    desc.inputs = (const char *const *)inputs.items;
    desc.input_count = (uint32_t)inputs.count;
    desc.jobs = (unsigned)jobs;
    desc.importer = strl_importer();
    desc.unit = unit_given ? strl_unit_name(unit) : NULL;
    desc.progress = show_progress;
    desc.estimate = show_estimate;
    desc.warn = show_warning;
    desc.context = &watch;
    strl_cli_catch_interrupts();
    strl_status status = strl_cli_check_files("build", desc.inputs, desc.input_count, &err);
    if (!status)
        status = structure ? strl_build_samples(&desc, &result, &err) : strl_build_clusters(&desc, &result, &err);
    strl_cli_build_progress_end(&watch.progress);
    if (status)
        return fail(&result, &err);
    if (json)
        return print_json(&result);
    if (!args->quiet)
        print_text(&result, desc.output);
    return 0;
}

STRL_CLI_COMMAND(build, "turn mesh files into one container", run);
