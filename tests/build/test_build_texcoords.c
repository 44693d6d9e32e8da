/* Texture coordinates from a model to the vertices of all nodes. On a sheet they are a linear function of the place, so
 * that whatever a collapse, a seam or a spill does wrong would show at some vertex. */
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
#include "stroll/walk.h"
#include "verify/verify.h"

#define SIDE 110u /* squares; two triangles each */
#define MIDDLE (SIDE / 2)

/* The left half shows one image, the right one another, turned and repeated; the last material has none. */
static void place(bool right, double x, double y, double uv[2])
{
    uv[0] = right ? 3 - 0.05 * y : 0.25 + x / (2. * SIDE);
    uv[1] = right ? -2 + 0.04 * x : y / SIDE;
}

static void put_square(FILE *file, unsigned x, unsigned y, unsigned first_uv)
{
    const bool right = x >= MIDDLE;
    const unsigned a = y * (SIDE + 1) + x + 1, b = a + 1, c = a + SIDE + 2, d = a + SIDE + 1;
    const unsigned uv = first_uv + (right ? (SIDE + 1) * (SIDE + 1) : 0);
    fprintf(file, "f %u/%u %u/%u %u/%u\nf %u/%u %u/%u %u/%u\n", a, a + uv, b, b + uv, c, c + uv, a, a + uv, c, c + uv,
            d, d + uv);
}

/* v of an OBJ is up. */
static void write_sheet(void)
{
    FILE *file = fopen(built_path("sheet.obj"), "w");
    assert_non_null(file);
    fprintf(file, "mtllib sheet.mtl\n");
    for (unsigned i = 0; i < (SIDE + 1) * (SIDE + 1); i++)
        fprintf(file, "v %u %u %.6f\n", i % (SIDE + 1), i / (SIDE + 1),
                2 * sin(i % (SIDE + 1) * 0.13) * cos(i / (SIDE + 1) * 0.21));
    for (unsigned half = 0; half < 2; half++)
        for (unsigned i = 0; i < (SIDE + 1) * (SIDE + 1); i++) {
            double uv[2];
            place(half, i % (SIDE + 1), i / (SIDE + 1), uv);
            fprintf(file, "vt %.9g %.9g\n", uv[0], 1 - uv[1]);
        }
    for (unsigned half = 0; half < 2; half++) {
        fprintf(file, "usemtl %s\n", half ? "right" : "left");
        for (unsigned y = 0; y < SIDE; y++)
            for (unsigned x = half ? MIDDLE : 0; x < (half ? SIDE : MIDDLE); x++)
                put_square(file, x, y, 0);
    }
    fprintf(file, "usemtl plain\nv 0 0 30\nv 50 0 30\nv 0 50 30\nf -3 -2 -1\n");
    assert_int_equal(fclose(file), 0);
    built_write_text("sheet.mtl",
                     "newmtl left\nmap_Kd no such image.png\nnewmtl right\nmap_Kd -clamp on textures\\other.ktx2\n"
                     "newmtl plain\nKd 1 0 0\n");
}

typedef struct warnings {
    unsigned count;
    char last[1600];
} warnings;

static void take_warning(void *context, const char *sentence)
{
    warnings *told = context;
    told->count++;
    snprintf(told->last, sizeof told->last, "%s", sentence);
}

static strl_build_result build_sheet(const char *output, unsigned jobs, warnings *told)
{
    const char *input = built_path("sheet.obj");
    const strl_build_desc desc = {.inputs = &input,
                                  .input_count = 1,
                                  .output = output,
                                  .memory_bytes = 256u << 20,
                                  .jobs = jobs,
                                  .warn = take_warning,
                                  .context = told};
    strl_build_result result;
    strl_error err = {0};
    if (strl_build_clusters(&desc, &result, &err) != STRL_OK)
        fail_msg("%s", err.message);
    return result;
}

static void check_images(strl_container *container, strl_material_image images[3])
{
    static const char *const expected[3] = {"no such image.png", "textures\\other.ktx2", NULL};
    static const strl_wrap wraps[3] = {STRL_WRAP_REPEAT, STRL_WRAP_CLAMP, STRL_WRAP_REPEAT};
    strl_error err = {0};
    assert_true(strl_container_get_info(container)->has_images);
    assert_int_equal(strl_container_get_info(container)->material_count, 3);
    for (uint32_t i = 0; i < 3; i++) {
        char reference[64];
        assert_int_equal(strl_container_material_image(container, i, reference, sizeof reference, &images[i], &err),
                         STRL_OK);
        assert_int_equal(images[i].reference != NULL, expected[i] != NULL);
        assert_string_equal(reference, expected[i] ? expected[i] : "");
        assert_int_equal(images[i].wrap[0], wraps[i]);
        assert_int_equal(images[i].wrap[1], wraps[i]);
    }
    assert_true(fabsf(images[0].texcoord_min[0] - 0.25f) < 1e-6f &&
                fabsf(images[0].texcoord_extent[0] - 0.25f) < 1e-6f);
    assert_true(fabsf(images[1].texcoord_min[1] - 0.2f) < 1e-5f && fabsf(images[1].texcoord_extent[1] - 2.2f) < 1e-5f);
    char cut[8];
    strl_material_image image;
    assert_int_equal(strl_container_material_image(container, 3, cut, sizeof cut, &image, &err), STRL_ERR_ARGUMENT);
    assert_int_equal(strl_container_material_image(container, 0, cut, sizeof cut, &image, &err), STRL_OK);
    assert_string_equal(cut, "no such");
}

/* Every vertex of every node, in all its states. */
static void check_vertices(built_model *model, const strl_material_image images[3])
{
    uint64_t looked_at = 0;
    for (uint32_t n = 0; n < model->tree.node_count; n++) {
        const strl_pm *mesh = &model->mesh[n];
        strl_error err = {0};
        uint32_t *materials = malloc(mesh->vertex_count * sizeof *materials);
        uint16_t(*codes)[2] = malloc(mesh->vertex_count * sizeof *codes);
        assert_int_equal(strl_container_vertex_texcoords(model->container, 0, n, mesh->vertex_count, codes, &err),
                         STRL_OK);
        assert_int_equal(strl_container_vertex_parts(model->container, 0, n, mesh->vertex_count, NULL, materials, &err),
                         STRL_OK);
        for (uint32_t v = 0; v < mesh->vertex_count; v++) {
            int64_t lattice[3];
            double uv[2], at[2];
            const strl_material_image *image = &images[materials[v]];
            built_position(model, n, v, lattice);
            if (materials[v] == 2) {
                assert_true(codes[v][0] == 0 && codes[v][1] == 0);
                continue;
            }
            for (int k = 0; k < 2; k++)
                at[k] = model->tree.origin[k] + model->tree.step * (double)lattice[k];
            place(materials[v] == 1, at[0], at[1], uv);
            for (int k = 0; k < 2; k++) {
                double got = (double)image->texcoord_min[k] +
                             codes[v][k] * (double)image->texcoord_extent[k] / STRL_TEXCOORD_MOST;
                assert_true(fabs(got - uv[k]) < (double)image->texcoord_extent[k] / STRL_TEXCOORD_MOST * 0.6 +
                                                    1e-3 * model->tree.step + 2e-5);
            }
            looked_at++;
        }
        free(materials);
        free(codes);
    }
    assert_true(looked_at > 2 * SIDE * SIDE);
}

static void each_vertex_has_the_coordinate_of_its_place(void **state)
{
    (void)state;
    warnings told = {0};
    built_model model;
    strl_material_image images[3];
    write_sheet();
    strl_build_result result = build_sheet(built_path("sheet.stroll"), 2, &told);
    assert_true(result.levels > 2);
    built_open(&model, built_path("sheet.stroll"));
    check_images(model.container, images);
    check_vertices(&model, images);
    built_close(&model);
}

static void unusable_images_make_one_warning(void **state)
{
    (void)state;
    warnings told = {0};
    write_sheet();
    strl_build_result result = build_sheet(built_path("sheet.stroll"), 2, &told);
    assert_int_equal(result.missing_images, 2);
    assert_int_equal(told.count, 1);
    assert_non_null(strstr(told.last, "no such image.png: No such file"));
    assert_non_null(strstr(told.last, "and 1 more image cannot be used"));
}

static void the_bytes_do_not_depend_on_threads(void **state)
{
    (void)state;
    warnings told = {0};
    size_t size[2];
    uint8_t *bytes[2];
    write_sheet();
    build_sheet(built_path("one.stroll"), 1, &told);
    build_sheet(built_path("three.stroll"), 3, &told);
    bytes[0] = built_read_file(built_path("one.stroll"), &size[0]);
    bytes[1] = built_read_file(built_path("three.stroll"), &size[1]);
    assert_int_equal(size[0], size[1]);
    assert_memory_equal(bytes[0], bytes[1], size[0]);
    free(bytes[0]);
    free(bytes[1]);
}

typedef struct stop {
    warnings told;
    unsigned calls, after;
} stop;

static bool say_no(void *context, const strl_build_progress *progress)
{
    (void)progress;
    return ++((stop *)context)->calls != ((stop *)context)->after;
}

static strl_status build_in_two(bool resume, unsigned after, unsigned *calls, strl_build_result *result)
{
    const char *input = built_path("sheet.obj");
    stop s = {.after = after};
    const strl_build_desc desc = {.inputs = &input,
                                  .input_count = 1,
                                  .output = built_path("two.stroll"),
                                  .memory_bytes = 256u << 20,
                                  .jobs = 2,
                                  .keep = true,
                                  .keep_triangles = 1,
                                  .resume = resume,
                                  .progress = say_no,
                                  .context = &s};
    strl_error err = {0};
    strl_status status = strl_build_clusters(&desc, result, &err);
    *calls = s.calls;
    return status;
}

/* Stopped at every few reports; what was finished is gone on with. */
static void a_resumed_build_has_the_same_bytes(void **state)
{
    (void)state;
    warnings told = {0};
    strl_build_result result;
    unsigned calls, most, resumed = 0;
    size_t size[2];
    write_sheet();
    build_sheet(built_path("one.stroll"), 2, &told);
    uint8_t *whole = built_read_file(built_path("one.stroll"), &size[0]);
    assert_int_equal(build_in_two(false, 0, &most, &result), STRL_OK);
    for (unsigned after = 1; after < most; after += 1 + most / 8) {
        assert_int_equal(build_in_two(false, after, &calls, &result), STRL_ERR_CANCELLED);
        assert_int_equal(build_in_two(true, 0, &calls, &result), STRL_OK);
        resumed += result.resumed;
        assert_int_equal(result.missing_images, 2);
        uint8_t *bytes = built_read_file(built_path("two.stroll"), &size[1]);
        assert_int_equal(size[0], size[1]);
        assert_memory_equal(bytes, whole, size[0]);
        free(bytes);
    }
    assert_true(resumed >= 2);
    free(whole);
}

static void the_container_is_good(void **state)
{
    (void)state;
    warnings told = {0};
    strl_error err = {0};
    strl_verify_report report;
    char folder[512], model[512], input[512];
    const char *inputs[1] = {input};
    write_sheet();
    snprintf(folder, sizeof folder, "%s", built_path(""));
    snprintf(model, sizeof model, "%s", built_path("sheet.stroll"));
    snprintf(input, sizeof input, "%s", built_path("sheet.obj"));
    build_sheet(model, 2, &told);
    const strl_verify_desc desc = {.model = model,
                                   .inputs = inputs,
                                   .input_count = 1,
                                   .scratch_dir = folder,
                                   .memory_bytes = 256u << 20,
                                   .jobs = 2,
                                   .cuts = 20};
    if (strl_verify_run(&desc, &report, &err) != STRL_OK)
        fail_msg("%s", err.message);
    for (unsigned kind = 0; kind < STRL_VERIFY_KINDS; kind++)
        if (report.checks[kind].failures)
            fail_msg("%s: %s", strl_verify_name((strl_verify_kind)kind), report.checks[kind].first);
    strl_verify_report_deinit(&report);
}

static void a_walk_gives_them_with_the_labels(void **state)
{
    (void)state;
    warnings told = {0};
    strl_source *source;
    strl_walk *walk;
    strl_draw_list list;
    strl_error err = {0};
    built_model model;
    uint64_t compared = 0;
    write_sheet();
    build_sheet(built_path("sheet.stroll"), 2, &told);
    built_open(&model, built_path("sheet.stroll"));
    assert_int_equal(strl_source_open_file(built_path("sheet.stroll"), 0, &source, &err), STRL_OK);
    assert_int_equal(strl_walk_open(source, &(strl_walk_desc){.labels = true}, &walk, &err), STRL_OK);
    const strl_camera camera = {.eye = {SIDE / 2., -SIDE, SIDE},
                                .target = {SIDE / 2., SIDE / 2., 0},
                                .up = {0, 0, 1},
                                .fov_y_deg = 60,
                                .width = 640,
                                .height = 480};
    do {
        assert_int_equal(strl_walk_frame(walk, &camera, &list, &err), STRL_OK);
        strl_walk_pump(walk, 1000000000);
    } while (!strl_walk_settled(walk));
    for (uint32_t i = 0; i < list.count; i++) {
        const strl_draw_item *item = &list.items[i];
        const strl_pm *mesh = &model.mesh[item->node];
        assert_int_equal(item->vertex_count, mesh->vertex_count);
        for (uint32_t v = 0; v < item->vertex_count; v++, compared++) {
            const uint32_t code = (uint32_t)item->labels[v].texcoord[0] | (uint32_t)item->labels[v].texcoord[1] << 16;
            assert_true(code == (mesh->texcoord ? mesh->texcoord[v] : 0));
        }
    }
    assert_true(compared > 0);
    strl_walk_close(walk);
    built_close(&model);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_vertex_has_the_coordinate_of_its_place),
        cmocka_unit_test(unusable_images_make_one_warning),
        cmocka_unit_test(the_bytes_do_not_depend_on_threads),
        cmocka_unit_test(a_resumed_build_has_the_same_bytes),
        cmocka_unit_test(the_container_is_good),
        cmocka_unit_test(a_walk_gives_them_with_the_labels),
    };
    return cmocka_run_group_tests_name("texture coordinates", tests, built_setup, built_teardown);
}
