/* How much a remote source asks for at a time, and when again. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "source/http_pace.h"

#define MS ((uint64_t)1000000)

/* A transfer of `bytes` at this rate, a chunk every 10 ms, from `now` on; returns when it has ended. */
static uint64_t carry(strl__pace *pace, uint64_t now_ns, uint64_t bytes, uint64_t bytes_per_s)
{
    uint64_t chunk = bytes_per_s / 100;
    strl__pace_begin(pace, now_ns);
    for (uint64_t sent = 0; sent < bytes; sent += chunk) {
        now_ns += 10 * MS;
        strl__pace_add_bytes(pace, now_ns, (size_t)chunk);
    }
    strl__pace_end(pace, now_ns);
    return now_ns;
}

static void assert_about(double found, double expected)
{
    if (!(found > 0.9 * expected && found < 1.1 * expected))
        fail_msg("found %g, expected about %g", found, expected);
}

static void bandwidth_is_of_the_time_in_which_bytes_come(void **state)
{
    (void)state;
    strl__pace pace = {0};
    uint64_t now_ns = 1000 * MS;
    for (unsigned i = 0; i < 20; i++) /* a second of silence between transfers is no slowness */
        now_ns = carry(&pace, now_ns + 1000 * MS, 128 << 10, 625000);
    assert_about(pace.bytes_per_s, 625000);
    for (unsigned i = 0; i < 20; i++)
        now_ns = carry(&pace, now_ns, 1 << 20, 6250000);
    assert_about(pace.bytes_per_s, 6250000);
}

static void transfers_at_the_same_time_share_one_bandwidth(void **state)
{
    (void)state;
    strl__pace pace = {0};
    uint64_t now_ns = MS;
    for (unsigned k = 0; k < 4; k++)
        strl__pace_begin(&pace, now_ns);
    for (unsigned i = 0; i < 400; i++) { /* each a quarter */
        now_ns += 10 * MS;
        strl__pace_add_bytes(&pace, now_ns, 10000);
    }
    for (unsigned k = 0; k < 4; k++)
        strl__pace_end(&pace, now_ns);
    assert_about(pace.bytes_per_s, 1e6);
    assert_int_equal(pace.receiving, 0);
}

static void a_latency_that_falls_is_believed_at_once_and_one_that_grows_in_time(void **state)
{
    (void)state;
    strl__pace pace = {0};
    strl__pace_add_latency(&pace, 80 * MS);
    strl__pace_add_latency(&pace, 5 * MS);
    assert_about(pace.latency_s, 0.005);
    strl__pace_add_latency(&pace, 500 * MS); /* queued behind other bytes */
    assert_true(pace.latency_s < 0.05);
    for (unsigned i = 0; i < 200; i++)
        strl__pace_add_latency(&pace, 80 * MS);
    assert_about(pace.latency_s, 0.08);
}

static void the_window_follows_bandwidth_and_latency(void **state)
{
    (void)state;
    const strl__pace slow = {.bytes_per_s = 625000, .latency_s = 0.08},
                     fast = {.bytes_per_s = 62.5e6, .latency_s = 0.08};
    assert_about((double)strl__pace_window(&slow), 625000 * 0.23);
    assert_about((double)strl__pace_window(&fast), 62.5e6 * 0.23);
    const strl__pace unknown = {0}, dead = {.bytes_per_s = 1}, absurd = {.bytes_per_s = 1e15, .latency_s = 10};
    assert_int_equal(strl__pace_window(&unknown), 256 << 10);
    assert_int_equal(strl__pace_window(&dead), 64 << 10);
    assert_int_equal(strl__pace_window(&absurd), 64 << 20);
}

static void there_is_room_for_what_comes_soon_and_more_where_the_cache_has_it(void **state)
{
    (void)state;
    strl__pace pace = {.bytes_per_s = 6250000, .latency_s = 0.02};
    uint64_t all = strl__pace_room(&pace, 0);
    assert_about((double)all, 6250000 * 0.32);
    assert_int_equal(strl__pace_room(&pace, all / 2), all - all / 2);
    assert_int_equal(strl__pace_room(&pace, all), 0);
    assert_int_equal(strl__pace_room(&pace, UINT64_MAX), 0);
    for (unsigned i = 0; i < 200; i++)
        strl__pace_add_lookup(&pace, true);
    assert_about((double)strl__pace_room(&pace, 0), 16 * (double)all);
    for (unsigned i = 0; i < 200; i++)
        strl__pace_add_lookup(&pace, false);
    assert_about((double)strl__pace_room(&pace, 0), (double)all);
}

static void gaps_are_worth_what_a_request_costs(void **state)
{
    (void)state;
    const strl__pace pace = {.bytes_per_s = 625000, .latency_s = 0.08}, unknown = {0};
    assert_about((double)strl__pace_gap(&pace, 5), 10000);
    assert_int_equal(strl__pace_gap(&unknown, 6), 4096);
    const strl__pace far = {.latency_s = 0.08}; /* the first bytes will tell what the link carries */
    assert_int_equal(strl__pace_gap(&far, 6), 48 << 10);
    const strl__pace wide = {.bytes_per_s = 1e12, .latency_s = 1};
    assert_int_equal(strl__pace_gap(&wide, 1), 256 << 10);
}

static void waits_double_and_differ(void **state)
{
    (void)state;
    for (unsigned failures = 1; failures <= 40; failures++) {
        uint64_t whole = 100 * MS << (failures - 1 < 4 ? failures - 1 : 4);
        for (uint64_t random = 0; random < 1000; random += 7) {
            uint64_t wait_ns = strl__backoff_ns(100 * MS, failures, random * 0x9e3779b97f4a7c15u);
            assert_true(wait_ns >= whole / 2 && wait_ns <= whole);
        }
    }
    assert_int_not_equal(strl__backoff_ns(100 * MS, 1, 1), strl__backoff_ns(100 * MS, 1, 2));
    assert_int_equal(strl__backoff_ns(0, 3, 5), 0);
}

static void check_span(strl__span found, uint64_t begin, uint64_t end)
{
    assert_int_equal(found.begin, begin);
    assert_int_equal(found.end, end);
}

static void a_request_grows_over_what_is_near_and_no_further(void **state)
{
    (void)state;
    const strl__span others[] = {{0, 100}, {200, 300}, {305, 400}, {1000, 1100}, {150, 250}, {400, 500}};
    const size_t count = sizeof others / sizeof *others;
    const strl__span seed = {200, 300};
    check_span(strl__span_grow(seed, others, count, 0, 1000), 150, 300); /* what it overlaps */
    check_span(strl__span_grow(seed, others, count, 5, 1000), 150, 500); /* over the gap, and on from there */
    check_span(strl__span_grow(seed, others, count, 50, 1000), 0, 500);
    check_span(strl__span_grow(seed, others, count, 1000, 10000), 0, 1100);
    check_span(strl__span_grow(seed, others, count, 5, 260), 150, 400); /* as much as may be */
    check_span(strl__span_grow(seed, others, count, 50, 10), 200, 300); /* the seed whatever its size */
    check_span(strl__span_grow(seed, others, 0, 50, 1000), 200, 300);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bandwidth_is_of_the_time_in_which_bytes_come),
        cmocka_unit_test(transfers_at_the_same_time_share_one_bandwidth),
        cmocka_unit_test(a_latency_that_falls_is_believed_at_once_and_one_that_grows_in_time),
        cmocka_unit_test(the_window_follows_bandwidth_and_latency),
        cmocka_unit_test(there_is_room_for_what_comes_soon_and_more_where_the_cache_has_it),
        cmocka_unit_test(gaps_are_worth_what_a_request_costs),
        cmocka_unit_test(waits_double_and_differ),
        cmocka_unit_test(a_request_grows_over_what_is_near_and_no_further),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
