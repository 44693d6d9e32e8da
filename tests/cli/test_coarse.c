/* When a warning tells that memory kept images coarser than asked for. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "cli/coarse.h"

static uint64_t coarse_frames(double error_px, double splat_px, double allowed_px, double drawn_px)
{
    strl_cli_coarse coarse = {0};
    strl_cli_coarse_add(&coarse, error_px, splat_px, allowed_px, drawn_px);
    assert_int_equal(coarse.frames, 1);
    return coarse.coarse_frames;
}

static void what_is_allowed_and_drawn_tells(void **state)
{
    (void)state;
    assert_int_equal(coarse_frames(1, 1, 1, 1), 0);
    assert_int_equal(coarse_frames(1, 1, 1, 1.5), 0); /* the finest there is */
    assert_int_equal(coarse_frames(1, 1, 2, 0.9), 0); /* nothing in view needs more */
    assert_int_equal(coarse_frames(1, 1, 2, 1.9), 1);
    assert_int_equal(coarse_frames(1, 1, 2, (double)INFINITY), 1);
}

static void splats_that_were_asked_for_are_no_damage(void **state)
{
    (void)state;
    assert_int_equal(coarse_frames(1, 5, 1.2, 4.9), 0);
    assert_int_equal(coarse_frames(1, 5, 1.2, 5.9), 1);
    assert_int_equal(coarse_frames(8, 5, 8, 5), 0);
}

static void the_worst_frame_is_told_by_what_was_asked_for(void **state)
{
    (void)state;
    strl_cli_coarse coarse = {0};
    strl_cli_coarse_add(&coarse, 1, 5, 1.5, 7);
    strl_cli_coarse_add(&coarse, 1, 5, 1.2, 6);
    assert_int_equal(coarse.coarse_frames, 2);
    assert_true(coarse.asked_px == 5 && coarse.drawn_px == 7);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_allowed_and_drawn_tells),
        cmocka_unit_test(splats_that_were_asked_for_are_no_damage),
        cmocka_unit_test(the_worst_frame_is_told_by_what_was_asked_for),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
