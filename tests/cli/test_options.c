#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "cli/options.h"
#include "cli/progress.h"

typedef struct values {
    bool json, realtime, smooth;
    uint64_t memory_bytes, jobs;
    double error_px, rate;
    uint32_t size[2];
    int structure;
    const char *out;
    strl_cli_list against, inputs;
    bool quiet;
} values;

enum { WORDS_MOST = 16 };

/* Parses a command line written with spaces. Usage errors go to the test's standard error. */
static int parse(values *values_out, const char *line)
{
    static char text[256];
    static char *argv[WORDS_MOST], *words[WORDS_MOST];
    values *v = values_out;
    *v = (values){.memory_bytes = 77, .error_px = 1};
    const strl_cli_option options[] = {
        {.name = "json", .letter = 'j', .kind = STRL_CLI_FLAG, .value = &v->json, .help = "one object"},
        {.name = "smooth", .letter = 's', .kind = STRL_CLI_FLAG, .value = &v->smooth, .help = "smooth"},
        {.name = "memory", .letter = 'm', .kind = STRL_CLI_BYTES, .value = &v->memory_bytes, .help = "bytes"},
        {.name = "jobs", .kind = STRL_CLI_COUNT, .value = &v->jobs, .help = "threads", .least = 1, .most = 64},
        {.name = "error", .letter = 'e', .kind = STRL_CLI_REAL, .value = &v->error_px, .help = "pixels"},
        {.name = "realtime",
         .kind = STRL_CLI_REAL,
         .value = &v->rate,
         .given = &v->realtime,
         .value_optional = true,
         .help = "rate"},
        {.name = "size", .kind = STRL_CLI_SIZE, .value = v->size, .help = "pixels"},
        {.name = "structure",
         .kind = STRL_CLI_ENUM,
         .value = &v->structure,
         .argument = "clusters|hlod|samples",
         .help = "structure"},
        {.name = "output", .letter = 'o', .kind = STRL_CLI_STRING, .value = &v->out, .help = "file", .required = true},
        {.name = "against", .kind = STRL_CLI_LIST, .value = &v->against, .help = "inputs"},
    };
    const strl_cli_usage usage = {.positional = "INPUT...",
                                  .least = 1,
                                  .most = 2,
                                  .options = options,
                                  .option_count = STRL_CLI_COUNT_OF(options)};
    strl_cli_args args = {.command = "test", .summary = "tests", .argv = argv, .words = words};
    snprintf(text, sizeof text, "%s", line);
    for (char *word = strtok(text, " "); word; word = strtok(NULL, " "))
        argv[args.argc++] = word;
    int stop = strl_cli_parse(&args, &usage, &v->inputs);
    v->quiet = args.quiet;
    return stop;
}

static void options_and_words_may_come_in_any_order(void **state)
{
    (void)state;
    values v;
    assert_int_equal(parse(&v, "a -o x --json b --memory=2G -q"), -1);
    assert_int_equal(v.inputs.count, 2);
    assert_string_equal(v.inputs.items[0], "a");
    assert_string_equal(v.inputs.items[1], "b");
    assert_string_equal(v.out, "x");
    assert_true(v.json && v.quiet);
    assert_true(v.memory_bytes == (uint64_t)2 << 30);
}

static void what_is_not_given_keeps_its_default(void **state)
{
    (void)state;
    values v;
    assert_int_equal(parse(&v, "-o x a"), -1);
    assert_true(v.memory_bytes == 77 && v.error_px == 1 && !v.json && !v.quiet && !v.realtime);
}

static void short_flags_join_and_take_joined_values(void **state)
{
    (void)state;
    values v;
    assert_int_equal(parse(&v, "-jsm512K -e -2.5 a -ox"), -1);
    assert_true(v.json && v.smooth && v.memory_bytes == 512 << 10 && v.error_px == -2.5);
    assert_string_equal(v.out, "x");
}

static void two_dashes_end_the_options(void **state)
{
    (void)state;
    values v;
    assert_int_equal(parse(&v, "-o x -- --json -"), -1);
    assert_int_equal(v.inputs.count, 2);
    assert_string_equal(v.inputs.items[0], "--json");
    assert_string_equal(v.inputs.items[1], "-");
}

static void a_list_ends_at_the_next_option(void **state)
{
    (void)state;
    values v;
    assert_int_equal(parse(&v, "--against p q --json m n -o x"), -1);
    assert_int_equal(v.against.count, 2);
    assert_string_equal(v.against.items[0], "p");
    assert_string_equal(v.against.items[1], "q");
    assert_string_equal(v.inputs.items[0], "m");
    assert_string_equal(v.inputs.items[1], "n");
    assert_int_equal(parse(&v, "a -o x --against --json"), 2);
}

static void an_optional_value_is_taken_only_where_it_is_a_number(void **state)
{
    (void)state;
    values v;
    assert_int_equal(parse(&v, "-o x --realtime a"), -1);
    assert_true(v.realtime && v.rate == 0 && v.inputs.count == 1);
    assert_int_equal(parse(&v, "-o x --realtime 30 a"), -1);
    assert_true(v.realtime && v.rate == 30 && v.inputs.count == 1);
}

static void enums_and_sizes_are_read(void **state)
{
    (void)state;
    values v;
    assert_int_equal(parse(&v, "a -o x --structure samples --size 1280x720"), -1);
    assert_int_equal(v.structure, 2);
    assert_true(v.size[0] == 1280 && v.size[1] == 720);
}

static void wrong_usage_stops_with_2(void **state)
{
    (void)state;
    static const char *const lines[] = {
        "-o x",
        "a",
        "a b c -o x",
        "a -o",
        "a -o x --nothing",
        "a -o x -z",
        "a -o x --memory",
        "a -o x --memory 1Q",
        "a -o x --memory -1",
        "a -o x --memory 99999999999G",
        "a -o x --jobs 0",
        "a -o x --jobs 65",
        "a -o x --jobs 2.x",
        "a -o x --jobs 1.5",
        "a -o x --error nan",
        "a -o x --error 1x",
        "a -o x --size 1280",
        "a -o x --size 0x5",
        "a -o x --size 5x20000",
        "a -o x --structure hl",
        "a -o x --structure |",
        "a -o x --json=1",
        "a -o x -o y",
        "a -o x --out y",
    };
    for (size_t i = 0; i < STRL_CLI_COUNT_OF(lines); i++) {
        values v;
        if (parse(&v, lines[i]) != 2)
            fail_msg("accepted: %s", lines[i]);
    }
}

static void help_stops_with_0_even_where_words_are_missing(void **state)
{
    (void)state;
    values v;
    assert_int_equal(parse(&v, "--help"), 0);
    assert_int_equal(parse(&v, "a -h"), 0);
}

static void suffixes_are_powers_of_1000_or_1024(void **state)
{
    (void)state;
    uint64_t value = 0;
    assert_true(strl_cli_read_scaled("2M", 1000, &value) && value == 2000000);
    assert_true(strl_cli_read_scaled("2m", 1024, &value) && value == 2 << 20);
    assert_true(strl_cli_read_scaled("1.5G", 1024, &value) && value == 1536u << 20);
    assert_true(strl_cli_read_scaled("0.25K", 1000, &value) && value == 250);
    assert_true(strl_cli_read_scaled("18446744073709551615", 1000, &value) && value == UINT64_MAX);
    assert_false(strl_cli_read_scaled("18446744073709551616", 1000, &value));
    assert_false(strl_cli_read_scaled("18446744073709552K", 1000, &value));
    assert_false(strl_cli_read_scaled("", 1000, &value));
    assert_false(strl_cli_read_scaled(" 1", 1000, &value));
    assert_false(strl_cli_read_scaled("1.2.3", 1000, &value));
    assert_true(strl_cli_read_scaled("2.3M", 1000, &value) && value == 2300000);
    assert_true(strl_cli_read_scaled("2.0", 1000, &value) && value == 2);
    assert_true(strl_cli_read_scaled("1.3G", 1024, &value) && value == 1395864371);
    assert_false(strl_cli_read_scaled("1.5", 1000, &value));
    assert_false(strl_cli_read_scaled("1.5", 1024, &value));
    assert_false(strl_cli_read_scaled("1.2345K", 1000, &value));
    assert_false(strl_cli_read_scaled("1KK", 1000, &value));
}

static void the_progress_line_states_share_rate_and_time_left(void **state)
{
    (void)state;
    char text[128];
    strl_cli_progress_format(text, sizeof text, "sort", 2500000, 10000000, "triangles", 5, 120);
    assert_non_null(strstr(text, "sort"));
    assert_non_null(strstr(text, " 25 %"));
    assert_non_null(strstr(text, "500 K triangles/s"));
    assert_non_null(strstr(text, "left 0:15"));
    strl_cli_progress_format(text, sizeof text, "sort", 2500000, 10000000, "triangles", 5, 10);
    assert_int_equal(strlen(text), 10);
    strl_cli_progress_format(text, sizeof text, "read", 0, 0, "bytes", 0, 120);
    assert_string_equal(text, "read  0 bytes");
    strl_cli_progress_format(text, sizeof text, "read", 3000, 0, "bytes", 2, 120);
    assert_string_equal(text, "read  3.00 K bytes  1.50 K/s");
}

static void a_stage_that_has_just_begun_states_no_rate(void **state)
{
    (void)state;
    char text[128];
    strl_cli_progress_format(text, sizeof text, "sort", 0, 10, "items", 3, 120);
    assert_string_equal(text, "sort         [------------------------------]   0 %");
    strl_cli_progress_format(text, sizeof text, "sort", 10, 10, "items", 0.001, 120);
    assert_string_equal(text, "sort         [##############################] 100 %");
    strl_cli_progress_format(text, sizeof text, "sort", 5, 10, "items", 1, 120);
    assert_string_equal(text, "sort         [###############---------------]  50 %  5 items/s  left 0:01");
}

static void progress_is_silent_where_nobody_reads_it(void **state)
{
    (void)state;
    strl_cli_progress progress;
    strl_cli_progress_init(&progress, true);
    assert_false(progress.shown);
    strl_cli_progress_update(&progress, "sort", 1, 2, "triangles");
    assert_false(progress.drawn);
    strl_cli_progress_end(&progress);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(options_and_words_may_come_in_any_order),
        cmocka_unit_test(what_is_not_given_keeps_its_default),
        cmocka_unit_test(short_flags_join_and_take_joined_values),
        cmocka_unit_test(two_dashes_end_the_options),
        cmocka_unit_test(a_list_ends_at_the_next_option),
        cmocka_unit_test(an_optional_value_is_taken_only_where_it_is_a_number),
        cmocka_unit_test(enums_and_sizes_are_read),
        cmocka_unit_test(wrong_usage_stops_with_2),
        cmocka_unit_test(help_stops_with_0_even_where_words_are_missing),
        cmocka_unit_test(suffixes_are_powers_of_1000_or_1024),
        cmocka_unit_test(the_progress_line_states_share_rate_and_time_left),
        cmocka_unit_test(a_stage_that_has_just_begun_states_no_rate),
        cmocka_unit_test(progress_is_silent_where_nobody_reads_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
