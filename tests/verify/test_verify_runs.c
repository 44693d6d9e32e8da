/* What a file says of runs of placements is proved: each planted lie, under right checksums, is found. */
#include "verify/planted.h"

#include "base/cursor.h"
#include "container/reseal.h"

#define COPIES 1200u      /* three pages */
#define ITEMS (4 + 4 * 3) /* where the first run's item lies in the only leaf of their table */

static model sheet;
static uint8_t *good, *bytes;
static size_t size;

static int make_model(void **state)
{
    (void)state;
    model_setup(&sheet, 12, 12, false);
    sheet.copies = COPIES;
    return 0;
}

static int drop_model(void **state)
{
    (void)state;
    free(good);
    free(bytes);
    model_teardown(&sheet);
    return 0;
}

static void no_fault(void *context, uint32_t id, strl_node *record, strl_pm *mesh, strl_arena *arena)
{
    (void)context, (void)id, (void)record, (void)mesh, (void)arena;
}

static strl_verify_report check_file(void)
{
    strl_error err = {0};
    strl_verify_report report;
    const strl_verify_desc desc = {.model = sheet.bad, .memory_bytes = 256u << 20, .jobs = 2, .cuts = 4};
    model__check(strl_verify_run(&desc, &report, &err), &err);
    return report;
}

static void copies_of_a_sound_tree_are_sound(void **state)
{
    (void)state;
    model_plant(&sheet, no_fault, NULL);
    strl_verify_report report = check_file();
    for (unsigned kind = 0; kind < STRL_VERIFY_KINDS; kind++)
        if (report.checks[kind].failures &&
            kind != STRL_VERIFY_COUNTS) /* the tree's triangles were counted by nobody */
            fail_msg("%s: %s", strl_verify_name((strl_verify_kind)kind), report.checks[kind].first);
    assert_true(report.checks[STRL_VERIFY_TABLES].count > COPIES);
    strl_verify_report_deinit(&report);
    FILE *file = fopen(sheet.bad, "rb");
    assert_non_null(file);
    size = (size_t)(fseek(file, 0, SEEK_END), ftell(file));
    rewind(file);
    good = malloc(size), bytes = malloc(size);
    assert_true(good && bytes && fread(good, 1, size, file) == size);
    fclose(file);
}

static uint64_t section_offset(unsigned number)
{
    return strl__load_le(good + STRL__AT_SECTIONS + (size_t)number * STRL__SECTION_BYTES + 16, 8);
}

/* Changes a number of the file and looks for a sentence. */
static void expect(uint64_t at, unsigned width, uint64_t value, const char *sentence)
{
    memcpy(bytes, good, size);
    strl__store_le(bytes + at, width, value);
    reseal_all(bytes, size, NULL, NULL);
    FILE *file = fopen(sheet.bad, "wb");
    assert_true(file && fwrite(bytes, 1, size, file) == size && fclose(file) == 0);
    strl_verify_report report = check_file();
    assert_false(report.ok);
    const strl_verify_check *tables = &report.checks[STRL_VERIFY_TABLES], *header = &report.checks[STRL_VERIFY_HEADER];
    if (!strstr(tables->first, sentence) && !strstr(header->first, sentence))
        fail_msg("%s: found %s, %s", sentence, tables->first, header->first);
    strl_verify_report_deinit(&report);
}

static uint64_t bits_of(double number)
{
    uint64_t bits;
    memcpy(&bits, &number, 8);
    return bits;
}

static uint32_t bits_of_float(float number)
{
    uint32_t bits;
    memcpy(&bits, &number, 4);
    return bits;
}

static double number_at(uint64_t at)
{
    uint64_t bits = strl__load_le(good + at, 8);
    double number;
    memcpy(&number, &bits, 8);
    return number;
}

static void each_lie_about_a_run_is_found(void **state)
{
    (void)state;
    const uint64_t runs = section_offset(4) + ITEMS, placements = section_offset(1);
    uint32_t area_bits = (uint32_t)strl__load_le(good + runs + 80 + 48, 4);
    float area;
    memcpy(&area, &area_bits, 4);
    assert_true(area > 1);
    for (unsigned i = 0; i < 3; i++) {
        expect(runs + 8 * i, 8, bits_of(number_at(runs + 8 * i) + 0.001), "of its box is");
        expect(runs + 80 + 24 + 8 * i, 8, bits_of(number_at(runs + 80 + 24 + 8 * i) - 0.001), "of its box is");
    }
    expect(runs + 160 + 24, 8, bits_of(1e9), "of its box is");
    expect(runs + 8, 8, bits_of(NAN), "its box is not finite or upside down");
    expect(runs + 80 + 48, 4, bits_of_float(area * 1.001f), "its area is said to be");
    expect(runs + 80 + 48, 4, bits_of_float(area * 0.999f), "its area is said to be");
    expect(runs + 80 + 48, 4, bits_of_float(-1), "area -1");
    expect(runs + 58, 2, 1024, "1024 of its normal");
    /* The second page's place where the first one's should be: both are sound pages of 512. */
    expect(runs + 64, 8, strl__load_le(good + runs + 80 + 64, 8), "its page is said to be");
    expect(STRL__AT_SECTIONS + 4 * STRL__SECTION_BYTES + 8, 8, 2, "runs of 1200 placements, expected 3");
    /* Index page: 8 bytes, then references of 32; the second begins with placement 512. */
    expect(placements + 8 + 32 + 8, 8, 511, "page");
}

/* A placement that is another one than its run was made of. */
static void a_placement_outside_of_its_run_is_found(void **state)
{
    (void)state;
    const uint64_t runs = section_offset(4) + ITEMS, page = strl__load_le(good + runs + 64, 8),
                   first = page + 4 + 4 * 512;
    expect(first + 8 + 56, 8, bits_of(500), "of its box is");
    expect(first + 8 + 80, 8, bits_of(4), "");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(copies_of_a_sound_tree_are_sound),
        cmocka_unit_test(each_lie_about_a_run_is_found),
        cmocka_unit_test(a_placement_outside_of_its_run_is_found),
    };
    return cmocka_run_group_tests(tests, make_model, drop_model);
}
