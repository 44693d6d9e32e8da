/* From a mesh of parts to the labels of a walk's draw list: what a pick names and a list hides. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include "stroll/build.h"
#include "container/container.h"
#include "platform/file.h"
#include "stroll/walk.h"
#include "support/folder.h"
#include "platform/thread.h"
#include "viewer/part_index.h"
#include "viewer/pick.h"

#define BALLS 40
#define RINGS 12
#define SPACING 10.0

/* Balls in a row, each a part, of three materials. */
static void write_balls(const char *path)
{
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    for (int b = 0, first = 1; b < BALLS; b++, first += (RINGS + 1) * RINGS) {
        fprintf(file, "o row/%s/ball %d\nusemtl m%d\n", b % 2 ? "odd" : "even", b, b % 3);
        for (int r = 0; r <= RINGS; r++)
            for (int s = 0; s < RINGS; s++) {
                double t = M_PI * r / RINGS, a = 2 * M_PI * s / RINGS;
                fprintf(file, "v %.9f %.9f %.9f\n", b * SPACING + sin(t) * cos(a), sin(t) * sin(a), cos(t));
            }
        for (int r = 0; r < RINGS; r++)
            for (int s = 0; s < RINGS; s++) {
                int i = first + r * RINGS + s, j = first + r * RINGS + (s + 1) % RINGS;
                fprintf(file, "f %d %d %d %d\n", i, i + RINGS, j + RINGS, j);
            }
    }
    fclose(file);
}

typedef strl_status build_fn(const strl_build_desc *desc, strl_build_result *result, strl_error *err);

static strl_build_result build(build_fn *build_as, const char *input, const char *output)
{
    strl_build_result result;
    strl_error err = {0};
    const strl_build_desc desc = {.inputs = &input, .input_count = 1, .output = output, .memory_bytes = 256 << 20};
    if (build_as(&desc, &result, &err) != STRL_OK)
        fail_msg("%s", err.message);
    return result;
}

static int ball_of(strl_container *container, uint32_t part)
{
    char name[64];
    int ball = -1;
    assert_int_equal(strl_container_part(container, part, name, sizeof name, NULL), STRL_OK);
    assert_int_equal(sscanf(strrchr(name, '/'), "/ball %d", &ball), 1);
    return ball;
}

static strl_draw_list settle(strl_walk *walk, double distance)
{
    strl_draw_list list;
    const strl_camera camera = {.eye = {BALLS * SPACING / 2, distance, 1},
                                .target = {BALLS * SPACING / 2, 0, 0},
                                .up = {0, 0, 1},
                                .fov_y_deg = 60,
                                .width = 640,
                                .height = 480};
    for (int frame = 0; frame < 1000; frame++) {
        assert_int_equal(strl_walk_frame(walk, &camera, &list, NULL), STRL_OK);
        if (strl_walk_settled(walk))
            return list;
        strl_walk_pump(walk, UINT64_MAX);
    }
    fail_msg("the walk does not settle");
    return list;
}

/* Every corner says which ball it is on, at every level of detail, and the three of a triangle agree. */
static void check_labels(strl_container *container, const strl_draw_list *list, bool *seen)
{
    for (uint32_t i = 0; i < list->count; i++) {
        const strl_draw_item *item = &list->items[i];
        assert_non_null(item->labels);
        for (uint32_t k = 0; k < item->index_count; k++) {
            strl_vertex_label label = item->labels[item->indices[k]];
            int ball = ball_of(container, label.part);
            double x =
                item->origin[0] + item->step * (double)(item->anchor[0] + item->vertices[item->indices[k]].position[0]);
            assert_true(fabs(x - ball * SPACING) < 1.001 + item->error);
            assert_int_equal(item->labels[item->indices[k - k % 3]].part, label.part);
            char name[64];
            uint32_t rgba;
            assert_int_equal(strl_container_material(container, label.material, name, sizeof name, &rgba, NULL),
                             STRL_OK);
            assert_int_equal(name[strlen(name) - 1] - '0', ball % 3);
            seen[ball] = true;
        }
    }
}

static strl_part_index *make_index(const char *path, uint32_t part_count)
{
    strl_part_index *index = NULL;
    double share, before = 0;
    const strl_location location = {.name = path};
    assert_int_equal(strl_part_index_create(&location, part_count, &index, NULL), STRL_OK);
    while (!strl_part_index_is_done(index, &share)) {
        assert_true(share >= before && share <= 1); /* it does not begin anew */
        before = share;
        strl_sleep_ns(100000);
    }
    assert_int_equal(strl_part_index_status(index, NULL), STRL_OK);
    return index;
}

/* Each ball is where it was written, though most have vanished from what is drawn from afar. */
static void check_index(strl_container *container, const char *path)
{
    strl_part_index *index = make_index(path, BALLS);
    for (uint32_t part = 0; part < BALLS; part++) {
        double bounds[6] = {INFINITY, INFINITY, INFINITY, -INFINITY, -INFINITY, -INFINITY};
        assert_true(strl_part_index_widen(index, part, bounds));
        double x = ball_of(container, part) * SPACING;
        assert_true(fabs(bounds[0] - x + 1) < 1e-4 && fabs(bounds[3] - x - 1) < 1e-4);
        assert_true(fabs(bounds[2] + 1) < 1e-4 && fabs(bounds[5] - 1) < 1e-4);
    }
    double bounds[6];
    assert_false(strl_part_index_widen(index, BALLS, bounds));
    strl_part_index_destroy(index);
    const strl_location location = {.name = path};
    assert_int_equal(strl_part_index_create(&location, BALLS, &index, NULL), STRL_OK); /* gone before it has ended */
    strl_part_index_destroy(index);
}

static void vertices_know_their_part_at_every_level(void **state)
{
    (void)state;
    char input[600], output[600];
    bool seen[BALLS] = {false};
    snprintf(input, sizeof input, "%s", strl_test_path("balls.obj"));
    snprintf(output, sizeof output, "%s", strl_test_path("balls.stroll"));
    write_balls(input);
    assert_int_equal(build(strl_build_clusters, input, output).parts, BALLS);
    strl_container *container = NULL;
    strl_source *source = NULL;
    strl_walk *walk = NULL;
    assert_int_equal(strl_container_open_path(output, &container, NULL), STRL_OK);
    assert_int_equal(strl_source_open_file(output, 0, &source, NULL), STRL_OK);
    assert_int_equal(strl_walk_open(source, &(strl_walk_desc){.labels = true}, &walk, NULL), STRL_OK);
    for (double distance = 3e4; distance > 20; distance /= 4) {
        strl_draw_list list = settle(walk, distance);
        check_labels(container, &list, seen);
    }
    for (int ball = 0; ball < BALLS; ball++)
        assert_true(seen[ball]);

    strl_draw_list list = settle(walk, 50);
    for (int ball = 0; ball < BALLS; ball += 7) {
        const strl_ray down = {{ball * SPACING + 0.3, 0.2, 40}, {0, 0, -1}};
        strl_pick pick;
        assert_true(strl_pick_list(&list, &down, NULL, &pick));
        assert_int_equal(ball_of(container, pick.part), ball);
        assert_true(fabs(hypot(hypot(0.3, 0.2), pick.point[2]) - 1) < 0.06 + pick.error);
    }
    strl_walk_close(walk);
    check_index(container, output);
    strl_container_close(container);
    strl_path_remove(input, NULL);
    strl_path_remove(output, NULL);
}

/* Every triangle of theirs is in one node, most of them in none without children. */
static void parts_of_sample_trees_are_found(void **state)
{
    (void)state;
    char input[600], output[600];
    strl_container *container = NULL;
    snprintf(input, sizeof input, "%s", strl_test_path("balls.obj"));
    snprintf(output, sizeof output, "%s", strl_test_path("balls.stroll"));
    write_balls(input);
    assert_int_equal(build(strl_build_samples, input, output).parts, BALLS);
    assert_int_equal(strl_container_open_path(output, &container, NULL), STRL_OK);
    check_index(container, output);
    strl_container_close(container);
    strl_path_remove(input, NULL);
    strl_path_remove(output, NULL);
}

/* ---- copies */

#define COPIES 24

/* One ball, of which each node of a row is a copy. */
static void write_copies(const char *gltf, const char *bin, const char *bin_name)
{
    FILE *file = fopen(bin, "wb");
    assert_non_null(file);
    for (int r = 0; r <= RINGS; r++)
        for (int s = 0; s < RINGS; s++) {
            double t = M_PI * r / RINGS, a = 2 * M_PI * s / RINGS;
            const float point[3] = {(float)(sin(t) * cos(a)), (float)(sin(t) * sin(a)), (float)cos(t)};
            assert_int_equal(fwrite(point, sizeof point, 1, file), 1);
        }
    for (int r = 0; r < RINGS; r++)
        for (int s = 0; s < RINGS; s++) {
            uint16_t i = (uint16_t)(r * RINGS + s), j = (uint16_t)(r * RINGS + (s + 1) % RINGS);
            const uint16_t faces[6] = {i, (uint16_t)(i + RINGS), j, j, (uint16_t)(i + RINGS), (uint16_t)(j + RINGS)};
            assert_int_equal(fwrite(faces, sizeof faces, 1, file), 1);
        }
    fclose(file);
    int points = (RINGS + 1) * RINGS, corners = RINGS * RINGS * 6;
    file = fopen(gltf, "w");
    assert_non_null(file);
    fprintf(
        file,
        "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"uri\":\"%s\",\"byteLength\":%d}],\"bufferViews\":["
        "{\"buffer\":0,\"byteLength\":%d},{\"buffer\":0,\"byteOffset\":%d,\"byteLength\":%d}],\"accessors\":["
        "{\"bufferView\":0,\"componentType\":5126,\"count\":%d,\"type\":\"VEC3\",\"min\":[-1,-1,-1],\"max\":[1,1,1]},"
        "{\"bufferView\":1,\"componentType\":5123,\"count\":%d,\"type\":\"SCALAR\"}],\"meshes\":[{\"name\":\"ball\","
        "\"primitives\":[{\"attributes\":{\"POSITION\":0},\"indices\":1}]}],\"scenes\":[{\"nodes\":[0]}],\"nodes\":["
        "{\"name\":\"row\",\"children\":[1",
        bin_name, points * 12 + corners * 2, points * 12, points * 12, corners * 2, points, corners);
    for (int c = 2; c <= COPIES; c++)
        fprintf(file, ",%d", c);
    fprintf(file, "]}");
    for (int c = 0; c < COPIES; c++)
        fprintf(file, ",{\"name\":\"ball %d\",\"mesh\":0,\"translation\":[%g,0,0]}", c, c * SPACING);
    fprintf(file, "]}\n");
    fclose(file);
}

/* Each copy is a part with a box of its own. */
static void copies_are_found_one_by_one(void **state)
{
    (void)state;
    char input[600], bin[600], output[600];
    snprintf(input, sizeof input, "%s", strl_test_path("copies.gltf"));
    snprintf(bin, sizeof bin, "%s", strl_test_path("copies.bin"));
    snprintf(output, sizeof output, "%s", strl_test_path("copies.stroll"));
    write_copies(input, bin, "copies.bin");
    strl_build_result result = build(strl_build_clusters, input, output);
    assert_true(result.trees == 1 && result.placements == COPIES && result.parts == COPIES + 1);
    strl_container *container = NULL;
    assert_int_equal(strl_container_open_path(output, &container, NULL), STRL_OK);
    strl_part_index *index = make_index(output, result.parts);
    uint32_t found = 0;
    for (uint32_t part = 0; part < result.parts; part++) {
        char name[64];
        int copy = -1;
        double bounds[6] = {INFINITY, INFINITY, INFINITY, -INFINITY, -INFINITY, -INFINITY};
        assert_int_equal(strl_container_part(container, part, name, sizeof name, NULL), STRL_OK);
        bool is_copy = sscanf(name, "row/ball %d", &copy) == 1;
        found += is_copy;
        assert_true(strl_part_index_widen(index, part, bounds));
        double low = is_copy ? copy * SPACING : 0, high = is_copy ? low : (COPIES - 1) * SPACING;
        assert_true(fabs(bounds[0] - low + 1) < 1e-3 && fabs(bounds[3] - high - 1) < 1e-3);
    }
    assert_int_equal(found, COPIES);
    strl_part_index_destroy(index);
    strl_container_close(container);
    strl_path_remove(input, NULL);
    strl_path_remove(bin, NULL);
    strl_path_remove(output, NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(vertices_know_their_part_at_every_level),
        cmocka_unit_test(parts_of_sample_trees_are_found),
        cmocka_unit_test(copies_are_found_one_by_one),
    };
    return cmocka_run_group_tests(tests, strl_test_folder_make, strl_test_folder_remove);
}
