/* What something looks like from so far away that it is a point: how much of it there is, its colour, the way its faces
 * lie. Of a tree it is in lattice units, of a placement or a run of them in world units. */
#ifndef STRL_GEOMETRY_FAR_H
#define STRL_GEOMETRY_FAR_H

#include "geometry/progressive.h"
#include "geometry/sample_payload.h"
#include "stroll/frame.h"

typedef struct strl_far {
    float area;         /* of its faces */
    uint32_t rgba;      /* mean, by area */
    uint16_t normal[2]; /* mean, octahedral; of faces, whichever their side */
    uint8_t spread;     /* how far they differ from it: 0 = they are parallel, to STRL_SPREAD_MOST = any direction */
} strl_far;

/* The share of a square that faces hide of which `seen` times as much is turned to the eye, `area` times as much with
 * their other sides. `along`: 1 = they are parallel, lie beside each other; 0 = of any direction, seen with half their
 * area, at random places, so that they hide each other. */
double strl_hidden_share(double area, double seen, double along);

/* Zero-initialise. */
typedef struct strl_far_sums {
    double area, linear[4], normal[3]; /* weighted by area; any direction, turned to one side, has half the length */
} strl_far_sums;

void strl_far_add(strl_far_sums *sums, const strl_far *far);
strl_far strl_far_end(const strl_far_sums *sums);
/* Of the finest state of a mesh, which is as much as its tree's root draws, or of the finest splats of a brick where
 * these have more. head: level_count 0 where it is none. */
strl_far strl_far_of_mesh(const strl_pm *mesh, const strl_brick_head *head);
/* By an affine transform that lengthens at most by `stretch`. */
strl_far strl_far_place(const strl_far *far, const double transform[12], double stretch);

#endif
