/* A file behind an address, read with a cache: what a later run finds there, damage, doubts, and none that can be used.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include "base/memory.h"
#include "platform/file.h"
#include "platform/shelf.h"
#include "platform/thread.h"
#include "source/http_checks.h"
#include "support/folder.h"

/* Reads the same things in any run; returns how many requests that took. */
static unsigned read_some(fault_server *server, const strl_http_desc *desc, const uint8_t *expected, uint64_t *hits)
{
    unsigned before = fault_server_asked(server, NULL, 0);
    strl_source *source = must_open(fault_server_url(server, "/model"), desc);
    static uint8_t data[100000];
    assert_int_equal(strl_source_read(source, BYTES - 500, data, 500, NULL), STRL_OK);
    assert_memory_equal(data, expected + BYTES - 500, 500);
    assert_int_equal(strl_source_read(source, BYTES - 9000, data, 2000, NULL), STRL_OK);
    assert_memory_equal(data, expected + BYTES - 9000, 2000);
    for (uint64_t i = 0; i < 10; i++)
        submit(source, i, 100000 + 50000 * i, 20000, 0);
    for (unsigned n = 0; n < 10; n++) {
        strl_source_result result = next_answer(source);
        assert_int_equal(result.status, STRL_OK);
        assert_memory_equal(result.data, expected + 100000 + 50000 * result.token, 20000);
        strl__free(result.data);
    }
    *hits = stats_of(source).cache_hits;
    strl_source_close(source);
    return fault_server_asked(server, NULL, 0) - before;
}

static void a_second_run_reads_nothing_but_the_header(void **state)
{
    (void)state;
    const strl_http_desc desc = cached("cache");
    fault_server *server = fault_server_create(&good, NULL, NULL), *mirror = fault_server_create(&good, NULL, NULL);
    uint64_t hits;
    assert_true(read_some(server, &desc, content, &hits) > 1);
    assert_int_equal(hits, 0);
    assert_int_equal(read_some(server, &desc, content, &hits), 1);
    assert_int_equal(hits, 12);
    assert_int_equal(read_some(mirror, &desc, content, &hits), 1); /* the same model at another address */
    const fault_content changed = {.data = other_content, .size = BYTES, .etag = "\"two\""};
    fault_server_set_content(server, &changed);
    assert_true(read_some(server, &desc, other_content, &hits) > 1);
    assert_int_equal(hits, 0);
    fault_server_destroy(server);
    fault_server_destroy(mirror);
    strl_path_remove_directory(strl_test_path("cache"), NULL);
}

typedef struct damage {
    const char *folder;
    unsigned files;
} damage;

static void damage_one(damage *self, const strl_shelf_entry *entry)
{
    char *path = strl_path_join(self->folder, entry->name);
    FILE *file = fopen(path, "r+b");
    assert_non_null(file);
    if (self->files++ % 2) {
        fseek(file, 1000, SEEK_SET);
        fputc(fgetc(file) ^ 0x40, file);
    } else {
        assert_int_equal(strl_path_remove(path, NULL), STRL_OK);
        FILE *shorter = fopen(path, "wb");
        fputs("stroll cache 1\n", shorter);
        fclose(shorter);
    }
    fclose(file);
    strl__free(path);
}

static void damage_all(damage *self)
{
    strl_shelf *shelf;
    strl_shelf_entry entry;
    assert_int_equal(strl_shelf_open(self->folder, &shelf, NULL), STRL_OK);
    while (strl_shelf_next(shelf, &entry, NULL) == STRL_OK && entry.name)
        if (*entry.name)
            damage_one(self, &entry);
    strl_shelf_close(shelf);
}

static void damaged_entries_heal(void **state)
{
    (void)state;
    const strl_http_desc desc = cached("damaged");
    fault_server *server = fault_server_create(&good, NULL, NULL);
    uint64_t hits;
    read_some(server, &desc, content, &hits);
    damage all = {.folder = desc.cache};
    damage_all(&all);
    assert_int_equal(all.files, 12);
    assert_true(read_some(server, &desc, content, &hits) > 1);
    assert_int_equal(read_some(server, &desc, content, &hits), 1);
    assert_int_equal(hits, 12);
    fault_server_destroy(server);
    strl_path_remove_directory(desc.cache, NULL);
}

/* The cache has these bytes, and has them right. */
static void check_next_run_finds(fault_server *server, const strl_http_desc *desc, uint64_t offset, size_t size)
{
    strl_source *source = must_open(fault_server_url(server, "/model"), desc);
    check_read(source, offset, size);
    assert_int_equal(stats_of(source).cache_hits, 1);
    strl_source_close(source);
}

static void wrong_bytes_that_somebody_doubts_do_not_come_out_of_the_cache(void **state)
{
    (void)state;
    const strl_http_desc desc = cached("doubted");
    const fault_rule wrong = {.wrong_bytes = true};
    fault_server *server = fault_server_create(&good, by_number, LISTED(well, wrong, well));
    strl_source *source = must_open(fault_server_url(server, "/model"), &desc);
    static uint8_t data[20000];
    assert_int_equal(strl_source_read(source, 100000, data, 20000, NULL), STRL_OK);
    assert_memory_not_equal(data, content + 100000, 20000);
    strl_source_doubt(source, 100000, 20000);
    check_read(source, 100000, 20000);
    strl_source_close(source);
    check_next_run_finds(server, &desc, 100000, 20000);
    fault_server_destroy(server);
    strl_path_remove_directory(desc.cache, NULL);
}

static void a_head_that_is_doubted_comes_anew_and_names_the_model(void **state)
{
    (void)state;
    const strl_http_desc desc = cached("head");
    const fault_rule wrong = {.wrong_bytes = true};
    fault_server *server = fault_server_create(&good, by_number, LISTED(wrong, wrong, well));
    strl_source *source = must_open(fault_server_url(server, "/model"), &desc);
    static uint8_t data[HEAD];
    for (unsigned wrongs = 1; wrongs <= 2; wrongs++) {
        assert_int_equal(strl_source_read(source, 0, data, HEAD, NULL), STRL_OK);
        assert_memory_not_equal(data, content, HEAD);
        strl_source_doubt(source, 0, HEAD);
        assert_int_equal(fault_server_asked(server, NULL, 0), wrongs);
    }
    check_read(source, 0, HEAD);
    check_read(source, 100, 1000);
    assert_int_equal(fault_server_asked(server, NULL, 0), 3);
    check_read(source, 100000, 20000);
    strl_source_close(source);
    check_next_run_finds(server, &desc, 100000, 20000); /* of the same model */
    fault_server_destroy(server);
    strl_path_remove_directory(desc.cache, NULL);
}

/* While the cache makes room for what was read nobody watches for what comes in. */
static void a_doubt_at_any_moment_leaves_no_read_behind(void **state)
{
    (void)state;
    const strl_http_desc desc = cached("doubts");
    fault_server *server = fault_server_create(&good, NULL, NULL);
    strl_source *source = must_open(fault_server_url(server, "/model"), &desc);
    for (uint64_t i = 0; i < 1000; i++) {
        uint64_t offset = i * 7919 % (BYTES - 2000);
        check_read(source, offset, 1000);
        if (i % 3 == 0)
            strl_sleep_ns(i * 250 % 50000);
        strl_source_doubt(source, offset, 1000);
        check_read(source, offset, 1000);
    }
    strl_source_close(source);
    fault_server_destroy(server);
    strl_path_remove_directory(desc.cache, NULL);
}

static void a_cache_that_cannot_be_used_is_done_without(void **state)
{
    (void)state;
    const strl_http_desc nowhere = cached("no/such/folder"), full = cached("full");
    fault_server *server = fault_server_create(&good, NULL, NULL);
    uint64_t hits;
    for (unsigned run = 0; run < 2; run++) {
        assert_true(read_some(server, &nowhere, content, &hits) > 1);
        assert_int_equal(hits, 0);
    }
    strl_file_fail_writes_after(1);
    assert_true(read_some(server, &full, content, &hits) > 1);
    strl_file_fail_writes_after(0);
    assert_true(read_some(server, &full, content, &hits) > 1);
    assert_int_equal(hits, 0);
    fault_server_destroy(server);
    strl_path_remove_directory(full.cache, NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_second_run_reads_nothing_but_the_header),
        cmocka_unit_test(damaged_entries_heal),
        cmocka_unit_test(wrong_bytes_that_somebody_doubts_do_not_come_out_of_the_cache),
        cmocka_unit_test(a_head_that_is_doubted_comes_anew_and_names_the_model),
        cmocka_unit_test(a_doubt_at_any_moment_leaves_no_read_behind),
        cmocka_unit_test(a_cache_that_cannot_be_used_is_done_without),
    };
    return cmocka_run_group_tests(tests, set_up, strl_test_folder_remove);
}
