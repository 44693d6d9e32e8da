/* Sample trees hold every triangle of the model exactly once, whatever the model is; their bytes do not depend on
 * threads. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "build/sample_tree.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define SMALLER 8u
#else
#define SMALLER 1u
#endif

/* ---- models */

static double random_unit(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (double)(*state >> 11) * 0x1p-53;
}

/* Three vertices of its own round a place. */
static void add_triangle(mesh_file *mesh, uint64_t *random, const double at[3], double size)
{
    uint32_t corner[3];
    for (int c = 0; c < 3; c++) {
        double p[3];
        for (int k = 0; k < 3; k++)
            p[k] = at[k] + size * (random_unit(random) - 0.5);
        corner[c] = mesh_file_add_vertex(mesh, p[0], p[1], p[2]);
    }
    mesh_file_add_face(mesh, corner[0], corner[1], corner[2]);
}

static void add_soup(mesh_file *mesh, uint32_t count, const double at[3], double extent, double size)
{
    uint64_t random = 5;
    for (uint32_t i = 0; i < count; i++) {
        double p[3];
        for (int k = 0; k < 3; k++)
            p[k] = at[k] + extent * random_unit(&random);
        add_triangle(mesh, &random, p, size);
    }
}

static void assert_same_bytes(const char *a, const char *b)
{
    size_t size, other_size;
    uint8_t *one = built_read_file(built_path(a), &size), *other = built_read_file(built_path(b), &other_size);
    assert_int_equal(size, other_size);
    assert_memory_equal(one, other, size);
    free(one);
    free(other);
}

static void a_surface_is_kept(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    mesh_file_torus(&mesh, 200 / SMALLER, 120);
    strl_build_result result = sample_tree_prove(&mesh);
    assert_int_equal(result.triangles_leaf, mesh.face_count);
    assert_true(result.nodes > (SMALLER > 1 ? 1 : 4));
    mesh_file_free(&mesh);
}

static void colours_go_with_their_corners(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    add_soup(&mesh, 20000 / SMALLER, (const double[3]){0, 0, 0}, 1, 0.02);
    mesh.colour = strl__alloc(mesh.vertex_count, sizeof *mesh.colour);
    assert_non_null(mesh.colour);
    for (uint32_t v = 0; v < mesh.vertex_count; v++)
        for (unsigned k = 0; k < 3; k++)
            mesh.colour[v][k] = (uint8_t)(v * 7919u >> 3 * k);
    sample_tree_prove(&mesh);
    mesh_file_free(&mesh);
}

static void boxes_are_kept(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    for (uint32_t box = 0; box < 3000 / SMALLER; box++) {
        uint32_t first = mesh.vertex_count;
        mesh_file_cube(&mesh);
        for (uint32_t v = first; v < mesh.vertex_count; v++) {
            mesh.position[v][0] = mesh.position[v][0] * 0.6 + box % 20;
            mesh.position[v][1] = mesh.position[v][1] * 0.7 + box / 20 % 20;
            mesh.position[v][2] = mesh.position[v][2] * 0.5 + box / 400;
        }
    }
    sample_tree_prove(&mesh);
    mesh_file_free(&mesh);
}

/* No cell but the root holds them: they may not all be in the root's brick. */
static void triangles_as_large_as_the_model_do_not_overflow_the_root(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    add_soup(&mesh, 60000 / SMALLER, (const double[3]){0, 0, 0}, 0.01, 1);
    strl_build_result result = sample_tree_prove(&mesh);
    assert_true(result.root_triangles > 0);
    assert_true(result.triangles_leaf > 50000 / SMALLER);
    mesh_file_free(&mesh);
}

static void large_and_small_ones_lie_in_one_place(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    add_soup(&mesh, 8000 / SMALLER, (const double[3]){0, 0, 0}, 1, 1);
    add_soup(&mesh, 30000 / SMALLER, (const double[3]){0.2, 0.2, 0.2}, 0.6, 0.003);
    sample_tree_prove(&mesh);
    mesh_file_free(&mesh);
}

/* As deep as cells go: a heap of triangles of some lattice steps in a corner of a model a million times as wide. */
static void a_heap_at_one_spot_is_kept(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    add_soup(&mesh, 10000 / SMALLER, (const double[3]){0.3, 0.7, 0.1}, 1e-7, 1e-7);
    mesh_file_add_face(&mesh, mesh_file_add_vertex(&mesh, 0, 0, 0), mesh_file_add_vertex(&mesh, 1, 0, 0),
                       mesh_file_add_vertex(&mesh, 0, 1, 1));
    sample_tree_prove(&mesh);
    mesh_file_free(&mesh);
}

static void a_triangle_given_often_is_kept_as_often(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    for (uint32_t v = 0; v < 4; v++)
        mesh_file_add_vertex(&mesh, v & 1, v >> 1, v * 0.1);
    for (uint32_t i = 0; i < 10000; i++)
        mesh_file_add_face(&mesh, 0, 1, 2);
    mesh_file_add_face(&mesh, 1, 3, 2);
    strl_build_result result = sample_tree_prove(&mesh);
    assert_int_equal(result.triangles_leaf, 10001);
    mesh_file_free(&mesh);
}

/* More than a brick and its neighbours take at once. */
static void very_many_of_one_kind_go_on_below(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    for (uint32_t v = 0; v < 3; v++)
        mesh_file_add_vertex(&mesh, v == 1, v == 2, 0.5);
    for (uint32_t i = 0; i < 80000; i++)
        mesh_file_add_face(&mesh, i % 3, (i + 1) % 3, (i + 2) % 3);
    sample_tree_prove(&mesh);
    mesh_file_free(&mesh);
}

/* More than some buckets of little memory, in the lowest corner, where keys begin, and in the highest. */
static void several_pieces_share_a_spot(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    mesh_file_torus(&mesh, 64, 40);
    for (int high = 0; high < 2; high++) {
        double at = high ? 100 : -100;
        uint32_t a = mesh_file_add_vertex(&mesh, at, at, at), b = mesh_file_add_vertex(&mesh, at * 0.9999, at, at),
                 c = mesh_file_add_vertex(&mesh, at, at * 0.9999, at);
        for (uint32_t i = 0; i < 150000 / SMALLER; i++)
            mesh_file_add_face(&mesh, a, b, c);
    }
    mesh_file_write_ply(&mesh, built_path("spot.ply"));
    for (unsigned jobs = 1; jobs < 4; jobs += 2) {
        strl_build_result result =
            sample_tree_build("spot.ply", jobs > 1 ? "more.stroll" : "one.stroll",
                              (strl_build_desc){.jobs = jobs, .memory_bytes = STRL_BUILD_LEAST_MEMORY});
        assert_int_equal(result.triangles_leaf, mesh.face_count);
    }
    assert_same_bytes("one.stroll", "more.stroll");
    sample_tree_check("one.stroll");
    sample_tree_compare("one.stroll", &mesh);
    sample_tree_verify("one.stroll", "spot.ply");
    mesh_file_free(&mesh);
}

static void one_triangle_is_a_tree(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    for (uint32_t v = 0; v < 3; v++)
        mesh_file_add_vertex(&mesh, v == 1, v == 2, 0);
    mesh_file_add_face(&mesh, 0, 1, 2);
    strl_build_result result = sample_tree_prove(&mesh);
    assert_int_equal(result.triangles_leaf, 1);
    mesh_file_free(&mesh);
}

static void far_from_the_origin_nothing_is_lost(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    mesh_file_grid(&mesh, 100 / (SMALLER > 1 ? 3 : 1), (const double[3]){512345.25, 5412345.5, 312.125}, 200, 0.05);
    strl_build_result result = sample_tree_prove(&mesh);
    assert_int_equal(result.triangles_leaf, mesh.face_count);
    mesh_file_free(&mesh);
}

/* Slivers round a diagonal: cells in one line, each a corner's width. */
static void a_model_in_one_line_is_kept(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    for (uint32_t i = 0; i < 20000 / SMALLER; i++) {
        double t = i * 1e-3;
        uint32_t a = mesh_file_add_vertex(&mesh, t, t, t),
                 b = mesh_file_add_vertex(&mesh, t + 1e-3, t + 1e-3, t + 1e-3);
        mesh_file_add_face(&mesh, a, b, mesh_file_add_vertex(&mesh, t + 5e-4, t + 5e-4, t + 5.2e-4));
    }
    sample_tree_prove(&mesh);
    mesh_file_free(&mesh);
}

static void two_heaps_far_apart_are_kept(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    add_soup(&mesh, 10000 / SMALLER, (const double[3]){0, 0, 0}, 1, 0.02);
    add_soup(&mesh, 10000 / SMALLER, (const double[3]){1e5, 3e5, -2e5}, 1, 0.02);
    sample_tree_prove(&mesh);
    mesh_file_free(&mesh);
}

/* Corners that differ and no area: neither dropped nor divided by. */
static void add_needles(mesh_file *mesh, uint32_t count)
{
    uint64_t random = 9;
    for (uint32_t i = 0; i < count; i++) {
        double p[3];
        for (int k = 0; k < 3; k++)
            p[k] = floor(1024 * random_unit(&random)) / 1024;
        mesh_file_add_face(mesh, mesh_file_add_vertex(mesh, p[0], p[1], p[2]),
                           mesh_file_add_vertex(mesh, p[0] + 1. / 512, p[1], p[2]),
                           mesh_file_add_vertex(mesh, p[0] + 1. / 256, p[1], p[2]));
    }
}

static void triangles_without_area_are_kept(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    add_needles(&mesh, 5000 / SMALLER);
    sample_tree_prove(&mesh);
    add_soup(&mesh, 5000 / SMALLER, (const double[3]){0, 0, 0}, 1, 0.02);
    sample_tree_prove(&mesh);
    mesh_file_free(&mesh);
}

/* All on the borders of cells of every size. */
static void what_lies_on_borders_of_cells_is_kept(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    mesh_file_grid(&mesh, 64, (const double[3]){-1, -1, 0}, 2, 0);
    for (uint32_t v = 0, count = mesh.vertex_count; v < count; v++)
        mesh_file_add_vertex(&mesh, 0, mesh.position[v][0], mesh.position[v][1]);
    for (uint32_t f = 0, count = mesh.face_count, first = mesh.vertex_count / 2; f < count; f++)
        mesh_file_add_face(&mesh, first + mesh.face[f][0], first + mesh.face[f][1], first + mesh.face[f][2]);
    sample_tree_prove(&mesh);
    mesh_file_free(&mesh);
}

/* Triangles that halve towards a corner: a chain of cells, each with few triangles of its own. */
static void detail_that_grows_towards_a_corner_is_kept(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    uint64_t random = 3;
    for (int shell = 0; shell < 18; shell++)
        for (uint32_t i = 0; i < 1600 / SMALLER; i++) {
            double size = ldexp(1, -shell), p[3];
            for (int k = 0; k < 3; k++)
                p[k] = size * (0.3 + 0.7 * random_unit(&random));
            add_triangle(&mesh, &random, p, size * 0.05);
        }
    sample_tree_prove(&mesh);
    mesh_file_free(&mesh);
}

/* ---- what belongs to triangles */

#define PATCHES 6u
#define PATCH_SIDE 20u

static const char *patch_name(unsigned patch)
{
    static const char *const names[PATCHES] = {"north/a", "north/b", "c", "d", "e", "f"};
    return names[patch];
}

/* Patches side by side, 100 apart; texture coordinates are places within the patch. */
static void write_patches(void)
{
    FILE *file = fopen(built_path("patches.obj"), "w");
    assert_non_null(file);
    fprintf(file, "mtllib patches.mtl\n");
    for (unsigned patch = 0; patch < PATCHES; patch++) {
        fprintf(file, "o %s\nusemtl %s\n", patch_name(patch),
                patch % 3 == 0   ? "plain"
                : patch % 3 == 1 ? "image"
                                 : "red");
        for (unsigned i = 0; i < (PATCH_SIDE + 1) * (PATCH_SIDE + 1); i++) {
            unsigned x = i % (PATCH_SIDE + 1), y = i / (PATCH_SIDE + 1);
            fprintf(file, "v %u %u %u\nvt %.9g %.9g\n", 100 * patch + x, y, (x * y) % 5, (double)x / PATCH_SIDE,
                    1 - (double)y / PATCH_SIDE);
        }
        for (unsigned y = 0; y < PATCH_SIDE; y++)
            for (unsigned x = 0; x < PATCH_SIDE; x++) {
                unsigned a = patch * (PATCH_SIDE + 1) * (PATCH_SIDE + 1) + y * (PATCH_SIDE + 1) + x + 1,
                         d = a + PATCH_SIDE + 1;
                fprintf(file, "f %u/%u %u/%u %u/%u\nf %u/%u %u/%u %u/%u\n", a, a, a + 1, a + 1, d + 1, d + 1, a, a,
                        d + 1, d + 1, d, d);
            }
    }
    assert_int_equal(fclose(file), 0);
    built_write_text("patches.mtl", "newmtl plain\nnewmtl image\nmap_Kd picture.png\nnewmtl red\nKd 1 0 0\n");
}

static void check_vertex(const built_model *model, uint32_t node, uint32_t vertex, uint32_t part, uint32_t material,
                         const uint16_t code[2])
{
    char name[64];
    int64_t cell[3];
    strl_error err = {0};
    built_position(model, node, vertex, cell);
    double x = model->tree.origin[0] + model->tree.step * (double)cell[0],
           y = model->tree.origin[1] + model->tree.step * (double)cell[1];
    unsigned patch = (unsigned)(x / 100);
    assert_int_equal(strl_container_part(model->container, part, name, sizeof name, &err), STRL_OK);
    assert_string_equal(name, patch_name(patch));
    uint32_t rgba;
    assert_int_equal(strl_container_material(model->container, material, name, sizeof name, &rgba, &err), STRL_OK);
    assert_string_equal(name, patch % 3 == 0 ? "plain" : patch % 3 == 1 ? "image" : "red");
    if (patch % 3 == 1) {
        assert_true(fabs(code[0] / 65535. - (x - 100 * patch) / PATCH_SIDE) < 1e-4);
        assert_true(fabs(code[1] / 65535. - y / PATCH_SIDE) < 1e-4);
    }
}

static void parts_materials_and_texture_coordinates_go_with_their_corners(void **state)
{
    (void)state;
    write_patches();
    strl_build_result result = sample_tree_build("patches.obj", "patches.stroll", (strl_build_desc){0});
    assert_int_equal(result.triangles_leaf, PATCHES * PATCH_SIDE * PATCH_SIDE * 2);
    assert_int_equal(result.parts, PATCHES);
    sample_tree_check("patches.stroll");
    sample_tree_verify("patches.stroll", "patches.obj");
    built_model model;
    built_open(&model, built_path("patches.stroll"));
    assert_true(model.info.has_images);
    for (uint32_t n = 0; n < model.tree.node_count; n++) {
        uint32_t count = model.mesh[n].vertex_count;
        uint32_t *part = malloc((count + 1) * sizeof *part), *material = malloc((count + 1) * sizeof *material);
        uint16_t(*code)[2] = malloc((count + 1) * sizeof *code);
        strl_error err = {0};
        assert_true(part && material && code);
        if (strl_container_vertex_parts(model.container, 0, n, count, part, material, &err) != STRL_OK ||
            strl_container_vertex_texcoords(model.container, 0, n, count, code, &err) != STRL_OK)
            fail_msg("%s", err.message);
        for (uint32_t v = 0; v < count; v++)
            check_vertex(&model, n, v, part[v], material[v], (const uint16_t *)code[v]);
        free(part);
        free(material);
        free(code);
    }
    built_close(&model);
}

/* ---- the same, whoever works */

static void the_bytes_do_not_depend_on_the_threads(void **state)
{
    (void)state;
    const unsigned jobs[] = {2, 3, 8};
    mesh_file mesh = {0};
    add_soup(&mesh, 60000 / SMALLER, (const double[3]){0, 0, 0}, 1, 0.01);
    add_soup(&mesh, 6000 / SMALLER, (const double[3]){0, 0, 0}, 1, 0.3);
    mesh_file_write_ply(&mesh, built_path("threads.ply"));
    sample_tree_build("threads.ply", "one.stroll",
                      (strl_build_desc){.jobs = 1, .memory_bytes = STRL_BUILD_LEAST_MEMORY});
    for (size_t i = 0; i < sizeof jobs / sizeof *jobs; i++) {
        sample_tree_build("threads.ply", "more.stroll",
                          (strl_build_desc){.jobs = jobs[i], .memory_bytes = STRL_BUILD_LEAST_MEMORY});
        assert_same_bytes("one.stroll", "more.stroll");
    }
    sample_tree_check("one.stroll");
    sample_tree_compare("one.stroll", &mesh);
    sample_tree_build("threads.ply", "ample.stroll", (strl_build_desc){.memory_bytes = 2048ull << 20});
    sample_tree_check("ample.stroll");
    assert_true(sample_trees_equal("one.stroll", "ample.stroll"));
    mesh_file_free(&mesh);
}

/* ---- what is asked for */

static void nothing_becomes_a_tree_of_nothing(void **state)
{
    (void)state;
    built_write_text("nothing.obj", "v 0 0 0\nv 1 1 1\nv 2 2 2\n");
    strl_build_result result;
    strl_error err = {0};
    const char *inputs[1] = {built_path("nothing.obj")};
    strl_build_desc desc = {.inputs = inputs, .input_count = 1, .output = built_path("nothing.stroll"), .jobs = 2};
    strl_status clusters = strl_build_clusters(&desc, &result, &err),
                samples = strl_build_samples(&desc, &result, &err);
    assert_int_equal(samples, clusters);
    assert_int_equal(samples, STRL_OK);
    assert_int_equal(result.triangles_leaf, 0);
    sample_tree_verify("nothing.stroll", "nothing.obj");
}

static void assert_refused(strl_build_desc desc, const char *word)
{
    strl_build_result result;
    strl_error err = {0};
    const char *inputs[1] = {built_path("asked.ply")};
    unsigned files = built_files_left();
    desc.inputs = inputs;
    desc.input_count = 1;
    desc.output = built_path("asked.stroll");
    assert_int_not_equal(strl_build_samples(&desc, &result, &err), STRL_OK);
    assert_true(err.status == STRL_ERR_ARGUMENT || err.status == STRL_ERR_UNSUPPORTED);
    if (!strstr(err.message, word) || strlen(err.message) < 20)
        fail_msg("%s", err.message);
    assert_int_equal(built_files_left(), files);
}

static void what_samples_cannot_be_asked_for_is_refused(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    mesh_file_cube(&mesh);
    mesh_file_write_ply(&mesh, built_path("asked.ply"));
    mesh_file_free(&mesh);
    assert_refused((strl_build_desc){.certify = true}, "certif");
    assert_refused((strl_build_desc){.no_dependencies = true}, "dependenc");
    assert_refused((strl_build_desc){.probability = 1}, "probability");
    assert_refused((strl_build_desc){.probability = 1.5}, "probability");
    assert_refused((strl_build_desc){.probability = -0.5}, "probability");
    assert_refused((strl_build_desc){.probability = NAN}, "probability");
    assert_refused((strl_build_desc){.memory_bytes = STRL_BUILD_LEAST_MEMORY - 1}, "memory");
    strl_build_result kept =
        sample_tree_build("asked.ply", "asked.stroll", (strl_build_desc){.keep = true, .probability = 0.5});
    assert_int_equal(kept.triangles_leaf, 12);
    assert_false(kept.scratch_kept);
}

/* Theorem 1: more draws for more certainty, so more triangles at the root of a model that has more than it draws. */
static void a_higher_probability_stores_more_above(void **state)
{
    (void)state;
    const double probabilities[] = {0.05, 0.5, 0.99, 1 - 1e-6, 1 - 1e-12};
    uint32_t before = 0;
    mesh_file mesh = {0};
    add_soup(&mesh, 40000, (const double[3]){0, 0, 0}, 1, 0.05);
    mesh_file_write_ply(&mesh, built_path("asked.ply"));
    for (size_t i = 0; i < sizeof probabilities / sizeof *probabilities; i++) {
        strl_build_result result =
            sample_tree_build("asked.ply", "asked.stroll", (strl_build_desc){.probability = probabilities[i]});
        assert_true(result.root_triangles > before);
        before = result.root_triangles;
        sample_tree_compare("asked.stroll", &mesh);
    }
    sample_tree_build("asked.ply", "default.stroll", (strl_build_desc){0});
    sample_tree_build("asked.ply", "asked.stroll", (strl_build_desc){.probability = 1 - 1e-6});
    assert_same_bytes("default.stroll", "asked.stroll");
    mesh_file_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_surface_is_kept),
        cmocka_unit_test(colours_go_with_their_corners),
        cmocka_unit_test(boxes_are_kept),
        cmocka_unit_test(triangles_as_large_as_the_model_do_not_overflow_the_root),
        cmocka_unit_test(large_and_small_ones_lie_in_one_place),
        cmocka_unit_test(a_heap_at_one_spot_is_kept),
        cmocka_unit_test(a_triangle_given_often_is_kept_as_often),
        cmocka_unit_test(very_many_of_one_kind_go_on_below),
        cmocka_unit_test(several_pieces_share_a_spot),
        cmocka_unit_test(one_triangle_is_a_tree),
        cmocka_unit_test(far_from_the_origin_nothing_is_lost),
        cmocka_unit_test(a_model_in_one_line_is_kept),
        cmocka_unit_test(two_heaps_far_apart_are_kept),
        cmocka_unit_test(triangles_without_area_are_kept),
        cmocka_unit_test(what_lies_on_borders_of_cells_is_kept),
        cmocka_unit_test(detail_that_grows_towards_a_corner_is_kept),
        cmocka_unit_test(parts_materials_and_texture_coordinates_go_with_their_corners),
        cmocka_unit_test(the_bytes_do_not_depend_on_the_threads),
        cmocka_unit_test(nothing_becomes_a_tree_of_nothing),
        cmocka_unit_test(what_samples_cannot_be_asked_for_is_refused),
        cmocka_unit_test(a_higher_probability_stores_more_above),
    };
    return cmocka_run_group_tests(tests, built_setup, built_teardown);
}
