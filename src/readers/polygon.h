/* Triangulation of one polygon by its corners' positions. */
#ifndef STRL_READERS_POLYGON_H
#define STRL_READERS_POLYGON_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Corners of the largest polygon that the readers take. */
#define STRL__POLYGON_CORNERS_MAX 16384u

/* Scratch and result, grown on demand up to about 48 bytes for each corner of the largest polygon
 * seen. Zero-initialise. */
typedef struct strl__polygon {
    uint32_t *triangles; /* result: corner indices, 3 * (corner_count - 2) */
    double *plane;       /* u and v of each corner */
    uint32_t *previous, *next;
    uint32_t *reflex;
    uint8_t *is_reflex;
    size_t capacity; /* corners */
} strl__polygon;

void strl__polygon_deinit(strl__polygon *polygon);

/* Fills polygon->triangles with corner_count - 2 triangles in the polygon's orientation. A polygon
 * that is star-shaped from its first corner becomes a fan, others are ear-clipped on the plane of
 * the two axes that show most of them. positions: 3 finite doubles each, stride_bytes apart;
 * corner_count 3 .. STRL__POLYGON_CORNERS_MAX. A self-intersecting polygon still gives corner_count
 * - 2 triangles. False without memory. */
bool strl__polygon_triangulate(strl__polygon *polygon, const double *positions, size_t stride_bytes,
                               uint32_t corner_count);

/* The sign of the area of (a, b, c), exact unless products of coordinates overflow or underflow: >
 * 0 counterclockwise. */
double strl__orientation(const double a[2], const double b[2], const double c[2]);

#endif
