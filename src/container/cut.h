/* Uniform cuts: the coarsest front of a tree with every claimed geometric error at most a given length, everywhere the
 * same. Used by `extract`, by `render --full` (length 0: all leaves in their finest state) and by tests. Of a sample
 * tree, where nodes add up, what is above the front is active with it.
 *
 * A group splits while its geometric error is above the length; errors grow to the root, so a node is active when its
 * parent's group splits and its own does not, or is a leaf. Each is drawn in its coarsest state within the length, or
 * its finest.
 *
 *     strl_cut_init(&cut, container, 0, length);
 *     while ((status = strl_cut_next(&cut, &id, &record, err)) == STRL_OK && id != STRL_NONE)
 *         ... strl_container_mesh(...) ... strl_cut_state(&cut, &mesh) ...
 */
#ifndef STRL_CONTAINER_CUT_H
#define STRL_CONTAINER_CUT_H

#include "container/container.h"

/* Caller's storage; nothing to release. One thread at a time. */
typedef struct strl_cut {
    strl_container *container; /* borrowed */
    uint32_t tree;
    double limit;    /* lattice units */
    bool adds;       /* a sample tree's: nodes that split are active too */
    uint32_t next;   /* id to look at next */
    uint32_t parent; /* whose group's decision `splits` is; STRL_NONE at first */
    bool splits;
} strl_cut;

/* length: model units, at least 0. The tree's number must be in range. */
void strl_cut_init(strl_cut *cut, strl_container *container, uint32_t tree, double length);
/* The next active node in id order; *id STRL_NONE after the last. Reads node records only, treelet by treelet. */
strl_status strl_cut_next(strl_cut *cut, uint32_t *id, strl_node *record, strl_error *err);
/* The state in which an active node's mesh is drawn. */
uint32_t strl_cut_state(const strl_cut *cut, const strl_pm *mesh);

/* For each vertex of the finest state the one that stands for it in `state`; map: [mesh->vertex_count]. */
void strl_cut_resolve(const strl_pm *mesh, uint32_t state, uint16_t *map);

/* By how much an affine transform stretches at most: its largest singular value. Exactly 1 for the identity. */
double strl_transform_stretch(const double transform[12]);

#endif
