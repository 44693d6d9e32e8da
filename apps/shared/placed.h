/* What a container shows, with its copies. */
#ifndef STRL_APPS_PLACED_H
#define STRL_APPS_PLACED_H

#include "frame/view.h"
#include "stroll/container.h"

/* Of the finest level, each tree's as often as it is placed; at most UINT64_MAX. Reads all placements. */
strl_status strl_placed_triangles(strl_container *container, uint64_t *triangles, strl_error *err);
/* The box of the world round a box of lattice cells. origin, step: of the lattice. */
strl_box strl_placed_box(const double origin[3], double step, const double transform[12], const int64_t box_min[3],
                         const int64_t box_max[3]);

#endif
