#include "render_model.h"

#include <math.h>

#include "base/fail.h"

#define LEAST_NEAR 1e-6

strl_status strl_render_model_open(const strl_render_model_desc *desc, strl_render_model **model, strl_error *err)
{
    *model = NULL;
    bool container;
    strl_status status = strl_location_is_container(&desc->location, &container, err);
    if (status != STRL_OK)
        return status;
    if (container)
        return desc->full ? strl_render_full_open(desc, model, err) : strl_render_walk_open(desc, model, err);
    if (!desc->full)
        return strl__fail(err, STRL_ERR_ARGUMENT,
                          "%s is not a container: build one first (stroll build), or draw its triangles as read "
                          "with --full",
                          desc->location.name);
    return strl_render_soup_open(desc, model, err);
}

void strl_render_set_range(strl_draw_list *list, double least, double largest)
{
    list->far_distance = largest > 0 && isfinite(largest) ? largest : 1;
    list->near_distance = fmin(fmax(least, list->far_distance * LEAST_NEAR), list->far_distance / 2);
}

void strl_render_add_stats(strl_image_stats *stats, const strl_render_stats *drawn)
{
    stats->triangles += drawn->triangles;
    stats->nodes += drawn->items;
    stats->draws += drawn->draws;
    stats->uploaded_bytes += drawn->uploaded_bytes;
    stats->evictions += drawn->evictions;
    stats->gpu_bytes = drawn->gpu_bytes;
}
