/* Splats of very many copies: they are drawn together, and each is where it would be, turned as its copy is, and says
 * whose it is. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "build/sample_tree.h"
#include "geometry/octahedral.h"
#include "scenes/scene.h"
#include "walk/walk_checks.h"

#define COPIES 500u
#define MOST_ITEMS 16u /* of points: one a size */
#define ERROR_PX 3.0

typedef struct told_splat {
    double at[3]; /* in the model's space */
    float line[3];
    uint32_t rgba;
} told_splat;

static built_model model;
static uint8_t *bytes;
static size_t size;
static strl_placement placement[COPIES];
static told_splat *told; /* of all bricks, by code of the tests */
static uint32_t told_count;

static void tell_splats(uint32_t id)
{
    const strl_node *node = &model.node[id];
    test_brick brick;
    test_brick_read(&brick, bytes + node->page.offset + node->payload_offset, node->payload_bytes);
    told = realloc(told, (told_count + brick.splat_count + 1) * sizeof *told);
    assert_non_null(told);
    for (uint32_t i = 0; i < brick.splat_count; i++) {
        told_splat *splat = &told[told_count++];
        const uint16_t code[2] = {(uint16_t)(brick.splat[i].normal[0] * 1023u / 255u),
                                  (uint16_t)(brick.splat[i].normal[1] * 1023u / 255u)};
        strl_oct_decode(code, splat->line);
        splat->rgba = brick.splat[i].rgba;
        for (int k = 0; k < 3; k++)
            splat->at[k] =
                model.tree.origin[k] + model.tree.step * (double)(node->anchor[k] + brick.splat[i].centre[k]);
    }
    test_brick_free(&brick);
}

static int create_array(void **state)
{
    strl_error err = {0};
    if (built_setup(state) != 0)
        return -1;
    built_scene("isosurface", "one.ply", 20000, true);
    const strl_scene_desc scene = {
        .name = "array", .path = built_path("many.gltf"), .of = built_path("one.ply"), .copies = COPIES};
    assert_int_equal(strl_scene_write(&scene, NULL, NULL, &err), STRL_OK);
    assert_int_equal(sample_tree_build("many.gltf", "many.stroll", (strl_build_desc){0}).placements, COPIES);
    built_open(&model, built_path("many.stroll"));
    bytes = built_read_file(built_path("many.stroll"), &size);
    for (uint32_t i = 0; i < COPIES; i++)
        assert_int_equal(strl_container_placement(model.container, i, &placement[i], &err), STRL_OK);
    for (uint32_t id = 0; id < model.tree.node_count; id++)
        tell_splats(id);
    return 0;
}

static int drop_array(void **state)
{
    free(told);
    free(bytes);
    built_close(&model);
    return built_teardown(state);
}

/* Above the middle, so high that a copy is some pixels large; y is up. */
static strl_camera high_above(double height)
{
    const double *b = model.info.bounds, middle[2] = {(b[0] + b[3]) / 2, (b[2] + b[5]) / 2};
    return (strl_camera){.eye = {middle[0], height, middle[1]},
                         .target = {middle[0], 0, middle[1]},
                         .up = {0.1, 0, 1},
                         .fov_y_deg = 40,
                         .width = 640,
                         .height = 480};
}

/* The turning and scaling part of arrays is a similarity: its transpose over the square of the scale takes it back. */
static void to_model(const double transform[12], const double world[3], double at[3], double *scale)
{
    *scale = sqrt(transform[0] * transform[0] + transform[4] * transform[4] + transform[8] * transform[8]);
    for (int k = 0; k < 3; k++)
        at[k] = (transform[k] * (world[0] - transform[3]) + transform[4 + k] * (world[1] - transform[7]) +
                 transform[8 + k] * (world[2] - transform[11])) /
                (*scale * *scale);
}

/* The splat that lies nearest to the place, by how far. */
static const told_splat *nearest_splat(const double at[3], const uint8_t rgba[4], double *distance)
{
    const told_splat *best = NULL;
    *distance = INFINITY;
    for (uint32_t i = 0; i < told_count; i++) {
        double way = hypot(hypot(told[i].at[0] - at[0], told[i].at[1] - at[1]), told[i].at[2] - at[2]);
        if (way < *distance && memcmp(&told[i].rgba, rgba, 3) == 0)
            *distance = way, best = &told[i];
    }
    return best;
}

static bool is_in_tree(const double at[3])
{
    for (int k = 0; k < 3; k++) {
        double cell = (at[k] - model.tree.origin[k]) / model.tree.step;
        if (cell < (double)model.tree.box_min[k] - 1 || cell > (double)model.tree.box_max[k] + 1)
            return false;
    }
    return true;
}

static void check_point(const strl_draw_item *item, uint32_t v, uint32_t *of_copy)
{
    double world[3], scale = 1, distance = INFINITY, along = 0;
    float line[3];
    const told_splat *splat = NULL;
    uint32_t copy = 0;
    for (int k = 0; k < 3; k++)
        world[k] = item->origin[k] + item->step * (double)(item->anchor[k] + item->vertices[v].position[k]);
    for (uint32_t i = 0; i < COPIES; i++) {
        double other[3], way, its_scale;
        to_model(placement[i].transform, world, other, &its_scale);
        const told_splat *near = is_in_tree(other) ? nearest_splat(other, item->vertices[v].rgba, &way) : NULL;
        if (near && way < distance) {
            distance = way, splat = near, copy = i, scale = its_scale;
        }
    }
    of_copy[copy]++;
    assert_int_equal(item->labels[v].part, placement[copy].own_part - 1);
    if (!splat || distance > 4 * item->step / scale + model.tree.step)
        fail_msg("a point is no splat of any copy: the nearest is %g away", distance);
    const uint16_t code[2] = {item->vertices[v].normal[0] & 1023u, item->vertices[v].normal[1]};
    strl_oct_decode(code, line);
    for (int k = 0; k < 3; k++) {
        double back = placement[copy].transform[k] * (double)line[0] +
                      placement[copy].transform[4 + k] * (double)line[1] +
                      placement[copy].transform[8 + k] * (double)line[2];
        along += back / scale * (double)splat->line[k];
    }
    assert_true(fabs(along) > 0.999);
}

static void copies_that_show_few_splats_are_drawn_together(void **state)
{
    (void)state;
    const strl_camera camera = high_above(220);
    strl_walk *walk = open_walk(memory_source(bytes, size), &(strl_walk_desc){.error_px = ERROR_PX, .labels = true});
    strl_draw_list list = settle(walk, &camera, 500);
    uint32_t items = 0, of_copy[COPIES] = {0};
    uint64_t points = 0;
    for (uint32_t i = 0; i < list.count; i++) {
        const strl_draw_item *item = &list.items[i];
        if (!(item->point_px > 0))
            continue;
        items++;
        points += item->draw_count;
        assert_int_equal(item->placement, STRL_NONE);
        assert_non_null(item->labels);
        assert_true(item->visible && item->vertex_count == item->draw_count && item->point_px <= 64);
        for (uint32_t v = 0; v < item->vertex_count; v++)
            check_point(item, v, of_copy);
    }
    assert_in_range(items, 1, MOST_ITEMS);
    assert_int_equal(points, strl_walk_get_stats(walk)->splats);
    assert_true(points > 2 * COPIES);
    for (uint32_t copy = 0; copy < COPIES; copy++)
        assert_true(of_copy[copy] > 0);
    strl_walk_close(walk);
}

/* Whoever asks for none gets none, and a point of a copy below a pixel says whose it is too. */
static void labels_are_those_of_the_copies(void **state)
{
    (void)state;
    assert_true(placement[0].own_part > 0);
    for (unsigned labels = 0; labels < 2; labels++) {
        const strl_camera camera = high_above(2000); /* a copy is less than a pixel, sixteen are more */
        strl_walk *walk = open_walk(memory_source(bytes, size), &(strl_walk_desc){.error_px = 1, .labels = labels});
        strl_draw_list list = settle(walk, &camera, 500);
        uint32_t points = 0, known = 0;
        for (uint32_t i = 0; i < list.count; i++) {
            const strl_draw_item *item = &list.items[i];
            if (!(item->point_px > 0))
                continue;
            assert_true((item->labels != NULL) == (labels > 0));
            points += item->draw_count;
            for (uint32_t v = 0; item->labels && v < item->vertex_count; v++) {
                assert_true(item->labels[v].part == placement[0].own_part - 1 || item->labels[v].part == UINT32_MAX);
                known += item->labels[v].part != UINT32_MAX;
            }
        }
        assert_true(points > COPIES / 20 && (!labels || known > points / 2));
        strl_walk_close(walk);
    }
}

/* What is read first over a slow link: roots without what is below them, and the ground under the trees with the first
 * placements. */
static void roots_and_large_placements_are_read_first(void **state)
{
    (void)state;
    strl_error err = {0};
    strl_container *container;
    double widest = 0;
    uint32_t first = 0;
    const strl_scene_desc scene = {.name = "landscape", .path = built_path("land.gltf"), .triangles = 6000000};
    assert_int_equal(strl_scene_write(&scene, NULL, NULL, &err), STRL_OK);
    const uint64_t placements = sample_tree_build("land.gltf", "land.stroll", (strl_build_desc){0}).placements;
    assert_true(placements > 512); /* more than a run */
    assert_int_equal(strl_container_open_path(built_path("land.stroll"), &container, &err), STRL_OK);
    for (uint64_t i = 0; i < placements; i++) {
        strl_placement at;
        assert_int_equal(strl_container_placement(container, i, &at, &err), STRL_OK);
        const strl_tree *tree = strl_container_tree(container, at.tree);
        double width = tree->step * (double)(tree->box_max[0] - tree->box_min[0]) *
                       sqrt(at.transform[0] * at.transform[0] + at.transform[4] * at.transform[4] +
                            at.transform[8] * at.transform[8]);
        if (width > widest)
            widest = width, first = (uint32_t)i;
    }
    assert_int_equal(first, 0);
    for (uint32_t i = 0; i < strl_container_get_info(container)->tree_count; i++) {
        strl_node root, below;
        assert_int_equal(strl_container_node(container, i, 0, &root, &err), STRL_OK);
        assert_int_equal(root.page.bytes, root.payload_bytes);
        if (root.child_count) {
            assert_int_equal(strl_container_node(container, i, 1, &below, &err), STRL_OK);
            assert_true(below.page.offset != root.page.offset);
        }
    }
    strl_container_close(container);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(copies_that_show_few_splats_are_drawn_together),
        cmocka_unit_test(labels_are_those_of_the_copies),
        cmocka_unit_test(roots_and_large_placements_are_read_first),
    };
    return cmocka_run_group_tests(tests, create_array, drop_array);
}
