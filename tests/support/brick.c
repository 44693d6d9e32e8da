#include "support/brick.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "support/brick_streams.h"

#define MOST_LEVELS 255u
#define MOST_SPLATS 65535u

enum { SIDE = 0, CENTRE, COVERAGE, NORMAL, PARALLEL, COLOUR, LEVEL = 9, COUNT, COUNT_ABOVE };

static const unsigned colour_shift[4] = {8, 0, 16, 24}; /* green, red, blue, alpha */

static uint64_t take(const uint8_t *payload, size_t size, size_t *at, unsigned bytes)
{
    uint64_t value = 0;
    assert_true(size - *at >= bytes);
    for (unsigned i = 0; i < bytes; i++)
        value |= (uint64_t)payload[(*at)++] << 8 * i;
    return value;
}

static float to_float(uint64_t bits)
{
    uint32_t low = (uint32_t)bits;
    float value;
    memcpy(&value, &low, sizeof value);
    return value;
}

static void *room(size_t count, size_t size)
{
    void *items = calloc(count, size);
    assert_non_null(items);
    return items;
}

/* ---- places */

static unsigned shift_of(unsigned side)
{
    return side < 5 ? 0 : side - 5;
}

static int64_t units_of(int64_t centre, unsigned side)
{
    return centre >> shift_of(side);
}

static int64_t middle_of(int64_t units, unsigned side)
{
    int64_t unit = (int64_t)1 << shift_of(side);
    return units * unit + unit / 2;
}

/* ---- reading */

static int32_t next_residual(test_stream *stream)
{
    uint32_t value = test_stream_next(stream);
    return value % 2 ? -(int32_t)(value / 2) - 1 : (int32_t)(value / 2);
}

static void next_byte(test_stream *stream, uint8_t *value)
{
    *value = (uint8_t)(*value + next_residual(stream));
}

/* *splat: the one before. */
static void next_splat(test_stream *stream, test_brick_splat *splat)
{
    next_byte(&stream[SIDE], &splat->side);
    for (unsigned k = 0; k < 3; k++)
        splat->centre[k] =
            middle_of(units_of(splat->centre[k], splat->side) + next_residual(&stream[CENTRE]), splat->side);
    splat->coverage = (uint8_t)(255 - test_stream_next(&stream[COVERAGE]));
    for (unsigned k = 0; k < 2; k++)
        next_byte(&stream[NORMAL], &splat->normal[k]);
    splat->parallel = (uint8_t)(255 - test_stream_next(&stream[PARALLEL]));
    uint32_t rgba = 0;
    int32_t green = 0;
    for (unsigned k = 0; k < 4; k++) {
        int32_t more = next_residual(&stream[COLOUR + k]) + (k == 1 || k == 2 ? green : 0);
        rgba |= (uint32_t)(uint8_t)((int32_t)(splat->rgba >> colour_shift[k] & 255) + more) << colour_shift[k];
        green = k == 0 ? more : green;
    }
    splat->rgba = rgba;
}

static void read_runs(test_brick *brick, test_stream *stream)
{
    uint32_t before = UINT32_MAX;
    brick->run_count = stream[LEVEL].count;
    brick->run = room(brick->run_count + 16, sizeof *brick->run);
    for (uint32_t i = 0; i < brick->run_count; i++) {
        uint32_t up = test_stream_next(&stream[LEVEL]);
        up += i > 0 && up >= before;
        before = up;
        brick->run[i].level = (uint8_t)(brick->level_count - up);
        brick->run[i].count = test_stream_next(&stream[up ? COUNT_ABOVE : COUNT]) + 1;
    }
}

void test_brick_read(test_brick *brick, const uint8_t *payload, size_t size)
{
    size_t at = 0;
    test_stream stream[TEST_BRICK_STREAMS];
    test_brick_splat splat = {.rgba = UINT32_MAX};
    *brick = (test_brick){.level = room(MOST_LEVELS, sizeof *brick->level),
                          .splat = room(MOST_SPLATS, sizeof *brick->splat)};
    brick->version = (uint8_t)take(payload, size, &at, 1);
    brick->level_count = (uint8_t)take(payload, size, &at, 1);
    size_t coded = take(payload, size, &at, 4);
    for (unsigned i = 0; i < brick->level_count; i++) {
        brick->level[i].size = to_float(take(payload, size, &at, 4));
        brick->splat_count = brick->level[i].end = (uint16_t)take(payload, size, &at, 2);
    }
    assert_true(coded <= size - at);
    test_streams_read(stream, payload + at, coded);
    for (uint32_t i = 0; i < brick->splat_count; i++) {
        next_splat(stream, &splat);
        brick->splat[i] = splat;
    }
    read_runs(brick, stream);
    test_streams_free(stream);
    brick->bytes = at + coded;
}

/* ---- writing */

static void push_residual(test_stream *stream, int64_t value)
{
    uint32_t low = (uint32_t)(uint64_t)value;
    test_stream_push(stream, low < 0x80000000u ? 2 * low : 2 * ~low + 1);
}

static void push_splat(test_stream *stream, const test_brick_splat *splat, const test_brick_splat *before)
{
    push_residual(&stream[SIDE], (int)splat->side - before->side);
    for (unsigned k = 0; k < 3; k++) {
        int64_t was = middle_of(units_of(before->centre[k], before->side), before->side);
        push_residual(&stream[CENTRE], units_of(splat->centre[k], splat->side) - units_of(was, splat->side));
    }
    test_stream_push(&stream[COVERAGE], 255u - splat->coverage);
    for (unsigned k = 0; k < 2; k++)
        push_residual(&stream[NORMAL], (int)splat->normal[k] - before->normal[k]);
    test_stream_push(&stream[PARALLEL], 255u - splat->parallel);
    for (unsigned k = 0, green = 0; k < 4; k++) {
        uint32_t more = (splat->rgba >> colour_shift[k] & 255) - (before->rgba >> colour_shift[k] & 255);
        push_residual(&stream[COLOUR + k], (int32_t)(more - (k == 1 || k == 2 ? green : 0)));
        green = k == 0 ? more : green;
    }
}

static void push_runs(const test_brick *brick, test_stream *stream)
{
    for (uint32_t i = 0, before = UINT32_MAX, up; i < brick->run_count; i++, before = up) {
        up = (uint32_t)brick->level_count - brick->run[i].level;
        test_stream_push(&stream[LEVEL], i > 0 && up > before ? up - 1 : up);
        test_stream_push(&stream[up ? COUNT_ABOVE : COUNT], brick->run[i].count - 1);
    }
}

static uint8_t *put(uint8_t *to, unsigned bytes, uint64_t value)
{
    for (unsigned i = 0; i < bytes; i++)
        *to++ = (uint8_t)(value >> 8 * i);
    return to;
}

uint8_t *test_brick_write(const test_brick *brick, const uint8_t *payload, size_t size, size_t *written)
{
    test_stream stream[TEST_BRICK_STREAMS] = {0};
    const test_brick_splat white = {.rgba = UINT32_MAX};
    size_t coded;
    for (uint32_t i = 0; i < brick->splat_count; i++)
        push_splat(stream, &brick->splat[i], i ? &brick->splat[i - 1] : &white);
    push_runs(brick, stream);
    if (brick->surplus)
        test_stream_push(&stream[brick->surplus - 1], 0);
    if (brick->missing)
        stream[brick->missing - 1].count--;
    uint8_t *streams = test_streams_write(stream, &coded);
    size_t head = 6 + 6 * (size_t)brick->level_count + coded;
    uint8_t *bytes = room(head + size - brick->bytes, 1), *to = bytes;
    to = put(put(put(to, 1, brick->version), 1, brick->level_count), 4, coded);
    for (unsigned i = 0; i < brick->level_count; i++) {
        uint32_t bits;
        memcpy(&bits, &brick->level[i].size, sizeof bits);
        to = put(put(to, 4, bits), 2, brick->level[i].end);
    }
    memcpy(to, streams, coded);
    memcpy(to + coded, payload + brick->bytes, size - brick->bytes);
    *written = head + size - brick->bytes;
    free(streams);
    test_streams_free(stream);
    return bytes;
}

void test_brick_free(test_brick *brick)
{
    free(brick->level);
    free(brick->splat);
    free(brick->run);
    *brick = (test_brick){0};
}
