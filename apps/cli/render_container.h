/* What both ways to draw a container take from its header. */
#ifndef STRL_CLI_RENDER_CONTAINER_H
#define STRL_CLI_RENDER_CONTAINER_H

#include "container/container.h"
#include "render_model.h"

/* Bounds over all placements, up axis and unit. */
void strl_render_container_facts(const strl_container *container, strl_render_model *model);

#endif
