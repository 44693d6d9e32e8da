/* The splats of a frame: of all bricks whose cells are small enough, merged into items of points, one or more a placement, and of
 * placements that are too far away (far.c). */
#include "walk/internal.h"

#include <math.h>
#include <string.h>

#define SIZES 4u /* of splats, shares of the allowed one: a cell is as a rule half as large as the one above */
#define MOST_POINTS 65535u /* of an item: indices have 16 bits */

typedef struct shown {
    const strl_splat *splats;
    uint32_t count;
} shown;

/* Of the state that the brick is drawn in. Of one whose children are wanted and not there yet, none: see missing_splats. */
static shown shown_splats(const strl__active *active)
{
    const strl__mesh *mesh = &active->node->mesh;
    if (active->sight.empty || !mesh->splat_end || active->state >= mesh->step_count)
        return (shown){0};
    uint32_t first = active->state ? mesh->splat_end[active->state - 1] : 0;
    return (shown){mesh->splats + first, mesh->splat_end[active->state] - first};
}

/* The least size that covers the cells of the brick's splats: 0 = a part of the allowed one, to SIZES - 1 = all of it. Where that is a pixel
 * there is but one. */
static unsigned size_of(const strl_walk *walk, const strl__active *active)
{
    const strl__mesh *mesh = &active->node->mesh;
    double allowed = walk->stats.allowed_error_px;
    if (!(walk->splat_ratio * allowed > 1))
        return SIZES - 1;
    double size = (double)mesh->errors[active->state] * walk->placements[active->placement].length_scale;
    double parts = ceil(SIZES * strl_sight_error_px(&active->sight, size) / allowed);
    return parts >= SIZES ? SIZES - 1 : parts >= 1 ? (unsigned)parts - 1 : 0;
}

/* How many splats of each size the front's items [first, end) show. */
static void count_sizes(const strl_walk *walk, size_t first, size_t end, size_t count[SIZES])
{
    memset(count, 0, SIZES * sizeof *count);
    for (size_t i = first; i < end; i++) {
        uint32_t splats = shown_splats(&walk->front.items[i]).count;
        if (splats)
            count[size_of(walk, &walk->front.items[i])] += splats;
    }
}

/* Behind the front's items of the same placement. */
static size_t end_of_placement(const strl__front *front, size_t first)
{
    size_t end = first + 1;
    while (end < front->count && front->items[end].placement == front->items[first].placement)
        end++;
    return end;
}

/* What is below has not arrived: the finest splats of the brick close its holes, as large as their cells. */
static shown missing_splats(const strl__active *active)
{
    const strl__mesh *mesh = &active->node->mesh;
    if (active->sight.empty || !mesh->splat_end || active->state < mesh->step_count || active->open ||
        active->node->record->child_count == 0)
        return (shown){0};
    uint32_t first = mesh->step_count > 1 ? mesh->splat_end[mesh->step_count - 2] : 0;
    return (shown){mesh->splats + first, mesh->splat_end[mesh->step_count - 1] - first};
}

/* 0 = all faces are parallel, STRL_SPREAD_MOST = any direction: then their mean is half as long as they are together, all being
 * turned to one side. */
static uint16_t spread_of(const strl_splat *splat)
{
    uint32_t twice = 2 * (255u - splat->parallel);
    return (uint16_t)((twice < 255 ? twice : 255) * STRL_SPREAD_MOST / 255);
}

/* Relative to the least corner of the tree's box, which all cells lie near. */
static strl_vertex make_point(const strl_node *record, const strl_splat *splat, const int64_t origin[3])
{
    strl_vertex point;
    for (int k = 0; k < 3; k++)
        point.position[k] = (int32_t)(uint32_t)((uint64_t)record->anchor[k] - (uint64_t)origin[k] + (uint64_t)(int64_t)splat->centre[k]);
    for (int k = 0; k < 2; k++)
        point.normal[k] = (uint16_t)(splat->normal[k] * 1023u / 255u);
    point.normal[0] |= (uint16_t)(spread_of(splat) << STRL_SPREAD_SHIFT);
    for (int k = 0; k < 3; k++)
        point.rgba[k] = (uint8_t)(splat->rgba >> 8 * k);
    point.rgba[3] = (uint8_t)((splat->rgba >> 24) * splat->coverage / 255);
    return point;
}

static void put_points(strl_walk *walk, const strl__active *active, shown added, size_t at)
{
    const strl_tree *tree = walk->trees[walk->placements[active->placement].tree].tree;
    for (uint32_t i = 0; i < added.count; i++)
        walk->points[at + i] = make_point(active->node->record, &added.splats[i], tree->box_min);
}

static strl_status make_room(strl_walk *walk, size_t count, strl_error *err)
{
    if (!strl__grow(&walk->points, &walk->point_capacity, walk->point_count + count, sizeof *walk->points))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu splats", walk->point_count + count);
    return STRL_OK;
}

/* Those of the front's items [first, end), which are of one placement, by size. */
static strl_status add_shown(strl_walk *walk, size_t first, size_t end, strl_error *err)
{
    size_t count[SIZES], at[SIZES], all = 0;
    count_sizes(walk, first, end, count);
    for (unsigned k = 0; k < SIZES; all += count[k++])
        at[k] = walk->point_count + all;
    strl_status status = make_room(walk, all, err);
    for (size_t i = first; i < end && !status; i++) {
        const strl__active *active = &walk->front.items[i];
        shown splats = shown_splats(active);
        if (!splats.count)
            continue;
        unsigned size = size_of(walk, active);
        put_points(walk, active, splats, at[size]);
        at[size] += splats.count;
    }
    walk->point_count += status ? 0 : all;
    return status;
}

static strl_status add_missing(strl_walk *walk, const strl__active *active, strl_error *err)
{
    shown splats = missing_splats(active);
    strl_status status = make_room(walk, splats.count, err);
    if (!status) {
        put_points(walk, active, splats, walk->point_count);
        walk->point_count += splats.count;
    }
    return status;
}

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
static strl_status add_items(strl_walk *walk, const strl_draw_item *shape, const strl_vertex *points, size_t count, strl_draw_list *list,
                             strl_error *err)
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
        item->indices = walk->numbers;
        item->vertex_count = item->index_count = item->draw_count = item->dirty_count = part;
        walk->stats.splats += part;
    }
    return STRL_OK;
}

/* Of points of one placement. */
static strl_draw_item shape_of(const strl_walk *walk, uint32_t placement_index, double px)
{
    const strl__placement *placement = &walk->placements[placement_index];
    const strl_tree *tree = walk->trees[placement->tree].tree;
    strl_draw_item item = {.placement = placement_index,
                           .own_part = placement->own_part,
                           .step = tree->step,
                           .point_px = (float)fmin(fmax(px, 1), STRL__MOST_POINT_PX),
                           .error_px = (float)px};
    memcpy(item.anchor, tree->box_min, sizeof item.anchor);
    memcpy(item.box_min, tree->box_min, sizeof item.box_min);
    memcpy(item.box_max, tree->box_max, sizeof item.box_max);
    memcpy(item.origin, tree->origin, sizeof item.origin);
    memcpy(item.transform, placement->transform, sizeof item.transform);
    return item;
}

static double missing_px(const strl_walk *walk, const strl__active *active)
{
    const strl__mesh *mesh = &active->node->mesh;
    double size = (double)mesh->errors[mesh->step_count - 1] * walk->placements[active->placement].length_scale;
    return walk->splat_ratio * strl_sight_error_px(&active->sight, size);
}

/* Items are made when all points are there: the array has its place only then. Of what has arrived they are as large as their cells, or
 * things would look denser than they are. */
static strl_status list_splats(strl_walk *walk, strl_draw_list *list, strl_error *err)
{
    const strl__front *front = &walk->front;
    strl_status status = STRL_OK;
    size_t at = 0;
    for (size_t i = 0, next; i < front->count && !status; i = next) {
        size_t count[SIZES];
        next = end_of_placement(front, i);
        count_sizes(walk, i, next, count);
        for (unsigned k = 0; k < SIZES && !status; at += count[k++]) {
            double px = walk->splat_ratio * walk->stats.allowed_error_px * (k + 1) / SIZES;
            const strl_draw_item shape = shape_of(walk, front->items[i].placement, px);
            status = add_items(walk, &shape, walk->points + at, count[k], list, err);
        }
    }
    for (size_t i = 0; i < front->count && !status; i++) {
        uint32_t count = missing_splats(&front->items[i]).count;
        const strl_draw_item shape = shape_of(walk, front->items[i].placement, count ? missing_px(walk, &front->items[i]) : 0);
        status = add_items(walk, &shape, walk->points + at, count, list, err);
        at += count;
    }
    return status;
}

strl_status strl__draw_splats(strl_walk *walk, strl_draw_list *list, strl_error *err)
{
    strl_status status = STRL_OK;
    walk->point_count = 0;
    for (size_t i = 0, next; i < walk->front.count && !status; i = next) {
        next = end_of_placement(&walk->front, i);
        status = add_shown(walk, i, next, err);
    }
    for (size_t i = 0; i < walk->front.count && !status; i++)
        status = add_missing(walk, &walk->front.items[i], err);
    if (status || walk->point_count + walk->far_count == 0)
        return status;
    if (!fill_numbers(walk))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for splats");
    const strl_draw_item far = strl__far_item(walk);
    status = list_splats(walk, list, err);
    if (status == STRL_OK)
        status = add_items(walk, &far, walk->far_points, walk->far_count, list, err);
    list->items = walk->items;
    return status;
}
