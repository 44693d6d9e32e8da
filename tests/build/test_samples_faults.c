/* A build of samples that cannot go on fails with one sentence and leaves its folder as it was: whatever allocation,
 * read or write it is, and whoever says no. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "build/sample_tree.h"
#include "platform/file.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define STRIDE 12u
#else
#define STRIDE 40u
#endif

static const char OLDER[] = "an older container";

typedef struct stop {
    uint64_t calls, after;
    uint32_t stages;
} stop;

static bool count_or_stop(void *context, const strl_build_progress *progress)
{
    stop *s = context;
    assert_non_null(progress->stage);
    assert_true(progress->total == 0 || progress->done <= progress->total);
    assert_true(progress->share >= 0 && progress->share <= 1);
    assert_true(progress->stage_index >= s->stages && progress->stage_index <= progress->stage_count);
    s->stages = progress->stage_index;
    return ++s->calls != s->after;
}

static strl_status build(unsigned jobs, stop *watch, strl_error *err)
{
    const char *inputs[1] = {built_path("in.ply")};
    strl_build_desc desc = {.inputs = inputs,
                            .input_count = 1,
                            .output = built_path("out.stroll"),
                            .memory_bytes = STRL_BUILD_LEAST_MEMORY,
                            .jobs = jobs,
                            .progress = watch ? count_or_stop : NULL,
                            .context = watch};
    strl_build_result result;
    *err = (strl_error){0};
    return strl_build_samples(&desc, &result, err);
}

static void assert_failed_cleanly(const strl_error *err, strl_status status, strl_status expected, uint64_t number)
{
    if (status != expected || err->status != status || strlen(err->message) < 12 || strchr(err->message, '\n') ||
        err->message[strlen(err->message) - 1] == '.')
        fail_msg("failure %llu: %s (%s)", (unsigned long long)number, err->message, strl_status_name(status));
    if (built_files_left() != 2)
        fail_msg("failure %llu (%s) left %u files, not 2", (unsigned long long)number, err->message,
                 built_files_left());
    size_t size;
    uint8_t *bytes = built_read_file(built_path("out.stroll"), &size);
    assert_int_equal(size, sizeof OLDER - 1);
    assert_memory_equal(bytes, OLDER, size);
    free(bytes);
}

/* A surface and some triangles that are too large for its pieces; and an older output: two files before, two after each
 * failure. */
static void make_input(mesh_file *mesh)
{
    *mesh = (mesh_file){0};
    mesh_file_torus(mesh, 70, 60);
    for (uint32_t i = 0; i < 200; i++)
        mesh_file_add_face(mesh, i, i + 2100, 4199 - i);
    mesh_file_write_ply(mesh, built_path("in.ply"));
    built_write_text("out.stroll", OLDER);
    assert_int_equal(built_files_left(), 2);
}

static void fail_each(void (*fail_after)(uint64_t n), unsigned jobs, strl_status expected, uint64_t least_failures)
{
    uint64_t failures = 0;
    mesh_file mesh;
    make_input(&mesh);
    for (uint64_t n = 1;; n += 1 + n / STRIDE) {
        strl_error err;
        fail_after(n);
        strl_status status = build(jobs, NULL, &err);
        fail_after(0);
        if (status == STRL_OK)
            break;
        assert_failed_cleanly(&err, status, expected, n);
        failures++;
        assert_true(n < 10000000);
    }
    assert_true(failures >= least_failures);
    assert_int_equal(built_files_left(), 2);
    sample_tree_check("out.stroll");
    sample_tree_compare("out.stroll", &mesh);
    mesh_file_free(&mesh);
}

static void any_allocation_may_fail(void **state)
{
    (void)state;
    fail_each(strl__alloc_fail_after, 1, STRL_ERR_MEMORY, 50);
}

static void any_allocation_may_fail_in_any_thread(void **state)
{
    (void)state;
    fail_each(strl__alloc_fail_after, 3, STRL_ERR_MEMORY, 50);
}

static void any_read_may_fail(void **state)
{
    (void)state;
    fail_each(strl_file_fail_reads_after, 2, STRL_ERR_IO, 4);
}

static void any_write_may_find_the_disk_full(void **state)
{
    (void)state;
    fail_each(strl_file_fail_writes_after, 2, STRL_ERR_DISK_FULL, 4);
}

static void progress_that_says_no_cancels(void **state)
{
    (void)state;
    uint64_t total = 0;
    mesh_file mesh;
    make_input(&mesh);
    for (uint64_t after = 1;; after++) {
        stop s = {.after = after};
        strl_error err;
        strl_status status = build(2, &s, &err);
        total = s.calls;
        if (status == STRL_OK)
            break;
        assert_int_equal(s.calls, after); /* nothing is asked after it said no */
        assert_failed_cleanly(&err, status, STRL_ERR_CANCELLED, after);
        assert_true(after < 10000);
    }
    assert_true(total >= 4);
    mesh_file_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(any_allocation_may_fail, built_setup, built_teardown),
        cmocka_unit_test_setup_teardown(any_allocation_may_fail_in_any_thread, built_setup, built_teardown),
        cmocka_unit_test_setup_teardown(any_read_may_fail, built_setup, built_teardown),
        cmocka_unit_test_setup_teardown(any_write_may_find_the_disk_full, built_setup, built_teardown),
        cmocka_unit_test_setup_teardown(progress_that_says_no_cancels, built_setup, built_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
