/* Vertex normals for corners that came without. */
#ifndef STRL_BUILD_CLUSTERS_NORMALS_H
#define STRL_BUILD_CLUSTERS_NORMALS_H

#include "base/memory.h"
#include "build/ingest/ingest.h"

/* Fills in missing normals of triangles [0, own) from the faces round each lattice position among all `count` triangles: the mean,
 * weighted by angle, of the faces within 40 degrees of the corner's own. The result for a corner depends on the set of
 * faces at its position and on their order, which must be the same wherever that position is looked at. */
bool strl__fill_normals(strl_soup_triangle *triangles, uint32_t own, uint32_t count, strl_arena *scratch);

#endif
