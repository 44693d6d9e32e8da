/* From what the simplifier did to a progressive mesh: vertices and triangles in the order of refinement. */
#ifndef STRL_GEOMETRY_RECORD_H
#define STRL_GEOMETRY_RECORD_H

#include "geometry/mesh.h"
#include "geometry/progressive.h"
#include "geometry/simplify.h"

/* palette[i] describes the mesh's palette id i; only the ids that the mesh uses enter *pm. All arrays come from arena.
 * Fails with STRL_ERR_LIMIT where the mesh has more vertices or triangles than a progressive mesh holds. */
strl_status strl_pm_record(const strl_mesh *mesh, const strl_simplified *simplified, const strl_palette_entry *palette,
                           uint32_t palette_count, strl_arena *arena, strl_pm *pm, strl_error *err);

/* The base mesh as a mesh of its own, with the errors it has reached; kept points keep their flags.
 * point_map (may be NULL): [mesh->point_count] receives the new index of each point, UINT32_MAX where it is gone. */
strl_status strl_mesh_after(const strl_mesh *mesh, const strl_simplified *simplified, uint32_t *point_map,
                            strl_arena *arena, strl_mesh *base, strl_error *err);

#endif
