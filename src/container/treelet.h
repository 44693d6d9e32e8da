/* Pieces of the format that the walk fetches itself: treelets (pages of node records), payload pages, and pages of
 * placements. Functions on bytes are pure and thread-safe. */
#ifndef STRL_CONTAINER_TREELET_H
#define STRL_CONTAINER_TREELET_H

#include "container/container.h"
#include "geometry/far.h"
#include "geometry/payload.h"
#include "geometry/sample_payload.h"

/* Where a treelet lies. A treelet names the treelets that hold the children of its nodes; the header names the first.
 */
typedef struct strl_treelet_ref {
    uint64_t offset;
    uint32_t bytes;
    uint64_t checksum;
} strl_treelet_ref;

typedef struct strl_treelet {
    uint32_t first_node; /* id of nodes[0] */
    uint32_t node_count;
    strl_node nodes[STRL_TREELET_NODES];
    uint32_t first_child_treelet; /* index of the treelet that child_refs[0] names; STRL_NONE where there is none */
    uint32_t child_ref_count;
    strl_treelet_ref *child_refs; /* owned (strl__free) */
} strl_treelet;

strl_status strl_container_root_treelet(const strl_container *container, uint32_t tree, strl_treelet_ref *ref,
                                        strl_error *err);
/* Checks the checksum and every field (ids against tree, ranges, finite and ordered errors, boxes). treelet is the
 * caller's. */
strl_status strl_treelet_decode(const strl_container *container, uint32_t tree, uint32_t index,
                                const strl_treelet_ref *ref, const void *data, size_t size, strl_treelet *treelet,
                                strl_error *err);
void strl_treelet_deinit(strl_treelet *treelet);

/* Checks a page's bytes against its reference. */
strl_status strl_page_check(const strl_page_ref *ref, const void *data, size_t size, strl_error *err);
/* Decodes one node's mesh from its page (already checked) and checks it against the record (counts, box, errors).
 * reference: the finest state of the record's decode_parent, placed; NULL where it has none. head: what stands before
 * the mesh in a node of a sample tree, zero in others; NULL = not wanted. Arrays of both come from arena. */
strl_status strl_page_mesh(const strl_node *record, const void *page, size_t size,
                           const strl_payload_reference *reference, strl_arena *arena, strl_brick_head *head,
                           strl_pm *mesh, strl_error *err);
/* The head alone. */
strl_status strl_page_head(const strl_node *record, const void *page, size_t size, strl_arena *arena,
                           strl_brick_head *head, strl_error *err);
/* What the node's mesh looks like from afar; as strl_page_mesh without a reference. */
strl_status strl_page_far(const strl_node *record, const void *page, size_t size, strl_far *far, strl_error *err);
/* Sets the offset of a reference whose positions are relative to `anchor`, for a node's payload. */
void strl_page_place(strl_payload_reference *reference, const int64_t anchor[3], const strl_node *record);
/* Nodes in a chain of decode parents, at most, from the one that is self-contained on. */
#define STRL_DECODE_CHAIN 32u
/* Bytes that the decoded mesh of a node takes in a walk: per vertex 20 for itself and 10 for its parent and the corners
 * that it moves, per triangle 6 for its corners, 6 for indices and 12 for lists of corners, 16 per state. A pure
 * function of the record's counts (docs/format.md has it), used for budgets before anything is fetched. */
uint64_t strl_node_decoded_bytes(const strl_node *record);

/* ---- placements */

/* Placement i is number i % STRL_RUN_PLACEMENTS of run i / STRL_RUN_PLACEMENTS. */
#define STRL_RUN_PLACEMENTS 512u

/* The placements of one page, and what they look like from outside. */
typedef struct strl_run {
    double box_min[3], box_max[3]; /* of them all, in the world, by strl_placed_box */
    strl_far far;
    strl_treelet_ref page;
} strl_run;

/* How many runs the container has: 0 where all placements are on one page. */
uint32_t strl_container_run_count(const strl_container *container);
/* Blocking; run < the count. The reference of its page is in the file, and of the size that the page must have. */
strl_status strl_container_run(strl_container *container, uint32_t run, strl_run *facts, strl_error *err);
/* Checks the bytes of a run's page against its facts; then each of its placements can be read from them. */
strl_status strl_run_check(const strl_container *container, uint32_t run, const strl_run *facts, const void *data,
                           size_t size, strl_error *err);
/* index: of the container, one of the run's. */
strl_status strl_run_placement(const strl_container *container, uint64_t index, const void *data,
                               strl_placement *placement, strl_error *err);
/* The box in the world of a box of the tree's lattice that an affine transform places. */
void strl_placed_box(const strl_tree *tree, const double transform[12], const int64_t min[3], const int64_t max[3],
                     double placed_min[3], double placed_max[3]);

#endif
