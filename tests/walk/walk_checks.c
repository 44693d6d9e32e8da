#include "walk/walk_checks.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "base/hash.h"
#include "base/memory.h"
#include "walk/grid_model.h"

#define SIDE (GRID_QUADS + 1)

/* ---- source */

static void note_offset(watched_source *self, uint64_t offset)
{
    for (unsigned i = 0; i < self->offset_count; i++)
        if (self->offsets[i] == offset) {
            self->repeats++;
            return;
        }
    if (self->offset_count < sizeof self->offsets / sizeof *self->offsets)
        self->offsets[self->offset_count++] = offset;
}

static strl_status watched_submit(strl_source *source, uint64_t token, uint64_t offset, size_t size, float urgency,
                                  strl_error *err)
{
    watched_source *self = (watched_source *)source;
    strl_status status = strl_source_submit(self->inner, token, offset, size, urgency, err);
    if (status == STRL_OK) {
        note_offset(self, offset);
        self->asked[token % 256] = (uint32_t)size;
        self->wanted_bytes += size;
    }
    if (self->wanted_bytes > self->most_wanted_bytes)
        self->most_wanted_bytes = self->wanted_bytes;
    return status;
}

/* One answer waits until the link has carried it. */
static bool link_brings(watched_source *self)
{
    if (!self->holds && !strl_source_poll(self->inner, &self->held))
        return false;
    self->holds = true;
    if (self->room_bytes && self->held.size > self->link_bytes)
        return false;
    self->link_bytes -= self->room_bytes ? self->held.size : 0;
    return true;
}

static bool watched_poll(strl_source *source, strl_source_result *result)
{
    watched_source *self = (watched_source *)source;
    if (next_random(&self->random) * 100 < self->hold_percent || !link_brings(self))
        return false;
    *result = self->held;
    self->holds = false;
    self->wanted_bytes -= self->asked[result->token % 256];
    self->came_bytes += result->size;
    return true;
}

static void watched_cancel(strl_source *source, uint64_t token)
{
    strl_source_cancel(((watched_source *)source)->inner, token);
}

static uint64_t watched_room(strl_source *source)
{
    const watched_source *self = (watched_source *)source;
    if (!self->room_bytes)
        return UINT64_MAX;
    return self->wanted_bytes < self->room_bytes ? self->room_bytes - self->wanted_bytes : 0;
}

static strl_status watched_read(strl_source *source, uint64_t offset, void *data, size_t size, strl_error *err)
{
    watched_source *self = (watched_source *)source;
    if (self->walking)
        fail_msg("a frame waits for a read");
    note_offset(self, offset);
    self->read_bytes += size;
    return strl_source_read(self->inner, offset, data, size, err);
}

static void watched_close(strl_source *source)
{
    watched_source *self = (watched_source *)source;
    if (self->holds)
        strl__free(self->held.data);
    strl_source_close(self->inner);
    strl__free(source);
}

watched_source *watched_source_open(strl_source *inner)
{
    static const strl_source_class klass = {.kind = "watched",
                                            .submit = watched_submit,
                                            .poll = watched_poll,
                                            .cancel = watched_cancel,
                                            .read = watched_read,
                                            .close = watched_close,
                                            .room = watched_room};
    watched_source *self = strl__alloc_zero(1, sizeof *self);
    assert_non_null(self);
    self->base = (strl_source){.klass = &klass, .bytes = inner->bytes};
    self->inner = inner;
    self->random = 1;
    return self;
}

strl_source *memory_source(const uint8_t *data, size_t size)
{
    strl_source *source;
    assert_int_equal(strl_source_open_memory(data, size, &source, NULL), STRL_OK);
    return source;
}

/* ---- cameras */

double next_random(uint64_t *state)
{
    *state += 0x9e3779b97f4a7c15u;
    return (double)(strl__mix64(*state) >> 11) * 0x1p-53;
}

static strl_camera camera_at(double x, double y, double z, double to_x, double to_y, double to_z)
{
    return (strl_camera){
        .eye = {x, y, z}, .target = {to_x, to_y, to_z}, .up = {0, 0, 1}, .fov_y_deg = 60, .width = 1280, .height = 720};
}

strl_camera random_camera(uint64_t *state)
{
    double at[6];
    for (unsigned i = 0; i < 6; i++)
        at[i] = next_random(state);
    double size = GRID_QUADS * GRID_SPACING * GRID_STEP, height = 1 + pow(at[2], 3) * 12 * size;
    return camera_at((at[0] * 1.6 - 0.3) * size, (at[1] * 1.6 - 0.3) * size, 6 + height, at[3] * size, at[4] * size,
                     at[5] * 4);
}

strl_camera flight_camera(unsigned at)
{
    double size = GRID_QUADS * GRID_SPACING * GRID_STEP, turn = at * 0.004;
    double x = size * (0.5 + 0.7 * cos(turn)), y = size * (0.5 + 0.5 * sin(1.7 * turn)),
           z = 8 + 25 * (1 + sin(2.3 * turn));
    return camera_at(x, y, z, size * (0.5 + 0.2 * sin(turn)), size * 0.5, 0);
}

/* ---- walking */

strl_walk *open_walk(strl_source *source, const strl_walk_desc *desc)
{
    strl_walk *walk;
    strl_error err = {0};
    if (strl_walk_open(source, desc, &walk, &err) != STRL_OK)
        fail_msg("%s", err.message);
    return walk;
}

strl_draw_list walk_frame(strl_walk *walk, const strl_camera *camera)
{
    strl_draw_list list;
    strl_error err = {0};
    if (strl_walk_frame(walk, camera, &list, &err) != STRL_OK)
        fail_msg("%s", err.message);
    return list;
}

strl_status walk_frame_without_memory(strl_walk *walk, const strl_camera *camera, uint64_t n, strl_draw_list *list)
{
    strl__alloc_fail_after(n);
    strl_status status = strl_walk_frame(walk, camera, list, NULL);
    strl_walk_pump(walk, 2000000);
    strl__alloc_fail_after(0);
    assert_true(status == STRL_OK || status == STRL_ERR_MEMORY);
    return status;
}

strl_draw_list settle(strl_walk *walk, const strl_camera *camera, unsigned max_frames)
{
    for (unsigned i = 0; i < max_frames; i++) {
        strl_draw_list list = walk_frame(walk, camera);
        if (strl_walk_settled(walk))
            return list;
        strl_walk_pump(walk, UINT64_MAX);
    }
    fail_msg("not settled after %u frames: %u missing, %u pending", max_frames,
             strl_walk_get_stats(walk)->missing_nodes, strl_walk_get_stats(walk)->requests_pending);
    return (strl_draw_list){0};
}

/* ---- checks */

typedef struct edge {
    uint64_t key; /* lower vertex << 32 | higher one, plus 1; 0 = free */
    int balance;  /* triangles that run upward less those that run downward */
} edge;

typedef struct edges {
    edge *slots;
    size_t size;
} edges;

static void add_edge(const edges *all, uint32_t from, uint32_t to)
{
    uint32_t low = from < to ? from : to, high = from < to ? to : from;
    uint64_t key = ((uint64_t)low << 32 | high) + 1;
    size_t slot = (size_t)strl__mix64(key) & (all->size - 1);
    while (all->slots[slot].key && all->slots[slot].key != key)
        slot = (slot + 1) & (all->size - 1);
    all->slots[slot].key = key;
    all->slots[slot].balance += from < to ? 1 : -1;
}

static bool on_one_side(uint32_t a, uint32_t b)
{
    uint32_t ax = a % SIDE, ay = a / SIDE, bx = b % SIDE, by = b / SIDE;
    return (ax == bx && (ax == 0 || ax == GRID_QUADS)) || (ay == by && (ay == 0 || ay == GRID_QUADS));
}

static uint32_t corner_vertex(const strl_draw_item *item, uint32_t k)
{
    assert_true(item->indices[k] < item->vertex_count);
    int64_t position[3];
    for (unsigned i = 0; i < 3; i++)
        position[i] = item->anchor[i] + item->vertices[item->indices[k]].position[i];
    uint32_t vertex = grid_vertex_at(position);
    assert_true(vertex != UINT32_MAX);
    return vertex;
}

/* Twice the area of the triangle seen from above, in quads. */
static int64_t add_triangle(const strl_draw_item *item, uint32_t first, edges *all)
{
    uint32_t v[3];
    for (unsigned k = 0; k < 3; k++)
        v[k] = corner_vertex(item, first + k);
    for (unsigned k = 0; k < 3; k++)
        add_edge(all, v[k], v[(k + 1) % 3]);
    int64_t x1 = (int64_t)(v[1] % SIDE) - v[0] % SIDE, y1 = (int64_t)(v[1] / SIDE) - v[0] / SIDE;
    int64_t x2 = (int64_t)(v[2] % SIDE) - v[0] % SIDE, y2 = (int64_t)(v[2] / SIDE) - v[0] / SIDE;
    return x1 * y2 - x2 * y1;
}

void check_cut_is_closed(const strl_draw_list *list, uint32_t placement)
{
    size_t corners = 0;
    int64_t area = 0;
    for (uint32_t i = 0; i < list->count; i++)
        corners += list->items[i].placement == placement ? list->items[i].draw_count : 0;
    edges all = {NULL, 64};
    while (all.size < 2 * corners)
        all.size *= 2;
    all.slots = strl__alloc_zero(all.size, sizeof *all.slots);
    assert_non_null(all.slots);
    for (uint32_t i = 0; i < list->count; i++)
        for (uint32_t k = 0; list->items[i].placement == placement && k < list->items[i].draw_count; k += 3)
            area += add_triangle(&list->items[i], list->items[i].draw_first + k, &all);
    uint32_t open = 0;
    for (size_t slot = 0; slot < all.size; slot++) {
        const edge *e = &all.slots[slot];
        open += e->balance != 0 && !on_one_side((uint32_t)((e->key - 1) >> 32), (uint32_t)(e->key - 1));
    }
    strl__free(all.slots);
    assert_int_equal(open, 0);
    assert_int_equal(area, 2 * GRID_QUADS * GRID_QUADS);
}

static const strl_draw_item *find_item(const strl_draw_list *list, uint32_t placement, uint32_t node)
{
    for (uint32_t i = 0; i < list->count; i++)
        if (list->items[i].placement == placement && list->items[i].node == node)
            return &list->items[i];
    return NULL;
}

void check_same_lists(const strl_draw_list *a, const strl_draw_list *b)
{
    assert_int_equal(a->count, b->count);
    for (uint32_t i = 0; i < a->count; i++) {
        const strl_draw_item *x = &a->items[i], *y = find_item(b, x->placement, x->node);
        assert_non_null(y);
        assert_int_equal(x->state, y->state);
        assert_int_equal(x->visible, y->visible);
        assert_int_equal(x->draw_count, y->draw_count);
        assert_memory_equal(x->indices + x->draw_first, y->indices + y->draw_first, x->draw_count * sizeof *x->indices);
    }
}

strl_draw_list copy_list(const strl_draw_list *list)
{
    strl_draw_item *items = strl__alloc(list->count, sizeof *items);
    assert_non_null(items);
    for (uint32_t i = 0; i < list->count; i++) {
        items[i] = list->items[i];
        uint16_t *indices = strl__alloc(items[i].index_count, sizeof *indices);
        assert_non_null(indices);
        memcpy(indices, items[i].indices, items[i].index_count * sizeof *indices);
        items[i].indices = indices;
    }
    strl_draw_list copy = *list;
    copy.items = items;
    return copy;
}

void free_list(strl_draw_list *list)
{
    for (uint32_t i = 0; i < list->count; i++)
        strl__free((void *)(uintptr_t)list->items[i].indices);
    strl__free((void *)(uintptr_t)list->items);
    *list = (strl_draw_list){0};
}

static void cross(const double a[3], const double b[3], double product[3])
{
    double length = 0;
    for (int k = 0; k < 3; k++)
        product[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
    for (int k = 0; k < 3; k++)
        length += product[k] * product[k];
    for (int k = 0; k < 3; k++)
        product[k] /= sqrt(length);
}

bool project_vertex(const strl_camera *camera, const strl_draw_item *item, const strl_vertex *vertex, double pixel[2],
                    double *depth)
{
    double forward[3], right[3], up[3], from[3], x = 0, y = 0;
    const double focal = camera->height / 2.0 / tan(camera->fov_y_deg * M_PI / 360);
    for (int k = 0; k < 3; k++)
        forward[k] = camera->target[k] - camera->eye[k];
    cross(forward, camera->up, right);
    cross(right, forward, up);
    cross(up, right, forward);
    for (int row = 0; row < 3; row++) {
        const double *m = item->transform + 4 * row;
        from[row] = m[3] - camera->eye[row];
        for (int k = 0; k < 3; k++)
            from[row] += m[k] * (item->origin[k] + item->step * (double)(item->anchor[k] + vertex->position[k]));
    }
    *depth = 0;
    for (int k = 0; k < 3; k++) {
        *depth += forward[k] * from[k];
        x += right[k] * from[k];
        y += up[k] * from[k];
    }
    pixel[0] = camera->width / 2.0 + focal * x / *depth;
    pixel[1] = camera->height / 2.0 - focal * y / *depth;
    return *depth > 0;
}
