/* A node's mesh on its way up the hierarchy: with the other nodes of its level that have the same points.
 *
 * Shares. All nodes that have a point at a level know each other: the lists of its holders agree (a holder that lost
 * the point may still be listed, which only locks more). A point whose list is empty is the node's own and may be
 * removed freely. Names in the lists are node indices within the level; one level up, index i has become i / 2. */
#ifndef STRL_BUILD_CLUSTERS_NODE_MESH_H
#define STRL_BUILD_CLUSTERS_NODE_MESH_H

#include "base/cursor.h"
#include "geometry/mesh.h"
#include "geometry/progressive.h"
#include "stroll/error.h"

typedef struct strl_node_mesh {
    strl_mesh mesh;
    int64_t anchor[3];     /* lattice cell that positions are relative to */
    uint32_t *share_first; /* [point_count + 1] into share; NULL = no point is shared */
    uint32_t *share;       /* other holders, ascending */
} strl_node_mesh;

/* Scratch format, not for exchange. Appends to writer. payload: the node's payload, decoded: its base
 * state has all points of the node, so that positions need not be told; NULL = they are. The reader
 * must be given the same. arena: for temporaries. */
strl_status strl_node_mesh_write(const strl_node_mesh *node, const strl_pm *payload, strl_arena *arena,
                                 strl_writer *writer, strl_error *err);
/* Arrays come from arena. */
strl_status strl_node_mesh_read(const void *data, size_t size, const strl_pm *payload, strl_arena *arena,
                                strl_node_mesh *node, strl_error *err);

/* Welds meshes at equal lattice positions, and their wedges where all attributes agree. Positions of the result are
 * relative to the first mesh's anchor. owner: [all triangles] receives the index of the mesh that each triangle came
 * from. point_of: [count][points of each] receives the new point of each old one. Shares are not merged. */
strl_status strl_node_mesh_merge(const strl_node_mesh *const *nodes, uint32_t count, strl_arena *arena,
                                 strl_node_mesh *merged, uint32_t **owner, uint32_t **point_of, strl_error *err);

/* The triangles t with owner[t] == which, as a mesh of their own. point_of: [mesh->point_count] receives new indices,
 * UINT32_MAX where unused. */
strl_status strl_mesh_extract(const strl_mesh *mesh, const uint32_t *owner, uint32_t which, strl_arena *arena,
                              strl_mesh *part, uint32_t *point_of, strl_error *err);

#endif
