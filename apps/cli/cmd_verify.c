/* stroll verify: proves that a container is what it claims to be. */
#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "interrupt.h"
#include "options.h"
#include "platform/file.h"
#include "progress.h"
#include "remote.h"
#include "shared/importer.h"
#include "verify/verify.h"

static bool show_progress(void *context, const char *stage, uint64_t done, uint64_t total)
{
    strl_cli_progress_update(context, stage, done, total, "steps");
    return !strl_cli_interrupted();
}

/* ---- for people ---- */

static void print_checks(const strl_verify_report *report)
{
    for (unsigned kind = 0; kind < STRL_VERIFY_KINDS; kind++) {
        const strl_verify_check *check = &report->checks[kind];
        if (check->failures)
            printf("%-16s %12" PRIu64 " looked at, FAILED %" PRIu64 ": %s\n", strl_verify_name((strl_verify_kind)kind),
                   check->count, check->failures, check->first);
        else if (check->done)
            printf("%-16s %12" PRIu64 " looked at, good\n", strl_verify_name((strl_verify_kind)kind), check->count);
        else
            printf("%-16s %12s not looked at\n", strl_verify_name((strl_verify_kind)kind), "");
    }
}

static void print_cut(const char *name, uint32_t number, const strl_verify_cut *cut)
{
    double ratio = strl_verify_ratio(cut);
    char text[32] = "-"; /* nothing to measure: what was simplified was flat */
    if (ratio > 0)
        snprintf(text, sizeof text, "%.3g", ratio);
    printf("%s %2u: error %.6g, claimed %.6g, measured %.6g from the input and %.6g to it, rms %.6g, ratio %s, %" PRIu64
           " triangles\n",
           name, number, cut->error, cut->claimed, cut->from_input, cut->to_input, cut->rms, text, cut->triangles);
}

static void print_report(const char *model, const strl_verify_report *report)
{
    print_checks(report);
    if (report->cuts) {
        printf("%" PRIu64 " open edges in the leaves; %u view-dependent cuts of %" PRIu64 " triangles: %u cracked",
               report->open_edges, report->cuts, report->cut_triangles, report->cracked_cuts);
        printf("; %" PRIu64 " nodes by vertex clustering, %" PRIu64 " edges left out\n", report->clustered_nodes,
               report->excluded_edges);
    }
    for (uint32_t i = 0; i < report->uniform_count; i++)
        print_cut("cut", i, &report->uniform[i]);
    for (uint32_t i = 0; i < report->level_count; i++)
        print_cut("level", i, &report->levels[i]);
    if (report->uniform_count)
        printf("claimed over measured: median %.3g, least %.3g; of levels at most %.3g\n",
               report->claimed_over_measured_median, report->worst_claimed_over_measured,
               report->most_claimed_over_measured_of_levels);
    printf("%s: %s\n", model, report->ok ? "good" : "NOT good");
}

/* ---- for programs ---- */

static json_t *json_checks(const strl_verify_report *report)
{
    json_t *checks = json_object();
    for (unsigned kind = 0; kind < STRL_VERIFY_KINDS; kind++) {
        const strl_verify_check *check = &report->checks[kind];
        json_t *entry = json_pack("{s:b, s:I, s:I}", "done", (int)check->done, "count", (json_int_t)check->count,
                                  "failures", (json_int_t)check->failures);
        if (check->failures)
            json_object_set_new(entry, "first", json_string(check->first));
        json_object_set_new(checks, strl_verify_name((strl_verify_kind)kind), entry);
    }
    return checks;
}

static json_t *json_cuts(const strl_verify_cut *cuts, uint32_t count)
{
    json_t *array = json_array();
    for (uint32_t i = 0; i < count; i++) {
        const strl_verify_cut *cut = &cuts[i];
        json_array_append_new(array,
                              json_pack("{s:f, s:f, s:f, s:f, s:f, s:f, s:I, s:I, s:I}", "error", cut->error, "claimed",
                                        cut->claimed, "measured_from_input", cut->from_input, "measured_to_input",
                                        cut->to_input, "rms", cut->rms, "claimed_over_measured", strl_verify_ratio(cut),
                                        "nodes", (json_int_t)cut->nodes, "triangles", (json_int_t)cut->triangles,
                                        "points", (json_int_t)cut->points));
    }
    return array;
}

static bool set_new(json_t *object, const char *key, json_t *value)
{
    return json_object_set_new(object, key, value) == 0;
}

static strl_status print_json(const strl_verify_report *report, strl_error *err)
{
    json_t *root = json_object();
    bool good = set_new(root, "ok", json_boolean(report->ok)) && set_new(root, "checks", json_checks(report)) &&
                set_new(root, "trees", json_integer((json_int_t)report->trees)) &&
                set_new(root, "nodes", json_integer((json_int_t)report->nodes)) &&
                set_new(root, "groups", json_integer((json_int_t)report->groups)) &&
                set_new(root, "triangles_in", json_integer((json_int_t)report->triangles_in)) &&
                set_new(root, "triangles_leaf", json_integer((json_int_t)report->triangles_leaf)) &&
                set_new(root, "closed", json_boolean(report->closed)) &&
                set_new(root, "open_edges", json_integer((json_int_t)report->open_edges)) &&
                set_new(root, "cuts", json_integer(report->cuts)) &&
                set_new(root, "cut_triangles", json_integer((json_int_t)report->cut_triangles)) &&
                set_new(root, "cracked_cuts", json_integer(report->cracked_cuts)) &&
                set_new(root, "cracks", json_integer((json_int_t)report->cracks)) &&
                set_new(root, "clustered_nodes", json_integer((json_int_t)report->clustered_nodes)) &&
                set_new(root, "excluded_edges", json_integer((json_int_t)report->excluded_edges)) &&
                set_new(root, "unions_exempt", json_integer((json_int_t)report->unions_exempt));
    if (report->uniform_count)
        good = good && set_new(root, "uniform_cuts", json_cuts(report->uniform, report->uniform_count)) &&
               set_new(root, "levels", json_cuts(report->levels, report->level_count)) &&
               set_new(root, "claimed_over_measured_median", json_real(report->claimed_over_measured_median)) &&
               set_new(root, "claimed_over_measured_levels_most",
                       json_real(report->most_claimed_over_measured_of_levels)) &&
               set_new(root, "claimed_over_measured_least", json_real(report->worst_claimed_over_measured));
    if (good)
        good = json_dumpf(root, stdout, JSON_INDENT(1) | JSON_PRESERVE_ORDER) == 0 && putchar('\n') != EOF;
    json_decref(root);
    return good ? STRL_OK : strl__fail(err, STRL_ERR_IO, "cannot write the report");
}

/* ---- running ---- */

/* Where files without names go: the user's folder, which is made where it is missing, or the model's, where there is
 * room for what belongs to it. */
static strl_status find_scratch(const char *model, const char *wanted, char **folder, bool *made, strl_error *err)
{
    const char *slash = strrchr(model, '/');
    *folder = strl__strdup(wanted ? wanted : slash ? model : ".");
    if (!*folder)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a path");
    if (!wanted && slash)
        (*folder)[slash == model ? 1 : slash - model] = 0;
    *made = wanted && !strl_path_exists(wanted);
    return wanted ? strl_path_make_directory(wanted, err) : STRL_OK;
}

static strl_status verify(strl_cli_args *args, strl_verify_desc *desc, const char *scratch, strl_verify_report *report,
                          strl_error *err)
{
    strl_cli_progress line;
    char *folder = NULL;
    bool made = false;
    strl_status status = desc->input_count ? find_scratch(desc->model, scratch, &folder, &made, err) : STRL_OK;
    strl_cli_catch_interrupts();
    strl_cli_progress_init(&line, args->quiet);
    desc->scratch_dir = folder;
    desc->progress = show_progress;
    desc->context = &line;
    if (status == STRL_OK)
        status = strl_verify_run(desc, report, err);
    strl_cli_progress_end(&line);
    if (made)
        strl_path_remove_if_empty(folder);
    strl__free(folder);
    return status;
}

static int verify_and_print(strl_cli_args *args, strl_verify_desc *desc, const char *scratch, bool json)
{
    strl_error err;
    strl_verify_report report = {0};
    strl_status status = strl_cli_check_files("verify", &desc->model, 1, &err);
    if (status == STRL_OK)
        status = strl_cli_check_files("verify", desc->inputs, desc->input_count, &err);
    if (status == STRL_OK)
        status = verify(args, desc, scratch, &report, &err);
    if (status == STRL_OK && json)
        status = print_json(&report, &err);
    else if (status == STRL_OK && (!args->quiet || !report.ok))
        print_report(desc->model, &report);
    int result = status != STRL_OK ? strl_cli_fail(&err) : 0;
    if (status == STRL_OK && !report.ok) {
        unsigned kind = 0;
        while (kind + 1 < STRL_VERIFY_KINDS && report.checks[kind].failures == 0)
            kind++;
        strl__fail(&err, STRL_ERR_FORMAT, "%s: %s", desc->model, report.checks[kind].first);
        result = strl_cli_fail(&err);
    }
    strl_verify_report_deinit(&report);
    return result;
}

static int run(strl_cli_args *args)
{
    bool json = false;
    const char *scratch = NULL;
    uint64_t memory = 1u << 30, jobs = 0, cuts = 200, seed = 0;
    strl_cli_list models, inputs = {0};
    const strl_cli_option options[] = {
        {.name = "against",
         .kind = STRL_CLI_LIST,
         .value = &inputs,
         .argument = "INPUT...",
         .help = "measure against the files it was built from"},
        {.name = "memory",
         .letter = 'm',
         .kind = STRL_CLI_BYTES,
         .value = &memory,
         .help = "peak memory (1G)",
         .least = (double)STRL_VERIFY_LEAST_MEMORY,
         .most = 0x1p50},
        {.name = "jobs",
         .letter = 'j',
         .kind = STRL_CLI_COUNT,
         .value = &jobs,
         .help = "threads (all processors)",
         .least = 1,
         .most = 1024},
        {.name = "cuts",
         .kind = STRL_CLI_COUNT,
         .value = &cuts,
         .help = "view-dependent cuts looked at for cracks (200)",
         .least = 1,
         .most = 100000},
        {.name = "seed", .kind = STRL_CLI_COUNT, .value = &seed, .help = "of random cuts and samples (0)"},
        {.name = "scratch",
         .kind = STRL_CLI_STRING,
         .value = &scratch,
         .argument = "DIR",
         .help = "folder for temporary files of --against, made for the time where it is missing (beside MODEL)"},
        {.name = "json", .kind = STRL_CLI_FLAG, .value = &json, .help = "print one JSON object"},
    };
    const strl_cli_usage usage = {
        .positional = "MODEL",
        .least = 1,
        .most = 1,
        .options = options,
        .option_count = STRL_CLI_COUNT_OF(options),
        .notes = "--against takes all words up to the next option: put MODEL before it, or after \"--\":\n"
                 "  stroll verify MODEL --against INPUT...\n"
                 "  stroll verify --against INPUT... -- MODEL"};
    int stop = strl_cli_parse(args, &usage, &models);
    if (stop >= 0)
        return stop;
    strl_verify_desc desc = {.model = models.items[0],
                             .inputs = (const char *const *)inputs.items,
                             .input_count = (uint32_t)inputs.count,
                             .importer = strl_importer(),
                             .memory_bytes = memory,
                             .jobs = (unsigned)jobs,
                             .cuts = (uint32_t)cuts,
                             .seed = seed};
    return verify_and_print(args, &desc, scratch, json);
}

STRL_CLI_COMMAND(verify, "prove that a container is what it claims to be", run);
