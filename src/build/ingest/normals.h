/* Vertex normals for corners that came without. */
#ifndef STRL_BUILD_INGEST_NORMALS_H
#define STRL_BUILD_INGEST_NORMALS_H

#include "base/memory.h"
#include "build/ingest/ingest.h"

/* Fills in missing normals of the triangles with wanted[t] from the faces round each lattice position: the mean,
 * weighted by angle, of the faces within 40 degrees of the corner's own. The result for a corner depends on the set of
 * faces at its position and on their order, which must be the same wherever that position is looked at. */
bool strl__fill_normals(strl_soup_triangle *triangles, const bool *wanted, uint32_t count, strl_arena *scratch);

#endif
