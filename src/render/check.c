#include "render/check.h"

#include <inttypes.h>
#include <math.h>

#include "base/fail.h"

#define NORMAL_MOST 1023

static strl_status fail_item(const strl_draw_item *item, strl_error *err, const char *what, uint64_t found,
                             uint64_t expected)
{
    return strl__fail(err, STRL_ERR_ARGUMENT,
                      "draw item of node %" PRIu32 " (placement %" PRIu32 "): %s is %" PRIu64
                      ", expected at most %" PRIu64,
                      item->node, item->placement, what, found, expected);
}

strl_status strl__check_item_counts(const strl_draw_item *item, strl_error *err)
{
    if (item->vertex_count > 65536)
        return fail_item(item, err, "vertex count", item->vertex_count, 65536);
    if (item->draw_first > item->index_count)
        return fail_item(item, err, "first index to draw", item->draw_first, item->index_count);
    if (item->draw_count > item->index_count - item->draw_first)
        return fail_item(item, err, "count of indices to draw", item->draw_count, item->index_count - item->draw_first);
    if (!(item->point_px > 0) && (item->index_count % 3 != 0 || item->draw_first % 3 != 0 || item->draw_count % 3 != 0))
        return fail_item(item, err, "index count modulo three",
                         item->index_count % 3 + item->draw_first % 3 + item->draw_count % 3, 0);
    if (item->dirty_first > item->index_count)
        return fail_item(item, err, "first dirty index", item->dirty_first, item->index_count);
    if (item->dirty_count > item->index_count - item->dirty_first)
        return fail_item(item, err, "dirty index count", item->dirty_count, item->index_count - item->dirty_first);
    if (item->index_count > 0 && (!item->indices || !item->vertices))
        return fail_item(item, err, "count of missing arrays", 1, 0);
    return STRL_OK;
}

static strl_status check_numbers(const strl_draw_item *item, strl_error *err)
{
    bool finite = isfinite(item->error) && item->error >= 0 && !isnan(item->error_px) && item->error_px >= 0;
    for (int i = 0; i < 12; i++)
        finite = finite && isfinite(item->transform[i]);
    for (int i = 0; i < 3; i++)
        finite = finite && isfinite(item->origin[i]);
    if (item->positions == STRL_POSITIONS_LATTICE)
        finite = finite && isfinite(item->step) && item->step > 0;
    if (!finite)
        return strl__fail(err, STRL_ERR_ARGUMENT,
                          "draw item of node %" PRIu32 " (placement %" PRIu32
                          "): transform, origin, step or error is not a finite number in its range",
                          item->node, item->placement);
    return STRL_OK;
}

static strl_status check_vertex(const strl_draw_item *item, uint32_t v, strl_error *err)
{
    const strl_vertex *vertex = &item->vertices[v];
    uint32_t most[2] = {item->point_px > 0 ? UINT16_MAX : NORMAL_MOST, NORMAL_MOST};
    for (int i = 0; i < 2; i++)
        if (vertex->normal[i] > most[i])
            return fail_item(item, err, "a normal's coordinate", vertex->normal[i], most[i]);
    if (item->positions == STRL_POSITIONS_FLOAT)
        return STRL_OK;
    for (int i = 0; i < 3; i++) {
        int64_t cell;
        if (__builtin_add_overflow(item->anchor[i], vertex->position[i], &cell) || cell < item->box_min[i] ||
            cell > item->box_max[i])
            return strl__fail(err, STRL_ERR_ARGUMENT,
                              "draw item of node %" PRIu32 " (placement %" PRIu32 "): vertex %" PRIu32
                              " lies outside the node's box along axis %d",
                              item->node, item->placement, v, i);
    }
    return STRL_OK;
}

strl_status strl__check_item_contents(const strl_draw_item *item, strl_error *err)
{
    strl_status status = check_numbers(item, err);
    for (uint32_t v = 0; status == STRL_OK && v < item->vertex_count; v++)
        status = check_vertex(item, v, err);
    for (uint32_t i = 0; status == STRL_OK && i < item->index_count; i++)
        if (item->indices[i] >= item->vertex_count)
            status = fail_item(item, err, "an index", item->indices[i], (uint64_t)item->vertex_count - 1);
    return status;
}
