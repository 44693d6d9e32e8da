/* Which nodes show nothing but the backs of their faces, by the cones of their records. */
#ifndef STRL_WALK_FACING_H
#define STRL_WALK_FACING_H

#include "walk/internal.h"

/* The eye as a placement's tree sees it. Zero: nothing is known, so nothing faces away. */
typedef struct strl__facing {
    bool known, orthographic;
    double eye[3];   /* on the lattice; orthographic: the direction of view */
    double error[3]; /* it is off by no more along each axis */
} strl__facing;

strl__facing strl__facing_find(const strl_view *view, const strl_tree *tree, const double transform[12]);
/* Conservative: true only where no point of the record's box, as part of a face whose normal is in its cone, shows its
 * front. */
bool strl__faces_away(const strl__facing *facing, const strl_node *record);

#endif
