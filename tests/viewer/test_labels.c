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

static void build(const char *input, const char *output)
{
    strl_build_result result;
    strl_error err = {0};
    const strl_build_desc desc = {.inputs = &input, .input_count = 1, .output = output, .memory_bytes = 256 << 20};
    if (strl_build_clusters(&desc, &result, &err) != STRL_OK)
        fail_msg("%s", err.message);
    assert_int_equal(result.parts, BALLS);
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

/* Each ball is where it was written, though most have vanished from what is drawn from afar. */
static void check_index(strl_container *container, const char *path)
{
    strl_part_index *index = NULL;
    double share;
    const strl_location location = {.name = path};
    assert_int_equal(strl_part_index_create(&location, BALLS, &index, NULL), STRL_OK);
    while (!strl_part_index_is_done(index, &share))
        strl_sleep_ns(1000000);
    assert_int_equal(strl_part_index_status(index, NULL), STRL_OK);
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
    build(input, output);
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

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(vertices_know_their_part_at_every_level)};
    return cmocka_run_group_tests(tests, strl_test_folder_make, strl_test_folder_remove);
}
