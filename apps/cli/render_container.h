/* What both ways to draw a container take from its header. */
#ifndef STRL_CLI_RENDER_CONTAINER_H
#define STRL_CLI_RENDER_CONTAINER_H

#include "container/container.h"
#include "frame/view.h"
#include "render_model.h"

/* Bounds over all placements, up axis and unit. */
strl_status strl_render_container_facts(strl_container *container, strl_render_model *model, strl_error *err);

#endif
