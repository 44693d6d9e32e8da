/* The walk over a slow link: what it asks for, in which order, and what it lets go. The link is made of numbers,
 * not of time: a source that says how much it has room for, and brings so many bytes a frame. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <cmocka.h>

#include "build/built.h"
#include "source/source.h"
#include "walk/walk_checks.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define TRIANGLES 150000u
#else
#define TRIANGLES 600000u
#endif
#define ROOM_BYTES 200000u
#define FRAME_BYTES 20000u /* that the link brings in a frame */
#define LARGEST_PAGE (STRL_PAGE_BYTES + 65536u)

static uint8_t *model;
static size_t model_bytes;
static double bounds[6];

static int create_model(void **state)
{
    if (built_setup(state) != 0)
        return -1;
    built_scene("isosurface", "walked.ply", TRIANGLES, false);
    built_build_one(built_path("walked.ply"), built_path("walked.stroll"));
    model = built_read_file(built_path("walked.stroll"), &model_bytes);
    strl_walk *walk = open_walk(memory_source(model, model_bytes), NULL);
    strl_walk_bounds(walk, bounds);
    strl_walk_close(walk);
    return 0;
}

static int destroy_model(void **state)
{
    free(model);
    return built_teardown(state);
}

/* Close by, from one side of the model or the other. */
static strl_camera look(double side)
{
    strl_camera camera = {.up = {0, 0, 1}, .fov_y_deg = 40, .width = 1280, .height = 720};
    for (int k = 0; k < 3; k++) {
        double size = bounds[k + 3] - bounds[k], middle = bounds[k] + size / 2;
        camera.eye[k] = middle + (k == 0 ? 0.8 * side : 0.1) * size;
        camera.target[k] = middle + (k == 0 ? 0.3 * side * size : 0);
    }
    return camera;
}

static watched_source *open_link(strl_walk **walk, uint64_t room_bytes, double error_px)
{
    watched_source *source = watched_source_open(memory_source(model, model_bytes));
    source->room_bytes = room_bytes;
    *walk = open_walk(&source->base, &(strl_walk_desc){.error_px = error_px});
    source->walking = true;
    return source;
}

static strl_draw_list frame_on(watched_source *source, strl_walk *walk, const strl_camera *camera)
{
    source->link_bytes = source->link_bytes < LARGEST_PAGE ? source->link_bytes + FRAME_BYTES : source->link_bytes;
    strl_draw_list list = walk_frame(walk, camera);
    strl_walk_pump(walk, UINT64_MAX);
    return list;
}

/* Frames until settled; returns how many. */
static unsigned settle_on(watched_source *source, strl_walk *walk, const strl_camera *camera)
{
    for (unsigned i = 1; i < 5000; i++) {
        strl_draw_list list = frame_on(source, walk, camera);
        assert_true(list.count > 0);
        if (strl_walk_settled(walk))
            return i;
    }
    fail_msg("not settled");
    return 0;
}

static void no_more_is_asked_for_than_there_is_room_for(void **state)
{
    (void)state;
    const strl_camera camera = look(1);
    for (unsigned tight = 0; tight < 2; tight++) {
        strl_walk *slow, *fast;
        watched_source *link = open_link(&slow, tight ? 1 : ROOM_BYTES, 0.5), *none = open_link(&fast, 0, 0.5);
        uint64_t before = link->most_wanted_bytes;
        settle_on(link, slow, &camera);
        strl_draw_list expected = settle(fast, &camera, 5000), found = walk_frame(slow, &camera);
        check_same_lists(&expected, &found);
        assert_true(before == 0 && link->most_wanted_bytes <= (tight ? 1 : ROOM_BYTES) + LARGEST_PAGE);
        /* or the room was not what bound it */
        assert_true(none->most_wanted_bytes > 3 * link->most_wanted_bytes / 2);
        strl_walk_close(slow);
        strl_walk_close(fast);
    }
}

static void the_coarse_comes_before_the_fine(void **state)
{
    (void)state;
    const strl_camera camera = look(1);
    strl_walk *walk;
    watched_source *link = open_link(&walk, ROOM_BYTES, 0.5);
    double worst = INFINITY;
    unsigned frames = 0, better = 0;
    while (!strl_walk_settled(walk) && ++frames < 5000) {
        strl_draw_list list = frame_on(link, walk, &camera);
        double most = 0;
        for (uint32_t i = 0; i < list.count; i++)
            most = fmax(most, list.items[i].visible ? list.items[i].error_px : 0);
        assert_true(most <= worst * 1.0001); /* no frame is worse than the one before it */
        better += most < worst;
        worst = most;
    }
    assert_true(better >= 4 && worst <= 0.5);
    strl_walk_close(walk);
}

static void what_was_wanted_before_is_not_in_the_way(void **state)
{
    (void)state;
    const strl_camera here = look(-1), there = look(1);
    strl_walk *walk, *fresh;
    watched_source *straight = open_link(&fresh, ROOM_BYTES, 1);
    unsigned frames_straight = settle_on(straight, fresh, &there);
    for (unsigned late = 5; late <= frames_straight; late += frames_straight / 5) {
        watched_source *link = open_link(&walk, ROOM_BYTES, 1);
        for (unsigned i = 0; i < late; i++)
            frame_on(link, walk, &here);
        uint64_t came_before = link->came_bytes;
        unsigned frames = settle_on(link, walk, &there);
        assert_true(link->came_bytes - came_before <= straight->came_bytes + ROOM_BYTES + LARGEST_PAGE);
        assert_true(frames <= frames_straight + (ROOM_BYTES + LARGEST_PAGE) / FRAME_BYTES + 4);
        strl_walk_close(walk);
    }
    strl_walk_close(fresh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_more_is_asked_for_than_there_is_room_for),
        cmocka_unit_test(the_coarse_comes_before_the_fine),
        cmocka_unit_test(what_was_wanted_before_is_not_in_the_way),
    };
    return cmocka_run_group_tests(tests, create_model, destroy_model);
}
