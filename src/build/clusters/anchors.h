/* The older surfaces that nodes are measured against (geometry/certify.h).
 *
 * The base meshes of one level become *anchors*: their triangles, each with a bound of its own distance from the input,
 * go up the hierarchy with the nodes that stand for them. Where they are many for what is left of a node, mostly two
 * levels above, its base mesh takes their place. So bounds do not add up from level to level.
 *
 * Which node stands for which piece decides who answers for it in a cut, whatever states the nodes take. Where a group
 * has moved the boundaries of its members, each piece goes to the member over which it lies now; one that lies over
 * several is cut. Members split together, so in any cut each piece, or what it was made from, has a node that is drawn:
 * new anchors take over at the very level above their birth, and the same node answers for them and for those that they
 * replace. */
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

/* Of a node. */
typedef struct strl_anchors {
    strl_pieces own;
    strl_pieces beside; /* of other members of the group, near this one: not written */
    float granted;      /* what the node will claim for its children's sake, whatever is measured */
} strl_anchors;

/* What happens at a level. */
typedef struct strl_anchor_plan {
    bool begins;   /* all base meshes become anchors, for the first time */
    bool measures; /* nodes are measured against the anchors that their children pass on */
    /* so many pieces for each triangle of a base mesh, and that becomes the anchors in their place; 0 = never */
    uint32_t crowd;
} strl_anchor_plan;

/* Whose base meshes become the first anchors. certify: as low a level as pays; else near the root. */
uint32_t strl_anchor_first_level(uint32_t depth, bool certify);
strl_anchor_plan strl_anchor_plan_of(uint32_t level, uint32_t depth, bool certify);

void strl_anchors_deinit(strl_anchors *anchors);
/* Scratch format. Pieces are relative to their node's anchor. */
void strl_pieces_write(const strl_pieces *pieces, strl_writer *writer);
/* Appends the pieces of a node; moved: what is to be added to their positions. */
strl_status strl_pieces_read(const void *data, size_t size, const int64_t moved[3], strl_pieces *pieces,
                             strl_error *err);
void strl_pieces_deinit(strl_pieces *pieces);
/* The triangles of a base mesh as anchors. certificate: NULL = by their drifts. */
bool strl_anchors_bear(const strl_mesh *base, const strl_certificate *certificate, strl_pieces *born);
/* Fills `beside` of all members. */
bool strl_anchors_find_beside(strl_anchors *shares, uint32_t members, double reach);
/* Divides what a group's members (at most 8) stood for as children among them, as their boundaries are now: own[i] goes
 * to shares[i].own as far as it lies over triangles of member i (owner: of mesh's triangles), or reaches beyond them by
 * no more than `tolerance`. */
strl_status strl_anchors_divide(const strl_mesh *mesh, const uint32_t *owner, uint32_t members, double tolerance,
                                const strl_pieces *own, strl_arena *arena, strl_anchors *shares, strl_error *err);

#endif
