/* From the points of placements, and of what is too far away to be told apart (far.c), to draw items. */
#include "walk/points.h"

#include <math.h>
#include <stdlib.h>

#include "base/affine.h"
#include "geometry/octahedral.h"

#define MOST_POINTS 65535u /* of an item: indices have 16 bits */
#define MOST_MERGED 256u   /* of a placement that has no items of its own */
#define SPREAD_BITS (STRL_SPREAD_MOST << STRL_SPREAD_SHIFT)

double strl__points_px(const strl_walk *walk, unsigned size)
{
    if (size >= STRL__POINT_SHARES)
        return STRL__MOST_POINT_PX * exp2(-0.5 * (size - STRL__POINT_SHARES));
    return walk->splat_ratio * walk->stats.allowed_error_px * (size + 1) / STRL__POINT_SHARES;
}

/* ---- merged */

/* From a point of the placement to the lattice of the far points, and how its normals turn. */
static void begin_merge(strl__points *self)
{
    const double *transform = self->placed->transform, step = strl__far_step(self->walk);
    double cofactor[9], largest = 0, least[3];
    for (int k = 0; k < 3; k++)
        least[k] = self->tree->origin[k] + self->tree->step * (double)self->tree->box_min[k];
    for (int row = 0; row < 3; row++) {
        const double *from = transform + 4 * row;
        double world = from[0] * least[0] + from[1] * least[1] + from[2] * least[2] + from[3];
        for (int k = 0; k < 3; k++)
            self->rows[row][k] = from[k] * self->tree->step / step;
        self->rows[row][3] = (world - self->walk->bounds[row]) / step;
    }
    strl_affine_cofactors(transform, cofactor);
    for (int k = 0; k < 9; k++)
        largest = fmax(largest, fabs(cofactor[k]));
    for (int k = 0; k < 9; k++)
        self->turn[k] = largest > 0 ? (float)(cofactor[k] / largest) : k % 4 == 0;
}

void strl__points_merge(strl__points *self, unsigned size, const strl_vertex *point, const float normal[3])
{
    strl__far_points *merged = &self->walk->merged[size];
    strl_vertex *to = strl__far_points_add(merged, self->walk->labels, self->placed->own_part);
    float turned[3];
    if (!to) {
        self->failed = true;
        return;
    }
    *to = *point;
    for (int k = 0; k < 3; k++) {
        const double *row = self->rows[k];
        const float *turn = self->turn + 3 * k;
        to->position[k] = strl__far_cell(row[0] * point->position[0] + row[1] * point->position[1] +
                                         row[2] * point->position[2] + row[3]);
        turned[k] = turn[0] * normal[0] + turn[1] * normal[1] + turn[2] * normal[2];
    }
    strl_oct_encode(turned, to->normal);
    to->normal[0] |= point->normal[0] & SPREAD_BITS;
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
    *counted = (strl__points){
        .walk = walk, .view = view, .placed = placed, .tree = walk->trees[placed->tree].tree, .work = walk->hole_work};
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
    begin_merge(made);
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
    if (all) {
        made.work = walk->hole_work;
        status = is_merged(walk, all) ? merge_points(&made, first, end, err) : make_points(&made, all, first, end, err);
    }
    walk->hole_work = made.work; /* looking at what is not seen is work too */
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
static strl_status add_items(strl_walk *walk, const strl_draw_item *shape, const strl_vertex *points,
                             const strl_vertex_label *labels, size_t count, strl_draw_list *list, strl_error *err)
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
    strl_draw_item item = {.placement = active->placement,
                           .point_px = (float)fmin(fmax(px, 1), STRL__MOST_POINT_PX),
                           .error_px = (float)px};
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
static strl_status list_far(strl_walk *walk, const strl__far_points *points, double px, strl_draw_list *list,
                            strl_error *err)
{
    const strl_draw_item shape = strl__far_item(walk, px, points->px);
    return add_items(walk, &shape, points->items, points->labels, points->count, list, err);
}

static int by_distance(const void *left, const void *right)
{
    const strl__placed_range *a = left, *b = right;
    if (a->distance != b->distance)
        return a->distance < b->distance ? -1 : 1;
    return a->first < b->first ? -1 : a->first > b->first;
}

/* The placements of the front; while something is missing the nearest ones first, by what comes first of them, which is
 * mostly the root: the work of closing holes may not do for all. */
static strl_status find_ranges(strl_walk *walk, strl_error *err)
{
    strl__placed_ranges *ranges = &walk->ranges;
    ranges->count = 0;
    for (size_t i = 0, next; i < walk->front.count; i = next) {
        next = end_of_placement(&walk->front, i);
        if (!strl__grow(&ranges->items, &ranges->capacity, ranges->count + 1, sizeof *ranges->items))
            return strl__fail(err, STRL_ERR_MEMORY, "no memory for the places of splats");
        ranges->items[ranges->count++] = (strl__placed_range){i, next, walk->front.items[i].sight.nearest};
    }
    if (walk->stats.missing_nodes > 0 && ranges->count > 1)
        qsort(ranges->items, ranges->count, sizeof *ranges->items, by_distance);
    return STRL_OK;
}

strl_status strl__draw_splats(strl_walk *walk, const strl_view *view, strl_draw_list *list, strl_error *err)
{
    strl_status status = find_ranges(walk, err);
    walk->point_count = walk->placed_count = 0;
    walk->hole_work = STRL__HOLE_WORK;
    for (unsigned size = 0; size < STRL__POINT_SIZES; size++)
        walk->merged[size].count = 0, walk->merged[size].px = strl__points_px(walk, size);
    for (size_t i = 0; i < walk->ranges.count && !status; i++)
        status = add_points(walk, view, walk->ranges.items[i].first, walk->ranges.items[i].end, err);
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
