/* What something looks like from so far away that it is a point: how much of it there is, its colour, the way its faces lie. Of a
 * tree it is in lattice units, of a placement or a run of them in world units. */
#ifndef STRL_GEOMETRY_FAR_H
#define STRL_GEOMETRY_FAR_H

#include "geometry/progressive.h"
#include "geometry/sample_payload.h"

#define STRL_FAR_SPREAD_MOST 63u

typedef struct strl_far {
    float area; /* of its faces */
    uint32_t rgba; /* mean, by area */
    uint16_t normal[2]; /* mean, octahedral; of faces, whichever their side */
    uint8_t spread; /* how far they differ from it: 0 = they are parallel, to STRL_FAR_SPREAD_MOST = any direction */
} strl_far;

/* Zero-initialise. */
typedef struct strl_far_sums {
    double area, linear[4], normal[3]; /* weighted by area; any direction, turned to one side, has half the length */
} strl_far_sums;

void strl_far_add(strl_far_sums *sums, const strl_far *far);
strl_far strl_far_end(const strl_far_sums *sums);
/* Of the finest state of a mesh, which is as much as its tree's root draws, or of the finest splats of a brick where these have more. head: level_count 0 where it is none. */
strl_far strl_far_of_mesh(const strl_pm *mesh, const strl_brick_head *head);
/* By an affine transform that lengthens at most by `stretch`. */
strl_far strl_far_place(const strl_far *far, const double transform[12], double stretch);

#endif
