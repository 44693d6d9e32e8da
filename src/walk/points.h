/* The points of a frame on their way from the front's bricks into a draw list: splats of a placement are counted, then
 * made, for an item of each size; those of a placement that shows few are merged with others', or each of very many
 * copies would cost draws. */
#ifndef STRL_WALK_POINTS_H
#define STRL_WALK_POINTS_H

#include "walk/internal.h"

typedef enum strl__points_purpose {
    STRL__POINTS_COUNT,
    STRL__POINTS_MAKE, /* into walk->points, relative to the least corner of the tree's box */
    STRL__POINTS_MERGE /* into walk->merged, on the lattice of the far points */
} strl__points_purpose;

/* Points of one placement. */
typedef struct strl__points {
    strl_walk *walk;
    const strl_view *view;
    const strl__placement *placed;
    const strl_tree *tree; /* points are relative to the least corner of its box, in which all lie */
    strl__points_purpose purpose;
    float sight[3];               /* direction to the brick in the tree's space, of length 1 */
    double unit_share;            /* of a point, what the side of a cell of one lattice unit takes */
    size_t at[STRL__POINT_SIZES]; /* how many so far, or where the next goes */
    uint64_t work;                /* that may still be done to close holes, see splats.c */
    double rows[3][4];            /* to be merged: from positions to cells of the far points' lattice, */
    float turn[9];                /* and of normals, row-major */
    bool failed;                  /* there was no memory to merge */
} strl__points;

#define STRL__HOLE_WORK ((uint64_t)4 << 20) /* of a frame: at most half a million points */

/* splats.c: the points of the front's items [first, end), which are of one placement. */
void strl__points_take(strl__points *self, size_t first, size_t end);

/* points.c */
double strl__points_px(const strl_walk *walk, unsigned size);
/* normal: of length 1, in the tree's space. */
void strl__points_merge(strl__points *self, unsigned size, const strl_vertex *point, const float normal[3]);

#endif
