/* The cluster hierarchy while it is simplified, level by level from the leaves (Quick-VDR 4.3, 4.4).
 *
 *   level 0:  cells of a cluster -> weld, normals -> mesh, shared points locked -> progressive mesh to half
 *   level k:  base meshes of the children -> groups of nodes -> boundaries within a group simplified on the merged
 *             mesh -> each node: progressive mesh to half, its shared points locked
 *
 * Only one group's meshes per worker are in memory; what stays is one strl_node_state per node. */
#ifndef STRL_BUILD_CLUSTERS_HIERARCHY_H
#define STRL_BUILD_CLUSTERS_HIERARCHY_H

#include "base/memory.h"
#include "build/clusters/anchors.h"
#include "build/clusters/node_mesh.h"
#include "build/clusters/partition.h"
#include "container/writer.h"

#define STRL_GROUP_MAX 8u
/* Appearance: attribute deviation of a normal turned by one radian, and of black against white. */
#define STRL_NORMAL_WEIGHT 0.4f
#define STRL_COLOUR_WEIGHT 1.f

/* What a node will claim, lattice units. Its record has the same by drifts alone, which the build goes by, so that
 * certificates change no geometry. */
typedef struct strl_node_claims {
    float least, most, group; /* of geometric_min, geometric_max, group_geometric */
} strl_node_claims;

/* What is kept of every node. Nodes of a level are numbered 0 .. count - 1; the children of i are 2i and 2i + 1 one
 * level down. */
typedef struct strl_node_state {
    strl_node record;    /* ids, group and page fields are filled in when the container is written */
    uint64_t payload_at; /* its progressive mesh, in the payload spill of its level */
    uint32_t payload_bytes;
    uint64_t mesh_at; /* base mesh, in the mesh spill of its level; when it is written, the order of its mesh */
    uint32_t mesh_bytes;
    uint64_t anchors_at; /* in the anchor spill of its level */
    uint64_t anchors_bytes;
    strl_node_claims claims;
    bool needs_payload;    /* positions of the base mesh are in the payload alone */
    uint32_t point_count;  /* of the base mesh */
    uint32_t outer_shared; /* points of the base mesh that a node other than the sibling has too */
    uint32_t group;        /* index within the level */
} strl_node_state;

typedef struct strl_level {
    uint32_t count;         /* nodes */
    strl_node_state *nodes; /* [count] */
    uint32_t group_count;
    strl_spill *payloads; /* progressive meshes, packed (pm_spill.h) until they are written */
    strl_spill *meshes;   /* base meshes, deleted when the next level is done; while writing, orders of meshes */
    strl_spill *anchors;  /* the same of anchors; NULL where there are none */
    strl_spill *states;   /* of the nodes as they were taken, for checkpoints; NULL where none are made */
} strl_level;

/* How many points two nodes of the next level share: counted while a level is made. */
typedef struct strl_adjacency {
    uint64_t *key; /* low << 32 | high, + 1; 0 = free */
    uint32_t *count;
    size_t size, used;
} strl_adjacency;

bool strl_adjacency_add(strl_adjacency *adjacency, uint32_t a, uint32_t b, uint32_t count);
void strl_adjacency_deinit(strl_adjacency *adjacency);

/* A base mesh of so many triangles is good enough where fewer would cost many times the error. */
#define STRL_SOFT_TRIANGLES 6144u

/* The root of a tree that is placed many times goes on down to so many: from afar each placement is drawn by no less.
 */
#define STRL_PLACED_ROOT_TRIANGLES 64u

typedef struct strl_hierarchy {
    strl_build_context *context;
    strl_ingest *ingest; /* gives up its streams when they are used up */
    const strl_partition *partition;
    strl_level *levels;     /* [partition->depth + 1] */
    strl_adjacency current; /* of the level being made, until its groups are chosen */
    strl_adjacency next;    /* of the level above it */
    /* lattice units: where the nodes of the level being made are to end; 0 = at half their triangles */
    float even_error;
    /* STRL_SOFT_TRIANGLES but while leaves are sampled, and at the root of a tree with placements */
    uint32_t soft_triangles;
    uint32_t most_target;         /* nodes are to end at no more; UINT32_MAX = at half their triangles */
    strl_anchor_plan anchor_plan; /* of the level opened last: the one being made */
    float growth;         /* by which even_error grows from level to level, so that about half the triangles go */
    uint32_t saved_done;  /* groups of the level being made that the last checkpoint has */
    uint64_t saved_at_ns; /* when it was made */
} strl_hierarchy;

/* One node as a worker has made it, before its bytes are put into the spills in order. */
typedef struct strl_made_node {
    strl_node_state state;
    strl_writer payload, mesh, anchors;
    uint32_t *next_neighbour; /* pairs (node of the next level, points shared), owned */
    size_t neighbour_count, neighbour_capacity;
} strl_made_node;

void strl_made_node_deinit(strl_made_node *made);
/* Simplifies to `target` triangles, records the progressive mesh, packs it, keeps the base mesh with its shares. `self`
 * is the node's index in its level. Boxes and errors are those of the mesh alone. anchors: what the node stands for;
 * NULL = nothing. */
strl_status strl_make_node(const strl_hierarchy *hierarchy, const strl_node_mesh *node, const strl_anchors *anchors,
                           uint32_t self, uint32_t target, strl_arena *arena, strl_made_node *made, strl_error *err);
/* Appends a made node's bytes to its level and counts its neighbours. In node order, one thread. */
strl_status strl_take_node(strl_hierarchy *hierarchy, strl_level *level, uint32_t self, strl_made_node *made,
                           strl_error *err);

/* What happens at a level; those below must be done. */
strl_anchor_plan strl_hierarchy_anchor_plan(const strl_hierarchy *hierarchy, uint32_t level);
/* The anchors of a group's children, given to its `count` members: shares[i] is member i's. owner: of the merged mesh's
 * triangles. */
strl_status strl_group_anchors(const strl_level *children, const uint32_t *member, uint32_t count,
                               const strl_node_mesh *merged, const uint32_t *owner, strl_arena *arena,
                               strl_anchors *shares, strl_error *err);
/* Raises the claims of a group's members to those of their children, and to each other's. */
void strl_group_claims(const strl_level *children, const uint32_t *member, uint32_t count, strl_made_node *made);

/* The larger of both errors of a node's base mesh. */
float strl_node_error(const strl_node *record);
/* Sorts values in place. */
float strl_median(float *values, uint32_t count);
/* Sets even_error for the level above `level`, which is done. */
bool strl_choose_even_error(strl_hierarchy *hierarchy, const strl_level *level);

/* From the group `first` on: those before are restored. */
strl_status strl_make_leaves(strl_hierarchy *hierarchy, uint32_t first, strl_error *err);
strl_status strl_make_level(strl_hierarchy *hierarchy, uint32_t level, uint32_t first, strl_error *err);

/* ---- checkpoints (build/checkpoint.h; clusters_save.c, node_save.c) ---- */

/* How far a build has come. */
typedef enum strl_stage { STRL_STAGE_NONE, STRL_STAGE_INGEST, STRL_STAGE_PARTITION } strl_stage;
typedef struct strl_position {
    strl_stage finished; /* the last of the stages before the levels */
    /* all levels below are finished, and so many groups of this one; level depth + 1 = all are */
    uint32_t level, done;
} strl_position;

strl_status strl_clusters_save(strl_hierarchy *hierarchy, const strl_position *position, strl_error *err);
/* After every group: saves where it is time to. */
strl_status strl_clusters_note(strl_hierarchy *hierarchy, uint32_t level, uint32_t done, strl_error *err);
/* Opens the streams of a level. */
strl_status strl_level_open(strl_hierarchy *hierarchy, uint32_t index, strl_error *err);
/* What an earlier build has finished: ingest, partition (with STRL_STAGE_PARTITION, levels too) and where to go on.
 * *graph: a stream that is to be deleted when the partition is made. */
strl_status strl_clusters_restore(strl_hierarchy *hierarchy, strl_ingest *ingest, strl_partition *partition,
                                  strl_position *position, strl_spill **graph, strl_error *err);

/* Appends a node that was taken to its level's states. */
strl_status strl_node_state_save(strl_level *level, uint32_t self, const strl_made_node *made, strl_error *err);
/* Reads all states of a level: its nodes, and to `next` (may be NULL) the neighbours that they counted. *count: how
 * many. */
strl_status strl_node_states_restore(strl_level *level, uint32_t groups, strl_adjacency *next, uint32_t *count,
                                     strl_error *err);

/* All nodes, breadth first, each payload told by its parent's. Uses up the payloads of the levels. */
strl_status strl_write_nodes(const strl_hierarchy *hierarchy, strl_container_writer *writer, strl_error *err);

/* Removes faces of which there are more than two identical ones, in pairs, from a group's merged mesh. *dropped: how
 * many. False without memory. */
bool strl__drop_duplicate_pairs(strl_mesh *mesh, uint32_t *owner, uint32_t *dropped, strl_arena *arena);

/* Groups of nodes whose shared boundary may be simplified together (Quick-VDR 4.4, conditions 1 to 3). */
typedef struct strl_groups {
    uint32_t count;
    uint32_t *first;  /* [count + 1] into member */
    uint32_t *member; /* nodes, ascending within a group; groups ascend by their first member */
} strl_groups;

strl_status strl_groups_choose(const strl_level *children, const strl_adjacency *adjacency, uint32_t node_count,
                               uint32_t levels_above, bool single, strl_groups *groups, strl_error *err);
void strl_groups_deinit(strl_groups *groups);

/* A position that has more cells than this outside of a cluster has no sensible normal anyway. */
#define STRL_HALO_CELLS 64u

/* Shared points of the leaves, by cluster: read from ingest, written to streams of cluster ranges. The cells are those
 * outside of the cluster; none where they are more than STRL_HALO_CELLS. */
typedef struct strl_leaf_shares {
    uint32_t bucket_count;
    uint32_t *bucket_first; /* [bucket_count + 1] clusters */
    strl_spill **spill;     /* words: cluster x y z clusters n cluster[n] m cell[m] */
    uint32_t *last_reader;  /* [cell_count] the last cluster that needs the cell: its own, or one beside it */
} strl_leaf_shares;

strl_status strl_leaf_shares_create(const strl_hierarchy *hierarchy, strl_leaf_shares *shares, strl_error *err);
void strl_leaf_shares_deinit(strl_leaf_shares *shares);

#endif
