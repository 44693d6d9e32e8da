/* What the tests of readers share: small files in a temporary folder, read to the end. One program
 * includes it once. */
#ifndef STRL_TESTS_READERS_READER_TEST_H
#define STRL_TESTS_READERS_READER_TEST_H

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
#include "readers/internal.h"
#include "readers/reader.h"

#define MEMORY_LEAST STRL__READER_MEMORY_LEAST

static char test_folder[64];

static inline int make_test_folder(void **state)
{
    (void)state;
    strcpy(test_folder, "/tmp/stroll-readers-XXXXXX");
    return mkdtemp(test_folder) ? 0 : -1;
}

static inline int remove_test_folder(void **state)
{
    (void)state;
    return strl_path_remove_directory(test_folder, NULL) ? -1 : 0;
}

static inline const char *test_path(const char *name)
{
    static char path[128];
    snprintf(path, sizeof path, "%s/%s", test_folder, name);
    return path;
}

static inline void write_test_file(const char *name, const void *data, size_t size)
{
    FILE *file = fopen(test_path(name), "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(data, 1, size, file), size);
    assert_int_equal(fclose(file), 0);
}

static inline void write_test_text(const char *name, const char *text)
{
    write_test_file(name, text, strlen(text));
}

/* All that one pass gives. */
typedef struct read_result {
    strl_status status;
    strl_error err;
    strl_triangle *triangles; /* owned; the first `kept` */
    size_t kept;
    uint64_t count;
    uint64_t checksum; /* of all triangles in order */
    strl_reader_drops drops;
} read_result;

#define TRIANGLES_KEPT 4096u

static inline void read_pass(strl_reader *reader, read_result *result)
{
    *result = (read_result){.triangles = malloc(TRIANGLES_KEPT * sizeof(strl_triangle))};
    strl_triangle chunk[97];
    for (;;) {
        size_t count;
        memset(chunk, 0, sizeof chunk);
        result->status = strl_reader_next(reader, chunk, 97, &count, &result->err);
        if (result->status)
            assert_int_equal(count, 0);
        if (count == 0)
            break;
        for (size_t i = 0; i < count && result->kept < TRIANGLES_KEPT; i++)
            result->triangles[result->kept++] = chunk[i];
        result->count += count;
        result->checksum = strl__mix64(result->checksum ^ strl__checksum(chunk, count * sizeof *chunk));
    }
    strl_reader_drops_get(reader, &result->drops);
}

static inline void free_result(read_result *result)
{
    free(result->triangles);
    *result = (read_result){0};
}

static inline strl_status open_test_file(const char *name, uint64_t memory_bytes, strl_reader **reader, strl_error *err)
{
    strl_reader_desc desc = {.path = test_path(name), .scratch_dir = test_folder, .memory_bytes = memory_bytes};
    return strl_reader_open(&desc, reader, err);
}

/* Opens, reads one pass, closes. */
static inline void read_test_file(const char *name, uint64_t memory_bytes, read_result *result)
{
    strl_reader *reader;
    strl_error err = {0};
    strl_status status = open_test_file(name, memory_bytes, &reader, &err);
    if (status) {
        assert_null(reader);
        *result = (read_result){.status = status, .err = err};
        return;
    }
    read_pass(reader, result);
    strl_reader_close(reader);
}

static inline void assert_refused(const char *name, const char *part_of_sentence)
{
    read_result result;
    read_test_file(name, MEMORY_LEAST, &result);
    if (result.status == STRL_OK)
        fail_msg("%s was read, expected a refusal with '%s'", name, part_of_sentence);
    if (!strstr(result.err.message, part_of_sentence))
        fail_msg("'%s' does not contain '%s'", result.err.message, part_of_sentence);
    if (!strstr(result.err.message, name))
        fail_msg("'%s' does not name the file", result.err.message);
    free_result(&result);
}

static inline void assert_text_refused(const char *name, const char *text, const char *part_of_sentence)
{
    write_test_text(name, text);
    assert_refused(name, part_of_sentence);
}

static inline void assert_positions(const strl_triangle *triangle, const double expected[9])
{
    for (unsigned i = 0; i < 9; i++)
        if (triangle->position[i / 3][i % 3] != expected[i])
            fail_msg("coordinate %u is %.17g, expected %.17g", i, triangle->position[i / 3][i % 3], expected[i]);
}

/* Every proper beginning of the file is refused or gives a beginning of its triangles. Returns how
 * many were refused. */
static inline size_t read_every_beginning(const char *name, const void *data, size_t size)
{
    read_result whole, part;
    size_t refused = 0;
    write_test_file(name, data, size);
    read_test_file(name, MEMORY_LEAST, &whole);
    assert_int_equal(whole.status, STRL_OK);
    for (size_t length = 0; length < size; length++) {
        write_test_file(name, data, length);
        read_test_file(name, MEMORY_LEAST, &part);
        if (part.status)
            assert_true(part.err.message[0] != 0);
        else
            assert_true(part.count <= whole.count);
        refused += part.status != STRL_OK;
        free_result(&part);
    }
    free_result(&whole);
    return refused;
}

/* Fails the n-th allocation (read) and all after it, for every n, until the file is read. */
static inline void read_through_faults(const char *name, void (*fail_after)(uint64_t n))
{
    read_result expected, result;
    read_test_file(name, MEMORY_LEAST, &expected);
    assert_int_equal(expected.status, STRL_OK);
    uint64_t n = 0;
    do {
        fail_after(++n);
        read_test_file(name, MEMORY_LEAST, &result);
        fail_after(0);
        if (result.status == STRL_OK) {
            assert_true(result.checksum == expected.checksum);
            free_result(&result);
            break;
        }
        if (result.status != STRL_ERR_MEMORY && result.status != STRL_ERR_IO)
            fail_msg("fault %u: %s", (unsigned)n, result.err.message);
        free_result(&result);
    } while (n < 1000);
    assert_in_range(n, 2, 999);
    free_result(&expected);
}

/* A reader gives the same triangles after a rewind, and also when it was rewound in the middle. */
static inline void assert_rewinds(const char *name, uint64_t memory_bytes)
{
    strl_reader *reader;
    strl_error err;
    read_result first, second;
    strl_triangle triangle;
    size_t count;
    assert_int_equal(open_test_file(name, memory_bytes, &reader, &err), STRL_OK);
    read_pass(reader, &first);
    assert_int_equal(first.status, STRL_OK);
    assert_int_equal(strl_reader_rewind(reader, &err), STRL_OK);
    assert_int_equal(strl_reader_next(reader, &triangle, 1, &count, &err), STRL_OK);
    assert_int_equal(strl_reader_rewind(reader, &err), STRL_OK);
    read_pass(reader, &second);
    assert_true(first.count > 0 && first.count == second.count && first.checksum == second.checksum);
    assert_memory_equal(&first.drops, &second.drops, sizeof first.drops);
    strl_reader_close(reader);
    free_result(&first);
    free_result(&second);
}

#endif
