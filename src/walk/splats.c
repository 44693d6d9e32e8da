/* The splats of a frame: of all bricks whose cells are small enough, merged into items of points, one or more a placement. */
#include "walk/internal.h"

#include <string.h>

#define MOST_POINTS 65535u /* of an item: indices have 16 bits */

/* Of the state that the brick is drawn in. */
static uint32_t shown_splats(const strl__active *active, const strl_splat **splats)
{
    const strl__mesh *mesh = &active->node->mesh;
    if (!active->sight.seen || !mesh->splat_end || mesh->state >= mesh->step_count)
        return 0;
    uint32_t first = mesh->state ? mesh->splat_end[mesh->state - 1] : 0;
    *splats = mesh->splats + first;
    return mesh->splat_end[mesh->state] - first;
}

/* Relative to the least corner of the tree's box, which all cells lie near. */
static strl_vertex make_point(const strl_node *record, const strl_splat *splat, const int64_t origin[3])
{
    strl_vertex point;
    for (int k = 0; k < 3; k++)
        point.position[k] = (int32_t)(uint32_t)((uint64_t)record->anchor[k] - (uint64_t)origin[k] + (uint64_t)(int64_t)splat->centre[k]);
    for (int k = 0; k < 2; k++)
        point.normal[k] = (uint16_t)(splat->normal[k] * 1023u / 255u);
    for (int k = 0; k < 3; k++)
        point.rgba[k] = (uint8_t)(splat->rgba >> 8 * k);
    point.rgba[3] = (uint8_t)((splat->rgba >> 24) * splat->coverage / 255);
    return point;
}

static strl_status add_points(strl_walk *walk, const strl__active *active, strl_error *err)
{
    const strl_tree *tree = walk->trees[walk->placements[active->placement].tree].tree;
    const strl_splat *splats;
    uint32_t count = shown_splats(active, &splats);
    if (!strl__grow(&walk->points, &walk->point_capacity, walk->point_count + count, sizeof *walk->points))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu splats", walk->point_count);
    for (uint32_t i = 0; i < count; i++)
        walk->points[walk->point_count++] = make_point(active->node->record, &splats[i], tree->box_min);
    return STRL_OK;
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

/* Points first..end, all of one placement. Where they lie is set when there are all. */
static strl_status add_items(strl_walk *walk, uint32_t placement_index, size_t first, size_t end, strl_draw_list *list, strl_error *err)
{
    const strl__placement *placement = &walk->placements[placement_index];
    const strl_tree *tree = walk->trees[placement->tree].tree;
    for (; first < end; first += MOST_POINTS) {
        uint32_t count = end - first < MOST_POINTS ? (uint32_t)(end - first) : MOST_POINTS;
        if (!strl__grow(&walk->items, &walk->item_capacity, (size_t)list->count + 1, sizeof *walk->items))
            return strl__fail(err, STRL_ERR_MEMORY, "no memory for a draw list of %u items", list->count);
        strl_draw_item *item = &walk->items[list->count++];
        *item = (strl_draw_item){.key = ++walk->loads,
                                 .placement = placement_index,
                                 .visible = true,
                                 .vertices = walk->points + first,
                                 .vertex_count = count,
                                 .indices = walk->numbers,
                                 .index_count = count,
                                 .dirty_count = count,
                                 .step = tree->step,
                                 .point_px = (float)(walk->stats.allowed_error_px > 1 ? walk->stats.allowed_error_px : 1),
                                 .error_px = (float)walk->stats.allowed_error_px};
        memcpy(item->anchor, tree->box_min, sizeof item->anchor);
        memcpy(item->box_min, tree->box_min, sizeof item->box_min);
        memcpy(item->box_max, tree->box_max, sizeof item->box_max);
        memcpy(item->origin, tree->origin, sizeof item->origin);
        memcpy(item->transform, placement->transform, sizeof item->transform);
        walk->stats.splats += count;
    }
    return STRL_OK;
}

strl_status strl__draw_splats(strl_walk *walk, strl_draw_list *list, strl_error *err)
{
    strl_status status = STRL_OK;
    walk->point_count = 0;
    for (size_t i = 0; i < walk->front.count && !status; i++)
        status = add_points(walk, &walk->front.items[i], err);
    if (status || walk->point_count == 0)
        return status;
    if (!fill_numbers(walk))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for splats");
    /* Once more: the array of points has its place only now. */
    size_t at = 0;
    for (size_t i = 0, next; i < walk->front.count && !status; i = next) {
        uint32_t placement = walk->front.items[i].placement;
        size_t first = at;
        const strl_splat *splats;
        for (next = i; next < walk->front.count && walk->front.items[next].placement == placement; next++)
            at += shown_splats(&walk->front.items[next], &splats);
        status = add_items(walk, placement, first, at, list, err);
    }
    list->items = walk->items;
    return status;
}
