/* A model of 200,000 placements: a walk opens by what runs of them look like from outside, and reads the pages that it
 * comes near. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "base/memory.h"
#include "build/built.h"
#include "container/reseal.h"
#include "scenes/scene.h"
#include "walk/internal.h"
#include "walk/walk_checks.h"

#define COPIES 200000u
#define RUNS ((COPIES - 1) / STRL_RUN_PLACEMENTS + 1)
#define PAGE_BYTES (4 + 108 * STRL_RUN_PLACEMENTS) /* of a run, in the file */

static uint8_t *bytes;
static size_t size;
static double width; /* of the array, which lies in x and -z */

static uint8_t *make_array(uint64_t copies, size_t *file_bytes)
{
    strl_error err = {0};
    const strl_scene_desc scene = {
        .name = "array", .path = built_path("many.gltf"), .of = built_path("one.ply"), .copies = copies};
    if (strl_scene_write(&scene, NULL, NULL, &err) != STRL_OK)
        fail_msg("%s", err.message);
    assert_int_equal(built_build_one(built_path("many.gltf"), built_path("many.stroll")).placements, copies);
    return built_read_file(built_path("many.stroll"), file_bytes);
}

static int make_model(void **state)
{
    if (built_setup(state) != 0)
        return -1;
    built_scene("isosurface", "one.ply", 2000, true);
    bytes = make_array(COPIES, &size);
    strl_walk *walk = open_walk(memory_source(bytes, size), NULL);
    double bounds[6];
    strl_walk_bounds(walk, bounds);
    width = bounds[3];
    strl_walk_close(walk);
    return 0;
}

static int drop_model(void **state)
{
    free(bytes);
    return built_teardown(state);
}

/* x, z and what is looked at are shares of the array's width. */
static strl_camera look(double x, double height, double z, double target_x, double target_z)
{
    return (strl_camera){.eye = {x * width, height, -z * width},
                         .target = {target_x * width, 0, -target_z * width},
                         .up = {0.01, 1, 0.02},
                         .fov_y_deg = 40,
                         .width = 640,
                         .height = 360};
}

/* Low over a corner of the array, over another, ... */
static strl_camera low_over(unsigned at)
{
    double x = 0.1 + 0.2 * (at % 5), z = 0.1 + 0.2 * (at / 5 % 5);
    return look(x, 12, z, x + 0.01, z + 0.01);
}

static watched_source *open_watched(strl_walk **walk, const strl_walk_desc *desc)
{
    watched_source *source = watched_source_open(memory_source(bytes, size));
    *walk = open_walk(&source->base, desc);
    source->walking = true;
    return source;
}

static uint32_t resident_runs(const strl_walk *walk)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < walk->run_count; i++)
        count += walk->runs[i].page != NULL;
    return count;
}

/* A walk that has read every page before its first frame. */
static strl_walk *open_whole(void)
{
    strl_walk *walk = open_walk(memory_source(bytes, size), NULL);
    for (uint32_t i = 0; i < walk->run_count; i++) {
        strl__run *run = &walk->runs[i];
        strl__run_reserve(walk, run, NULL);
        assert_int_equal(strl__run_load(walk, run, bytes + run->facts.page.offset, run->facts.page.bytes, NULL),
                         STRL_OK);
    }
    return walk;
}

/* The same placements, nodes and states, and the same points for what is far. */
static void check_equal(const strl_draw_list *a, const strl_draw_list *b)
{
    assert_int_equal(a->count, b->count);
    for (uint32_t i = 0; i < a->count; i++) {
        const strl_draw_item *x = &a->items[i], *y = &b->items[i];
        assert_true(x->placement == y->placement && x->node == y->node && x->visible == y->visible);
        assert_true(x->draw_count == y->draw_count && x->point_px == y->point_px && x->error_px == y->error_px);
        assert_true(x->vertex_count == y->vertex_count);
        if (x->point_px > 0)
            assert_memory_equal(x->vertices, y->vertices, x->vertex_count * sizeof *x->vertices);
        assert_memory_equal(x->transform, y->transform, sizeof x->transform);
    }
}

static uint32_t count_points(const strl_draw_list *list)
{
    uint32_t points = 0;
    for (uint32_t i = 0; i < list->count; i++)
        points += list->items[i].placement == STRL_NONE ? list->items[i].vertex_count : 0;
    return points;
}

static void opening_reads_what_runs_look_like_and_far_away_no_page_is_needed(void **state)
{
    (void)state;
    strl_walk *walk;
    watched_source *source = open_watched(&walk, NULL);
    assert_int_equal(walk->run_count, RUNS);
    assert_in_range(source->read_bytes, RUNS * 80, 128 << 10); /* all placements are 20 million bytes */
    const strl_camera far = look(0.5, 1000 * width, 0.501, 0.5, 0.5);
    strl_draw_list list = settle(walk, &far, 10);
    assert_in_range(count_points(&list), 1, RUNS);
    assert_int_equal(source->came_bytes, 0);
    assert_int_equal(resident_runs(walk), 0);
    strl_walk_close(walk);
}

static void near_by_few_pages_are_needed_and_before_they_come_points_stand_for_them(void **state)
{
    (void)state;
    strl_walk *walk;
    watched_source *source = open_watched(&walk, NULL);
    const strl_camera camera = low_over(12);
    strl_draw_list list = walk_frame(walk, &camera);
    assert_false(strl_walk_settled(walk));
    assert_true(strl_walk_get_stats(walk)->missing_nodes > 0);
    uint32_t points = count_points(&list), large = 0;
    for (uint32_t i = 0; i < list.count; i++) {
        assert_int_equal(list.items[i].placement, STRL_NONE);
        assert_in_range(list.items[i].point_px, 1, 64);
        large += list.items[i].point_px > 1;
    }
    assert_true(points > 0 && large > 0);
    list = settle(walk, &camera, 500);
    assert_true(count_points(&list) < list.count); /* most copies are drawn themselves */
    uint32_t resident = resident_runs(walk);
    assert_in_range(resident, 1, RUNS / 8);
    assert_in_range(source->came_bytes, resident * (uint64_t)PAGE_BYTES, size / 6);
    strl_walk_close(walk);
}

static void a_settled_list_is_that_of_a_walk_that_has_read_all(void **state)
{
    (void)state;
    strl_walk *whole = open_whole(), *paged = open_walk(memory_source(bytes, size), NULL);
    const strl_camera cameras[] = {low_over(0),
                                   low_over(18),
                                   look(0.2, 5, 0.2, -1, -1),
                                   look(0.5, 20, -0.1, 0.5, 0.3),
                                   look(0.5, 80, 0.5, 0.55, 0.55),
                                   look(0.5, 8 * width, 0.501, 0.5, 0.5)};
    for (unsigned i = 0; i < sizeof cameras / sizeof *cameras; i++) {
        const strl_draw_list expected = settle(whole, &cameras[i], 500), found = settle(paged, &cameras[i], 500);
        check_equal(&expected, &found);
        assert_int_equal(strl_walk_get_stats(paged)->missing_nodes, 0);
        assert_true(i > 2 || resident_runs(paged) < RUNS / 4);
    }
    strl_walk_close(whole);
    strl_walk_close(paged);
}

/* Pages go for others and come back. */
static void the_budget_holds_wherever_the_walk_goes(void **state)
{
    (void)state;
    const strl_walk_desc desc = {.memory_bytes = 5u << 18};
    strl_walk *whole = open_whole(), *walk = open_walk(memory_source(bytes, size), &desc);
    uint8_t *seen = calloc(RUNS, 1);
    assert_non_null(seen);
    for (unsigned at = 0; at < 30; at++) { /* the first places again at the end */
        const strl_camera camera = low_over(at);
        for (unsigned frame = 0; frame < 1000 && !(frame && strl_walk_settled(walk)); frame++) {
            walk_frame(walk, &camera);
            strl_walk_pump(walk, UINT64_MAX);
            assert_true(strl_walk_get_stats(walk)->resident_bytes <= desc.memory_bytes);
        }
        assert_true(strl_walk_settled(walk));
        assert_true(strl_walk_get_stats(walk)->allowed_error_px == 1);
        const strl_draw_list expected = settle(whole, &camera, 500), found = walk_frame(walk, &camera);
        check_equal(&expected, &found);
        for (uint32_t i = 0; i < RUNS; i++)
            seen[i] |= walk->runs[i].page != NULL;
    }
    uint32_t ever = 0;
    for (uint32_t i = 0; i < RUNS; i++)
        ever += seen[i];
    assert_true(ever > 2 * resident_runs(walk));
    free(seen);
    strl_walk_close(walk);
    strl_walk_close(whole);
}

/* What cannot be held is drawn as far away: the allowed error grows until the rest fits. */
static void more_than_fits_is_seen_with_a_larger_error(void **state)
{
    (void)state;
    const strl_walk_desc desc = {.memory_bytes = 3u << 20};
    strl_walk *walk = open_walk(memory_source(bytes, size), &desc);
    const strl_camera all = look(0.5, width, 0.501, 0.5, 0.5), close = low_over(3);
    strl_draw_list list = settle(walk, &all, 2000);
    double allowed = strl_walk_get_stats(walk)->allowed_error_px;
    assert_true(allowed > 1 && allowed < 200);
    assert_true(count_points(&list) >= RUNS / 16);
    uint64_t requests = 0;
    for (unsigned frame = 0; frame < 50; frame++) { /* it rests */
        walk_frame(walk, &all);
        strl_walk_pump(walk, UINT64_MAX);
        assert_true(strl_walk_get_stats(walk)->resident_bytes <= desc.memory_bytes);
        requests += strl_walk_get_stats(walk)->requests;
    }
    assert_int_equal(requests, 0);
    settle(walk, &close, 2000);
    assert_true(strl_walk_get_stats(walk)->allowed_error_px == 1);
    strl_walk_close(walk);
}

static void a_page_that_fails_is_a_point_until_it_is_repaired(void **state)
{
    (void)state;
    strl_walk *whole = open_whole(), *walk = open_walk(memory_source(bytes, size), NULL);
    const strl_camera camera = low_over(7);
    const strl_draw_list expected = settle(whole, &camera, 500);
    uint32_t run = expected.items[0].placement / STRL_RUN_PLACEMENTS;
    uint8_t *byte = bytes + walk->runs[run].facts.page.offset + 5000;
    *byte ^= 1;
    strl_draw_list list = settle(walk, &camera, 3000); /* it does not wait for ever */
    const strl_walk_stats *stats = strl_walk_get_stats(walk);
    assert_null(walk->runs[run].page);
    assert_true(stats->missing_nodes > 0 && count_points(&list) > 0);
    assert_non_null(strstr(stats->last_fault, "page of placements"));
    *byte ^= 1;
    for (unsigned i = 0; i < 5000 && (stats->missing_nodes > 0 || i == 0); i++) {
        list = walk_frame(walk, &camera);
        strl_walk_pump(walk, UINT64_MAX);
    }
    list = settle(walk, &camera, 500);
    check_equal(&expected, &list);
    strl_walk_close(walk);
    strl_walk_close(whole);
}

static void a_source_that_fails_now_and_then_heals(void **state)
{
    (void)state;
    strl_source *failing;
    assert_int_equal(strl_source_open_delayed(memory_source(bytes, size), 0, 2, &failing, NULL), STRL_OK);
    watched_source *source = watched_source_open(failing);
    source->hold_percent = 50;
    strl_walk *walk = open_walk(&source->base, NULL), *whole = open_whole();
    source->walking = true;
    const strl_camera camera = low_over(16);
    strl_draw_list expected = settle(whole, &camera, 500), found = {0};
    for (unsigned i = 0; i < 5000; i++) {
        found = walk_frame(walk, &camera);
        assert_true(found.count > 0);
        if (strl_walk_settled(walk) && strl_walk_get_stats(walk)->missing_nodes == 0)
            break;
        strl_walk_pump(walk, UINT64_MAX);
    }
    assert_true(strl_walk_get_stats(walk)->faults > 0);
    check_equal(&expected, &found);
    strl_walk_close(walk);
    strl_walk_close(whole);
}

/* What was asked for and nobody wants any more leaves no reservation behind. */
static void what_is_no_longer_wanted_gives_its_room_back(void **state)
{
    (void)state;
    strl_walk *walk;
    watched_source *source = open_watched(&walk, NULL);
    const strl_camera near = low_over(12), away = look(0.5, 12, -0.5, 0.5, -1);
    source->hold_percent = 100;
    for (unsigned i = 0; i < 3; i++)
        walk_frame(walk, &near);
    assert_true(strl_walk_get_stats(walk)->requests_pending > 0);
    for (unsigned i = 0; i < 40; i++)
        walk_frame(walk, &away);
    source->hold_percent = 0;
    for (unsigned i = 0; i < 40; i++)
        walk_frame(walk, &away);
    assert_int_equal(strl_walk_get_stats(walk)->requests_pending, 0);
    uint64_t pages = 0;
    for (uint32_t i = 0; i < RUNS; i++)
        pages += walk->runs[i].page ? strl__run_bytes(walk->runs[i].page->count) : 0;
    assert_int_equal(walk->resident_bytes,
                     walk->placement_bytes + walk->treelet_bytes + walk->kept_bytes + walk->root_bytes + pages);
    strl_walk_close(walk);
}

/* ---- hostile files */

/* Some bytes of placements and runs, and of the index pages and the header that lead to them, under right checksums. */
static void damage_placements(uint8_t *data, size_t data_bytes, uint64_t *random)
{
    unsigned damages = 1 + (unsigned)(next_random(random) * 3);
    for (unsigned i = 0; i < damages; i++) {
        bool runs = next_random(random) < 0.5;
        uint64_t section = STRL__AT_SECTIONS + (runs ? 4 : 1) * (uint64_t)STRL__SECTION_BYTES,
                 start = strl__load_le(data + section + 16, 8);
        uint64_t length = strl__load_le(data + section + 24, 4);
        if (!runs && next_random(random) < 0.8) { /* a page of placements; each run tells where one is */
            uint64_t leaf = strl__load_le(data + STRL__AT_SECTIONS + 4 * STRL__SECTION_BYTES + 16, 8);
            uint64_t run = leaf <= data_bytes - 400 ? leaf + 16 + 80 * (uint64_t)(next_random(random) * 3) : 0;
            start = run ? strl__load_le(data + run + 64, 8) : start;
            length = 4 + 108 * STRL_RUN_PLACEMENTS;
        }
        if (next_random(random) < 0.1)
            start = section, length = STRL__SECTION_BYTES;
        uint64_t at = start + (uint64_t)(next_random(random) * (double)length);
        if (at < data_bytes)
            data[at] =
                next_random(random) < 0.3 ? 0xff : (uint8_t)(data[at] ^ (1 + (unsigned)(next_random(random) * 255)));
    }
    reseal_all(data, data_bytes, NULL, NULL);
}

static void placements_that_lie_are_refused_or_walked(void **state)
{
    (void)state;
    size_t data_bytes;
    uint8_t *sound = make_array(3 * STRL_RUN_PLACEMENTS - 5, &data_bytes), *data = malloc(data_bytes);
    assert_non_null(data);
    uint64_t random = 5;
    unsigned opened = 0, faults = 0;
    for (unsigned round = 0; round < 300; round++) {
        const strl_walk_desc desc = {.memory_bytes = 4u << 20};
        const strl_camera cameras[] = {look(0.01, 12, 0.01, 0.02, 0.02), look(0.03, 2 * width, 0.03, 0.04, 0.04)};
        strl_walk *walk;
        strl_error err = {0};
        memcpy(data, sound, data_bytes);
        damage_placements(data, data_bytes, &random);
        if (strl_walk_open(memory_source(data, data_bytes), &desc, &walk, &err) != STRL_OK) {
            assert_true(err.message[0]);
            continue;
        }
        opened++;
        for (unsigned i = 0; i < 40; i++) {
            strl_draw_list list;
            if (strl_walk_frame(walk, &cameras[i / 20], &list, &err) != STRL_OK)
                fail_msg("%s", err.message);
            strl_walk_pump(walk, UINT64_MAX);
            assert_true(strl_walk_get_stats(walk)->resident_bytes <= desc.memory_bytes);
        }
        faults += strl_walk_get_stats(walk)->faults > 0;
        strl_walk_close(walk);
    }
    assert_true(opened > 50 && opened < 300 && faults > 5);
    free(data);
    free(sound);
}

static void without_memory_calls_fail_and_the_walk_goes_on(void **state)
{
    (void)state;
    const strl_camera camera = low_over(9);
    bool opened = false;
    for (uint64_t n = 1; !opened; n++) {
        strl_source *source = memory_source(bytes, size);
        strl_walk *walk;
        strl__alloc_fail_after(n);
        opened = strl_walk_open(source, NULL, &walk, NULL) == STRL_OK;
        strl__alloc_fail_after(0);
        assert_true(opened || walk == NULL);
        strl_walk_close(walk);
    }
    for (uint64_t n = 1; n < 200; n += 1 + n / 4) {
        strl_walk *walk = open_walk(memory_source(bytes, size), NULL);
        for (unsigned i = 0; i < 6; i++) {
            strl_draw_list list;
            walk_frame_without_memory(walk, &camera, n, &list);
        }
        for (unsigned i = 0; i < 400 && (!strl_walk_settled(walk) || strl_walk_get_stats(walk)->missing_nodes); i++) {
            walk_frame(walk, &camera);
            strl_walk_pump(walk, UINT64_MAX);
        }
        assert_int_equal(strl_walk_get_stats(walk)->missing_nodes, 0);
        strl_walk_close(walk);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(opening_reads_what_runs_look_like_and_far_away_no_page_is_needed),
        cmocka_unit_test(near_by_few_pages_are_needed_and_before_they_come_points_stand_for_them),
        cmocka_unit_test(a_settled_list_is_that_of_a_walk_that_has_read_all),
        cmocka_unit_test(the_budget_holds_wherever_the_walk_goes),
        cmocka_unit_test(more_than_fits_is_seen_with_a_larger_error),
        cmocka_unit_test(a_page_that_fails_is_a_point_until_it_is_repaired),
        cmocka_unit_test(a_source_that_fails_now_and_then_heals),
        cmocka_unit_test(what_is_no_longer_wanted_gives_its_room_back),
        cmocka_unit_test(placements_that_lie_are_refused_or_walked),
        cmocka_unit_test(without_memory_calls_fail_and_the_walk_goes_on),
    };
    return cmocka_run_group_tests(tests, make_model, drop_model);
}
