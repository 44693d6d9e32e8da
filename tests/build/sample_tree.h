/* Building sample trees in the test's folder (built.h), and what every one of them must be, whatever the model. */
#ifndef STRL_TESTS_BUILD_SAMPLE_TREE_H
#define STRL_TESTS_BUILD_SAMPLE_TREE_H

#include "build/built.h"
#include "support/brick.h"

/* Names are of files in the folder; desc->inputs and output are set here. Fails the test where the build fails. */
strl_build_result sample_tree_build(const char *input, const char *output, strl_build_desc desc);

/* Records and bricks are as docs/format.md and docs/format-payload.md say: one error a node that does not grow
 * downwards, boxes that nest, levels, runs and splats in their ranges, counts that add up. */
void sample_tree_check(const char *name);
/* Its bricks are, as a multiset, the triangles of the mesh on the lattice: corners in their turning order, with their
 * colours. Those of which two corners fall together are left out. */
void sample_tree_compare(const char *name, const mesh_file *mesh);
/* What `stroll verify --against` looks at. */
void sample_tree_verify(const char *name, const char *input);
/* The whole of it: the mesh is written, built, checked, compared and verified. */
strl_build_result sample_tree_prove(const mesh_file *mesh);

/* All triangles of all bricks, sorted, each turned so that its least corner is first: x, y, z, colour of each. malloc.
 */
typedef int64_t sample_tree_triangle[3][4];
sample_tree_triangle *sample_tree_triangles(const char *name, uint64_t *count);
void sample_tree_sort(sample_tree_triangle *triangle, uint64_t count);
bool sample_trees_equal(const char *a, const char *b);

#endif
