#include "support/brick_streams.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#define ONE 2048u /* sum of the frequencies */
#define SYMBOLS 72u
#define HEAD_BYTES 20u
#define END_STATE 65536u

typedef struct coded {
    const uint8_t *words, *bits;
    size_t word_count, word_at, bit_count, bit_at;
    uint32_t state[4];
} coded;

static uint32_t load(const uint8_t *bytes, unsigned count)
{
    uint32_t value = 0;
    for (unsigned i = 0; i < count; i++)
        value |= (uint32_t)bytes[i] << 8 * i;
    return value;
}

static uint32_t next_bits(coded *from, unsigned count)
{
    uint32_t value = 0;
    assert_true(from->bit_count - from->bit_at >= count);
    for (unsigned i = 0; i < count; i++, from->bit_at++)
        value |= (uint32_t)(from->bits[from->bit_at / 8] >> from->bit_at % 8 & 1) << i;
    return value;
}

/* A leading one that is not written, behind the number of its place. */
static uint32_t next_number(coded *from, unsigned length_bits)
{
    unsigned length = next_bits(from, length_bits);
    return length ? 1u << (length - 1) | next_bits(from, length - 1) : 0;
}

static unsigned next_table(coded *from, uint32_t frequency[SYMBOLS])
{
    unsigned symbols = next_bits(from, 7);
    uint32_t left = ONE;
    assert_true(symbols >= 1 && symbols <= SYMBOLS);
    for (unsigned s = 0; s + 1 < symbols; s++) {
        frequency[s] = next_number(from, 4);
        assert_true(frequency[s] <= left);
        left -= frequency[s];
    }
    assert_true(left > 0);
    frequency[symbols - 1] = left;
    return symbols;
}

static unsigned next_symbol(coded *from, uint32_t *state, const uint32_t frequency[SYMBOLS])
{
    uint32_t slot = *state % ONE, start = 0;
    unsigned symbol = 0;
    while (slot >= start + frequency[symbol])
        start += frequency[symbol++];
    *state = frequency[symbol] * (*state / ONE) + slot - start;
    if (*state < END_STATE) {
        assert_true(from->word_at < from->word_count);
        *state = *state << 16 | load(from->words + 2 * from->word_at++, 2);
    }
    return symbol;
}

static void read_stream(coded *from, test_stream *stream)
{
    uint32_t count = next_number(from, 5), frequency[SYMBOLS] = {0};
    for (unsigned mode = count ? next_bits(from, 6) : 0, tables = 0; count; count--) {
        assert_true(mode <= 33);
        if (mode == 33 && !tables++)
            next_table(from, frequency);
        if (mode < 33) {
            test_stream_push(stream, next_bits(from, mode));
            continue;
        }
        unsigned symbol = next_symbol(from, &from->state[stream->count % 4], frequency),
                 raw = symbol < 16 ? 0 : (symbol - 16) / 2 + 3;
        test_stream_push(stream, raw ? ((2 + symbol % 2) << raw) + next_bits(from, raw) : symbol);
    }
}

void test_streams_read(test_stream stream[TEST_BRICK_STREAMS], const uint8_t *bytes, size_t size)
{
    assert_true(size >= HEAD_BYTES);
    coded from = {.words = bytes + HEAD_BYTES, .word_count = load(bytes, 4)};
    for (unsigned i = 0; i < 4; i++)
        from.state[i] = load(bytes + 4 + 4 * i, 4);
    assert_true(from.word_count <= (size - HEAD_BYTES) / 2);
    from.bits = from.words + 2 * from.word_count;
    from.bit_count = 8 * (size - HEAD_BYTES - 2 * from.word_count);
    memset(stream, 0, TEST_BRICK_STREAMS * sizeof *stream);
    for (unsigned i = 0; i < TEST_BRICK_STREAMS; i++)
        read_stream(&from, &stream[i]);
    assert_int_equal(from.word_at, from.word_count);
    for (unsigned i = 0; i < 4; i++)
        assert_int_equal(from.state[i], END_STATE);
    while (from.bit_at < from.bit_count)
        assert_int_equal(next_bits(&from, 1), 0);
}

static void put_bits(uint8_t *bytes, size_t *at, unsigned count, uint32_t value)
{
    for (unsigned i = 0; i < count; i++, ++*at)
        bytes[*at / 8] |= (uint8_t)((value >> i & 1) << *at % 8);
}

uint8_t *test_streams_write(const test_stream stream[TEST_BRICK_STREAMS], size_t *size)
{
    size_t most = HEAD_BYTES, at = 8 * HEAD_BYTES;
    for (unsigned i = 0; i < TEST_BRICK_STREAMS; i++)
        most += 8 + 4 * (size_t)stream[i].count;
    uint8_t *bytes = calloc(most, 1);
    assert_non_null(bytes);
    for (unsigned i = 0; i < 4; i++)
        bytes[4 + 4 * i + 2] = 1; /* END_STATE */
    for (unsigned i = 0; i < TEST_BRICK_STREAMS; i++) {
        unsigned length = 0;
        while (stream[i].count >> length)
            length++;
        put_bits(bytes, &at, 5, length);
        if (!length)
            continue;
        put_bits(bytes, &at, length - 1, stream[i].count);
        put_bits(bytes, &at, 6, 32);
        for (uint32_t v = 0; v < stream[i].count; v++)
            put_bits(bytes, &at, 32, stream[i].value[v]);
    }
    *size = (at + 7) / 8;
    return bytes;
}

void test_streams_free(test_stream stream[TEST_BRICK_STREAMS])
{
    for (unsigned i = 0; i < TEST_BRICK_STREAMS; i++)
        free(stream[i].value);
}

uint32_t test_stream_next(test_stream *stream)
{
    assert_true(stream->at < stream->count);
    return stream->value[stream->at++];
}

void test_stream_push(test_stream *stream, uint32_t value)
{
    if ((stream->count & (stream->count + 1)) == 0) {
        stream->value = realloc(stream->value, (2 * (size_t)stream->count + 2) * sizeof *stream->value);
        assert_non_null(stream->value);
    }
    stream->value[stream->count++] = value;
}
