/* A file behind an address whose server is wrong: faults that pass, those that stay, and a model that is another one
 * under way. Times are as short as they can be, and nothing depends on how fast the machine is. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "base/memory.h"
#include "platform/thread.h"
#include "source/http_checks.h"
#include "support/folder.h"

/* ---- faults that pass */

static void faults_that_pass_are_tried_again_and_leave_no_trace(void **state)
{
    (void)state;
    static const fault_rule faults[] = {
        {.status = 500},
        {.status = 503, .field = "Retry-After: 0"},
        {.status = 429},
        {.cut = true, .after = 0},
        {.cut = true, .after = 1},
        {.cut = true, .after = 40000},
        {.stall = true, .after = 100},
        {.stall = true, .after = 0},
        {.shift = 1},
        {.longer = 10},
        {.no_range_field = true},
    };
    for (size_t i = 0; i < sizeof faults / sizeof *faults; i++) {
        fault_server *server = fault_server_create(&good, by_number, LISTED(well, faults[i], faults[i], well));
        strl_source *source = must_open(fault_server_url(server, "/model"), &quick);
        check_read(source, 100000, 100000);
        strl_network_stats stats = stats_of(source);
        assert_true(stats.retries > 0 || faults[i].longer); /* what was asked for may have come before what was not */
        assert_int_equal(stats.failures, 0);
        strl_source_close(source);
        fault_server_destroy(server);
    }
}

static void an_answer_cut_short_is_continued_not_begun_anew(void **state)
{
    (void)state;
    const fault_rule cut = {.cut = true, .after = 30000};
    fault_asked asked[3];
    fault_server *server = fault_server_create(&good, by_number, LISTED(well, cut, well));
    strl_source *source = must_open(fault_server_url(server, "/model"), &quick);
    check_read(source, 100000, 100000);
    assert_int_equal(fault_server_asked(server, asked, 3), 3);
    assert_int_equal(asked[2].first, 130000);
    assert_int_equal(asked[2].last, 199999);
    strl_source_close(source);
    fault_server_destroy(server);
}

static void attempts_are_bounded_and_their_failure_says_why(void **state)
{
    (void)state;
    static const struct {
        fault_rule rule;
        const char *words;
        unsigned requests;
    } cases[] = {
        {{.status = 500}, "the server failed (500)", 4},
        {{.status = 404}, "there is nothing at this address (404)", 1},
        {{.status = 403}, "refuses access (403)", 1},
        {{.status = 503, .field = "Retry-After: 3600"}, "to be left alone for 3600 seconds (503)", 1},
        {{.cut = true, .after = 0}, "the answer ended after 0 of 100000 bytes", 4},
        {{.stall = true, .after = 0}, "the server stalled: 0 bytes came in 300 ms", 4},
        {{.shift = -5}, "the answer is bytes 99995 to 199994, expected 100000 to 199999", 4},
        {{.no_range_field = true}, "does not say which range", 4},
        {{.whole = true}, "the server does not answer byte ranges here", 1},
        {{.field = "Content-Encoding: gzip"}, "encoded as gzip", 1},
        {{.endless_header = true}, "the header of the answer is longer than", 1},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        fault_server *server = fault_server_create(&good, by_number, LISTED(well, cases[i].rule));
        strl_source *source = must_open(fault_server_url(server, "/model"), &quick);
        check_read_fails(source, 100000, 100000, cases[i].words);
        check_read_fails(source, 100000, 100000, fault_server_url(server, "/model"));
        assert_int_equal(fault_server_asked(server, NULL, 0), 1 + 2 * cases[i].requests);
        assert_int_equal(stats_of(source).failures, 2);
        strl_source_close(source);
        fault_server_destroy(server);
    }
}

/* Counted from when somebody looked, it took up to two times as long. */
static void a_stall_is_counted_from_the_last_bytes_that_came(void **state)
{
    (void)state;
    const fault_rule stalls = {.stall = true, .after = 50000};
    const strl_http_desc desc = {.stall_ms = 3000, .attempts = 1};
    fault_server *server = fault_server_create(&good, by_number, LISTED(well, stalls));
    strl_source *source = must_open(fault_server_url(server, "/model"), &desc);
    uint64_t begin_ns = strl_clock_ns();
    check_read_fails(source, 100000, 100000, "the server stalled");
    uint64_t took_ns = strl_clock_ns() - begin_ns;
    assert_true(took_ns >= 3000 * MS && took_ns < 5500 * MS);
    strl_source_close(source);
    fault_server_destroy(server);
}

/* Stalls as long as it is told to. */
typedef struct stalling {
    atomic_bool now;
    uint64_t slow_from; /* answers of ranges from here on come after SLOW_MS */
} stalling;

#define SLOW_MS 3000u

static fault_rule while_stalling(void *context, unsigned number, const fault_asked *asked)
{
    const stalling *self = context;
    (void)number;
    if (self->slow_from && asked->first >= self->slow_from)
        return (fault_rule){.delay_ms = SLOW_MS};
    return (fault_rule){.stall = atomic_load(&self->now), .after = 0};
}

/* All connections are lost. Without a look at the server each of them would be waited for, a minute long. */
static void once_a_stalled_server_answers_all_is_asked_for_again(void **state)
{
    (void)state;
    enum { READS = 12, CONNECTIONS = 6 };
    const strl_http_desc desc = {.connections = CONNECTIONS, .stall_ms = 60000, .attempts = 2, .backoff_ms = 100};
    stalling stalls = {.now = false};
    fault_server *server = fault_server_create(&good, while_stalling, &stalls);
    strl_source *source = must_open(fault_server_url(server, "/model"), &desc);
    atomic_store(&stalls.now, true);
    for (uint64_t i = 0; i < READS; i++)
        submit(source, i, 50000 + 80000 * i, 20000, 0);
    strl_sleep_ns(4500 * MS);
    unsigned asked = fault_server_asked(server, NULL, 0);
    assert_true(asked > 1 + CONNECTIONS && asked <= 1 + CONNECTIONS + 4); /* it is looked at once a second */
    atomic_store(&stalls.now, false);
    uint64_t begin_ns = strl_clock_ns();
    for (unsigned n = 0; n < READS; n++) {
        strl_source_result result = next_answer(source);
        if (result.status != STRL_OK)
            fail_msg("%s", result.error.message);
        assert_memory_equal(result.data, content + 50000 + 80000 * result.token, 20000);
        strl__free(result.data);
    }
    assert_true(strl_clock_ns() - begin_ns < 20000 * MS); /* some 1.3 s, of the 60 without it */
    assert_int_equal(stats_of(source).failures, 0);
    strl_source_close(source);
    fault_server_destroy(server);
}

/* Others are answered before it: at its last attempt it has all the time. */
static void a_server_that_is_slow_with_some_bytes_gives_them_in_the_end(void **state)
{
    (void)state;
    const strl_http_desc desc = {.connections = 2, .stall_ms = 60000, .attempts = 2, .backoff_ms = 1};
    stalling slow = {.slow_from = 900000};
    fault_server *server = fault_server_create(&good, while_stalling, &slow);
    strl_source *source = must_open(fault_server_url(server, "/model"), &desc);
    submit(source, 0, 900000, 1000, 1);
    wait_until_asked(server, 2);
    submit(source, 1, 100000, 1000, 0);
    for (unsigned n = 0; n < 2; n++) {
        strl_source_result result = next_answer(source);
        assert_int_equal(result.token, 1 - n);
        assert_int_equal(result.status, STRL_OK);
        strl__free(result.data);
    }
    assert_int_equal(stats_of(source).retries, 1);
    strl_source_close(source);
    fault_server_destroy(server);
}

static void a_server_that_says_when_is_not_asked_before(void **state)
{
    (void)state;
    const fault_rule busy = {.status = 503, .field = "Retry-After: 1"};
    fault_server *server = fault_server_create(&good, by_number, LISTED(well, busy, well));
    strl_source *source = must_open(fault_server_url(server, "/model"), &quick);
    uint64_t begin_ns = strl_clock_ns();
    check_read(source, 100000, 1000);
    assert_true(strl_clock_ns() - begin_ns >= 1000 * MS);
    strl_source_close(source);
    fault_server_destroy(server);
}

static void a_server_that_was_killed_and_comes_back_is_read_on(void **state)
{
    (void)state;
    fault_server *server = fault_server_create(&good, NULL, NULL);
    strl_source *source = must_open(fault_server_url(server, "/model"), &quick);
    check_read(source, 100000, 50000);
    fault_server_kill(server);
    check_read_fails(source, 200000, 50000, "the server cannot be reached");
    for (uint64_t i = 0; i < 20; i++) /* an outage is an attempt of all that wait */
        submit(source, i, 30000 * i, 9000, 0);
    for (uint64_t i = 0; i < 20; i++) {
        strl_source_result result = next_answer(source);
        assert_int_equal(result.status, STRL_ERR_NETWORK);
        assert_null(result.data);
    }
    fault_server_restart(server);
    check_read(source, 200000, 50000);
    check_read(source, 400000, 50000);
    strl_source_close(source);
    fault_server_destroy(server);
}

static void reads_wait_for_a_server_that_restarts_soon(void **state)
{
    (void)state;
    const strl_http_desc patient = {.attempts = 12, .backoff_ms = 50};
    fault_server *server = fault_server_create(&good, NULL, NULL);
    strl_source *source = must_open(fault_server_url(server, "/model"), &patient);
    fault_server_kill(server);
    for (uint64_t i = 0; i < 10; i++)
        submit(source, i, 100000 * i, 20000, 0);
    strl_sleep_ns(100 * MS);
    fault_server_restart(server);
    for (unsigned n = 0; n < 10; n++) {
        strl_source_result result = next_answer(source);
        assert_int_equal(result.status, STRL_OK);
        assert_memory_equal(result.data, content + 100000 * result.token, 20000);
        strl__free(result.data);
    }
    strl_source_close(source);
    fault_server_destroy(server);
}

/* All requests under way fail at once, and are one attempt. */
static void an_outage_is_one_attempt_however_many_requests_it_ends(void **state)
{
    (void)state;
    enum { READS = 12, UNDER_WAY = 6 };
    const strl_http_desc desc = {.connections = UNDER_WAY, .backoff_ms = 500, .stall_ms = 60000};
    const fault_rule silent = {.delay_ms = 60000}; /* nothing comes, so that nobody was reached */
    fault_server *server =
        fault_server_create(&good, by_number, LISTED(well, silent, silent, silent, silent, silent, silent, well));
    strl_source *source = must_open(fault_server_url(server, "/model"), &desc);
    for (uint64_t i = 0; i < READS; i++)
        submit(source, i, 50000 + 80000 * i, 20000, 0);
    wait_until_asked(server, 1 + UNDER_WAY);
    fault_server_kill(server);
    strl_sleep_ns(200 * MS);
    fault_server_restart(server);
    for (unsigned n = 0; n < READS; n++) {
        strl_source_result result = next_answer(source);
        if (result.status != STRL_OK)
            fail_msg("%s", result.error.message);
        assert_memory_equal(result.data, content + 50000 + 80000 * result.token, 20000);
        strl__free(result.data);
    }
    assert_int_equal(stats_of(source).failures, 0);
    strl_source_close(source);
    fault_server_destroy(server);
}

/* No read has failed yet, and none is sent. */
static void a_server_that_is_asked_too_much_is_asked_nothing_else(void **state)
{
    (void)state;
    static const fault_rule busy[] = {{.status = 429}, {.status = 503}};
    const strl_http_desc desc = {.backoff_ms = 400};
    for (unsigned i = 0; i < 2; i++) {
        fault_server *server = fault_server_create(&good, by_number, LISTED(well, busy[i], well));
        strl_source *source = must_open(fault_server_url(server, "/model"), &desc);
        uint64_t begin_ns = strl_clock_ns();
        submit(source, 1, 100000, 1000, 0);
        while (stats_of(source).retries == 0)
            strl_sleep_ns(MS);
        submit(source, 2, 500000, 1000, 0); /* another one, whose first attempt this is */
        for (unsigned n = 0; n < 2; n++) {
            strl_source_result result = next_answer(source);
            assert_int_equal(result.status, STRL_OK);
            assert_true(strl_clock_ns() - begin_ns >= 200 * MS);
            strl__free(result.data);
        }
        strl_source_close(source);
        fault_server_destroy(server);
    }
}

/* ---- another model */

static void check_changed(fault_server *server, strl_source *source)
{
    unsigned before = fault_server_asked(server, NULL, 0);
    uint8_t byte;
    strl_error err = {0};
    assert_int_equal(strl_source_read(source, 10, &byte, 1, &err), STRL_ERR_NETWORK); /* known bytes, too */
    assert_non_null(strstr(err.message, "the model has changed since it was opened: open it again"));
    for (uint64_t i = 0; i < 5; i++)
        submit(source, i, 500000 + i, 100, 0);
    for (unsigned n = 0; n < 5; n++) {
        strl_source_result result = next_answer(source);
        assert_int_equal(result.status, STRL_ERR_NETWORK);
        assert_non_null(strstr(result.error.message, "has changed"));
        assert_non_null(strstr(result.error.message, fault_server_url(server, "/model")));
    }
    assert_int_equal(fault_server_asked(server, NULL, 0), before); /* nobody asks for it any more */
}

static void a_model_that_is_swapped_under_way_is_recognised(void **state)
{
    (void)state;
    static const struct {
        fault_content before, after;
    } cases[] = {
        {{content, BYTES, "\"one\"", NULL, false}, {other_content, BYTES, "\"two\"", NULL, false}},
        {{content, BYTES, "\"one\"", NULL, true}, {other_content, BYTES, "\"two\"", NULL, true}},
        {{content, BYTES, NULL, "then", false}, {other_content, BYTES, NULL, "now", false}},
        {{content, BYTES, NULL, "then", true}, {other_content, BYTES, NULL, "now", true}},
        {{content, BYTES, NULL, NULL, false}, {other_content, BYTES - 1, NULL, NULL, false}},
        {{content, BYTES, NULL, NULL, false}, {other_content, 1000, NULL, NULL, false}},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        fault_server *server = fault_server_create(&cases[i].before, NULL, NULL);
        strl_source *source = must_open(fault_server_url(server, "/model"), &quick);
        check_read(source, 100000, 100000);
        fault_server_set_content(server, &cases[i].after);
        check_read_fails(source, 300000, 100000, "has changed since it was opened");
        check_changed(server, source);
        strl_source_close(source);
        fault_server_destroy(server);
    }
}

static void an_attempt_at_opening_has_nothing_of_the_one_before(void **state)
{
    (void)state;
    const fault_rule other = {.wrong_bytes = true, .cut = true, .after = 1000};
    fault_server *server = fault_server_create(&good, by_number, LISTED(other, well));
    strl_source *source = must_open(fault_server_url(server, "/model"), &quick);
    check_read(source, 0, HEAD);
    strl_source_close(source);
    fault_server_destroy(server);
}

static void more_than_an_answer_says_is_an_attempt_that_failed(void **state)
{
    (void)state;
    const fault_rule late = {.late_excess = true};
    fault_server *server = fault_server_create(&good, by_number, LISTED(well, late, late, well, late));
    strl_source *source = must_open(fault_server_url(server, "/model"), &quick);
    check_read(source, 100000, 60000);
    assert_int_equal(stats_of(source).retries, 2);
    assert_int_equal(fault_server_asked(server, NULL, 0), 4);
    check_read_fails(source, 400000, 60000, "the server sends more than it says, or what is no answer");
    assert_int_equal(fault_server_asked(server, NULL, 0), 4 + quick.attempts);
    strl_source_close(source);
    fault_server_destroy(server);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(faults_that_pass_are_tried_again_and_leave_no_trace),
        cmocka_unit_test(an_answer_cut_short_is_continued_not_begun_anew),
        cmocka_unit_test(attempts_are_bounded_and_their_failure_says_why),
        cmocka_unit_test(a_stall_is_counted_from_the_last_bytes_that_came),
        cmocka_unit_test(once_a_stalled_server_answers_all_is_asked_for_again),
        cmocka_unit_test(a_server_that_is_slow_with_some_bytes_gives_them_in_the_end),
        cmocka_unit_test(a_server_that_says_when_is_not_asked_before),
        cmocka_unit_test(a_server_that_was_killed_and_comes_back_is_read_on),
        cmocka_unit_test(reads_wait_for_a_server_that_restarts_soon),
        cmocka_unit_test(an_outage_is_one_attempt_however_many_requests_it_ends),
        cmocka_unit_test(a_server_that_is_asked_too_much_is_asked_nothing_else),
        cmocka_unit_test(a_model_that_is_swapped_under_way_is_recognised),
        cmocka_unit_test(an_attempt_at_opening_has_nothing_of_the_one_before),
        cmocka_unit_test(more_than_an_answer_says_is_an_attempt_that_failed),
    };
    return cmocka_run_group_tests(tests, set_up, strl_test_folder_remove);
}
