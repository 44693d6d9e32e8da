#include "render_container.h"

#include <math.h>
#include <string.h>

#include "shared/placed.h"

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
        strl_box box = strl_placed_box(tree->origin, tree->step, placement.transform, tree->box_min, tree->box_max);
        for (int i = 0; i < 3; i++) {
            all.min[i] = fmin(all.min[i], box.min[i]);
            all.max[i] = fmax(all.max[i], box.max[i]);
        }
    }
    memcpy(model->bounds, &all, sizeof model->bounds);
    return STRL_OK;
}
