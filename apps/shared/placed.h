/* What a container shows, with its copies. */
#ifndef STRL_APPS_PLACED_H
#define STRL_APPS_PLACED_H

#include "stroll/container.h"

/* Of the finest level, each tree's as often as it is placed; at most UINT64_MAX. Reads all placements. */
strl_status strl_placed_triangles(strl_container *container, uint64_t *triangles, strl_error *err);

#endif
