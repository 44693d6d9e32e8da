/* Internal to simplify*.c: the state of a simplification and the star of a point. */
#ifndef STRL_GEOMETRY_SIMPLIFY_STAR_H
#define STRL_GEOMETRY_SIMPLIFY_STAR_H

#include "geometry/progressive.h"
#include "geometry/simplify.h"

#define STAR_MAX 64u /* triangles; a point with more is left alone */
#define CROWD_MAX 4096u /* triangles that collapses may gather at a point */
#define NO_INDEX UINT32_MAX

typedef struct quadric {
    double xx, xy, xz, yy, yz, zz, x, y, z, c; /* v'Av + 2 b'v + c */
} quadric;

/* The live triangles round one point. */
typedef struct strl_star {
    uint32_t point;
    uint32_t count;               /* triangles */
    uint32_t triangle[STAR_MAX];
    uint8_t corner[STAR_MAX];     /* which corner of the triangle is the point */
    uint32_t next[STAR_MAX];      /* the other two points, counter-clockwise: point, next, previous */
    uint32_t previous[STAR_MAX];
    uint32_t neighbour_count;
    uint32_t neighbour[2 * STAR_MAX]; /* different ones, in order of first appearance */
    uint8_t uses[2 * STAR_MAX];   /* triangles that hold the edge to that neighbour */
    bool on_boundary;             /* some edge is used by an odd number of triangles */
    bool manifold;                /* one closed or open fan */
    bool closed;                  /* the fan is closed */
    uint8_t order[STAR_MAX];      /* fan order of the triangles where manifold: next[order[i + 1]] == previous[order[i]] */
} strl_star;

/* What a collapse would do. */
typedef struct collapse_plan {
    uint32_t to;
    float geometric;  /* the error of the new patch, lattice units */
    float deviation;  /* the same of attributes */
    float shift;      /* appearance error of the new patch */
    float key;
} collapse_plan;

typedef struct candidate {
    float key;
    uint32_t point;
} candidate;

typedef struct simplifier {
    const strl_mesh *mesh;
    const strl_simplify_desc *desc;
    double (*position)[3];
    float (*normal)[3];     /* per wedge, decoded */
    float (*colour)[3];     /* per wedge, 0..1 */
    float (*normal_sum)[3]; /* per wedge, weighted by area, of it and all that fell onto it */
    quadric *quadrics;      /* per point */
    double *own_cost;       /* per point: its quadric at its own position */
    uint32_t *only_wedge;   /* per point: its wedge where it has just one; else NO_INDEX */
    uint32_t (*corner)[3];  /* current wedges */
    uint32_t (*point)[3];   /* their points */
    uint32_t *corner_next;  /* [3 * triangle_count] next corner at the same point */
    uint32_t *head, *tail;  /* per point, corners */
    uint32_t *degree;       /* per point: its live triangles */
    bool *dead;             /* per triangle */
    strl_drift *drift;      /* per triangle */
    float *deviation, *shift; /* per triangle */
    uint8_t *holders;       /* per point, a copy that follows the collapses; NULL where the mesh has none */
    uint32_t *stamp;        /* per point, against `tick` */
    uint32_t tick;
    uint32_t triangles_left;
    uint64_t moves;         /* of all collapses so far, see strl__moves_of */
    float free_key;         /* the largest key that was claimed before anything collapsed */
    strl_simplify_rung rung;
    /* candidates: a binary heap of points by key */
    candidate *heap;
    uint32_t heap_count;
    uint32_t *heap_at;      /* per point, NO_INDEX = not in the heap */
    collapse_plan *plan;    /* per point: the best collapse, valid where not stale */
    bool *stale;            /* per point: the neighbourhood changed since key was computed */
} simplifier;

static inline float strl__larger(float a, float b)
{
    return a > b ? a : b;
}

static inline uint32_t strl__corner_point(const simplifier *s, uint32_t triangle, unsigned corner)
{
    return s->point[triangle][corner];
}

/* What the collapse will cost who refines it, at most: the triangles at v once for each wedge of u (STRL_PM_MAX_MOVES). */
static inline uint64_t strl__moves_of(const simplifier *s, const strl_star *star, uint32_t to)
{
    return (uint64_t)star->count * (s->degree[to] + star->count);
}

/* Whether u -> v would gather too many triangles at v. */
static inline bool strl__crowds(const simplifier *s, const strl_star *star, uint32_t to)
{
    return s->degree[to] + star->count > CROWD_MAX || s->moves + strl__moves_of(s, star, to) > STRL_PM_MAX_MOVES;
}

/* Gathers the star of a point; dead corners met on the way are unlinked. False where it has more than STAR_MAX triangles. */
bool strl__star_gather(simplifier *s, uint32_t point, strl_star *star);
/* How many triangles hold the edge to `point` (0 = no neighbour). */
unsigned strl__star_uses(const strl_star *star, uint32_t point);
/* The wedge of v that a wedge of u falls onto. *exact: a triangle of the edge says so; else it is the one of v's that looks most
 * like it, of the same palette where the rung does not allow others. NO_INDEX = none. */
uint32_t strl__wedge_target(const simplifier *s, const strl_star *u_star, uint32_t to, uint32_t wedge, bool *exact);
/* What u -> v does to the surface round u. */
typedef struct collapse_drift {
    strl_drift of[STAR_MAX];  /* by index in the star; meaningless for triangles that vanish */
    strl_drift orphan;        /* of vanishing triangles that no triangle of the star takes over */
    uint32_t receiver[STAR_MAX], receivers; /* triangles at v that the orphans fall onto: their drifts must hold `orphan` too */
    uint32_t image;           /* index in the star of the triangle whose image holds u's; NO_INDEX = v itself */
    double weights[3];        /* of (v, next, previous) there */
    float longest;            /* the largest length */
} collapse_drift;

void strl__collapse_drift(const simplifier *s, const strl_star *star, uint32_t to, collapse_drift *result);
/* The largest changes where an old spoke crosses a new one; what u itself sees is not in them. */
typedef struct spoke_change {
    float colour; /* 0..1 */
    float normal; /* length of the difference of unit normals; 0 where u lies on a crease */
    float reach;  /* how far from v a point of the patch can be; 0 where nothing differs */
} spoke_change;

void strl__spoke_change(const simplifier *s, const strl_star *star, uint32_t to, spoke_change *change);
/* Gives the receivers what they take over, once the collapse is carried out. */
void strl__receive_orphans(simplifier *s, const collapse_drift *drift);

#endif
