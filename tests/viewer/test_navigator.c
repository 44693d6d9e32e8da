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
    strl_navigator_init(&navigator, bounds, up_axis);
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
        strl_navigator_init(&navigator, points[p], 2);
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
        cmocka_unit_test(no_movement_breaks_the_camera),
        cmocka_unit_test(a_model_of_one_point_has_a_camera),
        cmocka_unit_test(a_camera_seen_from_behind_is_a_pyramid),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
