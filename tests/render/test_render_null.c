/* The null renderer finds what a GPU would draw wrongly without a word. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "base/memory.h"
#include "render/patches.h"
#include "stroll/render.h"

typedef struct fixture {
    patches all;
    strl_renderer *renderer;
    strl_camera camera;
    strl_render_stats stats;
    strl_error err;
} fixture;

static int setup(void **state)
{
    fixture *f = calloc(1, sizeof *f);
    const strl_renderer_desc desc = {
        .backend = STRL_BACKEND_NULL, .width = 64, .height = 48, .gpu_memory_bytes = 4 << 20};
    patches_init(&f->all, (patches_desc){.side = 2});
    f->camera = patches_camera(&f->all, 64, 48, 0.3);
    *state = f;
    return strl_renderer_create(&desc, &f->renderer, NULL) == STRL_OK ? 0 : -1;
}

static int teardown(void **state)
{
    fixture *f = *state;
    strl_renderer_destroy(f->renderer);
    patches_deinit(&f->all);
    free(f);
    return 0;
}

static strl_status draw(fixture *f)
{
    return strl_renderer_draw(f->renderer, &f->camera, &f->all.list, NULL, &f->stats, &f->err);
}

static void assert_refused(fixture *f, const char *words)
{
    assert_int_equal(draw(f), STRL_ERR_ARGUMENT);
    if (!strstr(f->err.message, words))
        fail_msg("expected \"%s\" in \"%s\"", words, f->err.message);
}

static void faces_are_culled_as_is_known(void **state)
{
    fixture *f = *state;
    f->all.list.cull = STRL_CULL_BACK;
    assert_int_equal(draw(f), STRL_OK);
    assert_int_equal(f->stats.items, 4);
    f->all.list.cull = (strl_cull)2;
    assert_refused(f, "culls");
}

static void a_sound_list_is_counted(void **state)
{
    fixture *f = *state;
    f->all.items[2].visible = false;
    assert_int_equal(draw(f), STRL_OK);
    assert_int_equal(f->stats.items, 3);
    assert_int_equal(f->stats.triangles, 3 * PATCH_INDICES / 3);
    assert_int_equal(f->stats.uploaded_vertices, 3 * PATCH_VERTICES);
    assert_int_equal(f->stats.gpu_bytes, 3 * (PATCH_VERTICES * 20 + PATCH_INDICES * 2));
    assert_int_equal(draw(f), STRL_OK);
    assert_int_equal(f->stats.uploaded_bytes, 0);
}

static void an_index_past_the_vertices_is_found(void **state)
{
    fixture *f = *state;
    f->all.indices[PATCH_INDICES + 7] = PATCH_VERTICES;
    assert_refused(f, "an index is 625, expected at most 624");
}

static void a_vertex_outside_the_box_is_found(void **state)
{
    fixture *f = *state;
    f->all.items[3].box_max[2]--;
    assert_refused(f, "outside the node's box along axis 2");
}

static void a_broken_count_or_number_is_found(void **state)
{
    fixture *f = *state;
    f->all.items[1].index_count--, f->all.items[1].draw_count--;
    assert_refused(f, "index count modulo three");
    f->all.items[1].index_count++, f->all.items[1].draw_count++;
    assert_int_equal(draw(f), STRL_OK);
    f->all.items[1].draw_first = 3, f->all.items[1].draw_count = PATCH_INDICES;
    assert_refused(f, "count of indices to draw");
    f->all.items[1].draw_first = 0;
    f->all.items[0].transform[5] = NAN;
    assert_refused(f, "not a finite number");
    f->all.items[0].transform[5] = 1, f->all.items[0].step = 0;
    assert_refused(f, "not a finite number");
    f->all.items[0].step = 1, f->all.vertices[3].normal[1] = 1024;
    assert_refused(f, "a normal's coordinate");
}

static void a_key_used_twice_is_found(void **state)
{
    fixture *f = *state;
    f->all.items[2].key = f->all.items[0].key;
    assert_refused(f, "in the list already");
    /* Over two lists the same key is the same node, and not a mistake. */
    f->all.items[2].key = 999;
    assert_int_equal(draw(f), STRL_OK);
    assert_int_equal(draw(f), STRL_OK);
}

static void other_vertices_under_the_same_key_are_found(void **state)
{
    fixture *f = *state;
    assert_int_equal(draw(f), STRL_OK);
    f->all.vertices[5].rgba[0] ^= 1;
    assert_refused(f, "other vertices under the same key");
}

static void a_change_outside_the_dirty_range_is_found(void **state)
{
    fixture *f = *state;
    assert_int_equal(draw(f), STRL_OK);
    uint16_t *corner = f->all.indices + 60, kept = corner[0];
    corner[0] = corner[1], corner[1] = corner[2], corner[2] = kept;
    f->all.items[0].state++, f->all.list.frame++;
    f->all.items[0].dirty_first = 61, f->all.items[0].dirty_count = 2;
    assert_refused(f, "outside its dirty range [61, +2)");
    assert_int_equal(draw(f), STRL_OK); /* what was refused is not held, so all of it is taken */
    memcpy(corner, (uint16_t[3]){corner[1], corner[2], corner[0]}, 3 * sizeof *corner);
    f->all.items[0].state++, f->all.list.frame++;
    f->all.items[0].dirty_first = 60, f->all.items[0].dirty_count = 3;
    assert_int_equal(draw(f), STRL_OK);
    assert_int_equal(f->stats.uploaded_indices, 3);
}

static void a_change_of_indices_without_a_change_of_state_is_found(void **state)
{
    fixture *f = *state;
    assert_int_equal(draw(f), STRL_OK);
    f->all.indices[60] = f->all.indices[61];
    f->all.list.frame++;
    assert_refused(f, "dirty range");
}

static void the_budget_holds_and_the_oldest_goes_first(void **state)
{
    fixture *f = *state;
    strl_draw_list list = f->all.list;
    const uint64_t budget = 4 << 20, node = PATCH_VERTICES * 20 + PATCH_INDICES * 2;
    for (uint64_t key = 0; key < 3 * budget / node; key++) {
        strl_draw_item item = f->all.items[0];
        item.key = key;
        list.items = &item, list.count = 1, list.frame++;
        assert_int_equal(strl_renderer_draw(f->renderer, &f->camera, &list, NULL, &f->stats, &f->err), STRL_OK);
        assert_true(f->stats.gpu_bytes <= budget);
        assert_int_equal(f->stats.evictions, key >= budget / node);
    }
}

static void an_empty_list_and_a_list_without_depth_differ(void **state)
{
    fixture *f = *state;
    f->all.list.near_distance = 0;
    assert_refused(f, "expected 0 < near <= far");
    f->all.list.count = 0;
    assert_int_equal(draw(f), STRL_OK);
    float depth[64 * 48];
    assert_int_equal(strl_renderer_read_depth(f->renderer, depth, NULL), STRL_OK);
    assert_true(isinf(depth[100]));
}

static void no_memory_is_an_error_and_not_a_crash(void **state)
{
    (void)state;
    patches all;
    patches_init(&all, (patches_desc){.side = 3});
    strl_camera camera = patches_camera(&all, 64, 48, 0.3);
    const strl_renderer_desc desc = {.backend = STRL_BACKEND_NULL, .width = 64, .height = 48};
    bool succeeded = false;
    for (uint64_t n = 1; !succeeded && n < 200; n++) {
        strl_renderer *renderer = NULL;
        strl__alloc_fail_after(n);
        strl_status status = strl_renderer_create(&desc, &renderer, NULL);
        if (status == STRL_OK)
            status = strl_renderer_draw(renderer, &camera, &all.list, NULL, NULL, NULL);
        strl__alloc_fail_after(0);
        assert_true(status == STRL_OK || status == STRL_ERR_MEMORY);
        succeeded = status == STRL_OK;
        if (!succeeded && renderer)
            assert_int_equal(strl_renderer_draw(renderer, &camera, &all.list, NULL, NULL, NULL), STRL_OK);
        strl_renderer_destroy(renderer);
    }
    assert_true(succeeded);
    patches_deinit(&all);
}

int main(void)
{
#define WITH(test) cmocka_unit_test_setup_teardown(test, setup, teardown)
    const struct CMUnitTest tests[] = {
        WITH(a_sound_list_is_counted),
        WITH(faces_are_culled_as_is_known),
        WITH(an_index_past_the_vertices_is_found),
        WITH(a_vertex_outside_the_box_is_found),
        WITH(a_broken_count_or_number_is_found),
        WITH(a_key_used_twice_is_found),
        WITH(other_vertices_under_the_same_key_are_found),
        WITH(a_change_outside_the_dirty_range_is_found),
        WITH(a_change_of_indices_without_a_change_of_state_is_found),
        WITH(the_budget_holds_and_the_oldest_goes_first),
        WITH(an_empty_list_and_a_list_without_depth_differ),
        cmocka_unit_test(no_memory_is_an_error_and_not_a_crash),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
