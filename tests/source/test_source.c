#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "base/hash.h"
#include "base/memory.h"
#include "platform/file.h"
#include "platform/thread.h"
#include "source/source.h"

#define BYTES ((size_t)1 << 16)
#define MS ((uint64_t)1000000)

static uint8_t content[BYTES];
static char folder[64];
static char *path;

static int set_up(void **state)
{
    (void)state;
    for (size_t i = 0; i < BYTES; i++)
        content[i] = (uint8_t)strl__mix64(i + 1);
    snprintf(folder, sizeof folder, "/tmp/strl-source-XXXXXX");
    if (!mkdtemp(folder) || !(path = strl_path_join(folder, "bytes")))
        return -1;
    strl_file *file = NULL;
    strl_error err = {0};
    if (strl_file_create(path, &file, &err) != STRL_OK || strl_file_write(file, 0, content, BYTES, &err) != STRL_OK)
        return -1;
    return strl_file_close(file, &err) == STRL_OK ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    strl__free(path);
    return strl_path_remove_directory(folder, NULL) == STRL_OK ? 0 : -1;
}

enum {
    SOURCE_MEMORY,
    SOURCE_FILE_0,
    SOURCE_FILE_1,
    SOURCE_FILE_4,
    SOURCE_CALLBACK_0,
    SOURCE_CALLBACK_3,
    SOURCE_DELAYED_MEMORY,
    SOURCE_DELAYED_FILE,
    SOURCE_KINDS
};

static strl_status read_content(void *context, uint64_t offset, void *data, size_t size, strl_error *err)
{
    (void)err;
    memcpy(data, (const uint8_t *)context + offset, size);
    return STRL_OK;
}

static strl_status open_inner(int kind, unsigned threads, strl_source **source, strl_error *err)
{
    const strl_source_callbacks callbacks = {.bytes = BYTES, .context = content, .read = read_content};
    if (kind == SOURCE_MEMORY || kind == SOURCE_DELAYED_MEMORY)
        return strl_source_open_memory(content, BYTES, source, err);
    if (kind == SOURCE_CALLBACK_0 || kind == SOURCE_CALLBACK_3)
        return strl_source_open_callbacks(&callbacks, threads, source, err);
    return strl_source_open_file(path, threads, source, err);
}

static strl_status open_kind(int kind, strl_source **source, strl_error *err)
{
    static const unsigned threads[SOURCE_KINDS] = {0, 0, 1, 4, 0, 3, 0, 2};
    strl_source *inner = NULL;
    *source = NULL;
    strl_status status = open_inner(kind, threads[kind], &inner, err);
    if (status == STRL_OK && kind >= SOURCE_DELAYED_MEMORY) {
        status = strl_source_open_delayed(inner, 2 * MS, 0, source, err);
        if (status != STRL_OK)
            strl_source_close(inner);
    } else if (status == STRL_OK) {
        *source = inner;
    }
    return status;
}

static strl_source *must_open(int kind)
{
    strl_source *source = NULL;
    strl_error err = {0};
    if (open_kind(kind, &source, &err) != STRL_OK)
        fail_msg("%s", err.message);
    assert_int_equal(source->bytes, BYTES);
    return source;
}

/* The only wait is the test's own. */
static strl_source_result next_answer(strl_source *source)
{
    strl_source_result result;
    uint64_t give_up_ns = strl_clock_ns() + 20000 * MS;
    while (!strl_source_poll(source, &result)) {
        assert_true(strl_clock_ns() < give_up_ns);
        strl_sleep_ns(MS / 10);
    }
    return result;
}

static void every_accepted_read_is_answered_once_with_its_bytes(void **state)
{
    (void)state;
    for (int kind = 0; kind < SOURCE_KINDS; kind++) {
        strl_source *source = must_open(kind);
        uint8_t answered[500] = {0};
        for (uint64_t i = 0; i < 500; i++)
            assert_int_equal(strl_source_submit(source, i, i * 100, (size_t)i, (float)(i % 13), NULL), STRL_OK);
        for (unsigned n = 0; n < 500; n++) {
            strl_source_result result = next_answer(source);
            assert_true(result.token < 500);
            assert_int_equal(answered[result.token]++, 0);
            assert_int_equal(result.status, STRL_OK);
            assert_int_equal(result.size, result.token);
            assert_memory_equal(result.data, content + result.token * 100, result.size);
            strl__free(result.data);
        }
        strl_source_result none;
        assert_false(strl_source_poll(source, &none));
        assert_null(none.data);
        strl_source_close(source);
    }
}

static void a_waiting_read_gives_the_bytes_of_any_kind(void **state)
{
    (void)state;
    for (int kind = 0; kind < SOURCE_KINDS; kind++) {
        strl_source *source = must_open(kind);
        uint8_t data[1000];
        assert_int_equal(strl_source_read(source, BYTES - 1000, data, 1000, NULL), STRL_OK);
        assert_memory_equal(data, content + BYTES - 1000, 1000);
        assert_int_equal(strl_source_read(source, BYTES, data, 0, NULL), STRL_OK);
        strl_source_close(source);
    }
}

static void ranges_outside_the_source_are_not_accepted(void **state)
{
    (void)state;
    const struct {
        uint64_t offset;
        size_t size;
    } ranges[] = {
        {BYTES, 1}, {BYTES - 1, 2}, {BYTES + 1, 0}, {UINT64_MAX, 1}, {1, SIZE_MAX}, {UINT64_MAX, SIZE_MAX},
    };
    for (int kind = 0; kind < SOURCE_KINDS; kind++) {
        strl_source *source = must_open(kind);
        for (size_t i = 0; i < sizeof ranges / sizeof *ranges; i++) {
            strl_error err = {0};
            uint8_t data[2];
            strl_source_result result;
            assert_int_equal(strl_source_submit(source, 1, ranges[i].offset, ranges[i].size, 0, &err), STRL_ERR_FORMAT);
            assert_non_null(strstr(err.message, "past the end"));
            assert_int_equal(strl_source_read(source, ranges[i].offset, data, ranges[i].size, &err), STRL_ERR_FORMAT);
            assert_false(strl_source_poll(source, &result));
        }
        strl_source_close(source);
    }
}

static void the_most_urgent_read_is_served_first_then_the_oldest(void **state)
{
    (void)state;
    const int kinds[] = {SOURCE_MEMORY, SOURCE_FILE_0};
    for (size_t k = 0; k < 2; k++) {
        strl_source *source = must_open(kinds[k]);
        const float urgencies[] = {1, 5, 3, 5, (float)strtod("nan", NULL), 4, 2};
        const uint64_t order[] = {1, 3, 5, 2, 6, 0, 4};
        for (uint64_t i = 0; i < 7; i++)
            assert_int_equal(strl_source_submit(source, i, i, 1, urgencies[i], NULL), STRL_OK);
        for (unsigned i = 0; i < 7; i++) {
            strl_source_result result = next_answer(source);
            assert_int_equal(result.token, order[i]);
            strl__free(result.data);
        }
        strl_source_close(source);
    }
}

static void cancelled_reads_are_answered_and_the_others_keep_their_order(void **state)
{
    (void)state;
    for (int kind = 0; kind < SOURCE_KINDS; kind++) {
        strl_source *source = must_open(kind);
        unsigned answers[100] = {0}, cancelled = 0;
        for (uint64_t i = 0; i < 100; i++)
            assert_int_equal(strl_source_submit(source, i, i, 8, (float)(i * 37 % 100), NULL), STRL_OK);
        for (uint64_t i = 0; i < 100; i += 3)
            strl_source_cancel(source, i);
        strl_source_cancel(source, 12345);
        float last = 1000;
        for (unsigned n = 0; n < 100; n++) {
            strl_source_result result = next_answer(source);
            answers[result.token]++;
            if (result.status == STRL_ERR_CANCELLED) {
                cancelled++;
                assert_int_equal(result.token % 3, 0);
                assert_null(result.data);
                assert_int_not_equal(result.error.message[0], 0);
                continue;
            }
            assert_int_equal(result.status, STRL_OK);
            assert_memory_equal(result.data, content + result.token, 8);
            strl__free(result.data);
            if (kind == SOURCE_MEMORY || kind == SOURCE_FILE_0) {
                float urgency = (float)(result.token * 37 % 100);
                assert_true(urgency < last);
                last = urgency;
            }
        }
        for (unsigned i = 0; i < 100; i++)
            assert_int_equal(answers[i], 1);
        if (kind == SOURCE_MEMORY || kind == SOURCE_FILE_0 || kind >= SOURCE_DELAYED_MEMORY)
            assert_true(cancelled > 0);
        strl_source_close(source);
    }
}

static void without_threads_a_poll_reads_at_most_once(void **state)
{
    (void)state;
    strl_source *source = must_open(SOURCE_FILE_0);
    for (uint64_t i = 0; i < 3; i++)
        assert_int_equal(strl_source_submit(source, i, 0, 8, 0, NULL), STRL_OK);
    strl_file_fail_reads_after(2); /* the second poll is the first to notice */
    strl_source_result first, second;
    bool got_first = strl_source_poll(source, &first);
    strl_file_fail_reads_after(1);
    bool got_second = strl_source_poll(source, &second);
    strl_file_fail_reads_after(0);
    assert_true(got_first && got_second);
    assert_int_equal(first.status, STRL_OK);
    assert_int_equal(second.status, STRL_ERR_IO);
    strl__free(first.data);
    strl_source_close(source);
}

static void closing_drops_what_is_unanswered(void **state)
{
    (void)state;
    for (int kind = 0; kind < SOURCE_KINDS; kind++) {
        strl_source *source = must_open(kind);
        for (uint64_t i = 0; i < 200; i++)
            assert_int_equal(strl_source_submit(source, i, 0, BYTES, 0, NULL), STRL_OK);
        strl_source_result result = next_answer(source);
        strl__free(result.data);
        strl_source_close(source); /* the leak checker is the assertion */
    }
    strl_source_close(NULL);
}

static void a_delayed_answer_comes_neither_early_nor_in_a_wait(void **state)
{
    (void)state;
    strl_source *inner = NULL, *source = NULL;
    assert_int_equal(strl_source_open_memory(content, BYTES, &inner, NULL), STRL_OK);
    assert_int_equal(strl_source_open_delayed(inner, 50 * MS, 0, &source, NULL), STRL_OK);
    uint64_t start_ns = strl_clock_ns();
    for (uint64_t i = 0; i < 10; i++)
        assert_int_equal(strl_source_submit(source, i, i, 4, 0, NULL), STRL_OK);
    strl_source_result result;
    unsigned empty_polls = 0;
    while (!strl_source_poll(source, &result))
        empty_polls++;
    assert_true(strl_clock_ns() - start_ns >= 50 * MS);
    assert_true(empty_polls > 10); /* a poll that waited would have come back once */
    strl__free(result.data);
    for (unsigned i = 1; i < 10; i++) {
        result = next_answer(source);
        assert_int_equal(result.token, i);
        strl__free(result.data);
    }
    uint8_t byte;
    start_ns = strl_clock_ns();
    assert_int_equal(strl_source_read(source, 0, &byte, 1, NULL), STRL_OK);
    assert_true(strl_clock_ns() - start_ns < 50 * MS);
    strl_source_close(source);
}

static void a_cancelled_delayed_read_is_answered_at_once(void **state)
{
    (void)state;
    strl_source *inner = NULL, *source = NULL;
    assert_int_equal(strl_source_open_memory(content, BYTES, &inner, NULL), STRL_OK);
    assert_int_equal(strl_source_open_delayed(inner, 3600 * 1000 * MS, 0, &source, NULL), STRL_OK);
    strl_source_result result;
    assert_int_equal(strl_source_submit(source, 7, 0, 4, 0, NULL), STRL_OK);
    assert_int_equal(strl_source_submit(source, 8, 0, 4, 0, NULL), STRL_OK);
    assert_false(strl_source_poll(source, &result)); /* both are held now */
    assert_int_equal(strl_source_submit(source, 9, 0, 4, 0, NULL), STRL_OK);
    strl_source_cancel(source, 8);
    strl_source_cancel(source, 9);
    for (uint64_t token = 8; token <= 9; token++) {
        assert_true(strl_source_poll(source, &result));
        assert_int_equal(result.token, token);
        assert_int_equal(result.status, STRL_ERR_CANCELLED);
        assert_null(result.data);
    }
    assert_false(strl_source_poll(source, &result));
    strl_source_close(source);
}

static void every_nth_delayed_answer_fails(void **state)
{
    (void)state;
    strl_source *inner = NULL, *source = NULL;
    assert_int_equal(strl_source_open_memory(content, BYTES, &inner, NULL), STRL_OK);
    assert_int_equal(strl_source_open_delayed(inner, 0, 3, &source, NULL), STRL_OK);
    for (uint64_t i = 0; i < 9; i++)
        assert_int_equal(strl_source_submit(source, i, i, 4, 0, NULL), STRL_OK);
    for (unsigned i = 0; i < 9; i++) {
        strl_source_result result = next_answer(source);
        assert_int_equal(result.status, i % 3 == 2 ? STRL_ERR_NETWORK : STRL_OK);
        assert_true((result.data != NULL) == (result.status == STRL_OK));
        assert_true(result.status == STRL_OK || result.error.status == STRL_ERR_NETWORK);
        strl__free(result.data);
    }
    strl_source_close(source);
}

static void a_file_that_shrinks_is_answered_with_a_failure(void **state)
{
    (void)state;
    char *other = strl_path_join(folder, "shrinks");
    strl_file *file = NULL;
    assert_int_equal(strl_file_create(other, &file, NULL), STRL_OK);
    assert_int_equal(strl_file_write(file, 0, content, 1000, NULL), STRL_OK);
    assert_int_equal(strl_file_close(file, NULL), STRL_OK);
    strl_source *source = NULL;
    assert_int_equal(strl_source_open_file(other, 1, &source, NULL), STRL_OK);
    assert_int_equal(truncate(other, 500), 0);
    assert_int_equal(strl_source_submit(source, 1, 400, 200, 0, NULL), STRL_OK);
    strl_source_result result = next_answer(source);
    assert_int_equal(result.status, STRL_ERR_FORMAT);
    assert_null(result.data);
    assert_non_null(strstr(result.error.message, "ends at byte 500"));
    strl_source_close(source);
    strl__free(other);
}

static void a_missing_file_or_a_folder_is_refused(void **state)
{
    (void)state;
    strl_source *source = NULL;
    strl_error err = {0};
    assert_int_equal(strl_source_open_file("/nowhere/at/all", 2, &source, &err), STRL_ERR_IO);
    assert_non_null(strstr(err.message, "/nowhere/at/all"));
    assert_int_equal(strl_source_open_file(folder, 2, &source, &err), STRL_ERR_IO);
    assert_non_null(strstr(err.message, "folder"));
    assert_null(source);
}

/* Opens, reads 40 ranges, closes. Returns the first failure; every accepted read must be answered even then. */
static strl_status use_source(int kind)
{
    strl_source *source = NULL;
    strl_error err = {0};
    strl_status first = open_kind(kind, &source, &err);
    unsigned accepted = 0;
    for (uint64_t i = 0; source && i < 40; i++) {
        strl_status status = strl_source_submit(source, i, i, 64, (float)i, &err);
        accepted += status == STRL_OK;
        first = first == STRL_OK ? status : first;
    }
    for (; accepted > 0; accepted--) {
        strl_source_result result = next_answer(source);
        first = first == STRL_OK ? result.status : first;
        assert_true((result.data != NULL) == (result.status == STRL_OK));
        if (result.data)
            assert_memory_equal(result.data, content + result.token, 64);
        strl__free(result.data);
    }
    strl_source_close(source);
    return first;
}

static void every_failed_allocation_is_a_clean_failure(void **state)
{
    (void)state;
    for (int kind = 0; kind < SOURCE_KINDS; kind++) {
        uint64_t budget = 0;
        strl_status status;
        do {
            strl__alloc_fail_after(++budget);
            status = use_source(kind);
            strl__alloc_fail_after(0);
            assert_true(status == STRL_OK || status == STRL_ERR_MEMORY);
        } while (status != STRL_OK);
        assert_true(budget > 80); /* at least one for each read and one for its bytes */
    }
}

static void every_failed_file_read_is_a_failed_answer(void **state)
{
    (void)state;
    const int kinds[] = {SOURCE_FILE_0, SOURCE_FILE_1, SOURCE_FILE_4, SOURCE_DELAYED_FILE};
    for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++) {
        uint64_t budget = 0;
        strl_status status;
        do {
            strl_file_fail_reads_after(++budget);
            status = use_source(kinds[k]);
            strl_file_fail_reads_after(0);
            assert_true(status == STRL_OK || status == STRL_ERR_IO);
        } while (status != STRL_OK);
        assert_int_equal(budget, 41);
    }
}

/* What a callback was asked, and what it says. */
typedef struct scripted {
    strl_status status;
    const char *sentence; /* NULL = none */
    unsigned closed;
} scripted;

static strl_status read_scripted(void *context, uint64_t offset, void *data, size_t size, strl_error *err)
{
    const scripted *self = context;
    memset(data, (int)offset, size);
    return self->sentence ? strl_error_set(err, self->status, self->sentence) : self->status;
}

static void close_scripted(void *context)
{
    ((scripted *)context)->closed++;
}

static strl_source *must_open_scripted(scripted *script, unsigned threads)
{
    strl_source *source = NULL;
    const strl_source_callbacks callbacks = {
        .name = "over there", .bytes = BYTES, .context = script, .read = read_scripted, .close = close_scripted};
    assert_int_equal(strl_source_open_callbacks(&callbacks, threads, &source, NULL), STRL_OK);
    assert_string_equal(source->name, "over there");
    return source;
}

static void what_a_callback_says_of_a_failure_is_what_is_answered(void **state)
{
    (void)state;
    const struct {
        strl_status status;
        const char *sentence, *answered;
    } cases[] = {{STRL_ERR_NETWORK, "the line is cut", "the line is cut"},
                 {STRL_ERR_IO, NULL, "the callback could not read 8 bytes at byte 5"},
                 {STRL_ERR_IO, "", "the callback could not read 8 bytes at byte 5"}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        scripted script = {.status = cases[i].status, .sentence = cases[i].sentence};
        strl_source *source = must_open_scripted(&script, (unsigned)i);
        assert_int_equal(strl_source_submit(source, 1, 5, 8, 0, NULL), STRL_OK);
        strl_source_result result = next_answer(source);
        assert_int_equal(result.status, cases[i].status);
        assert_string_equal(result.error.message, cases[i].answered);
        assert_null(result.data);
        strl_error err = {STRL_OK, "an older sentence"};
        assert_int_equal(strl_source_read(source, 5, &(uint64_t){0}, 8, &err), cases[i].status);
        assert_string_equal(err.message, cases[i].answered);
        strl_source_close(source);
        assert_int_equal(script.closed, 1);
    }
}

static void a_source_of_callbacks_closes_once_and_only_where_it_was_opened(void **state)
{
    (void)state;
    scripted script = {.status = STRL_OK};
    strl_source *source = must_open_scripted(&script, 2);
    for (uint64_t i = 0; i < 50; i++)
        assert_int_equal(strl_source_submit(source, i, i, 1000, 0, NULL), STRL_OK);
    strl_source_close(source);
    assert_int_equal(script.closed, 1);
    strl_source_callbacks callbacks = {.name = "nowhere", .context = &script, .close = close_scripted};
    strl_error err;
    assert_int_equal(strl_source_open_callbacks(&callbacks, 0, &source, &err), STRL_ERR_ARGUMENT);
    assert_null(source);
    callbacks.read = read_scripted;
    for (uint64_t n = 1; n <= 3; n++) { /* the source, its name, its pool */
        strl__alloc_fail_after(n);
        assert_int_equal(strl_source_open_callbacks(&callbacks, 2, &source, &err), STRL_ERR_MEMORY);
        strl__alloc_fail_after(0);
        assert_null(source);
    }
    assert_int_equal(script.closed, 1);
}

static void a_failure_names_its_source_once(void **state)
{
    (void)state;
    scripted script = {.status = STRL_OK};
    strl_source *source = must_open_scripted(&script, 0);
    strl_error err;
    strl_error_set(&err, STRL_ERR_FORMAT, "byte 3 is wrong");
    assert_int_equal(strl_source_fail(source, STRL_ERR_FORMAT, &err), STRL_ERR_FORMAT);
    assert_string_equal(err.message, "over there: byte 3 is wrong");
    assert_int_equal(strl_source_fail(source, STRL_ERR_FORMAT, &err), STRL_ERR_FORMAT);
    assert_string_equal(err.message, "over there: byte 3 is wrong");
    assert_int_equal(strl_source_fail(source, STRL_ERR_FORMAT, NULL), STRL_ERR_FORMAT);
    strl_source_close(source);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_accepted_read_is_answered_once_with_its_bytes),
        cmocka_unit_test(a_waiting_read_gives_the_bytes_of_any_kind),
        cmocka_unit_test(ranges_outside_the_source_are_not_accepted),
        cmocka_unit_test(the_most_urgent_read_is_served_first_then_the_oldest),
        cmocka_unit_test(cancelled_reads_are_answered_and_the_others_keep_their_order),
        cmocka_unit_test(without_threads_a_poll_reads_at_most_once),
        cmocka_unit_test(closing_drops_what_is_unanswered),
        cmocka_unit_test(a_delayed_answer_comes_neither_early_nor_in_a_wait),
        cmocka_unit_test(a_cancelled_delayed_read_is_answered_at_once),
        cmocka_unit_test(every_nth_delayed_answer_fails),
        cmocka_unit_test(a_file_that_shrinks_is_answered_with_a_failure),
        cmocka_unit_test(a_missing_file_or_a_folder_is_refused),
        cmocka_unit_test(what_a_callback_says_of_a_failure_is_what_is_answered),
        cmocka_unit_test(a_source_of_callbacks_closes_once_and_only_where_it_was_opened),
        cmocka_unit_test(a_failure_names_its_source_once),
        cmocka_unit_test(every_failed_allocation_is_a_clean_failure),
        cmocka_unit_test(every_failed_file_read_is_a_failed_answer),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
