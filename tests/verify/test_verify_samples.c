/* A sample tree that lies is found by `verify` and refused by the readers with a sentence: each lie of a brick, of a
 * record, of a triangle. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "base/cursor.h"
#include "base/hash.h"
#include "build/planted_bricks.h"
#include "container/reseal.h"
#include "stroll/walk.h"
#include "verify/verify.h"

#define GOOD "good.stroll"
#define BAD "bad.stroll"

/* ---- the model: small triangles and some large ones */

static uint32_t liar; /* a node with a parent, children, triangles and splats */

static void find_liar(void)
{
    built_model model;
    built_open(&model, built_path(GOOD));
    assert_true(model.tree.level_count > 2);
    liar = 0;
    for (uint32_t i = 1; i < model.tree.node_count && !liar; i++)
        if (model.node[i].child_count > 0 && model.node[i].triangle_count > 20)
            liar = i;
    assert_true(liar > 0);
    built_close(&model);
}

static int setup(void **state)
{
    if (built_setup(state) != 0)
        return -1;
    mesh_file mesh = {0};
    uint64_t random = 8;
    for (uint32_t i = 0; i < 12000; i++) {
        uint32_t corner[3];
        double at[3], size = i % 30 ? 0.02 : 0.4;
        for (int k = 0; k < 3; k++)
            at[k] = (double)(strl__mix64(++random) >> 11) * 0x1p-53;
        for (int c = 0; c < 3; c++) {
            double p[3];
            for (int k = 0; k < 3; k++)
                p[k] = at[k] + size * (double)(strl__mix64(++random) >> 11) * 0x1p-53;
            corner[c] = mesh_file_add_vertex(&mesh, p[0], p[1], p[2]);
        }
        mesh_file_add_face(&mesh, corner[0], corner[1], corner[2]);
    }
    mesh_file_write_ply(&mesh, built_path("in.ply"));
    mesh_file_free(&mesh);
    sample_tree_build("in.ply", GOOD, (strl_build_desc){0});
    find_liar();
    return 0;
}

/* ---- looking */

static strl_verify_report look(const char *name, bool against)
{
    const char *inputs[] = {built_path("in.ply")};
    const strl_verify_desc desc = {.model = built_path(name),
                                   .inputs = inputs,
                                   .input_count = against,
                                   .scratch_dir = built_path(""),
                                   .memory_bytes = 256u << 20,
                                   .jobs = 2,
                                   .cuts = 4};
    strl_verify_report report;
    strl_error err = {0};
    if (strl_verify_run(&desc, &report, &err) != STRL_OK)
        fail_msg("%s", err.message);
    return report;
}

static void assert_found(bool against, strl_verify_kind kind, const char *what)
{
    strl_verify_report report = look(BAD, against);
    if (report.ok || report.checks[kind].failures == 0 || strlen(report.checks[kind].first) < 20) {
        for (unsigned k = 0; k < STRL_VERIFY_KINDS; k++)
            if (report.checks[k].failures)
                print_message("%s: %s\n", strl_verify_name((strl_verify_kind)k), report.checks[k].first);
        fail_msg("not found by %s: %s", strl_verify_name(kind), what);
    }
    strl_verify_report_deinit(&report);
}

/* The blocking reader and the walk read with code of their own: neither takes it. */
static void assert_refused_by_readers(uint32_t node, const char *what)
{
    strl_container *container;
    strl_error err = {0};
    strl_node record;
    strl_pm mesh;
    strl_arena arena = {0};
    if (strl_container_open_path(built_path(BAD), &container, &err) != STRL_OK)
        fail_msg("%s", err.message);
    strl_status status = strl_container_node(container, 0, node, &record, &err);
    if (status == STRL_OK)
        status = strl_container_mesh(container, 0, &record, &arena, &mesh, &err);
    if (status != STRL_ERR_FORMAT || strlen(err.message) < 20)
        fail_msg("not refused by the reader: %s", what);
    strl_arena_deinit(&arena);
    strl_container_close(container);
}

static strl_camera near_camera(void)
{
    return (strl_camera){.eye = {0.5, -0.2, 0.5},
                         .target = {0.5, 0.5, 0.5},
                         .up = {0, 0, 1},
                         .fov_y_deg = 70,
                         .width = 800,
                         .height = 600};
}

static void assert_refused_by_walk(const char *what)
{
    strl_source *source;
    strl_walk *walk;
    strl_error err = {0};
    size_t size;
    uint8_t *bytes = built_read_file(built_path(BAD), &size);
    assert_int_equal(strl_source_open_memory(bytes, size, &source, &err), STRL_OK);
    strl_status status = strl_walk_open(source, &(strl_walk_desc){.error_px = 0.01}, &walk, &err);
    if (status != STRL_OK) {
        assert_int_equal(status, STRL_ERR_FORMAT);
        assert_true(strlen(err.message) > 20);
        free(bytes);
        return;
    }
    strl_camera camera = near_camera();
    strl_draw_list list;
    for (unsigned i = 0; i < 300 && (i == 0 || !strl_walk_settled(walk)); i++) {
        if (strl_walk_frame(walk, &camera, &list, &err) != STRL_OK)
            fail_msg("%s", err.message);
        strl_walk_pump(walk, UINT64_MAX);
    }
    const strl_walk_stats *stats = strl_walk_get_stats(walk);
    if (stats->faults == 0 || strlen(stats->last_fault) < 20 || stats->missing_nodes == 0)
        fail_msg("not refused by the walk (%s): %s", stats->last_fault, what);
    assert_true(list.count > 0);
    strl_walk_close(walk);
    free(bytes);
}

/* ---- lies of heads */

typedef struct head_lie {
    const char *name;
    void (*tell)(strl_node *record, test_brick *brick);
} head_lie;

static void another_version(strl_node *record, test_brick *brick)
{
    (void)record;
    brick->version = 2;
}

static void no_level(strl_node *record, test_brick *brick)
{
    (void)record;
    brick->level_count = 0;
    brick->splat_count = 0;
}

static void too_many_levels(strl_node *record, test_brick *brick)
{
    (void)record;
    for (; brick->level_count < 23; brick->level_count++)
        brick->level[brick->level_count] = brick->level[brick->level_count - 1];
}

static void a_size_that_is_none(strl_node *record, test_brick *brick)
{
    (void)record;
    brick->level[0].size = NAN;
}

static void an_infinite_size(strl_node *record, test_brick *brick)
{
    (void)record;
    brick->level[0].size = INFINITY;
}

static void a_negative_size(strl_node *record, test_brick *brick)
{
    (void)record;
    brick->level[brick->level_count - 1].size = -1;
}

static void a_size_that_grows(strl_node *record, test_brick *brick)
{
    (void)record;
    brick->level[brick->level_count] = brick->level[brick->level_count - 1];
    brick->level[brick->level_count].size *= 2;
    if (brick->level[0].size == 0)
        brick->level[brick->level_count].size = 1;
    brick->level_count++;
}

static void a_size_above_its_records(strl_node *record, test_brick *brick)
{
    brick->level[0].size = nextafterf(record->geometric_max, INFINITY);
}

static void splats_that_end_before_they_begin(strl_node *record, test_brick *brick)
{
    (void)record;
    brick->level[brick->level_count] = brick->level[brick->level_count - 1];
    brick->level[brick->level_count].end--;
    brick->level_count++;
    brick->splat_count--;
}

static void too_many_splats(strl_node *record, test_brick *brick)
{
    (void)record;
    for (; brick->splat_count < 4097; brick->splat_count++)
        brick->splat[brick->splat_count] = brick->splat[0];
    brick->level[brick->level_count - 1].end = 4097;
}

static void a_splat_outside(strl_node *record, test_brick *brick)
{
    test_brick_splat *splat = &brick->splat[brick->splat_count - 1];
    splat->centre[1] = record->box_max[1] - record->anchor[1] + ((int64_t)1 << splat->side);
}

static void a_splat_below(strl_node *record, test_brick *brick)
{
    brick->splat[0].centre[2] = record->box_min[2] - record->anchor[2] - ((int64_t)1 << brick->splat[0].side);
}

static void a_splat_beyond_32_bits(strl_node *record, test_brick *brick)
{
    (void)record;
    brick->splat[0].side = 36;
    brick->splat[0].centre[0] = (int64_t)1 << 31;
}

static void a_splat_of_a_world(strl_node *record, test_brick *brick)
{
    (void)record;
    brick->splat[0].side = 37;
}

static void a_run_of_no_level(strl_node *record, test_brick *brick)
{
    (void)record;
    brick->run[0].level = (uint8_t)(brick->level_count + 1);
}

static void an_empty_run(strl_node *record, test_brick *brick)
{
    (void)record;
    brick->run[brick->run_count] = (test_brick_run){brick->run[brick->run_count - 1].level ? 0 : 1, 0};
    brick->run_count++;
}

static void a_triangle_too_few(strl_node *record, test_brick *brick)
{
    (void)record;
    brick->run[0].count++;
}

static void a_triangle_too_many(strl_node *record, test_brick *brick)
{
    (void)record;
    if (brick->run[brick->run_count - 1].count > 1)
        brick->run[brick->run_count - 1].count--;
    else
        brick->run_count--;
}

static const head_lie head_lies[] = {
    {"another version", another_version},
    {"no level", no_level},
    {"too many levels", too_many_levels},
    {"a size that is none", a_size_that_is_none},
    {"an infinite size", an_infinite_size},
    {"a negative size", a_negative_size},
    {"a size that grows", a_size_that_grows},
    {"a size above its record's", a_size_above_its_records},
    {"splats that end before they begin", splats_that_end_before_they_begin},
    {"too many splats", too_many_splats},
    {"a splat outside", a_splat_outside},
    {"a splat below", a_splat_below},
    {"a splat beyond 32 bits", a_splat_beyond_32_bits},
    {"a splat of a world", a_splat_of_a_world},
    {"a run of no level", a_run_of_no_level},
    {"an empty run", an_empty_run},
    {"a triangle too few", a_triangle_too_few},
    {"a triangle too many", a_triangle_too_many},
};

static bool tell_head_lie(void *context, uint32_t id, strl_node *record, test_brick *brick, strl_pm *mesh)
{
    const head_lie *lie = context;
    (void)mesh;
    if (id == liar) {
        assert_true(brick->splat_count > 1 && brick->run_count > 0);
        lie->tell(record, brick);
    }
    return false;
}

static void the_model_is_good_and_so_is_its_copy(void **state)
{
    (void)state;
    sample_tree_verify(GOOD, "in.ply");
    plant_bricks(GOOD, BAD, no_brick_lie, NULL);
    sample_tree_verify(BAD, "in.ply");
    sample_tree_check(BAD);
}

static void a_lie_in_the_head_of_a_brick_is_found_and_refused(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof head_lies / sizeof *head_lies; i++) {
        head_lie lie = head_lies[i];
        plant_bricks(GOOD, BAD, tell_head_lie, &lie);
        assert_found(false, STRL_VERIFY_PAYLOADS, lie.name);
        assert_refused_by_readers(liar, lie.name);
        assert_refused_by_walk(lie.name);
    }
}

/* Then no stream is empty. */
static void move_a_triangle_to_another_level(test_brick *brick)
{
    test_brick_run *last = &brick->run[brick->run_count - 1];
    assert_true(brick->level_count == 1 && last->count > 1);
    last->count--;
    last[1] = (test_brick_run){!last->level, 1};
    brick->run_count++;
}

static bool tell_surplus(void *context, uint32_t id, strl_node *record, test_brick *brick, strl_pm *mesh)
{
    (void)record, (void)mesh;
    if (id == liar) {
        move_a_triangle_to_another_level(brick);
        brick->surplus = *(unsigned *)context;
    }
    return false;
}

static bool tell_missing(void *context, uint32_t id, strl_node *record, test_brick *brick, strl_pm *mesh)
{
    tell_surplus(context, id, record, brick, mesh);
    brick->missing = brick->surplus;
    brick->surplus = 0;
    return false;
}

static void a_stream_of_another_length_is_found_and_refused(void **state)
{
    (void)state;
    unsigned number = 0;
    plant_bricks(GOOD, BAD, tell_surplus, &number);
    sample_tree_verify(BAD, "in.ply"); /* it is not the moving that is found */
    for (number = 1; number <= TEST_BRICK_STREAMS; number++) {
        plant_bricks(GOOD, BAD, tell_surplus, &number);
        assert_found(false, STRL_VERIFY_PAYLOADS, "a value too many");
        assert_refused_by_readers(liar, "a value too many");
        plant_bricks(GOOD, BAD, tell_missing, &number);
        assert_found(false, STRL_VERIFY_PAYLOADS, "a value too few");
        assert_refused_by_readers(liar, "a value too few");
    }
}

/* ---- lies of bytes: a head that is cut or says more than follows, behind right checksums */

static uint64_t head_of_liar(strl_node *record)
{
    strl_container *container;
    strl_error err = {0};
    assert_int_equal(strl_container_open_path(built_path(GOOD), &container, &err), STRL_OK);
    assert_int_equal(strl_container_node(container, 0, liar, record, &err), STRL_OK);
    strl_container_close(container);
    return record->page.offset + record->payload_offset;
}

static void store_resealed(uint8_t *bytes, size_t size)
{
    reseal_all(bytes, size, NULL, NULL);
    FILE *file = fopen(built_path(BAD), "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, size, file), size);
    assert_int_equal(fclose(file), 0);
}

static void a_head_that_says_more_than_follows_is_refused(void **state)
{
    (void)state;
    size_t size;
    strl_node record;
    uint64_t at = head_of_liar(&record);
    uint8_t *bytes = built_read_file(built_path(GOOD), &size);
    const uint64_t said = strl__load_le(bytes + at + 2, 4),
                   counts[] = {0xffffffffu, 0x80000000u, said + 1, said - 1, 19, 0};
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        strl__store_le(bytes + at + 2, 4, counts[i]); /* bytes of streams */
        store_resealed(bytes, size);
        assert_found(false, STRL_VERIFY_PAYLOADS, "a wrong number of bytes");
        assert_refused_by_readers(liar, "a wrong number of bytes");
        assert_refused_by_walk("a wrong number of bytes");
    }
    free(bytes);
}

/* Whatever the bit, nothing crashes; and of the bytes before the splats most mean something. */
static void a_flipped_bit_in_a_head_does_no_harm(void **state)
{
    (void)state;
    size_t size;
    strl_node record;
    uint64_t at = head_of_liar(&record);
    uint8_t *bytes = built_read_file(built_path(GOOD), &size), *copy = malloc(size);
    unsigned found = 0;
    assert_non_null(copy);
    for (unsigned i = 0; i < 48; i++) {
        memcpy(copy, bytes, size);
        copy[at + i / 2] ^= (uint8_t)(i % 2 ? 0x80 : 1u << i % 7);
        store_resealed(copy, size);
        strl_verify_report report = look(BAD, false);
        found += !report.ok;
        strl_verify_report_deinit(&report);
        strl_source *source;
        strl_walk *walk;
        strl_draw_list list;
        strl_camera camera = near_camera();
        assert_int_equal(strl_source_open_memory(copy, size, &source, NULL), STRL_OK);
        assert_int_equal(strl_walk_open(source, NULL, &walk, NULL), STRL_OK);
        for (unsigned frame = 0; frame < 20; frame++) {
            assert_int_equal(strl_walk_frame(walk, &camera, &list, NULL), STRL_OK);
            strl_walk_pump(walk, UINT64_MAX);
        }
        strl_walk_close(walk);
    }
    assert_true(found > 24);
    free(bytes);
    free(copy);
}

/* ---- lies of records */

typedef struct record_lie {
    const char *name;
    uint32_t at, bytes; /* within the record */
    uint64_t value;
    strl_verify_kind kind;
} record_lie;

static uint64_t record_of_liar(const uint8_t *bytes)
{
    assert_true(liar < 128); /* in the first treelet */
    uint64_t trees = strl__load_le(bytes + STRL__AT_SECTIONS + 16, 8), treelet = strl__load_le(bytes + trees + 120, 8);
    return treelet + STRL__TREELET_HEAD_BYTES + (uint64_t)liar * STRL__NODE_BYTES;
}

static void a_lie_in_a_record_is_found(void **state)
{
    (void)state;
    strl_node record;
    head_of_liar(&record);
    uint32_t size_bits;
    memcpy(&size_bits, &record.geometric_max, sizeof size_bits);
    const record_lie lies[] = {
        {"the rung of a mesh", 9, 1, 0, STRL_VERIFY_RECORDS},
        {"the rung of clusters", 9, 1, 3, STRL_VERIFY_RECORDS},
        {"a group of two", 16, 4, 2, STRL_VERIFY_GROUPS},
        {"told by its parent", 20, 4, record.parent, STRL_VERIFY_RECORDS},
        {"a step", 184, 4, 1, STRL_VERIFY_RECORDS},
        {"a group without error", 160, 4, 0, STRL_VERIFY_ERRORS},
        {"no least size", 144, 4, 0, STRL_VERIFY_ERRORS},
        {"a largest size that is a hair above", 148, 4, size_bits + 1, STRL_VERIFY_ERRORS},
        {"a least size that is a hair below", 144, 4, size_bits - 1, STRL_VERIFY_ERRORS},
        {"a group that is a hair above", 160, 4, size_bits + 1, STRL_VERIFY_ERRORS},
        {"an error above its parent's", 160, 4, 0x5f000000, STRL_VERIFY_ERRORS},
        {"a triangle more", 176, 4, record.triangle_count + 1, STRL_VERIFY_PAGES},
        {"a vertex more", 168, 4, record.vertex_count + 1, STRL_VERIFY_PAGES},
        {"a box that does not nest", 72, 8, (uint64_t)record.box_max[0] + ((uint64_t)1 << 40), STRL_VERIFY_BOXES},
        {"another level", 10, 2, record.level + 1, STRL_VERIFY_RECORDS},
    };
    size_t size;
    uint8_t *bytes = built_read_file(built_path(GOOD), &size), *copy = malloc(size);
    assert_non_null(copy);
    uint64_t at = record_of_liar(bytes);
    for (size_t i = 0; i < sizeof lies / sizeof *lies; i++) {
        memcpy(copy, bytes, size);
        strl__store_le(copy + at + lies[i].at, lies[i].bytes, lies[i].value);
        store_resealed(copy, size);
        strl_verify_report report = look(BAD, false);
        if (report.ok)
            fail_msg("not found: %s", lies[i].name);
        if (report.checks[lies[i].kind].failures == 0)
            for (unsigned k = 0; k < STRL_VERIFY_KINDS; k++)
                if (report.checks[k].failures)
                    print_message("%s: by %s: %s\n", lies[i].name, strl_verify_name((strl_verify_kind)k),
                                  report.checks[k].first);
        assert_true(report.checks[lies[i].kind].failures > 0);
        strl_verify_report_deinit(&report);
    }
    free(bytes);
    free(copy);
}

static void a_rung_of_another_structure_is_refused_by_readers(void **state)
{
    (void)state;
    size_t size;
    uint8_t *bytes = built_read_file(built_path(GOOD), &size);
    bytes[record_of_liar(bytes) + 9] = 0;
    store_resealed(bytes, size);
    assert_refused_by_readers(liar, "the rung of a mesh");
    free(bytes);
}

/* ---- lies of cones, of a sphere, whose bricks have some */

#define ROUND "round.stroll"

typedef struct cone_lie {
    uint32_t node;
    strl_cone cone;
} cone_lie;

static bool tell_cone(void *context, uint32_t id, strl_node *record, test_brick *brick, strl_pm *mesh)
{
    const cone_lie *lie = context;
    (void)brick, (void)mesh;
    if (id == lie->node)
        record->cone = lie->cone;
    return false;
}

/* The least cosine between the axis and a face of the node, in steps of the format, by floating numbers wide enough. */
static long least_cosine(const built_model *sphere, uint32_t id, const int16_t axis[3])
{
    const strl_pm *mesh = &sphere->mesh[id];
    double least = 1, size = sqrt((double)axis[0] * axis[0] + (double)axis[1] * axis[1] + (double)axis[2] * axis[2]);
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        double side[2][3], length = 0, along = 0;
        for (int s = 0; s < 2; s++)
            for (int k = 0; k < 3; k++)
                side[s][k] =
                    (double)mesh->position[mesh->triangle[t][s + 1]][k] - mesh->position[mesh->triangle[t][0]][k];
        for (int k = 0; k < 3; k++) {
            double n = side[0][(k + 1) % 3] * side[1][(k + 2) % 3] - side[0][(k + 2) % 3] * side[1][(k + 1) % 3];
            length += n * n;
            along += n * axis[k];
        }
        if (length > 0)
            least = fmin(least, along / (sqrt(length) * size));
    }
    return (long)floor(65535 * least);
}

static void make_sphere(built_model *sphere)
{
    mesh_file mesh = {0};
    mesh_file_sphere(&mesh, 200, 400);
    mesh_file_write_ply(&mesh, built_path("round.ply"));
    mesh_file_free(&mesh);
    sample_tree_build("round.ply", ROUND, (strl_build_desc){0});
    sample_tree_verify(ROUND, "round.ply");
    sample_tree_check(ROUND);
    built_open(sphere, built_path(ROUND));
}

static void assert_cone_found(uint32_t node, strl_cone cone, const char *what)
{
    cone_lie lie = {node, cone};
    plant_bricks(ROUND, BAD, tell_cone, &lie);
    assert_found(false, STRL_VERIFY_CONES, what);
}

static void a_cone_that_is_too_narrow_or_turned_is_found(void **state)
{
    (void)state;
    built_model sphere;
    make_sphere(&sphere);
    unsigned leaves = 0, inner = 0;
    for (uint32_t id = 0; id < sphere.tree.node_count; id++) {
        strl_cone cone = sphere.node[id].cone;
        if (cone.cosine == 0)
            continue;
        long least = least_cosine(&sphere, id, cone.axis);
        assert_true(cone.cosine <= least);
        if (sphere.node[id].child_count == 0 && leaves < 3) {
            assert_true(cone.cosine >= least - 1); /* no wider than it need be */
            cone.cosine = (uint16_t)(least + 2);
            assert_cone_found(id, cone, "a leaf's cone that is a hair too narrow");
            cone.cosine = (uint16_t)least;
            for (int k = 0; k < 3; k++)
                cone.axis[k] = (int16_t)-cone.axis[k];
            assert_cone_found(id, cone, "a leaf's cone that is turned round");
            leaves++;
        } else if (sphere.node[id].child_count > 0 && least > cone.cosine + 200 && inner < 3) {
            cone.cosine = (uint16_t)(least - 100);
            assert_cone_found(id, cone, "a cone that holds its own triangles and not those below");
            inner++;
        }
    }
    assert_true(leaves == 3 && inner > 0);
    cone_lie none = {0, {{0}, 0}};
    for (none.node = 1; sphere.node[none.node].cone.cosine == 0;)
        none.node++;
    plant_bricks(ROUND, BAD, tell_cone, &none);
    sample_tree_verify(BAD, "round.ply"); /* no cone is no lie */
    built_close(&sphere);
}

static void half_a_cone_is_found_and_refused(void **state)
{
    (void)state;
    const uint64_t cones[] = {0x0000000000007fffu, 0x0000800000000000u, 0xffff000000000000u, 0x0001000000000000u};
    size_t size;
    uint8_t *bytes = built_read_file(built_path(GOOD), &size), *copy = malloc(size);
    assert_non_null(copy);
    uint64_t at = record_of_liar(bytes) + 232;
    for (size_t i = 0; i < sizeof cones / sizeof *cones; i++) {
        memcpy(copy, bytes, size);
        strl__store_le(copy + at, 8, cones[i]);
        store_resealed(copy, size);
        assert_found(false, STRL_VERIFY_RECORDS, "half a cone");
        assert_refused_by_readers(liar, "half a cone");
    }
    free(bytes);
    free(copy);
}

/* ---- lies of triangles */

static bool drop_a_triangle(void *context, uint32_t id, strl_node *record, test_brick *brick, strl_pm *mesh)
{
    (void)context, (void)record, (void)brick;
    if (id == liar)
        mesh->triangle_end[0] = --mesh->triangle_count;
    return id == liar;
}

static bool store_a_triangle_twice(void *context, uint32_t id, strl_node *record, test_brick *brick, strl_pm *mesh)
{
    (void)context, (void)record, (void)brick;
    if (id == liar)
        memcpy(mesh->triangle[1], mesh->triangle[0], sizeof mesh->triangle[0]);
    return id == liar;
}

static bool turn_a_triangle(void *context, uint32_t id, strl_node *record, test_brick *brick, strl_pm *mesh)
{
    (void)context, (void)record, (void)brick;
    if (id == liar) {
        uint16_t first = mesh->triangle[3][0];
        mesh->triangle[3][0] = mesh->triangle[3][1];
        mesh->triangle[3][1] = first;
    }
    return id == liar;
}

static bool change_nothing(void *context, uint32_t id, strl_node *record, test_brick *brick, strl_pm *mesh)
{
    (void)context, (void)record, (void)brick, (void)mesh;
    return id == liar;
}

static void a_triangle_that_is_missing_twice_there_or_turned_is_found(void **state)
{
    (void)state;
    plant_bricks(GOOD, BAD, change_nothing, NULL);
    sample_tree_verify(BAD, "in.ply"); /* it is not the planting that is found */
    plant_bricks(GOOD, BAD, drop_a_triangle, NULL);
    assert_found(false, STRL_VERIFY_COUNTS, "a triangle less");
    plant_bricks(GOOD, BAD, store_a_triangle_twice, NULL);
    assert_found(true, STRL_VERIFY_LEAVES, "a triangle twice");
    plant_bricks(GOOD, BAD, turn_a_triangle, NULL);
    assert_found(true, STRL_VERIFY_LEAVES, "a triangle turned");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_model_is_good_and_so_is_its_copy),
        cmocka_unit_test(a_lie_in_the_head_of_a_brick_is_found_and_refused),
        cmocka_unit_test(a_stream_of_another_length_is_found_and_refused),
        cmocka_unit_test(a_head_that_says_more_than_follows_is_refused),
        cmocka_unit_test(a_flipped_bit_in_a_head_does_no_harm),
        cmocka_unit_test(a_lie_in_a_record_is_found),
        cmocka_unit_test(a_rung_of_another_structure_is_refused_by_readers),
        cmocka_unit_test(a_cone_that_is_too_narrow_or_turned_is_found),
        cmocka_unit_test(half_a_cone_is_found_and_refused),
        cmocka_unit_test(a_triangle_that_is_missing_twice_there_or_turned_is_found),
    };
    return cmocka_run_group_tests(tests, setup, built_teardown);
}
