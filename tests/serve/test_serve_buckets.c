/* Limits in time hold for made-up clocks, and text of strangers is escaped for where it goes. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <string.h>

#include "base/memory.h"
#include "serve/connections.h"
#include "serve/limits.h"
#include "serve/text.h"

#define SECOND UINT64_C(1000000000)

static strl_peer peer_of(uint32_t number)
{
    strl_peer peer = {.port = 1};
    memcpy(peer.address, &number, sizeof number);
    return peer;
}

static unsigned allowed(strl__rates *rates, const strl_peer *peer, unsigned asked, uint64_t now_ns)
{
    unsigned count = 0;
    for (unsigned i = 0; i < asked; i++)
        count += strl__rates_take(rates, peer, now_ns) == 0;
    return count;
}

static void an_address_has_its_rate_and_no_other_pays_for_it(void **state)
{
    (void)state;
    static strl__rates rates;
    strl__rates_init(&rates, 5);
    strl_peer one = peer_of(1), two = peer_of(2);
    assert_int_equal(allowed(&rates, &one, 100, SECOND), 10); /* two seconds' worth */
    assert_int_equal(allowed(&rates, &two, 3, SECOND), 3);
    assert_int_equal(strl__rates_take(&rates, &one, SECOND), 1);
    assert_int_equal(allowed(&rates, &one, 100, 2 * SECOND), 5);
    assert_int_equal(allowed(&rates, &one, 100, 1000 * SECOND), 10);
    assert_int_equal(allowed(&rates, &one, 100, 999 * SECOND), 0); /* a clock that goes back gives nothing */
    one.port = 7;                                                  /* another connection of the same address */
    assert_int_equal(allowed(&rates, &one, 100, 1000 * SECOND), 0);
    strl__rates_deinit(&rates);
}

static void a_slow_rate_says_how_long_to_wait(void **state)
{
    (void)state;
    static strl__rates rates;
    strl__rates_init(&rates, 0.1);
    strl_peer peer = peer_of(1);
    assert_int_equal(strl__rates_take(&rates, &peer, SECOND), 0);
    assert_int_equal(strl__rates_take(&rates, &peer, SECOND), 10);
    assert_int_equal(strl__rates_take(&rates, &peer, 6 * SECOND), 5);
    assert_int_equal(strl__rates_take(&rates, &peer, 11 * SECOND), 0);
    strl__rates_deinit(&rates);
    strl__rates_init(&rates, 0);
    assert_int_equal(allowed(&rates, &peer, 1000, SECOND), 1000);
    strl__rates_deinit(&rates);
}

static void work_is_paid_back_before_the_next_request(void **state)
{
    (void)state;
    static strl__rates rates;
    strl__rates_init(&rates, 5);
    strl_peer one = peer_of(1), two = peer_of(2);
    assert_int_equal(strl__rates_take(&rates, &one, SECOND), 0);
    strl__rates_charge(&rates, &one, 12, SECOND); /* 9 were left */
    assert_int_equal(strl__rates_take(&rates, &one, SECOND), 1);
    assert_int_equal(allowed(&rates, &one, 100, 2 * SECOND), 2);
    strl__rates_charge(&rates, &one, 1e9, 2 * SECOND); /* a debt has an end */
    assert_int_equal(strl__rates_take(&rates, &one, 2 * SECOND), 3);
    assert_int_equal(allowed(&rates, &two, 100, 2 * SECOND), 10);
    strl__rates_deinit(&rates);
}

static void many_addresses_take_no_more_room(void **state)
{
    (void)state;
    static strl__rates rates;
    strl__rates_init(&rates, 1);
    for (uint32_t i = 0; i < 100000; i++) {
        strl_peer peer = peer_of(i);
        assert_int_equal(strl__rates_take(&rates, &peer, SECOND + i), 0);
    }
    strl__rates_deinit(&rates);
}

static void addresses_of_one_network_of_ipv6_are_one(void **state)
{
    (void)state;
    static strl__rates rates;
    strl__rates_init(&rates, 1);
    strl_peer one = {.is_v6 = true, .address = {0x20, 1, 2, 3, 4, 5, 6, 7, 1}}, two = one, other = one;
    two.address[15] = 9;
    other.address[7] = 9;
    assert_int_equal(allowed(&rates, &one, 10, SECOND), 2);
    assert_int_equal(allowed(&rates, &two, 10, SECOND), 0);
    assert_int_equal(allowed(&rates, &other, 10, SECOND), 2);
    strl__rates_deinit(&rates);
}

static void bytes_flow_at_their_rate(void **state)
{
    (void)state;
    strl__flow flow;
    strl__flow_init(&flow, 1000000);
    uint64_t sent = 0;
    for (uint64_t now_ns = SECOND; now_ns < 11 * SECOND; now_ns += SECOND / 100)
        for (size_t got; (got = strl__flow_take(&flow, 65536, now_ns)) > 0;)
            sent += got;
    assert_in_range(sent, 9900000, 10300000); /* a quarter of a second's worth was saved up at first */
    strl__flow_deinit(&flow);
    strl__flow_init(&flow, 0);
    assert_int_equal(strl__flow_take(&flow, 65536, SECOND), 65536);
    strl__flow_deinit(&flow);
}

static void connections_beyond_a_limit_are_known(void **state)
{
    (void)state;
    strl__connections all;
    int handles[8];
    assert_true(strl__connections_init(&all, 3, 2, 5));
    strl__connection *made[6];
    static const uint8_t none[128];
    for (int i = 0; i < 6; i++)
        made[i] = strl__connections_add(&all, &handles[i], -1, none);
    assert_int_equal(made[0]->surplus, STRL__SURPLUS_NONE);
    assert_int_equal(made[1]->surplus, STRL__SURPLUS_NONE);
    assert_int_equal(made[2]->surplus, STRL__SURPLUS_ADDRESS);
    assert_int_equal(made[4]->surplus, STRL__SURPLUS_ADDRESS);
    assert_null(made[5]);
    assert_int_equal(strl__connections_count(&all), 5);
    strl__connections_remove(&all, made[0]);
    made[0] = strl__connections_add(&all, &handles[0], -1, none);
    assert_int_equal(made[0]->surplus, STRL__SURPLUS_NONE);
    uint32_t idle;
    atomic_store(&made[3]->is_between, true);
    assert_int_equal(strl__connections_end_idle(&all, UINT64_C(3600) * SECOND, &idle), 0);
    assert_int_equal(strl__connections_end_idle(&all, 0, &idle), 5);
    assert_int_equal(idle, 1);
    assert_int_equal(strl__connections_end_idle(&all, 0, &idle), 0); /* each once */
    assert_int_equal(idle, 0);
    strl__connections_deinit(&all);
}

static unsigned resumed;

static void count_resumed(void *handle)
{
    (void)handle;
    resumed++;
}

static void what_is_paused_is_resumed_once(void **state)
{
    (void)state;
    strl__connections all;
    int handle;
    assert_true(strl__connections_init(&all, 3, 3, 3));
    strl__connection *made = strl__connections_add(&all, &handle, -1, NULL);
    assert_true(strl__connections_pause(&all, made));
    uint32_t idle;
    assert_int_equal(strl__connections_end_idle(&all, 0, &idle), 0); /* it waits for us, not we for it */
    strl__connections_resume(&all, false, count_resumed);
    strl__connections_resume(&all, false, count_resumed);
    assert_int_equal(resumed, 1);
    assert_true(strl__connections_pause(&all, made));
    strl__connections_resume(&all, true, count_resumed);
    assert_int_equal(resumed, 2);
    assert_false(strl__connections_pause(&all, made)); /* the server closes */
    strl__connections_deinit(&all);
}

static void assert_put(void (*put)(strl_writer *, const char *), const char *text, const char *expected)
{
    strl_writer out = {0};
    put(&out, text);
    strl_writer_u8(&out, 0);
    assert_false(out.failed);
    assert_string_equal((const char *)out.data, expected);
    strl__free(out.data);
}

static void text_is_escaped_for_where_it_goes(void **state)
{
    (void)state;
    assert_put(strl__put_html, "<a href='x'>\"&", "&lt;a href=&#39;x&#39;&gt;&quot;&amp;");
    assert_put(strl__put_json, "a\"b\\c\n\x7f\xc3\xa4", "\"a\\\"b\\\\c\\u000a\\u007f\xc3\xa4\"");
    assert_put(strl__put_url, "a b/<\xc3\xa4>?#%.stroll", "a%20b/%3c%c3%a4%3e%3f%23%25.stroll");
    assert_put(strl__put_log, "GET\r\nX \"\\\x1b\xff", "GET\\x0d\\x0aX\\x20\\x22\\x5c\\x1b\\xff");
    assert_put(strl__put_log, "", "-");
    char line[16];
    strl__log_text("ab\ncd\x1b"
                   "efghijk",
                   line, sizeof line);
    assert_string_equal(line, "ab\\x0acd\\x1b"); /* cut, but not within an escape */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_address_has_its_rate_and_no_other_pays_for_it),
        cmocka_unit_test(a_slow_rate_says_how_long_to_wait),
        cmocka_unit_test(work_is_paid_back_before_the_next_request),
        cmocka_unit_test(many_addresses_take_no_more_room),
        cmocka_unit_test(addresses_of_one_network_of_ipv6_are_one),
        cmocka_unit_test(bytes_flow_at_their_rate),
        cmocka_unit_test(connections_beyond_a_limit_are_known),
        cmocka_unit_test(what_is_paused_is_resumed_once),
        cmocka_unit_test(text_is_escaped_for_where_it_goes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
