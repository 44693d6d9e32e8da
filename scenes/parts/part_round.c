/* See part_mesh.h: what is turned about an axis or swept along a way. */
#include "scenes/parts/part_mesh.h"

/* Normals of a profile lie in its plane: across the segment from a to b, to its right. */
static void profile_normal(const strl__turn_point *a, const strl__turn_point *b, double normal[2])
{
    double vector[3] = {b->z - a->z, a->radius - b->radius, 0};
    strl__normalise(vector);
    normal[0] = vector[0];
    normal[1] = vector[1];
}

static uint32_t put_ring(strl__part_mesh *mesh, const strl__turn_point *point, const double normal[2], int sides)
{
    uint32_t first = mesh->vertex_count;
    for (int i = 0; i < sides; i++) {
        double c, s;
        strl__circle_step(i, sides, &c, &s);
        const double at[3] = {point->radius * c, point->radius * s, point->z};
        const double out[3] = {normal[0] * c, normal[0] * s, normal[1]};
        strl__part_mesh_vertex(mesh, at, out);
    }
    return first;
}

/* A band between two rings; a ring of radius 0 is a pole. */
static void put_band(strl__part_mesh *mesh, uint32_t low, uint32_t high, int sides, bool low_pole, bool high_pole)
{
    for (uint32_t i = 0; i < (uint32_t)sides; i++) {
        uint32_t next = i + 1 < (uint32_t)sides ? i + 1 : 0;
        if (low_pole)
            strl__part_mesh_triangle(mesh, low + i, high + next, high + i);
        else if (high_pole)
            strl__part_mesh_triangle(mesh, low + i, low + next, high + i);
        else
            strl__part_mesh_quad(mesh, low + i, low + next, high + next, high + i);
    }
}

/* The normal at one end of segment `at`: that of the segment, or at a smooth point the mean of both. */
static void end_normal(const strl__turn_point *points, int count, bool ring, int at, bool high, double normal[2])
{
    int point = (at + high) % count, other = (at + (high ? 1 : count - 1)) % count;
    double own[2], next[2], mean[3] = {0};
    profile_normal(&points[at], &points[(at + 1) % count], own);
    normal[0] = own[0];
    normal[1] = own[1];
    bool is_end = !ring && (point == 0 || point == count - 1);
    if (!points[point].smooth || is_end)
        return;
    profile_normal(&points[other], &points[(other + 1) % count], next);
    mean[0] = own[0] + next[0];
    mean[1] = own[1] + next[1];
    if (strl__normalise(mean) > 0) {
        normal[0] = mean[0];
        normal[1] = mean[1];
    }
}

void strl__part_turned(strl__part_mesh *mesh, const strl__turn_point *points, int count, bool ring, int sides)
{
    uint32_t high = 0;
    for (int i = 0; i < (ring ? count : count - 1); i++) {
        const strl__turn_point *a = &points[i], *b = &points[(i + 1) % count];
        double normal[2];
        uint32_t low = high;
        if (i == 0 || !a->smooth) {
            end_normal(points, count, ring, i, false, normal);
            low = put_ring(mesh, a, normal, sides);
        }
        end_normal(points, count, ring, i, true, normal);
        high = put_ring(mesh, b, normal, sides);
        put_band(mesh, low, high, sides, a->radius == 0, b->radius == 0);
    }
}

void strl__part_disc(strl__part_mesh *mesh, double radius, double low, double high, int sides)
{
    const strl__turn_point points[] = {{0, low, false}, {radius, low, false}, {radius, high, false}, {0, high, false}};
    strl__part_turned(mesh, points, 4, false, sides);
}

void strl__part_ring(strl__part_mesh *mesh, double inner, double outer, double low, double high, int sides)
{
    const strl__turn_point points[] = {
        {inner, low, false}, {outer, low, false}, {outer, high, false}, {inner, high, false}};
    strl__part_turned(mesh, points, 4, true, sides);
}

/* ---- swept circles ---- */

static uint32_t put_circle(strl__part_mesh *mesh, const strl__sweep_ring *ring, double radius, int sides,
                           const double *flat)
{
    uint32_t first = mesh->vertex_count;
    for (int i = 0; i < sides; i++) {
        double c, s, at[3], out[3];
        strl__circle_step(i, sides, &c, &s);
        for (int k = 0; k < 3; k++) {
            out[k] = c * ring->u[k] + s * ring->v[k];
            at[k] = ring->middle[k] + radius * out[k];
        }
        strl__part_mesh_vertex(mesh, at, flat ? flat : out);
    }
    return first;
}

static void put_end(strl__part_mesh *mesh, const strl__sweep_ring *ring, double radius, int sides, bool last)
{
    double ahead[3];
    strl__cross(ring->u, ring->v, ahead);
    for (int k = 0; k < 3 && !last; k++)
        ahead[k] = -ahead[k];
    uint32_t first = put_circle(mesh, ring, radius, sides, ahead);
    for (uint32_t i = 1; i + 1 < (uint32_t)sides; i++)
        strl__part_mesh_triangle(mesh, first, first + i + !last, first + i + last);
}

void strl__part_sweep(strl__part_mesh *mesh, const strl__sweep_ring *rings, int count, double radius, int sides,
                      bool closed)
{
    uint32_t first = put_circle(mesh, &rings[0], radius, sides, NULL), low = first;
    for (int i = 1; i < count; i++) {
        uint32_t high = put_circle(mesh, &rings[i], radius, sides, NULL);
        put_band(mesh, low, high, sides, false, false);
        low = high;
    }
    if (closed) {
        put_band(mesh, low, first, sides, false, false);
        return;
    }
    put_end(mesh, &rings[0], radius, sides, false);
    put_end(mesh, &rings[count - 1], radius, sides, true);
}

void strl__part_bar(strl__part_mesh *mesh, const double from[3], const double to[3], double radius, int sides)
{
    const double direction[3] = {to[0] - from[0], to[1] - from[1], to[2] - from[2]};
    const strl__affine frame = strl__affine_along(from, direction);
    strl__sweep_ring rings[2];
    for (int end = 0; end < 2; end++)
        for (int k = 0; k < 3; k++) {
            rings[end].middle[k] = end ? to[k] : from[k];
            rings[end].u[k] = frame.axis[0][k];
            rings[end].v[k] = frame.axis[1][k];
        }
    strl__part_sweep(mesh, rings, 2, radius, sides, false);
}

enum { BEND_STEPS_MOST = 32 };

void strl__part_bend(strl__part_mesh *mesh, double bend, double turns, double radius, int sides, int steps)
{
    strl__sweep_ring rings[BEND_STEPS_MOST + 1];
    steps = steps < BEND_STEPS_MOST ? steps : BEND_STEPS_MOST;
    for (int i = 0; i <= steps; i++) {
        double c, s;
        strl__circle(turns * i / steps, &c, &s);
        rings[i] = (strl__sweep_ring){{bend - bend * c, 0, bend * s}, {c, 0, -s}, {0, 1, 0}};
    }
    strl__part_sweep(mesh, rings, steps + 1, radius, sides, false);
}

void strl__part_torus(strl__part_mesh *mesh, double ring, double radius, int sides, int steps)
{
    strl__sweep_ring rings[BEND_STEPS_MOST];
    steps = steps < BEND_STEPS_MOST ? steps : BEND_STEPS_MOST;
    for (int i = 0; i < steps; i++) {
        double c, s;
        strl__circle_step(i, steps, &c, &s);
        rings[i] = (strl__sweep_ring){{ring * c, ring * s, 0}, {0, 0, 1}, {c, s, 0}};
    }
    strl__part_sweep(mesh, rings, steps, radius, sides, true);
}

void strl__part_bolt(strl__part_mesh *mesh, double radius, double low, double high)
{
    const strl__affine before = mesh->place;
    const strl__outline hexagon = strl__outline_round(6, radius * 1.8), shank = strl__outline_round(3, radius);
    const struct {
        const strl__outline *outline;
        double from, length;
    } pieces[] = {
        {&hexagon, low - radius * 1.3, radius * 1.3}, {&shank, low, high - low}, {&hexagon, high, radius * 1.5}};
    for (int i = 0; i < 3; i++) {
        const strl__affine move = strl__affine_move(0, 0, pieces[i].from);
        mesh->place = strl__affine_of(&before, &move);
        strl__part_prism(mesh, pieces[i].outline, pieces[i].length);
    }
    mesh->place = before;
}
