/* The walk through a sample tree: what is drawn is whole and nothing of it twice, whatever the camera, the memory and
 * the source. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "base/hash.h"
#include "base/memory.h"
#include "build/sample_tree.h"
#include "walk/internal.h"
#include "walk/walk_checks.h"

#define TRIANGLES 100000u
#define CAMERAS 24u

static built_model model;
static uint8_t *bytes;
static size_t size;
static bool *drawn; /* [node_count] by a list that is looked at */

static double unit(uint64_t *state)
{
    return (double)(strl__mix64(++*state) >> 11) * 0x1p-53;
}

/* Small triangles in a cube of side 1, some large ones. */
static int create_model(void **state)
{
    if (built_setup(state) != 0)
        return -1;
    mesh_file mesh = {0};
    uint64_t random = 21;
    for (uint32_t i = 0; i < TRIANGLES; i++) {
        double at[3], edge = i % 50 ? 0.01 : 0.2;
        uint32_t corner[3];
        for (int k = 0; k < 3; k++)
            at[k] = (1 - edge) * unit(&random);
        for (int c = 0; c < 3; c++) {
            double p[3];
            for (int k = 0; k < 3; k++)
                p[k] = at[k] + edge * unit(&random);
            corner[c] = mesh_file_add_vertex(&mesh, p[0], p[1], p[2]);
        }
        mesh_file_add_face(&mesh, corner[0], corner[1], corner[2]);
    }
    mesh_file_write_ply(&mesh, built_path("walked.ply"));
    mesh_file_free(&mesh);
    sample_tree_build("walked.ply", "walked.stroll", (strl_build_desc){0});
    built_open(&model, built_path("walked.stroll"));
    bytes = built_read_file(built_path("walked.stroll"), &size);
    drawn = calloc(model.tree.node_count, sizeof *drawn);
    assert_non_null(drawn);
    assert_true(model.tree.node_count > 8);
    return 0;
}

static int destroy_model(void **state)
{
    built_close(&model);
    free(bytes);
    free(drawn);
    return built_teardown(state);
}

static strl_camera camera_at(double x, double y, double z)
{
    return (strl_camera){
        .eye = {x, y, z}, .target = {0.5, 0.5, 0.5}, .up = {0, 0, 1}, .fov_y_deg = 60, .width = 800, .height = 600};
}

/* Round the model, now and then inside it. */
static strl_camera any_camera(uint64_t *state)
{
    strl_camera camera = camera_at(0, 0, 0);
    double reach = unit(state) < 0.3 ? 0.4 : 3;
    for (int k = 0; k < 3; k++) {
        camera.eye[k] = 0.5 + reach * (2 * unit(state) - 1);
        camera.target[k] = unit(state);
    }
    return camera;
}

/* ---- a draw list */

typedef struct listed {
    uint64_t triangles, splats;
    uint32_t bricks, whole; /* whole: in their finest state */
} listed;

static void look_at_splats(const strl_draw_item *item, listed *found)
{
    assert_true(item->point_px >= 1 && isfinite(item->point_px));
    for (uint32_t i = 0; i < item->draw_count; i++) {
        assert_true(item->indices[i] < item->vertex_count);
        const strl_vertex *vertex = &item->vertices[item->indices[i]];
        for (int k = 0; k < 3; k++) {
            int64_t at = item->anchor[k] + vertex->position[k];
            assert_true(at >= model.tree.box_min[k] && at <= model.tree.box_max[k]);
        }
        for (int k = 0; k < 3; k++)
            assert_int_equal(vertex->rgba[k], 255); /* of white triangles */
        assert_true(vertex->normal[1] <= 1023 && vertex->normal[0] >> STRL_SPREAD_SHIFT <= STRL_SPREAD_MOST);
    }
    found->splats += item->draw_count;
}

static void look_at_brick(const strl_draw_item *item, listed *found)
{
    assert_true(item->node < model.tree.node_count);
    assert_false(drawn[item->node]); /* once */
    drawn[item->node] = true;
    found->bricks++;
    const strl_pm *mesh = &model.mesh[item->node];
    assert_true(item->draw_count <= 3 * mesh->triangle_count);
    assert_true(item->vertex_count <= mesh->vertex_count); /* fewer of what is far */
    found->whole += item->draw_count == 3 * mesh->triangle_count;
    for (uint32_t i = 0; i < item->draw_count; i++)
        assert_true(item->indices[i] < item->vertex_count);
    if (item->visible)
        found->triangles += item->draw_count / 3;
}

/* Bricks add up: what is drawn is drawn with all that is above it, and what is above is open. */
static listed look_at_list(const strl_draw_list *list, const strl_walk_stats *stats)
{
    listed found = {0};
    memset(drawn, 0, model.tree.node_count * sizeof *drawn);
    for (uint32_t i = 0; i < list->count; i++)
        if (list->items[i].point_px > 0)
            look_at_splats(&list->items[i], &found);
        else
            look_at_brick(&list->items[i], &found);
    assert_true(found.bricks > 0 && drawn[0]);
    for (uint32_t id = 1; id < model.tree.node_count; id++)
        assert_true(!drawn[id] || drawn[model.node[id].parent]);
    for (uint32_t i = 0; i < list->count; i++) {
        const strl_draw_item *item = &list->items[i];
        if (item->point_px > 0 || model.node[item->node].child_count == 0 || !drawn[model.node[item->node].first_child])
            continue;
        if (item->draw_count != 3 * model.mesh[item->node].triangle_count)
            fail_msg(
                "brick %u is drawn with what is below it, and with %u of its %u triangles: its cells of %g are %g pixels of %g; record %g visible %d settled %d",
                item->node, item->draw_count / 3, model.mesh[item->node].triangle_count, (double)item->error,
                (double)item->error_px, stats->allowed_error_px, model.node[item->node].geometric_max * model.tree.step,
                item->visible, stats->missing_nodes);
    }
    assert_int_equal(found.triangles, stats->triangles);
    assert_int_equal(found.splats, stats->splats);
    return found;
}

static strl_walk *open_model(strl_walk_desc desc)
{
    return open_walk(memory_source(bytes, size), &desc);
}

static listed settle_and_look(strl_walk *walk, const strl_camera *camera)
{
    strl_draw_list list = settle(walk, camera, 2000);
    const strl_walk_stats *stats = strl_walk_get_stats(walk);
    assert_int_equal(stats->missing_nodes, 0);
    assert_int_equal(stats->faults, 0);
    return look_at_list(&list, stats);
}

/* ---- tests */

static sample_tree_triangle *list_triangles(const strl_draw_list *list, uint64_t *count)
{
    sample_tree_triangle *triangle = malloc((model.tree.triangle_count + 1) * sizeof *triangle);
    assert_non_null(triangle);
    *count = 0;
    for (uint32_t i = 0; i < list->count; i++) {
        const strl_draw_item *item = &list->items[i];
        assert_false(item->point_px > 0);
        for (uint32_t t = 0; t < item->draw_count / 3; t++, ++*count) {
            assert_true(*count < model.tree.triangle_count);
            for (int c = 0; c < 3; c++) {
                const strl_vertex *vertex = &item->vertices[item->indices[3 * t + (uint32_t)c]];
                for (int k = 0; k < 3; k++)
                    triangle[*count][c][k] = item->anchor[k] + vertex->position[k];
                triangle[*count][c][3] = UINT32_MAX;
            }
        }
    }
    sample_tree_sort(triangle, *count);
    return triangle;
}

static void as_the_error_goes_to_nothing_all_triangles_are_drawn(void **state)
{
    (void)state;
    strl_walk *walk = open_model((strl_walk_desc){.error_px = 1e-9});
    strl_camera camera = camera_at(0.5, -4, 0.6);
    settle_and_look(walk, &camera);
    strl_draw_list list = walk_frame(walk, &camera);
    uint64_t count, wanted;
    sample_tree_triangle *found = list_triangles(&list, &count),
                         *stored = sample_tree_triangles("walked.stroll", &wanted);
    assert_int_equal(count, wanted);
    assert_memory_equal(found, stored, count * sizeof *found);
    assert_int_equal(strl_walk_get_stats(walk)->splats, 0);
    free(found);
    free(stored);
    strl_walk_close(walk);
}

static void a_larger_error_draws_less_and_from_afar_little(void **state)
{
    (void)state;
    const double errors[] = {0.25, 1, 2, 4, 16, 64};
    uint64_t before = UINT64_MAX;
    strl_camera camera = camera_at(0.5, -2, 0.6);
    for (size_t i = 0; i < sizeof errors / sizeof *errors; i++) {
        strl_walk *walk = open_model((strl_walk_desc){.error_px = errors[i]});
        listed found = settle_and_look(walk, &camera);
        assert_true(found.triangles <= before);
        assert_true(strl_walk_get_stats(walk)->allowed_error_px == errors[i]);
        before = found.triangles;
        if (errors[i] == 1) {
            strl_camera far_away = camera_at(0.5, -2000, 0.6); /* less than a pixel */
            assert_true(settle_and_look(walk, &far_away).triangles <= model.tree.root_triangles);
        }
        strl_walk_close(walk);
    }
    assert_true(before < model.tree.triangle_count / 4);
}

/* Splats are of a quarter, a half, three quarters or all of the size that is allowed, and of at least a pixel. */
static void splats_are_as_large_as_the_error(void **state)
{
    (void)state;
    const double errors[] = {0.3, 1, 3, 5};
    strl_camera camera = camera_at(0.5, -30, 0.6);
    for (size_t i = 0; i < sizeof errors / sizeof *errors; i++) {
        strl_walk *walk = open_model((strl_walk_desc){.error_px = errors[i]});
        settle_and_look(walk, &camera);
        strl_draw_list list = walk_frame(walk, &camera);
        uint64_t splats = 0;
        for (uint32_t k = 0; k < list.count; k++)
            if (list.items[k].point_px > 0) {
                bool is_size = false;
                for (int part = errors[i] > 1 ? 1 : 4; part <= 4; part++)
                    is_size = is_size || fabs((double)list.items[k].point_px - fmax(errors[i] * part / 4, 1)) < 1e-5;
                assert_true(is_size);
                splats += list.items[k].draw_count;
            }
        assert_true(i < 2 || splats > 0);
        strl_walk_close(walk);
    }
}

/* The least side of the square that covers a cell, sqrt(sqrt(3)) sides: what is drawn as a splat may not cover more
 * than the error, seen from the nearest point of its brick's box at worst. Found by distances alone. */
static void what_is_near_is_open(void **state)
{
    (void)state;
    uint64_t random = 4;
    strl_walk *walk = open_model((strl_walk_desc){.error_px = 32});
    uint32_t looked_at = 0;
    const double pixels = 600 / 2 / tan(30 * 3.14159265358979 / 180);
    for (uint32_t i = 0; i < CAMERAS; i++) {
        strl_camera camera = any_camera(&random);
        settle_and_look(walk, &camera);
        strl_draw_list list = walk_frame(walk, &camera);
        for (uint32_t k = 0; k < list.count; k++) {
            const strl_draw_item *item = &list.items[k];
            if (item->point_px > 0 || !item->visible || item->error_px == 0) /* 0: nothing of its box is in sight */
                continue;
            if (item->draw_count == 3 * model.mesh[item->node].triangle_count)
                continue;
            looked_at++;
            double far = 0; /* of the farthest corner: nothing of the brick is as small as it is there */
            for (int c = 0; c < 8; c++) {
                double sum = 0;
                for (int axis = 0; axis < 3; axis++) {
                    const strl_node *node = &model.node[item->node];
                    double at = model.tree.origin[axis] +
                                model.tree.step * (double)(c >> axis & 1 ? node->box_max[axis] : node->box_min[axis]);
                    sum += (at - camera.eye[axis]) * (at - camera.eye[axis]);
                }
                far = fmax(far, sqrt(sum));
            }
            if ((double)item->error * pixels / far > 32.001)
                fail_msg(
                    "brick %u of %u children in state %u with %u of %u triangles: its cells of %g are %.2f pixels, or as it says %.2f",
                    item->node, model.node[item->node].child_count, item->state, item->draw_count / 3,
                    model.mesh[item->node].triangle_count, (double)item->error, (double)item->error * pixels / far,
                    (double)item->error_px);
        }
    }
    assert_true(looked_at > CAMERAS);
    strl_walk_close(walk);
}

static void settled_lists_are_the_same_from_wherever_one_comes(void **state)
{
    (void)state;
    uint64_t random = 9;
    strl_walk *walk = open_model((strl_walk_desc){.error_px = 2});
    for (uint32_t i = 0; i < CAMERAS; i++) {
        strl_camera camera = any_camera(&random);
        listed found = settle_and_look(walk, &camera);
        strl_walk *fresh = open_model((strl_walk_desc){.error_px = 2});
        listed expected = settle_and_look(fresh, &camera);
        assert_int_equal(found.triangles, expected.triangles);
        assert_int_equal(found.splats, expected.splats);
        assert_int_equal(found.bricks, expected.bricks);
        strl_walk_close(fresh);
    }
    strl_walk_close(walk);
}

static void little_memory_coarsens_and_settles(void **state)
{
    (void)state;
    uint64_t random = 5;
    strl_walk *ample = open_model((strl_walk_desc){.error_px = 0.25});
    strl_camera camera = camera_at(0.5, -1.5, 0.6);
    settle_and_look(ample, &camera);
    uint64_t needed = strl_walk_get_stats(ample)->resident_bytes;
    strl_walk_close(ample);
    for (uint64_t part = 2; part <= 8; part *= 2) {
        strl_walk *walk = open_model((strl_walk_desc){.error_px = 0.25, .memory_bytes = needed / part});
        const strl_walk_stats *stats = strl_walk_get_stats(walk);
        settle_and_look(walk, &camera);
        assert_true(stats->allowed_error_px > 0.25);
        assert_true(stats->resident_bytes <= needed / part);
        for (uint32_t i = 0; i < CAMERAS; i++) {
            strl_camera other = any_camera(&random);
            for (unsigned frame = 0; frame < 5; frame++) {
                strl_draw_list list = walk_frame(walk, &other);
                look_at_list(&list, stats);
                assert_true(stats->resident_bytes <= needed / part);
                strl_walk_pump(walk, UINT64_MAX);
            }
            settle_and_look(walk, &other);
            assert_true(stats->resident_bytes <= needed / part);
        }
        strl_walk_close(walk);
    }
}

/* Many nodes share a page, and a level is wanted when the one above it is there. */
static void no_page_is_read_twice(void **state)
{
    (void)state;
    watched_source *source = watched_source_open(memory_source(bytes, size));
    strl_walk *walk = open_walk(&source->base, &(strl_walk_desc){.error_px = 2});
    source->walking = true;
    const strl_camera cameras[] = {camera_at(0.5, -1.5, 0.5), camera_at(0.5, -0.2, 0.5), camera_at(0.4, 0.3, 0.5)};
    for (unsigned i = 0; i < 3; i++)
        settle(walk, &cameras[i], 1000);
    assert_true(source->offset_count > 5 && source->came_bytes > size / 2);
    assert_int_equal(source->repeats, 0);
    strl_walk_close(walk);
}

static void a_late_source_shows_what_is_there(void **state)
{
    (void)state;
    uint64_t random = 6;
    watched_source *source = watched_source_open(memory_source(bytes, size));
    strl_walk *walk =
        open_walk(&source->base, &(strl_walk_desc){.error_px = 0.5, .requests_in_flight = 2, .labels = true});
    const strl_walk_stats *stats = strl_walk_get_stats(walk);
    uint32_t late = 0;
    source->walking = true;
    source->hold_percent = 80;
    for (uint32_t i = 0; i < CAMERAS; i++) {
        strl_camera camera = any_camera(&random);
        for (unsigned frame = 0; frame < 8; frame++) {
            strl_draw_list list = walk_frame(walk, &camera);
            look_at_list(&list, stats);
            late += stats->missing_nodes > 0;
            assert_true(stats->missing_nodes > 0 || stats->requests_pending > 0 || strl_walk_settled(walk));
            strl_walk_pump(walk, 1);
        }
    }
    assert_true(late > CAMERAS / 2);
    source->hold_percent = 0;
    strl_camera camera = camera_at(0.5, -2, 0.6);
    settle_and_look(walk, &camera);
    strl_walk_close(walk);
}

static void without_memory_calls_fail_and_the_walk_goes_on(void **state)
{
    (void)state;
    strl_camera camera = camera_at(0.5, -2, 0.6);
    bool opened = false;
    for (uint64_t n = 1; !opened; n++) {
        strl_source *source = memory_source(bytes, size);
        strl_walk *walk;
        strl_error err = {0};
        strl__alloc_fail_after(n);
        strl_status status = strl_walk_open(source, NULL, &walk, &err);
        strl__alloc_fail_after(0);
        opened = status == STRL_OK;
        assert_true(opened || (status == STRL_ERR_MEMORY && walk == NULL && err.message[0]));
        strl_walk_close(walk);
    }
    for (uint64_t n = 1; n < 400; n += 1 + n / 8) {
        strl_walk *walk = open_model((strl_walk_desc){.error_px = 4});
        for (unsigned i = 0; i < 6; i++) {
            strl_draw_list list;
            walk_frame_without_memory(walk, &camera, n, &list);
        }
        for (unsigned i = 0; i < 200 && (!strl_walk_settled(walk) || strl_walk_get_stats(walk)->missing_nodes); i++) {
            walk_frame(walk, &camera);
            strl_walk_pump(walk, UINT64_MAX);
        }
        strl_draw_list list = walk_frame(walk, &camera);
        look_at_list(&list, strl_walk_get_stats(walk));
        assert_int_equal(strl_walk_get_stats(walk)->missing_nodes, 0);
        strl_walk_close(walk);
    }
}

/* ---- less of a brick */

static void check_same_meshes(const strl__mesh *a, const strl__mesh *b)
{
    assert_int_equal(a->vertex_count, b->vertex_count);
    assert_int_equal(a->triangle_count, b->triangle_count);
    assert_int_equal(a->held, b->held);
    assert_int_equal(a->spare_bytes, b->spare_bytes);
    assert_memory_equal(a->vertices, b->vertices, a->vertex_count * sizeof *a->vertices);
    assert_memory_equal(a->labels, b->labels, a->vertex_count * sizeof *a->labels);
    assert_memory_equal(a->indices, b->indices, 3 * (size_t)a->triangle_count * sizeof *a->indices);
    assert_memory_equal(a->errors, b->errors, (a->step_count + 1) * sizeof *a->errors);
    assert_memory_equal(a->triangle_end, b->triangle_end, (a->step_count + 1) * sizeof *a->triangle_end);
    assert_memory_equal(a->vertex_end, b->vertex_end, (a->step_count + 1) * sizeof *a->vertex_end);
    assert_memory_equal(a->splat_end, b->splat_end, a->step_count * sizeof *a->splat_end);
    for (uint32_t i = 0; i < a->splat_end[a->step_count - 1]; i++) {
        const strl_splat *s = &a->splats[i], *t = &b->splats[i];
        assert_memory_equal(s->centre, t->centre, sizeof s->centre);
        assert_memory_equal(s->normal, t->normal, sizeof s->normal);
        assert_true(s->side == t->side && s->coverage == t->coverage && s->parallel == t->parallel &&
                    s->rgba == t->rgba);
    }
}

static strl__mesh make_brick(const strl_node *record, float closed_size)
{
    strl__mesh mesh;
    strl_error err = {0};
    if (strl__mesh_create(record, bytes + record->page.offset, record->page.bytes, NULL, true, false, closed_size,
                          &mesh, &err) != STRL_OK)
        fail_msg("%s", err.message);
    return mesh;
}

/* Trimmed, a brick is the one that is made so, and what it gives back is what was told. */
static void a_trimmed_brick_is_one_made_so(void **state)
{
    (void)state;
    unsigned smaller = 0;
    for (uint32_t id = 1; id < model.tree.node_count; id++) {
        const strl_node *record = &model.node[id];
        if (record->child_count > 0) /* taken as it is */
            continue;
        for (double halvings = 0; halvings < 8; halvings += 0.5) {
            float closed_size = (float)(record->geometric_max * exp2(-halvings));
            strl__mesh whole = make_brick(record, 0), part = make_brick(record, closed_size);
            uint64_t excess = strl__brick_excess(&whole, closed_size), spare = whole.spare_bytes;
            assert_true((excess > 0) == (part.held < part.step_count));
            if (excess > 0) {
                whole.state = part.held;
                assert_true(strl__brick_trim(&whole, closed_size));
                assert_int_equal(whole.spare_bytes, spare + excess);
                assert_int_equal(strl__brick_excess(&whole, closed_size), 0);
                smaller++;
            }
            check_same_meshes(&whole, &part);
            strl__mesh_deinit(&whole);
            strl__mesh_deinit(&part);
        }
        strl__mesh whole = make_brick(record, 0), before = whole;
        whole.state = whole.step_count;
        if (strl__brick_excess(&whole, record->geometric_max) > 0) /* it is drawn in a finer state */
            assert_true(!strl__brick_trim(&whole, record->geometric_max) && whole.vertices == before.vertices);
        strl__mesh_deinit(&whole);
    }
    assert_true(smaller > 20);
}

/* What a renderer holds of a node. */
typedef struct shadow {
    uint64_t key;
    bool drawn;            /* in the last frame */
    uint32_t vertex_count; /* of which a key tells */
    uint16_t *indices;
    strl_vertex *vertices;
} shadow;

static void upload(shadow *self, const strl_draw_item *item)
{
    bool known = self->key == item->key && self->drawn;
    uint32_t first = known ? item->dirty_first : 0, count = known ? item->dirty_count : item->index_count;
    assert_true(first + count <= item->index_count);
    if (self->key != item->key) {
        self->indices = realloc(self->indices, 3 * (size_t)STRL_PM_MAX_TRIANGLES * sizeof *self->indices);
        self->vertices = realloc(self->vertices, (size_t)STRL_PM_MAX_VERTICES * sizeof *self->vertices);
        memcpy(self->vertices, item->vertices, item->vertex_count * sizeof *item->vertices);
    }
    memcpy(self->indices + first, item->indices + first, count * sizeof *item->indices);
    assert_true(self->key != item->key || self->vertex_count == item->vertex_count);
    self->key = item->key;
    self->vertex_count = item->vertex_count;
    assert_memory_equal(self->indices, item->indices, item->index_count * sizeof *item->indices);
    assert_memory_equal(self->vertices, item->vertices, item->vertex_count * sizeof *item->vertices);
}

/* Bricks come, grow and shrink: who uploads what is said to be new draws what the list says. */
static void what_bricks_give_back_is_told(void **state)
{
    (void)state;
    shadow *shadows = calloc(model.tree.node_count, sizeof *shadows);
    bool *now = calloc(model.tree.node_count, sizeof *now);
    strl_walk *walk =
        open_walk(memory_source(bytes, size), &(strl_walk_desc){.error_px = 0.5, .memory_bytes = (uint64_t)3 << 20});
    unsigned gave_back = 0;
    assert_true(shadows && now);
    for (unsigned at = 0; at < 240; at++) {
        double distance = 6 - 5.2 * fabs(sin(at * 0.08));
        strl_camera camera = camera_at(0.5 + distance, 0.5 + 0.01 * at, 0.4);
        strl_draw_list list = walk_frame(walk, &camera);
        memset(now, 0, model.tree.node_count * sizeof *now);
        for (uint32_t i = 0; i < list.count; i++) {
            const strl_draw_item *item = &list.items[i];
            if (!item->visible || item->point_px > 0)
                continue;
            shadow *self = &shadows[item->node];
            gave_back += self->drawn && self->key && self->key != item->key;
            upload(self, item);
            now[item->node] = true;
        }
        for (uint32_t node = 0; node < model.tree.node_count; node++)
            shadows[node].drawn = now[node];
        strl_walk_pump(walk, UINT64_MAX);
    }
    assert_true(gave_back > 10);
    for (uint32_t node = 0; node < model.tree.node_count; node++) {
        free(shadows[node].indices);
        free(shadows[node].vertices);
    }
    free(shadows);
    free(now);
    strl_walk_close(walk);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(as_the_error_goes_to_nothing_all_triangles_are_drawn),
        cmocka_unit_test(a_larger_error_draws_less_and_from_afar_little),
        cmocka_unit_test(splats_are_as_large_as_the_error),
        cmocka_unit_test(what_is_near_is_open),
        cmocka_unit_test(settled_lists_are_the_same_from_wherever_one_comes),
        cmocka_unit_test(little_memory_coarsens_and_settles),
        cmocka_unit_test(no_page_is_read_twice),
        cmocka_unit_test(a_late_source_shows_what_is_there),
        cmocka_unit_test(without_memory_calls_fail_and_the_walk_goes_on),
        cmocka_unit_test(a_trimmed_brick_is_one_made_so),
        cmocka_unit_test(what_bricks_give_back_is_told),
    };
    return cmocka_run_group_tests(tests, create_model, destroy_model);
}
