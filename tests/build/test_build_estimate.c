/* The time that a build says it still needs: near the truth where stages take their usual shares, and soon where not.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "build/context.h"
#include "build/ingest/internal.h"
#include "build/progress.h"

#define SECOND 1000000000u

static const char *const stages[] = {"survey",  "read",    "sort",    "connect",       "partition", "level 0",
                                     "level 1", "level 2", "level 3", "level 4",       "level 5",   "level 6",
                                     "level 7", "level 8", "level 9", "higher levels", "write"};

enum { STAGES = sizeof stages / sizeof stages[0], STEPS = 50 };

/* What the shares of the stages are, by asking. */
static void ask_shares(double shares[STAGES])
{
    strl_estimate estimate;
    strl__estimate_start(&estimate, STRL_BUILD_CLUSTERS, 0);
    for (int i = 0; i < STAGES; i++) {
        double before = estimate.share;
        strl__estimate_stage(&estimate, stages[i]);
        strl__estimate_update(&estimate, 1, 1, 0);
        shares[i] = estimate.share - before;
    }
    assert_true(fabs(estimate.share - 1) < 1e-9);
    assert_int_equal(estimate.stage_index, STRL_BUILD_STAGES);
}

/* Of samples as well, whose stages are fewer: none of them is a jump over those that there are not. */
static void the_stages_of_samples_make_a_whole(void **state)
{
    static const char *const sampled[] = {"survey", "read", "sort", "write"};
    double most[] = {0.2, 0.3, 0.8, 0.05};
    strl_estimate estimate;
    (void)state;
    strl__estimate_start(&estimate, STRL_BUILD_SAMPLES, 0);
    for (int i = 0; i < 4; i++) {
        double before = estimate.share;
        strl__estimate_stage(&estimate, sampled[i]);
        strl__estimate_update(&estimate, 1, 2, 0);
        assert_true(estimate.share > before);
        strl__estimate_update(&estimate, 1, 1, 0);
        assert_true(estimate.share - before < most[i]);
    }
    assert_true(fabs(estimate.share - 1) < 1e-9);
    assert_true(strl__estimate_seconds(STRL_BUILD_SAMPLES, 1000000, 1) <
                strl__estimate_seconds(STRL_BUILD_CLUSTERS, 1000000, 1) / 4);
}

static void ask_seconds(double seconds[STAGES], double total)
{
    ask_shares(seconds);
    for (int i = 0; i < STAGES; i++)
        seconds[i] *= total;
}

/* A build whose stages take `seconds`. check is called at each step with the truth. */
static void simulate(strl_estimate *estimate, int first, const double seconds[STAGES], double guess,
                     void (*check)(const strl_estimate *estimate, double left, int stage, int step))
{
    double now = 5, total = 0, share = 0;
    for (int i = first; i < STAGES; i++)
        total += seconds[i];
    strl__estimate_start(estimate, STRL_BUILD_CLUSTERS, (uint64_t)(now * SECOND));
    for (int i = first; i < STAGES; i++) {
        strl__estimate_stage(estimate, stages[i]);
        if (i == first)
            strl__estimate_guess(estimate, guess);
        for (int step = 1; step <= STEPS; step++) {
            now += seconds[i] / STEPS;
            strl__estimate_update(estimate, (uint64_t)step, STEPS, (uint64_t)(now * SECOND));
            assert_true(estimate->share >= share && estimate->share <= 1 && estimate->seconds_left >= 0);
            share = estimate->share;
            check(estimate, 5 + total - now, i, step);
        }
    }
    assert_true(estimate->seconds_left < 1e-6 * total + 1e-6);
}

static void near_the_truth(const strl_estimate *estimate, double left, int stage, int step)
{
    (void)step;
    if (stage > 1)
        assert_true(fabs(estimate->seconds_left - left) < 0.02 * left + 1e-3);
}

static void usual_shares_tell_the_time_left(void **state)
{
    (void)state;
    double seconds[STAGES];
    strl_estimate estimate;
    ask_seconds(seconds, 1000);
    simulate(&estimate, 0, seconds, 1000, near_the_truth);
    assert_true(fabs(strl__estimate_rate(&estimate, 5000000) - 5000) < 1);
}

/* The guess was ten times too small: after a tenth of the work it hardly matters. */
static void soon_near_the_truth(const strl_estimate *estimate, double left, int stage, int step)
{
    (void)step;
    if (stage >= 5)
        assert_true(estimate->seconds_left > 0.85 * left - 1e-3 && estimate->seconds_left < 1.05 * left + 1e-3);
}

static void a_wrong_guess_is_forgotten(void **state)
{
    (void)state;
    double seconds[STAGES];
    strl_estimate estimate;
    ask_seconds(seconds, 1000);
    simulate(&estimate, 0, seconds, 100, soon_near_the_truth);
}

static void half_believed(const strl_estimate *estimate, double left, int stage, int step)
{
    assert_true(estimate->seconds_left < 4.1 * left + 1); /* at its end what follows is thought as slow */
    if ((stage == 6 && step > STEPS / 2) || stage == 7)
        assert_true(estimate->seconds_left > 0.5 * left);
}

/* Many separate parts: the first levels of the hierarchy take four times what they should. */
static void a_slow_stage_is_soon_believed(void **state)
{
    (void)state;
    double seconds[STAGES];
    strl_estimate estimate;
    ask_seconds(seconds, 1000);
    for (int i = 6; i < 8; i++)
        seconds[i] *= 4;
    simulate(&estimate, 0, seconds, 1000, half_believed);
}

static void a_resumed_build_counts_from_where_it_began(void **state)
{
    (void)state;
    double seconds[STAGES], share = 0;
    strl_estimate estimate;
    ask_seconds(seconds, 1000);
    for (int i = 0; i < 7; i++)
        share += seconds[i] / 1000;
    simulate(&estimate, 7, seconds, 1000, near_the_truth);
    assert_true(fabs(estimate.first_share - share) < 1e-9);
    assert_true(fabs(strl__estimate_rate(&estimate, 5000000) - 5000) < 1);
}

static void a_stage_that_stands_still_moves_the_end_away(void **state)
{
    (void)state;
    strl_estimate estimate;
    strl__estimate_start(&estimate, STRL_BUILD_CLUSTERS, 0);
    strl__estimate_stage(&estimate, "level 0");
    strl__estimate_guess(&estimate, 100);
    double before = estimate.seconds_left;
    strl__estimate_update(&estimate, 0, 0, 50 * (uint64_t)SECOND);
    assert_true(estimate.seconds_left > 2 * before);
    strl__estimate_stage(&estimate, "a stage of the future");
    double share = estimate.share;
    strl__estimate_update(&estimate, 1, 2, 51 * (uint64_t)SECOND);
    assert_true(estimate.share == share && estimate.stage_index == 6);
}

static void without_anything_known_nothing_is_said(void **state)
{
    (void)state;
    strl_estimate estimate;
    strl__estimate_start(&estimate, STRL_BUILD_CLUSTERS, 7);
    strl__estimate_stage(&estimate, "survey");
    assert_true(estimate.seconds_left == 0 && strl__estimate_rate(&estimate, 1000) == 0);
    strl__estimate_update(&estimate, 0, 0, 7);
    assert_true(estimate.seconds_left == 0 && estimate.share == 0);
    assert_true(strl__estimate_seconds(STRL_BUILD_CLUSTERS, 1000000, 0) ==
                strl__estimate_seconds(STRL_BUILD_CLUSTERS, 1000000, 1));
    assert_true(strl__estimate_seconds(STRL_BUILD_CLUSTERS, 1000000, 2) <
                strl__estimate_seconds(STRL_BUILD_CLUSTERS, 1000000, 1));
    assert_true(strl__estimate_seconds(STRL_BUILD_CERTIFIED, 1000000, 1) >
                strl__estimate_seconds(STRL_BUILD_CLUSTERS, 1000000, 1));
}

static void more_triangles_need_more_memory(void **state)
{
    (void)state;
    strl_error err = {0};
    strl_build_context context = {.memory_bytes = STRL_BUILD_LEAST_MEMORY};
    assert_int_equal(strl__ingest_check_memory(&context, 33000000, &err), STRL_OK);
    assert_int_equal(strl__ingest_check_memory(&context, 34000000, &err), STRL_ERR_ARGUMENT);
    assert_string_equal(err.message, "--memory 64M is below the least that a build of 34000000 triangles needs, 65M");
    context.memory_bytes = 65u << 20;
    assert_int_equal(strl__ingest_check_memory(&context, 34000000, &err), STRL_OK);
    context.memory_bytes = 1u << 30;
    assert_int_equal(strl__ingest_check_memory(&context, 372000000, &err), STRL_OK);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_stages_of_samples_make_a_whole),
        cmocka_unit_test(usual_shares_tell_the_time_left),
        cmocka_unit_test(a_wrong_guess_is_forgotten),
        cmocka_unit_test(a_slow_stage_is_soon_believed),
        cmocka_unit_test(a_resumed_build_counts_from_where_it_began),
        cmocka_unit_test(a_stage_that_stands_still_moves_the_end_away),
        cmocka_unit_test(without_anything_known_nothing_is_said),
        cmocka_unit_test(more_triangles_need_more_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
