/* The streams of a brick's head, by the text of docs/format-payload.md ("Streams") alone. */
#ifndef STRL_TESTS_SUPPORT_BRICK_STREAMS_H
#define STRL_TESTS_SUPPORT_BRICK_STREAMS_H

#include <stddef.h>
#include <stdint.h>

#include "support/brick.h"

typedef struct test_stream {
    uint32_t *value; /* malloc */
    uint32_t count, at;
} test_stream;

/* All fail the running test where something is not as the text says. size: all that is coded. */
void test_streams_read(test_stream stream[TEST_BRICK_STREAMS], const uint8_t *bytes, size_t size);
/* Without symbols: each value as it is, in 32 bits; malloc. */
uint8_t *test_streams_write(const test_stream stream[TEST_BRICK_STREAMS], size_t *size);
void test_streams_free(test_stream stream[TEST_BRICK_STREAMS]);
uint32_t test_stream_next(test_stream *stream);
void test_stream_push(test_stream *stream, uint32_t value);

#endif
