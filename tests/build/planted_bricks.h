/* Copies of a sample tree's container with a lie in it, written anew by the container's writer, so that all checksums
 * are right. */
#ifndef STRL_TESTS_BUILD_PLANTED_BRICKS_H
#define STRL_TESTS_BUILD_PLANTED_BRICKS_H

#include "build/sample_tree.h"

/* What a lie sees of each node; it may change all three, the mesh by returning true. Triangles then lie in one run of
 * level 1. */
typedef bool (*brick_lie)(void *context, uint32_t id, strl_node *record, test_brick *brick, strl_pm *mesh);

/* Names are of files in the folder of built.h. */
void plant_bricks(const char *good, const char *bad, brick_lie lie, void *context);
/* The same with the tree in these places; of none it is placed once, as it is. */
void plant_placed_bricks(const char *good, const char *bad, brick_lie lie, void *context,
                         const strl_placement *placement, uint32_t count);
bool no_brick_lie(void *context, uint32_t id, strl_node *record, test_brick *brick, strl_pm *mesh);

#endif
