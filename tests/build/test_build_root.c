/* Models that no simplifier likes: each is built in bounded time, ends below the root's bound and keeps its claims. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include "build/cuts.h"
#include "build/meshes.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define SMALLER 10u
#define MOST_SECONDS 300
#else
#define SMALLER 2u
#define MOST_SECONDS 60
#endif

/* Claims are rounded up when they are coded. */
#define CLAIM_ROUNDING 1.05
/* What nodes of the first two levels may claim where triangles stand so far apart. */
#define MOST_SPACINGS 4

/* samples: of each cut, each way; few where all triangles overlap, because then every search visits all of them */
static void build_and_check(const char *input, const char *name, uint32_t samples)
{
    const char *output = built_path("hard.stroll");
    strl_build_result result = built_build_one(input, output);
    if (result.root_triangles > STRL_ROOT_MAX_TRIANGLES || result.root_triangles == 0)
        fail_msg("%s: the root has %u triangles", name, result.root_triangles);
    if (result.seconds > MOST_SECONDS)
        fail_msg("%s: built in %.0f s", name, result.seconds);
    assert_int_equal(result.triangles_in, result.triangles_leaf + result.dropped_nonfinite + result.dropped_degenerate);
    built_model model;
    strl_error err = {0};
    built_open(&model, built_path("hard.stroll"));
    for (uint32_t i = 0; i < model.tree.node_count; i++) {
        const strl_node *node = &model.node[i];
        double diagonal = hypot(hypot((double)(node->group_box_max[0] - node->group_box_min[0]),
                                      (double)(node->group_box_max[1] - node->group_box_min[1])),
                                (double)(node->group_box_max[2] - node->group_box_min[2]));
        if (strl_pm_check(&model.mesh[i], &err) != STRL_OK)
            fail_msg("%s: node %u: %s", name, i, err.message);
        diagonal = 1 + diagonal * CLAIM_ROUNDING;
        if (node->geometric_max > diagonal || node->appearance_max > diagonal)
            fail_msg("%s: node %u claims %g and %g in a box of %g", name, i, node->geometric_max, node->appearance_max,
                     diagonal);
    }
    assert_uniform_cuts_hold(&model, name, 4, samples / SMALLER);
    built_close(&model);
    remove(built_path("hard.stroll"));
}

static void check_mesh(mesh_file *mesh, const char *name, uint32_t samples)
{
    mesh_file_write_ply(mesh, built_path("hard.ply"));
    mesh_file_free(mesh);
    build_and_check(built_path("hard.ply"), name, samples);
    remove(built_path("hard.ply"));
}

static double unit(uint64_t *random)
{
    return (double)(mesh_random(random) >> 11) * 0x1p-53;
}

static void twenty_thousand_boxes(void **state)
{
    (void)state;
    built_scene("boxes", "boxes.ply", 12u * 20000u / SMALLER, false);
    build_and_check(built_path("boxes.ply"), "boxes", 4000);
}

static void a_soup_of_random_triangles(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    uint64_t random = 4;
    for (uint32_t t = 0; t < 100000 / SMALLER; t++) {
        double at[3] = {unit(&random), unit(&random), unit(&random)};
        for (int c = 0; c < 3; c++)
            mesh_file_add_vertex(&mesh, at[0] + 0.02 * unit(&random), at[1] + 0.02 * unit(&random),
                                 at[2] + 0.02 * unit(&random));
        mesh_file_add_face(&mesh, 3 * t, 3 * t + 1, 3 * t + 2);
    }
    check_mesh(&mesh, "soup", 4000);
}

/* None can be simplified alone, and none may be joined to another but by the ladder: that climbs in small steps. */
static void separate_triangles_each_a_part_of_its_own(void **state)
{
    (void)state;
    uint32_t columns = 150, rows = 120 / (SMALLER / 5 + 1);
    FILE *file = fopen(built_path("parts.obj"), "w");
    assert_non_null(file);
    for (uint32_t t = 0; t < columns * rows; t++) {
        uint32_t x = t % columns, y = t / columns;
        fprintf(file, "o part%u\nv %u %u 0\nv %u.5 %u 0\nv %u %u.5 0\nf -3 -2 -1\n", t, x, y, x, y, x, y);
    }
    assert_int_equal(fclose(file), 0);
    build_and_check(built_path("parts.obj"), "parts", 400);
    built_model model;
    built_build_one(built_path("parts.obj"), built_path("hard.stroll"));
    built_open(&model, built_path("hard.stroll"));
    double spacing = 1 / model.tree.step;
    for (uint32_t i = 0; i < model.tree.node_count; i++)
        if (model.node[i].level < 2 && model.node[i].geometric_max > MOST_SPACINGS * spacing)
            fail_msg("separate triangles: node %u claims %g spacings", i, model.node[i].geometric_max / spacing);
    built_close(&model);
    remove(built_path("parts.obj"));
    remove(built_path("hard.stroll"));
}

static void one_fan_of_fifty_thousand(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    uint32_t count = 50000 / SMALLER;
    mesh_file_add_vertex(&mesh, 0, 0, 0.1);
    for (uint32_t i = 0; i < count; i++) {
        double angle = 6.28318530717959 * i / count;
        mesh_file_add_vertex(&mesh, cos(angle), sin(angle), 0.01 * sin(50 * angle));
    }
    for (uint32_t i = 0; i < count; i++)
        mesh_file_add_face(&mesh, 0, 1 + i, 1 + (i + 1) % count);
    check_mesh(&mesh, "fan", 400);
}

/* All share one edge. */
static void a_book_of_forty_thousand_pages(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    uint32_t count = 40000 / SMALLER;
    mesh_file_add_vertex(&mesh, 0, 0, 0);
    mesh_file_add_vertex(&mesh, 0, 0, 1);
    for (uint32_t i = 0; i < count; i++) {
        double angle = 6.28318530717959 * i / count;
        mesh_file_add_face(&mesh, 0, 1, mesh_file_add_vertex(&mesh, cos(angle), sin(angle), 0.5));
    }
    check_mesh(&mesh, "book", 200);
}

static void one_triangle_a_hundred_thousand_times(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    mesh_file_add_vertex(&mesh, 0, 0, 0);
    mesh_file_add_vertex(&mesh, 1, 0, 0);
    mesh_file_add_vertex(&mesh, 0, 1, 0);
    for (uint32_t t = 0; t < 100000 / SMALLER; t++)
        mesh_file_add_face(&mesh, 0, 1, 2);
    check_mesh(&mesh, "one triangle", 40);
}

/* Faces of a few points, in every combination, thousands of times. */
static void twenty_points_with_a_hundred_thousand_triangles(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    uint64_t random = 9;
    for (int p = 0; p < 20; p++)
        mesh_file_add_vertex(&mesh, unit(&random), unit(&random), unit(&random));
    for (uint32_t t = 0; t < 100000 / SMALLER; t++) {
        uint32_t a = mesh_below(&random, 18), b = a + 1 + mesh_below(&random, 19 - a - 1);
        mesh_file_add_face(&mesh, a, b, b + 1);
    }
    check_mesh(&mesh, "twenty points", 40);
}

/* None shares an edge, and corners of one triangle are a cube's edge apart. */
static void triangles_between_the_corners_of_a_cube(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    uint64_t random = 21;
    for (uint32_t t = 0; t < 100000 / SMALLER; t++) {
        uint32_t first = mesh_below(&random, 8), step = 1 + mesh_below(&random, 3);
        for (uint32_t c = 0; c < 3; c++) {
            uint32_t at = (first + c * step) % 8;
            mesh_file_add_vertex(&mesh, (at & 1) + 0.01 * unit(&random), (at >> 1 & 1) + 0.01 * unit(&random),
                                 (at >> 2) + 0.01 * unit(&random));
        }
        mesh_file_add_face(&mesh, 3 * t, 3 * t + 1, 3 * t + 2);
    }
    check_mesh(&mesh, "cube", 400);
}

static void a_strip_as_thin_as_a_line(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    uint32_t count = 30000 / SMALLER;
    for (uint32_t i = 0; i <= count; i++) {
        mesh_file_add_vertex(&mesh, i, 0, 0);
        mesh_file_add_vertex(&mesh, i, 0.05, 0);
    }
    for (uint32_t i = 0; i < count; i++) {
        mesh_file_add_face(&mesh, 2 * i, 2 * i + 2, 2 * i + 1);
        mesh_file_add_face(&mesh, 2 * i + 1, 2 * i + 2, 2 * i + 3);
    }
    check_mesh(&mesh, "strip", 4000);
}

/* Triangles without area whose corners are three different points. */
static void all_points_on_one_line(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    uint32_t count = 60000 / SMALLER;
    for (uint32_t i = 0; i < count + 2; i++)
        mesh_file_add_vertex(&mesh, i, 2. * i, 0);
    for (uint32_t i = 0; i < count; i++)
        mesh_file_add_face(&mesh, i, i + 1, i + 2);
    check_mesh(&mesh, "line", 4000);
}

static void a_grid_far_from_the_origin(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    mesh_file_grid(&mesh, 220 / (SMALLER / 3 + 1), (const double[3]){1e7, -1e7, 1e7}, 1, 0.02);
    check_mesh(&mesh, "far grid", 4000);
}

static void a_grid_of_a_billionth_of_a_millimetre(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    mesh_file_grid(&mesh, 220 / (SMALLER / 3 + 1), (const double[3]){0, 0, 0}, 1e-12, 0.02);
    check_mesh(&mesh, "tiny grid", 4000);
}

static void a_grid_of_a_galaxy(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    mesh_file_grid(&mesh, 100, (const double[3]){-1e30, 0, 3e29}, 1e30, 0.02);
    check_mesh(&mesh, "huge grid", 4000);
}

/* Fine detail in one corner of a model a million times larger. */
static void a_speck_of_detail_in_a_large_model(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    mesh_file_grid(&mesh, 200 / (SMALLER / 3 + 1), (const double[3]){0, 0, 0}, 1, 0.02);
    mesh_file_grid(&mesh, 4, (const double[3]){-5e5, -5e5, -1}, 1e6, 0);
    check_mesh(&mesh, "speck", 4000);
}

/* A point for every triangle of a comb: all ends of teeth are open, none share an edge. */
static void triangles_that_share_single_points(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    uint32_t count = 60000 / SMALLER, last = mesh_file_add_vertex(&mesh, 0, 0, 0);
    for (uint32_t i = 0; i < count; i++) {
        double x = 0.01 * (i + 1) * cos(i * 0.01), y = 0.01 * (i + 1) * sin(i * 0.01);
        uint32_t next = mesh_file_add_vertex(&mesh, x, y, 0), tip = mesh_file_add_vertex(&mesh, x, y, 1 + (i & 1));
        mesh_file_add_face(&mesh, last, next, tip);
        last = next;
    }
    check_mesh(&mesh, "comb", 4000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(twenty_thousand_boxes),
        cmocka_unit_test(a_soup_of_random_triangles),
        cmocka_unit_test(separate_triangles_each_a_part_of_its_own),
        cmocka_unit_test(one_fan_of_fifty_thousand),
        cmocka_unit_test(a_book_of_forty_thousand_pages),
        cmocka_unit_test(one_triangle_a_hundred_thousand_times),
        cmocka_unit_test(twenty_points_with_a_hundred_thousand_triangles),
        cmocka_unit_test(triangles_between_the_corners_of_a_cube),
        cmocka_unit_test(a_strip_as_thin_as_a_line),
        cmocka_unit_test(all_points_on_one_line),
        cmocka_unit_test(a_grid_far_from_the_origin),
        cmocka_unit_test(a_grid_of_a_billionth_of_a_millimetre),
        cmocka_unit_test(a_grid_of_a_galaxy),
        cmocka_unit_test(a_speck_of_detail_in_a_large_model),
        cmocka_unit_test(triangles_that_share_single_points),
    };
    return cmocka_run_group_tests(tests, built_setup, built_teardown);
}
