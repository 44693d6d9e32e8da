/* Files that appear when they are whole, and scratch folders: no failure leaves or touches anything. */
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <dirent.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#include <cmocka.h>

#include "base/memory.h"
#include "platform/output.h"
#include "platform/scratch.h"
#include "support/folder.h"

static const char *const names[] = {"*.spill", NULL};

static unsigned count_files(const char *path)
{
    unsigned count = 0;
    DIR *open = opendir(path);
    assert_non_null(open);
    for (const struct dirent *entry; (entry = readdir(open)) != NULL;)
        count += entry->d_name[0] != '.';
    closedir(open);
    return count;
}

static void put(const char *path, const char *text)
{
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    assert_int_equal(fclose(file), 0);
}

static void assert_holds(const char *path, const char *text)
{
    char found[64] = "";
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    size_t got = fread(found, 1, sizeof found - 1, file);
    fclose(file);
    found[got] = 0;
    assert_string_equal(found, text);
}

/* All that an output does: bytes, a spill, a stream, the name. */
static strl_status write_all(const char *path, bool durable, strl_error *err)
{
    strl_output *output = NULL;
    strl_file *spill = NULL;
    FILE *stream = NULL;
    strl_status status = strl_output_open(path, NULL, &output, err);
    if (status == STRL_OK)
        status = strl_output_spill(output, &spill, err);
    if (status == STRL_OK)
        status = strl_file_write(spill, 0, "wait", 4, err);
    if (status == STRL_OK)
        status = strl_file_write(strl_output_file(output), 0, "new", 3, err);
    if (status == STRL_OK)
        status = strl_output_append(output, spill, NULL, NULL, err);
    if (status == STRL_OK)
        status = strl_output_stream(output, &stream, err);
    if (status == STRL_OK)
        status = fputs("NEW", stream) >= 0 ? STRL_OK : STRL_ERR_IO;
    if (status == STRL_OK)
        status = strl_output_finish(output, durable, err);
    strl_file_close(spill, NULL);
    strl_output_close(output);
    return status;
}

static void a_file_has_its_name_when_it_is_whole(void **state)
{
    (void)state;
    strl_output *output = NULL;
    assert_int_equal(strl_output_open(strl_test_path("a"), NULL, &output, NULL), STRL_OK);
    assert_int_equal(strl_file_write(strl_output_file(output), 0, "half", 4, NULL), STRL_OK);
    assert_false(strl_path_exists(strl_test_path("a")));
    assert_int_equal(count_files(strl_test_folder), 1);
    strl_output_close(output);
    assert_int_equal(count_files(strl_test_folder), 0);
    for (int durable = 0; durable < 2; durable++) {
        assert_int_equal(write_all(strl_test_path("a"), durable, NULL), STRL_OK);
        assert_holds(strl_test_path("a"), "NEWwait");
        assert_int_equal(count_files(strl_test_folder), 1);
    }
    assert_int_equal(strl_path_remove(strl_test_path("a"), NULL), STRL_OK);
    strl_output_close(NULL);
}

typedef struct listener {
    unsigned calls, most; /* the call that ends the work */
    uint64_t done, total;
} listener;

static strl_status listen(void *context, uint64_t done, uint64_t total, strl_error *err)
{
    (void)err;
    listener *self = context;
    assert_true(done > self->done && done <= total);
    self->done = done;
    self->total = total;
    return ++self->calls < self->most ? STRL_OK : STRL_ERR_CANCELLED;
}

static void what_waits_comes_after_the_rest(void **state)
{
    (void)state;
    enum { BYTES = 5 << 19 }; /* more than is copied at once */
    uint8_t *data = strl__alloc(BYTES, 1), *found = strl__alloc(BYTES, 1);
    for (uint32_t i = 0; i < BYTES; i++)
        data[i] = (uint8_t)(i * 2654435761u >> 24);
    for (unsigned most = 1; most <= 4; most++) {
        strl_output *output = NULL;
        strl_file *spill = NULL;
        listener self = {.most = most};
        assert_int_equal(strl_output_open(strl_test_path("a"), NULL, &output, NULL), STRL_OK);
        assert_int_equal(strl_output_spill(output, &spill, NULL), STRL_OK);
        assert_int_equal(strl_file_write(spill, 0, data, BYTES, NULL), STRL_OK);
        assert_int_equal(strl_file_write(strl_output_file(output), 0, "head", 4, NULL), STRL_OK);
        assert_int_equal(strl_output_append(output, spill, listen, &self, NULL),
                         most < 4 ? STRL_ERR_CANCELLED : STRL_OK);
        assert_int_equal(self.calls, most < 4 ? most : 3);
        assert_int_equal(self.total, BYTES);
        if (most == 4) {
            assert_int_equal(strl_file_bytes(strl_output_file(output)), BYTES + 4);
            assert_int_equal(strl_file_read(strl_output_file(output), 4, found, BYTES, NULL), STRL_OK);
            assert_memory_equal(found, data, BYTES);
        }
        strl_file_close(spill, NULL);
        strl_output_close(output);
    }
    strl__free(found);
    strl__free(data);
    assert_int_equal(count_files(strl_test_folder), 0);
}

static void two_writers_of_one_name_do_not_meet(void **state)
{
    (void)state;
    strl_output *first = NULL, *second = NULL;
    assert_int_equal(strl_output_open(strl_test_path("a"), NULL, &first, NULL), STRL_OK);
    assert_int_equal(strl_output_open(strl_test_path("a"), NULL, &second, NULL), STRL_OK);
    assert_int_equal(count_files(strl_test_folder), 2);
    assert_int_equal(strl_file_write(strl_output_file(first), 0, "first", 5, NULL), STRL_OK);
    assert_int_equal(strl_file_write(strl_output_file(second), 0, "2nd", 3, NULL), STRL_OK);
    assert_int_equal(strl_output_finish(first, false, NULL), STRL_OK);
    assert_holds(strl_test_path("a"), "first");
    assert_int_equal(strl_output_finish(second, false, NULL), STRL_OK);
    assert_holds(strl_test_path("a"), "2nd");
    strl_output_close(first);
    strl_output_close(second);
    assert_int_equal(count_files(strl_test_folder), 1);
    assert_int_equal(strl_path_remove(strl_test_path("a"), NULL), STRL_OK);
}

static void long_names_are_written_or_refused(void **state)
{
    (void)state;
    char name[300];
    memset(name, 'n', sizeof name);
    name[255] = 0;
    assert_int_equal(write_all(strl_test_path(name), false, NULL), STRL_OK);
    assert_int_equal(strl_path_remove(strl_test_path(name), NULL), STRL_OK);
    name[255] = 'n', name[256] = 0;
    assert_int_equal(strl_output_check(strl_test_path(name), NULL), STRL_ERR_IO);
    assert_int_equal(count_files(strl_test_folder), 0);
}

static void the_unfinished_file_lies_in_scratch_where_that_is_beside(void **state)
{
    (void)state;
    strl_output *output = NULL;
    assert_int_equal(strl_path_make_directory(strl_test_path("scratch"), NULL), STRL_OK);
    assert_int_equal(strl_output_open(strl_test_path("a"), strl_test_path("scratch"), &output, NULL), STRL_OK);
    assert_int_equal(count_files(strl_test_path("scratch")), 1);
    assert_int_equal(strl_output_finish(output, false, NULL), STRL_OK);
    strl_output_close(output);
    assert_true(strl_path_exists(strl_test_path("a")));
    assert_int_equal(strl_output_open(strl_test_path("a"), "/tmp", &output, NULL), STRL_OK);
    assert_int_equal(count_files(strl_test_folder), 3);
    strl_output_close(output);
    assert_int_equal(strl_path_remove(strl_test_path("a"), NULL), STRL_OK);
    assert_int_equal(strl_path_remove_directory(strl_test_path("scratch"), NULL), STRL_OK);
}

static strl_status scratch_and_output(strl_error *err)
{
    const strl_scratch_desc desc = {
        .path = strl_test_path("parent/s.tmp"), .parent = strl_test_path("parent"), .names = names};
    strl_scratch *scratch = NULL;
    strl_status status = strl_scratch_create(&desc, &scratch, err);
    if (status == STRL_OK)
        status = write_all(strl_test_path("a"), true, err);
    strl_scratch_destroy(scratch);
    return status;
}

static void every_injected_failure_leaves_the_folder_as_it_was(void **state)
{
    (void)state;
    void (*const hooks[])(uint64_t) = {strl__alloc_fail_after, strl_file_fail_writes_after};
    const strl_status expected[] = {STRL_ERR_MEMORY, STRL_ERR_DISK_FULL};
    for (size_t i = 0; i < 2; i++) {
        uint64_t budget = 0;
        strl_status status;
        do {
            strl_error err = {0};
            put(strl_test_path("a"), "old");
            hooks[i](++budget);
            status = scratch_and_output(&err);
            hooks[i](0);
            if (status != STRL_OK && status != expected[i])
                fail_msg("%s", err.message);
            assert_int_equal(err.status, status);
            assert_int_equal(count_files(strl_test_folder), 1);
            assert_holds(strl_test_path("a"), status == STRL_OK ? "NEWwait" : "old");
        } while (status != STRL_OK);
        assert_true(budget > 3);
    }
    assert_int_equal(strl_path_remove(strl_test_path("a"), NULL), STRL_OK);
}

static void a_scratch_folder_is_held_by_one_process(void **state)
{
    (void)state;
    const char *path = strl_test_path("s.tmp");
    const strl_scratch_desc desc = {.path = path, .names = names};
    strl_scratch *first = NULL, *second = NULL;
    strl_error err = {0};
    assert_int_equal(strl_scratch_create(&desc, &first, NULL), STRL_OK);
    put(strl_test_path("s.tmp/x.spill"), "x");
    assert_int_equal(strl_scratch_create(&desc, &second, &err), STRL_ERR_IO);
    assert_null(second);
    assert_non_null(strstr(err.message, "locked"));
    assert_int_equal(count_files(path), 2);
    strl_scratch_destroy(first);
    assert_false(strl_path_exists(path));
    strl_scratch_destroy(NULL);
}

static void a_folder_that_says_nothing_yet_is_taken_over(void **state)
{
    (void)state;
    const strl_scratch_desc desc = {.path = strl_test_path("s.tmp"), .names = names};
    for (int with_lock = 0; with_lock < 2; with_lock++) {
        strl_scratch *scratch = NULL;
        assert_int_equal(mkdir(desc.path, 0777), 0);
        if (with_lock)
            put(strl_test_path("s.tmp/lock"), "");
        assert_int_equal(strl_scratch_create(&desc, &scratch, NULL), STRL_OK);
        put(strl_test_path("s.tmp/x.spill"), "x");
        strl_scratch_destroy(scratch);
        assert_int_equal(count_files(strl_test_folder), 0);
    }
}

static void a_folder_of_somebody_else_stays_as_it_is(void **state)
{
    (void)state;
    static const char *const holds[][3] = {
        {"letter"}, {"x.spill"}, {"lock", "", "letter"}, {"lock", "", "x.spill"}, {"lock", "mine"}};
    char path[512];
    snprintf(path, sizeof path, "%s", strl_test_path("s.tmp"));
    const strl_scratch_desc desc = {.path = path, .names = names};
    for (size_t i = 0; i < sizeof holds / sizeof *holds; i++) {
        strl_scratch *scratch = NULL;
        strl_error err = {0};
        assert_int_equal(mkdir(desc.path, 0777), 0);
        char first[16], second[16];
        snprintf(first, sizeof first, "s.tmp/%s", holds[i][0]);
        snprintf(second, sizeof second, "s.tmp/%s", holds[i][2] ? holds[i][2] : holds[i][0]);
        put(strl_test_path(second), "mine");
        put(strl_test_path(first), holds[i][1] ? holds[i][1] : "mine");
        unsigned before = count_files(desc.path);
        assert_int_equal(strl_scratch_create(&desc, &scratch, &err), STRL_ERR_ARGUMENT);
        assert_non_null(strstr(err.message, "not made by a build"));
        assert_int_equal(count_files(desc.path), before);
        assert_holds(strl_test_path(first), holds[i][1] ? holds[i][1] : "mine");
        assert_int_equal(strl_path_remove_directory(desc.path, NULL), STRL_OK);
    }
}

/* A lock file that is a link would be made where the link leads to. */
static void a_lock_that_is_a_link_is_not_followed(void **state)
{
    (void)state;
    const strl_scratch_desc desc = {.path = strl_test_path("s.tmp"), .names = names};
    strl_scratch *scratch = NULL;
    assert_int_equal(mkdir(desc.path, 0777), 0);
    assert_int_equal(symlink(strl_test_path("far"), strl_test_path("s.tmp/lock")), 0);
    assert_int_equal(strl_scratch_create(&desc, &scratch, NULL), STRL_ERR_ARGUMENT);
    assert_false(strl_path_exists(strl_test_path("far")));
    assert_int_equal(strl_path_remove_directory(desc.path, NULL), STRL_OK);
}

/* What one of several processes does: 0 where each folder was its own or another's. */
static int take_turns(const strl_scratch_desc *desc, unsigned rounds)
{
    for (unsigned round = 0; round < rounds; round++) {
        strl_scratch *scratch = NULL;
        strl_error err = {0};
        strl_status status = strl_scratch_create(desc, &scratch, &err);
        if (status == STRL_OK)
            strl_scratch_destroy(scratch);
        else if (!strstr(err.message, "is locked")) {
            fprintf(stderr, "%s\n", err.message);
            return 1;
        }
    }
    return 0;
}

static void of_processes_that_start_together_the_others_hear_locked(void **state)
{
    (void)state;
    enum { PROCESSES = 4, ROUNDS = 2000 };
    const strl_scratch_desc desc = {.path = strl_test_path("s.tmp"), .names = names};
    pid_t child[PROCESSES];
    for (int i = 0; i < PROCESSES; i++) {
        child[i] = fork();
        assert_true(child[i] >= 0);
        if (child[i] == 0)
            _exit(take_turns(&desc, ROUNDS));
    }
    int failed = 0;
    for (int i = 0; i < PROCESSES; i++) {
        int status;
        failed += waitpid(child[i], &status, 0) != child[i] || status != 0;
    }
    assert_int_equal(failed, 0);
    assert_int_equal(count_files(strl_test_folder), 0);
}

static void what_a_killed_process_left_is_cleared(void **state)
{
    (void)state;
    const strl_scratch_desc desc = {.path = strl_test_path("s.tmp"), .names = names};
    strl_scratch *scratch = NULL;
    pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        strl_scratch *killed;
        bool made = strl_scratch_create(&desc, &killed, NULL) == STRL_OK;
        put(strl_test_path("s.tmp/x.spill"), "x");
        _exit(made ? 0 : 1);
    }
    int status;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_int_equal(status, 0);
    assert_int_equal(count_files(desc.path), 2);
    put(strl_test_path("s.tmp/letter"), "mine");
    strl_error err = {0};
    assert_int_equal(strl_scratch_create(&desc, &scratch, &err), STRL_ERR_ARGUMENT);
    assert_non_null(strstr(err.message, "letter"));
    assert_int_equal(count_files(desc.path), 3);
    assert_int_equal(strl_path_remove(strl_test_path("s.tmp/letter"), NULL), STRL_OK);
    assert_int_equal(strl_scratch_create(&desc, &scratch, NULL), STRL_OK);
    assert_string_equal(strl_scratch_path(scratch), desc.path);
    assert_int_equal(count_files(desc.path), 1);
    strl_scratch_destroy(scratch);
    assert_int_equal(count_files(strl_test_folder), 0);
}

static bool is_x(void *context, const char *name)
{
    ++*(unsigned *)context;
    return strcmp(name, "x.spill") == 0;
}

static void what_is_left_for_a_later_run_is_found_again(void **state)
{
    (void)state;
    strl_scratch_desc desc = {
        .path = strl_test_path("parent/s.tmp"), .parent = strl_test_path("parent"), .names = names, .keep = true};
    strl_scratch *scratch = NULL;
    unsigned asked = 0;
    assert_int_equal(strl_scratch_create(&desc, &scratch, NULL), STRL_OK);
    put(strl_test_path("parent/s.tmp/x.spill"), "x");
    put(strl_test_path("parent/s.tmp/y.spill"), "y");
    strl_scratch_leave(scratch);
    strl_scratch_leave(NULL);
    assert_int_equal(count_files(desc.path), 3);
    assert_int_equal(strl_scratch_create(&desc, &scratch, NULL), STRL_OK);
    assert_int_equal(count_files(desc.path), 3);
    assert_int_equal(strl_scratch_sweep(scratch, is_x, &asked, NULL), STRL_OK);
    assert_int_equal(asked, 2);
    assert_int_equal(count_files(desc.path), 2);
    strl_scratch_leave(scratch);
    desc.keep = false;
    assert_int_equal(strl_scratch_create(&desc, &scratch, NULL), STRL_OK);
    assert_int_equal(count_files(desc.path), 1);
    strl_scratch_destroy(scratch);
    assert_int_equal(count_files(strl_test_folder), 0); /* the parent, which the first run made, too */
}

static void a_nameless_file_leaves_no_name(void **state)
{
    (void)state;
    strl_file *file = NULL;
    char text[4] = "";
    assert_int_equal(strl_file_create_nameless(strl_test_folder, &file, NULL), STRL_OK);
    assert_int_equal(count_files(strl_test_folder), 0);
    assert_int_equal(strl_file_write(file, 0, "abc", 3, NULL), STRL_OK);
    assert_int_equal(strl_file_read(file, 0, text, 3, NULL), STRL_OK);
    assert_string_equal(text, "abc");
    assert_int_equal(strl_file_close(file, NULL), STRL_OK);
    assert_int_equal(strl_file_create_nameless(strl_test_path("none"), &file, NULL), STRL_ERR_IO);
    assert_null(file);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_file_has_its_name_when_it_is_whole),
        cmocka_unit_test(what_waits_comes_after_the_rest),
        cmocka_unit_test(two_writers_of_one_name_do_not_meet),
        cmocka_unit_test(long_names_are_written_or_refused),
        cmocka_unit_test(the_unfinished_file_lies_in_scratch_where_that_is_beside),
        cmocka_unit_test(every_injected_failure_leaves_the_folder_as_it_was),
        cmocka_unit_test(a_scratch_folder_is_held_by_one_process),
        cmocka_unit_test(a_folder_that_says_nothing_yet_is_taken_over),
        cmocka_unit_test(a_folder_of_somebody_else_stays_as_it_is),
        cmocka_unit_test(a_lock_that_is_a_link_is_not_followed),
        cmocka_unit_test(of_processes_that_start_together_the_others_hear_locked),
        cmocka_unit_test(what_a_killed_process_left_is_cleared),
        cmocka_unit_test(what_is_left_for_a_later_run_is_found_again),
        cmocka_unit_test(a_nameless_file_leaves_no_name),
    };
    return cmocka_run_group_tests(tests, strl_test_folder_make, strl_test_folder_remove);
}
