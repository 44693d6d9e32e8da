/* Half-edge collapses in the order of the error that they would make claimable (Garland and Heckbert 1997 for the
 * choice of the target vertex; Cohen, Manocha and Olano 1997, successive mappings, for the bound).
 *
 * Every collapse u -> v carries a local bound of the two-sided distance between the patch before and after. Where both
 * patches are height fields over one polygon along the patch's normal, the bound is their largest difference in height,
 * which is attained at u or where an old spoke crosses a new one; everywhere, the way from u to v is a bound too,
 * because moving u linearly onto v maps the old patch onto the new one. These maps are chained: a triangle's drift is
 * the box that holds the drifts of the triangles it overlaps, plus its own move, so its length bounds the distance to
 * the start. Corners that were moved in straight lines count by the largest of a triangle's three, not by their sum. */
#ifndef STRL_GEOMETRY_SIMPLIFY_H
#define STRL_GEOMETRY_SIMPLIFY_H

#include "base/memory.h"
#include "geometry/mesh.h"
#include "stroll/error.h"

/* The ladder: what a collapse may do. The first rung goes as far as its errors stay in proportion; then all rungs take
 * turns up to one error, then up to twice that, and so on: a bolt may vanish before a wall is bent, and not after. Each
 * rung allows all that those before it allow. */
typedef enum strl_simplify_rung {
    STRL_SIMPLIFY_TOPOLOGY,  /* manifold stays manifold, seams collapse only along themselves */
    STRL_SIMPLIFY_SEAMS,     /* seams may end, non-manifold fans may collapse */
    STRL_SIMPLIFY_DISJOINT,  /* points of different components may merge without an edge between them */
    STRL_SIMPLIFY_CLUSTERING /* any two points of one cell of a growing grid may merge */
} strl_simplify_rung;

typedef struct strl_simplify_desc {
    uint32_t target_triangles; /* stop at this many or fewer */
    uint32_t soft_triangles;   /* with so many or fewer, do not pay many times the error for the rest */
    /* an error that pieces of a model are to end at alike: collapses up to it go on below the target, down to
     * least_triangles; dearer ones stop above it already, from most_triangles on; 0 = off */
    float even_error;
    uint32_t least_triangles, most_triangles;
    /* stop before a collapse whose error would pass this; lattice units; INFINITY = none */
    float error_limit;
    strl_simplify_rung last_rung; /* go no further down the ladder */
    float normal_weight;          /* attribute deviation of a normal that turned by one radian */
    float colour_weight;          /* the same of black to white */
} strl_simplify_desc;

typedef struct strl_collapse {
    uint32_t from, to;           /* points */
    uint32_t triangles_left;     /* after this collapse */
    float geometric, appearance; /* largest error of any triangle so far, never decreasing; lattice units */
    float own;                   /* largest geometric error of the triangles that it changed */
} strl_collapse;

/* What simplification did. Arrays live in the arena given. */
typedef struct strl_simplified {
    uint32_t collapse_count;
    strl_collapse *collapses; /* [collapse_count] in order */
    /* the mesh's, then those that came to be: where what a point shows fits nothing at the point that it falls onto,
     * its wedge goes with it (the rim of a plate onto the other side's, say) */
    uint32_t wedge_count;
    strl_wedge *wedge;      /* [wedge_count] */
    uint32_t *wedge_parent; /* [wedge_count] the wedge that a removed one fell onto; itself where it was kept */
    /* [wedge_count] octahedral: the mean over what fell onto the wedge, for the mesh after; the wedge's own where
     * its point is STRL_POINT_OUTSIDE, because others look at it too */
    uint16_t (*normal)[2];
    /* [triangle_count] index of the collapse that removed it; UINT32_MAX = still there */
    uint32_t *removed_at;
    uint32_t (*corner)[3];    /* [triangle_count] current wedges of the triangles still there */
    strl_drift *drift;        /* [triangle_count] of the triangles still there, as in strl_mesh */
    float *deviation, *shift; /* the same */
    uint32_t triangles_left;
    float geometric, appearance; /* largest over the triangles, at the end; at the start where nothing collapsed */
    strl_simplify_rung rung;     /* the furthest rung a collapse needed */
} strl_simplified;

/* Collapses points of `mesh` that are not STRL_POINT_KEPT. Deterministic. The mesh itself is not changed; results are
 * allocated from `arena`. */
strl_status strl_simplify(const strl_mesh *mesh, const strl_simplify_desc *desc, strl_arena *arena,
                          strl_simplified *result, strl_error *err);

#endif
