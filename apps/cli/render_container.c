#include "render_container.h"

#include <string.h>

void strl_render_container_facts(const strl_container *container, strl_render_model *model)
{
    const strl_container_info *info = strl_container_get_info(container);
    model->up_axis = info->up_axis;
    memcpy(model->unit, info->unit, sizeof model->unit);
    memcpy(model->bounds, info->bounds, sizeof model->bounds);
}
