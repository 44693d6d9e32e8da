/* Edges of odd use: where a surface is open. Lattice coordinates. */
#ifndef STRL_TESTS_BUILD_OPEN_EDGES_H
#define STRL_TESTS_BUILD_OPEN_EDGES_H

#include <stddef.h>
#include <stdint.h>

typedef struct open_edge {
    int64_t low[3], high[3];
} open_edge;

/* Sorted: malloc. */
open_edge *list_open_edges(size_t count, const int64_t (*triangle)[3][3], size_t *open);
/* The ends of the open edges, each as often as it is one. Sorted: malloc. */
int64_t (*list_rim_points(size_t count, const int64_t (*triangle)[3][3], size_t *points))[3];
/* Fails the test where an open edge ends at a point that is none of the rim's. */
void assert_open_at_the_rim_only(size_t count, const int64_t (*triangle)[3][3], const int64_t (*rim)[3],
                                 size_t rim_count, uint32_t number);

#endif
