#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "base/cursor.h"
#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"

static void a_cursor_fails_for_good_at_the_first_short_read(void **state)
{
    (void)state;
    const uint8_t bytes[] = {1, 2, 3, 4, 5};
    strl_cursor cursor = strl_cursor_make(bytes, sizeof bytes);
    assert_int_equal(strl_cursor_u32(&cursor), 0x04030201);
    assert_int_equal(strl_cursor_u16(&cursor), 0);
    assert_true(cursor.failed);
    assert_int_equal(strl_cursor_u8(&cursor), 0);
    assert_int_equal(strl_cursor_left(&cursor), 0);
}

static void what_a_writer_wrote_a_cursor_reads_back(void **state)
{
    (void)state;
    strl_writer writer = {0};
    strl_writer_u8(&writer, 7);
    strl_writer_u64(&writer, 0x0123456789abcdefu);
    strl_writer_f64(&writer, -1.5);
    strl_writer_i64(&writer, -42);
    strl_writer_f32(&writer, 0.25f);
    strl_cursor cursor = strl_cursor_make(writer.data, writer.size);
    assert_int_equal(strl_cursor_u8(&cursor), 7);
    assert_true(strl_cursor_u64(&cursor) == 0x0123456789abcdefu);
    assert_true(strl_cursor_f64(&cursor) == -1.5);
    assert_true(strl_cursor_i64(&cursor) == -42);
    assert_true(strl_cursor_f32(&cursor) == 0.25f);
    assert_int_equal(strl_cursor_left(&cursor), 0);
    strl__free(writer.data);
}

static void an_overflowing_size_is_no_allocation(void **state)
{
    (void)state;
    assert_null(strl__alloc(SIZE_MAX / 2, 3));
    strl_arena arena;
    strl_arena_init(&arena, 0);
    assert_null(strl_arena_alloc(&arena, SIZE_MAX / 2, 3));
    assert_null(strl_arena_alloc(&arena, SIZE_MAX, 1));
    strl_arena_deinit(&arena);
}

static void an_arena_keeps_to_its_limit_and_rewinds(void **state)
{
    (void)state;
    strl_arena arena;
    strl_arena_init(&arena, 1 << 20);
    char *first = strl_arena_alloc(&arena, 100, 1);
    assert_non_null(first);
    strl_arena_mark mark = strl_arena_get_mark(&arena);
    assert_non_null(strl_arena_alloc(&arena, 600 << 10, 1));
    assert_null(strl_arena_alloc(&arena, 600 << 10, 1));
    strl_arena_rewind(&arena, mark);
    assert_non_null(strl_arena_alloc(&arena, 600 << 10, 1));
    strl_arena_deinit(&arena);
}

static void the_injected_failure_hits_the_nth_allocation_and_all_after(void **state)
{
    (void)state;
    strl__alloc_fail_after(2);
    void *first = strl__alloc(1, 1);
    void *second = strl__alloc(1, 1);
    void *third = strl__alloc(1, 1);
    strl__alloc_fail_after(0);
    assert_non_null(first);
    assert_null(second);
    assert_null(third);
    strl__free(first);
}

static void context_stands_before_the_innermost_sentence(void **state)
{
    (void)state;
    strl_error err;
    assert_int_equal(strl__fail(&err, STRL_ERR_FORMAT, "byte %d is %d", 3, 4), STRL_ERR_FORMAT);
    assert_int_equal(strl__fail_context(&err, STRL_ERR_IO, "%s", "a.ply"), STRL_ERR_FORMAT);
    assert_string_equal(err.message, "a.ply: byte 3 is 4");
    assert_int_equal(strl__fail(NULL, STRL_ERR_IO, "x"), STRL_ERR_IO);
}

static void a_sentence_of_somebody_else_is_copied_as_it_stands(void **state)
{
    (void)state;
    strl_error err;
    char text[1000];
    memset(text, 'x', sizeof text - 1);
    text[sizeof text - 1] = 0;
    assert_int_equal(strl_error_set(&err, STRL_ERR_NETWORK, "100% of %s %n are lost"), STRL_ERR_NETWORK);
    assert_true(err.status == STRL_ERR_NETWORK);
    assert_string_equal(err.message, "100% of %s %n are lost");
    strl_error_set(&err, STRL_ERR_IO, text);
    assert_int_equal(strlen(err.message), sizeof err.message - 1);
    strl_error_set(&err, STRL_ERR_IO, NULL);
    assert_string_equal(err.message, "");
    assert_int_equal(strl_error_set(NULL, STRL_ERR_IO, "x"), STRL_ERR_IO);
}

static void the_checksum_is_xxh3(void **state)
{
    (void)state;
    /* XXH3_64bits of the empty input, from its specification */
    assert_true(strl__checksum("", 0) == 0x2d06800538d394c2u);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_cursor_fails_for_good_at_the_first_short_read),
        cmocka_unit_test(what_a_writer_wrote_a_cursor_reads_back),
        cmocka_unit_test(an_overflowing_size_is_no_allocation),
        cmocka_unit_test(an_arena_keeps_to_its_limit_and_rewinds),
        cmocka_unit_test(the_injected_failure_hits_the_nth_allocation_and_all_after),
        cmocka_unit_test(context_stands_before_the_innermost_sentence),
        cmocka_unit_test(a_sentence_of_somebody_else_is_copied_as_it_stands),
        cmocka_unit_test(the_checksum_is_xxh3),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
