/* The walk's front, states and draw lists. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include "base/memory.h"
#include "container/cut.h"
#include "frame/view.h"
#include "jobs/pool.h"
#include "platform/thread.h"
#include "walk/grid_model.h"
#include "walk/walk_checks.h"

typedef struct models {
    uint8_t *one, *two; /* with one and two placements */
    size_t one_bytes, two_bytes;
} models;

static models shared;

static int create_models(void **state)
{
    (void)state;
    shared.one = grid_model_create(1, &shared.one_bytes);
    shared.two = grid_model_create(2, &shared.two_bytes);
    return 0;
}

static int destroy_models(void **state)
{
    (void)state;
    strl__free(shared.one);
    strl__free(shared.two);
    return 0;
}

static watched_source *watched_model(void)
{
    return watched_source_open(memory_source(shared.one, shared.one_bytes));
}

static void every_front_is_closed_whatever_has_arrived(void **state)
{
    (void)state;
    uint64_t random = 7;
    for (unsigned run = 0; run < 4; run++) {
        watched_source *source = watched_model();
        source->hold_percent = 40 + 15 * run;
        strl_walk *walk = open_walk(&source->base, &(strl_walk_desc){.error_px = 1 + run, .requests_in_flight = 3});
        source->walking = true;
        uint32_t most = 0;
        for (unsigned view = 0; view < 12; view++) {
            strl_camera camera = random_camera(&random);
            for (unsigned i = 0; i < 8; i++) {
                strl_draw_list list = walk_frame(walk, &camera);
                most = list.count > most ? list.count : most;
                check_cut_is_closed(&list, 0);
                strl_walk_pump(walk, (uint64_t)(next_random(&random) * 2e6));
            }
        }
        assert_true(most > 8);
        strl_walk_close(walk);
    }
}

static void a_settled_front_keeps_to_the_error_and_wastes_no_state(void **state)
{
    (void)state;
    uint64_t random = 3;
    watched_source *source = watched_model();
    strl_walk *walk = open_walk(&source->base, NULL);
    source->walking = true;
    for (unsigned i = 0; i < 20; i++) {
        strl_camera camera = random_camera(&random);
        strl_view view;
        assert_true(strl_view_init(&view, &camera));
        strl_draw_list list = settle(walk, &camera, 400);
        check_cut_is_closed(&list, 0);
        assert_int_equal(strl_walk_get_stats(walk)->missing_nodes, 0);
        for (uint32_t k = 0; k < list.count; k++) {
            const strl_draw_item *item = &list.items[k];
            strl_box box;
            for (unsigned axis = 0; axis < 3; axis++) {
                box.min[axis] = item->origin[axis] + item->step * (double)item->box_min[axis];
                box.max[axis] = item->origin[axis] + item->step * (double)item->box_max[axis];
            }
            double px = strl_view_error_px(&view, &box, item->error);
            assert_true(px <= 1 || item->level == 0);
            assert_true(item->visible || item->state == 0);
            assert_true(fabs(px - item->error_px) <= 1e-5 * px || px == item->error_px);
        }
    }
    strl_walk_close(walk);
}

static void a_late_source_never_waits_and_ends_like_an_immediate_one(void **state)
{
    (void)state;
    strl_source *late;
    assert_int_equal(strl_source_open_delayed(memory_source(shared.one, shared.one_bytes), 50000000, 0, &late, NULL),
                     STRL_OK);
    watched_source *slow_source = watched_source_open(late), *fast_source = watched_model();
    strl_walk *slow = open_walk(&slow_source->base, NULL), *fast = open_walk(&fast_source->base, NULL);
    slow_source->walking = fast_source->walking = true;
    strl_camera camera = flight_camera(500);
    strl_draw_list wanted = settle(fast, &camera, 100), list = walk_frame(slow, &camera);
    uint32_t coarse = list.count, frames = 0;
    assert_true(wanted.count > coarse);
    assert_true(strl_walk_get_stats(slow)->missing_nodes > 0);
    while (!strl_walk_settled(slow)) {
        assert_true(++frames < 20000);
        strl_sleep_ns(500000);
        strl_walk_pump(slow, 1000000);
        list = walk_frame(slow, &camera);
        check_cut_is_closed(&list, 0);
    }
    check_same_lists(&wanted, &list);
    strl_walk_close(slow);
    strl_walk_close(fast);
}

static void a_settled_front_does_not_depend_on_the_way_there(void **state)
{
    (void)state;
    uint64_t random = 11;
    watched_source *source = watched_model();
    strl_walk *walk = open_walk(&source->base, NULL);
    strl_camera end = flight_camera(900);
    strl_draw_list first = settle(walk, &end, 400), kept = copy_list(&first);
    for (unsigned i = 0; i < 60; i++) {
        strl_camera camera = random_camera(&random);
        walk_frame(walk, &camera);
        strl_walk_pump(walk, 500000);
    }
    strl_draw_list again = settle(walk, &end, 400);
    check_same_lists(&kept, &again);
    free_list(&kept);
    strl_walk_close(walk);
}

/* ---- indices */

/* What a renderer would hold. */
typedef struct shadow {
    uint64_t key;
    bool drawn; /* in the last frame */
    uint16_t *indices;
} shadow;

static void upload(shadow *copy, const strl_draw_item *item)
{
    bool known = copy->key == item->key && copy->drawn;
    uint32_t first = known ? item->dirty_first : 0, count = known ? item->dirty_count : item->index_count;
    assert_true(first + count <= item->index_count);
    if (!copy->indices)
        copy->indices = strl__alloc(3 * STRL_PM_MAX_TRIANGLES, sizeof *copy->indices);
    memcpy(copy->indices + first, item->indices + first, count * sizeof *item->indices);
    copy->key = item->key;
    assert_memory_equal(copy->indices, item->indices, item->index_count * sizeof *item->indices);
}

static void check_against_scratch(strl_container *container, const strl_draw_item *item)
{
    static uint16_t map[STRL_PM_MAX_VERTICES];
    strl_node record;
    strl_arena arena;
    strl_pm pm;
    strl_arena_init(&arena, 0);
    assert_int_equal(strl_container_node(container, 0, item->node, &record, NULL), STRL_OK);
    assert_int_equal(strl_container_mesh(container, 0, &record, &arena, &pm, NULL), STRL_OK);
    strl_cut_resolve(&pm, item->state, map);
    assert_int_equal(item->index_count, 3 * pm.triangle_end[item->state]);
    for (uint32_t k = 0; k < item->index_count; k++)
        assert_int_equal(item->indices[k], map[pm.triangle[k / 3][k % 3]]);
    for (uint32_t v = 0; v < pm.vertex_count; v++) {
        assert_memory_equal(item->vertices[v].position, pm.position[v], sizeof pm.position[v]);
        assert_memory_equal(item->vertices[v].normal, pm.normal[v], sizeof pm.normal[v]);
        assert_memory_equal(item->vertices[v].rgba, &pm.colour[v], 4);
    }
    strl_arena_deinit(&arena);
}

static void refined_indices_equal_those_from_scratch_and_dirty_ranges_tell_all(void **state)
{
    (void)state;
    static shadow shadows[GRID_NODES];
    strl_container *container;
    assert_int_equal(strl_container_open(memory_source(shared.one, shared.one_bytes), &container, NULL), STRL_OK);
    watched_source *source = watched_model();
    strl_walk *walk = open_walk(&source->base, &(strl_walk_desc){.memory_bytes = 4 << 20});
    uint64_t random = 5, steps = 0;
    for (unsigned at = 0; at < 300; at++) {
        strl_camera camera = at % 10 < 8 ? flight_camera(3 * at) : random_camera(&random);
        strl_draw_list list = walk_frame(walk, &camera);
        steps += strl_walk_get_stats(walk)->vertex_splits + strl_walk_get_stats(walk)->vertex_collapses;
        bool now[GRID_NODES] = {false};
        for (uint32_t i = 0; i < list.count; i++) {
            const strl_draw_item *item = &list.items[i];
            if (item->visible)
                upload(&shadows[item->node], item);
            now[item->node] = item->visible;
            if ((at + i) % 17 == 0)
                check_against_scratch(container, item);
        }
        for (uint32_t node = 0; node < GRID_NODES; node++)
            shadows[node].drawn = now[node];
        strl_walk_pump(walk, 300000);
    }
    assert_true(steps > 10000);
    for (uint32_t node = 0; node < GRID_NODES; node++)
        strl__free(shadows[node].indices);
    strl_walk_close(walk);
    strl_container_close(container);
}

/* ---- groups */

static void dependent_splits_and_collapses_happen_on_a_path(void **state)
{
    (void)state;
    watched_source *source = watched_model();
    strl_walk *walk = open_walk(&source->base, NULL);
    uint64_t splits = 0, collapses = 0, dependent_splits = 0, dependent_collapses = 0;
    for (unsigned at = 0; at < 800; at++) {
        strl_camera camera = flight_camera(3 * at);
        strl_draw_list list = walk_frame(walk, &camera);
        const strl_walk_stats *stats = strl_walk_get_stats(walk);
        splits += stats->splits, collapses += stats->collapses;
        dependent_splits += stats->dependent_splits, dependent_collapses += stats->dependent_collapses;
        assert_true(stats->dependent_splits <= stats->splits && stats->dependent_collapses <= stats->collapses);
        assert_true(stats->nodes + stats->nodes_culled == list.count);
        strl_walk_pump(walk, 5000000);
    }
    assert_true(dependent_splits > 0 && dependent_collapses > 0);
    assert_true(splits > dependent_splits && collapses > dependent_collapses);
    assert_true(splits >= collapses && splits - collapses < GRID_NODES); /* what is split now */
    strl_walk_close(walk);
}

static void members_of_a_group_are_active_together_or_split_together(void **state)
{
    (void)state;
    strl_container *container;
    assert_int_equal(strl_container_open(memory_source(shared.one, shared.one_bytes), &container, NULL), STRL_OK);
    watched_source *source = watched_model();
    source->hold_percent = 60;
    strl_walk *walk = open_walk(&source->base, NULL);
    for (unsigned at = 0; at < 100; at++) {
        strl_camera camera = flight_camera(20 * at);
        strl_draw_list list = walk_frame(walk, &camera);
        bool covered[GRID_NODES] = {false}; /* an ancestor is in the front: not reached */
        bool front[GRID_NODES] = {false};
        for (uint32_t i = 0; i < list.count; i++)
            front[list.items[i].node] = true;
        uint8_t split_of[GRID_NODES] = {0}; /* by group: 1 a member split, 2 a member did not */
        for (uint32_t node = 0; node < GRID_NODES; node++) {
            uint32_t parent = node ? (node - 1) / 2 : 0;
            covered[node] = node && (covered[parent] || front[parent]);
            strl_node record;
            assert_int_equal(strl_container_node(container, 0, node, &record, NULL), STRL_OK);
            split_of[record.group] |= !front[node] && !covered[node] ? 1 : 2;
        }
        for (uint32_t group = 0; group < GRID_NODES; group++)
            assert_true(split_of[group] != 3);
        strl_walk_pump(walk, 1000000);
    }
    strl_walk_close(walk);
    strl_container_close(container);
}

/* ---- placements, threads */

static void two_placements_of_a_tree_are_two_whole_fronts(void **state)
{
    (void)state;
    strl_walk *walk = open_walk(memory_source(shared.two, shared.two_bytes), NULL);
    double bounds[6];
    strl_walk_bounds(walk, bounds);
    assert_true(bounds[0] == -20 - 0.5 * GRID_QUADS && bounds[3] == GRID_QUADS);
    strl_camera camera = flight_camera(100);
    for (unsigned i = 0; i < 3; i++) {
        camera.eye[0] -= 30;
        camera.target[0] -= 30;
        strl_draw_list list = settle(walk, &camera, 400);
        check_cut_is_closed(&list, 0);
        check_cut_is_closed(&list, 1);
        for (uint32_t k = 0; k < list.count; k++)
            assert_true(list.items[k].error_px <= 1 || list.items[k].level == 0);
    }
    strl_walk_close(walk);
}

static strl_status submit_to_pool(void *context, void (*run)(void *job), void *job, strl_error *err)
{
    return strl_pool_submit(context, run, job, err);
}

static void a_walk_with_threads_ends_like_one_without_any(void **state)
{
    (void)state;
    strl_pool *pool;
    assert_int_equal(strl_pool_create(2, &pool, NULL), STRL_OK);
    const strl_executor executor = {pool, submit_to_pool};
    strl_walk *alone = open_walk(memory_source(shared.one, shared.one_bytes), NULL);
    strl_walk *threaded =
        open_walk(memory_source(shared.one, shared.one_bytes), &(strl_walk_desc){.executor = &executor});
    for (unsigned at = 0; at < 200; at += 40) {
        strl_camera camera = flight_camera(at);
        strl_draw_list wanted = settle(alone, &camera, 400), list = {0};
        assert_int_equal(strl_walk_pump(threaded, UINT64_MAX), 0);
        for (unsigned i = 0; i < 100000; i++) {
            list = walk_frame(threaded, &camera);
            if (strl_walk_settled(threaded))
                break;
            strl_sleep_ns(100000);
        }
        check_same_lists(&wanted, &list);
    }
    strl_walk_close(threaded);
    strl_walk_close(alone);
    strl_pool_destroy(pool);
}

static void a_walk_closes_while_its_nodes_are_being_decoded(void **state)
{
    (void)state;
    for (unsigned threads = 0; threads < 3; threads++) {
        strl_pool *pool;
        assert_int_equal(strl_pool_create(threads, &pool, NULL), STRL_OK);
        const strl_executor executor = {pool, submit_to_pool};
        for (unsigned frames = 1; frames < 6; frames++) {
            strl_walk *walk =
                open_walk(memory_source(shared.one, shared.one_bytes), &(strl_walk_desc){.executor = &executor});
            strl_camera camera = flight_camera(500);
            for (unsigned i = 0; i < frames; i++)
                walk_frame(walk, &camera);
            strl_walk_close(walk);
        }
        strl_pool_destroy(pool); /* runs what was abandoned: it must not touch the walks */
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_front_is_closed_whatever_has_arrived),
        cmocka_unit_test(a_settled_front_keeps_to_the_error_and_wastes_no_state),
        cmocka_unit_test(a_late_source_never_waits_and_ends_like_an_immediate_one),
        cmocka_unit_test(a_settled_front_does_not_depend_on_the_way_there),
        cmocka_unit_test(refined_indices_equal_those_from_scratch_and_dirty_ranges_tell_all),
        cmocka_unit_test(dependent_splits_and_collapses_happen_on_a_path),
        cmocka_unit_test(members_of_a_group_are_active_together_or_split_together),
        cmocka_unit_test(two_placements_of_a_tree_are_two_whole_fronts),
        cmocka_unit_test(a_walk_with_threads_ends_like_one_without_any),
        cmocka_unit_test(a_walk_closes_while_its_nodes_are_being_decoded),
    };
    return cmocka_run_group_tests(tests, create_models, destroy_models);
}
