/* A file behind an address: reads merged, ordered, cancelled and given up, its addresses, and no memory. Times are as
 * short as they can be, and nothing depends on how fast the machine is. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include "base/hash.h"
#include "base/memory.h"
#include "platform/file.h"
#include "platform/thread.h"
#include "source/http_checks.h"
#include "support/folder.h"

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

/* so near that on any link one request brings several */
enum { MANY = 60, MANY_BYTES = 3000, FAR = 17000, NEAR = 5000 };

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
    /* Six or more in each, as long as nothing lies between two that are on their way: 21 at most; the head, and what
     * was cut off. */
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
    /* nobody is asked twice for what is in memory */
    assert_int_equal(strl_source_read_known(source, &span, NULL), STRL_OK);
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
    strl_source *source = must_open_memory();
    strl_network_stats stats = {.requests = 7};
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
        cmocka_unit_test(what_is_no_address_is_refused),
        cmocka_unit_test(opening_says_what_is_wrong),
        cmocka_unit_test(a_password_or_a_query_is_in_no_sentence),
        cmocka_unit_test(an_address_that_is_none_keeps_its_secrets),
        cmocka_unit_test(where_a_redirect_led_to_knows_who_asks),
        cmocka_unit_test(a_redirect_is_followed_once_and_remembered),
        cmocka_unit_test(where_a_redirect_led_to_may_end),
        cmocka_unit_test(every_failed_allocation_is_a_clean_failure),
        cmocka_unit_test(a_local_source_is_not_remote),
    };
    return cmocka_run_group_tests(tests, set_up, strl_test_folder_remove);
}
