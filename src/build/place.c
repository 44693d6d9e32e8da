/* Placements into the container: those that are near each other lie together, so that what bounds a run of them is small. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "build/model.h"

/* As many as fit are put into order at once; where there are more, one such window follows the other. */
#define SHARES_OF_MEMORY 8u
#define LEAST_AT_ONCE 4096u
#define CURVE_BITS 21u

typedef struct placed {
    strl_placement placement;
    double centre[3]; /* of the tree's box, in the world */
    uint64_t key;     /* on the curve */
    uint64_t index;   /* in the order of the inputs, so that equal keys have an order */
} placed;

typedef struct placing {
    strl_build_context *context;
    placed *items; /* [capacity] */
    size_t count, capacity;
    uint64_t total; /* of all windows */
    uint32_t part_base; /* of the parts of the input at hand */
} placing;

static uint64_t spread(uint64_t bits)
{
    uint64_t key = 0;
    for (unsigned i = 0; i < CURVE_BITS; i++)
        key |= (bits >> i & 1) << 3 * i;
    return key;
}

static void set_keys(placing *p)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY}, extent = 0;
    for (size_t i = 0; i < p->count; i++)
        for (unsigned k = 0; k < 3; k++) {
            low[k] = fmin(low[k], p->items[i].centre[k]);
            high[k] = fmax(high[k], p->items[i].centre[k]);
        }
    for (unsigned k = 0; k < 3; k++)
        extent = fmax(extent, high[k] - low[k]);
    for (size_t i = 0; i < p->count; i++) {
        p->items[i].key = 0;
        for (unsigned k = 0; k < 3; k++) {
            double at = extent > 0 && isfinite(extent) ? (p->items[i].centre[k] - low[k]) / extent : 0;
            p->items[i].key |= spread((uint64_t)(fmin(at, 1) * (double)((1u << CURVE_BITS) - 1))) << k;
        }
    }
}

static int by_key(const void *left, const void *right)
{
    const placed *a = left, *b = right;
    if (a->key != b->key)
        return a->key < b->key ? -1 : 1;
    return a->index < b->index ? -1 : a->index > b->index;
}

static strl_status write_window(placing *p, strl_error *err)
{
    strl_status status = STRL_OK;
    set_keys(p);
    if (p->count > 1)
        qsort(p->items, p->count, sizeof *p->items, by_key);
    for (size_t i = 0; i < p->count && !status; i++)
        status = strl_container_writer_add_placement(p->context->model->writer, &p->items[i].placement, err);
    p->count = 0;
    return status ? status : strl__build_report(p->context, 0, 0, err);
}

static strl_status add(placing *p, uint32_t tree, uint32_t own_part, const double transform[12], strl_error *err)
{
    strl_build_context *context = p->context;
    const strl_model_tree *facts = &context->model->trees[tree];
    if (facts->triangles == 0)
        return STRL_OK; /* of a tree without a triangle there is nothing to see */
    placed *item = &p->items[p->count++];
    *item = (placed){.placement = {.tree = tree, .own_part = own_part}, .index = p->total++};
    memcpy(item->placement.transform, transform, sizeof item->placement.transform);
    for (unsigned k = 0; k < 3; k++)
        item->centre[k] = transform[4 * k] * facts->centre[0] + transform[4 * k + 1] * facts->centre[1] +
                          transform[4 * k + 2] * facts->centre[2] + transform[4 * k + 3];
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
            status = add(p, model->first_tree[input] + placement.piece - 1, p->part_base + placement.part + 1, placement.transform, err);
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
    uint64_t fit = context->memory_bytes / SHARES_OF_MEMORY / sizeof *p.items, all = count_placements(model);
    p.capacity = (size_t)(all < LEAST_AT_ONCE ? LEAST_AT_ONCE : all < fit ? all : fit);
    p.items = strl__alloc(p.capacity, sizeof *p.items);
    strl_status status = p.items ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu placements", p.capacity);
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
