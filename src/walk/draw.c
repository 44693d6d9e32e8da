/* The front as a draw list. */
#include "walk/internal.h"

#include <math.h>
#include <string.h>

/* The eye may stand inside a box; the depth buffer still wants a near plane before it. */
#define LEAST_NEAR 1e-6

void strl__item_place(strl_draw_item *item, const strl_tree *tree, const strl_node *record,
                      const strl__placement *placement)
{
    item->own_part = placement->own_part;
    item->step = tree->step;
    memcpy(item->anchor, record ? record->anchor : tree->box_min, sizeof item->anchor);
    memcpy(item->box_min, record ? record->box_min : tree->box_min, sizeof item->box_min);
    memcpy(item->box_max, record ? record->box_max : tree->box_max, sizeof item->box_max);
    memcpy(item->origin, tree->origin, sizeof item->origin);
    memcpy(item->transform, placement->transform, sizeof item->transform);
}

static strl_draw_item make_item(const strl_walk *walk, const strl__active *active)
{
    const strl__node *node = active->node;
    const strl_node *record = node->record;
    const strl__placement *placement = active->placed;
    const strl_tree *tree = walk->trees[placement->tree].tree;
    const strl__mesh *mesh = &node->mesh;
    float error = mesh->errors[active->state];
    uint32_t draw_count = 3 * mesh->triangle_end[active->state];
    strl_draw_item item = {
        .key = node->load,
        .placement = active->placement,
        .node = node->treelet->data.first_node + (uint32_t)(node - node->treelet->nodes),
        .level = record->level,
        .group = record->group,
        .state = mesh->state,
        .visible = active->sight.seen,
        .vertices = mesh->vertices,
        .labels = mesh->labels,
        .vertex_count = mesh->vertex_count,
        .indices = mesh->indices,
        .index_count = mesh->shared ? mesh->index_total : draw_count,
        .draw_first = mesh->index_first ? mesh->index_first[active->state] : 0,
        .draw_count = draw_count,
        .dirty_first = node->dirty_first,
        .dirty_count = node->dirty_end - node->dirty_first,
        .error = (float)(error * tree->step),
        .error_px = (float)strl_sight_error_px(&active->sight, error * placement->length_scale),
    };
    strl__item_place(&item, tree, record, placement);
    return item;
}

static void count_item(strl_walk *walk, const strl_draw_item *item)
{
    strl_walk_stats *stats = &walk->stats;
    if (!item->visible) {
        stats->nodes_culled++;
        return;
    }
    stats->nodes++;
    stats->triangles += item->draw_count / 3;
    stats->max_error_px = fmaxf(stats->max_error_px, item->error_px);
}

strl_status strl__draw_list(strl_walk *walk, const strl_view *view, strl_draw_list *list, strl_error *err)
{
    double least = walk->far_far > 0 ? walk->far_near : INFINITY, largest = walk->far_far;
    if (!strl__grow(&walk->items, &walk->item_capacity, walk->front.count, sizeof *walk->items))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a draw list of %zu items", walk->front.count);
    for (size_t i = 0; i < walk->front.count; i++) {
        const strl__active *active = &walk->front.items[i];
        walk->items[i] = make_item(walk, active);
        count_item(walk, &walk->items[i]);
        if (!active->sight.seen)
            continue;
        double near_depth, far_depth;
        strl_view_depth_range(view, &active->box, &near_depth, &far_depth);
        least = fmin(least, near_depth);
        largest = fmax(largest, far_depth);
    }
    list->frame = walk->frame;
    list->cull = walk->cull;
    list->items = walk->items;
    list->count = (uint32_t)walk->front.count;
    list->far_distance = largest > 0 ? largest : 1;
    list->near_distance = fmin(fmax(least, list->far_distance * LEAST_NEAR), list->far_distance / 2);
    return strl__draw_splats(walk, view, list, err);
}
