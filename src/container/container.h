/* The container: one .stroll file, format version 1 (docs/format.md is normative). This header adds to
 * stroll/container.h what a file holds below the facts, and the rest of the blocking reader. The walk uses the same
 * decoders through container/treelet.h without ever waiting. */
#ifndef STRL_CONTAINER_CONTAINER_H
#define STRL_CONTAINER_CONTAINER_H

#include <stdbool.h>
#include <stdint.h>

#include "base/memory.h"
#include "geometry/cone.h"
#include "geometry/progressive.h"
#include "source/source.h"
#include "stroll/container.h"

#define STRL_NONE UINT32_MAX
/* Nodes of one treelet: node i is record i % STRL_TREELET_NODES of treelet i / STRL_TREELET_NODES of its tree. */
#define STRL_TREELET_NODES 128u
#define STRL_NODE_MAX_CHILDREN 8u
#define STRL_PAGE_BYTES (128u << 10) /* a page is closed when it reaches this; one payload is never divided */

typedef enum strl_structure {
    STRL_STRUCTURE_CLUSTERS = 1,
    STRL_STRUCTURE_HLOD = 2,
    STRL_STRUCTURE_SAMPLES = 3
} strl_structure;

/* Which rung of the simplification ladder a node's mesh needed (docs/algorithms/clusters.md); errors hold on all of
 * them. */
typedef enum strl_rung {
    STRL_RUNG_TOPOLOGY,
    STRL_RUNG_SEAMS,
    STRL_RUNG_DISJOINT,
    STRL_RUNG_CLUSTERING,
    STRL_RUNG_SAMPLED /* nothing was simplified: a brick of a sample tree */
} strl_rung;

/* Where bytes lie, with all that recognises a stale or foreign page. */
typedef struct strl_page_ref {
    uint64_t offset;        /* from the start of the file */
    uint32_t bytes;         /* as stored */
    uint32_t decoded_bytes; /* what its payloads take in memory when decoded, summed */
    uint64_t checksum;      /* XXH3 of the stored bytes */
} strl_page_ref;

/* Where a treelet lies. */
typedef struct strl_treelet_place {
    uint64_t offset;
    uint32_t bytes;
} strl_treelet_place;

/* A node's record. Ids are breadth first from the root (0); the children of a node have consecutive ids. */
typedef struct strl_node {
    uint32_t parent;      /* STRL_NONE for the root */
    uint32_t first_child; /* STRL_NONE for a leaf */
    uint32_t child_count;
    uint32_t level;      /* 0 = leaf level; a parent's level is its children's + 1 */
    uint32_t group;      /* dependency group: its members split and collapse together */
    uint32_t group_size; /* members, at least 1 */
    int64_t anchor[3];   /* lattice cell that the payload's positions are relative to */
    int64_t box_min[3];  /* lattice; encloses the node's geometry in every state and the boxes of its children */
    int64_t box_max[3];
    /* encloses the boxes of all members and the group boxes of all groups of their children */
    int64_t group_box_min[3];
    int64_t group_box_max[3];
    float geometric_min, geometric_max;   /* error range in lattice units: finest state, base mesh */
    float appearance_min, appearance_max; /* the same for appearance */
    float group_geometric,
        group_appearance; /* largest minimum error of the group; at least that of their children's groups */
    uint32_t vertex_count, base_vertex_count;     /* finest state, base mesh */
    uint32_t triangle_count, base_triangle_count; /* finest state, base mesh */
    uint32_t step_count;
    uint32_t boundary_steps;  /* collapses of shared vertices made in the group before this node's mesh began */
    uint32_t shared_vertices; /* vertices of the base mesh that another node of the level has too (locked ones) */
    uint32_t rung;            /* strl_rung, the highest used in this node or its boundary steps */
    strl_page_ref page;       /* the page that holds the payload */
    uint32_t payload_offset;  /* within the page */
    uint32_t payload_bytes;
    /* STRL_NONE: the payload is self-contained; else the parent, whose mesh is needed to decode it */
    uint32_t decode_parent;
    /* of the normals of all triangles of the node and of those below it; sample trees alone have one */
    strl_cone cone;
} strl_node;

/* One tree. Lattice cell c is the point origin + step * c in model units. */
typedef struct strl_tree {
    strl_structure structure;
    double origin[3];
    double step;                    /* a power of two */
    int64_t box_min[3], box_max[3]; /* lattice, of the leaf geometry */
    uint32_t node_count;
    uint32_t level_count; /* levels are 0 .. level_count - 1; the root's is level_count - 1 */
    uint32_t group_count;
    uint64_t triangle_count; /* of all leaves in their finest state */
    uint64_t vertex_count;   /* the same, render vertices, summed over leaves */
    uint32_t root_triangles; /* base mesh of the root */
    float leaf_geometric;    /* lattice units: half a cell's diagonal and what ingest adds */
} strl_tree;

/* borrowed; NULL out of range */
const strl_tree *strl_container_tree(const strl_container *container, uint32_t tree);
strl_source *strl_container_source(strl_container *container); /* borrowed */

/* Blocking calls, for tools. A few treelets are cached. */
strl_status strl_container_node(strl_container *container, uint32_t tree, uint32_t node, strl_node *record,
                                strl_error *err);
/* Where the treelet lies that holds the node's record. After strl_container_node of the same node it is known. */
strl_status strl_container_treelet_of(strl_container *container, uint32_t tree, uint32_t node,
                                      strl_treelet_place *place, strl_error *err);
/* Bytes of memory that looking nodes up in all trees can take at most. */
uint64_t strl_container_lookup_bytes(const strl_container *container);
/* Reads and decodes a node's mesh into arena; the page's checksum is checked. Meshes that it is decoded by are decoded
 * too, and kept along one way from the root: to go through nodes in the order of their ids costs about twice their own
 * decoding. */
strl_status strl_container_mesh(strl_container *container, uint32_t tree, const strl_node *record, strl_arena *arena,
                                strl_pm *mesh, strl_error *err);

#endif
