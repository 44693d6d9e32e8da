/* The growing mesh that encoder and decoder of a node payload keep alike: triangles of the current state, and for each
 * vertex the list of its triangles by falling number. Internal to the payload codec. */
#ifndef STRL_GEOMETRY_PAYLOAD_MESH_H
#define STRL_GEOMETRY_PAYLOAD_MESH_H

#include <stdbool.h>
#include <stdint.h>

#include "base/memory.h"
#include "geometry/payload_streams.h"
#include "geometry/progressive.h"

#define STRL__NONE 0xffffffffu

/* Corner k of triangle t has the number 4 t + k; every fourth is unused. */
#define STRL__CHUNK_CORNERS 14u

/* The newest corners at a vertex, oldest first: one cache line, which is enough for most. */
struct strl__chunk {
    uint32_t corner[STRL__CHUNK_CORNERS];
    uint32_t count;
    uint32_t older; /* a full chunk, or STRL__NONE */
};

struct strl__mesh {
    int32_t (*position)[3];
    uint64_t *triangle;                    /* [triangles], the corners a, b, c in 16 bits each, a lowest, and a again */
    struct strl__chunk *chunk;             /* vertex v's is number v; behind those of all vertices lie the older ones */
    uint32_t chunk_count, free_chunk;      /* older chunks come from a list of free ones, or from the end */
    uint16_t *twin;                        /* [vertices], rings of vertices known to share a position */
    uint32_t vertex_count, triangle_count; /* so far */
};

bool strl__mesh_init(struct strl__mesh *mesh, uint32_t vertices, uint32_t triangles, int32_t (*position)[3],
                     strl_arena *scratch);

/* (k + 1) % 3 and (k + 2) % 3 for k < 3, without a branch. */
static inline unsigned strl__next3(unsigned k)
{
    return 9u >> (2 * k) & 3;
}
static inline unsigned strl__last3(unsigned k)
{
    return 18u >> (2 * k) & 3;
}

/* Puts the full chunk of a vertex behind a new one. */
void strl__mesh_age_chunk(struct strl__mesh *mesh, uint32_t vertex);
/* Empties a vertex's list. */
void strl__mesh_clear(struct strl__mesh *mesh, uint32_t vertex);

static inline void strl__mesh_push_corner(struct strl__mesh *mesh, uint32_t corner, uint32_t vertex)
{
    struct strl__chunk *chunk = &mesh->chunk[vertex];
    if (chunk->count == STRL__CHUNK_CORNERS)
        strl__mesh_age_chunk(mesh, vertex);
    chunk->corner[chunk->count++] = corner;
}

static inline void strl__mesh_get_triangle(const struct strl__mesh *mesh, uint32_t t, uint16_t vertex[3])
{
    for (unsigned k = 0; k < 3; k++)
        vertex[k] = (uint16_t)(mesh->triangle[t] >> 16 * k);
}

/* A corner is another vertex from now on. */
static inline void strl__mesh_set_corner(struct strl__mesh *mesh, uint32_t corner, uint32_t vertex)
{
    static const uint64_t places[4] = {0x0001000000000001, 0x0000000000010000, 0x0000000100000000, 0};
    uint64_t place = places[corner & 3], *triangle = &mesh->triangle[corner >> 2];
    *triangle = (*triangle & ~(place * 0xffff)) | place * vertex;
}

static inline void strl__mesh_add_triangle(struct strl__mesh *mesh, uint32_t a, uint32_t b, uint32_t c)
{
    uint32_t t = mesh->triangle_count++;
    mesh->triangle[t] = a | (uint64_t)b << 16 | (uint64_t)c << 32 | (uint64_t)a << 48;
    strl__mesh_push_corner(mesh, 4 * t, a);
    strl__mesh_push_corner(mesh, 4 * t + 1, b);
    strl__mesh_push_corner(mesh, 4 * t + 2, c);
}

static inline bool strl__is_at(const int32_t p[3], const int32_t q[3])
{
    /* one branch: on coarse lattices the parts cannot be foreseen */
    return ((p[0] ^ q[0]) | (p[1] ^ q[1]) | (p[2] ^ q[2])) == 0;
}

static inline bool strl__same_position(const int32_t (*position)[3], uint32_t a, uint32_t b)
{
    return strl__is_at(position[a], position[b]);
}

static inline void strl__twin_join(uint16_t *twin, uint32_t ring, uint32_t vertex)
{
    twin[vertex] = twin[ring];
    twin[ring] = (uint16_t)vertex;
}

#define STRL__STAR_SMALL 8u

/* ---- the star of a vertex: its corners in the order of its list, each with a place from 0 ---- */
struct strl__star {
    uint32_t count;
    uint32_t *corner;    /* [count] */
    uint16_t (*wing)[2]; /* [count], x and y of the triangle (vertex, x, y) */
    uint8_t *moves;      /* [count], for the users of the star: the corner goes to the new vertex; false at first */
    uint32_t *begins;    /* [vertices + 1], the last place with this x; stale entries are recognised */
    uint32_t spare;      /* the entry of begins that is no vertex's */
};

/* Room for stars of up to `triangles`. */
bool strl__star_init(struct strl__star *star, uint32_t vertices, uint32_t triangles, strl_arena *scratch);

/* Sets a place; returns its x. */
static inline uint16_t strl__star_set(const struct strl__star *star, const uint64_t *triangle, uint32_t place,
                                      uint32_t corner)
{
    uint64_t wings = triangle[corner >> 2] >> (16 * strl__next3(corner & 3));
    star->corner[place] = corner;
    star->wing[place][0] = (uint16_t)wings;
    star->wing[place][1] = (uint16_t)(wings >> 16);
    return (uint16_t)wings;
}

/* Most stars are small: their loops run a fixed number of times, because the number of corners cannot be foreseen. What
 * lies past the count is a corner too, and means nothing. */
static inline void strl__star_build(struct strl__star *star, const struct strl__mesh *mesh, uint32_t vertex)
{
    const struct strl__chunk *chunk = &mesh->chunk[vertex];
    const struct strl__star own = *star; /* its pointers stay in registers */
    const uint64_t *triangle = mesh->triangle;
    uint32_t count = chunk->count;
    if (chunk->older == STRL__NONE && count <= STRL__STAR_SMALL) {
        for (uint32_t place = 0; place < STRL__STAR_SMALL; place++) {
            uint32_t is_there = 0u - (place < count);
            uint16_t x = strl__star_set(&own, triangle, place, chunk->corner[(count - 1 - place) & is_there]);
            own.begins[own.spare ^ ((own.spare ^ x) & is_there)] = place;
        }
        star->count = count;
        return;
    }
    count = 0;
    for (uint32_t c = vertex; c != STRL__NONE; c = mesh->chunk[c].older)
        for (uint32_t i = mesh->chunk[c].count; i-- > 0; count++)
            own.begins[strl__star_set(&own, triangle, count, mesh->chunk[c].corner[i])] = count;
    star->count = count;
}

/* Takes the corners at places for which star->moves is set out of the list of the star's vertex. */
static inline void strl__star_keep(const struct strl__star *star, struct strl__mesh *mesh, uint32_t vertex)
{
    struct strl__chunk *chunk = &mesh->chunk[vertex];
    const uint32_t *corner = star->corner;
    const uint8_t *moves = star->moves;
    uint32_t kept = 0, count = star->count;
    if (chunk->older != STRL__NONE) {
        strl__mesh_clear(mesh, vertex);
        for (uint32_t i = count; i-- > 0;)
            if (!moves[i])
                strl__mesh_push_corner(mesh, corner[i], vertex);
        return;
    }
    /* Without a branch on what moves: it cannot be foreseen. */
    for (uint32_t i = count; i > STRL__STAR_SMALL; i--) {
        chunk->corner[kept] = corner[i - 1];
        kept += moves[i - 1] ^ 1u;
    }
    for (uint32_t i = STRL__STAR_SMALL; i-- > 0;) {
        chunk->corner[kept] = corner[i];
        kept += (moves[i] ^ 1u) & (i < count);
    }
    chunk->count = kept;
}

/* The corners at `moved` places, for which star->moves is set, go from the star's vertex to another one; the last of
 * them comes to its front. Clears star->moves. False where the y of such a place is at the other vertex's position. */
static inline bool strl__star_move(struct strl__star *star, struct strl__mesh *mesh, uint32_t from, uint32_t to,
                                   const uint32_t *place, uint32_t moved)
{
    const int32_t(*position)[3] = (const int32_t(*)[3])mesh->position;
    const int32_t *there = position[to];
    uint8_t *moves = star->moves;
    bool sound = true;
    strl__star_keep(star, mesh, from);
    for (uint32_t i = 0; i < moved; i++) {
        uint32_t at = place[i], corner = star->corner[at];
        sound &= !strl__is_at(there, position[star->wing[at][1]]);
        moves[at] = 0;
        strl__mesh_set_corner(mesh, corner, to);
        strl__mesh_push_corner(mesh, corner, to);
    }
    return sound;
}

/* The place of the triangle that follows (vertex, x, y) round the vertex: the last with y for its x. STRL__NONE without
 * one. */
static inline uint32_t strl__star_follower(const struct strl__star *star, uint16_t y)
{
    uint32_t place = star->begins[y];
    return place < star->count && star->wing[place][0] == y ? place : STRL__NONE;
}

/* ---- how a step's vertex v splits from its parent u ----
 * An arc of triangles round u, from (u, a, .) to (u, ., b), moves to v. By the bits of its kind, a triangle (v, u, a)
 * closes the gap at its start and (v, b, u) that at its end. What is no arc is said corner by corner. */
enum { STRL__KIND_START = 1, STRL__KIND_END = 2, STRL__KIND_GENERAL = 4 };

/* Predicts a new vertex: the mean of its parent and `count` neighbours, in integers that wrap. */
struct strl__mean {
    uint32_t sum[3], count;
};

static inline void strl__mean_add(struct strl__mean *mean, const int32_t position[3])
{
    for (unsigned k = 0; k < 3; k++)
        mean->sum[k] += (uint32_t)position[k];
    mean->count++;
}

static inline void strl__mean_get(const struct strl__mean *mean, const int32_t parent[3], uint32_t predicted[3])
{
    /* 65536 / (count + 1): most have a few */
    static const uint16_t few[16] = {0,    32768, 21845, 16384, 13107, 10922, 9362, 8192,
                                     7281, 6553,  5957,  5461,  5041,  4681,  4369, 4096};
    int64_t scale = mean->count - 1 < 15 ? few[mean->count] : 65536u / (mean->count + 1);
    for (unsigned k = 0; k < 3; k++) {
        int32_t difference = (int32_t)(mean->sum[k] - mean->count * (uint32_t)parent[k]);
        predicted[k] = (uint32_t)parent[k] + (uint32_t)((difference * scale + 32768) >> 16);
    }
}

/* ---- attributes: predicted over the finest state ---- */
/* Integer normals of all vertices from the finest triangles; sums wrap. NULL without memory. */
uint64_t (*strl__normal_sums(const struct strl__mesh *mesh, strl_arena *scratch))[4];
void strl__normal_predict(const uint64_t sum[4], uint32_t most, uint32_t predicted[2]);

/* A normal's coordinate, 0 to 1023, in a payload whose coordinates go up to `most`, and back. */
static inline uint32_t strl__normal_narrow(uint32_t coordinate, uint32_t most)
{
    return most == 1023 ? coordinate : (coordinate * most + 511) / 1023;
}
static inline uint32_t strl__normal_widen(uint32_t narrow, uint32_t most)
{
    return most == 1023 ? narrow : (narrow * 1023 + most / 2) / most;
}

#endif
