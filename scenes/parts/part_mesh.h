/* The mesh of one part, put together of closed solids that face outward: each solid is watertight by itself, where
 * vertices at one place count as one (they are split where the normal breaks). Shapes are put through `place`, a
 * rotation and a move. A growing array that finds no memory sets `failed`, and everything after it does nothing. */
#ifndef STRL_SCENES_PARTS_PART_MESH_H
#define STRL_SCENES_PARTS_PART_MESH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "scenes/parts/affine.h"

enum { STRL__PART_VERTEX_FLOATS = 6, STRL__OUTLINE_MOST = 12 };

typedef struct strl__part_mesh {
    float *vertices; /* position and unit normal; owned */
    size_t float_capacity;
    uint32_t *corners; /* owned */
    size_t corner_capacity;
    uint32_t vertex_count;
    uint32_t triangle_count;
    strl__affine place;
    bool failed;
} strl__part_mesh;

/* Empties the mesh; its arrays stay. A zero mesh is an empty one. */
void strl__part_mesh_clear(strl__part_mesh *mesh);
void strl__part_mesh_deinit(strl__part_mesh *mesh);
uint32_t strl__part_mesh_vertex(strl__part_mesh *mesh, const double position[3], const double normal[3]);
void strl__part_mesh_triangle(strl__part_mesh *mesh, uint32_t a, uint32_t b, uint32_t c);
void strl__part_mesh_quad(strl__part_mesh *mesh, uint32_t a, uint32_t b, uint32_t c, uint32_t d);

/* 12 triangles. */
void strl__part_box(strl__part_mesh *mesh, const double low[3], const double high[3]);
/* The same with its middle and its three sides. */
void strl__part_block(strl__part_mesh *mesh, const double middle[3], double x, double y, double z);

/* A plane figure, counter-clockwise, and how it is cut into triangles. */
typedef struct strl__outline {
    int count;
    double points[STRL__OUTLINE_MOST][2];
    uint8_t caps[STRL__OUTLINE_MOST - 2][3];
} strl__outline;

strl__outline strl__outline_i(double width, double depth, double flange, double web); /* middle at 0 */
strl__outline strl__outline_channel(double width, double depth, double thick);        /* open to +y; stands on 0 */
strl__outline strl__outline_angle(double side, double thick);                         /* corner at 0 */
strl__outline strl__outline_round(int count, double radius);                          /* hexagons and such */

/* From z = 0 to z = length: 4 count - 4 triangles. */
void strl__part_prism(strl__part_mesh *mesh, const strl__outline *outline, double length);

/* A point of a profile that is turned about z. Between smooth points the surface is shaded as round. */
typedef struct strl__turn_point {
    double radius, z;
    bool smooth;
} strl__turn_point;

/* Closed: it begins and ends at radius 0, or `ring` joins the last point to the first. The inside lies to the left of
 * the way from the first point to the last. */
void strl__part_turned(strl__part_mesh *mesh, const strl__turn_point *points, int count, bool ring, int sides);
/* A cylinder about z with flat ends. */
void strl__part_disc(strl__part_mesh *mesh, double radius, double low, double high, int sides);
/* A ring about z of rectangular section. */
void strl__part_ring(strl__part_mesh *mesh, double inner, double outer, double low, double high, int sides);

/* One circle of a swept pipe; u x v is the way ahead, both of length 1. */
typedef struct strl__sweep_ring {
    double middle[3], u[3], v[3];
} strl__sweep_ring;

/* With flat ends: 2 sides (count - 1) + 2 (sides - 2) triangles; `closed` joins the last ring to the first instead. */
void strl__part_sweep(strl__part_mesh *mesh, const strl__sweep_ring *rings, int count, double radius, int sides,
                      bool closed);
/* A straight bar from one point to another: 4 sides - 4 triangles. */
void strl__part_bar(strl__part_mesh *mesh, const double from[3], const double to[3], double radius, int sides);
/* From the origin along z, bending towards +x about (bend, 0, 0) by a part of a turn. */
void strl__part_bend(strl__part_mesh *mesh, double bend, double turns, double radius, int sides, int steps);
/* A torus about z. */
void strl__part_torus(strl__part_mesh *mesh, double ring, double radius, int sides, int steps);
/* A bolt on z from its head at `low` to its nut at `high`. */
void strl__part_bolt(strl__part_mesh *mesh, double radius, double low, double high);

/* A vertex in the world: its position, and its normal of length 1. */
void strl__part_vertex_in_world(const strl__part_mesh *mesh, uint32_t vertex, const strl__affine *world,
                                double position[3], double normal[3]);

#endif
