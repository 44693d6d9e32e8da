/* The table of marching cubes (Lorensen, Cline: Marching Cubes, 1987), built instead of copied, so that its two
 * promises can be read in one place:
 *  - on an ambiguous face the inside corners are always separated, so that two cubes agree on their common face;
 *  - no triangle has an edge across a cube's face other than the segments on which the neighbour agrees, so that every
 * edge of the surface belongs to exactly two triangles, and no triangle lies in a face (where it could have no area).
 * A vertex stands on a cube's edge, and at most one on each. */
#ifndef STRL_SCENES_MARCHING_H
#define STRL_SCENES_MARCHING_H

#include <stdint.h>

enum { STRL__CUBE_TRIANGLES_MAX = 5 };

/* Corner x + 2 y + 4 z. Edge 4 d + a + 2 b runs along axis d; a and b are its places on the other two axes, the lower
 * axis first. A set bit of the mask is an inside corner; triangles turn counter-clockwise seen from outside. */
typedef struct strl__cube_table {
    uint8_t triangles[256];
    uint8_t edges[256][3 * STRL__CUBE_TRIANGLES_MAX];
} strl__cube_table;

void strl__cube_table_init(strl__cube_table *table);

#endif
