/* What is read of a server's answer, and what is made of it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "source/http_answer.h"

static strl__http_fields parse(const char *const *lines)
{
    strl__http_fields fields = {0};
    for (; *lines; lines++)
        strl__http_fields_line(&fields, *lines, strlen(*lines));
    return fields;
}

static void the_fields_of_a_good_answer_are_read_in_any_case_and_spacing(void **state)
{
    (void)state;
    const char *const lines[] = {"HTTP/1.1 206 Partial Content\r\n",
                                 "CONTENT-RANGE:bytes 0-4095/123456\r\n",
                                 "etag:   \"abc-1\"  \r\n",
                                 "Last-Modified: Sun, 06 Nov 1994 08:49:37 GMT\r\n",
                                 "Content-Encoding: Identity\r\n",
                                 "\r\n",
                                 NULL};
    strl__http_fields fields = parse(lines);
    assert_int_equal(fields.status, 206);
    assert_true(fields.range_known);
    assert_int_equal(fields.first, 0);
    assert_int_equal(fields.last, 4095);
    assert_int_equal(fields.identity.total, 123456);
    assert_string_equal(fields.identity.etag, "\"abc-1\"");
    assert_string_equal(fields.identity.modified, "Sun, 06 Nov 1994 08:49:37 GMT");
    assert_string_equal(fields.encoding, "");
}

static void a_status_line_forgets_the_answer_before_it(void **state)
{
    (void)state;
    const char *const lines[] = {"HTTP/1.1 302 Found", "Content-Range: bytes 0-1/2",
                                 "ETag: \"a\"",        "Content-Encoding: gzip",
                                 "HTTP/2 206",         NULL};
    strl__http_fields fields = parse(lines);
    assert_int_equal(fields.status, 206);
    assert_int_equal(fields.identity.total, 0);
    assert_string_equal(fields.identity.etag, "");
    assert_string_equal(fields.encoding, "");
}

static void ranges_that_contradict_themselves_are_not_known(void **state)
{
    (void)state;
    static const char *const wrong[] = {"",
                                        "bytes",
                                        "bytes ",
                                        "bytes 0-1",
                                        "bytes 0-1/*",
                                        "bytes 5-4/10",
                                        "bytes 0-10/10",
                                        "bytes -1-5/10",
                                        "bytes 0-1/10 ",
                                        "bytes 0 - 1/10",
                                        "items 0-1/10",
                                        "bytes 0-1/10,bytes 2-3/10",
                                        "bytes 0-1/99999999999999999999",
                                        "bytes 0-18446744073709551616/18446744073709551617",
                                        "bytes 0x0-1/10",
                                        "bytes 0-1/",
                                        "bytes /10",
                                        "bytes */x",
                                        "bytes 0-0/0"};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        strl__http_fields fields = {0};
        bool trimmed_good = strcmp(wrong[i], "bytes 0-1/10 ") == 0; /* the end of a line is no part of it */
        assert_int_equal(strl__http_parse_range(wrong[i], strlen(wrong[i]), &fields), trimmed_good);
        assert_int_equal(fields.range_known, trimmed_good);
    }
    strl__http_fields fields = {0};
    assert_false(strl__http_parse_range("bytes */77", 10, &fields));
    assert_false(fields.range_known);
    assert_int_equal(fields.identity.total, 77);
}

static void only_strong_entity_tags_that_can_be_sent_back_are_taken(void **state)
{
    (void)state;
    char tag[16];
    assert_true(strl__http_parse_etag("\"\"", 2, tag, sizeof tag));
    assert_string_equal(tag, "\"\"");
    static const char *const wrong[] = {
        "W/\"a\"", "a", "\"a", "\"", "\"a\"b\"", "\"a b\"", "\"a\nb\"", "\"0123456789abcdef\"", ""};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        assert_false(strl__http_parse_etag(wrong[i], strlen(wrong[i]), tag, sizeof tag));
        assert_string_equal(tag, "");
    }
}

static void the_length_of_a_header_is_counted_whatever_is_in_it(void **state)
{
    (void)state;
    strl__http_fields fields = {0};
    for (unsigned i = 0; i < 100; i++)
        strl__http_fields_line(&fields, "no colon at all", 15);
    assert_int_equal(fields.bytes, 1500);
}

/* ---- verdicts */

static const strl__http_asked asked = {
    .first = 100, .last = 199, .identity = {.total = 1000, .etag = "\"a\"", .modified = "then"}};

static strl__http_fields good_answer(void)
{
    return (strl__http_fields){.status = 206,
                               .range_known = true,
                               .first = 100,
                               .last = 199,
                               .identity = {.total = 1000, .etag = "\"a\"", .modified = "then"}};
}

static void check(const strl__http_asked *to, const strl__http_fields *answer, strl__http_verdict verdict,
                  const char *words)
{
    strl_error err = {0};
    assert_int_equal(strl__http_judge(to, answer, &err), verdict);
    if (!strstr(err.message, words))
        fail_msg("\"%s\" lacks \"%s\"", err.message, words);
    assert_true(verdict == STRL__HTTP_GOOD || err.status == STRL_ERR_NETWORK);
}

static void what_was_asked_for_is_good(void **state)
{
    (void)state;
    strl__http_fields answer = good_answer();
    check(&asked, &answer, STRL__HTTP_GOOD, "");
    answer.identity.etag[0] = answer.identity.modified[0] = 0; /* a server need not repeat itself */
    check(&asked, &answer, STRL__HTTP_GOOD, "");
}

static void another_content_is_recognised_by_each_of_its_marks(void **state)
{
    (void)state;
    strl__http_fields answer = good_answer();
    answer.identity.total = 1001;
    check(&asked, &answer, STRL__HTTP_CHANGED, "has changed since it was opened: open it again");
    answer = good_answer();
    strcpy(answer.identity.etag, "\"b\"");
    check(&asked, &answer, STRL__HTTP_CHANGED, "has changed");
    strl__http_asked without_tag = asked;
    without_tag.identity.etag[0] = 0;
    answer = good_answer();
    check(&without_tag, &answer, STRL__HTTP_GOOD, "");
    strcpy(answer.identity.modified, "now");
    check(&without_tag, &answer, STRL__HTTP_CHANGED, "has changed");
    answer = (strl__http_fields){.status = 412};
    check(&asked, &answer, STRL__HTTP_CHANGED, "has changed");
    answer.status = 416;
    check(&asked, &answer, STRL__HTTP_CHANGED, "has changed");
}

static void wrong_answers_are_told_apart(void **state)
{
    (void)state;
    strl__http_fields answer = good_answer();
    answer.first = 101;
    check(&asked, &answer, STRL__HTTP_AGAIN, "bytes 101 to 199, expected 100 to 199");
    answer = good_answer();
    answer.range_known = false;
    check(&asked, &answer, STRL__HTTP_AGAIN, "does not say which range");
    answer = good_answer();
    strcpy(answer.encoding, "gzip");
    check(&asked, &answer, STRL__HTTP_REFUSED, "gzip");
    static const struct {
        unsigned status;
        strl__http_verdict verdict, redirected;
        const char *words;
    } cases[] = {{0, STRL__HTTP_AGAIN, STRL__HTTP_AGAIN, "does not speak HTTP"},
                 {200, STRL__HTTP_REFUSED, STRL__HTTP_REFUSED, "does not answer byte ranges"},
                 {404, STRL__HTTP_REFUSED, STRL__HTTP_MOVED, "nothing at this address (404)"},
                 {403, STRL__HTTP_REFUSED, STRL__HTTP_MOVED, "refuses access (403)"},
                 {400, STRL__HTTP_REFUSED, STRL__HTTP_REFUSED, "(400)"},
                 {429, STRL__HTTP_AGAIN, STRL__HTTP_AGAIN, "too often (429)"},
                 {500, STRL__HTTP_AGAIN, STRL__HTTP_AGAIN, "failed (500)"},
                 {503, STRL__HTTP_AGAIN, STRL__HTTP_AGAIN, "failed (503)"}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        strl__http_asked redirected = asked;
        redirected.redirected = true;
        answer = (strl__http_fields){.status = cases[i].status};
        check(&asked, &answer, cases[i].verdict, cases[i].words);
        check(&redirected, &answer, cases[i].redirected, cases[i].words);
    }
}

static void the_first_answer_may_be_shorter_but_must_say_what_it_is(void **state)
{
    (void)state;
    const strl__http_asked opening = {.first = 0, .last = 4095, .opening = true};
    strl__http_fields answer = {.status = 206, .range_known = true, .first = 0, .last = 99, .identity = {.total = 100}};
    check(&opening, &answer, STRL__HTTP_GOOD, "");
    answer.identity.total = 101;
    check(&opening, &answer, STRL__HTTP_AGAIN, "bytes 0 to 99, expected 0 to 100");
    answer.range_known = false;
    check(&opening, &answer, STRL__HTTP_REFUSED, "does not say which range");
    answer = (strl__http_fields){.status = 416};
    check(&opening, &answer, STRL__HTTP_REFUSED, "empty");
    answer.status = 412;
    check(&opening, &answer, STRL__HTTP_REFUSED, "(412)");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_fields_of_a_good_answer_are_read_in_any_case_and_spacing),
        cmocka_unit_test(a_status_line_forgets_the_answer_before_it),
        cmocka_unit_test(ranges_that_contradict_themselves_are_not_known),
        cmocka_unit_test(only_strong_entity_tags_that_can_be_sent_back_are_taken),
        cmocka_unit_test(the_length_of_a_header_is_counted_whatever_is_in_it),
        cmocka_unit_test(what_was_asked_for_is_good),
        cmocka_unit_test(another_content_is_recognised_by_each_of_its_marks),
        cmocka_unit_test(wrong_answers_are_told_apart),
        cmocka_unit_test(the_first_answer_may_be_shorter_but_must_say_what_it_is),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
