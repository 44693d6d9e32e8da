/* The pixel error of a box against brute force: points of the box that are in the image, displaced by the error. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <string.h>
#include <cmocka.h>

#include "base/hash.h"
#include "frame/view.h"

static double uniform(uint64_t *seed)
{
    return (double)(strl__mix64(++*seed) >> 11) * 0x1p-53;
}

static strl_camera a_camera(void)
{
    strl_camera camera = {
        .eye = {0, 0, 0}, .target = {0, 0, -1}, .up = {0, 1, 0}, .fov_y_deg = 60, .width = 1280, .height = 720};
    return camera;
}

static strl_camera random_camera(uint64_t *seed)
{
    strl_camera camera = a_camera();
    for (int i = 0; i < 3; i++) {
        camera.eye[i] = 200 * uniform(seed) - 100;
        camera.target[i] = 200 * uniform(seed) - 100;
        camera.up[i] = uniform(seed) - 0.5;
    }
    camera.fov_y_deg = 15 + 100 * uniform(seed);
    camera.width = 64 + (uint32_t)(2000 * uniform(seed));
    camera.height = 64 + (uint32_t)(2000 * uniform(seed));
    return camera;
}

/* Pixel position of a point; false where it is not in front of the eye. */
static bool project(const strl_view *view, const double p[3], double px[2], double *z, double *length)
{
    double d[3] = {p[0] - view->eye[0], p[1] - view->eye[1], p[2] - view->eye[2]};
    double x = 0, y = 0;
    *z = *length = 0;
    for (int i = 0; i < 3; i++)
        x += view->right[i] * d[i], y += view->up[i] * d[i], *z += view->forward[i] * d[i], *length += d[i] * d[i];
    *length = sqrt(*length);
    px[0] = x / *z * view->focal_px, px[1] = y / *z * view->focal_px;
    return *z > 0;
}

static bool in_image(const strl_view *view, const double px[2])
{
    return fabs(px[0]) <= view->tan_x * view->focal_px && fabs(px[1]) <= view->tan_y * view->focal_px;
}

/* The largest value of the formula over a grid of the box's points in the image; -1 where none is. */
static double sampled_formula(const strl_view *view, const strl_box *box, double error, int grid)
{
    double largest = -1;
    for (int k = 0; k < grid * grid * grid; k++) {
        int at[3] = {k % grid, k / grid % grid, k / grid / grid};
        double p[3], px[2], z, length;
        for (int i = 0; i < 3; i++)
            p[i] = box->min[i] + (box->max[i] - box->min[i]) * at[i] / (grid - 1);
        if (!project(view, p, px, &z, &length) || !in_image(view, px))
            continue;
        largest = fmax(largest, z > error ? error * view->focal_px * length / (z * (z - error)) : INFINITY);
    }
    return largest;
}

static strl_box box_round(const double centre[3], const double half[3])
{
    strl_box box;
    for (int i = 0; i < 3; i++)
        box.min[i] = centre[i] - half[i], box.max[i] = centre[i] + half[i];
    return box;
}

static void the_bound_is_never_below_any_sampled_point(void **state)
{
    (void)state;
    uint64_t seed = 1;
    int seen = 0;
    for (int round = 0; round < 4000; round++) {
        strl_camera camera = random_camera(&seed);
        strl_view view;
        if (!strl_view_init(&view, &camera))
            continue;
        double centre[3], half[3], size = pow(10, 4 * uniform(&seed) - 2);
        for (int i = 0; i < 3; i++)
            centre[i] = 200 * uniform(&seed) - 100, half[i] = size * uniform(&seed);
        strl_box box = box_round(centre, half);
        double error = pow(10, 5 * uniform(&seed) - 5);
        double sampled = sampled_formula(&view, &box, error, 9), bound = strl_view_error_px(&view, &box, error);
        assert_true(bound >= sampled);
        if (sampled >= 0) {
            assert_true(strl_view_sees(&view, &box));
            seen++;
        }
    }
    assert_in_range(seen, 500, 4000);
}

static void the_bound_of_a_small_box_is_within_1_3_of_the_truth(void **state)
{
    (void)state;
    uint64_t seed = 7;
    int compared = 0;
    for (int round = 0; round < 4000; round++) {
        strl_camera camera = random_camera(&seed);
        strl_view view;
        if (!strl_view_init(&view, &camera))
            continue;
        double centre[3], half[3], distance = 5 + 100 * uniform(&seed);
        double x = (2 * uniform(&seed) - 1) * view.tan_x, y = (2 * uniform(&seed) - 1) * view.tan_y;
        for (int i = 0; i < 3; i++) {
            centre[i] = view.eye[i] + distance * (view.forward[i] + x * view.right[i] + y * view.up[i]);
            half[i] = distance * 0.02 * uniform(&seed);
        }
        strl_box box = box_round(centre, half);
        double error = distance * 0.02 * uniform(&seed);
        double sampled = sampled_formula(&view, &box, error, 9), bound = strl_view_error_px(&view, &box, error);
        assert_true(sampled > 0);
        assert_true(bound >= sampled && bound <= 1.3 * sampled);
        compared++;
    }
    assert_true(compared > 3500);
}

/* Not the formula but what it stands for: the point moves by the error in any direction, and the image of it moves. */
static void no_displacement_by_the_error_moves_a_point_further_than_the_bound(void **state)
{
    (void)state;
    uint64_t seed = 3;
    double closest = 0;
    for (int round = 0; round < 20000; round++) {
        strl_camera camera = random_camera(&seed);
        strl_view view;
        if (!strl_view_init(&view, &camera))
            continue;
        double at[3], moved[3], way[3], px[2], moved_px[2], z, length, norm = 0;
        double x = (2 * uniform(&seed) - 1) * view.tan_x, y = (2 * uniform(&seed) - 1) * view.tan_y,
               distance = 1 + uniform(&seed);
        double error = 0.3 * uniform(&seed);
        for (int i = 0; i < 3; i++)
            way[i] = uniform(&seed) - 0.5, norm += way[i] * way[i];
        for (int i = 0; i < 3; i++) {
            at[i] = view.eye[i] + distance * (view.forward[i] + x * view.right[i] + y * view.up[i]);
            moved[i] = at[i] + error * way[i] / sqrt(norm);
        }
        strl_box box = box_round(at, (const double[3]){1e-9, 1e-9, 1e-9});
        double bound = strl_view_error_px(&view, &box, error);
        assert_true(project(&view, at, px, &z, &length) && project(&view, moved, moved_px, &z, &length));
        double moved_by = hypot(moved_px[0] - px[0], moved_px[1] - px[1]);
        assert_true(moved_by <= bound);
        closest = fmax(closest, moved_by / bound);
    }
    assert_true(closest > 0.95); /* the bound is reached by the worst direction, so the factor |p| / z is not idle */
}

static void boxes_that_nest_have_bounds_in_the_same_order(void **state)
{
    (void)state;
    uint64_t seed = 11;
    for (int round = 0; round < 4000; round++) {
        strl_camera camera = random_camera(&seed);
        strl_view view;
        if (!strl_view_init(&view, &camera))
            continue;
        strl_box outer, inner;
        for (int i = 0; i < 3; i++) {
            double a = 200 * uniform(&seed) - 100, size = 20 * uniform(&seed), b = uniform(&seed), c = uniform(&seed);
            outer.min[i] = a, outer.max[i] = a + size;
            inner.min[i] = a + size * fmin(b, c), inner.max[i] = a + size * fmax(b, c);
        }
        double outer_px = strl_view_error_px(&view, &outer, 0.01), inner_px = strl_view_error_px(&view, &inner, 0.01);
        assert_true(inner_px <= outer_px * (1 + 1e-9));
        assert_true(!strl_view_sees(&view, &inner) || strl_view_sees(&view, &outer));
    }
}

static void the_error_of_so_many_pixels_has_so_many(void **state)
{
    (void)state;
    uint64_t seed = 12;
    int seen = 0;
    for (int round = 0; round < 2000; round++) {
        strl_camera camera = random_camera(&seed);
        if (round % 4 == 0)
            camera.fov_y_deg = 0, camera.ortho_height = 100;
        strl_view view;
        if (!strl_view_init(&view, &camera))
            continue;
        double centre[3], half[3] = {uniform(&seed), uniform(&seed), uniform(&seed)}, px = 0.01 + 50 * uniform(&seed);
        for (int i = 0; i < 3; i++)
            centre[i] = 200 * uniform(&seed) - 100;
        const strl_box box = box_round(centre, half);
        const strl_sight sight = strl_view_sight(&view, &box);
        double error = strl_sight_error_of(&sight, px);
        assert_true(error >= 0);
        if (sight.empty) {
            assert_true(isinf(error));
        } else if (error > 0) {
            assert_true(fabs(strl_sight_error_px(&sight, error) - px) < 1e-9 * px);
            seen++;
        }
    }
    assert_true(seen > 200);
    const strl_sight inside = {.seen = true, .focal_px = 500, .nearest = 0, .slope = 1};
    assert_true(strl_sight_error_of(&inside, 1) == 0); /* the eye is in the box: nothing is small enough */
}

static void the_corner_of_a_wide_image_counts_2_4_times_the_centre(void **state)
{
    (void)state;
    strl_camera camera = a_camera();
    strl_view view;
    assert_true(strl_view_init(&view, &camera));
    double distance = 1000, z = distance / view.corner, tiny[3] = {1e-6, 1e-6, 1e-6};
    strl_box centre = box_round((const double[3]){0, 0, -distance}, tiny);
    strl_box corner = box_round((const double[3]){view.tan_x * z, view.tan_y * z, -z}, tiny);
    double ratio = strl_view_error_px(&view, &corner, 0.01) / strl_view_error_px(&view, &centre, 0.01);
    assert_true(fabs(ratio - 2.385) < 0.01);
}

static void a_box_round_the_eye_is_infinite_and_one_outside_the_image_is_zero(void **state)
{
    (void)state;
    strl_camera camera = a_camera();
    strl_view view;
    assert_true(strl_view_init(&view, &camera));
    const double half[3] = {1, 1, 1};
    strl_box around = box_round((const double[3]){0, 0, 0}, half), behind = box_round((const double[3]){0, 0, 5}, half);
    strl_box beside = box_round((const double[3]){100, 0, -5}, half),
             near = box_round((const double[3]){0, 0, -2}, half);
    assert_true(strl_view_error_px(&view, &around, 1e-6) == INFINITY);
    assert_true(strl_view_error_px(&view, &behind, 1) == 0 && !strl_view_sees(&view, &behind));
    assert_true(strl_view_error_px(&view, &beside, 1) == 0 && !strl_view_sees(&view, &beside));
    assert_true(strl_view_error_px(&view, &near, 1) == INFINITY); /* z can be 1, the error is 1 */
    assert_true(isfinite(strl_view_error_px(&view, &near, 0.5)));
}

/* A floor that reaches from behind the eye to the horizon: what counts is its nearest point within the image. */
static void a_box_that_passes_below_the_eye_is_bounded_by_what_the_image_shows_of_it(void **state)
{
    (void)state;
    strl_camera camera = a_camera();
    strl_view view;
    assert_true(strl_view_init(&view, &camera));
    strl_box floor = {{-1000, -11, -1000}, {1000, -10, 1000}};
    double first_z = 10 / view.tan_y, bound = strl_view_error_px(&view, &floor, 0.1);
    double largest = 0.1 * view.focal_px * view.corner / (first_z - 0.1);
    assert_true(bound <= largest * (1 + 1e-6) && bound >= 0.99 * largest);
}

static void an_orthographic_error_does_not_depend_on_the_distance(void **state)
{
    (void)state;
    strl_camera camera = a_camera();
    camera.fov_y_deg = 0;
    camera.ortho_height = 10;
    strl_view view;
    assert_true(strl_view_init(&view, &camera));
    const double half[3] = {1, 1, 1};
    strl_box box = box_round((const double[3]){0, 0, -50}, half),
             outside = box_round((const double[3]){0, 7, -50}, half);
    assert_true(fabs(strl_view_error_px(&view, &box, 0.25) - 0.25 * 72) < 1e-9);
    assert_true(strl_view_error_px(&view, &outside, 0.25) == 0);
    double least, largest;
    strl_view_depth_range(&view, &box, &least, &largest);
    assert_true(fabs(least - 49) < 1e-12 && fabs(largest - 51) < 1e-12);
}

static void what_is_wrong_with_a_camera_is_named(void **state)
{
    (void)state;
    strl_camera camera = a_camera();
    assert_null(strl_view_fault(&camera));
    memcpy(camera.target, camera.eye, sizeof camera.eye);
    assert_non_null(strstr(strl_view_fault(&camera), "eye and target"));
    camera = a_camera();
    memset(camera.up, 0, sizeof camera.up);
    assert_string_equal(strl_view_fault(&camera), "up is zero");
    camera.up[2] = 3;
    assert_string_equal(strl_view_fault(&camera), "up is along the line from eye to target");
    camera = a_camera();
    camera.target[1] = INFINITY;
    assert_non_null(strstr(strl_view_fault(&camera), "not finite"));
    camera = a_camera();
    camera.fov_y_deg = 180;
    assert_non_null(strstr(strl_view_fault(&camera), "fov"));
}

static void degenerate_cameras_are_refused(void **state)
{
    (void)state;
    strl_view view;
    strl_camera camera = a_camera();
    camera.eye[0] = NAN;
    assert_false(strl_view_init(&view, &camera));
    camera = a_camera();
    memcpy(camera.target, camera.eye, sizeof camera.eye);
    assert_false(strl_view_init(&view, &camera));
    camera = a_camera();
    camera.up[1] = 0, camera.up[2] = 3;
    assert_false(strl_view_init(&view, &camera));
    camera = a_camera();
    camera.fov_y_deg = 180;
    assert_false(strl_view_init(&view, &camera));
    camera = a_camera();
    camera.height = 0;
    assert_false(strl_view_init(&view, &camera));
    camera = a_camera();
    camera.fov_y_deg = 0;
    assert_false(strl_view_init(&view, &camera));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_bound_is_never_below_any_sampled_point),
        cmocka_unit_test(the_bound_of_a_small_box_is_within_1_3_of_the_truth),
        cmocka_unit_test(no_displacement_by_the_error_moves_a_point_further_than_the_bound),
        cmocka_unit_test(boxes_that_nest_have_bounds_in_the_same_order),
        cmocka_unit_test(the_error_of_so_many_pixels_has_so_many),
        cmocka_unit_test(the_corner_of_a_wide_image_counts_2_4_times_the_centre),
        cmocka_unit_test(a_box_round_the_eye_is_infinite_and_one_outside_the_image_is_zero),
        cmocka_unit_test(a_box_that_passes_below_the_eye_is_bounded_by_what_the_image_shows_of_it),
        cmocka_unit_test(an_orthographic_error_does_not_depend_on_the_distance),
        cmocka_unit_test(degenerate_cameras_are_refused),
        cmocka_unit_test(what_is_wrong_with_a_camera_is_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
