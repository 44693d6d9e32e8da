/* What is asked for first: the most urgent of many candidates, found without putting all in order. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <cmocka.h>

#include "base/hash.h"
#include "walk/internal.h"

#define MOST 3000u

typedef float (*urgency_of)(uint32_t i, uint32_t count);

static float in_order(uint32_t i, uint32_t count)
{
    return (float)(count - i);
}

static float the_other_way(uint32_t i, uint32_t count)
{
    (void)count;
    return (float)i;
}

static float all_alike(uint32_t i, uint32_t count)
{
    (void)i, (void)count;
    return 0.5f;
}

static float at_random(uint32_t i, uint32_t count)
{
    (void)count;
    return (float)(strl__mix64(i) >> 40);
}

static float of_few_values(uint32_t i, uint32_t count)
{
    (void)count;
    return (float)(strl__mix64(i) % 3);
}

static float up_and_down(uint32_t i, uint32_t count)
{
    return (float)(i < count / 2 ? i : count - i);
}

static float without_bound(uint32_t i, uint32_t count)
{
    (void)count;
    return strl__mix64(i) % 4 ? (float)i : INFINITY;
}

static int descending(const void *left, const void *right)
{
    float a = *(const float *)left, b = *(const float *)right;
    return (a < b) - (a > b);
}

static void check(urgency_of of, uint32_t count, uint32_t at)
{
    strl__candidates candidates = {.items = calloc(count, sizeof *candidates.items), .count = count};
    float *sorted = calloc(count, sizeof *sorted);
    uint64_t sum = 0;
    assert_true(candidates.items && sorted);
    for (uint32_t i = 0; i < count; i++) {
        sorted[i] = of(i, count);
        candidates.items[i] = (strl__candidate){.urgency = sorted[i], .treelet = i};
    }
    qsort(sorted, count, sizeof *sorted, descending);
    strl__candidates_select(&candidates, at);
    assert_int_equal(candidates.count, count);
    assert_true(candidates.items[at].urgency == sorted[at]);
    for (uint32_t i = 0; i < count; i++) {
        const strl__candidate *item = &candidates.items[i];
        assert_true(item->urgency == of(item->treelet, count)); /* what belongs together stayed together */
        assert_true(i < at ? item->urgency >= sorted[at] : item->urgency <= sorted[at]);
        sum += strl__mix64(item->treelet) - strl__mix64(i);
    }
    assert_true(sum == 0); /* each once */
    free(candidates.items);
    free(sorted);
}

static void the_most_urgent_come_first(void **state)
{
    (void)state;
    const urgency_of of[] = {in_order, the_other_way, all_alike, at_random, of_few_values, up_and_down, without_bound};
    const uint32_t counts[] = {1, 2, 3, 7, 64, MOST};
    for (size_t k = 0; k < sizeof of / sizeof *of; k++)
        for (size_t n = 0; n < sizeof counts / sizeof *counts; n++)
            for (uint32_t at = 0; at < counts[n]; at += 1 + counts[n] / 16)
                check(of[k], counts[n], at);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(the_most_urgent_come_first)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
