/* The cache on disk: what was put comes back or not at all, the cap holds, nobody else's file is touched. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <cmocka.h>

#include "base/hash.h"
#include "platform/file.h"
#include "platform/shelf.h"
#include "platform/thread.h"
#include "source/cache.h"
#include "support/folder.h"

#define CAP ((uint64_t)1 << 20)
#define ENTRY_BYTES 10000u

static uint8_t data_of[ENTRY_BYTES], found[ENTRY_BYTES];

static strl__cache_key key_of(uint64_t i)
{
    strl__cache_key key = {.offset = i * 1000003, .size = ENTRY_BYTES};
    memset(key.model, 0xa5, sizeof key.model);
    return key;
}

static const uint8_t *content_of(uint64_t i)
{
    for (size_t b = 0; b < ENTRY_BYTES; b++)
        data_of[b] = (uint8_t)strl__mix64(i * ENTRY_BYTES + b);
    return data_of;
}

static strl__cache *must_open(const char *name, uint64_t cap)
{
    strl__cache *cache = NULL;
    strl_error err = {0};
    if (strl__cache_open(strl_test_path(name), cap, &cache, &err) != STRL_OK)
        fail_msg("%s", err.message);
    return cache;
}

static void put(strl__cache *cache, uint64_t i)
{
    const strl__cache_key key = key_of(i);
    strl__cache_put(cache, &key, content_of(i));
}

static bool has(strl__cache *cache, uint64_t i)
{
    const strl__cache_key key = key_of(i);
    bool hit = strl__cache_get(cache, &key, found);
    if (hit)
        assert_memory_equal(found, content_of(i), ENTRY_BYTES);
    return hit;
}

static char *path_of(const char *folder, uint64_t i)
{
    static char path[600];
    char name[STRL__CACHE_NAME_BYTES];
    const strl__cache_key key = key_of(i);
    strl__cache_entry_name(&key, name);
    snprintf(path, sizeof path, "%s/%s", strl_test_path(folder), name);
    return path;
}

typedef struct tally {
    uint64_t bytes;
    unsigned files;
} tally;

static tally count(const char *folder)
{
    tally all = {0};
    strl_shelf *shelf;
    strl_shelf_entry entry;
    assert_int_equal(strl_shelf_open(strl_test_path(folder), &shelf, NULL), STRL_OK);
    while (strl_shelf_next(shelf, &entry, NULL) == STRL_OK && entry.name) {
        all.bytes += (entry.bytes + 4095) / 4096 * 4096;
        all.files += *entry.name != 0;
    }
    strl_shelf_close(shelf);
    return all;
}

static void clear(const char *folder)
{
    assert_int_equal(strl_path_remove_directory(strl_test_path(folder), NULL), STRL_OK);
}

static void what_was_put_comes_back_in_another_process_too(void **state)
{
    (void)state;
    strl__cache *cache = must_open("one", CAP), *other = must_open("one", CAP);
    assert_false(has(cache, 1));
    put(cache, 1);
    put(cache, 2);
    assert_true(has(cache, 1) && has(other, 2) && has(other, 1));
    strl__cache_key key = key_of(1);
    key.offset++;
    assert_false(strl__cache_get(cache, &key, found));
    key = key_of(1);
    key.model[3]++;
    assert_false(strl__cache_get(cache, &key, found)); /* another model */
    key = key_of(1);
    strl__cache_drop(other, &key);
    assert_false(has(cache, 1));
    assert_true(has(cache, 2));
    strl__cache_close(cache);
    strl__cache_close(other);
    clear("one");
}

static void write_file(const char *path, const void *data, size_t size)
{
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(data, 1, size, file), size);
    fclose(file);
}

static void a_damaged_entry_is_a_miss_and_goes(void **state)
{
    (void)state;
    strl__cache *cache = must_open("two", CAP);
    const size_t whole = STRL__CACHE_HEAD_BYTES + ENTRY_BYTES;
    static uint8_t bytes[STRL__CACHE_HEAD_BYTES + ENTRY_BYTES + 1];
    const strl__cache_key key = key_of(7);
    /* Sizes: cut anywhere, or longer. Bytes: one wrong, in head and content. */
    const size_t sizes[] = {0, 1, 16, 63, 64, 65, whole - 1, whole + 1},
                 wrong[] = {16, 32, 40, 47, 48, 55, 56, 63, 64, whole - 1};
    for (size_t i = 0; i < 18; i++) {
        strl__cache_entry_head(&key, content_of(7), bytes);
        memcpy(bytes + STRL__CACHE_HEAD_BYTES, data_of, ENTRY_BYTES);
        if (i >= 8)
            bytes[wrong[i - 8]] ^= 1;
        write_file(path_of("two", 7), bytes, i < 8 ? sizes[i] : whole);
        assert_false(has(cache, 7));
        assert_false(strl_path_exists(path_of("two", 7)));
    }
    put(cache, 7);
    assert_true(has(cache, 7));
    strl__cache_close(cache);
    clear("two");
}

static void the_cap_holds_and_what_was_used_longest_ago_goes(void **state)
{
    (void)state;
    strl__cache *cache = must_open("three", CAP);
    put(cache, 0);
    for (uint64_t i = 1; i < 300; i++) {
        strl_sleep_ns(20000);
        put(cache, i);
        assert_true(count("three").bytes <= CAP);
        if (i % 10 == 0)
            assert_true(has(cache, 0)); /* used now and then: it stays */
    }
    assert_true(count("three").files >= 50); /* of the 85 that fit */
    assert_true(has(cache, 0) && has(cache, 299));
    assert_false(has(cache, 1));
    strl__cache_close(cache);
    strl__cache *smaller = must_open("three", CAP / 2);
    strl__cache_trim(smaller);
    assert_true(count("three").bytes <= CAP / 2);
    put(smaller, 1000);
    assert_true(count("three").bytes <= CAP / 2);
    assert_true(has(smaller, 1000));
    strl__cache_close(smaller);
    clear("three");
}

static void a_folder_is_looked_through_in_steps(void **state)
{
    (void)state;
    strl__cache *cache = must_open("nine", UINT64_C(1) << 30);
    for (uint64_t i = 0; i < 300; i++)
        put(cache, i);
    strl__cache_close(cache);
    cache = must_open("nine", CAP);
    unsigned steps = 0;
    while (strl__cache_room_step(cache, ENTRY_BYTES)) {
        assert_true(has(cache, 299) == true); /* look-ups go on between them; what was used last stays */
        assert_true(++steps < 1000);
    }
    assert_true(steps >= 6);
    assert_true(count("nine").bytes <= CAP);
    unsigned files = count("nine").files;
    put(cache, 1000);
    assert_int_equal(count("nine").files, files + 1); /* there was room */
    assert_true(strl__cache_trim_step(cache));
    put(cache, 2000); /* that goes on with the count first */
    assert_true(has(cache, 2000));
    assert_true(count("nine").bytes <= CAP);
    strl__cache_close(cache); /* also in the middle of it */
    cache = must_open("nine", CAP / 2);
    assert_true(strl__cache_trim_step(cache) && strl__cache_trim_step(cache));
    strl__cache_close(cache);
    clear("nine");
}

/* Files that have our names and are none of ours stay, so no room can be made. */
static void a_folder_that_stays_above_the_cap_is_given_up(void **state)
{
    (void)state;
    strl__cache *cache = must_open("ten", CAP);
    static uint8_t filling[CAP + 1] = "not ours";
    write_file(path_of("ten", 1), filling, sizeof filling);
    put(cache, 2);
    assert_int_equal(count("ten").files, 1);
    assert_int_equal(strl_path_remove(path_of("ten", 1), NULL), STRL_OK);
    put(cache, 3); /* or each put would look through the folder */
    assert_int_equal(count("ten").files, 0);
    strl__cache_close(cache);
    clear("ten");
}

static void nobody_else_reads_what_is_kept(void **state)
{
    (void)state;
    mode_t before = umask(0);
    struct stat facts;
    strl__cache *cache = must_open("private", CAP);
    put(cache, 1);
    umask(before);
    assert_int_equal(stat(strl_test_path("private"), &facts), 0);
    assert_int_equal(facts.st_mode & 0777, 0700);
    assert_int_equal(stat(path_of("private", 1), &facts), 0);
    assert_int_equal(facts.st_mode & 0777, 0600);
    strl__cache_close(cache);
    clear("private");
}

static void two_processes_together_pass_the_cap_by_little(void **state)
{
    (void)state;
    strl__cache *caches[2] = {must_open("four", CAP), must_open("four", CAP)};
    for (uint64_t i = 0; i < 300; i++)
        put(caches[i % 2], i);
    assert_true(count("four").bytes <= CAP + CAP / 8);
    strl__cache_close(caches[0]);
    strl__cache_close(caches[1]);
    clear("four");
}

static void an_entry_too_large_for_the_cap_is_not_kept(void **state)
{
    (void)state;
    strl__cache *cache = must_open("five", 3 * ENTRY_BYTES);
    put(cache, 1);
    assert_false(has(cache, 1));
    assert_int_equal(count("five").files, 0);
    strl__cache_close(cache);
    clear("five");
}

static void only_files_of_ours_are_removed(void **state)
{
    (void)state;
    static const char *const foreign[] = {"scan.stroll", "notes.txt", "stroll-1-2-3.page",
                                          "stroll-a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5-0000000000000001-00002710.page",
                                          "stroll-a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5-0000000000000002-00002710.page.old"};
    static uint8_t filling[100000] = "not what the name says";
    strl__cache *cache = must_open("six", CAP);
    char path[600];
    for (size_t i = 0; i < 5; i++) {
        snprintf(path, sizeof path, "%s/%s", strl_test_path("six"), foreign[i]);
        write_file(path, filling, sizeof filling);
    }
    for (uint64_t i = 10; i < 200; i++)
        put(cache, i);
    strl__cache_key key = {.offset = 1, .size = ENTRY_BYTES}; /* the fourth has its name, not its signature */
    memset(key.model, 0xa5, sizeof key.model);
    assert_false(strl__cache_get(cache, &key, found));
    strl__cache_drop(cache, &key);
    for (size_t i = 0; i < 5; i++) {
        snprintf(path, sizeof path, "%s/%s", strl_test_path("six"), foreign[i]);
        assert_true(strl_path_exists(path));
    }
    strl__cache_close(cache);
    clear("six");
}

static void what_a_kill_left_goes_when_it_is_old(void **state)
{
    (void)state;
    strl__cache *cache = must_open("seven", CAP);
    char old[700], young[700];
    snprintf(old, sizeof old, "%s.abcdefgh.part", path_of("seven", 1));
    snprintf(young, sizeof young, "%s.12345678.part", path_of("seven", 2));
    write_file(old, strl__cache_signature, 10);
    write_file(young, strl__cache_signature, 10);
    const struct timespec times[2] = {{.tv_sec = 1000000000}, {.tv_sec = 1000000000}};
    assert_int_equal(utimensat(AT_FDCWD, old, times, 0), 0);
    put(cache, 3);
    assert_false(strl_path_exists(old));
    assert_true(strl_path_exists(young));
    strl__cache_close(cache);
    clear("seven");
}

static void a_full_disk_ends_writing_and_nothing_else(void **state)
{
    (void)state;
    strl__cache *cache = must_open("eight", CAP);
    put(cache, 1);
    strl_file_fail_writes_after(2); /* the head is written, the content is not */
    put(cache, 2);
    strl_file_fail_writes_after(0);
    assert_int_equal(count("eight").files, 1); /* no part is left */
    put(cache, 3);
    assert_true(has(cache, 1));
    assert_false(has(cache, 2) || has(cache, 3));
    strl__cache_close(cache);
    clear("eight");
}

static void a_folder_that_cannot_be_made_is_refused_with_its_name(void **state)
{
    (void)state;
    strl__cache *cache;
    strl_error err = {0};
    write_file(strl_test_path("file"), "x", 1);
    assert_int_not_equal(strl__cache_open(strl_test_path("file"), CAP, &cache, &err), STRL_OK);
    assert_null(cache);
    assert_non_null(strstr(err.message, strl_test_path("file")));
    assert_int_not_equal(strl__cache_open(strl_test_path("no/such"), CAP, &cache, &err), STRL_OK);
    assert_int_equal(strl_path_remove(strl_test_path("file"), NULL), STRL_OK);
}

static void names_are_read_as_they_are_written_and_no_others(void **state)
{
    (void)state;
    for (uint64_t i = 0; i < 1000; i++) {
        strl__cache_key key = {.offset = strl__mix64(i), .size = (uint32_t)strl__mix64(~i)}, again;
        char name[STRL__CACHE_NAME_BYTES], part[STRL__CACHE_NAME_BYTES + 16];
        strl__digest(&i, sizeof i, key.model);
        strl__cache_entry_name(&key, name);
        assert_int_equal(strl__cache_parse_name(name, &again), STRL__CACHE_ENTRY);
        assert_memory_equal(key.model, again.model, 16);
        assert_true(key.offset == again.offset && key.size == again.size);
        snprintf(part, sizeof part, "%s.0a1b2c3d.part", name);
        assert_int_equal(strl__cache_parse_name(part, NULL), STRL__CACHE_PART);
        for (size_t cut = 0; cut < strlen(name); cut++) {
            char shorter[STRL__CACHE_NAME_BYTES];
            memcpy(shorter, name, cut);
            shorter[cut] = 0;
            assert_int_equal(strl__cache_parse_name(shorter, NULL), STRL__CACHE_FOREIGN);
        }
        name[10] = 'G';
        assert_int_equal(strl__cache_parse_name(name, NULL), STRL__CACHE_FOREIGN);
    }
}

static void models_are_told_apart_by_their_beginning_and_their_size(void **state)
{
    (void)state;
    uint8_t head[5000] = {1, 2, 3}, a[16], b[16];
    strl__cache_model(head, 4096, 10000, a);
    strl__cache_model(head, 4096, 10000, b);
    assert_memory_equal(a, b, 16);
    strl__cache_model(head, 4096, 10001, b);
    assert_memory_not_equal(a, b, 16);
    head[4095] ^= 1;
    strl__cache_model(head, 4096, 10000, b);
    assert_memory_not_equal(a, b, 16);
    strl__cache_model(head, 5000, 10000, a); /* what lies behind does not count */
    assert_memory_equal(a, b, 16);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_was_put_comes_back_in_another_process_too),
        cmocka_unit_test(a_damaged_entry_is_a_miss_and_goes),
        cmocka_unit_test(the_cap_holds_and_what_was_used_longest_ago_goes),
        cmocka_unit_test(a_folder_is_looked_through_in_steps),
        cmocka_unit_test(a_folder_that_stays_above_the_cap_is_given_up),
        cmocka_unit_test(nobody_else_reads_what_is_kept),
        cmocka_unit_test(two_processes_together_pass_the_cap_by_little),
        cmocka_unit_test(an_entry_too_large_for_the_cap_is_not_kept),
        cmocka_unit_test(only_files_of_ours_are_removed),
        cmocka_unit_test(what_a_kill_left_goes_when_it_is_old),
        cmocka_unit_test(a_full_disk_ends_writing_and_nothing_else),
        cmocka_unit_test(a_folder_that_cannot_be_made_is_refused_with_its_name),
        cmocka_unit_test(names_are_read_as_they_are_written_and_no_others),
        cmocka_unit_test(models_are_told_apart_by_their_beginning_and_their_size),
    };
    return cmocka_run_group_tests(tests, strl_test_folder_make, strl_test_folder_remove);
}
