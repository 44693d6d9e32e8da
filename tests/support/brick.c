#include "support/brick.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

typedef struct reading {
    const uint8_t *data;
    size_t size, at;
} reading;

static uint64_t take(reading *from, unsigned bytes)
{
    uint64_t value = 0;
    assert_true(from->size - from->at >= bytes);
    for (unsigned i = 0; i < bytes; i++)
        value |= (uint64_t)from->data[from->at++] << 8 * i;
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

void test_brick_read(test_brick *brick, const uint8_t *payload, size_t size)
{
    reading from = {payload, size, 0};
    *brick = (test_brick){.level = room(255, sizeof *brick->level), .splat = room(65535, sizeof *brick->splat)};
    brick->version = (uint8_t)take(&from, 1);
    brick->level_count = (uint8_t)take(&from, 1);
    brick->run_count = (uint32_t)take(&from, 4);
    for (unsigned i = 0; i < brick->level_count; i++) {
        brick->level[i].size = to_float(take(&from, 4));
        brick->splat_count = brick->level[i].end = (uint16_t)take(&from, 2);
    }
    for (uint32_t i = 0; i < brick->splat_count; i++) {
        test_brick_splat *splat = &brick->splat[i];
        for (int k = 0; k < 3; k++)
            splat->centre[k] = (int32_t)take(&from, 4);
        splat->side = (uint8_t)take(&from, 1);
        splat->coverage = (uint8_t)take(&from, 1);
        splat->normal[0] = (uint8_t)take(&from, 1);
        splat->normal[1] = (uint8_t)take(&from, 1);
        splat->parallel = (uint8_t)take(&from, 1);
        splat->rgba = (uint32_t)take(&from, 4);
    }
    assert_true(brick->run_count <= (size - from.at) / 3);
    brick->run = room(brick->run_count + 16, sizeof *brick->run);
    for (uint32_t i = 0; i < brick->run_count; i++) {
        brick->run[i].level = (uint8_t)take(&from, 1);
        brick->run[i].count = (uint16_t)take(&from, 2);
    }
    brick->bytes = from.at;
}

static uint8_t *put(uint8_t *to, unsigned bytes, uint64_t value)
{
    for (unsigned i = 0; i < bytes; i++)
        *to++ = (uint8_t)(value >> 8 * i);
    return to;
}

uint8_t *test_brick_write(const test_brick *brick, const uint8_t *payload, size_t size, size_t *written)
{
    size_t head = 6 + 6 * (size_t)brick->level_count + TEST_BRICK_SPLAT_BYTES * (size_t)brick->splat_count +
                  3 * (size_t)brick->run_count;
    uint8_t *bytes = room(head + size - brick->bytes, 1), *to = bytes;
    to = put(put(put(to, 1, brick->version), 1, brick->level_count), 4, brick->run_count);
    for (unsigned i = 0; i < brick->level_count; i++) {
        uint32_t bits;
        memcpy(&bits, &brick->level[i].size, sizeof bits);
        to = put(put(to, 4, bits), 2, brick->level[i].end);
    }
    for (uint32_t i = 0; i < brick->splat_count; i++) {
        const test_brick_splat *splat = &brick->splat[i];
        for (int k = 0; k < 3; k++)
            to = put(to, 4, (uint32_t)splat->centre[k]);
        to = put(put(put(put(put(to, 1, splat->side), 1, splat->coverage), 1, splat->normal[0]), 1, splat->normal[1]), 1,
                 splat->parallel);
        to = put(to, 4, splat->rgba);
    }
    for (uint32_t i = 0; i < brick->run_count; i++)
        to = put(put(to, 1, brick->run[i].level), 2, brick->run[i].count);
    memcpy(to, payload + brick->bytes, size - brick->bytes);
    *written = head + size - brick->bytes;
    return bytes;
}

void test_brick_free(test_brick *brick)
{
    free(brick->level);
    free(brick->splat);
    free(brick->run);
    *brick = (test_brick){0};
}
