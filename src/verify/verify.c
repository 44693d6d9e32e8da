#include "verify/verify.h"

#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "verify/cracks.h"
#include "verify/distances.h"

strl_status strl__v_report(strl__model *model, const char *stage, uint64_t done, uint64_t total, strl_error *err)
{
    const strl_verify_desc *desc = model->desc;
    if (!desc->progress || desc->progress(desc->context, stage, done, total))
        return STRL_OK;
    return strl__fail(err, STRL_ERR_CANCELLED, "cancelled");
}

static bool any_flaw(strl__model *model, strl_verify_kind first, strl_verify_kind last)
{
    for (unsigned kind = first; kind <= last; kind++)
        if (strl__v_flawed(model->checks, kind))
            return true;
    return false;
}

static void check_totals(strl__model *model, strl_verify_report *report)
{
    for (uint32_t t = 0; t < model->tree_count; t++) {
        report->triangles_leaf += model->trees[t].triangle_count;
        report->nodes += model->trees[t].node_count;
        report->groups += model->trees[t].group_count;
    }
    report->trees = model->tree_count;
    report->triangles_in = model->triangles_in;
    strl__v_checked(model->checks, STRL_VERIFY_COUNTS, 1);
    uint64_t accounted = report->triangles_leaf + model->dropped_nonfinite + model->dropped_degenerate;
    if (model->triangles_in != accounted)
        strl__v_flaw(
            model->checks, STRL_VERIFY_COUNTS, 0,
            "header: %llu triangles came in, the leaves have %llu, %llu not finite and %llu degenerate ones were "
            "dropped",
            (unsigned long long)model->triangles_in, (unsigned long long)report->triangles_leaf,
            (unsigned long long)model->dropped_nonfinite, (unsigned long long)model->dropped_degenerate);
}

/* Header to records. *sound: all records can be relied on as far as indexing goes. */
static strl_status read_structure(strl__model *model, strl_verify_report *report, bool *sound, strl_error *err)
{
    strl_status status = strl__v_read_header(model, sound, err);
    if (status == STRL_OK && *sound)
        status = strl__v_read_trees(model, sound, err);
    if (status == STRL_OK && *sound)
        status = strl__v_read_tables(model, err);
    for (uint32_t t = 0; status == STRL_OK && *sound && t < model->tree_count; t++) {
        status = strl__v_read_records(model, &model->trees[t], sound, err);
        if (status == STRL_OK && *sound)
            status = strl__v_check_structure(model, &model->trees[t], err);
    }
    if (status == STRL_OK && *sound)
        check_totals(model, report);
    *sound = *sound && !strl__v_flawed(model->checks, STRL_VERIFY_PAGES) &&
             !strl__v_flawed(model->checks, STRL_VERIFY_GROUPS);
    return status;
}

/* Every payload, and what compares them. Cracks need sound payloads. */
static strl_status check_tree(strl__model *model, strl__vtree *tree, strl_verify_report *report, bool *sound,
                              strl_error *err)
{
    strl__boundary boundary = {0};
    strl_status status = strl__v_check_contents(model, tree, err);
    *sound = !any_flaw(model, STRL_VERIFY_HEADER, STRL_VERIFY_PAYLOADS);
    if (status != STRL_OK || !*sound || !strl__replaces(tree))
        return status;
    if (tree->structure == 1)
        strl__v_check_unions(model, tree, &report->unions_exempt);
    status = strl__v_boundary_find(model, tree, &boundary, err);
    report->open_edges += boundary.open_edges;
    if (status == STRL_OK)
        status = strl__v_check_cracks(model, tree, &boundary, report, err);
    strl__v_boundary_deinit(&boundary);
    return status;
}

static void check_closed(strl__model *model, strl_verify_report *report)
{
    report->closed = report->open_edges == 0;
    strl__v_checked(model->checks, STRL_VERIFY_CLOSED, 1);
    if (model->closed && !report->closed)
        strl__v_flaw(model->checks, STRL_VERIFY_CLOSED, 0,
                     "header: the input is said to be closed, its leaves have %llu open edges",
                     (unsigned long long)report->open_edges);
}

static void add_totals(strl__vinput *total, const strl__vinput *input)
{
    total->triangles += input->triangles;
    total->nonfinite += input->nonfinite;
    total->degenerate += input->degenerate;
    total->lines += input->lines;
    total->points += input->points;
}

static strl_status compare_tree(strl__model *model, strl__vtree *tree, const strl__vpiece *piece, strl__vinput *total,
                                strl_verify_report *report, strl_error *err)
{
    strl__vinput input;
    strl_status status = strl__v_input_read(model, tree, piece, &input, err);
    if (status == STRL_OK) {
        add_totals(total, &input);
        strl__v_check_leaves(model, tree, &input);
    }
    /* in the others nothing moves but onto the lattice */
    if (status == STRL_OK && strl__replaces(tree) && input.kept)
        status = strl__v_check_distances(model, tree, &input, report, err);
    strl__v_input_deinit(&input);
    return status;
}

/* Of several trees the figures of cuts and levels are those of the tree whose claims are nearest to being broken. */
static void keep_worse(strl_verify_report *report, strl_verify_report *one)
{
    bool worse = one->uniform_count &&
                 (!report->uniform_count || (one->worst_claimed_over_measured > 0 &&
                                             (report->worst_claimed_over_measured == 0 ||
                                              one->worst_claimed_over_measured < report->worst_claimed_over_measured)));
    if (worse) {
        strl_verify_report_deinit(report);
        memcpy(report->uniform, one->uniform, sizeof report->uniform);
        report->uniform_count = one->uniform_count;
        report->levels = one->levels;
        report->level_count = one->level_count;
        report->claimed_over_measured_median = one->claimed_over_measured_median;
        report->most_claimed_over_measured_of_levels = one->most_claimed_over_measured_of_levels;
        report->worst_claimed_over_measured = one->worst_claimed_over_measured;
        one->levels = NULL;
    }
    strl_verify_report_deinit(one);
}

static strl_status compare_trees(strl__model *model, strl__vpieces *pieces, strl_verify_report *report, strl_error *err)
{
    strl__vinput total = {0};
    strl_status status = STRL_OK;
    for (uint32_t t = 0; status == STRL_OK && t < model->tree_count; t++) {
        strl_verify_report one = {0};
        status = compare_tree(model, &model->trees[t], &pieces->items[t], &total, &one, err);
        keep_worse(report, &one);
    }
    total.nonfinite += pieces->nonfinite;
    total.triangles += pieces->nonfinite;
    if (status == STRL_OK)
        strl__v_check_drops(model, &total);
    return status;
}

static strl_status compare_input(strl__model *model, strl_verify_report *report, strl_error *err)
{
    strl__vpieces pieces = {0};
    bool comparable = false;
    strl_status status = strl__v_pieces_list(model, &pieces, err);
    if (status == STRL_OK)
        status = strl__v_check_placements(model, &pieces, &comparable, err);
    if (status == STRL_OK && comparable)
        status = compare_trees(model, &pieces, report, err);
    strl__v_pieces_deinit(&pieces);
    return status;
}

static strl_status check_all(strl__model *model, strl_verify_report *report, strl_error *err)
{
    bool sound;
    strl_status status = read_structure(model, report, &sound, err);
    for (uint32_t t = 0; status == STRL_OK && sound && t < model->tree_count; t++)
        status = check_tree(model, &model->trees[t], report, &sound, err);
    if (status == STRL_OK && sound)
        status = strl__v_check_run_areas(model, err);
    if (status != STRL_OK || !sound)
        return status;
    if (strl__replaces(&model->trees[0]))
        check_closed(model, report);
    return model->desc->input_count ? compare_input(model, report, err) : STRL_OK;
}

static strl_status check_desc(const strl_verify_desc *desc, strl_error *err)
{
    if (desc->memory_bytes && desc->memory_bytes < STRL_VERIFY_LEAST_MEMORY)
        return strl__fail(err, STRL_ERR_ARGUMENT, "--memory is %llu bytes, the least is %llu",
                          (unsigned long long)desc->memory_bytes, (unsigned long long)STRL_VERIFY_LEAST_MEMORY);
    if (desc->input_count && !desc->scratch_dir)
        return strl__fail(err, STRL_ERR_ARGUMENT, "comparing with an input needs a scratch folder");
    return STRL_OK;
}

strl_status strl_verify_run(const strl_verify_desc *desc, strl_verify_report *report, strl_error *err)
{
    strl__checks checks;
    strl__model model = {
        .desc = desc, .checks = &checks, .memory_bytes = desc->memory_bytes ? desc->memory_bytes : 1u << 30};
    unsigned jobs = desc->jobs ? desc->jobs : strl_cpu_count();
    *report = (strl_verify_report){0};
    strl__v_checks_init(&checks);
    strl_status status = check_desc(desc, err);
    if (status == STRL_OK)
        status = strl_pool_create(jobs - 1, &model.pool, err); /* the caller works too */
    if (status == STRL_OK)
        status = strl_file_open(desc->model, &model.file, err);
    if (status == STRL_OK)
        status = check_all(&model, report, err);
    strl__v_checks_report(&checks, report);
    report->ok = report->ok && status == STRL_OK;
    strl__v_trees_deinit(&model);
    strl_file_close(model.file, NULL);
    strl_pool_destroy(model.pool);
    strl__v_checks_deinit(&checks);
    return status;
}

void strl_verify_report_deinit(strl_verify_report *report)
{
    strl__free(report->levels);
    report->levels = NULL;
}
