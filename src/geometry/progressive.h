/* A node's progressive mesh (Hoppe 1996; Quick-VDR 3.2.2) as plain arrays: what the simplifier records, the payload
 * codec stores, and the walk draws.
 *
 * Vertices are in the order in which refinement adds them: the base mesh has vertices [0, vertex_end[0]) and triangles
 * [0, triangle_end[0]); state s (0 = base, step_count = finest) has [0, vertex_end[s]) and [0, triangle_end[s]).
 * Step s (1..step_count) splits one topological vertex: it adds one render vertex per wedge, all at one position, and
 * the triangles that were degenerate without it. A half-edge collapse moves no vertex, so the arrays are shared by all
 * states.
 *
 * `triangle` holds the corners of the finest state. A corner c in state s is
 *     resolve(c, s) = c < vertex_end[s] ? c : resolve(parent[c], s)
 * and parent[c] < the first vertex of c's step. In state s every triangle t < triangle_end[s] has three corners at
 * three different positions, and each triangle of a step has a vertex of that step for a corner.
 *
 * Errors are lengths in lattice units, never increasing with s: geometric_error[s] bounds the two-sided distance
 * between state s and the input surface (quantisation included), appearance_error[s] how far a feature of colour or
 * normal may have moved. */
#ifndef STRL_GEOMETRY_PROGRESSIVE_H
#define STRL_GEOMETRY_PROGRESSIVE_H

#include <stdbool.h>
#include <stdint.h>

#include "base/memory.h"
#include "stroll/error.h"

/* Most vertices of a node's finest state: indices are 16 bits on the GPU. */
#define STRL_PM_MAX_VERTICES 65535u
#define STRL_PM_MAX_TRIANGLES 131072u
#define STRL_PM_MAX_PALETTE 65535u
/* Largest error, in lattice units. */
#define STRL_PM_MAX_ERROR 0x1p64f
/* Limit of the work of refining: the sum, over all vertices that steps add, of the triangles at the parent just before.
 * A step moves some of these corners; only a vertex shared by very many triangles comes near. */
#define STRL_PM_MAX_MOVES (1u << 26)

/* What a vertex's palette index stands for. */
typedef struct strl_palette_entry {
    uint32_t part;     /* index into the container's parts */
    uint32_t material; /* index into the container's materials */
    uint32_t rgba;     /* the material's colour, sRGB-encoded RGBA8, R lowest byte */
} strl_palette_entry;

typedef struct strl_pm {
    uint32_t vertex_count;       /* of the finest state, render vertices (wedges) */
    uint32_t triangle_count;     /* of the finest state */
    uint32_t step_count;         /* recorded collapses of topological vertices */
    uint32_t palette_count;      /* at least 1 */
    int32_t (*position)[3];      /* [vertex_count], lattice units, offset from the node's anchor */
    uint16_t (*normal)[2];       /* [vertex_count], octahedral, 10 bits each (0..1023); see geometry/octahedral.h */
    uint32_t *colour;            /* [vertex_count], sRGB-encoded RGBA8; NULL = all 0xffffffff */
    uint32_t *texcoord;          /* [vertex_count], two codes of 16 bits, u lowest; NULL = all 0 */
    uint16_t *palette_index;     /* [vertex_count]; NULL = all 0 */
    uint16_t *parent;            /* [vertex_count]; entries below vertex_end[0] are unused and 0 */
    uint16_t (*triangle)[3];     /* [triangle_count], corners in the finest state */
    uint32_t *vertex_end;        /* [step_count + 1], strictly increasing, last = vertex_count */
    uint32_t *triangle_end;      /* [step_count + 1], never decreasing, last = triangle_count */
    float *geometric_error;      /* [step_count + 1], never increasing */
    float *appearance_error;     /* [step_count + 1], never increasing */
    strl_palette_entry *palette; /* [palette_count] */
} strl_pm;

/* Gives the mesh its arrays, from the arena and unset: the four counts are set and within the limits above. False
 * without memory. */
bool strl_pm_create(strl_pm *pm, bool has_colours, bool has_palette_indices, bool has_texcoords, strl_arena *arena);

/* Checks every invariant that this file states (of the limit of moves only the moved corners): counts, order, errors,
 * indices, one position per step, no degenerate triangle in any state, each step's triangles hold one of its vertices.
 * Allocates nothing. Time is bounded by the limits above. */
strl_status strl_pm_check(const strl_pm *pm, strl_error *err);

#endif
