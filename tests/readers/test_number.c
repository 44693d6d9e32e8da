#include <locale.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "base/hash.h"
#include "readers/number.h"

static void assert_like_strtod(const char *text)
{
    double value = -1;
    const char *after = strl__number_parse(text, &value);
    double expected = strtod(text, NULL);
    if (!after || *after)
        fail_msg("'%s' was not read whole", text);
    if (memcmp(&value, &expected, sizeof value) != 0)
        fail_msg("'%s' was read as %.17g, not %.17g", text, value, expected);
}

static void every_form_is_read_like_strtod(void **state)
{
    (void)state;
    static const char *const texts[] = {
        "0",
        "-0",
        "+1",
        "1.",
        ".5",
        "-.5e1",
        "007",
        "1e5",
        "1E+05",
        "1e-5",
        "123456789012345678901234567890",
        "0.000000000000000000000000000001",
        "9007199254740993",
        "9007199254740992",
        "9007199254740995",
        "1e22",
        "1e23",
        "8.5e-27",
        "1e308",
        "1.7976931348623157e308",
        "1e309",
        "-1e400",
        "4.9e-324",
        "2e-324",
        "1e-400",
        "2.2250738585072011e-308",
        "18446744073709551615",
        "18446744073709551616",
        "9999999999999999999",
        "1e99999999999",
        "1e-99999999999",
        "0.30000000000000004",
        "93.87400100000001",
        "0.00012345678901234567",
        "0e999999",
        "1e+0000000000000000000001",
    };
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
        assert_like_strtod(texts[i]);
}

static void random_doubles_survive_all_usual_notations(void **state)
{
    (void)state;
    static const char *const formats[] = {"%.17g", "%.9g", "%.6f", "%e", "%.15g", "%g", "%.12f"};
    char text[512];
    for (uint64_t i = 1; i < 30000; i++) {
        double value = (double)(int64_t)strl__mix64(i) * ldexp(1, (int)(strl__mix64(~i) % 160) - 140);
        snprintf(text, sizeof text, formats[i % 7], value);
        assert_like_strtod(text);
        snprintf(text, sizeof text, "%llu.%llue%d", (unsigned long long)(strl__mix64(3 * i) >> (i % 64)),
                 (unsigned long long)(strl__mix64(5 * i) >> (i % 61)), (int)(i % 60) - 30);
        assert_like_strtod(text);
    }
}

static void the_locale_does_not_matter(void **state)
{
    (void)state;
    static const char *const names[] = {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8", "de_DE"};
    bool found = false;
    for (size_t i = 0; i < sizeof names / sizeof *names && !found; i++)
        found = setlocale(LC_NUMERIC, names[i]) != NULL;
    double short_road, long_road;
    const char *after_short = strl__number_parse("1.5", &short_road);
    const char *after_long = strl__number_parse("1.50000000000000000000000000000000000e0", &long_road);
    setlocale(LC_NUMERIC, "C");
    assert_true(*after_short == 0 && *after_long == 0);
    assert_true(short_road == 1.5 && long_road == 1.5);
    if (!found)
        skip(); /* no locale with a decimal comma is installed */
}

static void words_for_what_is_not_finite_are_read(void **state)
{
    (void)state;
    static const char *const nans[] = {"nan",        "NaN",     "-nan",    "nan(ind)",
                                       "-nan(snan)", "1.#QNAN", "-1.#IND", "1.#IND00"};
    static const char *const infinities[] = {"inf", "-INF", "+Infinity", "1.#INF", "-1.#INF00"};
    double value;
    for (size_t i = 0; i < sizeof nans / sizeof *nans; i++) {
        const char *after = strl__number_parse(nans[i], &value);
        assert_true(after && *after == 0 && value != value);
    }
    for (size_t i = 0; i < sizeof infinities / sizeof *infinities; i++) {
        const char *after = strl__number_parse(infinities[i], &value);
        assert_true(after && *after == 0 && isinf(value) && (value < 0) == (infinities[i][0] == '-'));
    }
}

static void what_is_no_number_is_refused(void **state)
{
    (void)state;
    static const char *const texts[] = {"",    "-", "+",   ".",  "-.", "e5",   ".e5", "1e",
                                        "1e+", "x", "--1", "in", "na", "1.#x", "#"};
    double value;
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
        if (strl__number_parse(texts[i], &value))
            fail_msg("'%s' was taken for a number", texts[i]);
    const char *after = strl__number_parse("1,5", &value);
    assert_true(value == 1 && *after == ',');
    after = strl__number_parse("0x10", &value);
    assert_true(value == 0 && *after == 'x');
}

static void integers_are_read_up_to_eighteen_digits(void **state)
{
    (void)state;
    int64_t value;
    assert_true(*strl__integer_parse("-42/", &value) == '/' && value == -42);
    assert_true(*strl__integer_parse("+7 ", &value) == ' ' && value == 7);
    assert_true(*strl__integer_parse("0000000000000000000000000001", &value) == 0 && value == 1);
    assert_true(*strl__integer_parse("0", &value) == 0 && value == 0);
    assert_true(*strl__integer_parse("999999999999999999", &value) == 0 && value == 999999999999999999);
    assert_null(strl__integer_parse("1000000000000000000", &value));
    assert_null(strl__integer_parse("", &value));
    assert_null(strl__integer_parse("-", &value));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_form_is_read_like_strtod), cmocka_unit_test(random_doubles_survive_all_usual_notations),
        cmocka_unit_test(the_locale_does_not_matter),     cmocka_unit_test(words_for_what_is_not_finite_are_read),
        cmocka_unit_test(what_is_no_number_is_refused),   cmocka_unit_test(integers_are_read_up_to_eighteen_digits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
