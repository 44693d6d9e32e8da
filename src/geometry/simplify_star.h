/* Internal to simplify*.c: the state of a simplification and the star of a point.
 *
 * What a plan reads of a point or a triangle lies in one cache line each: most of the time goes into reading stars. */
#ifndef STRL_GEOMETRY_SIMPLIFY_STAR_H
#define STRL_GEOMETRY_SIMPLIFY_STAR_H

#include "geometry/progressive.h"
#include "geometry/simplify.h"

#define STAR_MAX 64u /* triangles; a point with more is left alone */
#define RING_MAX (STAR_MAX + 1)
#define CROWD_MAX 4096u /* triangles that collapses may gather at a point */
/* of its corners are looked at in search of a wedge or a face: where ladder moves have gathered thousands, the
 * others are no better */
#define SCAN_MAX 256u
#define NO_INDEX UINT32_MAX

typedef struct quadric {
    double xx, xy, xz, yy, yz, zz, x, y, z, c; /* v'Av + 2 b'v + c */
} quadric;

/* What has become of a piece of surface, as numbers that only grow: the six sides of its drift (strl_drift; the lower
 * ones negated), then its attribute deviation and its appearance error. Eight of them, so that vector registers hold
 * it. */
typedef struct reach {
    float of[8];
} reach;
#define REACH_DEVIATION 6
#define REACH_SHIFT 7

/* A corner's name is its triangle * 4 + 0, 1 or 2. */
typedef struct face {
    uint32_t point[3];
    uint32_t next[3]; /* per corner: the next corner at the same point */
    reach reach;
    bool gone;         /* collapses have removed it */
    bool is_pulled;    /* its drift comes in part from its corners, see pull */
    uint8_t unused[6]; /* to the end of the cache line */
} face;

/* A triangle whose corners were moved in straight lines: a point of it goes by the mean of its corners' ways, weighted
 * by where it lies, so the largest of the three bounds it, not their sum. The triangle's drift is the sum of `before`
 * and that largest. */
typedef struct pull {
    float before[6];
    float corner[3][6];
} pull;

/* What a candidate's key says. */
enum {
    STATE_STALE,     /* the neighbourhood has changed since */
    STATE_ESTIMATED, /* about what a plan will cost */
    STATE_PLANNED    /* what its plan costs */
};

typedef struct site {
    double position[3];
    double own_cost;     /* its quadric at its own position */
    uint32_t head, tail; /* corners */
    uint32_t degree;     /* its live triangles */
    uint32_t only_wedge; /* its wedge where it has just one; else NO_INDEX */
    uint32_t palette;    /* of that wedge */
    uint32_t stamp;      /* against `tick` */
    uint8_t flags;       /* STRL_POINT_... */
    uint8_t holders;     /* follows the collapses; 0 where the mesh has none */
    uint8_t state;       /* STATE_... */
    bool in_heap;
} site;

/* Loops over a ring run in steps of so many, whatever its length, so that vector registers do them; what lies beyond
 * the ring's end is finite and not looked at. */
#define LANES 8u
#define RING_ROOM (2 * RING_MAX + 14)

static inline uint32_t strl__lanes(uint32_t n)
{
    return (n + LANES - 1) / LANES * LANES;
}

/* The fan of a manifold star, flattened; fan order throughout, which is that of the star's neighbours. Rings are stored
 * twice over, so that ring + v_at begins anywhere: a closed fan has n points and triangles, an open one n points and n
 * - 1 triangles; triangle i lies between points i and i + 1. */
typedef struct strl_fan {
    uint32_t n;
    uint8_t triangle[RING_ROOM]; /* index in the star; meaningless for an open fan's last */
    double x[3][RING_ROOM];      /* relative to the star's point */
    double cross[3][RING_ROOM];  /* x[i] times x[i + 1]: twice the area of triangle i */
    double axis[3][3];           /* the last one is the unit normal of the ring's polygon */
    bool has_axes;
    double flat[3][RING_ROOM]; /* along the axes */
} strl_fan;

/* The live triangles round one point. */
typedef struct strl_star {
    uint32_t point;
    uint32_t count; /* triangles */
    uint32_t triangle[STAR_MAX];
    uint8_t corner[STAR_MAX]; /* which corner of the triangle is the point */
    uint32_t next[STAR_MAX];  /* the other two points, counter-clockwise: point, next, previous */
    uint32_t previous[STAR_MAX];
    uint32_t neighbour_count;
    /* different ones; in fan order where manifold, else in order of first appearance */
    uint32_t neighbour[2 * STAR_MAX];
    uint8_t uses[2 * STAR_MAX]; /* triangles that hold the edge to that neighbour */
    uint32_t stamp;             /* neighbour i is stamped stamp + 1 + i until the next star is gathered */
    bool on_boundary;           /* some edge is used by an odd number of triangles */
    bool manifold;              /* one closed or open fan */
    bool closed;                /* the fan is closed */
    uint32_t wedge_count;
    uint32_t wedge[STAR_MAX]; /* the point's wedges in this star, different ones */
    strl_fan fan;             /* where manifold */
} strl_star;

/* What a collapse would do. */
typedef struct collapse_plan {
    uint32_t to;
    float geometric; /* the error of the new patch, lattice units */
    float deviation; /* the same of attributes */
    float shift;     /* appearance error of the new patch */
    float key;
} collapse_plan;

/* What u -> v does to the surface round u. */
typedef struct collapse_effect {
    reach of[STAR_MAX];      /* by index in the star, drift only; meaningless for triangles that vanish */
    reach all;               /* of the star before */
    bool straight;           /* the corners at u go to v in straight lines */
    float way[6];            /* then: that line's box, */
    bool is_mixed[STAR_MAX]; /* and which triangles of the star have taken over what others drifted */
    reach orphan;            /* of vanishing triangles that no triangle of the star takes over */
    /* triangles at v that the orphans fall onto: their drifts must hold `orphan` too */
    uint32_t receiver[STAR_MAX], receivers;
    uint32_t image;    /* index in the star of the triangle whose image holds u's; NO_INDEX = v itself */
    double weights[3]; /* of (v, next, previous) there */
    float longest;     /* the largest drift */
    /* the largest changes of attributes where an old spoke crosses a new one; what u itself sees is not in them */
    float spoke_colour; /* 0..1 */
    float spoke_normal; /* length of the difference of unit normals; 0 where u lies on a crease */
    float spoke_reach;  /* how far from v a point of the patch can be */
} collapse_effect;

/* A point below the bits of its key: keys are not negative, so their bits are ordered as they are, and ties go by
 * point. */
typedef uint64_t candidate;
#define NO_CANDIDATE UINT64_MAX
#define HEAP_WAYS 4u /* children of a candidate: half a cache line */

typedef struct simplifier {
    const strl_mesh *mesh;
    const strl_simplify_desc *desc;
    site *sites;            /* per point */
    quadric *quadrics;      /* per point */
    face *faces;            /* per triangle */
    pull *pulls;            /* per triangle, where is_pulled */
    uint32_t (*corner)[3];  /* per triangle: current wedges */
    float (*normal)[4];     /* per wedge, decoded; the last is 0 */
    float (*colour)[4];     /* per wedge, 0..1; the last is 0 */
    float (*normal_sum)[3]; /* per wedge, weighted by area, of it and all that fell onto it */
    strl_wedge *wedge;      /* the result's: the mesh's and those that collapses add */
    uint32_t wedge_count, wedge_room;
    bool has_colours; /* not all wedges are of one colour */
    uint32_t tick;
    uint32_t triangles_left;
    uint64_t moves;      /* of all collapses so far, see strl__moves_of */
    double diagonal;     /* of the points' box */
    float shortest_edge; /* of what is left when clustering last began */
    float least_left;    /* the least key that was above the limits of this round */
    float free_key;      /* the largest key that was claimed before anything collapsed */
    strl_simplify_rung rung;
    candidate *heap; /* the least first; NO_CANDIDATE after the last */
    uint32_t heap_count;
    collapse_plan *plan; /* per point: the best collapse, valid where not stale */
    /* per point: what its plan cost on the first rung and on later ones, if its neighbourhood has not changed since;
     * INFINITY = none was allowed, 0 = not known */
    float (*known)[2];
    /* the star that was planned last, with the effect of its plan: most plans are carried out at once */
    strl_star star;
    collapse_effect effect, other_effect;
} simplifier;

static inline double strl__distance2(const double a[3], const double b[3])
{
    double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return x * x + y * y + z * z;
}

static inline float strl__larger(float a, float b)
{
    return a > b ? a : b;
}

static inline void strl__forget_known(simplifier *s, uint32_t point)
{
    s->known[point][0] = s->known[point][1] = 0;
}

/* Never negative. */
static inline double strl__quadric_at(const quadric *q, const double p[3])
{
    double x = q->xx * p[0] + 2 * (q->xy * p[1] + q->xz * p[2] + q->x), y = q->yy * p[1] + 2 * (q->yz * p[2] + q->y);
    double value = x * p[0] + y * p[1] + (q->zz * p[2] + 2 * q->z) * p[2] + q->c;
    return value > 0 ? value : 0;
}

static inline void strl__unite(reach *to, const reach *other)
{
    for (unsigned k = 0; k < 8; k++)
        to->of[k] = strl__larger(to->of[k], other->of[k]);
}

static inline float strl__drift_squared(const reach *r)
{
    float x = strl__larger(r->of[0], r->of[3]), y = strl__larger(r->of[1], r->of[4]),
          z = strl__larger(r->of[2], r->of[5]);
    return x * x + y * y + z * z;
}

/* What the collapse will cost who refines it, at most: the triangles at v once for each wedge of u (STRL_PM_MAX_MOVES).
 */
static inline uint64_t strl__moves_of(const simplifier *s, const strl_star *star, uint32_t to)
{
    return (uint64_t)star->count * (s->sites[to].degree + star->count);
}

/* Whether u -> v would gather too many triangles at v. */
static inline bool strl__crowds(const simplifier *s, const strl_star *star, uint32_t to)
{
    return s->sites[to].degree + star->count > CROWD_MAX || s->moves + strl__moves_of(s, star, to) > STRL_PM_MAX_MOVES;
}

/* Gathers the star of a point; gone corners met on the way are unlinked. False where it has more than STAR_MAX
 * triangles. */
bool strl__star_gather(simplifier *s, uint32_t point, strl_star *star);
/* How many triangles hold the edge to `point` (0 = no neighbour). The star must be the one gathered last. */
static inline unsigned strl__star_uses(const simplifier *s, const strl_star *star, uint32_t point)
{
    uint32_t stamp = s->sites[point].stamp;
    return stamp > star->stamp ? star->uses[stamp - star->stamp - 1] : 0;
}
/* Which neighbour of the star the point is; NO_INDEX where it is none. Same condition. */
static inline uint32_t strl__neighbour_at(const simplifier *s, const strl_star *star, uint32_t point)
{
    uint32_t stamp = s->sites[point].stamp;
    return stamp > star->stamp ? stamp - star->stamp - 1 : NO_INDEX;
}
/* How a wedge of u finds its place at v. */
typedef enum wedge_fate {
    WEDGE_EXACT,  /* a triangle of the edge says which wedge of v goes on */
    WEDGE_LIKE,   /* it falls onto the one of v's that looks most like it */
    WEDGE_CARRIED /* none looks like it: v gets one more */
} wedge_fate;

/* The wedge of v that a wedge of u falls onto or, where it is carried, comes nearest to; of the same palette where the
 * rung does not allow others. NO_INDEX = none. */
uint32_t strl__wedge_target(const simplifier *s, const strl_star *u_star, uint32_t to, uint32_t wedge,
                            wedge_fate *fate);

/* The bound of u -> v and what it does to attributes (simplify_bound.c). */
void strl__collapse_effect(const simplifier *s, const strl_star *star, uint32_t to, collapse_effect *effect);
/* Gives the triangles that stay their new drifts, once the collapse is carried out. */
void strl__take_effect(simplifier *s, const strl_star *star, const collapse_plan *plan, const collapse_effect *effect);

#endif
