/* Containers that are cut, damaged or lie: each is refused with a sentence, none makes the reader crash, hang or take
 * memory that the file does not pay for. The committed files are in golden/; STRL_UPDATE_GOLDEN=1 writes them anew,
 * which only a change of the format justifies: look at what has changed before committing it. */
#include "fixture.h"

#include <inttypes.h>
#include <jansson.h>

#include "container/layout.h"
#include "reseal.h"

static void assert_ok(strl_status status, const strl_error *err)
{
    if (status != STRL_OK)
        fail_msg("%s", err->message);
}

static void golden_path(char path[512], const char *name)
{
    const char *root = getenv("STRL_TEST_ROOT");
    snprintf(path, 512, "%s/tests/container/golden/%s", root ? root : ".", name);
}

static uint8_t *make_copies(uint32_t levels, uint32_t copies, size_t *size)
{
    fixture self;
    strl_error err;
    fixture_setup(&self, levels, 3);
    self.copies = copies;
    assert_ok(fixture_write(&self, &err), &err);
    uint8_t *bytes = fixture_load(self.path, size);
    fixture_teardown(&self);
    return bytes;
}

static uint8_t *make_container(uint32_t levels, size_t *size)
{
    return make_copies(levels, 0, size);
}

/* One placement more than a page holds. */
static uint8_t *container_of_runs(size_t *size)
{
    return make_copies(1, STRL_RUN_PLACEMENTS, size);
}

static uint8_t *small_container(size_t *size)
{
    return make_container(2, size);
}

static void assert_refused(const uint8_t *bytes, size_t size)
{
    strl_error err = {0};
    uint64_t digest;
    strl_status status = fixture_try(bytes, size, &digest, &err);
    assert_true(status == STRL_ERR_FORMAT || status == STRL_ERR_UNSUPPORTED);
    assert_true(err.status == status && err.message[0]);
}

static void a_file_cut_at_any_byte_is_refused(void **state)
{
    (void)state;
    size_t size;
    uint8_t *bytes = small_container(&size);
    for (size_t cut = 0; cut < size; cut++) {
        uint8_t *copy = malloc(cut + 1); /* of its own, so that the sanitizer sees a read past the cut */
        assert_non_null(copy);
        memcpy(copy, bytes, cut);
        assert_refused(copy, cut);
        free(copy);
    }
    free(bytes);
}

/* Says it has all its bytes, as a file does that is cut while it is open. */
typedef struct cut_source {
    strl_source base;
    const uint8_t *bytes;
    size_t cut;
} cut_source;

static strl_status cut_read(strl_source *source, uint64_t offset, void *data, size_t size, strl_error *err)
{
    const cut_source *self = (const cut_source *)source;
    if (offset + size > self->cut) {
        *err = (strl_error){STRL_ERR_IO, "the wire is cut"};
        return STRL_ERR_IO;
    }
    memcpy(data, self->bytes + offset, size);
    return STRL_OK;
}

static void cut_close(strl_source *source)
{
    free(source);
}

static void a_source_that_ends_early_gives_its_own_sentence(void **state)
{
    (void)state;
    static const strl_source_class klass = {.kind = "cut", .read = cut_read, .close = cut_close};
    size_t size;
    uint8_t *bytes = small_container(&size);
    for (size_t cut = 0; cut < size; cut++) {
        cut_source *source = calloc(1, sizeof *source);
        assert_non_null(source);
        *source = (cut_source){{.klass = &klass, .bytes = size}, bytes, cut};
        strl_container *container;
        strl_error err = {0};
        uint64_t digest;
        strl_status status = strl_container_open(&source->base, &container, &err);
        if (status == STRL_OK)
            status = fixture_read_all(container, &digest, &err);
        assert_int_equal(status, STRL_ERR_IO);
        assert_string_equal(err.message, "the wire is cut");
        strl_container_close(container);
    }
    free(bytes);
}

static void mark_piece(void *context, uint64_t offset, uint32_t bytes)
{
    memset((uint8_t *)context + offset, 1, bytes);
}

static void a_flipped_byte_is_detected_wherever_it_means_something(void **state)
{
    (void)state;
    size_t size, silent = 0;
    uint8_t *bytes = small_container(&size);
    uint8_t *meaningful = calloc(size, 1), *copy = malloc(size);
    assert_true(meaningful && copy);
    memset(meaningful, 1, STRL__HEADER_BYTES);
    memcpy(copy, bytes, size);
    reseal_all(copy, size, mark_piece, meaningful);
    assert_memory_equal(copy, bytes, size); /* sealed it was */
    uint64_t whole, digest;
    strl_error err;
    assert_ok(fixture_try(bytes, size, &whole, &err), &err);
    for (size_t at = 0; at < size; at++) {
        for (int flip = 1; flip < 256; flip += 254) {
            copy[at] = (uint8_t)(bytes[at] ^ flip);
            if (meaningful[at]) {
                assert_refused(copy, size);
            } else {
                assert_ok(fixture_try(copy, size, &digest, &err), &err);
                assert_true(digest == whole);
                silent++;
            }
        }
        copy[at] = bytes[at];
    }
    assert_true(silent < size / 4);
    free(copy);
    free(meaningful);
    free(bytes);
}

/* Behind right checksums the checks of every field are on their own: whatever they let pass must be harmless. */
static void a_flipped_byte_under_right_checksums_never_crashes(void **state)
{
    (void)state;
    size_t size, refused = 0;
    uint8_t *bytes = small_container(&size), *copy = malloc(size);
    assert_non_null(copy);
    for (size_t at = 0; at < size; at++)
        for (int flip = 1; flip < 256; flip += 127) {
            memcpy(copy, bytes, size);
            copy[at] = (uint8_t)(copy[at] ^ flip);
            reseal_all(copy, size, NULL, NULL);
            strl_error err = {0};
            uint64_t digest;
            refused += fixture_try(copy, size, &digest, &err) != STRL_OK;
        }
    assert_true(refused > size / 2);
    free(copy);
    free(bytes);
}

typedef enum place { HEADER, TREE, TREELET, NODE_0, NODE_1, PLACEMENTS, PARTS, PAGE, RUNS, RUN_PAGE } place;

/* One damage: `bytes` bytes of value, at an offset from the place; checksums are made right afterwards. */
typedef struct damage {
    const char *file;
    place place;
    uint32_t at, bytes;
    uint64_t value;
} damage;

static const damage damages[] = {
    {"bad-magic.stroll", HEADER, 0, 1, 'P'},
    {"bad-version.stroll", HEADER, 8, 4, 2},
    {"bad-file-bytes.stroll", HEADER, 40, 8, 12345678},
    {"bad-up-axis.stroll", HEADER, 64, 4, 3},
    {"bad-flags.stroll", HEADER, 68, 4, 4},
    {"bad-bounds.stroll", HEADER, 112, 8, 0x7ff8000000000000u},
    {"bad-reserved.stroll", HEADER, 4000, 1, 1},
    {"bad-section-kind.stroll", HEADER, 168 + 120, 4, 9},
    {"bad-section-range.stroll", HEADER, 168 + 16, 8, 0x7fffffffffffffc0u},
    {"bad-trees-count.stroll", HEADER, 168 + 8, 8, 513},
    {"bad-parts-count.stroll", HEADER, 168 + 80 + 8, 8, 6},
    {"bad-table-depth.stroll", HEADER, 168 + 80 + 4, 4, 4},
    {"bad-structure.stroll", TREE, 0, 4, 7},
    {"bad-node-count.stroll", TREE, 8, 4, 0x7fffffff},
    {"bad-step.stroll", TREE, 40, 8, 0x3ff8000000000000u},
    {"bad-tree-box.stroll", TREE, 48, 8, 0x7fffffffffffffffu},
    {"bad-treelet-count.stroll", TREELET, 4, 4, 128},
    {"bad-child-refs.stroll", TREELET, 12, 4, 9},
    {"bad-parent.stroll", NODE_1, 0, 4, 5},
    {"bad-first-child.stroll", NODE_1, 4, 4, 1},
    {"bad-child-count.stroll", NODE_0, 8, 1, 9},
    {"bad-level.stroll", NODE_1, 10, 2, 2},
    {"bad-root-level.stroll", NODE_0, 10, 2, 7},
    {"bad-group.stroll", NODE_1, 12, 4, 1000},
    {"bad-group-size.stroll", NODE_1, 16, 4, 0},
    {"bad-decode-parent.stroll", NODE_1, 20, 4, 1},
    {"bad-not-told.stroll", NODE_1, 20, 4, 0},
    {"bad-normal-bits.stroll", PAGE, 2, 1, 9},
    {"bad-box.stroll", NODE_1, 48, 8, 0x4000000000000001u},
    {"bad-error-nan.stroll", NODE_1, 144, 4, 0x7fc00000},
    {"bad-error-negative.stroll", NODE_1, 144, 4, 0xbf800000},
    {"bad-group-error.stroll", NODE_1, 160, 4, 0},
    {"bad-claim.stroll", NODE_1, 148, 4, 0x40400000},
    {"bad-vertex-count.stroll", NODE_1, 168, 4, 65536},
    {"bad-step-count.stroll", NODE_1, 184, 4, 100},
    {"bad-record-lies.stroll", NODE_1, 168, 4, 60},
    {"bad-payload-range.stroll", NODE_1, 200, 4, 100000},
    {"bad-cone.stroll", NODE_1, 232, 8, 0xfffe7fff00000000u}, /* such trees have none */
    {"bad-page-range.stroll", NODE_1, 208, 8, 0x1000000},
    {"bad-page-alignment.stroll", NODE_1, 208, 8, 4097},
    {"bad-placement-tree.stroll", PLACEMENTS, 8, 4, 1},
    {"bad-placement-nan.stroll", PLACEMENTS, 16, 8, 0x7ff0000000000000u},
    {"bad-name-ends.stroll", PARTS, 8, 4, 5000},
    {"bad-name-utf8.stroll", PARTS, 26, 1, 0xff},
    {"bad-name-shared.stroll", PARTS, 24, 2, 1}, /* with the name before the first */
    {"bad-payload-version.stroll", PAGE, 0, 1, 0xee},
};
#define DAMAGES (sizeof damages / sizeof *damages)

/* The same of v1-runs.stroll; these are made when they are needed. RUNS: the table's leaf, of two items that end at 8
 * and lie from 12 on; RUN_PAGE: the first page of placements, of 512 items that lie from 2052 on. */
static const damage run_damages[] = {
    {"runs of too few placements", HEADER, STRL__AT_SECTIONS + STRL__SECTION_BYTES + 8, 8, 512},
    {"runs too few", HEADER, STRL__AT_SECTIONS + 4 * STRL__SECTION_BYTES + 8, 8, 1},
    {"runs not there", HEADER, 160, 4, 4},
    {"runs as deep as can't be", HEADER, STRL__AT_SECTIONS + 4 * STRL__SECTION_BYTES + 4, 4, 4},
    {"run that is too short", RUNS, 4, 4, 79},
    {"run with a box that is no number", RUNS, 12, 8, 0x7ff8000000000000u},
    {"run with a box without end", RUNS, 12 + 40, 8, 0x7ff0000000000000u},
    {"run with a box upside down", RUNS, 12 + 24, 8, 0xc130000000000000u},
    {"run with an area below nothing", RUNS, 12 + 48, 4, 0xbf800000},
    {"run with an area that is no number", RUNS, 12 + 48, 4, 0x7fc00000},
    {"run with a normal off its square", RUNS, 12 + 58, 2, 1024},
    {"run with a page of another size", RUNS, 12 + 60, 4, 55296},
    {"run with a page that is not there", RUNS, 12 + 64, 8, (uint64_t)1 << 40},
    {"run with a page between others", RUNS, 12 + 64, 8, 4160 + 32},
    {"run with a page that is another piece", RUNS, 12 + 64, 8, 4096},
    {"page of too many placements", RUN_PAGE, 0, 4, 513},
    {"page with a placement that is too long", RUN_PAGE, 4, 4, 105},
    {"placement of no tree", RUN_PAGE, 2052, 4, 1},
    {"placement of no part", RUN_PAGE, 2056, 4, 9},
    {"placement with a number without end", RUN_PAGE, 2060, 8, 0x7ff0000000000000u},
    {"placement with what is no number", RUN_PAGE, 2060 + 88, 8, 0x7ff8000000000000u},
};
#define RUN_DAMAGES (sizeof run_damages / sizeof *run_damages)

static uint64_t locate(const uint8_t *bytes, place where)
{
    uint64_t trees = strl__load_le(bytes + STRL__AT_SECTIONS + 16, 8), treelet = strl__load_le(bytes + trees + 120, 8);
    uint64_t node = treelet + STRL__TREELET_HEAD_BYTES;
    switch (where) {
    case HEADER:
        return 0;
    case TREE:
        return trees;
    case TREELET:
        return treelet;
    case NODE_0:
        return node;
    case NODE_1:
        return node + STRL__NODE_BYTES;
    case PLACEMENTS:
        return strl__load_le(bytes + STRL__AT_SECTIONS + STRL__SECTION_BYTES + 16, 8);
    case PARTS:
        return strl__load_le(bytes + STRL__AT_SECTIONS + (size_t)2 * STRL__SECTION_BYTES + 16, 8);
    case PAGE:
        return strl__load_le(bytes + node + 208, 8);
    case RUNS:
        return strl__load_le(bytes + STRL__AT_SECTIONS + (size_t)4 * STRL__SECTION_BYTES + 16, 8);
    case RUN_PAGE:
        return strl__load_le(bytes + locate(bytes, RUNS) + 12 + 64, 8);
    }
    return 0;
}

static json_t *describe(const uint8_t *bytes, size_t size)
{
    strl_source *source;
    strl_container *container;
    strl_error err;
    assert_ok(strl_source_open_memory(bytes, size, &source, &err), &err);
    assert_ok(strl_container_open(source, &container, &err), &err);
    const strl_container_info *info = strl_container_get_info(container);
    const strl_tree *tree = strl_container_tree(container, 0);
    char id[33];
    for (int i = 0; i < 16; i++)
        snprintf(id + (size_t)2 * i, 3, "%02x", info->model_id[i]);
    json_t *object = json_pack(
        "{s:i, s:s, s:I, s:s, s:i, s:b, s:i, s:i, s:i, s:I, s:I, s:I, s:I, s:[f,f,f,f,f,f]}", "version",
        (int)info->version, "model_id", id, "file_bytes", (json_int_t)info->file_bytes, "unit", info->unit, "up_axis",
        (int)info->up_axis, "has_colour", info->has_colour, "trees", (int)info->tree_count, "parts",
        (int)info->part_count, "materials", (int)info->material_count, "placements", (json_int_t)info->placement_count,
        "triangles_in", (json_int_t)info->triangles_in, "dropped_degenerate", (json_int_t)info->dropped_degenerate,
        "closed", (json_int_t)info->closed_hint, "bounds", info->bounds[0], info->bounds[1], info->bounds[2],
        info->bounds[3], info->bounds[4], info->bounds[5]);
    json_t *more =
        json_pack("{s:i, s:i, s:i, s:I, s:I, s:i, s:f, s:f}", "nodes", (int)tree->node_count, "levels",
                  (int)tree->level_count, "groups", (int)tree->group_count, "triangles",
                  (json_int_t)tree->triangle_count, "vertices", (json_int_t)tree->vertex_count, "root_triangles",
                  (int)tree->root_triangles, "step", tree->step, "leaf_geometric", (double)tree->leaf_geometric);
    assert_true(object && more);
    json_object_update(object, more);
    json_decref(more);
    uint64_t digest;
    char hex[17];
    assert_ok(fixture_read_all(container, &digest, &err), &err);
    snprintf(hex, sizeof hex, "%016" PRIx64, digest);
    json_object_set_new(object, "digest", json_string(hex));
    strl_container_close(container);
    return object;
}

static void store(const char *name, const uint8_t *bytes, size_t size)
{
    char path[512];
    golden_path(path, name);
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, size, file), size);
    assert_int_equal(fclose(file), 0);
}

/* A container of runs with a damage under right checksums, malloc'ed. */
static uint8_t *damaged_runs(const uint8_t *bytes, size_t size, const damage *what)
{
    uint8_t *copy = malloc(size);
    assert_non_null(copy);
    memcpy(copy, bytes, size);
    strl__store_le(copy + locate(bytes, what->place) + what->at, what->bytes, what->value);
    reseal_all(copy, size, NULL, NULL);
    return copy;
}

static void update_runs(json_t *expected, json_t *refused)
{
    size_t size;
    uint8_t *bytes = container_of_runs(&size);
    store("v1-runs.stroll", bytes, size);
    store("../../../fuzz/corpus/container/v1-runs.stroll", bytes, size);
    json_object_set_new(expected, "v1-runs.stroll", describe(bytes, size));
    for (size_t i = 0; i < RUN_DAMAGES; i++) {
        uint8_t *copy = damaged_runs(bytes, size, &run_damages[i]);
        strl_error err = {0};
        uint64_t digest;
        if (fixture_try(copy, size, &digest, &err) == STRL_OK)
            fail_msg("%s is accepted", run_damages[i].file);
        json_object_set_new(refused, run_damages[i].file, json_string(err.message));
        free(copy);
    }
    free(bytes);
}

static void update_golden(void)
{
    size_t size;
    uint8_t *bytes = small_container(&size), *copy = malloc(size);
    assert_non_null(copy);
    json_t *refused = json_object(), *expected = json_pack("{s:o}", "v1-small.stroll", describe(bytes, size));
    store("v1-small.stroll", bytes, size);
    store("../../../fuzz/corpus/container/v1-small.stroll", bytes, size);
    for (size_t i = 0; i < DAMAGES; i++) {
        const damage *what = &damages[i];
        memcpy(copy, bytes, size);
        strl__store_le(copy + locate(bytes, what->place) + what->at, what->bytes, what->value);
        reseal_all(copy, size, NULL, NULL);
        store(what->file, copy, size);
        strl_error err = {0};
        uint64_t digest;
        if (fixture_try(copy, size, &digest, &err) == STRL_OK)
            fail_msg("%s is accepted", what->file);
        json_object_set_new(refused, what->file, json_string(err.message));
    }
    update_runs(expected, refused);
    json_object_set_new(expected, "refused", refused);
    free(bytes);
    bytes = make_container(6, &size); /* 136 nodes: two treelets */
    store("v1-treelets.stroll", bytes, size);
    store("../../../fuzz/corpus/container/v1-treelets.stroll", bytes, size);
    json_object_set_new(expected, "v1-treelets.stroll", describe(bytes, size));
    char path[512];
    golden_path(path, "expected.json");
    assert_int_equal(json_dump_file(expected, path, JSON_INDENT(2)), 0);
    json_decref(expected);
    free(copy);
    free(bytes);
}

static json_t *load_expected(void)
{
    char path[512];
    json_error_t err;
    golden_path(path, "expected.json");
    json_t *expected = json_load_file(path, 0, &err);
    if (!expected)
        fail_msg("%s: %s", path, err.text);
    return expected;
}

static void the_committed_containers_read_as_committed(void **state)
{
    (void)state;
    if (getenv("STRL_UPDATE_GOLDEN"))
        update_golden();
    static const char *const names[] = {"v1-small.stroll", "v1-treelets.stroll", "v1-runs.stroll"};
    json_t *expected = load_expected();
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        size_t size;
        char path[512];
        golden_path(path, names[i]);
        uint8_t *bytes = fixture_load(path, &size);
        json_t *found = describe(bytes, size);
        char *text = json_dumps(found, JSON_INDENT(2));
        if (!json_equal(found, json_object_get(expected, names[i])))
            fail_msg("%s: found %s", names[i], text);
        free(text);
        json_decref(found);
        free(bytes);
    }
    json_decref(expected);
}

static void each_committed_bad_container_is_refused_with_its_sentence(void **state)
{
    (void)state;
    json_t *expected = load_expected(), *refused = json_object_get(expected, "refused");
    assert_int_equal(json_object_size(refused), DAMAGES + RUN_DAMAGES);
    for (size_t i = 0; i < DAMAGES; i++) {
        const char *sentence = json_string_value(json_object_get(refused, damages[i].file));
        assert_non_null(sentence);
        char path[512];
        golden_path(path, damages[i].file);
        size_t size;
        uint8_t *bytes = fixture_load(path, &size);
        strl_error err = {0};
        uint64_t digest;
        assert_int_not_equal(fixture_try(bytes, size, &digest, &err), STRL_OK);
        assert_string_equal(err.message, sentence);
        free(bytes);
    }
    json_decref(expected);
}

static void each_damage_of_runs_is_refused_with_its_sentence(void **state)
{
    (void)state;
    size_t size;
    char path[512];
    golden_path(path, "v1-runs.stroll");
    uint8_t *bytes = fixture_load(path, &size);
    json_t *expected = load_expected(), *refused = json_object_get(expected, "refused");
    for (size_t i = 0; i < RUN_DAMAGES; i++) {
        uint8_t *copy = damaged_runs(bytes, size, &run_damages[i]);
        strl_error err = {0};
        uint64_t digest;
        assert_int_not_equal(fixture_try(copy, size, &digest, &err), STRL_OK);
        assert_string_equal(err.message, json_string_value(json_object_get(refused, run_damages[i].file)));
        free(copy);
    }
    json_decref(expected);
    free(bytes);
}

/* In the table of runs every byte; of placements one in 97. */
static void a_flipped_byte_of_runs_is_detected_or_harmless(void **state)
{
    (void)state;
    size_t size;
    uint8_t *bytes = container_of_runs(&size), *copy = malloc(size);
    assert_non_null(copy);
    const uint64_t runs = locate(bytes, RUNS), page = locate(bytes, RUN_PAGE);
    for (size_t i = 0; i < 172 + 55300 / 97; i++) {
        uint64_t at = i < 172 ? runs + i : page + (i - 172) * 97;
        strl_error err = {0};
        uint64_t digest;
        memcpy(copy, bytes, size);
        copy[at] ^= 0x41;
        assert_refused(copy, size);
        reseal_all(copy, size, NULL, NULL);
        if (fixture_try(copy, size, &digest, &err) != STRL_OK)
            assert_true(err.message[0]);
    }
    free(copy);
    free(bytes);
}

static void a_sentence_names_the_file(void **state)
{
    (void)state;
    char path[512];
    golden_path(path, "bad-up-axis.stroll");
    strl_container *container;
    strl_error err;
    assert_int_equal(strl_container_open_path(path, &container, &err), STRL_ERR_FORMAT);
    assert_null(container);
    assert_memory_equal(err.message, path, strlen(path));
    assert_non_null(strstr(err.message, ": header: up axis is 3, expected 0 to 2"));
}

static void a_count_that_the_file_cannot_hold_takes_no_memory(void **state)
{
    (void)state;
    size_t size;
    char path[512];
    golden_path(path, "bad-node-count.stroll");
    uint8_t *bytes = fixture_load(path, &size);
    strl_error err;
    uint64_t digest;
    assert_int_equal(fixture_try(bytes, size, &digest, &err), STRL_ERR_FORMAT);
    assert_non_null(strstr(err.message, "2147483647 nodes, expected 1 to "));
    free(bytes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_committed_containers_read_as_committed),
        cmocka_unit_test(each_committed_bad_container_is_refused_with_its_sentence),
        cmocka_unit_test(a_file_cut_at_any_byte_is_refused),
        cmocka_unit_test(a_source_that_ends_early_gives_its_own_sentence),
        cmocka_unit_test(a_flipped_byte_is_detected_wherever_it_means_something),
        cmocka_unit_test(a_flipped_byte_under_right_checksums_never_crashes),
        cmocka_unit_test(each_damage_of_runs_is_refused_with_its_sentence),
        cmocka_unit_test(a_flipped_byte_of_runs_is_detected_or_harmless),
        cmocka_unit_test(a_sentence_names_the_file),
        cmocka_unit_test(a_count_that_the_file_cannot_hold_takes_no_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
