/* Bricks: the nodes of the container that hold a sample tree (docs/algorithms/samples.md). The brick of an inner cell
 * holds what the cells below it store, because they are needed together; its child bricks are those of these cells. Of
 * a cell with few triangles it holds all that lies below, level by level, and has no child. */
#ifndef STRL_BUILD_SAMPLES_BRICK_H
#define STRL_BUILD_SAMPLES_BRICK_H

#include "base/cursor.h"
#include "base/memory.h"
#include "build/samples/octree.h"
#include "container/container.h"

/* More than these, of one brick, are told by several. */
#define STRL_BRICK_TRIANGLES 8192u
#define STRL_NO_BRICK UINT32_MAX
#define STRL_PREVIEW_DEPTH 5u /* halvings of the model */

typedef struct strl_brick {
    strl_node record; /* boxes, counts and errors; ids and levels are given when all bricks are known */
    uint32_t parent;  /* in the set; STRL_NO_BRICK of the first one */
    uint32_t depth;   /* below the first one */
    uint32_t child_count;
    uint32_t chunk;      /* at the top: no brick, but the place of a piece's bricks; else STRL_NO_CHUNK */
    uint64_t payload_at; /* in the set's bytes */
    uint32_t payload_bytes;
} strl_brick;

/* In preorder, so that those of one depth lie in the order of their ids. */
typedef struct strl_brick_set {
    strl_brick *brick; /* owned */
    size_t count, capacity;
    strl_writer bytes;            /* payloads; data owned */
    uint64_t triangles, vertices; /* of all bricks */
} strl_brick_set;

/* Appends the brick of an inner octant and those below it. At the top a child that is the root of a piece becomes a
 * place of depth and parent alone. arena: for temporaries. */
strl_status strl_bricks_add(strl_brick_set *set, const strl_octree *octree, uint32_t octant, uint32_t parent,
                            strl_arena *arena, strl_error *err);
/* The first brick of a tree: what its root cell stores, and the preview: splats of the finest cells down to
 * strl_preview_depth of which a brick has room for all. They close the holes as long as what is below is not there. */
strl_status strl_bricks_add_root(strl_brick_set *set, const strl_octree *octree, uint32_t octant, strl_arena *arena,
                                 strl_error *err);
/* Boxes and cones of parents around those of their children; sizes never less than theirs. */
/* In the octree, which is that of the curve's cube. */
uint32_t strl_preview_depth(const strl_ingest *ingest);
void strl_bricks_close(strl_brick_set *set);
void strl_bricks_deinit(strl_brick_set *set);

#endif
