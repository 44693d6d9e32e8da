/* The visitor's movements and the outline of a frozen camera, without a window. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "frame/view.h"
#include "viewer/frustum.h"
#include "viewer/navigator.h"

#define WIDTH 1280
#define HEIGHT 720

static const double bounds[6] = {100, -20, 3, 140, 10, 9};

static strl_navigator start(unsigned up_axis)
{
    strl_navigator navigator;
    strl_navigator_init(&navigator, bounds, up_axis, 0);
    navigator.view_height = HEIGHT;
    return navigator;
}

static strl_view view_of(const strl_navigator *navigator)
{
    strl_view view;
    strl_camera camera = strl_navigator_camera(navigator, WIDTH, HEIGHT);
    assert_true(strl_view_init(&view, &camera));
    return view;
}

static double distance(const double a[3], const double b[3])
{
    return hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
}

static void find_pivot(const strl_navigator *navigator, double pivot[3])
{
    strl_view view = view_of(navigator);
    for (int i = 0; i < 3; i++)
        pivot[i] = navigator->eye[i] + view.forward[i] * navigator->distance;
}

static void home_shows_the_whole_model_upright(void **state)
{
    (void)state;
    for (unsigned up = 0; up < 3; up++) {
        strl_navigator navigator = start(up);
        strl_view view = view_of(&navigator);
        assert_true(view.up[up] > 0.9);
        assert_true(fabs(view.right[up]) < 1e-12);
        for (unsigned corner = 0; corner < 8; corner++) {
            double x = 0, y = 0, z = 0;
            for (unsigned i = 0; i < 3; i++) {
                double away = bounds[i + (corner >> i & 1 ? 3 : 0)] - view.eye[i];
                x += view.right[i] * away, y += view.up[i] * away, z += view.forward[i] * away;
            }
            assert_true(z > 0 && fabs(x) < z * view.tan_x && fabs(y) < z * view.tan_y);
        }
    }
}

static void orbit_keeps_the_pivot_and_fly_the_eye(void **state)
{
    (void)state;
    strl_navigator navigator = start(2);
    double before[3], after[3], eye[3];
    find_pivot(&navigator, before);
    strl_navigator_drag_left(&navigator, 333, -120);
    find_pivot(&navigator, after);
    assert_true(distance(before, after) < 1e-9);
    strl_navigator_set_mode(&navigator, STRL_NAVIGATOR_FLY);
    memcpy(eye, navigator.eye, sizeof eye);
    strl_navigator_drag_right(&navigator, 50, 70);
    assert_true(distance(eye, navigator.eye) == 0);
    find_pivot(&navigator, after);
    assert_true(distance(before, after) > 1);
}

/* A point under the cursor goes with it: right and down on the screen. */
static void a_drag_takes_the_model_along(void **state)
{
    (void)state;
    strl_navigator navigator = start(2);
    strl_view before = view_of(&navigator);
    strl_navigator_drag_left(&navigator, 40, 0);
    double sideways = 0, upward = 0;
    for (int i = 0; i < 3; i++)
        sideways += before.right[i] * (navigator.eye[i] - before.eye[i]);
    assert_true(sideways < 0);
    strl_navigator_drag_left(&navigator, 0, 40);
    for (int i = 0; i < 3; i++)
        upward += before.up[i] * (navigator.eye[i] - before.eye[i]);
    assert_true(upward > 0);

    navigator = start(2);
    before = view_of(&navigator);
    strl_navigator_drag_right(&navigator, 100, 60);
    strl_view after = view_of(&navigator);
    double x = 0, y = 0, z = 0;
    for (int i = 0; i < 3; i++) {
        double away = navigator.centre[i] - after.eye[i];
        x += after.right[i] * away, y += after.up[i] * away, z += after.forward[i] * away;
    }
    assert_true(fabs(x / z * after.focal_px - 100) < 1e-6);
    assert_true(fabs(y / z * after.focal_px + 60) < 1e-6);
}

static void keys_move_along_the_view_only_while_flying(void **state)
{
    (void)state;
    const double forward[3] = {0, 0, 1}, sideways[3] = {1, 0, 0};
    strl_navigator navigator = start(1);
    strl_navigator_move(&navigator, forward, false, 1);
    strl_view view = view_of(&navigator), still = view_of(&navigator);
    assert_true(distance(view.eye, still.eye) == 0);
    strl_navigator_set_mode(&navigator, STRL_NAVIGATOR_FLY);
    strl_navigator_wheel(&navigator, 3);
    strl_navigator_move(&navigator, forward, false, 0.5);
    for (int i = 0; i < 3; i++)
        assert_true(fabs(navigator.eye[i] - view.eye[i] - view.forward[i] * navigator.speed * 0.5) < 1e-9);
    memcpy(still.eye, navigator.eye, sizeof still.eye);
    strl_navigator_move(&navigator, sideways, true, 1);
    assert_true(distance(still.eye, navigator.eye) > 3 * navigator.speed);
}

static void a_transition_goes_smoothly_and_ends_where_it_shall(void **state)
{
    (void)state;
    strl_navigator navigator = start(2);
    strl_pose home = strl_navigator_home(&navigator);
    strl_navigator_drag_left(&navigator, 900, 100);
    strl_navigator_wheel(&navigator, 8);
    strl_navigator_go(&navigator, &home, 0.5);
    double last[3], longest = 0, pivot[3], whole = distance(navigator.eye, home.eye);
    int steps = 0;
    do {
        memcpy(last, navigator.eye, sizeof last);
        find_pivot(&navigator, pivot);
        assert_true(distance(pivot, navigator.centre) < 1e-9); /* an orbit stays one */
        view_of(&navigator);
        steps++;
        longest = fmax(longest, strl_navigator_step(&navigator, 0.01) ? distance(last, navigator.eye) : 0);
    } while (navigator.going > 0);
    assert_true(steps >= 49 && steps <= 51 && longest < whole / 8);
    strl_pose there = strl_navigator_pose(&navigator);
    assert_memory_equal(&there, &home, sizeof home);
    /* The hand ends it on the way. */
    strl_navigator_wheel(&navigator, 3);
    strl_navigator_go(&navigator, &home, 0.5);
    strl_navigator_step(&navigator, 0.1);
    strl_navigator_drag_left(&navigator, 5, 0);
    assert_false(strl_navigator_step(&navigator, 10));
    assert_true(distance(navigator.eye, home.eye) > 1e-6);
}

static void looking_at_a_box_shows_all_of_it(void **state)
{
    (void)state;
    const double box[6] = {101, -19, 4, 103, -18, 4.5};
    strl_navigator navigator = start(2);
    strl_navigator_drag_left(&navigator, 77, -31);
    strl_pose pose = strl_navigator_pose_on(&navigator, box);
    assert_true(pose.yaw == navigator.yaw && pose.pitch == navigator.pitch);
    strl_navigator_go(&navigator, &pose, 0);
    strl_view view = view_of(&navigator);
    for (unsigned corner = 0; corner < 8; corner++) {
        double x = 0, y = 0, z = 0;
        for (unsigned i = 0; i < 3; i++) {
            double away = box[i + (corner >> i & 1 ? 3 : 0)] - view.eye[i];
            x += view.right[i] * away, y += view.up[i] * away, z += view.forward[i] * away;
        }
        assert_true(z > 0 && fabs(x) < z * view.tan_x && fabs(y) < z * view.tan_y);
    }
}

static void a_walker_stays_level_at_eye_height(void **state)
{
    (void)state;
    const double way[3] = {0, 1, 1};
    strl_navigator navigator;
    strl_navigator_init(&navigator, bounds, 1, 0.001); /* millimetres */
    assert_true(fabs(navigator.eye_height - 1700) < 1e-9);
    navigator = start(1);
    assert_true(fabs(navigator.eye_height - navigator.radius / 50) < 1e-12);
    strl_navigator_set_mode(&navigator, STRL_NAVIGATOR_WALK);
    double height = navigator.eye[1], before[3];
    memcpy(before, navigator.eye, sizeof before);
    strl_navigator_move(&navigator, way, false, 2);
    assert_true(navigator.eye[1] == height); /* though the view goes down */
    assert_true(fabs(distance(before, navigator.eye) - 2 * strl_navigator_speed(&navigator)) < 1e-9);
    double speed = strl_navigator_speed(&navigator);
    strl_navigator_wheel(&navigator, 2);
    assert_true(strl_navigator_speed(&navigator) > 1.5 * speed);
    int steps = 0;
    while (strl_navigator_stand(&navigator, 2.5, 0.02))
        assert_true(++steps < 500);
    assert_true(fabs(navigator.eye[1] - 2.5 - navigator.eye_height) < 1e-9 && steps > 3);
}

/* What an orthographic camera shows at the pivot is as large as in perspective, and nothing is behind its eye. */
static void an_orthographic_camera_shows_the_same_size(void **state)
{
    (void)state;
    strl_navigator navigator = start(2);
    for (int zoom = 0; zoom < 40; zoom++) {
        strl_navigator_wheel(&navigator, 1);
        navigator.orthographic = false;
        strl_view perspective = view_of(&navigator);
        navigator.orthographic = true;
        strl_view view = view_of(&navigator);
        assert_true(view.orthographic);
        assert_true(fabs(view.half_height / (perspective.tan_y * navigator.distance) - 1) < 1e-12);
        double ahead = 0, aside = 0;
        for (int i = 0; i < 3; i++) {
            ahead += view.forward[i] * (navigator.centre[i] - view.eye[i]);
            aside += view.right[i] * (view.eye[i] - navigator.eye[i]);
        }
        assert_true(ahead >= navigator.radius && fabs(aside) < 1e-9);
    }
}

static void a_pose_towards_a_target_looks_there(void **state)
{
    (void)state;
    const double eye[3] = {90, 3, 8}, target[3] = {120, -7, 5};
    for (unsigned up = 0; up < 3; up++) {
        strl_navigator navigator = start(up);
        strl_pose pose = strl_navigator_pose_at(&navigator, eye, target);
        strl_navigator_go(&navigator, &pose, 0);
        strl_view view = view_of(&navigator);
        double length = distance(eye, target);
        for (int i = 0; i < 3; i++)
            assert_true(fabs(view.eye[i] - eye[i]) < 1e-12 &&
                        fabs(view.forward[i] - (target[i] - eye[i]) / length) < 1e-9);
    }
}

static void no_movement_breaks_the_camera(void **state)
{
    (void)state;
    const double way[3] = {1, 1, 1};
    strl_navigator navigator = start(2);
    uint32_t seed = 7;
    for (int step = 0; step < 20000; step++) {
        seed = seed * 1664525u + 1013904223u;
        double a = (double)(seed >> 8 & 0xfff) - 2048, b = (double)(seed >> 20) - 2048;
        switch (seed >> 4 & 7) {
        case 0:
            strl_navigator_drag_left(&navigator, a, b);
            break;
        case 1:
            strl_navigator_drag_right(&navigator, a * 10, b * 10);
            break;
        case 2:
            strl_navigator_wheel(&navigator, a);
            break;
        case 3:
            strl_navigator_set_mode(&navigator, STRL_NAVIGATOR_FLY);
            break;
        case 4:
            strl_navigator_set_mode(&navigator, STRL_NAVIGATOR_ORBIT);
            break;
        default:
            strl_navigator_move(&navigator, way, true, 0.1);
            break;
        }
        view_of(&navigator);
        assert_true(distance(navigator.eye, navigator.centre) < 1e4 * navigator.radius);
    }
}

static void a_model_of_one_point_has_a_camera(void **state)
{
    (void)state;
    const double points[2][6] = {{0}, {5e6, 4e6, 100, 5e6, 4e6, 100}};
    for (int p = 0; p < 2; p++) {
        strl_navigator navigator;
        strl_navigator_init(&navigator, points[p], 2, 0);
        view_of(&navigator);
    }
}

static void a_camera_seen_from_behind_is_a_pyramid(void **state)
{
    (void)state;
    float lines[STRL_FRUSTUM_LINES][4];
    strl_navigator navigator = start(2);
    strl_camera seen = strl_navigator_camera(&navigator, WIDTH, HEIGHT);
    strl_navigator_wheel(&navigator, -5);
    strl_camera by = strl_navigator_camera(&navigator, WIDTH, HEIGHT);
    assert_int_equal(strl_frustum_lines(&seen, 50, &by, lines), STRL_FRUSTUM_LINES);
    for (unsigned i = 0; i < STRL_FRUSTUM_LINES; i++)
        for (unsigned k = 0; k < 4; k++)
            assert_true(lines[i][k] > 0 && lines[i][k] < (k % 2 ? HEIGHT : WIDTH));
    /* Looking away from it nothing is left. */
    for (int i = 0; i < 3; i++)
        by.target[i] = 2 * by.eye[i] - by.target[i];
    assert_int_equal(strl_frustum_lines(&seen, 50, &by, lines), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(home_shows_the_whole_model_upright),
        cmocka_unit_test(orbit_keeps_the_pivot_and_fly_the_eye),
        cmocka_unit_test(a_drag_takes_the_model_along),
        cmocka_unit_test(keys_move_along_the_view_only_while_flying),
        cmocka_unit_test(a_transition_goes_smoothly_and_ends_where_it_shall),
        cmocka_unit_test(looking_at_a_box_shows_all_of_it),
        cmocka_unit_test(a_walker_stays_level_at_eye_height),
        cmocka_unit_test(an_orthographic_camera_shows_the_same_size),
        cmocka_unit_test(a_pose_towards_a_target_looks_there),
        cmocka_unit_test(no_movement_breaks_the_camera),
        cmocka_unit_test(a_model_of_one_point_has_a_camera),
        cmocka_unit_test(a_camera_seen_from_behind_is_a_pyramid),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
