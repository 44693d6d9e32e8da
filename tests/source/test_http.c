/* A file behind an address: reads merged and ordered, retried, cancelled, cached; and every way in which a server
 * may be wrong. Times are as short as they can be, and nothing depends on how fast the machine is. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include "base/hash.h"
#include "base/memory.h"
#include "platform/file.h"
#include "platform/shelf.h"
#include "platform/thread.h"
#include "source/source.h"
#include "support/fault_server.h"
#include "support/folder.h"

#define BYTES ((size_t)1 << 20)
#define MS ((uint64_t)1000000)
#define HEAD 4096u

static uint8_t content[BYTES], other_content[BYTES];
static const fault_content good = {.data = content, .size = BYTES, .etag = "\"one\""};

static int set_up(void **state)
{
    for (size_t i = 0; i < BYTES; i++) {
        content[i] = (uint8_t)strl__mix64(i + 1);
        other_content[i] = (uint8_t)strl__mix64(i + 12345);
    }
    return strl_test_folder_make(state);
}

/* ---- what the tests share */

static const strl_http_desc quick = {.backoff_ms = 1, .stall_ms = 300, .attempts = 4};

static strl_source *must_open(const char *url, const strl_http_desc *desc)
{
    strl_source *source = NULL;
    strl_error err = {0};
    if (strl_source_open_http(url, desc, &source, &err) != STRL_OK)
        fail_msg("%s", err.message);
    return source;
}

static strl_source *must_open_memory(void)
{
    strl_source *source = NULL;
    assert_int_equal(strl_source_open_memory(content, BYTES, &source, NULL), STRL_OK);
    return source;
}

static void must_not_open(const char *url, strl_status status, const char *words)
{
    strl_source *source = NULL;
    strl_error err = {0};
    assert_int_equal(strl_source_open_http(url, &quick, &source, &err), status);
    assert_null(source);
    if (!strstr(err.message, words))
        fail_msg("\"%s\" lacks \"%s\"", err.message, words);
}

static strl_source_result next_answer(strl_source *source)
{
    strl_source_result result;
    uint64_t give_up_ns = strl_clock_ns() + 60000 * MS;
    while (!strl_source_poll(source, &result)) {
        assert_true(strl_clock_ns() < give_up_ns);
        strl_sleep_ns(MS / 10);
    }
    return result;
}

static void submit(strl_source *source, uint64_t token, uint64_t offset, size_t size, float urgency)
{
    assert_int_equal(strl_source_submit(source, token, offset, size, urgency, NULL), STRL_OK);
}

static void check_read(strl_source *source, uint64_t offset, size_t size)
{
    static uint8_t data[BYTES];
    strl_error err = {0};
    if (strl_source_read(source, offset, data, size, &err) != STRL_OK)
        fail_msg("%s", err.message);
    assert_memory_equal(data, content + offset, size);
}

static void check_read_fails(strl_source *source, uint64_t offset, size_t size, const char *words)
{
    static uint8_t data[BYTES];
    strl_error err = {0};
    assert_int_equal(strl_source_read(source, offset, data, size, &err), STRL_ERR_NETWORK);
    if (!strstr(err.message, words))
        fail_msg("\"%s\" lacks \"%s\"", err.message, words);
}

static strl_network_stats stats_of(const strl_source *source)
{
    strl_network_stats stats;
    assert_true(strl_source_get_network_stats(source, &stats));
    return stats;
}

static void wait_until_asked(fault_server *server, unsigned requests)
{
    uint64_t give_up_ns = strl_clock_ns() + 60000 * MS;
    while (fault_server_asked(server, NULL, 0) < requests) {
        assert_true(strl_clock_ns() < give_up_ns);
        strl_sleep_ns(MS / 10);
    }
}

/* Rules by the number of the request; the last is that of all further ones. */
typedef struct listed_rules {
    const fault_rule *rules;
    unsigned count;
} listed_rules;

static fault_rule by_number(void *context, unsigned number, const fault_asked *asked)
{
    const listed_rules *list = context;
    (void)asked;
    return list->rules[number < list->count ? number : list->count - 1];
}

#define LISTED(...)                                                                                                    \
    &(listed_rules)                                                                                                    \
    {                                                                                                                  \
        (const fault_rule[]){__VA_ARGS__}, sizeof((fault_rule[]){__VA_ARGS__}) / sizeof(fault_rule)                    \
    }

static const fault_rule well = {0};

/* ---- reading */

static void every_read_is_answered_once_with_its_bytes(void **state)
{
    (void)state;
    fault_server *server = fault_server_create(&good, NULL, NULL);
    strl_source *source = must_open(fault_server_url(server, "/model"), &quick);
    uint8_t answered[300] = {0};
    assert_int_equal(source->bytes, BYTES);
    for (uint64_t i = 0; i < 300; i++)
        submit(source, i, strl__mix64(i) % (BYTES - 9000), (size_t)(i % 9 == 0 ? 0 : strl__mix64(i + 7) % 9000),
               (float)(i % 13));
    for (unsigned n = 0; n < 300; n++) {
        strl_source_result result = next_answer(source);
        uint64_t i = result.token;
        assert_true(i < 300 && answered[i]++ == 0);
        assert_int_equal(result.status, STRL_OK);
        assert_int_equal(result.size, i % 9 == 0 ? 0 : strl__mix64(i + 7) % 9000);
        assert_non_null(result.data);
        assert_memory_equal(result.data, content + strl__mix64(i) % (BYTES - 9000), result.size);
        strl__free(result.data);
    }
    strl_source_result none;
    assert_false(strl_source_poll(source, &none));
    strl_source_close(source);
    fault_server_destroy(server);
}

static void a_waiting_read_gives_its_bytes_and_brings_what_is_near(void **state)
{
    (void)state;
    fault_server *server = fault_server_create(&good, NULL, NULL);
    strl_source *source = must_open(fault_server_url(server, "/model"), &quick);
    check_read(source, 0, HEAD); /* is here since opening */
    check_read(source, 17, 100);
    check_read(source, 500, 0);
    assert_int_equal(fault_server_asked(server, NULL, 0), 1);
    check_read(source, BYTES - 100, 100); /* the end of the file, and what lies before it */
    check_read(source, BYTES - 20000, 15000);
    submit(source, 5, BYTES - 4000, 77, 1);
    strl_source_result result = next_answer(source);
    assert_memory_equal(result.data, content + BYTES - 4000, 77);
    strl__free(result.data);
    assert_int_equal(fault_server_asked(server, NULL, 0), 2);
    check_read(source, 5000, 300000);
    check_read(source, 305000, 100000); /* one after the other: ever more at a time */
    for (uint64_t at = 405000; at < 1000000; at += 5000)
        check_read(source, at, 5000);
    assert_true(fault_server_asked(server, NULL, 0) < 12);
    strl_source_close(source);
    fault_server_destroy(server);
}

/* As tools read a model of many trees, whose order is not that of the file. */
static void a_waiting_read_that_comes_back_finds_what_was_near(void **state)
{
    (void)state;
    enum { PLACES = 5, STEPS = 60, APART = 200000, STEP = 1700 };
    fault_server *server = fault_server_create(&good, NULL, NULL);
    strl_source *source = must_open(fault_server_url(server, "/model"), &quick);
    for (uint64_t i = 0; i < STEPS; i++)
        for (uint64_t place = 0; place < PLACES; place++) /* the last ones lie across what two requests brought */
            check_read(source, place * APART + i * STEP, STEP + 300);
    assert_true(fault_server_asked(server, NULL, 0) <= 1 + 3 * PLACES);
    strl_source_doubt(source, APART + 5 * STEP, 10);
    unsigned before = fault_server_asked(server, NULL, 0);
    check_read(source, 2 * APART + 5 * STEP, 10);
    assert_int_equal(fault_server_asked(server, NULL, 0), before);
    check_read(source, APART + 5 * STEP, 10);
    assert_int_equal(fault_server_asked(server, NULL, 0), before + 1); /* what is doubted comes anew */
    strl_source_close(source);
    fault_server_destroy(server);
}

enum { MANY = 60, MANY_BYTES = 3000, FAR = 17000, NEAR = 5000 }; /* so near that on any link one request brings several */

static strl_source_span known_span(uint64_t offset, size_t size, void *data)
{
    return (strl_source_span){offset, size, data, strl__checksum(content + offset, size)};
}

static void many_spans(strl_source_span *spans, uint8_t *data, size_t apart)
{
    for (size_t i = 0; i < MANY; i++)
        spans[i] = known_span(i * 7 % MANY * apart, i == 9 ? 0 : MANY_BYTES, data + i * MANY_BYTES);
}

static void reads_together_give_what_each_would_alone(void **state)
{
    (void)state;
    static uint8_t data[MANY * MANY_BYTES];
    strl_source_span spans[MANY];
    strl_error err = {0};
    fault_asked asked[MANY];
    const fault_rule cut = {.cut = true, .after = 1000};
    fault_server *server = fault_server_create(&good, by_number, LISTED(well, well, cut, well));
    strl_source *source = must_open(fault_server_url(server, "/model"), &quick);
    many_spans(spans, data, NEAR);
    assert_int_equal(strl_source_read_many(source, spans, MANY, &err), STRL_OK);
    for (size_t i = 0; i < MANY; i++)
        assert_memory_equal(data + i * MANY_BYTES, content + spans[i].offset, spans[i].size);
    unsigned requests = fault_server_asked(server, asked, MANY);
    /* Six or more in each, as long as nothing lies between two that are on their way: 21 at most; the head, and what was cut off. */
    assert_true(requests <= MANY / 2);
    spans[20].offset = BYTES - 10;
    assert_int_equal(strl_source_read_many(source, spans, MANY, &err), STRL_ERR_FORMAT);
    assert_int_equal(fault_server_asked(server, NULL, 0), requests);
    assert_int_equal(strl_source_read_many(source, spans, 0, &err), STRL_OK);
    strl_source_close(source);
    fault_server_destroy(server);
}

/* Every other answer is wrong. */
static fault_rule wrong_at_times(void *context, unsigned number, const fault_asked *asked)
{
    (void)context, (void)asked;
    return (fault_rule){.wrong_bytes = number % 2 == 1};
}

static void bytes_that_come_wrong_are_asked_for_again(void **state)
{
    (void)state;
    static uint8_t data[MANY * MANY_BYTES];
    strl_source_span spans[MANY];
    strl_error err = {0};
    fault_server *server = fault_server_create(&good, wrong_at_times, NULL);
    strl_source *source = must_open(fault_server_url(server, "/model"), &quick);
    strl_source_span one = known_span(500000, MANY_BYTES, data);
    assert_int_equal(strl_source_read_known(source, &one, &err), STRL_OK);
    assert_memory_equal(data, content + 500000, MANY_BYTES);
    assert_int_equal(fault_server_asked(server, NULL, 0), 3);
    many_spans(spans, data, FAR);
    assert_int_equal(strl_source_read_many(source, spans, MANY, &err), STRL_OK);
    for (size_t i = 0; i < MANY; i++)
        assert_memory_equal(data + i * MANY_BYTES, content + spans[i].offset, spans[i].size);
    strl_source_close(source);
    fault_server_destroy(server);
}

static void bytes_that_are_always_wrong_are_asked_for_some_times(void **state)
{
    (void)state;
    uint8_t data[100];
    strl_source *source = must_open_memory();
    strl_source_span span = known_span(500000, sizeof data, data);
    span.checksum++;
    assert_int_equal(strl_source_read_known(source, &span, NULL), STRL_OK); /* nobody is asked twice for what is in memory */
    strl_source_close(source);
    const fault_rule wrong = {.wrong_bytes = true};
    fault_server *server = fault_server_create(&good, by_number, LISTED(well, wrong));
    source = must_open(fault_server_url(server, "/model"), &quick);
    assert_int_equal(strl_source_read_known(source, &span, NULL), STRL_OK);
    assert_memory_not_equal(data, content + 500000, sizeof data); /* who has asked looks himself */
    assert_int_equal(fault_server_asked(server, NULL, 0), 1 + 8);
    strl_source_doubt(source, span.offset, span.size);
    assert_int_equal(strl_source_read_many(source, &span, 1, NULL), STRL_OK);
    assert_int_equal(fault_server_asked(server, NULL, 0), 1 + 8 + 8);
    strl_source_close(source);
    fault_server_destroy(server);
}

static fault_rule refuse_the_end(void *context, unsigned number, const fault_asked *asked)
{
    (void)context, (void)number;
    return (fault_rule){.status = asked->last >= BYTES / 2 ? 403 : 0};
}

static void of_reads_together_the_first_that_failed_is_told(void **state)
{
    (void)state;
    static uint8_t data[MANY * MANY_BYTES];
    strl_source_span spans[MANY];
    strl_error err = {0};
    fault_server *server = fault_server_create(&good, refuse_the_end, NULL);
    strl_source *source = must_open(fault_server_url(server, "/model"), &quick);
    many_spans(spans, data, FAR);
    assert_int_equal(strl_source_read_many(source, spans, MANY, &err), STRL_ERR_NETWORK);
    assert_non_null(strstr(err.message, "refuses access (403)"));
    assert_int_equal(strl_source_read_many(source, spans, 4, &err), STRL_OK); /* of the first half of the file */
    assert_memory_equal(data + MANY_BYTES, content + spans[1].offset, MANY_BYTES);
    strl_source_close(source);
    fault_server_destroy(server);
}

static void read_many_of(void *context)
{
    static uint8_t data[MANY * MANY_BYTES];
    strl_source_span spans[MANY];
    many_spans(spans, data, FAR);
    assert_int_equal(strl_source_read_many(context, spans, MANY, NULL), STRL_ERR_NETWORK);
}

/* No request is answered, and yet there is one on each connection. */
static void reads_together_are_asked_for_together(void **state)
{
    (void)state;
    enum { CONNECTIONS = 5 };
    const fault_rule silent = {.delay_ms = 120000};
    const strl_http_desc desc = {.connections = CONNECTIONS, .backoff_ms = 1, .stall_ms = 60000};
    fault_server *server = fault_server_create(&good, by_number, LISTED(well, silent));
    strl_source *source = must_open(fault_server_url(server, "/model"), &desc);
    strl_thread *reader;
    assert_int_equal(strl_thread_start(&reader, read_many_of, source, NULL), STRL_OK);
    wait_until_asked(server, 1 + CONNECTIONS);
    fault_server_kill(server);
    strl_thread_join(reader);
    strl_source_close(source);
    fault_server_destroy(server);
}

static void ranges_outside_are_not_accepted_and_small_files_open(void **state)
{
    (void)state;
    const fault_content small = {.data = content, .size = 100};
    fault_server *server = fault_server_create(&small, NULL, NULL);
    strl_source *source = must_open(fault_server_url(server, "/model"), &quick);
    uint8_t data[8];
    assert_int_equal(source->bytes, 100);
    check_read(source, 0, 100);
    assert_int_equal(strl_source_read(source, 99, data, 2, NULL), STRL_ERR_FORMAT);
    assert_int_equal(strl_source_submit(source, 1, 101, 0, 0, NULL), STRL_ERR_FORMAT);
    strl_source_close(source);
    const fault_content empty = {.data = content, .size = 0};
    fault_server_set_content(server, &empty);
    must_not_open(fault_server_url(server, "/model"), STRL_ERR_NETWORK, "the file is empty");
    fault_server_destroy(server);
}

static void later_requests_are_for_what_was_opened_alone(void **state)
{
    (void)state;
    static const fault_content kinds[] = {{.data = content, .size = BYTES, .etag = "\"one\""},
                                          {.data = content, .size = BYTES, .modified = "Sun, 06 Nov 1994 08:49:37 GMT"},
                                          {.data = content, .size = BYTES, .etag = "W/\"weak\""}};
    for (unsigned kind = 0; kind < 3; kind++) {
        fault_asked asked[2];
        fault_server *server = fault_server_create(&kinds[kind], NULL, NULL);
        strl_source *source = must_open(fault_server_url(server, "/model"), &quick);
        check_read(source, 100000, 100000);
        assert_int_equal(fault_server_asked(server, asked, 2), 2);
        assert_false(asked[0].conditional);
        assert_int_equal(asked[0].first, 0);
        assert_int_equal(asked[0].last, HEAD - 1);
        assert_int_equal(asked[1].conditional, kind < 2);
        assert_int_equal(asked[1].first, 100000);
        assert_int_equal(asked[1].last, 199999);
        strl_source_close(source);
        fault_server_destroy(server);
    }
}

/* The first request after opening stalls on its only connection, until all else is submitted. */
static fault_server *create_slow(strl_source **source, uint32_t connections)
{
    static const fault_rule rules[] = {{0}, {.delay_ms = 400}, {0}};
    static listed_rules list = {rules, 3};
    const strl_http_desc desc = {.connections = connections, .backoff_ms = 1};
    fault_server *server = fault_server_create(&good, by_number, &list);
    *source = must_open(fault_server_url(server, "/model"), &desc);
    submit(*source, 1000, 900000, 100, 1000);
    wait_until_asked(server, 2);
    return server;
}

static void the_most_urgent_goes_first(void **state)
{
    (void)state;
    strl_source *source;
    fault_asked asked[16];
    fault_server *server = create_slow(&source, 1);
    const float urgency[] = {1, 7, 3, 9, 5};
    for (uint64_t i = 0; i < 5; i++)
        submit(source, i, 100000 + 150000 * i, 1000, urgency[i]);
    for (unsigned n = 0; n < 6; n++)
        strl__free(next_answer(source).data);
    assert_int_equal(fault_server_asked(server, asked, 16), 7);
    const uint64_t order[] = {3, 1, 4, 2, 0};
    for (unsigned n = 0; n < 5; n++)
        assert_int_equal(asked[2 + n].first, 100000 + 150000 * order[n]);
    strl_source_close(source);
    fault_server_destroy(server);
}

static void reads_next_to_each_other_share_a_request(void **state)
{
    (void)state;
    strl_source *source;
    fault_asked asked[16];
    fault_server *server = create_slow(&source, 1);
    for (uint64_t i = 0; i < 20; i++)
        submit(source, i, 200000 + 1000 * (i * 7 % 20), 1000, (float)i);
    for (unsigned n = 0; n < 21; n++) {
        strl_source_result result = next_answer(source);
        assert_int_equal(result.status, STRL_OK);
        if (result.token < 20)
            assert_memory_equal(result.data, content + 200000 + 1000 * (result.token * 7 % 20), 1000);
        strl__free(result.data);
    }
    assert_int_equal(fault_server_asked(server, asked, 16), 3);
    assert_int_equal(asked[2].first, 200000);
    assert_int_equal(asked[2].last, 219999);
    strl_network_stats stats = stats_of(source);
    assert_int_equal(stats.merged_reads, 20);
    assert_int_equal(stats.reads, 21);
    assert_int_equal(stats.requests, 3);
    assert_int_equal(stats.bytes, HEAD + 100 + 20000);
    assert_true(stats.latency_ns > 0);
    strl_source_close(source);
    fault_server_destroy(server);
}

/* ---- giving up */

static void cancelled_reads_are_answered_at_once_wherever_they_are(void **state)
{
    (void)state;
    const fault_rule stalls = {.stall = true, .after = 500};
    const strl_http_desc patient = {.connections = 2, .stall_ms = 60000};
    fault_server *server = fault_server_create(&good, by_number, LISTED(well, stalls));
    strl_source *source = must_open(fault_server_url(server, "/model"), &patient);
    for (uint64_t i = 0; i < 10; i++)
        submit(source, i, 100000 * (i % 5), 2000, (float)i);
    wait_until_asked(server, 3);
    uint64_t answers[10] = {0}, begin_ns = strl_clock_ns();
    for (uint64_t i = 0; i < 10; i++)
        strl_source_cancel(source, i);
    strl_source_cancel(source, 12345);
    for (unsigned n = 0; n < 10; n++) {
        strl_source_result result = next_answer(source);
        answers[result.token]++;
        assert_true(result.status == STRL_ERR_CANCELLED || result.token % 5 == 0); /* the head is known */
        assert_true((result.data == NULL) == (result.status != STRL_OK));
        strl__free(result.data);
    }
    assert_true(strl_clock_ns() - begin_ns < 30000 * MS);
    for (unsigned i = 0; i < 10; i++)
        assert_int_equal(answers[i], 1);
    while (fault_server_aborted(server) < 2) { /* nobody wanted the rest */
        assert_true(strl_clock_ns() - begin_ns < 60000 * MS);
        strl_sleep_ns(MS);
    }
    assert_int_equal(stats_of(source).failures, 0);
    strl_source_close(source);
    fault_server_destroy(server);
}

static void a_transfer_goes_on_for_the_reads_that_stay(void **state)
{
    (void)state;
    strl_source *source;
    fault_server *server = create_slow(&source, 1);
    for (uint64_t i = 0; i < 10; i++)
        submit(source, i, 200000 + 1000 * i, 1000, 1);
    for (uint64_t i = 0; i < 10; i += 2)
        strl_source_cancel(source, i);
    for (unsigned n = 0; n < 11; n++) {
        strl_source_result result = next_answer(source);
        assert_int_equal(result.status, result.token < 10 && result.token % 2 == 0 ? STRL_ERR_CANCELLED : STRL_OK);
        if (result.data)
            assert_memory_equal(result.data, content + (result.token < 10 ? 200000 + 1000 * result.token : 900000),
                                result.size);
        strl__free(result.data);
    }
    strl_source_close(source);
    fault_server_destroy(server);
}

static void closing_drops_what_is_unanswered(void **state)
{
    (void)state;
    const fault_rule stalls = {.stall = true, .after = 5000};
    const strl_http_desc desc = {.cache = strl_test_path("closing"), .stall_ms = 60000};
    fault_server *server = fault_server_create(&good, by_number, LISTED(well, well, stalls));
    for (unsigned run = 0; run < 8; run++) {
        strl_source *source = NULL;
        if (strl_source_open_http(fault_server_url(server, "/model"), run == 0 ? &desc : &quick, &source, NULL) !=
            STRL_OK)
            continue; /* that one stalled already */
        for (uint64_t i = 0; i < 100; i++)
            submit(source, i, 10000 * i, 9000, 0);
        if (run % 2)
            strl_sleep_ns(5 * MS);
        strl_source_close(source); /* the leak checker is the assertion */
    }
    fault_server_destroy(server);
    strl_path_remove_directory(strl_test_path("closing"), NULL);
}

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
        {{.whole = true}, "the server does not answer byte ranges", 1},
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
    fault_server *server = fault_server_create(
        &good, by_number, LISTED(well, silent, silent, silent, silent, silent, silent, well));
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

/* ---- addresses */

static void what_is_no_address_is_refused(void **state)
{
    (void)state;
    char longest[9000];
    memset(longest, 'a', sizeof longest);
    memcpy(longest, "http://h/", 9);
    longest[sizeof longest - 1] = 0;
    must_not_open("", STRL_ERR_ARGUMENT, "expected http:// or https://");
    must_not_open("ftp://host/model", STRL_ERR_ARGUMENT, "ftp://host/model is not an address");
    must_not_open("file:///etc/passwd", STRL_ERR_ARGUMENT, "is not an address");
    must_not_open("http://", STRL_ERR_ARGUMENT, "is not an address");
    must_not_open("http://host:99999/", STRL_ERR_ARGUMENT, "is not an address");
    must_not_open("http://host/a\r\nX: y", STRL_ERR_ARGUMENT, "control character");
    must_not_open(longest, STRL_ERR_ARGUMENT, "more than 8000 characters");
}

static void opening_says_what_is_wrong(void **state)
{
    (void)state;
    fault_server *server = fault_server_create(&good, NULL, NULL);
    must_not_open(fault_server_url(server, "/nothing"), STRL_ERR_NETWORK, "there is nothing at this address (404)");
    must_not_open(fault_server_url(server, "/loop"), STRL_ERR_NETWORK, "redirected too often");
    must_not_open(fault_server_url(server, "/elsewhere"), STRL_ERR_NETWORK,
                  "redirected to where Stroll does not follow");
    fault_server_kill(server);
    must_not_open(fault_server_url(server, "/model"), STRL_ERR_NETWORK, "the server cannot be reached");
    fault_server_destroy(server);
    const fault_rule failing = {.status = 500}, whole = {.whole = true}, silent = {.stall = true, .after = 0},
                     nameless = {.no_range_field = true};
    static const char *const words[] = {"the server failed (500)", "does not answer byte ranges", "stalled",
                                        "does not say which range"};
    const fault_rule rules[] = {failing, whole, silent, nameless};
    for (unsigned i = 0; i < 4; i++) {
        server = fault_server_create(&good, by_number, LISTED(rules[i]));
        must_not_open(fault_server_url(server, "/model"), STRL_ERR_NETWORK, words[i]);
        fault_server_destroy(server);
    }
}

static void a_password_or_a_query_is_in_no_sentence(void **state)
{
    (void)state;
    fault_server *server = fault_server_create(&good, NULL, NULL);
    char url[200];
    strl_source *source = NULL;
    strl_error err = {0};
    snprintf(url, sizeof url, "http://me:secret@%s?token=hidden", fault_server_url(server, "/none") + 7);
    assert_int_equal(strl_source_open_http(url, &quick, &source, &err), STRL_ERR_NETWORK);
    assert_null(strstr(err.message, "secret"));
    assert_null(strstr(err.message, "hidden"));
    assert_non_null(strstr(err.message, "/none: there is nothing"));
    fault_server_destroy(server);
}

static void an_address_that_is_none_keeps_its_secrets(void **state)
{
    (void)state;
    static const char *const shown[][2] = {
        {"http://me:secret@host:99999/x?token=secret", "http://host:99999/x"},
        {"ftp://me:secret@host/x#secret", "ftp://host/x"},
        {"me:secret@host/x", "host/x"},
        {"http://me:sec?ret@host/x", "http://"},
        {"http://host/x?mail=a@b&token=secret", "http://"},
        {"http://host/a@b/c", "http://b/c"},
        {"host/x?from=http://me:secret", "host/x"},
        {"", ""},
    };
    for (size_t i = 0; i < sizeof shown / sizeof *shown; i++) {
        char text[64], cut[8];
        assert_string_equal(strl__address_shown(shown[i][0], text, sizeof text), shown[i][1]);
        strl__address_shown(shown[i][0], cut, sizeof cut);
        assert_int_equal(strncmp(cut, shown[i][1], 7), 0);
        strl_source *source = NULL;
        strl_error err = {0};
        if (strncmp(shown[i][0], "http://host/", 12) == 0)
            continue; /* that is an address */
        assert_int_equal(strl_source_open_http(shown[i][0], &quick, &source, &err), STRL_ERR_ARGUMENT);
        assert_null(strstr(err.message, "sec"));
    }
}

static void where_a_redirect_led_to_knows_who_asks(void **state)
{
    (void)state;
    fault_asked asked[3];
    char url[200];
    fault_server *server = fault_server_create(&good, NULL, NULL);
    snprintf(url, sizeof url, "http://me:sec%%40ret@%s", fault_server_url(server, "/moved") + 7);
    strl_source *source = must_open(url, &quick);
    check_read(source, 100000, 100000);
    check_read(source, 400000, 100000);
    assert_int_equal(fault_server_asked(server, asked, 3), 3);
    assert_true(asked[0].named && asked[1].named && asked[2].named);
    strl_source_close(source);
    fault_server_destroy(server);
}

static void a_redirect_is_followed_once_and_remembered(void **state)
{
    (void)state;
    fault_server *server = fault_server_create(&good, NULL, NULL);
    strl_source *source = must_open(fault_server_url(server, "/redirect"), &quick);
    check_read(source, 100000, 100000);
    check_read(source, 400000, 100000);
    assert_int_equal(fault_server_asked(server, NULL, 0), 3);
    strl_source_close(source);
    fault_server_destroy(server);
}

static void where_a_redirect_led_to_may_end(void **state)
{
    (void)state;
    const fault_rule gone = {.status = 403};
    fault_server *server = fault_server_create(&good, by_number, LISTED(well, gone, well));
    strl_source *source = must_open(fault_server_url(server, "/redirect"), &quick);
    check_read(source, 100000, 100000); /* the address itself leads there again */
    strl_source_close(source);
    fault_server_destroy(server);
}

/* ---- the cache */

static strl_http_desc cached(const char *folder)
{
    strl_http_desc desc = quick;
    desc.cache = strl_test_path(folder);
    return desc;
}

/* Reads the same things in any run; returns how many requests that took. */
static unsigned read_some(fault_server *server, const strl_http_desc *desc, const uint8_t *expected, uint64_t *hits)
{
    unsigned before = fault_server_asked(server, NULL, 0);
    strl_source *source = must_open(fault_server_url(server, "/model"), desc);
    static uint8_t data[100000];
    assert_int_equal(strl_source_read(source, BYTES - 500, data, 500, NULL), STRL_OK);
    assert_memory_equal(data, expected + BYTES - 500, 500);
    assert_int_equal(strl_source_read(source, BYTES - 9000, data, 2000, NULL), STRL_OK);
    assert_memory_equal(data, expected + BYTES - 9000, 2000);
    for (uint64_t i = 0; i < 10; i++)
        submit(source, i, 100000 + 50000 * i, 20000, 0);
    for (unsigned n = 0; n < 10; n++) {
        strl_source_result result = next_answer(source);
        assert_int_equal(result.status, STRL_OK);
        assert_memory_equal(result.data, expected + 100000 + 50000 * result.token, 20000);
        strl__free(result.data);
    }
    *hits = stats_of(source).cache_hits;
    strl_source_close(source);
    return fault_server_asked(server, NULL, 0) - before;
}

static void a_second_run_reads_nothing_but_the_header(void **state)
{
    (void)state;
    const strl_http_desc desc = cached("cache");
    fault_server *server = fault_server_create(&good, NULL, NULL), *mirror = fault_server_create(&good, NULL, NULL);
    uint64_t hits;
    assert_true(read_some(server, &desc, content, &hits) > 1);
    assert_int_equal(hits, 0);
    assert_int_equal(read_some(server, &desc, content, &hits), 1);
    assert_int_equal(hits, 12);
    assert_int_equal(read_some(mirror, &desc, content, &hits), 1); /* the same model at another address */
    const fault_content changed = {.data = other_content, .size = BYTES, .etag = "\"two\""};
    fault_server_set_content(server, &changed);
    assert_true(read_some(server, &desc, other_content, &hits) > 1);
    assert_int_equal(hits, 0);
    fault_server_destroy(server);
    fault_server_destroy(mirror);
    strl_path_remove_directory(strl_test_path("cache"), NULL);
}

typedef struct damage {
    const char *folder;
    unsigned files;
} damage;

static void damage_one(damage *self, const strl_shelf_entry *entry)
{
    char *path = strl_path_join(self->folder, entry->name);
    FILE *file = fopen(path, "r+b");
    assert_non_null(file);
    if (self->files++ % 2) {
        fseek(file, 1000, SEEK_SET);
        fputc(fgetc(file) ^ 0x40, file);
    } else {
        assert_int_equal(strl_path_remove(path, NULL), STRL_OK);
        FILE *shorter = fopen(path, "wb");
        fputs("stroll cache 1\n", shorter);
        fclose(shorter);
    }
    fclose(file);
    strl__free(path);
}

static void damage_all(damage *self)
{
    strl_shelf *shelf;
    strl_shelf_entry entry;
    assert_int_equal(strl_shelf_open(self->folder, &shelf, NULL), STRL_OK);
    while (strl_shelf_next(shelf, &entry, NULL) == STRL_OK && entry.name)
        if (*entry.name)
            damage_one(self, &entry);
    strl_shelf_close(shelf);
}

static void damaged_entries_heal(void **state)
{
    (void)state;
    const strl_http_desc desc = cached("damaged");
    fault_server *server = fault_server_create(&good, NULL, NULL);
    uint64_t hits;
    read_some(server, &desc, content, &hits);
    damage all = {.folder = desc.cache};
    damage_all(&all);
    assert_int_equal(all.files, 12);
    assert_true(read_some(server, &desc, content, &hits) > 1);
    assert_int_equal(read_some(server, &desc, content, &hits), 1);
    assert_int_equal(hits, 12);
    fault_server_destroy(server);
    strl_path_remove_directory(desc.cache, NULL);
}

static void wrong_bytes_that_somebody_doubts_do_not_come_out_of_the_cache(void **state)
{
    (void)state;
    const strl_http_desc desc = cached("doubted");
    const fault_rule wrong = {.wrong_bytes = true};
    fault_server *server = fault_server_create(&good, by_number, LISTED(well, wrong, well));
    strl_source *source = must_open(fault_server_url(server, "/model"), &desc);
    static uint8_t data[20000];
    assert_int_equal(strl_source_read(source, 100000, data, 20000, NULL), STRL_OK);
    assert_memory_not_equal(data, content + 100000, 20000);
    strl_source_doubt(source, 100000, 20000);
    check_read(source, 100000, 20000);
    strl_source_close(source);
    source = must_open(fault_server_url(server, "/model"), &desc);
    check_read(source, 100000, 20000);
    assert_int_equal(stats_of(source).cache_hits, 1);
    strl_source_close(source);
    fault_server_destroy(server);
    strl_path_remove_directory(desc.cache, NULL);
}

static void a_head_that_is_doubted_comes_anew_and_names_the_model(void **state)
{
    (void)state;
    const strl_http_desc desc = cached("head");
    const fault_rule wrong = {.wrong_bytes = true};
    fault_server *server = fault_server_create(&good, by_number, LISTED(wrong, wrong, well));
    strl_source *source = must_open(fault_server_url(server, "/model"), &desc);
    static uint8_t data[HEAD];
    for (unsigned wrongs = 1; wrongs <= 2; wrongs++) {
        assert_int_equal(strl_source_read(source, 0, data, HEAD, NULL), STRL_OK);
        assert_memory_not_equal(data, content, HEAD);
        strl_source_doubt(source, 0, HEAD);
        assert_int_equal(fault_server_asked(server, NULL, 0), wrongs);
    }
    check_read(source, 0, HEAD);
    check_read(source, 100, 1000);
    assert_int_equal(fault_server_asked(server, NULL, 0), 3);
    check_read(source, 100000, 20000);
    strl_source_close(source);
    source = must_open(fault_server_url(server, "/model"), &desc); /* of the same model */
    check_read(source, 100000, 20000);
    assert_int_equal(stats_of(source).cache_hits, 1);
    strl_source_close(source);
    fault_server_destroy(server);
    strl_path_remove_directory(desc.cache, NULL);
}

/* While the cache makes room for what was read nobody watches for what comes in. */
static void a_doubt_at_any_moment_leaves_no_read_behind(void **state)
{
    (void)state;
    const strl_http_desc desc = cached("doubts");
    fault_server *server = fault_server_create(&good, NULL, NULL);
    strl_source *source = must_open(fault_server_url(server, "/model"), &desc);
    for (uint64_t i = 0; i < 1000; i++) {
        uint64_t offset = i * 7919 % (BYTES - 2000);
        check_read(source, offset, 1000);
        if (i % 3 == 0)
            strl_sleep_ns(i * 250 % 50000);
        strl_source_doubt(source, offset, 1000);
        check_read(source, offset, 1000);
    }
    strl_source_close(source);
    fault_server_destroy(server);
    strl_path_remove_directory(desc.cache, NULL);
}

static void a_cache_that_cannot_be_used_is_done_without(void **state)
{
    (void)state;
    const strl_http_desc nowhere = cached("no/such/folder"), full = cached("full");
    fault_server *server = fault_server_create(&good, NULL, NULL);
    uint64_t hits;
    for (unsigned run = 0; run < 2; run++) {
        assert_true(read_some(server, &nowhere, content, &hits) > 1);
        assert_int_equal(hits, 0);
    }
    strl_file_fail_writes_after(1);
    assert_true(read_some(server, &full, content, &hits) > 1);
    strl_file_fail_writes_after(0);
    assert_true(read_some(server, &full, content, &hits) > 1);
    assert_int_equal(hits, 0);
    fault_server_destroy(server);
    strl_path_remove_directory(full.cache, NULL);
}

/* ---- without memory */

static strl_status use_source(const char *url, const strl_http_desc *desc)
{
    strl_source *source = NULL;
    strl_error err = {0};
    unsigned accepted = 0;
    strl_status first = strl_source_open_http(url, desc, &source, &err);
    for (uint64_t i = 0; source && i < 20; i++) {
        strl_status status = strl_source_submit(source, i, 10000 + 5000 * i, 4000, (float)i, &err);
        accepted += status == STRL_OK;
        first = first == STRL_OK ? status : first;
    }
    for (; accepted > 0; accepted--) {
        strl_source_result result = next_answer(source);
        first = first == STRL_OK ? result.status : first;
        assert_true((result.data != NULL) == (result.status == STRL_OK));
        if (result.data)
            assert_memory_equal(result.data, content + 10000 + 5000 * result.token, 4000);
        strl__free(result.data);
    }
    uint8_t together[4][1000];
    strl_source_span spans[4];
    for (size_t i = 0; i < 4; i++)
        spans[i] = known_span(200000 + 100000 * i, sizeof together[i], together[i]);
    if (source && first == STRL_OK)
        first = strl_source_read_many(source, spans, 4, &err);
    strl_source_close(source);
    return first;
}

static void every_failed_allocation_is_a_clean_failure(void **state)
{
    (void)state;
    const strl_http_desc desc = cached("memory");
    fault_server *server = fault_server_create(&good, NULL, NULL);
    strl_status status = STRL_ERR_MEMORY;
    for (uint64_t n = 1; status != STRL_OK; n++) {
        strl__alloc_fail_after(n);
        status = use_source(fault_server_url(server, "/model"), &desc);
        strl__alloc_fail_after(0);
        if (status != STRL_OK && status != STRL_ERR_MEMORY)
            fail_msg("allocation %u failed: %s", (unsigned)n, strl_status_name(status));
        assert_true(n < 2000);
    }
    fault_server_destroy(server);
    strl_path_remove_directory(desc.cache, NULL);
}

static void a_local_source_is_not_remote(void **state)
{
    (void)state;
    strl_source *source = NULL;
    strl_network_stats stats = {.requests = 7};
    assert_int_equal(strl_source_open_memory(content, BYTES, &source, NULL), STRL_OK);
    assert_false(strl_source_get_network_stats(source, &stats));
    assert_int_equal(stats.requests, 0);
    assert_true(strl_source_room(source) == UINT64_MAX);
    strl_source_doubt(source, 0, 1);
    strl_source_close(source);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_read_is_answered_once_with_its_bytes),
        cmocka_unit_test(a_waiting_read_gives_its_bytes_and_brings_what_is_near),
        cmocka_unit_test(a_waiting_read_that_comes_back_finds_what_was_near),
        cmocka_unit_test(reads_together_give_what_each_would_alone),
        cmocka_unit_test(bytes_that_come_wrong_are_asked_for_again),
        cmocka_unit_test(bytes_that_are_always_wrong_are_asked_for_some_times),
        cmocka_unit_test(of_reads_together_the_first_that_failed_is_told),
        cmocka_unit_test(reads_together_are_asked_for_together),
        cmocka_unit_test(ranges_outside_are_not_accepted_and_small_files_open),
        cmocka_unit_test(later_requests_are_for_what_was_opened_alone),
        cmocka_unit_test(the_most_urgent_goes_first),
        cmocka_unit_test(reads_next_to_each_other_share_a_request),
        cmocka_unit_test(cancelled_reads_are_answered_at_once_wherever_they_are),
        cmocka_unit_test(a_transfer_goes_on_for_the_reads_that_stay),
        cmocka_unit_test(closing_drops_what_is_unanswered),
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
        cmocka_unit_test(what_is_no_address_is_refused),
        cmocka_unit_test(more_than_an_answer_says_is_an_attempt_that_failed),
        cmocka_unit_test(opening_says_what_is_wrong),
        cmocka_unit_test(a_password_or_a_query_is_in_no_sentence),
        cmocka_unit_test(an_address_that_is_none_keeps_its_secrets),
        cmocka_unit_test(where_a_redirect_led_to_knows_who_asks),
        cmocka_unit_test(a_redirect_is_followed_once_and_remembered),
        cmocka_unit_test(where_a_redirect_led_to_may_end),
        cmocka_unit_test(a_second_run_reads_nothing_but_the_header),
        cmocka_unit_test(damaged_entries_heal),
        cmocka_unit_test(wrong_bytes_that_somebody_doubts_do_not_come_out_of_the_cache),
        cmocka_unit_test(a_head_that_is_doubted_comes_anew_and_names_the_model),
        cmocka_unit_test(a_doubt_at_any_moment_leaves_no_read_behind),
        cmocka_unit_test(a_cache_that_cannot_be_used_is_done_without),
        cmocka_unit_test(every_failed_allocation_is_a_clean_failure),
        cmocka_unit_test(a_local_source_is_not_remote),
    };
    return cmocka_run_group_tests(tests, set_up, strl_test_folder_remove);
}
