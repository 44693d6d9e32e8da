#include "source/http_checks.h"

#include <setjmp.h>
#include <stdarg.h>
#include <string.h>
#include <cmocka.h>

#include "base/hash.h"
#include "platform/thread.h"
#include "support/folder.h"

uint8_t content[BYTES], other_content[BYTES];
const fault_content good = {.data = content, .size = BYTES, .etag = "\"one\""};
const fault_rule well = {0};
const strl_http_desc quick = {.backoff_ms = 1, .stall_ms = 300, .attempts = 4};

int set_up(void **state)
{
    for (size_t i = 0; i < BYTES; i++) {
        content[i] = (uint8_t)strl__mix64(i + 1);
        other_content[i] = (uint8_t)strl__mix64(i + 12345);
    }
    return strl_test_folder_make(state);
}

strl_http_desc cached(const char *folder)
{
    strl_http_desc desc = quick;
    desc.cache = strl_test_path(folder);
    return desc;
}

strl_source *must_open(const char *url, const strl_http_desc *desc)
{
    strl_source *source = NULL;
    strl_error err = {0};
    if (strl_source_open_http(url, desc, &source, &err) != STRL_OK)
        fail_msg("%s", err.message);
    return source;
}

strl_source *must_open_memory(void)
{
    strl_source *source = NULL;
    assert_int_equal(strl_source_open_memory(content, BYTES, &source, NULL), STRL_OK);
    return source;
}

void must_not_open(const char *url, strl_status status, const char *words)
{
    strl_source *source = NULL;
    strl_error err = {0};
    assert_int_equal(strl_source_open_http(url, &quick, &source, &err), status);
    assert_null(source);
    if (!strstr(err.message, words))
        fail_msg("\"%s\" lacks \"%s\"", err.message, words);
}

strl_source_result next_answer(strl_source *source)
{
    strl_source_result result;
    uint64_t give_up_ns = strl_clock_ns() + 60000 * MS;
    while (!strl_source_poll(source, &result)) {
        assert_true(strl_clock_ns() < give_up_ns);
        strl_sleep_ns(MS / 10);
    }
    return result;
}

void submit(strl_source *source, uint64_t token, uint64_t offset, size_t size, float urgency)
{
    assert_int_equal(strl_source_submit(source, token, offset, size, urgency, NULL), STRL_OK);
}

void check_read(strl_source *source, uint64_t offset, size_t size)
{
    static uint8_t data[BYTES];
    strl_error err = {0};
    if (strl_source_read(source, offset, data, size, &err) != STRL_OK)
        fail_msg("%s", err.message);
    assert_memory_equal(data, content + offset, size);
}

void check_read_fails(strl_source *source, uint64_t offset, size_t size, const char *words)
{
    static uint8_t data[BYTES];
    strl_error err = {0};
    assert_int_equal(strl_source_read(source, offset, data, size, &err), STRL_ERR_NETWORK);
    if (!strstr(err.message, words))
        fail_msg("\"%s\" lacks \"%s\"", err.message, words);
}

strl_network_stats stats_of(const strl_source *source)
{
    strl_network_stats stats;
    assert_true(strl_source_get_network_stats(source, &stats));
    return stats;
}

void wait_until_asked(fault_server *server, unsigned requests)
{
    uint64_t give_up_ns = strl_clock_ns() + 60000 * MS;
    while (fault_server_asked(server, NULL, 0) < requests) {
        assert_true(strl_clock_ns() < give_up_ns);
        strl_sleep_ns(MS / 10);
    }
}

fault_rule by_number(void *context, unsigned number, const fault_asked *asked)
{
    const listed_rules *list = context;
    (void)asked;
    return list->rules[number < list->count ? number : list->count - 1];
}
