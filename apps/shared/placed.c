#include "shared/placed.h"

#include <math.h>

#include "container/container.h"

strl_status strl_placed_triangles(strl_container *container, uint64_t *triangles, strl_error *err)
{
    const strl_container_info *info = strl_container_get_info(container);
    strl_status status = STRL_OK;
    uint64_t sum = 0;
    *triangles = 0;
    for (uint64_t i = 0; i < info->placement_count && status == STRL_OK; i++) {
        strl_placement placement;
        status = strl_container_placement(container, i, &placement, err);
        const strl_tree *tree = status == STRL_OK ? strl_container_tree(container, placement.tree) : NULL;
        if (tree && __builtin_add_overflow(sum, tree->triangle_count, &sum))
            sum = UINT64_MAX;
    }
    if (status == STRL_OK)
        *triangles = sum;
    return status;
}

strl_box strl_placed_box(const double origin[3], double step, const double transform[12], const int64_t box_min[3],
                         const int64_t box_max[3])
{
    strl_box box;
    for (int row = 0; row < 3; row++) {
        const double *m = transform + 4 * row;
        box.min[row] = box.max[row] = m[3];
        for (int i = 0; i < 3; i++) {
            double a = m[i] * (origin[i] + step * (double)box_min[i]);
            double b = m[i] * (origin[i] + step * (double)box_max[i]);
            box.min[row] += fmin(a, b);
            box.max[row] += fmax(a, b);
        }
    }
    return box;
}
