/* Picking, sections and measuring, without a window. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "frame/view.h"
#include "render/patches.h"
#include "viewer/picks.h"
#include "viewer/section.h"

#define WIDTH 160u
#define HEIGHT 120u

/* The pixel's ray ends on the flat square where the view says that pixel lies. */
static void a_ray_meets_the_surface_behind_its_pixel(void **state)
{
    (void)state;
    patches all;
    patches_init(&all, (patches_desc){.side = 3, .flat = true});
    strl_camera camera = patches_camera(&all, WIDTH, HEIGHT, 0.5);
    for (int orthographic = 0; orthographic < 2; orthographic++) {
        strl_view view;
        camera.fov_y_deg = orthographic ? 0 : 60, camera.ortho_height = 30;
        assert_true(strl_view_init(&view, &camera));
        for (uint32_t y = 20; y < HEIGHT - 20; y += 9)
            for (uint32_t x = 30; x < WIDTH - 30; x += 11) {
                strl_ray ray;
                strl_pick pick;
                assert_true(strl_ray_through(&camera, x, y, &ray));
                assert_true(strl_pick_list(&all.list, &ray, NULL, &pick));
                assert_true(fabs(pick.point[2]) < 1e-9);
                double right = 0, up = 0, ahead = 0;
                for (int i = 0; i < 3; i++) {
                    double away = pick.point[i] - view.eye[i];
                    right += view.right[i] * away, up += view.up[i] * away, ahead += view.forward[i] * away;
                }
                right /= orthographic ? view.half_width : ahead * view.tan_x;
                up /= orthographic ? view.half_height : ahead * view.tan_y;
                assert_true(fabs((1 + right) / 2 * WIDTH - x - 0.5) < 1e-6);
                assert_true(fabs((1 - up) / 2 * HEIGHT - y - 0.5) < 1e-6);
                assert_true(pick.normal[2] > 0.999999);
            }
    }
    patches_deinit(&all);
}

/* Coordinates are those of the model, also where floats have no digits left for them. */
static void coordinates_far_from_the_origin_keep_their_digits(void **state)
{
    (void)state;
    patches all;
    strl_ray ray = {{0.4, 0.3, 50}, {0, 0, -1}};
    strl_pick near, far;
    patches_init(&all, (patches_desc){.side = 1});
    assert_true(strl_pick_list(&all.list, &ray, NULL, &near));
    for (uint32_t i = 0; i < all.count; i++)
        for (int k = 0; k < 3; k++)
            all.items[i].origin[k] += 5e6 + k;
    for (int k = 0; k < 3; k++)
        ray.from[k] += 5e6 + k;
    assert_true(strl_pick_list(&all.list, &ray, NULL, &far));
    for (int k = 0; k < 3; k++)
        assert_true(fabs(far.point[k] - near.point[k] - 5e6 - k) < 1e-8);
    patches_deinit(&all);
}

static void a_placement_moves_what_is_picked(void **state)
{
    (void)state;
    patches all;
    strl_pick pick;
    patches_init(&all, (patches_desc){.side = 1, .flat = true});
    /* Twice as wide, upright, mirrored: x stays, y goes up, z to the back. */
    const double transform[12] = {2, 0, 0, 10, 0, 0, 2, 20, 0, 2, 0, 30};
    memcpy(all.items[0].transform, transform, sizeof transform);
    const strl_ray ray = {{14, 50, 36}, {0, -1, 0}};
    assert_true(strl_pick_list(&all.list, &ray, NULL, &pick));
    assert_true(fabs(pick.point[1] - 20) < 1e-9 && fabs(pick.distance - 30) < 1e-9);
    assert_true(pick.normal[1] > 0.999999);
    assert_true(fabs(pick.error - 0.02) < 1e-6);
    patches_deinit(&all);
}

/* From before as ever, from behind through it; the same where the placement mirrors. */
static void a_back_that_is_not_drawn_is_not_picked(void **state)
{
    (void)state;
    patches all;
    strl_pick pick;
    patches_init(&all, (patches_desc){.side = 1, .flat = true});
    for (int mirrored = 0; mirrored < 2; mirrored++) {
        double x = mirrored ? -3 : 3;
        all.items[0].transform[0] = mirrored ? -1 : 1;
        const strl_ray down = {{x, 3, 50}, {0, 0, -1}}, up = {{x, 3, -50}, {0, 0, 1}};
        for (int cull = STRL_CULL_NONE; cull <= STRL_CULL_BACK; cull++) {
            all.list.cull = (strl_cull)cull;
            assert_true(strl_pick_list(&all.list, &down, NULL, &pick));
            assert_true(strl_pick_list(&all.list, &up, NULL, &pick) == (cull == STRL_CULL_NONE));
        }
    }
    patches_deinit(&all);
}

/* Two squares over each other, of parts 0 and 1. */
static void hidden_parts_and_what_is_cut_off_are_not_picked(void **state)
{
    (void)state;
    static strl_vertex_label labels[2][PATCH_VERTICES];
    patches all;
    patches_init(&all, (patches_desc){.side = 1, .flat = true});
    strl_draw_item items[2] = {all.items[0], all.items[0]};
    items[1].origin[2] += 4; /* above */
    for (uint32_t part = 0; part < 2; part++) {
        for (int v = 0; v < PATCH_VERTICES; v++)
            labels[part][v] = (strl_vertex_label){.part = part, .material = 7 + part};
        items[part].labels = labels[part];
    }
    const strl_draw_list list = {.items = items, .count = 2};
    const strl_ray down = {{3, 3, 50}, {0, 0, -1}};
    uint8_t styles[2] = {STRL_PART_PLAIN, STRL_PART_MARKED};
    strl_pick_filter filter = {.part_styles = styles, .part_count = 2};
    strl_pick pick;
    assert_true(strl_pick_list(&list, &down, &filter, &pick));
    assert_true(pick.part == 1 && pick.material == 8 && fabs(pick.point[2] - 4) < 1e-9);
    styles[1] = STRL_PART_HIDDEN;
    assert_true(strl_pick_list(&list, &down, &filter, &pick));
    assert_true(pick.part == 0 && pick.material == 7);
    styles[0] = STRL_PART_HIDDEN;
    assert_false(strl_pick_list(&list, &down, &filter, &pick));

    filter = (strl_pick_filter){.section = {0, 0, 1, 2}};
    assert_true(strl_pick_list(&list, &down, &filter, &pick));
    assert_int_equal(pick.part, 0);

    double bounds[6];
    styles[1] = STRL_PART_MARKED;
    assert_true(strl_pick_style_bounds(&list, styles, 2, STRL_PART_MARKED, bounds));
    assert_true(fabs(bounds[2] - 4) < 1e-9 && fabs(bounds[5] - 4) < 1e-9 && bounds[0] < bounds[3]);
    assert_false(strl_pick_style_bounds(&list, styles, 1, STRL_PART_MARKED, bounds));

    /* The placement's own part is what is picked and hidden; the part that its vertices name still counts. */
    uint8_t three[3] = {STRL_PART_PLAIN, STRL_PART_PLAIN, STRL_PART_PLAIN};
    filter = (strl_pick_filter){.part_styles = three, .part_count = 3};
    items[1].own_part = 3;
    assert_true(strl_pick_list(&list, &down, &filter, &pick));
    assert_true(pick.part == 2 && pick.material == 8);
    three[2] = STRL_PART_MARKED;
    assert_true(strl_pick_style_bounds(&list, three, 3, STRL_PART_MARKED, bounds));
    assert_true(fabs(bounds[2] - 4) < 1e-9 && fabs(bounds[5] - 4) < 1e-9);
    three[2] = STRL_PART_HIDDEN;
    assert_true(strl_pick_list(&list, &down, &filter, &pick));
    assert_int_equal(pick.part, 0);
    three[2] = STRL_PART_PLAIN, three[1] = STRL_PART_HIDDEN;
    assert_true(strl_pick_list(&list, &down, &filter, &pick));
    assert_int_equal(pick.part, 0);
    patches_deinit(&all);
}

static void two_picks_have_a_distance_and_the_oldest_goes(void **state)
{
    (void)state;
    static strl_picks picks;
    static strl_picked picked;
    double difference[3];
    picks.count = 0;
    assert_null(strl_picks_newest(&picks));
    for (int p = 0; p < 5; p++) {
        assert_true((strl_picks_distance(&picks, difference) < 0) == (p < 2));
        memcpy(picked.pick.point, (double[3]){p, 3 * (p % 2), 4 * p * p}, sizeof picked.pick.point);
        strl_picks_add(&picks, &picked);
    }
    assert_int_equal(picks.count, STRL_MOST_PICKS);
    assert_true(picks.items[0].pick.point[0] == 2);
    assert_true(fabs(strl_picks_distance(&picks, difference) - sqrt(1 + 9 + 28 * 28)) < 1e-12);
    assert_true(difference[0] == 1 && difference[1] == -3 && difference[2] == 28);
}

static double side(const strl_section *section, const double point[3])
{
    double plane[4];
    strl_section_plane(section, plane);
    return plane[0] * point[0] + plane[1] * point[1] + plane[2] * point[2] - plane[3];
}

static void a_section_goes_where_it_is_put(void **state)
{
    (void)state;
    const double bounds[6] = {10, -2, 0, 30, 8, 4}, eye[3] = {100, 50, 60};
    const double points[3][3] = {{12, 0, 1}, {20, 5, 2}, {15, 7, 3}}, in_line[3][3] = {{0}, {1, 1, 1}, {3, 3, 3}};
    double range[2];
    strl_section section = {0};
    assert_true(side(&section, eye) == 0); /* off: a plane that cuts nothing */
    strl_section_by_axis(&section, 1, bounds);
    assert_true(section.offset == 3 && side(&section, (double[3]){99, 8, 99}) == 5);
    strl_section_flip(&section);
    assert_true(side(&section, (double[3]){99, 8, 99}) == -5);

    assert_true(strl_section_by_points(&section, points, eye));
    for (int p = 0; p < 3; p++)
        assert_true(fabs(side(&section, points[p])) < 1e-12);
    assert_true(side(&section, eye) > 0); /* what is between the eye and the plane goes */
    strl_section before = section;
    assert_false(strl_section_by_points(&section, in_line, eye));
    assert_memory_equal(&before, &section, sizeof section);

    strl_section_range(&section, bounds, range);
    strl_section_move(&section, bounds, 0.25);
    assert_true(fabs(section.offset - before.offset - 0.25 * (range[1] - range[0])) < 1e-12);
    strl_section_move(&section, bounds, 7);
    assert_true(section.offset == range[1]);
    strl_section_by_normal(&section, points[1], (double[3]){0, 0, -5});
    assert_true(section.normal[2] == -1 && section.offset == -2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_ray_meets_the_surface_behind_its_pixel),
        cmocka_unit_test(coordinates_far_from_the_origin_keep_their_digits),
        cmocka_unit_test(a_placement_moves_what_is_picked),
        cmocka_unit_test(a_back_that_is_not_drawn_is_not_picked),
        cmocka_unit_test(hidden_parts_and_what_is_cut_off_are_not_picked),
        cmocka_unit_test(two_picks_have_a_distance_and_the_oldest_goes),
        cmocka_unit_test(a_section_goes_where_it_is_put),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
