/* Distance from points to triangles, apart from the library's code: what the tests measure claimed errors with. */
#ifndef STRL_TESTS_BUILD_SURFACE_DISTANCE_H
#define STRL_TESTS_BUILD_SURFACE_DISTANCE_H

#include <stdint.h>

typedef struct surface_box {
    double least[3], most[3];
    uint32_t first, count; /* triangles of a leaf; count 0 = inner: the children are 2 i + 1 and 2 i + 2 */
} surface_box;

typedef struct surface {
    uint32_t count;
    double (*corner)[3][3]; /* [count] own copy, in the order of the tree */
    surface_box *box;       /* a complete binary tree */
    uint32_t levels;
} surface;

/* Copies `count` triangles. Fails the test without memory. */
void surface_create(surface *tree, uint32_t count, const double (*corner)[3][3]);
void surface_destroy(surface *tree);
/* Distance from p to the nearest triangle; INFINITY without triangles. A triangle may be a line or a point. */
double surface_distance(const surface *tree, const double p[3]);
/* The same by looking at every triangle. */
double surface_distance_slow(uint32_t count, const double (*corner)[3][3], const double p[3]);
/* The largest distance of the corners, the middles of edges and `samples` seeded points of each triangle to
 * the surface. */
double surface_reach(const surface *tree, uint32_t count, const double (*corner)[3][3], unsigned samples,
                     uint64_t seed);

#endif
