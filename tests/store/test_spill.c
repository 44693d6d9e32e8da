#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <cmocka.h>

#include "base/hash.h"
#include "base/memory.h"
#include "jobs/pool.h"
#include "platform/file.h"
#include "store/spill.h"
#include "support/folder.h"

#define KIB ((size_t)1 << 10)

static strl_spill_set *make_set(uint64_t limit_bytes)
{
    strl_spill_set *set = NULL;
    strl_error err = {0};
    if (strl_spill_set_create(strl_test_folder, limit_bytes, &set, &err) != STRL_OK)
        fail_msg("%s", err.message);
    return set;
}

static strl_spill *must_open(strl_spill_set *set, const char *name, size_t buffer_bytes)
{
    strl_spill *spill = NULL;
    strl_error err = {0};
    if (strl_spill_open(set, name, buffer_bytes, &spill, &err) != STRL_OK)
        fail_msg("%s", err.message);
    return spill;
}

static bool on_disk(const char *name)
{
    char file[64];
    snprintf(file, sizeof file, "%s" STRL_SPILL_SUFFIX, name);
    char *path = strl_path_join(strl_test_folder, file);
    bool exists = strl_path_exists(path);
    strl__free(path);
    return exists;
}

/* The byte that belongs at a position of a stream, so that misplaced bytes show. */
static uint8_t byte_at(uint64_t stream, uint64_t position)
{
    return (uint8_t)strl__mix64(stream * 1000003 + position);
}

static void fill(uint8_t *data, uint64_t stream, uint64_t position, size_t size)
{
    for (size_t i = 0; i < size; i++)
        data[i] = byte_at(stream, position + i);
}

static strl_status append_pattern(strl_spill *spill, uint64_t stream, size_t size, strl_error *err)
{
    uint8_t data[8192];
    fill(data, stream, strl_spill_bytes(spill), size);
    return strl_spill_append(spill, data, size, err);
}

static strl_status check_pattern(strl_spill *spill, uint64_t stream, uint64_t offset, size_t size, strl_error *err)
{
    uint8_t data[8192], expected[8192];
    fill(expected, stream, offset, size);
    strl_status status = strl_spill_read(spill, offset, data, size, err);
    if (status == STRL_OK)
        assert_memory_equal(data, expected, size);
    return status;
}

static void what_was_appended_in_any_sizes_is_read_at_any_offset(void **state)
{
    (void)state;
    const size_t buffers[] = {1, 7, 4096, 0};
    for (size_t b = 0; b < 4; b++) {
        strl_spill_set *set = make_set(0);
        strl_spill *spill = must_open(set, "runs", buffers[b]);
        uint64_t total = 0;
        for (size_t i = 0; i < 600; i++) {
            size_t size = (size_t)(strl__mix64(i + 1) % (i % 50 == 0 ? 8192 : 40));
            assert_int_equal(append_pattern(spill, 3, size, NULL), STRL_OK);
            total += size;
            assert_int_equal(strl_spill_bytes(spill), total);
        }
        assert_int_equal(strl_spill_flush(spill, NULL), STRL_OK);
        assert_int_equal(strl_spill_flush(spill, NULL), STRL_OK);
        assert_int_equal(strl_spill_set_bytes(set), total);
        for (uint64_t offset = 0; offset + 1000 < total; offset += 777)
            assert_int_equal(check_pattern(spill, 3, offset, 1000, NULL), STRL_OK);
        assert_int_equal(append_pattern(spill, 3, 10, NULL), STRL_OK); /* after a flush it goes on */
        assert_int_equal(strl_spill_flush(spill, NULL), STRL_OK);
        assert_int_equal(check_pattern(spill, 3, total, 10, NULL), STRL_OK);
        assert_int_equal(strl_spill_close_and_delete(spill, NULL), STRL_OK);
        assert_false(on_disk("runs"));
        strl_spill_set_destroy(set);
    }
}

static void only_flushed_bytes_can_be_read(void **state)
{
    (void)state;
    strl_spill_set *set = make_set(0);
    strl_spill *spill = must_open(set, "a", 100);
    strl_error err = {0};
    uint8_t data[200];
    assert_int_equal(append_pattern(spill, 1, 60, NULL), STRL_OK);
    assert_int_equal(strl_spill_read(spill, 0, data, 1, &err), STRL_ERR_ARGUMENT);
    assert_int_equal(append_pattern(spill, 1, 60, NULL), STRL_OK);
    assert_int_equal(check_pattern(spill, 1, 0, 60, NULL), STRL_OK);
    assert_int_equal(strl_spill_read(spill, 60, data, 1, &err), STRL_ERR_ARGUMENT);
    assert_int_equal(strl_spill_read(spill, UINT64_MAX, data, 2, &err), STRL_ERR_ARGUMENT);
    assert_int_equal(strl_spill_read(spill, 1, data, SIZE_MAX, &err), STRL_ERR_ARGUMENT);
    assert_int_equal(strl_spill_read(spill, 59, data, 2, &err), STRL_ERR_ARGUMENT);
    assert_non_null(strstr(err.message, "2 bytes at byte 59 of the scratch file a, which has 60"));
    strl_spill_set_destroy(set);
}

static void the_set_counts_what_is_on_disk_now_and_at_most(void **state)
{
    (void)state;
    strl_spill_set *set = make_set(0);
    strl_spill *a = must_open(set, "a", 1), *b = must_open(set, "b", 1);
    for (unsigned i = 0; i < 64; i++) {
        assert_int_equal(append_pattern(a, 1, 4096, NULL), STRL_OK);
        assert_int_equal(append_pattern(b, 2, 4096, NULL), STRL_OK);
    }
    assert_int_equal(strl_spill_set_bytes(set), 512 * KIB);
    assert_int_equal(strl_spill_close_and_delete(a, NULL), STRL_OK);
    assert_int_equal(strl_spill_set_bytes(set), 256 * KIB);
    assert_int_equal(strl_spill_set_peak_bytes(set), 512 * KIB);
    char *path = strl_path_join(strl_test_folder, "b" STRL_SPILL_SUFFIX);
    struct stat facts;
    strl_spill_drop(b, 90 * KIB, 40 * KIB); /* 96 to 128 KiB are whole steps of it */
    strl_spill_drop(b, 1 * KIB, 89 * KIB);  /* all but the first */
    uint64_t left = strl_spill_set_bytes(set);
    assert_int_equal(stat(path, &facts), 0);
    if (left != 256 * KIB) { /* a file system that can punch */
        assert_int_equal(left, 144 * KIB);
        assert_true((uint64_t)facts.st_blocks * 512 <= 144 * KIB + 64 * KIB);
    }
    uint8_t byte;
    strl_error err = {0};
    assert_int_equal(strl_spill_read(b, 128 * KIB - 1, &byte, 1, &err), STRL_ERR_ARGUMENT);
    assert_non_null(strstr(err.message, "1 bytes at byte 131071 of the scratch file b, which were dropped"));
    assert_int_equal(check_pattern(b, 2, 0, 1 * KIB, NULL), STRL_OK);
    assert_int_equal(check_pattern(b, 2, 130 * KIB, 4096, NULL), STRL_OK);
    strl_spill_drop(b, 0, 1 * KIB);
    strl_spill_drop(b, 130 * KIB, 126 * KIB);
    assert_true(left == 256 * KIB || strl_spill_set_bytes(set) == 0);
    assert_int_equal(append_pattern(b, 2, 100, NULL), STRL_OK); /* it still grows */
    assert_int_equal(check_pattern(b, 2, 256 * KIB, 100, NULL), STRL_OK);
    assert_int_equal(strl_spill_close_and_delete(b, NULL), STRL_OK);
    assert_int_equal(strl_spill_set_bytes(set), 0);
    assert_int_equal(strl_spill_set_peak_bytes(set), 512 * KIB);
    strl__free(path);
    strl_spill_set_destroy(set);
}

static void the_limit_holds_over_all_streams_and_frees_with_them(void **state)
{
    (void)state;
    strl_spill_set *set = make_set(10000);
    strl_spill *a = must_open(set, "a", 1), *b = must_open(set, "b", 1);
    strl_error err = {0};
    assert_int_equal(append_pattern(a, 1, 6000, NULL), STRL_OK);
    assert_int_equal(append_pattern(b, 2, 4001, &err), STRL_ERR_LIMIT);
    assert_non_null(strstr(err.message, "holds 6000 bytes, 4001 more would pass its limit of 10000"));
    assert_non_null(strstr(err.message, strl_test_folder));
    assert_int_equal(strl_spill_bytes(b), 0);
    assert_int_equal(append_pattern(b, 2, 4000, NULL), STRL_OK);
    assert_int_equal(strl_spill_close_and_delete(a, NULL), STRL_OK);
    assert_int_equal(append_pattern(b, 2, 6000, NULL), STRL_OK);
    assert_int_equal(check_pattern(b, 2, 0, 8000, NULL), STRL_OK);
    assert_int_equal(strl_spill_set_peak_bytes(set), 10000);
    assert_int_equal(strl_spill_close_and_delete(b, NULL), STRL_OK);
    strl_spill_set_destroy(set);
}

static void a_full_disk_loses_nothing_and_the_stream_goes_on(void **state)
{
    (void)state;
    strl_spill_set *set = make_set(0);
    strl_spill *spill = must_open(set, "a", 1000);
    strl_error err = {0};
    assert_int_equal(append_pattern(spill, 1, 900, NULL), STRL_OK);
    strl_file_fail_writes_after(1);
    strl_status appended = append_pattern(spill, 1, 200, &err);
    strl_status flushed = strl_spill_flush(spill, NULL);
    strl_file_fail_writes_after(0);
    assert_int_equal(appended, STRL_ERR_DISK_FULL);
    assert_int_equal(flushed, STRL_ERR_DISK_FULL);
    assert_non_null(strstr(err.message, strl_test_folder));
    assert_int_equal(strl_spill_bytes(spill), 900);
    assert_int_equal(strl_spill_set_bytes(set), 0);
    assert_int_equal(strl_spill_set_peak_bytes(set), 0);
    assert_int_equal(append_pattern(spill, 1, 200, NULL), STRL_OK);
    assert_int_equal(strl_spill_flush(spill, NULL), STRL_OK);
    assert_int_equal(check_pattern(spill, 1, 0, 1100, NULL), STRL_OK);
    assert_int_equal(strl_spill_close_and_delete(spill, NULL), STRL_OK);
    strl_spill_set_destroy(set);
}

static void names_are_plain_and_open_once(void **state)
{
    (void)state;
    strl_spill_set *set = make_set(0);
    strl_spill *spill = must_open(set, "a", 0), *other = NULL;
    const char *const bad[] = {"a", "", "x/y", "../a", ".hidden"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        assert_int_equal(strl_spill_open(set, bad[i], 0, &other, NULL), STRL_ERR_ARGUMENT);
        assert_null(other);
    }
    assert_int_equal(strl_spill_close_and_delete(spill, NULL), STRL_OK);
    assert_int_equal(strl_spill_close_and_delete(NULL, NULL), STRL_OK);
    strl_spill_set_destroy(set);
    strl_spill_set_destroy(NULL);
    assert_int_equal(strl_spill_set_create("/nowhere/at/all", 0, &set, NULL), STRL_ERR_IO);
    assert_null(set);
}

/* ---- kept streams ---- */
static strl_spill *must_keep(strl_spill_set *set, const char *name)
{
    strl_spill *spill = NULL;
    strl_error err = {0};
    if (strl_spill_open_kept(set, name, 1000, &spill, &err) != STRL_OK)
        fail_msg("%s", err.message);
    return spill;
}

static strl_spill *must_take(strl_spill_set *set, const char *name)
{
    strl_spill *spill = NULL;
    strl_error err = {0};
    if (strl_spill_take(set, name, &spill, &err) != STRL_OK)
        fail_msg("%s", err.message);
    return spill;
}

static void must_append(strl_spill *spill, uint64_t stream, size_t bytes)
{
    for (size_t size; bytes > 0; bytes -= size) {
        size = bytes < 700 ? bytes : 700;
        assert_int_equal(append_pattern(spill, stream, size, NULL), STRL_OK);
    }
}

static void save(strl_spill_set *set, strl_writer *saved)
{
    saved->size = 0;
    assert_int_equal(strl_spill_set_save(set, saved, NULL), STRL_OK);
}

static strl_spill_set *restore(const strl_writer *saved)
{
    strl_spill_set *set = make_set(0);
    strl_cursor cursor = strl_cursor_make(saved->data, saved->size);
    strl_error err = {0};
    if (strl_spill_set_restore(set, &cursor, &err) != STRL_OK)
        fail_msg("%s", err.message);
    assert_int_equal(strl_cursor_left(&cursor), 0);
    return set;
}

static strl_status check(strl_spill_set *set, strl_error *err)
{
    return strl_spill_set_check(set, NULL, NULL, err);
}

static void change_byte(const char *file, long at)
{
    char *path = strl_path_join(strl_test_folder, file);
    FILE *stream = fopen(path, "r+b");
    assert_non_null(stream);
    fseek(stream, at, SEEK_SET);
    int byte = fgetc(stream);
    fseek(stream, at, SEEK_SET);
    fputc(byte ^ 1, stream);
    fclose(stream);
    strl__free(path);
}

static void a_later_run_goes_on_from_the_last_save(void **state)
{
    (void)state;
    strl_writer saved = {0};
    uint64_t bytes = 100000;
    strl_spill_set *set = make_set(0);
    must_append(must_keep(set, "a"), 5, bytes);
    must_append(must_open(set, "other", 0), 6, 100);
    save(set, &saved);
    strl_spill_set_destroy(set);
    for (unsigned run = 0; run < 4; run++) {
        strl_spill *spill = NULL;
        set = restore(&saved);
        assert_int_equal(check(set, NULL), STRL_OK);
        assert_int_equal(strl_spill_take(set, "other", &spill, NULL), STRL_ERR_FORMAT);
        spill = must_take(set, "a");
        assert_int_equal(strl_spill_take(set, "a", &spill, NULL), STRL_ERR_FORMAT); /* once */
        spill = NULL;
        assert_int_equal(strl_spill_open_kept(set, "a", 0, &spill, NULL), STRL_ERR_ARGUMENT);
        assert_true(strl_spill_set_uses(set, "a" STRL_SPILL_SUFFIX));
        assert_false(strl_spill_set_uses(set, "other" STRL_SPILL_SUFFIX));
        assert_int_equal(strl_spill_set_bytes(set), bytes);
        strl_spill_set_destroy(set);
        set = restore(&saved);
        spill = must_take(set, "a");
        assert_int_equal(check_pattern(spill, 5, bytes - 8000, 8000, NULL), STRL_OK);
        must_append(spill, 5, 33000);
        save(set, &saved);
        bytes += 33000;
        must_append(spill, 5, 7777); /* lost */
        assert_int_equal(strl_spill_flush(spill, NULL), STRL_OK);
        assert_int_equal(strl_spill_set_peak_bytes(set), bytes + 7777);
        strl_spill_set_destroy(set);
    }
    strl__free(saved.data);
}

static void what_a_save_needs_stays_until_the_next(void **state)
{
    (void)state;
    strl_writer saved = {0};
    strl_spill_set *set = make_set(0);
    strl_spill *a = must_keep(set, "a"), *b = must_keep(set, "b");
    must_append(a, 1, 128 * KIB);
    must_append(b, 2, 1000);
    save(set, &saved);
    strl_spill_set_settle(set);
    strl_spill_drop(a, 0, 70 * KIB);
    assert_int_equal(strl_spill_close_and_delete(b, NULL), STRL_OK);
    assert_int_equal(strl_spill_set_bytes(set), 128 * KIB + 1000);
    assert_int_equal(check_pattern(a, 1, 0, 1, NULL), STRL_ERR_ARGUMENT); /* dropped all the same */
    strl_spill_set_destroy(set);

    set = restore(&saved); /* as if nothing had been dropped */
    assert_int_equal(check(set, NULL), STRL_OK);
    a = must_take(set, "a");
    b = must_take(set, "b");
    assert_int_equal(check_pattern(a, 1, 0, 8000, NULL), STRL_OK);
    strl_spill_drop(a, 0, 70 * KIB);
    assert_int_equal(strl_spill_close_and_delete(b, NULL), STRL_OK);
    save(set, &saved);
    assert_true(on_disk("b"));
    strl_spill_set_settle(set);
    assert_false(on_disk("b"));
    assert_true(strl_spill_set_bytes(set) == 64 * KIB || strl_spill_set_bytes(set) == 128 * KIB);
    strl_spill_set_destroy(set);

    set = restore(&saved); /* the holes are not missed */
    assert_int_equal(check(set, NULL), STRL_OK);
    a = must_take(set, "a");
    assert_int_equal(check_pattern(a, 1, 60 * KIB, 1, NULL), STRL_ERR_ARGUMENT);
    assert_int_equal(check_pattern(a, 1, 72 * KIB, 8000, NULL), STRL_OK);
    strl_spill_drop(a, 70 * KIB, 58 * KIB); /* the step that was half dropped goes, too */
    save(set, &saved);
    strl_spill_set_settle(set);
    assert_true(strl_spill_set_bytes(set) == 0 || strl_spill_set_bytes(set) == 128 * KIB);
    strl_spill_close(a);
    assert_true(on_disk("a"));
    strl_spill_set_destroy(set);
    strl__free(saved.data);
}

static void damage_is_found_where_the_bytes_are_needed(void **state)
{
    (void)state;
    strl_writer saved = {0};
    strl_error err = {0};
    strl_spill_set *set = make_set(0);
    strl_spill *a = must_keep(set, "a");
    must_append(a, 1, 50 * KIB);
    strl_spill_drop(a, 0, 16 * KIB);
    save(set, &saved);
    strl_spill_set_destroy(set);
    const struct {
        long at;
        const char *says;
    } places[] = {
        {100, NULL}, {16384, "bytes 16384 to 32767"}, {32767, "bytes 16384 to 32767"}, {51199, "bytes 49152 to 51199"}};
    for (size_t i = 0; i < sizeof places / sizeof *places; i++) {
        change_byte("a" STRL_SPILL_SUFFIX, places[i].at);
        set = restore(&saved);
        assert_int_equal(check(set, &err), places[i].says ? STRL_ERR_FORMAT : STRL_OK);
        assert_true(!places[i].says || strstr(err.message, places[i].says));
        strl_spill_set_destroy(set);
        change_byte("a" STRL_SPILL_SUFFIX, places[i].at);
    }
    char *path = strl_path_join(strl_test_folder, "a" STRL_SPILL_SUFFIX);
    assert_int_equal(truncate(path, 51199), 0);
    set = make_set(0);
    strl_cursor cursor = strl_cursor_make(saved.data, saved.size);
    assert_int_equal(strl_spill_set_restore(set, &cursor, &err), STRL_ERR_FORMAT);
    assert_non_null(strstr(err.message, "ends at byte 51199, expected 51200"));
    strl_spill_set_destroy(set);
    strl__free(path);
    strl__free(saved.data);
}

static void a_save_cut_off_anywhere_is_refused(void **state)
{
    (void)state;
    strl_writer saved = {0};
    strl_spill_set *set = make_set(0);
    must_append(must_keep(set, "a"), 1, 40 * KIB);
    must_append(must_keep(set, "b"), 2, 10);
    save(set, &saved);
    strl_spill_set_destroy(set);
    for (size_t size = 0; size < saved.size; size++) {
        set = make_set(0);
        uint8_t *copy = strl__alloc(size, 1); /* so that a sanitizer sees what is read behind it */
        memcpy(copy, saved.data, size);
        strl_cursor cursor = strl_cursor_make(copy, size);
        strl_error err = {0};
        assert_int_equal(strl_spill_set_restore(set, &cursor, &err), STRL_ERR_FORMAT);
        assert_true(strlen(err.message) > 12);
        strl_spill_set_destroy(set);
        strl__free(copy);
    }
    strl__free(saved.data);
}

static strl_status fill_and_check(void *context, uint64_t index, unsigned worker, strl_error *err)
{
    (void)worker;
    strl_spill_set *set = context;
    strl_spill *spill = NULL;
    char name[16];
    snprintf(name, sizeof name, "t%u", (unsigned)index);
    strl_status status = strl_spill_open(set, name, 1000, &spill, err);
    for (unsigned i = 0; status == STRL_OK && i < 50; i++)
        status = append_pattern(spill, index, 300, err);
    if (status == STRL_OK)
        status = strl_spill_flush(spill, err);
    for (uint64_t at = 0; status == STRL_OK && at < 15000; at += 5000) {
        uint8_t data[5000], expected[5000];
        fill(expected, index, at, sizeof expected);
        status = strl_spill_read(spill, at, data, sizeof data, err);
        if (status == STRL_OK && memcmp(data, expected, sizeof data) != 0)
            status = STRL_ERR_INTERNAL;
    }
    strl_status closed = index % 2 ? strl_spill_close_and_delete(spill, NULL) : STRL_OK;
    return status == STRL_OK ? closed : status;
}

static void streams_of_several_threads_share_one_count(void **state)
{
    (void)state;
    strl_pool *pool = NULL;
    assert_int_equal(strl_pool_create(7, &pool, NULL), STRL_OK);
    strl_spill_set *set = make_set(40 * 15000);
    strl_error err = {0};
    if (strl_pool_for(pool, 40, fill_and_check, set, NULL, &err) != STRL_OK)
        fail_msg("%s", err.message);
    assert_int_equal(strl_spill_set_bytes(set), 20 * 15000);
    assert_in_range(strl_spill_set_peak_bytes(set), 20 * 15000, 40 * 15000);
    strl_pool_destroy(pool);
    strl_spill_set_destroy(set);
}

static strl_status use_everything(strl_error *err)
{
    strl_spill_set *set = NULL;
    strl_spill *spill = NULL;
    strl_status status = strl_spill_set_create(strl_test_folder, 1 << 20, &set, err);
    if (status == STRL_OK)
        status = strl_spill_open(set, "fault", 1000, &spill, err);
    for (unsigned i = 0; status == STRL_OK && i < 20; i++)
        status = append_pattern(spill, 9, 300, err);
    if (status == STRL_OK)
        status = strl_spill_flush(spill, err);
    for (uint64_t at = 0; status == STRL_OK && at < 6000; at += 2000)
        status = check_pattern(spill, 9, at, 2000, err);
    if (status == STRL_OK)
        status = strl_spill_close_and_delete(spill, err);
    if (status == STRL_OK)
        assert_int_equal(strl_spill_set_bytes(set), 0);
    strl_spill_set_destroy(set);
    return status;
}

static void every_injected_failure_is_reported(void **state)
{
    (void)state;
    void (*const hooks[])(uint64_t) = {strl__alloc_fail_after, strl_file_fail_reads_after, strl_file_fail_writes_after};
    const strl_status expected[] = {STRL_ERR_MEMORY, STRL_ERR_IO, STRL_ERR_DISK_FULL};
    /* set, stream, path, file, buffer, path: 9 allocations; 3 reads; 20 appends of 300 bytes by threes: 7 writes */
    const uint64_t budgets[] = {10, 4, 8};
    for (size_t i = 0; i < 3; i++) {
        uint64_t budget = 0;
        strl_status status;
        do {
            strl_error err = {0};
            hooks[i](++budget);
            status = use_everything(&err);
            hooks[i](0);
            assert_true(status == STRL_OK || status == expected[i]);
            assert_int_equal(err.status, status);
            assert_true(status == STRL_OK || err.message[0]);
        } while (status != STRL_OK);
        assert_int_equal(budget, budgets[i]);
        assert_false(on_disk("fault"));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_was_appended_in_any_sizes_is_read_at_any_offset),
        cmocka_unit_test(only_flushed_bytes_can_be_read),
        cmocka_unit_test(the_set_counts_what_is_on_disk_now_and_at_most),
        cmocka_unit_test(the_limit_holds_over_all_streams_and_frees_with_them),
        cmocka_unit_test(a_full_disk_loses_nothing_and_the_stream_goes_on),
        cmocka_unit_test(names_are_plain_and_open_once),
        cmocka_unit_test(a_later_run_goes_on_from_the_last_save),
        cmocka_unit_test(what_a_save_needs_stays_until_the_next),
        cmocka_unit_test(damage_is_found_where_the_bytes_are_needed),
        cmocka_unit_test(a_save_cut_off_anywhere_is_refused),
        cmocka_unit_test(streams_of_several_threads_share_one_count),
        cmocka_unit_test(every_injected_failure_is_reported),
    };
    return cmocka_run_group_tests(tests, strl_test_folder_make, strl_test_folder_remove);
}
