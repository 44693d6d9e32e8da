#include "verify/distances.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/fail.h"

/* Of a claim: a distance so small is the rounding of what measures it. */
#define NOTHING_SHARE 1e-9

typedef struct comparison {
    strl__model *model;
    const strl__vtree *tree;
    strl__vinput *input;
    uint64_t *active;
    strl__measured *of_input; /* [input chunks] */
    strl__measured *of_cut;   /* [nodes] */
    uint64_t seed;            /* of the next cut */
} comparison;

/* Larger than anything that rounding explains. */
static double most_allowed(const comparison *self, double claimed)
{
    return claimed * (1 + 1e-9) + self->input->rounding;
}

static void worst_of(const strl__measured *results, uint32_t count, strl__measured *total)
{
    *total = (strl__measured){0};
    for (uint32_t i = 0; i < count; i++) {
        total->sum += results[i].sum;
        total->points += results[i].points;
        total->claimed = fmax(total->claimed, results[i].claimed);
        if (results[i].most > total->most) {
            total->most = results[i].most;
            memcpy(total->worst, results[i].worst, sizeof total->worst);
        }
        if (results[i].excess > total->excess) {
            total->excess = results[i].excess;
            memcpy(total->most_excessive, results[i].most_excessive, sizeof total->most_excessive);
        }
    }
}

static void check_most(comparison *self, uint64_t key, const char *name, const char *direction,
                       const strl__measured *measured, double claimed)
{
    const strl__vtree *tree = self->tree;
    strl__v_checked(self->model->checks, STRL_VERIFY_DISTANCES, measured->points);
    if (measured->most <= most_allowed(self, claimed))
        return;
    double p[3];
    for (unsigned k = 0; k < 3; k++)
        p[k] = tree->origin[k] + tree->step * measured->worst[k];
    strl__v_flaw(self->model->checks, STRL_VERIFY_DISTANCES, key, "%s: %s at %g %g %g is %g, above the claim of %g",
                 name, direction, p[0], p[1], p[2], measured->most * tree->step, claimed * tree->step);
}

/* A point of the input is no farther from some node than that node claims, whatever others do. */
static void check_excess(comparison *self, uint64_t key, const char *name, const strl__measured *from, double claimed)
{
    const strl__vtree *tree = self->tree;
    double p[3];
    if (from->excess <= claimed * 1e-9 + self->input->rounding)
        return;
    for (unsigned k = 0; k < 3; k++)
        p[k] = tree->origin[k] + tree->step * from->most_excessive[k];
    strl__v_flaw(self->model->checks, STRL_VERIFY_DISTANCES, key,
                 "%s: the input's point at %g %g %g is farther from every node than it claims, by %g at least", name,
                 p[0], p[1], p[2], from->excess * tree->step);
}

/* Each node's own claim, towards the input. */
static void check_nodes(comparison *self, uint64_t key, const char *name, const strl__cut_surface *cut)
{
    for (uint32_t i = 0; i < cut->surface.count; i++) {
        char where[96];
        if (self->of_cut[i].most <= most_allowed(self, self->of_cut[i].claimed))
            continue;
        snprintf(where, sizeof where, "%s, node %u", name, cut->nodes[i]);
        check_most(self, key, where, "the distance from the input", &self->of_cut[i], self->of_cut[i].claimed);
    }
}

static void fill_in(const comparison *self, const strl__cut_surface *cut, const strl__measured *from,
                    const strl__measured *to, strl_verify_cut *out)
{
    double step = self->tree->step;
    out->claimed = to->claimed * step;
    out->from_input = from->most * step;
    out->to_input = to->most * step;
    out->points = from->points + to->points;
    out->rms = out->points ? sqrt((from->sum + to->sum) / (double)out->points) * step : 0;
    out->nodes = cut->surface.count;
    out->triangles = 0;
    for (uint32_t i = 0; i < cut->surface.count; i++)
        out->triangles += cut->triangles[i];
}

/* Half of what is left of the memory for each of the two surfaces. */
static uint64_t surface_budget(const strl__model *model)
{
    return (model->memory_bytes - model->memory_bytes / 3 - model->record_bytes) / 2;
}

static strl_status compare(comparison *self, uint64_t key, const char *name, strl__cut_surface *cut,
                           strl_verify_cut *out, strl_error *err)
{
    strl__measured from, to;
    strl__surface *input = &self->input->surface;
    cut->surface.budget = input->budget = surface_budget(self->model);
    strl_status status =
        strl__v_measure(self->model, input, &cut->surface, strl__mix64(self->seed++), self->of_input, err);
    if (status == STRL_OK)
        status = strl__v_measure(self->model, &cut->surface, input, strl__mix64(self->seed++), self->of_cut, err);
    if (status != STRL_OK)
        return status;
    worst_of(self->of_input, input->count, &from);
    worst_of(self->of_cut, cut->surface.count, &to);
    fill_in(self, cut, &from, &to, out);
    check_most(self, key, name, "the distance of the input's point", &from, to.claimed);
    check_excess(self, key, name, &from, to.claimed);
    check_most(self, key, name, "the distance from the input", &to, to.claimed);
    check_nodes(self, key, name, cut);
    return STRL_OK;
}

/* The errors at both ends: all leaves in their finest state, the root in its base state. */
static void error_range(const strl__vtree *tree, double *least, double *most)
{
    *least = 0;
    for (uint32_t id = 0; id < tree->node_count; id++)
        if (tree->nodes[id].child_count == 0)
            *least = fmax(*least, tree->nodes[id].geometric_min);
    *most = fmax(*least, tree->nodes[0].geometric_max);
}

static strl_status compare_uniform(comparison *self, uint32_t number, strl_verify_cut *out, strl_error *err)
{
    double least, most, last = STRL_VERIFY_UNIFORM_CUTS - 1;
    char name[64];
    error_range(self->tree, &least, &most);
    double limit =
        number == 0 || !(least > 0) ? least + (most - least) * number / last : least * pow(most / least, number / last);
    limit = fmin(fmax(limit, least), most);
    strl__cut_surface cut = {.limit = limit};
    *out = (strl_verify_cut){.error = limit * self->tree->step};
    snprintf(name, sizeof name, "uniform cut %u at %g", number, out->error);
    strl__v_cut_uniform(self->tree, limit, self->active);
    strl_status status = strl__v_cut_surface_init(&cut, self->model, self->tree, self->active, err);
    if (status == STRL_OK)
        status = compare(self, number, name, &cut, out, err);
    strl__v_cut_surface_deinit(&cut);
    if (status == STRL_OK && out->claimed > out->error * (1 + 1e-9))
        strl__v_flaw(self->model->checks, STRL_VERIFY_DISTANCES, number, "%s: a node of it claims %g", name,
                     out->claimed);
    return status;
}

static strl_status compare_level(comparison *self, uint32_t level, strl_verify_cut *out, strl_error *err)
{
    strl__cut_surface cut = {.base_states = true};
    char name[64];
    snprintf(name, sizeof name, "level %u in its base state", level);
    *out = (strl_verify_cut){0};
    strl__v_cut_level(self->tree, level, self->active);
    strl_status status = strl__v_cut_surface_init(&cut, self->model, self->tree, self->active, err);
    if (status == STRL_OK)
        status = compare(self, STRL_VERIFY_UNIFORM_CUTS + level, name, &cut, out, err);
    strl__v_cut_surface_deinit(&cut);
    out->error = out->claimed;
    return status;
}

static int compare_doubles(const void *a, const void *b)
{
    double x, y;
    memcpy(&x, a, sizeof x);
    memcpy(&y, b, sizeof y);
    return x < y ? -1 : x > y;
}

double strl_verify_ratio(const strl_verify_cut *cut)
{
    double measured = fmax(cut->from_input, cut->to_input);
    return measured > NOTHING_SHARE * cut->claimed ? cut->claimed / measured : 0;
}

static void summarise(strl_verify_report *report)
{
    double ratio[STRL_VERIFY_UNIFORM_CUTS];
    uint32_t count = 0;
    for (uint32_t i = 0; i < report->level_count; i++)
        report->most_claimed_over_measured_of_levels =
            fmax(report->most_claimed_over_measured_of_levels, strl_verify_ratio(&report->levels[i]));
    for (uint32_t i = 0; i < report->uniform_count; i++) {
        double one = strl_verify_ratio(&report->uniform[i]);
        if (one > 0)
            ratio[count++] = one;
    }
    if (count == 0)
        return;
    qsort(ratio, count, sizeof *ratio, compare_doubles);
    report->claimed_over_measured_median = (ratio[(count - 1) / 2] + ratio[count / 2]) / 2;
    report->worst_claimed_over_measured = ratio[0];
}

strl_status strl__v_check_distances(strl__model *model, const strl__vtree *tree, strl__vinput *input,
                                    strl_verify_report *report, strl_error *err)
{
    comparison self = {.model = model, .tree = tree, .input = input, .seed = model->desc->seed + 1};
    self.active = strl__alloc(strl__bit_words(tree), sizeof *self.active);
    self.of_input = strl__alloc(input->surface.count, sizeof *self.of_input);
    self.of_cut = strl__alloc(tree->node_count, sizeof *self.of_cut);
    report->levels = strl__alloc_zero(tree->level_count, sizeof *report->levels);
    strl_status status = STRL_OK;
    if (!self.active || !self.of_input || !self.of_cut || !report->levels)
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory to compare %u nodes", tree->node_count);
    for (uint32_t i = 0; status == STRL_OK && i < STRL_VERIFY_UNIFORM_CUTS; i++) {
        status = compare_uniform(&self, i, &report->uniform[i], err);
        report->uniform_count += status == STRL_OK;
    }
    for (uint32_t level = 0; status == STRL_OK && level < tree->level_count; level++) {
        status = compare_level(&self, level, &report->levels[level], err);
        report->level_count += status == STRL_OK;
    }
    summarise(report);
    strl__free(self.active);
    strl__free(self.of_input);
    strl__free(self.of_cut);
    return status;
}
