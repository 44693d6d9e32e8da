/* The older surfaces that nodes are measured against (geometry/certify.h).
 *
 * Base meshes of every second level become *anchors*: their triangles, each with a bound of its own distance from the input, go up the
 * hierarchy with the nodes that stand for them. From two levels above on, nodes are measured against them; when the next anchors are old
 * enough these take over, so that bounds do not add up from level to level. Levels of few nodes keep what they have to the top.
 *
 * Which node stands for which piece decides who answers for it in a cut, whatever states the nodes take. Where a group has moved the
 * boundaries of its members, each piece goes to the member over which it lies now; one that lies over several is cut. */
#ifndef STRL_BUILD_CLUSTERS_ANCHORS_H
#define STRL_BUILD_CLUSTERS_ANCHORS_H

#include "base/cursor.h"
#include "build/clusters/node_mesh.h"
#include "geometry/certify.h"

typedef struct strl_pieces {
    uint32_t count;
    strl_piece *item; /* owned */
    size_t capacity;
} strl_pieces;

/* Two generations: what nodes are measured against, and what will be. */
typedef struct strl_anchors {
    strl_pieces used, young;
    strl_pieces beside; /* used ones of other members of the group, near this one: not written */
} strl_anchors;

/* What happens at the level being made. */
typedef struct strl_anchor_plan {
    uint32_t first;     /* the first level whose base meshes become anchors */
    uint32_t born;      /* the level of the young ones */
    bool promotes;      /* the children's young ones are used from here on */
    bool has_used, has_young;
    bool is_on;         /* any of it */
    bool bears;         /* the base meshes of this level become young anchors */
} strl_anchor_plan;

/* Of a level. certify: from as low a level as pays; else near the root only. */
strl_anchor_plan strl_anchor_plan_of(uint32_t level, uint32_t depth, bool certify);

void strl_anchors_deinit(strl_anchors *anchors);
/* Scratch format. Pieces are relative to their node's anchor. */
void strl_anchors_write(const strl_anchors *anchors, strl_writer *writer);
/* Appends the pieces of a node; moved: what is to be added to their positions. */
strl_status strl_anchors_read(const void *data, size_t size, const int64_t moved[3], bool promotes, strl_anchors *anchors,
                              strl_error *err);
/* The triangles of a base mesh as young anchors. certificate: NULL = by their drifts. */
bool strl_anchors_bear(const strl_mesh *base, const strl_certificate *certificate, strl_pieces *young);
/* Fills `beside` of all members. */
bool strl_anchors_find_beside(strl_anchors *shares, uint32_t members, double reach);
/* Divides what a group's members (at most 8) stood for as children among them, as their boundaries are now: own[i] becomes shares[i] as far
 * as it lies over triangles of member i (owner: of mesh's triangles), or reaches beyond them by no more than `tolerance`. */
strl_status strl_anchors_divide(const strl_mesh *mesh, const uint32_t *owner, uint32_t members, double tolerance, const strl_anchors *own,
                                strl_arena *arena, strl_anchors *shares, strl_error *err);

#endif
