/* Cracks: edges that an odd number of triangles of a cut use, where the input has none.
 *
 * Whether a cut has any is asked without holding it: the exclusive or of the hashes of all edges, one term for
 * each triangle that uses the edge, is zero where all are used evenly, and else only by an accident of 128
 * bits. So all cuts together take one pass over the payloads, in memory that does not grow with the model.
 * Where the input is open, edges between two vertices of its boundary are left out; the boundary is a Bloom
 * filter, whose size bounds the memory and not the size of the boundary. */
#ifndef STRL_VERIFY_CRACKS_H
#define STRL_VERIFY_CRACKS_H

#include "verify/cuts.h"

typedef struct strl__boundary {
    uint64_t *bits; /* owned; NULL where the leaf mesh is closed */
    uint64_t mask;  /* bits - 1 */
    uint64_t open_edges;
} strl__boundary;

/* Finds the open edges of the leaf mesh. */
strl_status strl__v_boundary_find(strl__model *model, const strl__vtree *tree, strl__boundary *boundary,
                                  strl_error *err);
void strl__v_boundary_deinit(strl__boundary *boundary);
bool strl__v_boundary_has(const strl__boundary *boundary, strl__hash128 point);

/* Tries desc->cuts view-dependent cuts. */
strl_status strl__v_check_cracks(strl__model *model, const strl__vtree *tree, const strl__boundary *boundary,
                                 strl_verify_report *report, strl_error *err);

/* Nodes that the ladder's last rung made. Edges of other nodes are left out where both ends lie in the box of
 * such a node. */
typedef struct strl__clustered {
    uint32_t *nodes; /* owned; all of the tree */
    uint32_t count;
} strl__clustered;
strl_status strl__v_clustered_find(const strl__vtree *tree, strl__clustered *clustered, strl_error *err);
void strl__v_clustered_deinit(strl__clustered *clustered);
/* Those that are active and touch the box of `id` go to near ([clustered->count]); returns how many. */
uint32_t strl__v_clustered_near(const strl__clustered *clustered, const strl__vtree *tree, const uint64_t *active,
                                uint32_t id, uint32_t *near);
/* Whether one of them holds both points. */
bool strl__v_clustered_holds(const strl__vtree *tree, const uint32_t *near, uint32_t count, const int64_t a[3],
                             const int64_t b[3]);

/* Open edges one by one: each node's own triangles cancel inside the node, what is left goes to sorted runs. */
typedef struct strl__open_edge {
    strl__hash128 hash;
    int64_t end[2][3]; /* lattice */
} strl__open_edge;

/* Which triangles take part. */
typedef struct strl__edge_query {
    strl__model *model;
    const strl__vtree *tree;
    const uint64_t *active;           /* NULL = the leaves */
    const strl__vview *view;          /* states of the nodes; NULL = the finest */
    const strl__boundary *boundary;   /* edges between two of its vertices are left out; may be NULL */
    const strl__clustered *clustered; /* may be NULL where active is */
    void (*visit)(void *context, const strl__open_edge *edge); /* for each open edge */
    void *context;
} strl__edge_query;
strl_status strl__v_open_edges(const strl__edge_query *query, uint64_t *count, strl_error *err);

#endif
