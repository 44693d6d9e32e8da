/* Numbers packed for scratch come back, are short where they are alike, and never come from behind the end. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "base/hash.h"
#include "base/memory.h"
#include "store/pack.h"

#define NUMBERS 10000u

/* Numbers of all lengths, with runs of one length between them. */
static uint32_t number(uint32_t i)
{
    unsigned length = (unsigned)(strl__mix64(i / (1 + i % 7 * 16)) % 33);
    uint32_t bits = (uint32_t)strl__mix64(i + 1000003);
    return length ? bits >> (32 - length) | 1u << (length - 1) : 0;
}

static size_t pack_numbers(uint32_t (*number_at)(uint32_t), strl_writer *out)
{
    strl_packer packer = {.out = out};
    strl_pack_model model = {0};
    for (uint32_t i = 0; i < NUMBERS; i++)
        strl_pack(&packer, &model, number_at(i));
    strl_pack_finish(&packer);
    assert_false(out->failed);
    return out->size;
}

static void numbers_of_every_length_come_back(void **state)
{
    (void)state;
    strl_writer out = {0};
    size_t size = pack_numbers(number, &out);
    strl_unpacker unpacker = strl_unpacker_make(out.data, size);
    strl_pack_model model = {0};
    for (uint32_t i = 0; i < NUMBERS; i++)
        assert_int_equal(strl_unpack(&unpacker, &model), number(i));
    assert_false(unpacker.failed);
    assert_true(unpacker.end - unpacker.at < 8);
    strl__free(out.data);
}

static uint32_t same(uint32_t i)
{
    return i < NUMBERS / 2 ? 0 : 1;
}

static void numbers_that_repeat_take_about_a_bit(void **state)
{
    (void)state;
    strl_writer out = {0};
    assert_true(pack_numbers(same, &out) <= NUMBERS / 8 + 16);
    strl__free(out.data);
}

static void nothing_comes_from_behind_the_end(void **state)
{
    (void)state;
    strl_writer out = {0};
    size_t size = pack_numbers(number, &out);
    for (size_t cut = 0; cut < size; cut += 1 + size / 97) {
        uint8_t *some = strl__alloc(cut, 1); /* of its own, for sanitizers to watch */
        memcpy(some, out.data, cut);
        strl_unpacker unpacker = strl_unpacker_make(some, cut);
        strl_pack_model model = {0};
        for (uint32_t i = 0; i < NUMBERS; i++)
            strl_unpack(&unpacker, &model);
        assert_true(unpacker.failed);
        strl__free(some);
    }
    strl__free(out.data);
}

/* Any bytes are numbers, or fail. */
static void noise_is_harmless(void **state)
{
    (void)state;
    for (uint64_t seed = 0; seed < 200; seed++) {
        uint8_t noise[64];
        for (uint64_t i = 0; i < sizeof noise; i++)
            noise[i] = (uint8_t)(strl__mix64(seed << 32 | i) >> (seed % 5 * 8)) & (seed % 3 ? 0xff : 0x01);
        strl_unpacker unpacker = strl_unpacker_make(noise, sizeof noise);
        strl_pack_model model = {0};
        for (uint32_t i = 0; i < 600; i++)
            strl_unpack(&unpacker, &model);
        assert_true(unpacker.failed);
    }
}

static void position_at(uint32_t i, uint32_t position[3])
{
    for (uint32_t k = 0; k < 3; k++)
        position[k] =
            (uint32_t)strl__mix64(i / 3 * 3 + k) / (i % 1000 ? 2 : 1) + (uint32_t)(strl__mix64(3 * i + k) & 1023);
}

static void positions_come_back(void **state)
{
    (void)state;
    strl_writer out = {0};
    strl_packer packer = {.out = &out};
    strl_pack_points points;
    uint32_t position[3], expected[3];
    strl_pack_points_init(&points);
    for (uint32_t i = 0; i < NUMBERS; i++) {
        position_at(i, position);
        strl_pack_point(&packer, &points, position);
    }
    strl_pack_finish(&packer);
    /* a third of the points lie anywhere, the rest within 1024 of the one before */
    assert_true(out.size < NUMBERS / 3 * (12 + 2 * 5) * 5 / 4);
    strl_unpacker unpacker = strl_unpacker_make(out.data, out.size);
    strl_pack_points_init(&points);
    for (uint32_t i = 0; i < NUMBERS; i++) {
        position_at(i, expected);
        strl_unpack_point(&unpacker, &points, position);
        assert_memory_equal(position, expected, sizeof expected);
    }
    assert_false(unpacker.failed);
    strl__free(out.data);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers_of_every_length_come_back),
        cmocka_unit_test(numbers_that_repeat_take_about_a_bit),
        cmocka_unit_test(nothing_comes_from_behind_the_end),
        cmocka_unit_test(noise_is_harmless),
        cmocka_unit_test(positions_come_back),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
