/* What strangers send is taken apart as RFC 9110 and docs/serve.md say, and what is no such thing is refused. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "serve/parse.h"

#define COUNT_OF(array) (sizeof(array) / sizeof *(array))

/* In a block of its own, for sanitizers to watch. */
static strl__refusal parse_target(const char *text, strl__target *target, char **copy)
{
    *copy = strdup(text);
    assert_non_null(*copy);
    return strl__parse_target(*copy, target);
}

static void a_target_names_a_file_or_a_folder(void **state)
{
    (void)state;
    static const struct {
        const char *raw, *path;
        bool is_folder, is_hidden;
        const char *query;
    } cases[] = {
        {"/", "", true, false, NULL},
        {"/a.stroll", "a.stroll", false, false, NULL},
        {"/sub/a.stroll?nodes=0:0", "sub/a.stroll", false, false, "nodes=0:0"},
        {"/sub/", "sub", true, false, NULL},
        {"/%61%2Estroll", "a.stroll", false, false, NULL},
        {"/a%20b.stroll", "a b.stroll", false, false, NULL},
        {"/%c3%a4.stroll", "\xc3\xa4.stroll", false, false, NULL},
        {"/\xc3\xa4.stroll", "\xc3\xa4.stroll", false, false, NULL},
        {"/a+b.stroll", "a+b.stroll", false, false, NULL},
        {"/.git/x.stroll", ".git/x.stroll", false, true, NULL},
        {"/a/%2ehidden", "a/.hidden", false, true, NULL},
        {"/...", "...", false, true, NULL},
        {"/a..b", "a..b", false, false, NULL},
        {"/?", "", true, false, ""},
        {"http://host:80/x", "x", false, false, NULL},
        {"HTTP://host/x?y", "x", false, false, "y"},
        {"http://host", "", true, false, NULL},
    };
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        strl__target target;
        char *copy;
        strl__refusal refusal = parse_target(cases[i].raw, &target, &copy);
        if (refusal.status)
            fail_msg("%s: %s", cases[i].raw, refusal.sentence);
        assert_string_equal(target.path, cases[i].path);
        assert_int_equal(target.is_folder, cases[i].is_folder);
        assert_int_equal(target.is_hidden, cases[i].is_hidden);
        assert_int_equal(target.query != NULL, cases[i].query != NULL);
        if (cases[i].query)
            assert_string_equal(target.query, cases[i].query);
        free(copy);
    }
}

static void a_target_that_leads_elsewhere_is_refused(void **state)
{
    (void)state;
    static const struct {
        const char *raw;
        unsigned status;
    } cases[] = {
        {"", 400},
        {"a.stroll", 400},
        {"//a", 400},
        {"/a//b", 400},
        {"/..", 400},
        {"/../a", 400},
        {"/a/../b", 400},
        {"/%2e%2e/a", 400},
        {"/.%2E/a", 400},
        {"/./a", 400},
        {"/a/.", 400},
        {"/a%2fb", 400},
        {"/..%2fa", 400},
        {"/..%5ca", 400},
        {"/a\\b", 400},
        {"/%00", 400},
        {"/a%0ab", 400},
        {"/a%7f", 400},
        {"/\x01", 400},
        {"/%", 400},
        {"/%2", 400},
        {"/%zz", 400},
        {"/%c0%ae%c0%ae/a", 400},
        {"/\xff", 400},
        {"/%ed%a0%80", 400},
        {"/a#b", 400},
        {"http://", 400},
        {"ftp://host/a", 400},
        {"*/", 400},
        {"/a/ /../b", 400},
    };
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        strl__target target;
        char *copy;
        strl__refusal refusal = parse_target(cases[i].raw, &target, &copy);
        if (refusal.status != cases[i].status)
            fail_msg("%s: %u, expected %u", cases[i].raw, refusal.status, cases[i].status);
        assert_non_null(refusal.sentence);
        free(copy);
    }
}

static void a_path_may_be_as_long_as_is_said(void **state)
{
    (void)state;
    char raw[STRL__PATH_BYTES + 3];
    strl__target target;
    memset(raw, 'a', sizeof raw);
    for (size_t at = 0; at < sizeof raw; at += 200)
        raw[at] = '/';
    raw[1 + STRL__PATH_BYTES] = 0;
    assert_int_equal(strl__parse_target(raw, &target).status, 0);
    assert_int_equal(strlen(target.path), STRL__PATH_BYTES);
    raw[1 + STRL__PATH_BYTES] = 'a';
    raw[2 + STRL__PATH_BYTES] = 0;
    assert_int_equal(strl__parse_target(raw, &target).status, 414);
    memset(raw, 'a', sizeof raw);
    raw[0] = '/';
    raw[1 + STRL__COMPONENT_BYTES] = 0;
    assert_int_equal(strl__parse_target(raw, &target).status, 0);
    raw[1 + STRL__COMPONENT_BYTES] = 'a';
    raw[2 + STRL__COMPONENT_BYTES] = 0;
    assert_int_equal(strl__parse_target(raw, &target).status, 414);
}

static strl__refusal parse_query(const char *text, strl__query *query)
{
    char *copy = strdup(text);
    assert_non_null(copy);
    strl__refusal refusal = strl__parse_query(copy, query);
    free(copy);
    return refusal;
}

static void a_query_asks_for_nodes(void **state)
{
    (void)state;
    static strl__query query;
    assert_int_equal(parse_query("nodes=3:0,7,4294967294", &query).status, 0);
    assert_int_equal(query.kind, STRL__QUERY_NODES);
    assert_int_equal(query.tree, 3);
    assert_int_equal(query.count, 3);
    assert_int_equal(query.items[1].node, 7);
    assert_int_equal(query.items[2].node, UINT32_MAX - 1);
    assert_int_equal(parse_query("most=100&subtrees=0%3A1%2F2%2C5%2f65535&", &query).status, 0);
    assert_int_equal(query.kind, STRL__QUERY_SUBTREES);
    assert_int_equal(query.count, 2);
    assert_int_equal(query.items[0].depth, 2);
    assert_int_equal(query.items[1].depth, 65535);
    assert_int_equal(query.most_bytes, 100);
    assert_int_equal(strl__parse_query(NULL, &query).status, 0);
    assert_int_equal(query.kind, STRL__QUERY_NONE);
    assert_int_equal(parse_query("format=json", &query).status, 0);
    assert_int_equal(query.format, STRL__FORMAT_JSON);
}

static void a_query_that_is_none_is_refused(void **state)
{
    (void)state;
    static const char *const cases[] = {
        "nodes",
        "nodes=",
        "nodes=0",
        "nodes=0:",
        "nodes=:1",
        "nodes=0:1,",
        "nodes=0:,1",
        "nodes=0:1,1",
        "nodes=0:2,1",
        "nodes=0:-1",
        "nodes=0:1/2",
        "nodes=0:4294967295",
        "nodes=0:99999999999999999999999",
        "nodes=4294967295:1",
        "nodes=0:1 ",
        "nodes=0:1+",
        "nodes=0:0x1",
        "nodes=0:1&nodes=0:2",
        "nodes=0:1&subtrees=0:1/1",
        "subtrees=0:1",
        "subtrees=0:1/",
        "subtrees=0:1/65536",
        "subtrees=0:1/-1",
        "subtrees=0:1/1/1",
        "most=0",
        "most=",
        "most=x",
        "most=9223372036854775808",
        "format=xml",
        "format",
        "node=0:1",
        "%",
        "%zz=1",
        "nodes=0:1%00",
        "nodes%0d=0:1",
        "=",
        "x",
    };
    static strl__query query;
    for (size_t i = 0; i < COUNT_OF(cases); i++)
        if (parse_query(cases[i], &query).status != 400)
            fail_msg("%s is taken", cases[i]);
}

static void a_query_may_ask_for_as_many_nodes_as_is_said(void **state)
{
    (void)state;
    static strl__query query;
    static char text[STRL__QUERY_ITEMS * 6 + 32];
    size_t used = (size_t)snprintf(text, sizeof text, "nodes=0:0");
    for (unsigned i = 1; i < STRL__QUERY_ITEMS; i++)
        used += (size_t)snprintf(text + used, sizeof text - used, ",%u", i);
    assert_int_equal(parse_query(text, &query).status, 0);
    assert_int_equal(query.count, STRL__QUERY_ITEMS);
    snprintf(text + used, sizeof text - used, ",9999");
    assert_int_equal(parse_query(text, &query).status, 400);
}

static void a_range_is_cut_to_the_file(void **state)
{
    (void)state;
    static const struct {
        const char *value;
        strl__range_kind kind;
        uint64_t first, bytes;
    } cases[] = {
        {"bytes=0-0", STRL__RANGE_PART, 0, 1},
        {"bytes=0-99", STRL__RANGE_PART, 0, 100},
        {"bytes=0-100", STRL__RANGE_PART, 0, 100},
        {"bytes=99-", STRL__RANGE_PART, 99, 1},
        {"bytes=10-19", STRL__RANGE_PART, 10, 10},
        {"bytes=-1", STRL__RANGE_PART, 99, 1},
        {"bytes=-100", STRL__RANGE_PART, 0, 100},
        {"bytes=-101", STRL__RANGE_PART, 0, 100},
        {"bytes=0-18446744073709551615", STRL__RANGE_PART, 0, 100},
        {"bytes=0-99999999999999999999999999", STRL__RANGE_PART, 0, 100},
        {"bytes=-99999999999999999999999999", STRL__RANGE_PART, 0, 100},
        {"Bytes = 5-5 ", STRL__RANGE_PART, 5, 1},
        {"bytes= 5-5", STRL__RANGE_PART, 5, 1},
        {"bytes=100-", STRL__RANGE_NOTHING, 0, 0},
        {"bytes=100-200", STRL__RANGE_NOTHING, 0, 0},
        {"bytes=99999999999999999999999999-", STRL__RANGE_NOTHING, 0, 0},
        {"bytes=-0", STRL__RANGE_NOTHING, 0, 0},
        {"bytes=5-4", STRL__RANGE_NOTHING, 0, 0},
        {"bytes=", STRL__RANGE_NOTHING, 0, 0},
        {"bytes=-", STRL__RANGE_NOTHING, 0, 0},
        {"bytes=a-b", STRL__RANGE_NOTHING, 0, 0},
        {"bytes=1", STRL__RANGE_NOTHING, 0, 0},
        {"bytes=1-2x", STRL__RANGE_NOTHING, 0, 0},
        {"bytes=1-2,", STRL__RANGE_NOTHING, 0, 0},
        {"bytes=+1-2", STRL__RANGE_NOTHING, 0, 0},
        {"bytes=1 -2", STRL__RANGE_NOTHING, 0, 0},
        {"bytes=200-300,400-", STRL__RANGE_NOTHING, 0, 0},
        {"bytes=0-1,5-6", STRL__RANGE_WHOLE, 0, 0},
        {"bytes=0-1, 200-", STRL__RANGE_WHOLE, 0, 0},
        {"items=0-5", STRL__RANGE_WHOLE, 0, 0},
        {"bytesx=0-5", STRL__RANGE_WHOLE, 0, 0},
        {"", STRL__RANGE_WHOLE, 0, 0},
        {"0-5", STRL__RANGE_WHOLE, 0, 0},
    };
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        strl__range range = strl__parse_range(cases[i].value, 100);
        if (range.kind != cases[i].kind || range.first != cases[i].first || range.bytes != cases[i].bytes)
            fail_msg("%s: kind %d, %llu bytes at %llu", cases[i].value, (int)range.kind,
                     (unsigned long long)range.bytes, (unsigned long long)range.first);
    }
    assert_int_equal(strl__parse_range(NULL, 100).kind, STRL__RANGE_WHOLE);
    assert_int_equal(strl__parse_range("bytes=0-", 0).kind, STRL__RANGE_NOTHING);
    assert_int_equal(strl__parse_range("bytes=-5", 0).kind, STRL__RANGE_NOTHING);
    strl__range far = strl__parse_range("bytes=-1", UINT64_MAX);
    assert_true(far.first == UINT64_MAX - 1 && far.bytes == 1);
}

static void tags_are_compared_as_they_stand(void **state)
{
    (void)state;
    assert_true(strl__etag_is_listed("\"a\"", "\"a\"", false));
    assert_true(strl__etag_is_listed("*", "\"a\"", false));
    assert_true(strl__etag_is_listed(" * ", "\"a\"", false));
    assert_true(strl__etag_is_listed("\"b\" , \"a\"", "\"a\"", false));
    assert_true(strl__etag_is_listed("\"b,c\",\"a\"", "\"a\"", false));
    assert_true(strl__etag_is_listed("W/\"a\"", "\"a\"", true));
    assert_false(strl__etag_is_listed("W/\"a\"", "\"a\"", false));
    assert_false(strl__etag_is_listed("\"A\"", "\"a\"", true));
    assert_false(strl__etag_is_listed("\"aa\"", "\"a\"", true));
    assert_false(strl__etag_is_listed("a", "\"a\"", true));
    assert_false(strl__etag_is_listed("\"a", "\"a\"", true));
    assert_false(strl__etag_is_listed("", "\"a\"", true));
    assert_false(strl__etag_is_listed("W/", "\"a\"", true));
    assert_false(strl__etag_is_listed("\"b\" \"a\"", "\"a\"", true));
}

static void dates_go_there_and_back(void **state)
{
    (void)state;
    static const int64_t times[] = {0, 1, 784111777, 951782400, 951868799, 1709164800, 4102444800, 253402300799};
    char text[STRL__DATE_BYTES];
    int64_t back;
    for (size_t i = 0; i < COUNT_OF(times); i++) {
        strl__format_date(times[i], text);
        assert_true(strl__parse_date(text, &back));
        assert_true(back == times[i]);
    }
    strl__format_date(784111777, text);
    assert_string_equal(text, "Sun, 06 Nov 1994 08:49:37 GMT");
    strl__format_date(INT64_MAX, text);
    assert_string_equal(text, "Fri, 31 Dec 9999 23:59:59 GMT");
    strl__format_date(INT64_MIN, text);
    assert_string_equal(text, "Mon, 01 Jan 0001 00:00:00 GMT");
    strl__format_time(784111777123456789, text);
    assert_string_equal(text, "1994-11-06T08:49:37.123Z");
}

static void all_three_forms_of_a_date_are_read(void **state)
{
    (void)state;
    static const char *const same[] = {"Sun, 06 Nov 1994 08:49:37 GMT", "Sunday, 06-Nov-94 08:49:37 GMT",
                                       "Sun Nov  6 08:49:37 1994", "Sun Nov 06 08:49:37 1994"};
    static const char *const none[] = {"",
                                       "Sun",
                                       "Sun,",
                                       "0",
                                       "784111777",
                                       "Sun, 06 Nov 1994 08:49:37",
                                       "Sun, 06 Nov 1994",
                                       "Sun, 06 Nov 1994 08:49:37 GMT ",
                                       "Sun, 32 Nov 1994 08:49:37 GMT",
                                       "Sun, 06 Nov 1994 24:49:37 GMT",
                                       "Sun, 06 Non 1994 08:49:37 GMT",
                                       "Sun, 6 Nov 1994 08:49:37 GMT",
                                       "Sun, 06 Nov 0000 08:49:37 GMT",
                                       "Sun Nov   6 08:49:37 1994",
                                       "S, 06 Nov 1994 08:49:37 GMT"};
    int64_t time;
    for (size_t i = 0; i < COUNT_OF(same); i++) {
        assert_true(strl__parse_date(same[i], &time));
        assert_true(time == 784111777);
    }
    for (size_t i = 0; i < COUNT_OF(none); i++)
        if (strl__parse_date(none[i], &time))
            fail_msg("\"%s\" is taken for a date", none[i]);
}

#define BEFORE "Sun, 06 Nov 1994 08:49:36 GMT"
#define EXACT "Sun, 06 Nov 1994 08:49:37 GMT"
#define AFTER "Sun, 06 Nov 1994 08:49:38 GMT"

static void conditions_come_before_ranges(void **state)
{
    (void)state;
    const strl__validators fresh = {.etag = "\"t\"", .modified_s = 784111777, .date_is_strong = true, .bytes = 100};
    const struct {
        strl__conditions conditions;
        unsigned status;
    } cases[] = {
        {{.range = NULL}, 200},
        {{.range = "bytes=0-9"}, 206},
        {{.range = "bytes=100-"}, 416},
        {{.range = "bytes=0-1,3-4"}, 200},
        {{.match = {"\"t\""}}, 200},
        {{.match = {"\"x\"", "\"t\""}}, 200},
        {{.match = {"\"x\""}}, 412},
        {{.match = {"W/\"t\""}}, 412},
        {{.match = {"\"x\""}, .range = "bytes=0-9"}, 412},
        {{.match = {"\"t\""}, .unmodified_since = BEFORE}, 200},
        {{.unmodified_since = BEFORE}, 412},
        {{.unmodified_since = EXACT}, 200},
        {{.unmodified_since = "nonsense"}, 200},
        {{.none_match = {"\"t\""}}, 304},
        {{.none_match = {"W/\"t\""}}, 304},
        {{.none_match = {"*"}}, 304},
        {{.none_match = {"\"x\""}}, 200},
        {{.none_match = {"\"x\""}, .modified_since = AFTER}, 200},
        {{.none_match = {"\"t\""}, .range = "bytes=0-9"}, 304},
        {{.modified_since = BEFORE}, 200},
        {{.modified_since = EXACT}, 304},
        {{.modified_since = "nonsense"}, 200},
        {{.if_range = "\"t\"", .range = "bytes=0-9"}, 206},
        {{.if_range = "\"x\"", .range = "bytes=0-9"}, 200},
        {{.if_range = "\"x\"", .range = "bytes=100-"}, 200},
        {{.if_range = "\"t\"x", .range = "bytes=0-9"}, 200},
        {{.if_range = "W/\"t\"", .range = "bytes=0-9"}, 200},
        {{.if_range = EXACT, .range = "bytes=0-9"}, 206},
        {{.if_range = AFTER, .range = "bytes=0-9"}, 200},
        {{.if_range = "\"", .range = "bytes=0-9"}, 200},
    };
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        strl__range range;
        unsigned status = strl__decide(&cases[i].conditions, &fresh, true, &range);
        if (status != cases[i].status)
            fail_msg("case %zu: %u, expected %u", i, status, cases[i].status);
        assert_int_equal(range.kind == STRL__RANGE_PART, status == 206);
    }
    strl__range range;
    const strl__conditions part = {.range = "bytes=0-9"};
    assert_int_equal(strl__decide(&part, &fresh, false, &range), 200);
    strl__validators young = fresh;
    young.date_is_strong = false;
    const strl__conditions dated = {.if_range = EXACT, .range = "bytes=0-9"};
    assert_int_equal(strl__decide(&dated, &young, true, &range), 200);
}

static void who_wants_json_says_so(void **state)
{
    (void)state;
    assert_true(strl__prefers_json("application/json"));
    assert_true(strl__prefers_json("text/plain, application/json;q=0.5"));
    assert_false(strl__prefers_json("text/html,application/json"));
    assert_false(strl__prefers_json("application/json;q=0"));
    assert_false(strl__prefers_json("application/json;q=0.000"));
    assert_false(strl__prefers_json("application/jsonx"));
    assert_false(strl__prefers_json("*/*"));
    assert_false(strl__prefers_json(""));
    assert_false(strl__prefers_json(NULL));
}

static void names_of_lines_are_tokens(void **state)
{
    (void)state;
    assert_true(strl__is_token("X-a_1!"));
    static const char *const none[] = {"", "a b", "a\t", "Content-Length ", "a:b", "\xc3\xa4", "a\x01"};
    for (size_t i = 0; i < COUNT_OF(none); i++)
        assert_false(strl__is_token(none[i]));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_target_names_a_file_or_a_folder),
        cmocka_unit_test(a_target_that_leads_elsewhere_is_refused),
        cmocka_unit_test(a_path_may_be_as_long_as_is_said),
        cmocka_unit_test(a_query_asks_for_nodes),
        cmocka_unit_test(a_query_that_is_none_is_refused),
        cmocka_unit_test(a_query_may_ask_for_as_many_nodes_as_is_said),
        cmocka_unit_test(a_range_is_cut_to_the_file),
        cmocka_unit_test(tags_are_compared_as_they_stand),
        cmocka_unit_test(dates_go_there_and_back),
        cmocka_unit_test(all_three_forms_of_a_date_are_read),
        cmocka_unit_test(conditions_come_before_ranges),
        cmocka_unit_test(who_wants_json_says_so),
        cmocka_unit_test(names_of_lines_are_tokens),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
