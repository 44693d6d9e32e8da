/* Internal to simplify*.c: planning one collapse. */
#ifndef STRL_GEOMETRY_SIMPLIFY_PLAN_H
#define STRL_GEOMETRY_SIMPLIFY_PLAN_H

#include "geometry/simplify_star.h"

/* Never negative. */
double strl__quadric_at(const quadric *q, const double p[3]);
void strl__quadric_add(quadric *to, const quadric *other);
/* The squared distance to the plane through `on` with unit normal n, times weight. */
void strl__quadric_add_plane(quadric *q, const double n[3], const double on[3], double weight);

/* Whether the present rung allows the collapse of the star's point to one of its neighbours. */
bool strl__may_collapse(simplifier *s, const strl_star *star, uint32_t to);
/* The best collapse of a point to one of its neighbours; false where none is allowed on the present rung. */
bool strl__plan_best(simplifier *s, uint32_t point, collapse_plan *plan);
/* The cost of a given collapse, allowed or not. */
void strl__plan_collapse(simplifier *s, const strl_star *star, uint32_t to, collapse_plan *plan);

/* Some triangle must stay at v after u -> v, or the surface there would be lost altogether. */
bool strl__leaves_surface_at(const simplifier *s, const strl_star *star, uint32_t to);
/* Carries out a planned collapse of the star's point and records it. */
void strl__apply_collapse(simplifier *s, const strl_star *star, const collapse_plan *plan, strl_simplified *result);
/* Rungs DISJOINT and CLUSTERING, with cells and errors up to `limit`. False without memory. */
bool strl__simplify_clustering(simplifier *s, float limit, strl_arena *arena, strl_simplified *result);

#endif
