/* The walk when reads fail, pages are wrong and memory runs out. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "base/memory.h"
#include "container/container.h"
#include "platform/thread.h"
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

static void a_source_that_fails_now_and_then_heals(void **state)
{
    (void)state;
    strl_source *failing;
    assert_int_equal(strl_source_open_delayed(memory_source(model, model_bytes), 0, 3, &failing, NULL), STRL_OK);
    watched_source *source = watched_source_open(failing);
    strl_walk *walk = open_walk(&source->base, NULL), *sound = open_walk(memory_source(model, model_bytes), NULL);
    source->walking = true;
    strl_camera camera = flight_camera(500);
    strl_draw_list wanted = settle(sound, &camera, 400), list = {0};
    for (unsigned i = 0; i < 5000; i++) { /* settled is not enough: it does not wait for what failed three times */
        list = walk_frame(walk, &camera);
        check_cut_is_closed(&list, 0);
        if (strl_walk_settled(walk) && strl_walk_get_stats(walk)->missing_nodes == 0)
            break;
        strl_walk_pump(walk, UINT64_MAX);
    }
    check_same_lists(&wanted, &list);
    assert_true(strl_walk_get_stats(walk)->faults > 0);
    assert_true(strl_walk_get_stats(walk)->last_fault[0] != 0);
    strl_walk_close(walk);
    strl_walk_close(sound);
}

typedef struct mortal {
    bool is_dead;
    unsigned reads;
} mortal;

static strl_status read_mortal(void *context, uint64_t offset, void *data, size_t size, strl_error *err)
{
    mortal *self = context;
    self->reads++;
    if (self->is_dead)
        return strl_error_set(err, STRL_ERR_NETWORK, "nobody is there");
    memcpy(data, model + offset, size);
    return STRL_OK;
}

/* By frames alone it would be some thousand of them, at this point. */
static void what_failed_is_asked_for_again_once_the_source_is_back(void **state)
{
    (void)state;
    enum { LOOKS_FOR_MS = 2500, FRAME_MS = 10 };
    mortal server = {.is_dead = false};
    const strl_source_callbacks callbacks = {.bytes = model_bytes, .context = &server, .read = read_mortal};
    strl_source *source;
    assert_int_equal(strl_source_open_callbacks(&callbacks, 0, &source, NULL), STRL_OK);
    strl_walk *walk = open_walk(source, NULL), *sound = open_walk(memory_source(model, model_bytes), NULL);
    strl_camera camera = flight_camera(500);
    strl_draw_list wanted = settle(sound, &camera, 400), list = {0};
    server.is_dead = true;
    for (unsigned i = 0; i < 2100; i++) /* the next one after 1,024 */
        list = walk_frame(walk, &camera);
    check_cut_is_closed(&list, 0);
    unsigned before = server.reads;
    strl_sleep_ns((uint64_t)LOOKS_FOR_MS * 1000000u);
    for (unsigned i = 0; i < 3; i++) /* a look is one read, whatever waits */
        walk_frame(walk, &camera);
    assert_true(server.reads - before <= 3);
    server.is_dead = false;
    for (unsigned i = 0; i < 600 && (i == 0 || strl_walk_get_stats(walk)->missing_nodes > 0); i++) {
        list = walk_frame(walk, &camera);
        strl_walk_pump(walk, UINT64_MAX);
        strl_sleep_ns((uint64_t)FRAME_MS * 1000000u);
    }
    check_same_lists(&wanted, &list);
    strl_walk_close(walk);
    strl_walk_close(sound);
}

/* While a read fails and others do not, the source comes back again and again. */
static void what_fails_once_more_is_called_by_the_end_of_another_outage(void **state)
{
    (void)state;
    strl_walk *walk = strl__alloc_zero(1, sizeof *walk);
    strl__retry retry = {0};
    assert_non_null(walk);
    for (unsigned outage = 0; outage < 3; outage++) {
        strl__source_fails(walk);
        if (outage == 0)
            strl__back_off(walk, &retry, true);
        assert_true(strl__is_waiting(walk, &retry));
        walk->away_ns -= outage * UINT64_C(2000000000);
        strl__source_answers(walk);
        assert_false(strl__is_waiting(walk, &retry));
        strl__retry_asked(walk, &retry);
        for (unsigned i = 0; i < 3; i++) {
            strl__source_fails(walk);
            strl__back_off(walk, &retry, true);
            strl__source_answers(walk);
            assert_true(strl__is_waiting(walk, &retry));
        }
    }
    walk->frame = retry.frame;
    assert_false(strl__is_waiting(walk, &retry));
    strl__retry_asked(walk, &retry); /* it has waited, and whatever returns may call it */
    strl__source_fails(walk);
    strl__back_off(walk, &retry, true);
    strl__source_answers(walk);
    assert_false(strl__is_waiting(walk, &retry));
    strl__free(walk);
}

static strl_node record_of(const uint8_t *data, uint32_t node)
{
    strl_container *container;
    strl_node record;
    assert_int_equal(strl_container_open(memory_source(data, model_bytes), &container, NULL), STRL_OK);
    assert_int_equal(strl_container_node(container, 0, node, &record, NULL), STRL_OK);
    strl_container_close(container);
    return record;
}

static void a_damaged_page_keeps_its_nodes_coarse_until_it_is_repaired(void **state)
{
    (void)state;
    uint8_t *data = strl__alloc(model_bytes, 1);
    memcpy(data, model, model_bytes);
    strl_camera camera = flight_camera(500);
    strl_walk *sound = open_walk(memory_source(model, model_bytes), NULL);
    strl_draw_list wanted = settle(sound, &camera, 400);
    const strl_node damaged = record_of(data, wanted.items[wanted.count / 2].node);
    uint8_t *byte = &data[damaged.page.offset + damaged.page.bytes / 2];
    *byte ^= 1;
    strl_walk *walk = open_walk(memory_source(data, model_bytes), NULL);
    strl_draw_list list = settle(walk, &camera, 2000); /* it does not wait for ever */
    const strl_walk_stats *stats = strl_walk_get_stats(walk);
    check_cut_is_closed(&list, 0);
    assert_true(stats->missing_nodes > 0);
    assert_non_null(strstr(stats->last_fault, "checksum"));
    uint64_t before = stats->faults;
    for (unsigned i = 0; i < 200; i++) {
        walk_frame(walk, &camera);
        strl_walk_pump(walk, UINT64_MAX);
    }
    assert_true(stats->faults - before < 64); /* asked for again, but ever more rarely */
    *byte ^= 1;
    for (unsigned i = 0; i < 5000 && (stats->missing_nodes > 0 || i == 0); i++) {
        list = walk_frame(walk, &camera);
        strl_walk_pump(walk, UINT64_MAX);
    }
    check_same_lists(&wanted, &list);
    strl_walk_close(walk);
    strl_walk_close(sound);
    strl__free(data);
}

static void a_file_damaged_anywhere_is_refused_or_walked_without_a_crack(void **state)
{
    (void)state;
    uint8_t *data = strl__alloc(model_bytes, 1);
    strl_camera camera = flight_camera(500);
    uint64_t random = 77;
    unsigned opened = 0;
    for (unsigned run = 0; run < 60; run++) {
        memcpy(data, model, model_bytes);
        unsigned damages = 1 + run % 5;
        for (unsigned i = 0; i < damages; i++)
            data[(size_t)(next_random(&random) * (double)model_bytes)] ^= (uint8_t)(1 + next_random(&random) * 255);
        strl_walk *walk;
        strl_error err = {0};
        if (strl_walk_open(memory_source(data, model_bytes), NULL, &walk, &err) != STRL_OK) {
            assert_true(err.message[0] != 0);
            continue;
        }
        opened++;
        strl_draw_list list = settle(walk, &camera, 3000);
        check_cut_is_closed(&list, 0);
        strl_walk_close(walk);
    }
    assert_true(opened > 0);
    strl__free(data);
}

/* As a page's own checks could let pass: each of its nodes names the children of the node before it. */
static uint32_t contradict(strl_walk *walk)
{
    const strl__treelet *second = strl__treelets_find(&walk->treelets, 0, 1);
    uint32_t changed = 0;
    assert_non_null(second);
    assert_int_equal(second->residency, STRL__RESIDENT);
    for (uint32_t i = 0; i < second->data.node_count; i++)
        if (second->data.nodes[i].child_count > 0) {
            ((strl_node *)second->nodes[i].record)->first_child -= 2;
            changed++;
        }
    return changed;
}

static void a_node_that_two_others_name_as_their_child_is_drawn_once(void **state)
{
    (void)state;
    strl_walk *walk = open_walk(memory_source(model, model_bytes), &(strl_walk_desc){.error_px = 1e-3});
    strl_camera camera = flight_camera(500);
    size_t before = settle(walk, &camera, 3000).count;
    assert_true(contradict(walk) > 100);
    for (unsigned i = 0; i < 200; i++) {
        strl_draw_list list = walk_frame(walk, &camera);
        strl_walk_pump(walk, UINT64_MAX);
        check_cut_is_closed(&list, 0);
        assert_true(list.count < before);
    }
    assert_non_null(strstr(strl_walk_get_stats(walk)->last_fault, "is not the child of node"));
    strl_walk_close(walk);
}

static void without_memory_calls_fail_and_the_walk_goes_on(void **state)
{
    (void)state;
    strl_camera camera = flight_camera(500);
    bool opened = false;
    for (uint64_t n = 1; !opened; n++) {
        strl_source *source = memory_source(model, model_bytes);
        strl_walk *walk;
        strl__alloc_fail_after(n);
        strl_status status = strl_walk_open(source, NULL, &walk, NULL);
        strl__alloc_fail_after(0);
        opened = status == STRL_OK;
        assert_true(opened || walk == NULL);
        strl_walk_close(walk);
    }
    for (uint64_t n = 1; n < 400; n += 1 + n / 8) {
        strl_walk *walk = open_walk(memory_source(model, model_bytes), NULL);
        for (unsigned i = 0; i < 6; i++) {
            strl_draw_list list;
            strl_status status = walk_frame_without_memory(walk, &camera, n, &list);
            if (status == STRL_OK && i % 3 == 0)
                check_cut_is_closed(&list, 0);
        }
        for (unsigned i = 0; i < 200 && (!strl_walk_settled(walk) || strl_walk_get_stats(walk)->missing_nodes); i++) {
            walk_frame(walk, &camera);
            strl_walk_pump(walk, UINT64_MAX);
        }
        assert_int_equal(strl_walk_get_stats(walk)->missing_nodes, 0);
        strl_walk_close(walk);
    }
}

static void a_degenerate_camera_is_refused_and_the_next_one_is_served(void **state)
{
    (void)state;
    strl_walk *walk = open_walk(memory_source(model, model_bytes), NULL);
    strl_camera camera = flight_camera(0), blind = camera;
    strl_draw_list list;
    strl_error err = {0};
    settle(walk, &camera, 400);
    memcpy(blind.target, blind.eye, sizeof blind.eye);
    assert_int_equal(strl_walk_frame(walk, &blind, &list, &err), STRL_ERR_ARGUMENT);
    assert_int_equal(list.count, 0);
    assert_false(strl_walk_settled(walk));
    list = settle(walk, &camera, 10);
    check_cut_is_closed(&list, 0);
    strl_walk_close(walk);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_source_that_fails_now_and_then_heals),
        cmocka_unit_test(what_failed_is_asked_for_again_once_the_source_is_back),
        cmocka_unit_test(what_fails_once_more_is_called_by_the_end_of_another_outage),
        cmocka_unit_test(a_damaged_page_keeps_its_nodes_coarse_until_it_is_repaired),
        cmocka_unit_test(a_file_damaged_anywhere_is_refused_or_walked_without_a_crack),
        cmocka_unit_test(a_node_that_two_others_name_as_their_child_is_drawn_once),
        cmocka_unit_test(without_memory_calls_fail_and_the_walk_goes_on),
        cmocka_unit_test(a_degenerate_camera_is_refused_and_the_next_one_is_served),
    };
    return cmocka_run_group_tests(tests, create_model, destroy_model);
}
