/* Internal to simplify*.c: planning one collapse. */
#ifndef STRL_GEOMETRY_SIMPLIFY_PLAN_H
#define STRL_GEOMETRY_SIMPLIFY_PLAN_H

#include "geometry/simplify_star.h"

void strl__quadric_add(quadric *to, const quadric *other);
/* The squared distance to the plane through `on` with unit normal n, times weight. */
void strl__quadric_add_plane(quadric *q, const double n[3], const double on[3], double weight);

/* Whether the present rung allows the collapse of the star's point to one of its neighbours. No star may have been
 * gathered since this one. */
bool strl__may_collapse(const simplifier *s, const strl_star *star, uint32_t to);
/* The best collapse of a point to one of its neighbours; false where none is allowed on the present rung. Its star and
 * effect stay in s->star and s->effect until the next. */
bool strl__plan_best(simplifier *s, uint32_t point, collapse_plan *plan);
/* The cost of a given collapse, allowed or not, and its effect. */
void strl__plan_collapse(const simplifier *s, const strl_star *star, uint32_t to, collapse_plan *plan,
                         collapse_effect *effect);

/* Sets up all of s but mesh and desc, from `work`, and the arrays of the result, from `arena`. False without memory. */
bool strl__simplify_load(simplifier *s, strl_arena *work, strl_arena *arena, strl_simplified *result);
/* What is left, into the result. */
void strl__simplify_store(const simplifier *s, strl_simplified *result);
/* Adds a corner to its point. */
void strl__append_corner(simplifier *s, uint32_t point, uint32_t corner);

/* Some triangle must stay at v after u -> v, or the surface there would be lost altogether. */
bool strl__leaves_surface_at(const simplifier *s, const strl_star *star, uint32_t to);
/* Carries out a planned collapse of the star's point and records it. */
void strl__apply_collapse(simplifier *s, const strl_star *star, const collapse_plan *plan,
                          const collapse_effect *effect, strl_simplified *result);
/* Rungs DISJOINT and CLUSTERING, with cells and errors up to `limit`. False without memory. */
bool strl__simplify_clustering(simplifier *s, float limit, strl_arena *arena, strl_simplified *result);

#endif
