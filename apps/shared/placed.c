#include "shared/placed.h"

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
