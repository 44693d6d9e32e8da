#include "viewer/model.h"

#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "container/layout.h"
#include "frame/view.h"
#include "platform/file.h"
#include "platform/thread.h"
#include "shared/units.h"

#define READ_THREADS 2u
/* A near plane closer than this share of the far one wastes the digits of depth. */
#define LEAST_NEAR 1e-6

static strl_status check_kind(const char *path, strl_error *err)
{
    strl_file *file = NULL;
    char magic[8];
    size_t got = 0;
    if (strstr(path, "://"))
        return strl__fail(err, STRL_ERR_UNSUPPORTED,
                          "%s: models behind an address are not supported yet, expected a file", path);
    strl_status status = strl_file_open(path, &file, err);
    if (status == STRL_OK)
        status = strl_file_read_some(file, 0, magic, sizeof magic, &got, err);
    strl_file_close(file, NULL);
    if (status == STRL_OK && (got != sizeof magic || memcmp(magic, STRL__MAGIC, sizeof magic) != 0))
        status = strl__fail(err, STRL_ERR_ARGUMENT,
                            "%s is not a container: build one of it first "
                            "(stroll build %s -o NAME.stroll) and view that",
                            path, path);
    return status;
}

/* The walk gives bounds; up axis, unit and counts are the header's. */
static strl_status read_facts(strl_viewer_model *model, const char *path, strl_error *err)
{
    strl_status status = strl_container_open_path(path, &model->container, err);
    if (status != STRL_OK)
        return status;
    const strl_container_info *info = strl_container_get_info(model->container);
    model->up_axis = info->up_axis;
    model->unit_metres = strl_unit_metres(info->unit);
    for (uint32_t t = 0; t < info->tree_count; t++)
        model->triangles += strl_container_tree(model->container, t)->triangle_count;
    return STRL_OK;
}

static strl_status submit(void *context, void (*run)(void *job), void *job, strl_error *err)
{
    return strl_pool_submit(context, run, job, err);
}

strl_status strl_viewer_model_open(strl_viewer_model *model, const char *path, uint64_t memory_bytes, double error_px,
                                   strl_error *err)
{
    *model = (strl_viewer_model){0};
    strl_source *source = NULL;
    unsigned processors = strl_cpu_count();
    strl_status status = check_kind(path, err);
    if (status == STRL_OK)
        status = read_facts(model, path, err);
    if (status == STRL_OK)
        status = strl_pool_create(processors > 1 ? processors - 1 : 1, &model->pool, err);
    if (status == STRL_OK)
        status = strl_source_open_file(path, READ_THREADS, &source, err);
    if (status == STRL_OK) {
        model->executor = (strl_executor){model->pool, submit};
        const strl_walk_desc desc = {
            .memory_bytes = memory_bytes, .error_px = error_px, .executor = &model->executor, .labels = true};
        status = strl_walk_open(source, &desc, &model->walk, err);
    }
    if (status == STRL_OK)
        strl_walk_bounds(model->walk, model->bounds);
    else
        strl_viewer_model_close(model);
    return status;
}

void strl_viewer_model_close(strl_viewer_model *model)
{
    strl_walk_close(model->walk);
    strl_container_close(model->container);
    strl_pool_destroy(model->pool);
    *model = (strl_viewer_model){0};
}

static strl_box world_box(const strl_draw_item *item)
{
    strl_box box;
    for (int row = 0; row < 3; row++) {
        const double *m = item->transform + 4 * row;
        box.min[row] = box.max[row] = m[3];
        for (int i = 0; i < 3; i++) {
            double a = m[i] * (item->origin[i] + item->step * (double)item->box_min[i]);
            double b = m[i] * (item->origin[i] + item->step * (double)item->box_max[i]);
            box.min[row] += fmin(a, b);
            box.max[row] += fmax(a, b);
        }
    }
    return box;
}

bool strl_viewer_set_range(strl_draw_list *list, const strl_camera *camera)
{
    strl_view view;
    double near = INFINITY, far = 0;
    if (!strl_view_init(&view, camera))
        return false;
    for (uint32_t i = 0; i < list->count; i++) {
        strl_box box = world_box(&list->items[i]);
        double least, most;
        if (!list->items[i].visible || !strl_view_sees(&view, &box))
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
