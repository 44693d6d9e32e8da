/* A walk as another program embeds it: bytes by callbacks on the source's threads, decoding by an executor of its own.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "base/memory.h"
#include "platform/thread.h"
#include "walk/grid_model.h"
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

typedef struct remote {
    atomic_bool down;
    atomic_uint reads, closed;
} remote;

static strl_status read_remote(void *context, uint64_t offset, void *data, size_t size, strl_error *err)
{
    remote *self = context;
    atomic_fetch_add(&self->reads, 1);
    if (atomic_load(&self->down))
        return strl_error_set(err, STRL_ERR_NETWORK, "the remote is down");
    memcpy(data, model + offset, size);
    return STRL_OK;
}

static void close_remote(void *context)
{
    atomic_fetch_add(&((remote *)context)->closed, 1);
}

static strl_source *open_remote(remote *self, unsigned threads)
{
    strl_source *source;
    const strl_source_callbacks callbacks = {
        .name = "over there", .bytes = model_bytes, .context = self, .read = read_remote, .close = close_remote};
    assert_int_equal(strl_source_open_callbacks(&callbacks, threads, &source, NULL), STRL_OK);
    return source;
}

/* Decodes inside submit: legal, and the shortest executor there is. */
static strl_status run_at_once(void *context, void (*run)(void *job), void *job, strl_error *err)
{
    (void)err;
    ++*(unsigned *)context;
    run(job);
    return STRL_OK;
}

/* Frames until settled; decoding does not wait for a pump. */
static strl_draw_list settle_by_frames(strl_walk *walk, const strl_camera *camera)
{
    strl_draw_list list = walk_frame(walk, camera);
    for (unsigned i = 0; i < 20000 && !strl_walk_settled(walk); i++) {
        strl_sleep_ns(100000);
        list = walk_frame(walk, camera);
    }
    assert_true(strl_walk_settled(walk));
    return list;
}

static void a_walk_over_callbacks_draws_what_one_over_memory_draws(void **state)
{
    (void)state;
    for (unsigned threads = 0; threads < 4; threads += 3) {
        remote there = {0};
        unsigned decoded = 0;
        const strl_executor executor = {&decoded, run_at_once};
        strl_walk *near = open_walk(memory_source(model, model_bytes), NULL);
        strl_walk *far = open_walk(open_remote(&there, threads), &(strl_walk_desc){.executor = &executor});
        uint64_t random = 3;
        for (unsigned view = 0; view < 6; view++) {
            strl_camera camera = random_camera(&random);
            strl_draw_list expected = settle(near, &camera, 1000), found = settle_by_frames(far, &camera);
            check_same_lists(&expected, &found);
        }
        assert_true(decoded > 10);
        strl_walk_close(near);
        strl_walk_close(far);
        assert_int_equal(atomic_load(&there.closed), 1);
    }
}

static void a_remote_that_is_down_is_a_fault_and_no_failure(void **state)
{
    (void)state;
    remote there = {0};
    uint64_t random = 5;
    strl_camera camera = random_camera(&random);
    strl_walk *walk = open_walk(open_remote(&there, 2), NULL);
    atomic_store(&there.down, true);
    for (unsigned i = 0; i < 50; i++) {
        strl_draw_list list = walk_frame(walk, &camera);
        assert_true(list.count > 0);
        strl_walk_pump(walk, 1000000);
        strl_sleep_ns(100000);
    }
    assert_true(strl_walk_get_stats(walk)->faults > 0);
    assert_string_equal(strl_walk_get_stats(walk)->last_fault, "the remote is down");
    atomic_store(&there.down, false);
    for (unsigned i = 0; i < 20000 && strl_walk_get_stats(walk)->missing_nodes > 0; i++)
        settle(walk, &camera, 20000); /* what failed thrice is asked for again, but not waited for */
    assert_int_equal(strl_walk_get_stats(walk)->missing_nodes, 0);
    strl_walk_close(walk);
}

static void what_is_drawn_has_parts(void **state)
{
    (void)state;
    remote there = {0};
    uint64_t random = 9;
    strl_camera camera = random_camera(&random);
    strl_walk *walk = open_walk(open_remote(&there, 1), NULL);
    strl_container *container = strl_walk_container(walk);
    strl_draw_list list = settle(walk, &camera, 20000);
    assert_int_equal(strl_container_get_info(container)->placement_count, 1);
    for (uint32_t i = 0; i < list.count; i++) {
        const strl_draw_item *item = &list.items[i];
        strl_error err;
        uint32_t *parts = malloc(item->vertex_count * sizeof *parts);
        assert_non_null(parts);
        strl_status status =
            strl_container_vertex_parts(container, item->placement, item->node, item->vertex_count, parts, NULL, &err);
        assert_int_equal(status, STRL_OK);
        for (uint32_t v = 0; v < item->vertex_count; v++)
            assert_true(parts[v] < strl_container_get_info(container)->part_count);
        free(parts);
    }
    strl_walk_close(walk);
}

static void a_model_that_does_not_open_is_named_and_its_source_closed(void **state)
{
    (void)state;
    remote there = {0};
    strl_walk *walk;
    strl_error err;
    strl_source *source = open_remote(&there, 0);
    atomic_store(&there.down, true);
    assert_int_equal(strl_walk_open(source, NULL, &walk, &err), STRL_ERR_NETWORK);
    assert_null(walk);
    assert_string_equal(err.message, "over there: the remote is down");
    assert_int_equal(atomic_load(&there.closed), 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_walk_over_callbacks_draws_what_one_over_memory_draws),
        cmocka_unit_test(a_remote_that_is_down_is_a_fault_and_no_failure),
        cmocka_unit_test(what_is_drawn_has_parts),
        cmocka_unit_test(a_model_that_does_not_open_is_named_and_its_source_closed),
    };
    return cmocka_run_group_tests(tests, create_model, destroy_model);
}
