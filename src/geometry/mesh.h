/* A piece of a model in memory while it is built: points (topological vertices, one per lattice position), wedges (a point
 * with one set of attributes: the render vertices) and triangles. Plain arrays, owned by an arena. */
#ifndef STRL_GEOMETRY_MESH_H
#define STRL_GEOMETRY_MESH_H

#include <stdbool.h>
#include <stdint.h>

#include "base/memory.h"

/* Attributes that wedges of one point may differ in. */
typedef struct strl_wedge {
    uint32_t point;     /* index into the mesh's points */
    uint16_t normal[2]; /* octahedral, 10 bits each */
    uint32_t colour;    /* sRGB-encoded RGBA8, R lowest byte */
    uint32_t palette;   /* opaque: wedges of different palette are never merged into one */
} strl_wedge;

/* Point flags. */
#define STRL_POINT_KEPT 1u    /* must not be removed: another node has it too, or the caller says so */
#define STRL_POINT_OUTSIDE 2u /* known to nodes outside the piece: it must not get into parts that do not have it yet */

typedef struct strl_mesh {
    uint32_t point_count, wedge_count, triangle_count;
    int32_t (*position)[3];  /* [point_count] lattice units from an anchor */
    uint8_t *flags;          /* [point_count] STRL_POINT_... */
    uint8_t *holders;        /* [point_count] a bit for each part of the piece that has the point; NULL = one part */
    strl_wedge *wedge;       /* [wedge_count] */
    uint32_t (*triangle)[3]; /* [triangle_count] wedges, counter-clockwise; three different points */
    float *error;            /* [triangle_count] bound of the distance that this piece of surface has moved so far, lattice units */
    float *deviation;        /* [triangle_count] how much its attributes have changed so far, 0..1 */
    float *shift;            /* [triangle_count] appearance error so far, lattice units */
} strl_mesh;

/* Allocates all arrays for the given counts (contents undefined, flags zero). False without memory. */
bool strl_mesh_create(strl_mesh *mesh, uint32_t points, uint32_t wedges, uint32_t triangles, strl_arena *arena);

#endif
