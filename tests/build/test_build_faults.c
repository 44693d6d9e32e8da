/* A build that cannot go on fails with one sentence and leaves its folder as it was: whatever allocation,
 * read or write it is. */
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
#include "platform/file.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define STRIDE 12u
#else
#define STRIDE 40u
#endif

static const char OLDER[] = "an older container";

static strl_status build(const char *input, unsigned jobs, strl_error *err)
{
    const char *inputs[1] = {input};
    strl_build_desc desc = {.inputs = inputs,
                            .input_count = 1,
                            .output = built_path("out.stroll"),
                            .memory_bytes = STRL_BUILD_LEAST_MEMORY,
                            .jobs = jobs};
    strl_build_result result;
    *err = (strl_error){0};
    return strl_build_clusters(&desc, &result, err);
}

static void assert_one_sentence(const strl_error *err, strl_status status)
{
    assert_int_equal(err->status, status);
    assert_true(strlen(err->message) > 12);
    assert_null(strchr(err->message, '\n'));
    assert_int_not_equal(err->message[strlen(err->message) - 1], '.');
}

static void assert_older_output_stays(void)
{
    size_t size;
    uint8_t *bytes = built_read_file(built_path("out.stroll"), &size);
    assert_int_equal(size, sizeof OLDER - 1);
    assert_memory_equal(bytes, OLDER, size);
    free(bytes);
}

/* Input, and an older output: two files before, two files after each failure. */
static void make_input(void)
{
    mesh_file mesh = {0};
    mesh_file_torus(&mesh, 80, 80); /* a few clusters */
    mesh_file_write_ply(&mesh, built_path("in.ply"));
    mesh_file_free(&mesh);
    built_write_text("out.stroll", OLDER);
    assert_int_equal(built_files_left(), 2);
}

/* fail_after(n) for growing n until the build gets through. other: a status that is as good as `expected`. */
static void fail_each(void (*fail_after)(uint64_t n), unsigned jobs, strl_status expected, strl_status other,
                      uint64_t least_failures)
{
    uint64_t failures = 0;
    make_input();
    for (uint64_t n = 1;; n += 1 + n / STRIDE) {
        strl_error err;
        fail_after(n);
        strl_status status = build(built_path("in.ply"), jobs, &err);
        fail_after(0);
        if (status == STRL_OK)
            break;
        if (status != expected && status != other)
            fail_msg("failure %llu: %s (%s)", (unsigned long long)n, err.message, strl_status_name(status));
        assert_one_sentence(&err, status);
        if (built_files_left() != 2)
            fail_msg("failure %llu (%s) left %u files, not 2", (unsigned long long)n, err.message, built_files_left());
        assert_older_output_stays();
        failures++;
        assert_true(n < 10000000);
    }
    assert_true(failures >= least_failures);
    assert_int_equal(built_files_left(), 2);
    built_model model;
    built_open(&model, built_path("out.stroll"));
    assert_int_equal(model.tree.triangle_count, 12800);
    built_close(&model);
}

static void any_allocation_may_fail(void **state)
{
    (void)state;
    fail_each(strl__alloc_fail_after, 1, STRL_ERR_MEMORY, STRL_ERR_MEMORY, 50);
}

static void any_allocation_may_fail_in_any_thread(void **state)
{
    (void)state;
    fail_each(strl__alloc_fail_after, 3, STRL_ERR_MEMORY, STRL_ERR_MEMORY, 50);
}

static void any_read_may_fail(void **state)
{
    (void)state;
    fail_each(strl_file_fail_reads_after, 2, STRL_ERR_IO, STRL_ERR_IO, 10);
}

static void any_write_may_find_the_disk_full(void **state)
{
    (void)state;
    fail_each(strl_file_fail_writes_after, 2, STRL_ERR_DISK_FULL, STRL_ERR_DISK_FULL, 10);
}

/* ---- refusals ---- */
typedef struct refusal {
    const char *input, *output;
    strl_status status;
    const char *word; /* in the sentence */
} refusal;

static void what_cannot_be_built_is_refused(void **state)
{
    (void)state;
    const refusal refusals[] = {
        {"absent.ply", "new.stroll", STRL_ERR_IO, "absent.ply"},
        {"empty.ply", "new.stroll", STRL_ERR_FORMAT, "empty.ply"},
        {"text.ply", "new.stroll", STRL_ERR_FORMAT, "text.ply"},
        {"words.obj", "new.stroll", STRL_ERR_FORMAT, "words.obj"},
        {"line.obj", "new.stroll", STRL_ERR_FORMAT, "line.obj"},
        {"in.ply", "in.ply", STRL_ERR_ARGUMENT, "in.ply"},
        {"in.ply", "", STRL_ERR_ARGUMENT, "folder"},
        {"", "new.stroll", STRL_OK, ""}, /* a folder as input: any failure */
        {"in.ply", "no/such/folder/new.stroll", STRL_ERR_IO, "no/such/folder"},
    };
    make_input();
    built_write_text("empty.ply", "");
    built_write_text("text.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nend_header\n1 2 x\n");
    built_write_text("words.obj", "Once upon a time\n");
    built_write_text("line.obj", "v 0 0 0\nv 1 1 1\nv 2 2 2\nf 1 1 1\nf 2 2 3\n");
    unsigned files = built_files_left();
    for (size_t i = 0; i < sizeof refusals / sizeof *refusals; i++) {
        strl_error err = {0};
        strl_build_result result;
        const char *input = built_path(refusals[i].input);
        strl_build_desc desc = {
            .inputs = &input, .input_count = 1, .output = built_path(refusals[i].output), .jobs = 1};
        strl_status status = strl_build_clusters(&desc, &result, &err);
        if (status == STRL_OK || (refusals[i].status && status != refusals[i].status) ||
            !strstr(err.message, refusals[i].word))
            fail_msg("%s -> %s: %s (%s)", refusals[i].input, refusals[i].output, err.message, strl_status_name(status));
        assert_one_sentence(&err, status);
        assert_int_equal(built_files_left(), files);
        assert_older_output_stays();
    }
}

static void too_little_memory_is_refused(void **state)
{
    (void)state;
    strl_error err = {0};
    strl_build_result result;
    const char *input = built_path("in.ply");
    strl_build_desc desc = {.inputs = &input,
                            .input_count = 1,
                            .output = built_path("new.stroll"),
                            .memory_bytes = STRL_BUILD_LEAST_MEMORY - 1};
    assert_int_equal(strl_build_clusters(&desc, &result, &err), STRL_ERR_ARGUMENT);
    assert_non_null(strstr(err.message, "memory"));
    desc.input_count = 0;
    assert_int_equal(strl_build_clusters(&desc, &result, &err), STRL_ERR_ARGUMENT);
}

/* ---- stopping ---- */
typedef struct stop {
    uint64_t calls, after;
    uint32_t stages;
} stop;

static bool count_or_stop(void *context, const strl_build_progress *progress)
{
    stop *s = context;
    assert_non_null(progress->stage);
    assert_true(progress->total == 0 || progress->done <= progress->total);
    assert_true(progress->stage_index >= s->stages);
    s->stages = progress->stage_index;
    return ++s->calls != s->after;
}

static void progress_that_says_no_cancels(void **state)
{
    (void)state;
    uint64_t total = 0;
    make_input();
    for (uint64_t after = 1;; after++) {
        stop s = {.after = after};
        const char *input = built_path("in.ply");
        strl_build_desc desc = {.inputs = &input,
                                .input_count = 1,
                                .output = built_path("out.stroll"),
                                .jobs = 2,
                                .progress = count_or_stop,
                                .context = &s};
        strl_build_result result;
        strl_error err = {0};
        strl_status status = strl_build_clusters(&desc, &result, &err);
        total = s.calls;
        if (status == STRL_OK)
            break;
        assert_int_equal(status, STRL_ERR_CANCELLED);
        assert_int_equal(s.calls, after); /* nothing is asked after it said no */
        assert_one_sentence(&err, status);
        assert_older_output_stays();
        assert_true(after < 10000);
    }
    assert_true(total >= 8);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(any_allocation_may_fail, built_setup, built_teardown),
        cmocka_unit_test_setup_teardown(any_allocation_may_fail_in_any_thread, built_setup, built_teardown),
        cmocka_unit_test_setup_teardown(any_read_may_fail, built_setup, built_teardown),
        cmocka_unit_test_setup_teardown(any_write_may_find_the_disk_full, built_setup, built_teardown),
        cmocka_unit_test_setup_teardown(what_cannot_be_built_is_refused, built_setup, built_teardown),
        cmocka_unit_test_setup_teardown(too_little_memory_is_refused, built_setup, built_teardown),
        cmocka_unit_test_setup_teardown(progress_that_says_no_cancels, built_setup, built_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
