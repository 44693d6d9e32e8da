/* What goes into a build comes out of its leaves: triangles, parts, normals, wedges; and nothing
 * depends on the threads. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "build/built.h"
#include "geometry/octahedral.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define SMALLER 8u
#else
#define SMALLER 1u
#endif

/* ---- multisets of triangles ---- */
static int compare_faces(const void *a, const void *b)
{
    const int64_t *x = a, *y = b;
    for (int i = 0; i < 9; i++)
        if (x[i] != y[i])
            return x[i] < y[i] ? -1 : 1;
    return 0;
}

/* Turns each so that its least corner comes first, which keeps the winding. */
static void normalise(uint64_t count, int64_t (*triangle)[3][3])
{
    for (uint64_t t = 0; t < count; t++) {
        int64_t turned[3][3];
        unsigned least = 0;
        for (unsigned c = 1; c < 3; c++)
            for (int k = 0; k < 3; k++)
                if (triangle[t][c][k] != triangle[t][least][k]) {
                    least = triangle[t][c][k] < triangle[t][least][k] ? c : least;
                    break;
                }
        for (unsigned c = 0; c < 3; c++)
            memcpy(turned[c], triangle[t][(least + c) % 3], sizeof turned[c]);
        memcpy(triangle[t], turned, sizeof turned);
    }
    qsort(triangle, count, sizeof *triangle, compare_faces);
}

/* The input on the lattice that the container states; triangles with equal corners are left out. */
static int64_t (*expected_faces(const mesh_file *mesh, const strl_tree *tree, uint64_t *count))[3][3]
{
    int64_t(*triangle)[3][3] = malloc((mesh->face_count + 1u) * sizeof *triangle);
    assert_non_null(triangle);
    *count = 0;
    for (uint32_t f = 0; f < mesh->face_count; f++) {
        int64_t(*to)[3] = triangle[*count];
        bool kept = true;
        for (int c = 0; c < 3; c++)
            for (int k = 0; k < 3; k++) {
                double value = mesh->position[mesh->face[f][c]][k];
                kept &= isfinite(value) != 0;
                to[c][k] = isfinite(value) ? (int64_t)nearbyint((value - tree->origin[k]) / tree->step) : 0;
            }
        for (int c = 0; c < 3; c++)
            kept &= memcmp(to[c], to[(c + 1) % 3], sizeof to[c]) != 0;
        *count += kept;
    }
    return triangle;
}

static void assert_leaves_are_the_input(const mesh_file *mesh, const char *path)
{
    built_model model;
    uint64_t expected, found;
    built_open(&model, path);
    int64_t(*in)[3][3] = expected_faces(mesh, &model.tree, &expected), (*out)[3][3] = built_leaves(&model, &found);
    assert_int_equal(found, expected);
    normalise(expected, in);
    normalise(found, out);
    for (uint64_t t = 0; t < found; t++)
        if (memcmp(in[t], out[t], sizeof in[t]))
            fail_msg("triangle %llu of the leaves is not one of the input", (unsigned long long)t);
    free(in);
    free(out);
    built_close(&model);
}

static void the_leaves_are_the_input(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    mesh_file_torus(&mesh, 240 / SMALLER, 120);
    mesh_file_write_ply(&mesh, built_path("torus.ply"));
    strl_build_result result = built_build_one(built_path("torus.ply"), built_path("torus.stroll"));
    assert_int_equal(result.triangles_in, mesh.face_count);
    assert_int_equal(result.triangles_leaf, mesh.face_count);
    assert_leaves_are_the_input(&mesh, built_path("torus.stroll"));
    mesh_file_free(&mesh);
}

static void what_is_dropped_is_counted_by_kind(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    mesh_file_grid(&mesh, 60, (const double[3]){0, 0, 0}, 1, 0.05);
    uint32_t bad[3] = {mesh_file_add_vertex(&mesh, NAN, 0, 0), mesh_file_add_vertex(&mesh, 0, INFINITY, 0),
                       mesh_file_add_vertex(&mesh, 0.5, 0.5, -INFINITY)};
    for (uint32_t i = 0; i < 3; i++)
        mesh_file_add_face(&mesh, 5, bad[i], 6);
    mesh_file_add_face(&mesh, bad[0], bad[1], bad[2]);
    for (uint32_t i = 0; i < 5; i++)
        mesh_file_add_face(&mesh, i, i, i + 1); /* degenerate as given */
    mesh_file_add_face(
        &mesh, 7, mesh_file_add_vertex(&mesh, mesh.position[7][0], mesh.position[7][1] + 1e-13, mesh.position[7][2]),
        9);
    mesh_file_write_ply(&mesh, built_path("drops.ply"));
    strl_build_result result = built_build_one(built_path("drops.ply"), built_path("drops.stroll"));
    assert_int_equal(result.triangles_in, mesh.face_count);
    assert_int_equal(result.dropped_nonfinite, 4);
    assert_int_equal(result.dropped_degenerate, 6);
    assert_int_equal(result.triangles_in, result.triangles_leaf + result.dropped_nonfinite + result.dropped_degenerate);
    assert_leaves_are_the_input(&mesh, built_path("drops.stroll"));
    built_model model;
    built_open(&model, built_path("drops.stroll"));
    assert_int_equal(model.info.triangles_in, result.triangles_in);
    assert_int_equal(model.info.dropped_nonfinite, 4);
    assert_int_equal(model.info.dropped_degenerate, 6);
    built_close(&model);
    mesh_file_free(&mesh);
    built_write_text("lines.obj",
                     "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\nl 1 2 3\nl 2 4\np 1\np 2 3\nf 1 2 3\nf 1 2\nf 2 4 3\n");
    result = built_build_one(built_path("lines.obj"), built_path("lines.stroll"));
    assert_int_equal(result.triangles_leaf, 2);
    assert_true(result.dropped_lines >= 2 && result.dropped_points >= 2);
    assert_int_equal(result.triangles_in, result.triangles_leaf + result.dropped_nonfinite + result.dropped_degenerate);
}

static void faces_given_twice_stay_twice(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    mesh_file_sphere(&mesh, 40, 60);
    for (uint32_t f = 0, count = mesh.face_count; f < count; f++) {
        uint32_t corner[3];
        memcpy(corner, mesh.face[f], sizeof corner);
        mesh_file_add_face(&mesh, corner[0], corner[1], corner[2]);
        if (f % 3 == 0)
            mesh_file_add_face(&mesh, corner[2], corner[1], corner[0]);
    }
    mesh_file_write_ply(&mesh, built_path("twice.ply"));
    strl_build_result result = built_build_one(built_path("twice.ply"), built_path("twice.stroll"));
    assert_int_equal(result.triangles_leaf, mesh.face_count);
    assert_leaves_are_the_input(&mesh, built_path("twice.stroll"));
    mesh_file_free(&mesh);
}

/* ---- parts ---- */
static void part_names(const built_model *model, char names[8][64])
{
    strl_error err = {0};
    assert_true(model->info.part_count <= 8);
    for (uint32_t p = 0; p < model->info.part_count; p++)
        if (strl_container_part(model->container, p, names[p], 64, &err) != STRL_OK)
            fail_msg("%s", err.message);
}

/* Every vertex of the leaves names the part whose name ends with the letter that its position stands for. */
static void assert_parts_lie_where_they_were(const built_model *model, char names[8][64], const char *letters)
{
    for (uint32_t i = 0; i < model->tree.node_count; i++) {
        const strl_pm *mesh = &model->mesh[i];
        for (uint32_t v = 0; v < mesh->vertex_count && model->node[i].child_count == 0; v++) {
            int64_t cell[3];
            built_position(model, i, v, cell);
            double x = model->tree.origin[0] + model->tree.step * (double)cell[0];
            const strl_palette_entry *entry = &mesh->palette[mesh->palette_index ? mesh->palette_index[v] : 0];
            assert_true(entry->part < model->info.part_count);
            const char *name = names[entry->part];
            assert_int_equal(name[strlen(name) - 1], letters[(int)floor(x / 10)]);
        }
    }
}

static void with_several_inputs_each_file_is_a_group(void **state)
{
    (void)state;
    built_write_text("one.obj",
                     "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 10 0 0\nv 11 0 0\nv 10 1 0\no a\nf 1 2 3\no b\nf 4 5 6\n");
    built_write_text("two.obj",
                     "v 20 0 0\nv 21 0 0\nv 20 1 0\nv 30 0 0\nv 31 0 0\nv 30 1 0\ng c\nf 1 2 3\ng d\nf 4 5 6\n");
    const char *inputs[2] = {built_path("one.obj"), built_path("two.obj")};
    strl_build_result result = built_build(inputs, 2, built_path("groups.stroll"), 0);
    assert_int_equal(result.inputs, 2);
    assert_int_equal(result.triangles_leaf, 4);
    built_model model;
    char names[8][64];
    built_open(&model, built_path("groups.stroll"));
    part_names(&model, names);
    const char *const expected[4] = {"one.obj/a", "one.obj/b", "two.obj/c", "two.obj/d"};
    for (int e = 0; e < 4; e++) {
        unsigned found = 0;
        for (uint32_t p = 0; p < model.info.part_count; p++)
            found += !strcmp(names[p], expected[e]);
        assert_int_equal(found, 1);
    }
    assert_parts_lie_where_they_were(&model, names, "abcd");
    built_close(&model);
    /* one input alone keeps its names */
    result = built_build_one(built_path("one.obj"), built_path("single.stroll"));
    built_open(&model, built_path("single.stroll"));
    part_names(&model, names);
    assert_parts_lie_where_they_were(&model, names, "ab");
    for (uint32_t p = 0; p < model.info.part_count; p++)
        assert_null(strchr(names[p], '/'));
    built_close(&model);
}

static void inputs_that_disagree_about_up_need_the_option(void **state)
{
    (void)state;
    built_write_text("up.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    mesh_file mesh = {0};
    mesh_file_cube(&mesh);
    mesh_file_write_ply(&mesh, built_path("up.ply"));
    mesh_file_free(&mesh);
    const char *inputs[2] = {built_path("up.obj"), built_path("up.ply")};
    strl_build_desc desc = {.inputs = inputs, .input_count = 2, .output = built_path("up.stroll"), .jobs = 1};
    strl_build_result result;
    strl_error err = {0};
    assert_int_equal(strl_build_clusters(&desc, &result, &err), STRL_ERR_ARGUMENT);
    assert_non_null(strstr(err.message, "up"));
    desc.up_axis = 3;
    desc.unit = "mm";
    desc.output = built_path("up.stroll");
    assert_int_equal(strl_build_clusters(&desc, &result, &err), STRL_OK);
    built_model model;
    built_open(&model, built_path("up.stroll"));
    assert_int_equal(model.info.up_axis, 2);
    assert_string_equal(model.info.unit, "mm");
    built_close(&model);
}

/* ---- normals and wedges ---- */
static void leaf_normal(const built_model *model, uint32_t node, uint32_t vertex, float normal[3])
{
    strl_oct_decode(model->mesh[node].normal[vertex], normal);
}

/* Least cosine between the vertices' normals and, at each, the face's or the direction from the origin. */
static double least_agreement(const built_model *model, bool radial)
{
    double least = 1;
    for (uint32_t i = 0; i < model->tree.node_count; i++) {
        const strl_pm *mesh = &model->mesh[i];
        for (uint32_t t = 0; t < mesh->triangle_count && model->node[i].child_count == 0; t++) {
            double p[3][3], n[3], e[2][3];
            for (int c = 0; c < 3; c++) {
                int64_t cell[3];
                built_position(model, i, mesh->triangle[t][c], cell);
                for (int k = 0; k < 3; k++)
                    p[c][k] = model->tree.origin[k] + model->tree.step * (double)cell[k];
            }
            for (int k = 0; k < 3; k++)
                e[0][k] = p[1][k] - p[0][k], e[1][k] = p[2][k] - p[0][k];
            for (int k = 0; k < 3; k++)
                n[k] = e[0][(k + 1) % 3] * e[1][(k + 2) % 3] - e[0][(k + 2) % 3] * e[1][(k + 1) % 3];
            for (int c = 0; c < 3; c++) {
                const double *wanted = radial ? p[c] : n;
                float found[3];
                leaf_normal(model, i, mesh->triangle[t][c], found);
                double length = sqrt(wanted[0] * wanted[0] + wanted[1] * wanted[1] + wanted[2] * wanted[2]);
                least = fmin(least, (wanted[0] * found[0] + wanted[1] * found[1] + wanted[2] * found[2]) / length);
            }
        }
    }
    return least;
}

static void missing_normals_are_computed_with_a_crease(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    built_model model;
    mesh_file_cube(&mesh);
    mesh_file_write_ply(&mesh, built_path("cube.ply"));
    built_build_one(built_path("cube.ply"), built_path("cube.stroll"));
    built_open(&model, built_path("cube.stroll"));
    assert_int_equal(model.tree.node_count, 1);
    assert_int_equal(model.mesh[0].vertex_count, 24); /* 8 corners, each with three wedges */
    assert_true(least_agreement(&model, false) > 0.9999);
    built_close(&model);
    mesh_file_free(&mesh);
    mesh_file_sphere(&mesh, 60, 90);
    mesh_file_write_ply(&mesh, built_path("sphere.ply"));
    built_build_one(built_path("sphere.ply"), built_path("sphere.stroll"));
    built_open(&model, built_path("sphere.stroll"));
    assert_true(least_agreement(&model, true) > 0.999);
    uint32_t vertices = 0, leaves = 0;
    for (uint32_t i = 0; i < model.tree.node_count; i++)
        if (model.node[i].child_count == 0) {
            vertices += model.mesh[i].vertex_count;
            leaves++;
        }
    assert_true(leaves > 1);
    assert_true(vertices >= mesh.vertex_count &&
                vertices < mesh.vertex_count * 11 / 10); /* no seams but those of leaves */
    built_close(&model);
    mesh_file_free(&mesh);
}

/* Two planes that meet at an angle just below or above the crease of 40 degrees. */
static void the_crease_is_at_forty_degrees(void **state)
{
    (void)state;
    for (int above = 0; above < 2; above++) {
        mesh_file mesh = {0};
        double angle = (above ? 41.5 : 38.5) * 3.14159265358979 / 180;
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 2; j++)
                mesh_file_add_vertex(&mesh, i == 0 ? -1 : i == 1 ? 0 : cos(angle), j, i == 2 ? sin(angle) : 0);
        for (uint32_t i = 0; i < 2; i++) {
            mesh_file_add_face(&mesh, 2 * i, 2 * i + 2, 2 * i + 3);
            mesh_file_add_face(&mesh, 2 * i, 2 * i + 3, 2 * i + 1);
        }
        mesh_file_write_ply(&mesh, built_path("crease.ply"));
        mesh_file_free(&mesh);
        built_build_one(built_path("crease.ply"), built_path("crease.stroll"));
        built_model model;
        built_open(&model, built_path("crease.stroll"));
        assert_int_equal(model.mesh[0].vertex_count, above ? 8 : 6);
        built_close(&model);
    }
}

static void normals_and_colours_that_are_given_stay(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    mesh_file_grid(&mesh, 30, (const double[3]){0, 0, 0}, 1, 0);
    mesh.normal = strl__alloc(mesh.vertex_count, sizeof *mesh.normal);
    mesh.colour = strl__alloc(mesh.vertex_count, sizeof *mesh.colour);
    assert_non_null(mesh.normal);
    assert_non_null(mesh.colour);
    for (uint32_t v = 0; v < mesh.vertex_count; v++) {
        float x = (float)mesh.position[v][0],
              y = (float)mesh.position[v][1]; /* nothing to do with the plane; not of unit length */
        mesh.normal[v][0] = 3, mesh.normal[v][1] = x - 0.5f, mesh.normal[v][2] = y;
        mesh.colour[v][0] = (uint8_t)(255 * x), mesh.colour[v][1] = (uint8_t)(255 * y), mesh.colour[v][2] = 77;
    }
    mesh_file_write_ply(&mesh, built_path("given.ply"));
    mesh_file_free(&mesh);
    built_build_one(built_path("given.ply"), built_path("given.stroll"));
    built_model model;
    built_open(&model, built_path("given.stroll"));
    assert_true(model.info.has_colour);
    assert_int_equal(model.tree.node_count, 1);
    const strl_pm *pm = &model.mesh[0];
    assert_int_equal(pm->vertex_count, 31 * 31);
    assert_non_null(pm->colour);
    for (uint32_t v = 0; v < pm->vertex_count; v++) {
        int64_t cell[3];
        float found[3], x, y;
        built_position(&model, 0, v, cell);
        x = (float)(model.tree.origin[0] + model.tree.step * (double)cell[0]);
        y = (float)(model.tree.origin[1] + model.tree.step * (double)cell[1]);
        leaf_normal(&model, 0, v, found);
        float wanted[3] = {3, x - 0.5f, y}, length = sqrtf(9 + wanted[1] * wanted[1] + y * y);
        for (int k = 0; k < 3; k++)
            assert_true(fabsf(found[k] - wanted[k] / length) < 0.005f);
        assert_true(fabsf((float)(pm->colour[v] & 255) - 255 * x) < 1.5f);
        assert_true(fabsf((float)(pm->colour[v] >> 8 & 255) - 255 * y) < 1.5f);
        assert_int_equal(pm->colour[v] >> 16, 0xff4d);
    }
    built_close(&model);
}

/* ---- the result, the bytes, the folder ---- */
static void the_result_says_what_the_file_holds(void **state)
{
    (void)state;
    unsigned before = built_files_left();
    built_scene("isosurface", "facts.ply", 60000 / SMALLER, true);
    strl_build_result result = built_build_one(built_path("facts.ply"), built_path("facts.stroll"));
    assert_int_equal(built_files_left(), before + 2); /* no scratch, nothing but input and output */
    size_t size;
    free(built_read_file(built_path("facts.stroll"), &size));
    assert_int_equal(result.bytes_out, size);
    built_model model;
    built_open(&model, built_path("facts.stroll"));
    uint64_t leaf = 0, vertices = 0;
    for (uint32_t i = 0; i < model.tree.node_count; i++) {
        leaf += model.node[i].child_count ? 0 : model.node[i].triangle_count;
        vertices += model.node[i].child_count ? 0 : model.node[i].vertex_count;
        assert_int_equal(model.node[i].triangle_count, model.mesh[i].triangle_count);
        assert_int_equal(model.node[i].vertex_count, model.mesh[i].vertex_count);
        assert_int_equal(model.node[i].step_count, model.mesh[i].step_count);
    }
    assert_int_equal(result.triangles_leaf, leaf);
    assert_int_equal(result.vertices, vertices);
    assert_int_equal(result.nodes, model.tree.node_count);
    assert_int_equal(result.groups, model.tree.group_count);
    assert_int_equal(result.levels, model.tree.level_count);
    assert_int_equal(result.root_triangles, model.node[0].base_triangle_count);
    assert_int_equal(result.root_triangles, model.tree.root_triangles);
    assert_int_equal(result.parts, model.info.part_count);
    assert_int_equal(result.placements, 1);
    assert_true(result.root_triangles > 0 && result.root_triangles <= STRL_ROOT_MAX_TRIANGLES);
    assert_true(result.seconds > 0 && result.cpu_seconds > 0);
    assert_true(result.peak_rss_bytes > 1 << 20);
    if (result.scratch_bytes == 0 || result.scratch_bytes > 80 * result.triangles_in)
        fail_msg("%llu bytes of scratch for %llu triangles", (unsigned long long)result.scratch_bytes,
                 (unsigned long long)result.triangles_in);
    built_close(&model);
}

static void the_bytes_do_not_depend_on_the_threads(void **state)
{
    (void)state;
    const unsigned jobs[] = {1, 2, 3, 8};
    size_t first_size = 0;
    uint8_t *first = NULL;
    built_scene("isosurface", "jobs.ply", 120000 / SMALLER, true);
    for (unsigned i = 0; i < 4; i++) {
        const char *input = built_path("jobs.ply");
        size_t size;
        built_build(&input, 1, built_path("jobs.stroll"), jobs[i]);
        uint8_t *bytes = built_read_file(built_path("jobs.stroll"), &size);
        if (first) {
            assert_int_equal(size, first_size);
            if (memcmp(first, bytes, size))
                fail_msg("%u threads write other bytes than one", jobs[i]);
            free(bytes);
        } else {
            first = bytes;
            first_size = size;
        }
    }
    free(first);
}

static void an_older_output_is_replaced(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    mesh_file_cube(&mesh);
    mesh_file_write_ply(&mesh, built_path("replace.ply"));
    mesh_file_free(&mesh);
    built_write_text("replace.stroll", "an older file");
    strl_build_result result = built_build_one(built_path("replace.ply"), built_path("replace.stroll"));
    size_t size;
    uint8_t *bytes = built_read_file(built_path("replace.stroll"), &size);
    assert_int_equal(size, result.bytes_out);
    assert_memory_equal(bytes, "STROLL", 6);
    free(bytes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_leaves_are_the_input),
        cmocka_unit_test(what_is_dropped_is_counted_by_kind),
        cmocka_unit_test(faces_given_twice_stay_twice),
        cmocka_unit_test(with_several_inputs_each_file_is_a_group),
        cmocka_unit_test(inputs_that_disagree_about_up_need_the_option),
        cmocka_unit_test(missing_normals_are_computed_with_a_crease),
        cmocka_unit_test(the_crease_is_at_forty_degrees),
        cmocka_unit_test(normals_and_colours_that_are_given_stay),
        cmocka_unit_test(the_result_says_what_the_file_holds),
        cmocka_unit_test(the_bytes_do_not_depend_on_the_threads),
        cmocka_unit_test(an_older_output_is_replaced),
    };
    return cmocka_run_group_tests(tests, built_setup, built_teardown);
}
