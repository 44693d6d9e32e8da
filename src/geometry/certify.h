/* Certificates: measured upper bounds of how far each state of a simplified mesh is from an older, finer surface, both
 * ways (after the error tracking of Klein, Liebich and Strasser 1996, with whole triangles in place of vertices).
 *
 * The older surface comes as pieces, each with a bound of its own distance from the input. Collapses are carried out
 * once more, in their order. What a collapse changes is measured at once: every piece that lay over a triangle of the
 * star against the triangles that are there now (`down`), every new triangle against the pieces over it (`up`), both by
 * geometry/cover.h. So each state is bounded, not only some stops, and a bound does not add up over collapses, because
 * it is measured against the same pieces every time. What chained bounds (geometry/simplify.h) say is near enough is
 * not measured. */
#ifndef STRL_GEOMETRY_CERTIFY_H
#define STRL_GEOMETRY_CERTIFY_H

#include "geometry/cover.h"
#include "geometry/simplify.h"

/* A triangle of an older surface, which may be a line or a point. */
typedef struct strl_piece {
    int32_t corner[3][3]; /* lattice units from the same anchor as the mesh */
    float claim;          /* its distance from the input, both ways */
} strl_piece;

typedef struct strl_certificate {
    /* [collapse_count + 1] after so many collapses: how far what the pieces stand for is from the mesh */
    float *down;
    float *up; /* [collapse_count + 1] how far the mesh is from what the pieces stand for */
    /* [triangles_left] at the end, in their old order: the same of what lies over each triangle, and of the triangle */
    float *triangle_down, *triangle_up;
} strl_certificate;

/* The older surface near the mesh. */
typedef struct strl_older {
    /* [count] those before `own` are what the mesh stands for; the others only show how far it is from them */
    const strl_piece *piece;
    uint32_t own, count;
    float granted; /* claimed whatever is measured: bounds up to that need not be tight */
} strl_older;

void strl_piece_facet(const strl_piece *piece, strl_facet *facet);

/* Neither down nor up ever decreases; INFINITY = nothing is known. Arrays live in the arena. */
strl_status strl_certify(const strl_mesh *mesh, const strl_simplified *simplified, const strl_older *older,
                         strl_arena *arena, strl_certificate *certificate, strl_error *err);

#endif
