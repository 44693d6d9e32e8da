#include "render_container.h"

#include <math.h>
#include <string.h>

void strl_render_world_box(const strl_tree *tree, const double transform[12], const int64_t box_min[3],
                           const int64_t box_max[3], strl_box *box)
{
    for (int row = 0; row < 3; row++) {
        const double *m = transform + 4 * row;
        box->min[row] = box->max[row] = m[3];
        for (int i = 0; i < 3; i++) {
            double a = m[i] * (tree->origin[i] + tree->step * (double)box_min[i]);
            double b = m[i] * (tree->origin[i] + tree->step * (double)box_max[i]);
            box->min[row] += fmin(a, b);
            box->max[row] += fmax(a, b);
        }
    }
}

strl_status strl_render_container_facts(strl_container *container, strl_render_model *model, strl_error *err)
{
    const strl_container_info *info = strl_container_get_info(container);
    model->up_axis = info->up_axis;
    memcpy(model->unit, info->unit, sizeof model->unit);
    strl_box all = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (uint64_t p = 0; p < info->placement_count; p++) {
        strl_placement placement;
        strl_status status = strl_container_placement(container, p, &placement, err);
        if (status != STRL_OK)
            return status;
        const strl_tree *tree = strl_container_tree(container, placement.tree);
        strl_box box;
        strl_render_world_box(tree, placement.transform, tree->box_min, tree->box_max, &box);
        for (int i = 0; i < 3; i++) {
            all.min[i] = fmin(all.min[i], box.min[i]);
            all.max[i] = fmax(all.max[i], box.max[i]);
        }
    }
    memcpy(model->bounds, &all, sizeof model->bounds);
    return STRL_OK;
}
