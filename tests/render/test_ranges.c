#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "base/hash.h"
#include "base/memory.h"
#include "render/gl45/ranges.h"

#define TOTAL 4096u
#define BLOCKS 300

typedef struct block {
    uint32_t first, count;
} block;

static void assert_sorted_and_joined(const strl_ranges *ranges, uint32_t used)
{
    uint32_t free = 0;
    for (size_t r = 0; r < ranges->count; r++) {
        assert_true(ranges->free[r].count > 0);
        if (r > 0)
            assert_true(ranges->free[r - 1].first + ranges->free[r - 1].count < ranges->free[r].first);
        free += ranges->free[r].count;
    }
    assert_int_equal(free + used, TOTAL);
}

static void blocks_never_overlap_and_nothing_is_lost(void **state)
{
    (void)state;
    static uint8_t owner[TOTAL];
    static block blocks[BLOCKS];
    strl_ranges ranges;
    assert_true(strl__ranges_init(&ranges, TOTAL));
    uint32_t used = 0, refused = 0;
    for (uint64_t round = 0; round < 20000; round++) {
        uint64_t random = strl__mix64(round + 1);
        block *chosen = &blocks[random % BLOCKS];
        if (chosen->count > 0) {
            memset(owner + chosen->first, 0, chosen->count);
            strl__ranges_give(&ranges, chosen->first, chosen->count);
            used -= chosen->count;
            chosen->count = 0;
        } else {
            uint32_t count = 1 + (uint32_t)(random >> 32) % 40, first = strl__ranges_take(&ranges, count);
            if (first == STRL_RANGES_NONE) {
                refused++;
                continue;
            }
            assert_true(first + count <= TOTAL);
            for (uint32_t g = first; g < first + count; g++)
                assert_int_equal(owner[g]++, 0);
            *chosen = (block){first, count};
            used += count;
        }
        assert_sorted_and_joined(&ranges, used);
    }
    assert_true(refused > 10);
    for (int b = 0; b < BLOCKS; b++)
        if (blocks[b].count > 0)
            strl__ranges_give(&ranges, blocks[b].first, blocks[b].count);
    assert_int_equal(ranges.count, 1);
    assert_int_equal(ranges.free[0].count, TOTAL);
    strl__ranges_deinit(&ranges);
}

static void without_memory_nothing_is_taken(void **state)
{
    (void)state;
    strl_ranges ranges;
    strl__alloc_fail_after(1);
    assert_false(strl__ranges_init(&ranges, TOTAL));
    strl__alloc_fail_after(0);
    assert_true(strl__ranges_init(&ranges, TOTAL));
    uint32_t taken = 0, refused = 0;
    strl__alloc_fail_after(1);
    for (int b = 0; b < 64; b++)
        *(strl__ranges_take(&ranges, 1) == STRL_RANGES_NONE ? &refused : &taken) += 1;
    strl__alloc_fail_after(0);
    assert_true(refused > 0);
    assert_sorted_and_joined(&ranges, taken);
    strl__ranges_deinit(&ranges);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(blocks_never_overlap_and_nothing_is_lost),
        cmocka_unit_test(without_memory_nothing_is_taken),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
