/* The growing mesh that encoder and decoder of a node payload keep alike: triangles of the current state, and for each vertex
 * the list of its triangles by falling number. Internal to the payload codec. */
#ifndef STRL_GEOMETRY_PAYLOAD_MESH_H
#define STRL_GEOMETRY_PAYLOAD_MESH_H

#include <stdbool.h>
#include <stdint.h>

#include "base/memory.h"
#include "geometry/payload_streams.h"
#include "geometry/progressive.h"

#define STRL__NONE 0xffffffffu

struct strl__mesh {
    int32_t (*position)[3];
    uint16_t (*triangle)[4]; /* three corners; corner k of triangle t has the number 4 t + k */
    uint32_t *next;          /* [4 * triangles], the next corner at the same vertex, with a smaller number */
    uint32_t *first;         /* [vertices], first corner at a vertex */
    uint16_t *twin;          /* [vertices], rings of vertices known to share a position */
    uint32_t vertex_count, triangle_count; /* so far */
};

bool strl__mesh_init(struct strl__mesh *mesh, uint32_t vertices, uint32_t triangles, int32_t (*position)[3], strl_arena *scratch);

static inline unsigned strl__next3(unsigned k) { return k == 2 ? 0 : k + 1; }

static inline void strl__mesh_add_corner(struct strl__mesh *mesh, uint32_t corner, uint32_t vertex)
{
    mesh->triangle[corner >> 2][corner & 3] = (uint16_t)vertex;
    mesh->next[corner] = mesh->first[vertex];
    mesh->first[vertex] = corner;
}

static inline void strl__mesh_add_triangle(struct strl__mesh *mesh, uint32_t a, uint32_t b, uint32_t c)
{
    uint32_t corner = 4 * mesh->triangle_count++;
    strl__mesh_add_corner(mesh, corner, a);
    strl__mesh_add_corner(mesh, corner + 1, b);
    strl__mesh_add_corner(mesh, corner + 2, c);
}

static inline bool strl__same_position(const int32_t (*position)[3], uint32_t a, uint32_t b)
{
    const int32_t *p = position[a], *q = position[b];
    return !((p[0] ^ q[0]) | (p[1] ^ q[1]) | (p[2] ^ q[2]));
}

static inline void strl__twin_join(uint16_t *twin, uint32_t ring, uint32_t vertex)
{
    twin[vertex] = twin[ring];
    twin[ring] = (uint16_t)vertex;
}

/* ---- the star of a vertex ----
 * Its triangles in chains: triangle (u, x, y) is followed by the first listed (u, y, z), where it is itself the first listed
 * with y last. A chain is closed where it runs back into its first triangle. Spokes are the vertices x along a chain and, where
 * it is open, its last y. */
struct strl__chain {
    uint32_t first_triangle, triangles; /* places in `order` */
    uint32_t first_spoke;               /* place in `spoke`; an open chain has one spoke more than triangles */
    bool closed;
};

struct strl__star {
    uint32_t count;       /* triangles */
    uint32_t *corner;     /* [count], the corners at the vertex, by falling number */
    uint16_t (*wing)[2];  /* [count], x and y */
    uint32_t *order;      /* [count], places in `corner`, chain by chain */
    uint16_t *spoke;      /* [spoke_count] */
    uint32_t spoke_count;
    struct strl__chain *chain;
    uint32_t chain_count;
    uint8_t *moves;       /* [count], by place in `corner`: the corner goes to the new vertex */
    uint32_t *begins;     /* [vertices], scratch: first place with this x; stale entries are recognised */
    uint32_t *ends;       /* [vertices], scratch: first place with this y */
    uint32_t *link;       /* [count], scratch: the place that follows */
    uint8_t *placed;      /* [count], scratch */
};

/* Room for stars of up to `triangles`. */
bool strl__star_init(struct strl__star *star, uint32_t vertices, uint32_t triangles, strl_arena *scratch);
/* Fills star for `vertex`; moves is all false. */
void strl__star_build(struct strl__star *star, const struct strl__mesh *mesh, uint32_t vertex);

/* An arc of a chain: `triangles` triangles from local spoke `from`. */
struct strl__arc {
    const struct strl__chain *chain;
    uint32_t from, triangles;
};

/* Place in star->order of the arc's i-th triangle, and the arc's i-th spoke (0..triangles). */
static inline uint32_t strl__arc_place(const struct strl__arc *arc, uint32_t i)
{
    uint32_t local = arc->from + i;
    return arc->chain->first_triangle + (local >= arc->chain->triangles ? local - arc->chain->triangles : local);
}

static inline uint16_t strl__arc_spoke(const struct strl__star *star, const struct strl__arc *arc, uint32_t i)
{
    uint32_t local = arc->from + i;
    if (arc->chain->closed && local >= arc->chain->triangles)
        local -= arc->chain->triangles;
    return star->spoke[arc->chain->first_spoke + local];
}

/* Moves the corners marked in star->moves from the star's vertex to `vertex`; both lists keep their order. */
void strl__star_move(const struct strl__star *star, struct strl__mesh *mesh, uint32_t from, uint32_t vertex);

/* ---- how a step's vertex splits from its parent u ---- */
enum {
    STRL__KIND_CHAIN,   /* a whole chain moves, no new triangle */
    STRL__KIND_TAIL,    /* from a spoke a to the end of an open chain; new (v, u, a) */
    STRL__KIND_HEAD,    /* from the start of an open chain to a spoke b; new (v, b, u) */
    STRL__KIND_CUT,     /* from spoke a to spoke b; new (v, u, a) and (v, b, u) */
    STRL__KIND_GENERAL, /* all explicit */
    STRL__KIND_COUNT
};

/* Predicts a new vertex: the mean of its parent and `count` neighbours, in integers. */
struct strl__mean {
    int64_t sum[3]; /* of differences to the origin */
    uint32_t count;
};

static inline void strl__mean_add(struct strl__mean *mean, const int32_t origin[3], const int32_t position[3])
{
    for (unsigned k = 0; k < 3; k++)
        mean->sum[k] += (int64_t)position[k] - origin[k];
    mean->count++;
}

static inline void strl__mean_get(const struct strl__mean *mean, const int32_t origin[3], uint32_t predicted[3])
{
    uint32_t scale = 65536u / (mean->count + 1);
    for (unsigned k = 0; k < 3; k++)
        predicted[k] = (uint32_t)origin[k] + (uint32_t)((mean->sum[k] * (int64_t)scale + 32768) >> 16);
}

/* ---- attributes: predicted over the finest state ---- */
/* Integer normals of all vertices from the finest triangles; sums wrap. NULL without memory. */
uint64_t (*strl__normal_sums(const int32_t (*position)[3], uint32_t vertices, const uint16_t (*triangle)[4], uint32_t triangles,
                             strl_arena *scratch))[4];
void strl__normal_predict(const uint64_t sum[4], uint32_t predicted[2]);

#endif
