/* The walk's memory budget. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "base/memory.h"
#include "walk/grid_model.h"
#include "walk/internal.h"
#include "walk/walk_checks.h"

static uint8_t *model;
static size_t model_bytes;

static int create_model(void **state)
{
    (void)state;
    model = grid_model_create(1, &model_bytes);
    return 0;
}

static int destroy_model(void **state)
{
    (void)state;
    strl__free(model);
    return 0;
}

static void resident_bytes_never_pass_the_budget(void **state)
{
    (void)state;
    uint64_t random = 21;
    for (unsigned run = 0; run < 4; run++) {
        uint64_t memory = (uint64_t)600 << (10 + run);
        watched_source *source = watched_source_open(memory_source(model, model_bytes));
        source->hold_percent = 30;
        strl_walk *walk = open_walk(&source->base,
                                    &(strl_walk_desc){.memory_bytes = memory, .error_px = 0.5, .labels = run % 2 == 1});
        for (unsigned at = 0; at < 200; at++) {
            strl_camera camera = at % 4 ? flight_camera(11 * at) : random_camera(&random);
            strl_draw_list list = walk_frame(walk, &camera);
            uint64_t drawn = 0;
            for (uint32_t i = 0; i < list.count; i++)
                drawn += list.items[i].vertex_count *
                             (sizeof(strl_vertex) + (list.items[i].labels ? sizeof(strl_vertex_label) : 0)) +
                         list.items[i].index_count * sizeof(uint16_t);
            for (uint32_t i = 0; i < list.count; i++)
                assert_true((list.items[i].labels != NULL) == (run % 2 == 1));
            assert_true(strl_walk_get_stats(walk)->resident_bytes <= memory);
            assert_true(drawn <= strl_walk_get_stats(walk)->resident_bytes);
            if (at % 10 == 0)
                check_cut_is_closed(&list, 0);
            strl_walk_pump(walk, (uint64_t)(next_random(&random) * 3e6));
        }
        strl_walk_close(walk);
    }
}

static void a_tight_budget_raises_the_allowed_error_and_comes_to_rest(void **state)
{
    (void)state;
    strl_camera near_camera = flight_camera(500);
    uint64_t memory = (uint64_t)1200 << 10;
    watched_source *source = watched_source_open(memory_source(model, model_bytes));
    strl_walk *walk = open_walk(&source->base, &(strl_walk_desc){.memory_bytes = memory, .error_px = 0.25});
    strl_draw_list list = settle(walk, &near_camera, 1000), kept = copy_list(&list);
    const strl_walk_stats *stats = strl_walk_get_stats(walk);
    double allowed = stats->allowed_error_px;
    assert_true(allowed > 0.25);
    for (uint32_t i = 0; i < list.count; i++)
        assert_true(list.items[i].error_px <= allowed || list.items[i].level == 0);
    uint64_t late_requests = 0;
    for (unsigned at = 0; at < 200; at++) {
        list = walk_frame(walk, &near_camera);
        strl_walk_pump(walk, UINT64_MAX);
        assert_true(strl_walk_settled(walk));
        assert_true(stats->allowed_error_px == allowed);
        assert_true(stats->splits == 0 && stats->collapses == 0);
        late_requests += at >= 100 ? stats->requests : 0;
        check_same_lists(&kept, &list);
    }
    assert_int_equal(late_requests, 0);
    free_list(&kept);
    /* From far away all fits again, and the error goes back to what was asked for. */
    strl_camera far_camera = near_camera;
    far_camera.eye[2] += 30000;
    settle(walk, &far_camera, 1000);
    assert_true(stats->allowed_error_px == 0.25);
    strl_walk_close(walk);
}

static void a_slow_path_under_a_tight_budget_does_not_swing(void **state)
{
    (void)state;
    watched_source *source = watched_source_open(memory_source(model, model_bytes));
    strl_walk *walk =
        open_walk(&source->base, &(strl_walk_desc){.memory_bytes = (uint64_t)1500 << 10, .error_px = 0.25});
    strl_camera camera = flight_camera(300);
    settle(walk, &camera, 1000);
    unsigned turns = 0;
    int direction = 0;
    double before = strl_walk_get_stats(walk)->allowed_error_px;
    for (unsigned at = 300; at < 500; at++) {
        camera = flight_camera(at);
        walk_frame(walk, &camera);
        strl_walk_pump(walk, UINT64_MAX);
        double allowed = strl_walk_get_stats(walk)->allowed_error_px;
        int now = (allowed > before) - (allowed < before);
        turns += now && direction && now != direction;
        direction = now ? now : direction;
        before = allowed;
    }
    assert_in_range(turns, 0, 10);
    strl_walk_close(walk);
}

static void all_nodes_that_are_wanted_of_a_page_share_its_read(void **state)
{
    (void)state;
    watched_source *source = watched_source_open(memory_source(model, model_bytes));
    strl_walk *walk = open_walk(&source->base, &(strl_walk_desc){.memory_bytes = 400 << 20, .error_px = 1e-3});
    strl_camera camera = flight_camera(500);
    settle(walk, &camera, 1000);
    assert_true(walk->front.count > 150 && source->offset_count < 20);
    assert_int_equal(source->repeats, 0);
    strl_walk_close(walk);
}

static void pages_that_are_kept_go_before_anything_else_and_are_few(void **state)
{
    (void)state;
    strl_walk *walk =
        open_walk(memory_source(model, model_bytes), &(strl_walk_desc){.memory_bytes = 40 << 20, .error_px = 0.25});
    strl_camera camera = flight_camera(500);
    settle(walk, &camera, 1000);
    assert_true(walk->kept_bytes > 100 << 10 && walk->kept_bytes <= walk->memory_bytes / 32);
    uint64_t resident = walk->resident_bytes - walk->kept_bytes;
    assert_true(strl__make_room(walk, walk->memory_bytes - resident, 0)); /* no node may go */
    assert_int_equal(walk->kept_bytes, 0);
    assert_int_equal(walk->resident_bytes, resident);
    assert_false(strl__make_room(walk, walk->memory_bytes - resident + 1, 0));
    strl_walk_close(walk);
}

static void a_budget_too_small_for_the_root_is_refused_in_one_sentence(void **state)
{
    (void)state;
    strl_walk *walk;
    strl_error err = {0};
    assert_int_equal(
        strl_walk_open(memory_source(model, model_bytes), &(strl_walk_desc){.memory_bytes = 50 << 10}, &walk, &err),
        STRL_ERR_MEMORY);
    assert_null(walk);
    assert_true(err.message[0] != 0);
}

static void a_wide_budget_gives_the_same_front_as_a_wider_one(void **state)
{
    (void)state;
    strl_walk *wide = open_walk(memory_source(model, model_bytes), &(strl_walk_desc){.memory_bytes = 12 << 20});
    strl_walk *wider = open_walk(memory_source(model, model_bytes), &(strl_walk_desc){.memory_bytes = 200 << 20});
    uint64_t random = 9;
    for (unsigned i = 0; i < 15; i++) {
        strl_camera camera = random_camera(&random);
        strl_draw_list a = settle(wide, &camera, 1000), b = settle(wider, &camera, 1000);
        if (strl_walk_get_stats(wide)->allowed_error_px == 1)
            check_same_lists(&a, &b);
        assert_true(strl_walk_get_stats(wider)->allowed_error_px == 1);
    }
    strl_walk_close(wide);
    strl_walk_close(wider);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(resident_bytes_never_pass_the_budget),
        cmocka_unit_test(all_nodes_that_are_wanted_of_a_page_share_its_read),
        cmocka_unit_test(pages_that_are_kept_go_before_anything_else_and_are_few),
        cmocka_unit_test(a_tight_budget_raises_the_allowed_error_and_comes_to_rest),
        cmocka_unit_test(a_slow_path_under_a_tight_budget_does_not_swing),
        cmocka_unit_test(a_budget_too_small_for_the_root_is_refused_in_one_sentence),
        cmocka_unit_test(a_wide_budget_gives_the_same_front_as_a_wider_one),
    };
    return cmocka_run_group_tests(tests, create_model, destroy_model);
}
