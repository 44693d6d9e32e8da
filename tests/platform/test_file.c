#include <fcntl.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#include <cmocka.h>

#include "base/memory.h"
#include "platform/file.h"
#include "platform/thread.h"
#include "support/folder.h"

static strl_file *must_create(const char *name)
{
    strl_file *file = NULL;
    strl_error err = {0};
    if (strl_file_create(strl_test_path(name), &file, &err) != STRL_OK)
        fail_msg("%s", err.message);
    return file;
}

static void make_file(const char *name, const char *text)
{
    strl_file *file = must_create(name);
    assert_int_equal(strl_file_write(file, 0, text, strlen(text), NULL), STRL_OK);
    assert_int_equal(strl_file_close(file, NULL), STRL_OK);
}

static void what_was_written_is_read_back_at_any_offset(void **state)
{
    (void)state;
    strl_file *file = must_create("a");
    assert_int_equal(strl_file_bytes(file), 0);
    assert_int_equal(strl_file_write(file, 5000000000u, "end", 3, NULL), STRL_OK);
    assert_int_equal(strl_file_write(file, 0, "begin", 5, NULL), STRL_OK);
    assert_true(strl_file_bytes(file) == 5000000003u);
    char text[8] = {0};
    assert_int_equal(strl_file_read(file, 5000000000u, text, 3, NULL), STRL_OK);
    assert_string_equal(text, "end");
    assert_int_equal(strl_file_close(file, NULL), STRL_OK);
    assert_int_equal(strl_file_open(strl_test_path("a"), &file, NULL), STRL_OK);
    assert_true(strl_file_bytes(file) == 5000000003u);
    assert_string_equal(strl_file_path(file), strl_test_path("a"));
    assert_int_equal(strl_file_read(file, 1, text, 4, NULL), STRL_OK);
    assert_memory_equal(text, "egin", 4);
    assert_int_equal(strl_file_write(file, 0, "x", 1, NULL), STRL_ERR_IO); /* opened to read */
    assert_int_equal(strl_file_close(file, NULL), STRL_OK);
    assert_int_equal(strl_file_close(NULL, NULL), STRL_OK);
}

static void a_short_read_says_where_the_file_ends(void **state)
{
    (void)state;
    make_file("short", "0123456789");
    strl_file *file = NULL;
    strl_error err = {0};
    char text[16];
    size_t got = 99;
    assert_int_equal(strl_file_open(strl_test_path("short"), &file, NULL), STRL_OK);
    assert_int_equal(strl_file_read(file, 8, text, 5, &err), STRL_ERR_FORMAT);
    assert_non_null(strstr(err.message, "ends at byte 10, expected 5 bytes from byte 8"));
    assert_int_equal(strl_file_read(file, 50, text, 1, &err), STRL_ERR_FORMAT);
    assert_non_null(strstr(err.message, "ends at byte 10, expected 1 bytes from byte 50"));
    assert_int_equal(strl_file_read(file, UINT64_MAX, text, 8, &err), STRL_ERR_FORMAT);
    assert_int_equal(strl_file_read_some(file, 8, text, 5, &got, NULL), STRL_OK);
    assert_int_equal(got, 2);
    assert_int_equal(strl_file_read_some(file, UINT64_MAX, text, 5, &got, NULL), STRL_OK);
    assert_int_equal(got, 0);
    assert_int_equal(strl_file_read(file, 10, text, 0, NULL), STRL_OK);
    strl_file_close(file, NULL);
}

static void what_is_no_regular_file_is_not_opened(void **state)
{
    (void)state;
    strl_file *file = NULL;
    strl_error err = {0};
    assert_int_equal(strl_file_open(strl_test_path("missing"), &file, &err), STRL_ERR_IO);
    assert_non_null(strstr(err.message, "missing"));
    assert_int_equal(strl_file_open(strl_test_folder, &file, &err), STRL_ERR_IO);
    assert_non_null(strstr(err.message, "folder"));
    assert_int_equal(strl_file_open("/dev/null", &file, &err), STRL_ERR_IO);
    assert_int_equal(mkfifo(strl_test_path("pipe"), 0600), 0);
    assert_int_equal(strl_file_open(strl_test_path("pipe"), &file, &err), STRL_ERR_IO); /* does not wait */
    assert_null(file);
    assert_int_equal(strl_file_create(strl_test_path("no/such/folder"), &file, &err), STRL_ERR_IO);
    assert_null(file);
}

static void a_long_path_does_not_hide_the_reason(void **state)
{
    (void)state;
    char path[2000];
    memset(path, 'x', sizeof path - 1);
    path[0] = '/';
    path[sizeof path - 1] = 0;
    strl_file *file = NULL;
    strl_error err = {0};
    assert_int_equal(strl_file_open(path, &file, &err), STRL_ERR_IO);
    assert_non_null(strstr(err.message, "too long"));
}

static void a_full_device_is_a_full_disk(void **state)
{
    (void)state;
    strl_file *file = NULL;
    strl_error err = {0};
    assert_int_equal(strl_file_create("/dev/full", &file, NULL), STRL_OK);
    assert_int_equal(strl_file_write(file, 0, "x", 1, &err), STRL_ERR_DISK_FULL);
    assert_non_null(strstr(err.message, "/dev/full"));
    assert_int_equal(strl_file_bytes(file), 0);
    strl_file_close(file, NULL);
}

static void a_write_past_the_largest_file_is_refused(void **state)
{
    (void)state;
    strl_file *file = must_create("huge");
    assert_int_equal(strl_file_write(file, UINT64_MAX, "x", 1, NULL), STRL_ERR_LIMIT);
    assert_int_equal(strl_file_write(file, INT64_MAX, "xy", 2, NULL), STRL_ERR_LIMIT);
    assert_int_equal(strl_file_bytes(file), 0);
    assert_int_equal(strl_file_close(file, NULL), STRL_OK);
}

static void a_file_size_limit_of_the_system_is_a_failure(void **state)
{
    (void)state;
    struct rlimit before, tight;
    getrlimit(RLIMIT_FSIZE, &before);
    tight = before;
    tight.rlim_cur = 4096;
    signal(SIGXFSZ, SIG_IGN);
    static const char block[8192];
    strl_file *file = must_create("limited");
    setrlimit(RLIMIT_FSIZE, &tight);
    /* half of it fits: a short write first */
    strl_status status = strl_file_write(file, 0, block, sizeof block, NULL);
    setrlimit(RLIMIT_FSIZE, &before);
    assert_int_equal(status, STRL_ERR_LIMIT);
    assert_int_equal(strl_file_bytes(file), 4096);
    assert_int_equal(strl_file_close(file, NULL), STRL_OK);
}

static void a_punched_range_reads_as_zeros_and_takes_no_blocks(void **state)
{
    (void)state;
    enum { SIZE = 1 << 20 };
    static char data[SIZE];
    memset(data, 7, SIZE);
    strl_file *file = must_create("holes");
    assert_int_equal(strl_file_write(file, 0, data, SIZE, NULL), STRL_OK);
    assert_int_equal(strl_file_sync(file, NULL), STRL_OK);
    struct stat before, after;
    stat(strl_test_path("holes"), &before);
    if (strl_file_punch(file, 65536, SIZE - 65536)) {
        stat(strl_test_path("holes"), &after);
        assert_true(after.st_blocks < before.st_blocks);
        assert_int_equal(after.st_size, SIZE);
        assert_int_equal(strl_file_read(file, 65535, data, 2, NULL), STRL_OK);
        assert_int_equal(data[0], 7);
        assert_int_equal(data[1], 0);
    }
    assert_false(strl_file_punch(file, UINT64_MAX, 1));
    strl_file_close(file, NULL);
}

static void one_file_has_one_identity_under_any_name(void **state)
{
    (void)state;
    make_file("one", "12345");
    make_file("two", "12345");
    assert_int_equal(link(strl_test_path("one"), strl_test_path("alias")), 0);
    strl_file_info one, alias, two, opened;
    assert_int_equal(strl_path_stat(strl_test_path("one"), &one, NULL), STRL_OK);
    assert_int_equal(strl_path_stat(strl_test_path("alias"), &alias, NULL), STRL_OK);
    assert_int_equal(strl_path_stat(strl_test_path("two"), &two, NULL), STRL_OK);
    assert_true(one.device == alias.device && one.inode == alias.inode);
    assert_true(one.inode != two.inode);
    assert_int_equal(one.bytes, 5);
    assert_false(one.is_directory);
    assert_true(one.modified_ns > 1500000000ull * 1000000000u);
    strl_file *file = NULL;
    assert_int_equal(strl_file_open(strl_test_path("alias"), &file, NULL), STRL_OK);
    assert_int_equal(strl_file_stat(file, &opened, NULL), STRL_OK);
    assert_true(opened.inode == one.inode);
    strl_file_close(file, NULL);
    assert_int_equal(strl_path_stat(strl_test_folder, &opened, NULL), STRL_OK);
    assert_true(opened.is_directory);
    assert_int_equal(strl_path_stat(strl_test_path("none"), &opened, NULL), STRL_ERR_IO);
}

static void a_rename_replaces_and_a_failed_one_changes_nothing(void **state)
{
    (void)state;
    make_file("from", "new");
    make_file("to", "older");
    assert_int_equal(strl_path_rename(strl_test_path("from"), strl_test_path("to"), NULL), STRL_OK);
    assert_false(strl_path_exists(strl_test_path("from")));
    strl_file_info info;
    assert_int_equal(strl_path_stat(strl_test_path("to"), &info, NULL), STRL_OK);
    assert_int_equal(info.bytes, 3);
    strl_error err = {0};
    assert_int_equal(strl_path_rename(strl_test_path("from"), strl_test_path("to"), &err), STRL_ERR_IO);
    assert_non_null(strstr(err.message, "/to"));
    assert_true(strl_path_exists(strl_test_path("to")));
    strl__alloc_fail_after(1);
    strl_status status = strl_path_rename(strl_test_path("to"), strl_test_path("from"), NULL);
    strl__alloc_fail_after(0);
    assert_int_equal(status, STRL_ERR_MEMORY);
    assert_true(strl_path_exists(strl_test_path("to")));
}

static void folders_are_made_and_removed_with_their_files_but_never_through_a_link(void **state)
{
    (void)state;
    assert_int_equal(strl_path_make_directory(strl_test_path("sub"), NULL), STRL_OK);
    assert_int_equal(strl_path_make_directory(strl_test_path("sub"), NULL), STRL_OK);
    make_file("sub/a", "a");
    make_file("sub/b", "b");
    make_file("plain", "p");
    assert_int_equal(strl_path_make_directory(strl_test_path("plain"), NULL), STRL_ERR_IO);
    assert_int_equal(symlink(strl_test_path("sub"), strl_test_path("link")), 0);
    assert_int_equal(strl_path_remove_directory(strl_test_path("link"), NULL), STRL_ERR_IO);
    assert_true(strl_path_exists(strl_test_path("sub/a")));
    assert_int_equal(strl_path_make_directory(strl_test_path("sub/inner"), NULL), STRL_OK);
    assert_int_equal(strl_path_remove_directory(strl_test_path("sub"), NULL), STRL_ERR_IO);
    assert_int_equal(strl_path_remove_directory(strl_test_path("sub/inner"), NULL), STRL_OK);
    make_file("sub/c", "c");
    assert_int_equal(strl_path_remove_directory(strl_test_path("sub"), NULL), STRL_OK);
    assert_false(strl_path_exists(strl_test_path("sub")));
    assert_int_equal(strl_path_remove_directory(strl_test_path("sub"), NULL), STRL_OK);
    assert_int_equal(strl_path_remove(strl_test_path("link"), NULL), STRL_OK);
    assert_int_equal(strl_path_remove(strl_test_path("link"), NULL), STRL_OK);
}

static void joining_puts_one_slash_between(void **state)
{
    (void)state;
    const char *const cases[][3] = {{"a", "b", "a/b"}, {"a/", "b", "a/b"}, {"/", "b", "/b"}, {"", "b", "b"}};
    for (size_t i = 0; i < 4; i++) {
        char *path = strl_path_join(cases[i][0], cases[i][1]);
        assert_string_equal(path, cases[i][2]);
        strl__free(path);
    }
}

static void free_space_is_told(void **state)
{
    (void)state;
    uint64_t bytes = 0;
    assert_int_equal(strl_path_free_bytes(strl_test_folder, &bytes, NULL), STRL_OK);
    assert_true(bytes > 0);
    assert_int_equal(strl_path_free_bytes(strl_test_path("none"), &bytes, NULL), STRL_ERR_IO);
}

static void a_lock_has_one_holder_until_it_is_released(void **state)
{
    (void)state;
    strl_lock *first = NULL, *second = NULL;
    strl_error err = {0};
    assert_int_equal(strl_lock_acquire(strl_test_path("lock"), &first, NULL), STRL_OK);
    assert_int_equal(strl_lock_acquire(strl_test_path("lock"), &second, &err), STRL_ERR_IO);
    assert_null(second);
    assert_non_null(strstr(err.message, "locked"));
    strl_lock_release(first);
    assert_int_equal(strl_lock_acquire(strl_test_path("lock"), &second, NULL), STRL_OK);
    strl_lock_release(second);
    strl_lock_release(NULL);
    assert_int_equal(strl_lock_acquire(strl_test_path("no/lock"), &first, NULL), STRL_ERR_IO);
}

static void a_lock_ends_with_its_process(void **state)
{
    (void)state;
    int ready[2], stop[2];
    assert_int_equal(pipe(ready) | pipe(stop), 0);
    pid_t child = fork();
    if (child == 0) {
        close(stop[1]); /* or the child would keep its own end open and never hear of ours closing */
        strl_lock *lock = NULL;
        char byte = strl_lock_acquire(strl_test_path("child"), &lock, NULL) == STRL_OK ? 'y' : 'n';
        _exit(write(ready[1], &byte, 1) == 1 && read(stop[0], &byte, 1) == 0 ? 0 : 1);
    }
    char byte = 0;
    assert_int_equal(read(ready[0], &byte, 1), 1);
    assert_int_equal(byte, 'y');
    strl_lock *lock = NULL;
    assert_int_equal(strl_lock_acquire(strl_test_path("child"), &lock, NULL), STRL_ERR_IO);
    close(stop[1]);
    waitpid(child, NULL, 0);
    assert_int_equal(strl_lock_acquire(strl_test_path("child"), &lock, NULL), STRL_OK);
    strl_lock_release(lock);
    close(stop[0]);
    close(ready[0]);
    close(ready[1]);
}

/* Every call that can fail for the system's reasons, in the order of a small build. */
static strl_status write_and_publish(strl_error *err)
{
    strl_file *file = NULL;
    strl_lock *lock = NULL;
    char text[30];
    strl_status status = strl_lock_acquire(strl_test_path("f.lock"), &lock, err);
    if (status == STRL_OK)
        status = strl_file_create(strl_test_path("f.tmp"), &file, err);
    for (uint64_t i = 0; status == STRL_OK && i < 3; i++)
        status = strl_file_write(file, i * 10, "0123456789", 10, err);
    for (uint64_t i = 0; status == STRL_OK && i < 3; i++)
        status = strl_file_read(file, i * 10, text, 10, err);
    strl_status closed = strl_file_close(file, status == STRL_OK ? err : NULL);
    status = status == STRL_OK ? closed : status;
    if (status == STRL_OK)
        status = strl_path_rename(strl_test_path("f.tmp"), strl_test_path("f"), err);
    strl_lock_release(lock);
    return status;
}

static void every_injected_failure_is_reported_and_publishes_nothing(void **state)
{
    (void)state;
    void (*const hooks[])(uint64_t) = {strl__alloc_fail_after, strl_file_fail_reads_after, strl_file_fail_writes_after};
    const strl_status expected[] = {STRL_ERR_MEMORY, STRL_ERR_IO, STRL_ERR_DISK_FULL};
    const uint64_t budgets[] = {1 + 2 + 1 + 1, 4,
                                4}; /* lock, file and path, parent folder | 3 reads | 3 writes, and one */
    for (size_t i = 0; i < 3; i++) {
        uint64_t budget = 0;
        strl_status status;
        do {
            strl_error err = {0};
            assert_int_equal(strl_path_remove(strl_test_path("f"), NULL), STRL_OK);
            hooks[i](++budget);
            status = write_and_publish(&err);
            hooks[i](0);
            assert_true(status == STRL_OK || status == expected[i]);
            assert_true((status == STRL_OK) == strl_path_exists(strl_test_path("f")));
            assert_int_equal(err.status, status);
        } while (status != STRL_OK);
        assert_int_equal(budget, budgets[i]);
    }
}

typedef struct meeting {
    strl_mutex mutex;
    strl_condition changed;
    unsigned arrived;
    bool signals_blocked;
} meeting;

static void arrive(void *context)
{
    meeting *self = context;
    sigset_t mask;
    pthread_sigmask(SIG_SETMASK, NULL, &mask);
    strl_mutex_lock(&self->mutex);
    self->signals_blocked = sigismember(&mask, SIGINT) && sigismember(&mask, SIGTERM);
    self->arrived++;
    strl_condition_signal(&self->changed);
    strl_mutex_unlock(&self->mutex);
}

static void threads_run_wait_and_leave_signals_to_the_host(void **state)
{
    (void)state;
    meeting self = {.arrived = 0};
    strl_mutex_init(&self.mutex);
    strl_condition_init(&self.changed);
    strl_thread *threads[3];
    for (unsigned i = 0; i < 3; i++)
        assert_int_equal(strl_thread_start(&threads[i], arrive, &self, NULL), STRL_OK);
    strl_mutex_lock(&self.mutex);
    while (self.arrived < 3)
        strl_condition_wait(&self.changed, &self.mutex);
    strl_mutex_unlock(&self.mutex);
    for (unsigned i = 0; i < 3; i++)
        strl_thread_join(threads[i]);
    strl_thread_join(NULL);
    assert_true(self.signals_blocked);
    sigset_t mask;
    pthread_sigmask(SIG_SETMASK, NULL, &mask);
    assert_false(sigismember(&mask, SIGINT));
    strl_condition_deinit(&self.changed);
    strl_mutex_deinit(&self.mutex);
}

static void clocks_advance_and_processors_are_counted(void **state)
{
    (void)state;
    uint64_t start_ns = strl_clock_ns(), cpu_ns = strl_clock_cpu_ns();
    strl_sleep_ns(3000000);
    uint64_t slept_ns = strl_clock_ns() - start_ns;
    assert_true(slept_ns >= 3000000);
    while (strl_clock_cpu_ns() - cpu_ns < 1000000)
        ;
    assert_in_range(strl_cpu_count(), 1, 65536);
}

static void a_reopened_file_is_cut_and_goes_on(void **state)
{
    (void)state;
    strl_file *file = NULL;
    strl_error err = {0};
    char text[8] = "";
    make_file("again", "abcdef");
    assert_int_equal(strl_file_reopen(strl_test_path("again"), 7, &file, &err), STRL_ERR_FORMAT);
    assert_null(file);
    assert_non_null(strstr(err.message, "ends at byte 6, expected 7"));
    assert_int_equal(strl_file_reopen(strl_test_path("again"), 4, &file, NULL), STRL_OK);
    assert_int_equal(strl_file_bytes(file), 4);
    assert_int_equal(strl_file_write(file, 4, "XY", 2, NULL), STRL_OK);
    assert_int_equal(strl_file_read(file, 0, text, 6, NULL), STRL_OK);
    assert_string_equal(text, "abcdXY");
    assert_int_equal(strl_file_close(file, NULL), STRL_OK);
    assert_int_equal(strl_path_remove(strl_test_path("again"), NULL), STRL_OK);
    assert_int_equal(strl_file_reopen(strl_test_path("again"), 0, &file, NULL), STRL_ERR_IO);
    assert_int_equal(strl_file_reopen(strl_test_path("."), 0, &file, NULL), STRL_ERR_IO);
}

static void touch_pages(size_t bytes)
{
    void *pages = mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (pages == MAP_FAILED)
        return;
    memset(pages, 1, bytes);
    munmap(pages, bytes);
}

static void the_peak_resident_set_counts_what_was_freed_and_what_children_held(void **state)
{
    (void)state;
    const size_t step = (size_t)64 << 20;
    uint64_t before = strl_process_peak_rss_bytes();
    assert_true(before > 0);
    touch_pages(step);
    uint64_t own = strl_process_peak_rss_bytes();
    assert_in_range(own, step, before + 8 * step); /* thread sanitizer shadows each page with up to five */
    pid_t child = fork();
    if (child == 0) {
        touch_pages(own + step);
        _exit(0);
    }
    waitpid(child, NULL, 0);
    assert_true(strl_process_peak_rss_bytes() >= own + step);
}

static void a_thread_waits_for_the_disk_only_where_it_reads_from_it(void **state)
{
    (void)state;
    const size_t size = (size_t)4 << 20;
    uint8_t *bytes = calloc(size, 1);
    strl_file *file = NULL;
    assert_non_null(bytes);
    assert_int_equal(strl_file_create("test_file_waits", &file, NULL), STRL_OK);
    assert_int_equal(strl_file_write(file, 0, bytes, size, NULL), STRL_OK);
    assert_int_equal(strl_file_sync(file, NULL), STRL_OK);
    uint64_t before = strl_thread_disk_waits();
    assert_int_equal(strl_file_read(file, 0, bytes, size, NULL), STRL_OK);
    uint64_t kept = strl_thread_disk_waits() - before;
    int descriptor = open("test_file_waits", O_RDONLY);
    assert_true(descriptor >= 0);
    bool forgotten = posix_fadvise(descriptor, 0, 0, POSIX_FADV_DONTNEED) == 0;
    close(descriptor);
    before = strl_thread_disk_waits();
    assert_int_equal(strl_file_read(file, 0, bytes, size, NULL), STRL_OK);
    uint64_t fetched = strl_thread_disk_waits() - before;
    assert_true(kept <= 16); /* pages of the program itself */
    /* A file system in memory forgets nothing. */
    assert_true(!forgotten || fetched == 0 || fetched >= size / 512 / 2);
    strl_file_close(file, NULL);
    remove("test_file_waits");
    free(bytes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_was_written_is_read_back_at_any_offset),
        cmocka_unit_test(a_short_read_says_where_the_file_ends),
        cmocka_unit_test(what_is_no_regular_file_is_not_opened),
        cmocka_unit_test(a_reopened_file_is_cut_and_goes_on),
        cmocka_unit_test(a_long_path_does_not_hide_the_reason),
        cmocka_unit_test(a_full_device_is_a_full_disk),
        cmocka_unit_test(a_write_past_the_largest_file_is_refused),
        cmocka_unit_test(a_file_size_limit_of_the_system_is_a_failure),
        cmocka_unit_test(a_punched_range_reads_as_zeros_and_takes_no_blocks),
        cmocka_unit_test(one_file_has_one_identity_under_any_name),
        cmocka_unit_test(a_rename_replaces_and_a_failed_one_changes_nothing),
        cmocka_unit_test(folders_are_made_and_removed_with_their_files_but_never_through_a_link),
        cmocka_unit_test(joining_puts_one_slash_between),
        cmocka_unit_test(free_space_is_told),
        cmocka_unit_test(a_lock_has_one_holder_until_it_is_released),
        cmocka_unit_test(a_lock_ends_with_its_process),
        cmocka_unit_test(every_injected_failure_is_reported_and_publishes_nothing),
        cmocka_unit_test(threads_run_wait_and_leave_signals_to_the_host),
        cmocka_unit_test(a_thread_waits_for_the_disk_only_where_it_reads_from_it),
        cmocka_unit_test(clocks_advance_and_processors_are_counted),
        cmocka_unit_test(the_peak_resident_set_counts_what_was_freed_and_what_children_held),
    };
    return cmocka_run_group_tests(tests, strl_test_folder_make, strl_test_folder_remove);
}
