/* From the points of placements, and of what is too far away to be told apart (far.c), to draw items. */
#include "walk/points.h"

#include <math.h>

#include "base/affine.h"
#include "geometry/octahedral.h"

#define MOST_POINTS 65535u   /* of an item: indices have 16 bits */
#define MOST_MERGED 256u     /* of a placement that has no items of its own */
#define SPREAD_BITS (STRL_SPREAD_MOST << STRL_SPREAD_SHIFT)

double strl__points_px(const strl_walk *walk, unsigned size)
{
    if (size >= STRL__POINT_SHARES)
        return STRL__MOST_POINT_PX * exp2(-0.5 * (size - STRL__POINT_SHARES));
    return walk->splat_ratio * walk->stats.allowed_error_px * (size + 1) / STRL__POINT_SHARES;
}

/* ---- merged */

static void turn_normal(const double turn[9], strl_vertex *point)
{
    float before[3], after[3];
    uint16_t spread = point->normal[0] & SPREAD_BITS, code[2] = {point->normal[0] & (uint16_t)~SPREAD_BITS, point->normal[1]};
    double way[3], square = 0;
    strl_oct_decode(code, before);
    for (int row = 0; row < 3; row++) {
        way[row] = turn[3 * row] * (double)before[0] + turn[3 * row + 1] * (double)before[1] + turn[3 * row + 2] * (double)before[2];
        square += way[row] * way[row];
    }
    for (int row = 0; row < 3; row++)
        after[row] = square > 0 ? (float)(way[row] / sqrt(square)) : before[row];
    strl_oct_encode(after, code);
    point->normal[0] = code[0] | spread;
    point->normal[1] = code[1];
}

void strl__points_merge(strl__points *self, unsigned size, const strl_vertex *point)
{
    strl__far_points *merged = &self->walk->merged[size];
    strl_vertex *to = strl__far_points_add(merged, self->walk->labels, self->placed->own_part);
    double model[3];
    if (!to) {
        self->failed = true;
        return;
    }
    *to = *point;
    for (int k = 0; k < 3; k++)
        model[k] = self->tree->origin[k] + self->tree->step * ((double)self->tree->box_min[k] + point->position[k]);
    const double *rows = self->placed->transform;
    const double world[3] = {rows[0] * model[0] + rows[1] * model[1] + rows[2] * model[2] + rows[3],
                             rows[4] * model[0] + rows[5] * model[1] + rows[6] * model[2] + rows[7],
                             rows[8] * model[0] + rows[9] * model[1] + rows[10] * model[2] + rows[11]};
    strl__far_place(self->walk, world, to->position);
    turn_normal(self->turn, to);
}

/* ---- placements */

/* Behind the front's items of the same placement. */
static size_t end_of_placement(const strl__front *front, size_t first)
{
    size_t end = first + 1;
    while (end < front->count && front->items[end].placement == front->items[first].placement)
        end++;
    return end;
}

static size_t count_points(strl_walk *walk, const strl_view *view, size_t first, size_t end, strl__points *counted)
{
    const strl__placement *placed = walk->front.items[first].placed;
    size_t all = 0;
    *counted = (strl__points){.walk = walk, .view = view, .placed = placed, .tree = walk->trees[placed->tree].tree, .work = walk->hole_work};
    strl__points_take(counted, first, end);
    for (unsigned k = 0; k < STRL__POINT_SIZES; k++)
        all += counted->at[k];
    return all;
}

/* The points are merged; where there is but one placement, its items are as few. */
static bool is_merged(const strl_walk *walk, size_t points)
{
    return points <= MOST_MERGED && walk->placement_count > 1;
}

static strl_status merge_points(strl__points *made, size_t first, size_t end, strl_error *err)
{
    made->purpose = STRL__POINTS_MERGE;
    strl_affine_cofactors(made->placed->transform, made->turn);
    strl__points_take(made, first, end);
    return made->failed ? strl__fail(err, STRL_ERR_MEMORY, "no memory for splats of many placements") : STRL_OK;
}

static strl_status make_points(strl__points *made, size_t all, size_t first, size_t end, strl_error *err)
{
    strl_walk *walk = made->walk;
    size_t at = walk->point_count;
    if (!strl__grow(&walk->points, &walk->point_capacity, at + all, sizeof *walk->points) ||
        !strl__grow(&walk->placed_points, &walk->placed_capacity, walk->placed_count + 1, sizeof *walk->placed_points))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu splats", at + all);
    strl__placed_points *placed = &walk->placed_points[walk->placed_count++];
    placed->active = first;
    for (unsigned k = 0; k < STRL__POINT_SIZES; k++) {
        placed->count[k] = (uint32_t)made->at[k];
        made->at[k] = at;
        at += placed->count[k];
    }
    made->purpose = STRL__POINTS_MAKE;
    strl__points_take(made, first, end);
    walk->point_count = at;
    return STRL_OK;
}

/* Counted first, then made; both end alike, because both begin with the same work left. */
static strl_status add_points(strl_walk *walk, const strl_view *view, size_t first, size_t end, strl_error *err)
{
    strl__points made;
    size_t all = count_points(walk, view, first, end, &made);
    strl_status status = STRL_OK;
    made.work = walk->hole_work;
    if (all)
        status = is_merged(walk, all) ? merge_points(&made, first, end, err) : make_points(&made, all, first, end, err);
    walk->hole_work = all ? made.work : walk->hole_work;
    return status;
}

/* ---- items */

static bool fill_numbers(strl_walk *walk)
{
    if (walk->numbers)
        return true;
    walk->numbers = strl__alloc(MOST_POINTS, sizeof *walk->numbers);
    for (uint32_t i = 0; walk->numbers && i < MOST_POINTS; i++)
        walk->numbers[i] = (uint16_t)i;
    return walk->numbers != NULL;
}

/* `shape`: all of an item but its points. */
static strl_status add_items(strl_walk *walk, const strl_draw_item *shape, const strl_vertex *points, const strl_vertex_label *labels,
                             size_t count, strl_draw_list *list, strl_error *err)
{
    for (size_t first = 0; first < count; first += MOST_POINTS) {
        uint32_t part = count - first < MOST_POINTS ? (uint32_t)(count - first) : MOST_POINTS;
        if (!strl__grow(&walk->items, &walk->item_capacity, (size_t)list->count + 1, sizeof *walk->items))
            return strl__fail(err, STRL_ERR_MEMORY, "no memory for a draw list of %u items", list->count);
        strl_draw_item *item = &walk->items[list->count++];
        *item = *shape;
        item->key = ++walk->loads;
        item->visible = true;
        item->vertices = points + first;
        item->labels = labels ? labels + first : NULL;
        item->indices = walk->numbers;
        item->vertex_count = item->index_count = item->draw_count = item->dirty_count = part;
        walk->stats.splats += part;
        walk->stats.max_error_px = fmaxf(walk->stats.max_error_px, item->error_px);
    }
    return STRL_OK;
}

/* Of points of one placement. */
static strl_draw_item shape_of(const strl_walk *walk, const strl__active *active, double px)
{
    strl_draw_item item = {
        .placement = active->placement, .point_px = (float)fmin(fmax(px, 1), STRL__MOST_POINT_PX), .error_px = (float)px};
    strl__item_place(&item, walk->trees[active->placed->tree].tree, NULL, active->placed);
    return item;
}

/* Items are made when all points are there: the array has its place only then. */
static strl_status list_splats(strl_walk *walk, strl_draw_list *list, strl_error *err)
{
    strl_status status = STRL_OK;
    size_t at = 0;
    for (size_t i = 0; i < walk->placed_count && !status; i++) {
        const strl__placed_points *placed = &walk->placed_points[i];
        for (unsigned k = 0; k < STRL__POINT_SIZES && !status; at += placed->count[k++]) {
            if (!placed->count[k])
                continue;
            const strl_draw_item shape = shape_of(walk, &walk->front.items[placed->active], strl__points_px(walk, k));
            status = add_items(walk, &shape, walk->points + at, NULL, placed->count[k], list, err);
        }
    }
    return status;
}

/* Of many placements. */
static strl_status list_far(strl_walk *walk, const strl__far_points *points, double px, strl_draw_list *list, strl_error *err)
{
    const strl_draw_item shape = strl__far_item(walk, px, points->px);
    return add_items(walk, &shape, points->items, points->labels, points->count, list, err);
}

strl_status strl__draw_splats(strl_walk *walk, const strl_view *view, strl_draw_list *list, strl_error *err)
{
    strl_status status = STRL_OK;
    walk->point_count = walk->placed_count = 0;
    walk->hole_work = STRL__HOLE_WORK;
    for (unsigned size = 0; size < STRL__POINT_SIZES; size++)
        walk->merged[size].count = 0, walk->merged[size].px = strl__points_px(walk, size);
    for (size_t i = 0, next; i < walk->front.count && !status; i = next) {
        next = end_of_placement(&walk->front, i);
        status = add_points(walk, view, i, next, err);
    }
    size_t points = walk->point_count;
    for (unsigned size = 0; size < STRL__FAR_SIZES; size++)
        points += walk->far[size].count;
    for (unsigned size = 0; size < STRL__POINT_SIZES; size++)
        points += walk->merged[size].count;
    if (status || points == 0)
        return status;
    if (!fill_numbers(walk))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for splats");
    status = list_splats(walk, list, err);
    for (unsigned size = 0; size < STRL__POINT_SIZES && !status; size++)
        status = list_far(walk, &walk->merged[size], walk->merged[size].px, list, err);
    for (unsigned size = 0; size < STRL__FAR_SIZES && !status; size++)
        status = list_far(walk, &walk->far[size], strl__far_px(walk->stats.allowed_error_px, size), list, err);
    list->items = walk->items;
    return status;
}
