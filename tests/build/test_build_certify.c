/* `--certify`: the same geometry, claims that hold by the independent check and are no larger, the same bytes for any
 * number of threads. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "build/built.h"
#include "verify/verify.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define TRIANGLES 40000u
#else
#define TRIANGLES 80000u
#endif

/* Of a model so small, with four levels; docs/benchmarks.md has larger ones. */
#define MOST_CERTIFIED 2.1

static void build(const char *input, const char *output, bool certify, unsigned jobs)
{
    strl_build_desc desc = {.inputs = &input,
                            .input_count = 1,
                            .output = output,
                            .memory_bytes = 256u << 20,
                            .jobs = jobs,
                            .certify = certify};
    strl_build_result result;
    strl_error err = {0};
    if (strl_build_clusters(&desc, &result, &err) != STRL_OK)
        fail_msg("%s: %s", input, err.message);
}

static double worst_ratio(const char *model, const char *input)
{
    strl_error err = {0};
    strl_verify_report report;
    char folder[512];
    snprintf(folder, sizeof folder, "%s", built_path(""));
    const strl_verify_desc desc = {.model = model,
                                   .inputs = &input,
                                   .input_count = 1,
                                   .scratch_dir = folder,
                                   .memory_bytes = 256u << 20,
                                   .jobs = 2,
                                   .cuts = 20};
    if (strl_verify_run(&desc, &report, &err) != STRL_OK)
        fail_msg("%s", err.message);
    for (unsigned kind = 0; kind < STRL_VERIFY_KINDS; kind++)
        if (report.checks[kind].failures)
            fail_msg("%s: %s", strl_verify_name((strl_verify_kind)kind), report.checks[kind].first);
    double worst = report.most_claimed_over_measured_of_levels;
    strl_verify_report_deinit(&report);
    return worst;
}

static void assert_same_bytes(const char *a, const char *b)
{
    size_t size_a, size_b;
    uint8_t *bytes_a = built_read_file(a, &size_a), *bytes_b = built_read_file(b, &size_b);
    assert_int_equal(size_a, size_b);
    assert_memory_equal(bytes_a, bytes_b, size_a);
    free(bytes_a);
    free(bytes_b);
}

/* A node may claim a little more than its drifts do, because others' pieces lie over it; a level may not. */
#define CODEC_STEP 1.05 /* claims are rounded up to a scale of 16 steps an octave */

/* Nodes and states are alike but for their errors. */
static void compare_claims(const char *plain, const char *certified)
{
    built_model a, b;
    uint32_t lower = 0, higher = 0;
    float most_a[32] = {0}, most_b[32] = {0};
    built_open(&a, plain);
    built_open(&b, certified);
    assert_int_equal(a.tree.node_count, b.tree.node_count);
    for (uint32_t i = 0; i < a.tree.node_count; i++) {
        uint32_t level = a.node[i].level;
        float claim_a = a.node[i].geometric_max, claim_b = b.node[i].geometric_max;
        assert_int_equal(a.mesh[i].step_count, b.mesh[i].step_count);
        assert_memory_equal(a.mesh[i].position, b.mesh[i].position,
                            a.mesh[i].vertex_count * sizeof *a.mesh[i].position);
        most_a[level] = fmaxf(most_a[level], claim_a);
        most_b[level] = fmaxf(most_b[level], claim_b);
        lower += claim_b < claim_a;
        higher += claim_b > claim_a;
    }
    for (uint32_t level = 0; level <= a.node[0].level; level++)
        if ((double)most_b[level] > CODEC_STEP * (double)most_a[level])
            fail_msg("level %u claims %g, without certificates %g", level, (double)most_b[level],
                     (double)most_a[level]);
    assert_true(lower > 2 * higher);
    built_close(&a);
    built_close(&b);
}

static void a_certified_isosurface_claims_less_and_holds(void **state)
{
    (void)state;
    char input[512], plain[512], one[512], two[512];
    built_scene("isosurface", "iso.ply", TRIANGLES, false);
    snprintf(input, sizeof input, "%s", built_path("iso.ply"));
    snprintf(plain, sizeof plain, "%s", built_path("plain.stroll"));
    snprintf(one, sizeof one, "%s", built_path("one.stroll"));
    snprintf(two, sizeof two, "%s", built_path("two.stroll"));
    build(input, plain, false, 2);
    build(input, one, true, 1);
    build(input, two, true, 3);
    assert_same_bytes(one, two);
    compare_claims(plain, one);
    double worst = worst_ratio(one, input), before = worst_ratio(plain, input);
    if (!(worst <= MOST_CERTIFIED) || !(worst <= before) || !(before <= 4))
        fail_msg("claimed over measured: %g certified, %g without", worst, before);
}

/* ---- stopped and resumed ---- */

typedef struct stop {
    const char *stage;
    uint64_t calls, after;
} stop;

static bool say_no(void *context, const strl_build_progress *progress)
{
    stop *s = context;
    s->calls += !strcmp(s->stage, progress->stage);
    return s->calls < s->after;
}

static strl_status build_kept(const char *input, const char *output, bool certify, stop *s, strl_error *err)
{
    const strl_build_desc desc = {.inputs = &input,
                                  .input_count = 1,
                                  .output = output,
                                  .memory_bytes = 256u << 20,
                                  .jobs = 1,
                                  .certify = certify,
                                  .keep = true,
                                  .keep_triangles = 1,
                                  .resume = !s,
                                  .progress = s ? say_no : NULL,
                                  .context = s};
    strl_build_result result;
    return strl_build_clusters(&desc, &result, err);
}

/* In the middle of a level that is measured, and after one. */
static void a_certified_build_resumes_to_the_same_bytes(void **state)
{
    (void)state;
    char input[512], whole[512], output[512];
    built_scene("isosurface", "iso.ply", TRIANGLES, false);
    snprintf(input, sizeof input, "%s", built_path("iso.ply"));
    snprintf(whole, sizeof whole, "%s", built_path("whole.stroll"));
    snprintf(output, sizeof output, "%s", built_path("out.stroll"));
    build(input, whole, true, 2);
    const stop stops[] = {{"level 1", 0, 2}, {"level 2", 0, 1}, {"level 2", 0, 2}, {"level 3", 0, 1}};
    for (unsigned i = 0; i < sizeof stops / sizeof *stops; i++) {
        strl_error err = {0};
        stop s = stops[i];
        assert_int_equal(build_kept(input, output, true, &s, &err), STRL_ERR_CANCELLED);
        assert_int_equal(build_kept(input, output, false, NULL, &err), STRL_ERR_ARGUMENT);
        assert_non_null(strstr(err.message, "--certify"));
        if (build_kept(input, output, true, NULL, &err) != STRL_OK)
            fail_msg("%s", err.message);
        assert_same_bytes(whole, output);
        assert_int_equal(remove(output), 0);
    }
}

/* Parts that do not hang together, so that the ladder goes to its end. */
static void certified_boxes_hold(void **state)
{
    (void)state;
    char input[512], output[512];
    built_scene("boxes", "boxes.ply", TRIANGLES / 4, false);
    snprintf(input, sizeof input, "%s", built_path("boxes.ply"));
    snprintf(output, sizeof output, "%s", built_path("boxes.stroll"));
    build(input, output, true, 2);
    worst_ratio(output, input);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_certified_isosurface_claims_less_and_holds),
        cmocka_unit_test(a_certified_build_resumes_to_the_same_bytes),
        cmocka_unit_test(certified_boxes_hold),
    };
    return cmocka_run_group_tests(tests, built_setup, built_teardown);
}
