/* A piece of a model in memory while it is built: points (topological vertices, one per lattice position), wedges (a
 * point with one set of attributes: the render vertices) and triangles. Plain arrays, owned by an arena. */
#ifndef STRL_GEOMETRY_MESH_H
#define STRL_GEOMETRY_MESH_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "base/memory.h"

/* Attributes that wedges of one point may differ in. */
typedef struct strl_wedge {
    uint32_t point;     /* index into the mesh's points */
    uint16_t normal[2]; /* octahedral, 10 bits each */
    uint32_t colour;    /* sRGB-encoded RGBA8, R lowest byte */
    uint32_t texcoord;  /* two codes of 16 bits, u lowest */
    uint32_t palette;   /* opaque: wedges of different palette are never merged into one */
} strl_wedge;

/* Where the points of a piece of surface have gone since the start: every way from a point to its image lies in this
 * box. Boxes of successive moves add up, so moves to and fro do not count twice as they would as lengths. Lattice
 * units. */
typedef struct strl_drift {
    float least[3], most[3]; /* least <= 0 <= most */
} strl_drift;

/* The longest way in the box. */
static inline float strl_drift_length(const strl_drift *drift)
{
    float sum = 0;
    for (int k = 0; k < 3; k++) {
        float far = -drift->least[k] > drift->most[k] ? -drift->least[k] : drift->most[k];
        sum += far * far;
    }
    return sqrtf(sum) * (1 + 1e-6f); /* whatever the rounding, the length is a bound */
}

/* A sum of two floats times this is not below the true sum, whatever the rounding. */
#define STRL_ROUND_UP (1 + 2.4e-7f)

/* Point flags. */
#define STRL_POINT_KEPT 1u /* must not be removed: another node has it too, or the caller says so */
/* Known to nodes outside the piece: its attributes stay, and it must not get into parts that do not have it yet. */
#define STRL_POINT_OUTSIDE 2u

typedef struct strl_mesh {
    uint32_t point_count, wedge_count, triangle_count;
    int32_t (*position)[3];  /* [point_count] lattice units from an anchor */
    uint8_t *flags;          /* [point_count] STRL_POINT_... */
    uint8_t *holders;        /* [point_count] a bit for each part of the piece that has the point; NULL = one part */
    strl_wedge *wedge;       /* [wedge_count] */
    uint32_t (*triangle)[3]; /* [triangle_count] wedges, counter-clockwise; three different points */
    strl_drift *drift;       /* [triangle_count] of this piece of surface */
    float start_error;       /* lattice units: distance of the start from the input, to be added to every drift */
    /* no point can be further from the input than this: both lie in one box of such a diagonal; 0 = not known */
    float most_error;
    float *deviation; /* [triangle_count] how much its attributes have changed so far, 0..1 */
    float *shift;     /* [triangle_count] appearance error so far, lattice units */
} strl_mesh;

/* The geometric error of a surface that has drifted so far at most: lattice units. */
static inline float strl_mesh_error(const strl_mesh *mesh, float longest_drift)
{
    float error = longest_drift + mesh->start_error;
    return mesh->most_error > 0 && error > mesh->most_error ? mesh->most_error : error;
}

/* Allocates all arrays for the given counts (contents undefined, flags zero). False without memory. */
bool strl_mesh_create(strl_mesh *mesh, uint32_t points, uint32_t wedges, uint32_t triangles, strl_arena *arena);

#endif
