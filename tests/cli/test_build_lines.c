/* The lines that `stroll build` shows while it works. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "cli/build_progress.h"

static const strl_build_progress halfway = {.stage = "level 3",
                                            .stage_index = 6,
                                            .stage_count = 7,
                                            .triangles_in = 10000000,
                                            .share = 0.5,
                                            .seconds_left = 75.2,
                                            .triangles_per_s = 281234,
                                            .scratch_bytes = 512ull << 20,
                                            .memory_bytes = 1ull << 30};

static void the_line_says_all_that_one_wants_to_know(void **state)
{
    (void)state;
    char text[256];
    strl_cli_build_progress_format(text, sizeof text, &halfway, 154ull << 20, 200);
    assert_string_equal(text, "6/7 level 3    [###############---------------]  50 %  281 K triangles/s  left 1:15"
                              "  mem 154M/1G  scratch 512M");
    strl_cli_build_progress_format(text, sizeof text, &halfway, 154ull << 20, 88);
    assert_non_null(strstr(text, "[####----]"));
    assert_int_equal(strlen(text), 88);
    strl_cli_build_progress_format(text, sizeof text, &halfway, 154ull << 20, 79);
    assert_non_null(strstr(text, "scratch 512M")); /* all fits a common terminal */
    strl_cli_build_progress_format(text, sizeof text, &halfway, 154ull << 20, 60);
    assert_null(strchr(text, '['));
    assert_non_null(strstr(text, "6/7 level 3"));
    assert_int_equal(strlen(text), 60);
}

static void what_is_not_known_is_left_out(void **state)
{
    (void)state;
    char text[256];
    const strl_build_progress start = {
        .stage = "survey", .stage_index = 1, .stage_count = 7, .memory_bytes = 1536ull << 20};
    strl_cli_build_progress_format(text, sizeof text, &start, 9ull << 20, 30);
    assert_string_equal(text, "1/7 survey       0 %  mem 9M/1");
    strl_cli_build_progress_format(text, sizeof text, &start, 9ull << 20, 50);
    assert_string_equal(text, "1/7 survey       0 %  mem 9M/1.5G  scratch 0K");
}

static void what_is_checked_before_resuming_is_no_stage(void **state)
{
    (void)state;
    char text[256];
    const strl_build_progress check = {
        .stage = "check what was finished", .stage_count = 7, .memory_bytes = 1ull << 30, .scratch_bytes = 4096};
    strl_cli_build_progress_format(text, sizeof text, &check, 9ull << 20, 60);
    assert_string_equal(text, "check what was finished   0 %  mem 9M/1G  scratch 4K");
}

static void the_estimate_warns_of_a_small_disk(void **state)
{
    (void)state;
    char text[256];
    strl_build_estimate estimate = {372000000, 372000000ull * 80, 63ull << 30, 930};
    strl_cli_build_estimate_format(text, sizeof text, &estimate);
    assert_string_equal(text, "about 372 M triangles: up to 28G of scratch, 63G free; some 15:30");
    estimate.scratch_free_bytes = 5ull << 30;
    strl_cli_build_estimate_format(text, sizeof text, &estimate);
    assert_non_null(strstr(text, "28G of scratch, 5G free and that may be TOO LITTLE"));
    estimate = (strl_build_estimate){.scratch_free_bytes = 5ull << 30};
    strl_cli_build_estimate_format(text, sizeof text, &estimate);
    assert_string_equal(text, "an unknown number of triangles; 5G free for scratch");
}

/* What goes to a standard error that is a file. */
static void log_lines(char *text, size_t size, uint64_t since_ns, bool quiet)
{
    char path[] = "test_build_lines_XXXXXX";
    int file = mkstemp(path), kept = dup(STDERR_FILENO);
    assert_true(file >= 0 && kept >= 0);
    fflush(stderr);
    dup2(file, STDERR_FILENO);
    strl_cli_build_progress progress;
    strl_cli_build_progress_init(&progress, quiet);
    progress.logged_ns -= since_ns;
    const strl_build_estimate estimate = {10000000, 800000000, 1ull << 40, 60};
    strl_cli_build_progress_estimate(&progress, &estimate);
    for (int i = 0; i < 3; i++)
        strl_cli_build_progress_update(&progress, &halfway);
    strl_cli_build_progress_end(&progress);
    fflush(stderr);
    dup2(kept, STDERR_FILENO);
    close(kept);
    ssize_t got = pread(file, text, size - 1, 0);
    close(file);
    remove(path);
    assert_true(got >= 0);
    text[got] = '\0';
}

static void a_log_gets_a_line_a_minute(void **state)
{
    (void)state;
    char text[1024];
    log_lines(text, sizeof text, 0, false);
    assert_string_equal(text, "");
    log_lines(text, sizeof text, 61000000000u, false);
    assert_null(strchr(text, '\r'));
    char *second = strstr(text, "\nstroll: 6/7 level 3");
    assert_non_null(second);
    assert_int_equal(strncmp(text, "stroll: about 10.0 M triangles", 30), 0);
    assert_int_equal(strchr(second + 1, '\n')[1], '\0');
    log_lines(text, sizeof text, 61000000000u, true);
    assert_string_equal(text, "");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_line_says_all_that_one_wants_to_know),
        cmocka_unit_test(what_is_not_known_is_left_out),
        cmocka_unit_test(what_is_checked_before_resuming_is_no_stage),
        cmocka_unit_test(the_estimate_warns_of_a_small_disk),
        cmocka_unit_test(a_log_gets_a_line_a_minute),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
