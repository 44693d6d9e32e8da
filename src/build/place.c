/* Placements into the container: those that are near each other lie together, so that what bounds a run of them is
 * small. Where some are large beside the rest (the ground under a forest), these come first of their window: who reads
 * over a slow link sees them with the first page. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"
#include "build/model.h"
#include "container/cut.h"
#include "container/treelet.h"

/* As many as fit are put into order at once; where there are more, one such window follows the other. */
#define SHARES_OF_MEMORY 8u
#define LEAST_AT_ONCE 4096u
#define LEAST_BOX 16u     /* what a walk has boxes over */
#define LARGE_SHARE 0.125 /* of the extent of all centres */

/* Where a placement is. */
typedef struct spot {
    double centre[3]; /* of the tree's box, in the world */
    double size;      /* of that box, its longest side, in the world */
    uint64_t index;   /* in the window, as the inputs have it, so that equal places have an order */
} spot;

typedef struct placing {
    strl_build_context *context;
    strl_placement *items; /* [capacity] */
    spot *spots;           /* [capacity] */
    size_t count, capacity;
    uint32_t part_base; /* of the parts of the input at hand */
} placing;

/* ---- order */

static bool comes_before(const spot *a, const spot *b, unsigned axis)
{
    return a->centre[axis] != b->centre[axis] ? a->centre[axis] < b->centre[axis] : a->index < b->index;
}

static void swap(spot *a, spot *b)
{
    spot other = *a;
    *a = *b;
    *b = other;
}

/* Puts the first `left` of the items along an axis before the others (Hoare 1961, FIND). */
static void part(spot *items, size_t count, size_t left, unsigned axis)
{
    size_t low = 0, high = count - 1;
    while (low < high) {
        /* no order of the input is a bad one */
        const spot pivot = items[low + strl__mix64(low ^ high << 32) % (high - low + 1)];
        size_t i = low, j = high;
        while (i <= j) {
            while (comes_before(&items[i], &pivot, axis))
                i++;
            while (comes_before(&pivot, &items[j], axis))
                j--;
            if (i > j)
                break;
            swap(&items[i++], &items[j]);
            if (j-- == 0)
                break;
        }
        if (j != SIZE_MAX && left <= j)
            high = j;
        else if (left >= i)
            low = i;
        else
            return;
    }
}

static unsigned longest_axis(const spot *items, size_t count, double *length)
{
    double extent[3];
    for (unsigned k = 0; k < 3; k++) {
        double low = items[0].centre[k], high = low;
        for (size_t i = 1; i < count; i++) {
            low = fmin(low, items[i].centre[k]);
            high = fmax(high, items[i].centre[k]);
        }
        extent[k] = high - low;
    }
    unsigned axis = extent[0] >= extent[1] && extent[0] >= extent[2] ? 0 : extent[1] >= extent[2] ? 1 : 2;
    *length = extent[axis];
    return axis;
}

static int by_index(const void *left, const void *right)
{
    const spot *a = left, *b = right;
    return a->index < b->index ? -1 : a->index > b->index;
}

/* Halves them across their longest side, again and again; the first half is a power of two. So every 16, every 512 and
 * so on that begin at a multiple of their number are what one box of a tree of boxes holds. */
static void put_in_order(spot *items, size_t count)
{
    while (count > LEAST_BOX) {
        size_t left = LEAST_BOX;
        while (2 * left < count)
            left *= 2;
        double length;
        part(items, count, left, longest_axis(items, count, &length));
        put_in_order(items, left);
        items += left;
        count -= left;
    }
    if (count > 1)
        qsort(items, count, sizeof *items, by_index);
}

static int by_size(const void *left, const void *right)
{
    const spot *a = left, *b = right;
    return a->size != b->size ? (a->size > b->size ? -1 : 1) : by_index(left, right);
}

/* The largest ones as the first box, where one is large; then what fills its run, and the others run by run. */
static void put_large_first(spot *items, size_t count)
{
    double length, largest = 0;
    size_t run = STRL_RUN_PLACEMENTS - LEAST_BOX;
    unsigned axis = longest_axis(items, count, &length);
    for (size_t i = 0; i < count; i++)
        largest = fmax(largest, items[i].size);
    if (count <= STRL_RUN_PLACEMENTS || !(largest > LARGE_SHARE * length)) {
        put_in_order(items, count);
        return;
    }
    qsort(items, count, sizeof *items, by_size);
    items += LEAST_BOX;
    count -= LEAST_BOX;
    part(items, count, run, axis);
    put_in_order(items, run);
    put_in_order(items + run, count - run);
}

static strl_status write_window(placing *p, strl_error *err)
{
    strl_status status = STRL_OK;
    put_large_first(p->spots, p->count);
    for (size_t i = 0; i < p->count && !status; i++)
        status = strl_container_writer_add_placement(p->context->model->writer, &p->items[p->spots[i].index], err);
    p->count = 0;
    return status ? status : strl__build_report(p->context, 0, 0, err);
}

static strl_status add(placing *p, uint32_t tree, uint32_t own_part, const double transform[12], strl_error *err)
{
    strl_build_context *context = p->context;
    const strl_model_tree *facts = &context->model->trees[tree];
    if (facts->triangles == 0)
        return STRL_OK; /* of a tree without a triangle there is nothing to see */
    strl_placement *item = &p->items[p->count];
    spot *at = &p->spots[p->count];
    item->tree = tree;
    item->own_part = own_part;
    memcpy(item->transform, transform, sizeof item->transform);
    at->index = p->count++;
    for (unsigned k = 0; k < 3; k++) {
        double centre = transform[4 * k] * facts->centre[0] + transform[4 * k + 1] * facts->centre[1] +
                        transform[4 * k + 2] * facts->centre[2] + transform[4 * k + 3];
        at->centre[k] = isfinite(centre) ? centre : 0;
    }
    at->size = facts->size * strl_transform_stretch(transform);
    at->size = isfinite(at->size) ? at->size : 0;
    context->result->placements++;
    if (__builtin_add_overflow(context->result->triangles_placed, facts->triangles, &context->result->triangles_placed))
        context->result->triangles_placed = UINT64_MAX;
    return p->count == p->capacity ? write_window(p, err) : STRL_OK;
}

static strl_status add_of_input(placing *p, uint32_t input, strl_error *err)
{
    strl_build_model *model = p->context->model;
    strl_reader_placement placement;
    bool found = true;
    strl_status status = strl_reader_begin_placements(model->readers[input], err);
    while (!status && found) {
        status = strl_reader_next_placement(model->readers[input], &placement, &found, err);
        if (!status && found)
            status = add(p, model->first_tree[input] + placement.piece - 1, p->part_base + placement.part + 1,
                         placement.transform, err);
    }
    return status;
}

static uint64_t count_placements(const strl_build_model *model)
{
    uint64_t count = 0;
    for (uint32_t i = 0; i < model->tree_count; i++)
        count += model->trees[i].placements;
    return count;
}

static strl_status place_trees(strl_build_context *context, strl_error *err)
{
    static const double as_it_is[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    strl_build_model *model = context->model;
    placing p = {.context = context};
    uint64_t fit = context->memory_bytes / SHARES_OF_MEMORY / (sizeof *p.items + sizeof *p.spots),
             all = count_placements(model);
    p.capacity = (size_t)(all < LEAST_AT_ONCE ? LEAST_AT_ONCE : all < fit ? all : fit / LEAST_AT_ONCE * LEAST_AT_ONCE);
    p.capacity = p.capacity < LEAST_AT_ONCE ? LEAST_AT_ONCE : p.capacity;
    p.items = strl__alloc(p.capacity, sizeof *p.items);
    p.spots = strl__alloc(p.capacity, sizeof *p.spots);
    strl_status status =
        p.items && p.spots ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu placements", p.capacity);
    if (!status && model->trees[0].input == STRL_EVERY_INPUT)
        status = add(&p, 0, 0, as_it_is, err);
    for (uint32_t i = 0; i < context->desc->input_count && !status; i++) {
        if (strl_reader_piece_count(model->readers[i]) > 1)
            status = add_of_input(&p, i, err);
        p.part_base += strl_reader_part_count(model->readers[i]);
    }
    if (!status && p.count)
        status = write_window(&p, err);
    strl__free(p.items);
    strl__free(p.spots);
    return status;
}

strl_status strl__model_place(strl_build_context *context, strl_error *err)
{
    strl_build_result *result = context->result;
    if (!strl__model_is_plain(context))
        return place_trees(context, err);
    const strl_placement identity = {.tree = 0, .transform = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};
    result->placements = 1;
    result->triangles_placed = result->triangles_leaf;
    return strl_container_writer_add_placement(context->model->writer, &identity, err);
}
