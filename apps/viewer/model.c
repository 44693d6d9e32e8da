#include "viewer/model.h"

#include <math.h>

#include "base/fail.h"
#include "container/treelet.h"
#include "frame/view.h"
#include "platform/thread.h"
#include "shared/placed.h"
#include "shared/units.h"

#define READ_THREADS 2u
/* A near plane closer than this share of the far one wastes the digits of depth. */
#define LEAST_NEAR 1e-6

static strl_status check_kind(const strl_location *location, strl_error *err)
{
    bool container;
    strl_status status = strl_location_is_container(location, &container, err);
    if (status == STRL_OK && !container)
        status = strl__fail(err, STRL_ERR_ARGUMENT,
                            "%s is not a container: build one of it first "
                            "(stroll build %s -o NAME.stroll) and view that",
                            location->name, location->name);
    return status;
}

/* Placements that are counted before a model is shown: of more, or far away, it would be waited for. */
#define MOST_COUNTED (1u << 20)
#define MOST_COUNTED_FAR (1u << 12)

/* 0 where that would take long or fails: it is for people. */
static uint64_t count_placed(const strl_viewer_model *model, const strl_location *location)
{
    uint64_t count = strl_container_get_info(model->container)->placement_count, triangles = 0;
    if (count <= (strl_location_is_remote(location->name) ? MOST_COUNTED_FAR : MOST_COUNTED))
        strl_placed_triangles(model->container, &triangles, NULL);
    return triangles;
}

/* The walk gives bounds; up axis, unit and counts are the header's. */
static void take_facts(strl_viewer_model *model, const strl_location *location)
{
    model->container = strl_walk_container(model->walk);
    const strl_container_info *info = strl_container_get_info(model->container);
    model->up_axis = info->up_axis;
    model->unit_metres = strl_unit_metres(info->unit);
    model->triangles = strl_container_triangle_count(model->container);
    model->placed = count_placed(model, location);
    strl_walk_bounds(model->walk, model->bounds);
}

static strl_status submit(void *context, void (*run)(void *job), void *job, strl_error *err)
{
    return strl_pool_submit(context, run, job, err);
}

strl_status strl_viewer_model_open(strl_viewer_model *model, const strl_location *location, const strl_walk_desc *how,
                                   strl_error *err)
{
    *model = (strl_viewer_model){0};
    strl_source *source = NULL;
    unsigned processors = strl_cpu_count();
    strl_status status = check_kind(location, err);
    if (status == STRL_OK)
        status = strl_pool_create(processors > 1 ? processors - 1 : 1, &model->pool, err);
    if (status == STRL_OK)
        status = strl_location_open_source(location, READ_THREADS, &source, err);
    if (status == STRL_OK) {
        model->executor = (strl_executor){model->pool, submit};
        strl_walk_desc desc = *how;
        desc.executor = &model->executor;
        desc.labels = true;
        status = strl_walk_open(source, &desc, &model->walk, err);
    }
    if (status == STRL_OK)
        take_facts(model, location);
    else
        strl_viewer_model_close(model);
    return status;
}

void strl_viewer_model_close(strl_viewer_model *model)
{
    strl_walk_close(model->walk);
    strl_pool_destroy(model->pool);
    *model = (strl_viewer_model){0};
}

bool strl_viewer_set_range(strl_draw_list *list, const strl_camera *camera)
{
    strl_view view;
    double near = INFINITY, far = 0;
    if (!strl_view_init(&view, camera))
        return false;
    for (uint32_t i = 0; i < list->count; i++) {
        const strl_draw_item *item = &list->items[i];
        const strl_tree lattice = {.origin = {item->origin[0], item->origin[1], item->origin[2]}, .step = item->step};
        strl_box box;
        strl_placed_box(&lattice, item->transform, item->box_min, item->box_max, box.min, box.max);
        double least, most;
        if (!item->visible || !strl_view_sees(&view, &box))
            continue;
        strl_view_depth_range(&view, &box, &least, &most);
        near = fmin(near, least);
        far = fmax(far, most);
    }
    if (!(far > 0) || !isfinite(far))
        return false;
    list->far_distance = far;
    list->near_distance = fmin(fmax(near, far * LEAST_NEAR), far / 2);
    return true;
}
