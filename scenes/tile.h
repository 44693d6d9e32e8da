/* One tile of the isosurface: up to 63^3 grid cells, extracted on its own, in any order and on any thread.
 *
 * Tiles share the vertices on their common faces without talking to each other. A vertex on a face, or on a line where
 * four tiles meet, belongs to the tile on the lower side; it is the n-th of its face or line in scan order (z, then y,
 * then x, edges along x before those along y, then those along z). The neighbour scans the same samples in the same
 * order, so it knows n; it cannot know where the owner's block starts in the file. So a corner of a triangle is a pair
 * (block, n) until the tiles are numbered in order. */
#ifndef STRL_SCENES_TILE_H
#define STRL_SCENES_TILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "scenes/marching.h"
#include "scenes/mixing_field.h"
#include "stroll/error.h"

enum {
    STRL__TILE_CELLS = 63, /* along an axis: a row of corners is one 64-bit mask */

    /* Blocks of vertices. A tile owns the first seven: inside, on its upper face of axis a, on its upper line along
       axis a. */
    STRL__BLOCK_INSIDE = 0,
    STRL__BLOCK_FACE = 1,
    STRL__BLOCK_LINE = 4,
    STRL__BLOCKS_OWN = 7,
    /* Those of its lower neighbours: the face of the one below along a; the lines along a of the one below along both
     * other axes, and along the first and the second of them alone. */
    STRL__BLOCK_BELOW_FACE = 7,
    STRL__BLOCK_BELOW_LINE = 10, /* + 3 a + 0, 1, 2 */
    STRL__BLOCKS = 19,

    STRL__BLOCK_SHIFT = 27 /* a corner is block << 27 | n */
};

/* A grid of cubes: its corner at the origin, step model units per cell. */
typedef struct strl__grid {
    uint64_t cells[3];
    uint64_t tiles[3];
    double step;
} strl__grid;

typedef struct strl__tile_block {
    float *vertices; /* 3 or 6 floats each */
    size_t count;
    size_t capacity; /* floats */
} strl__tile_block;

/* What is extracted. Zero-initialise; reused from tile to tile. */
typedef struct strl__tile_mesh {
    strl__tile_block blocks[STRL__BLOCKS_OWN];
    uint32_t *corners; /* three per triangle */
    size_t triangles;
    size_t corner_capacity;
} strl__tile_mesh;

void strl__tile_mesh_deinit(strl__tile_mesh *mesh);

/* Working memory of one thread: about 5 MB. */
typedef struct strl__tile_scratch {
    strl__field_scratch field;
    uint64_t inside[2][STRL__TILE_CELLS + 1]; /* sign masks of the two slices in use, by y */
    uint32_t corners[5][64 * 64];             /* vertices on edges along x, y (two slices each) and z */
} strl__tile_scratch;

/* The axes other than `axis`, lower one first. */
static inline unsigned strl__axis_first(unsigned axis)
{
    return axis == 0 ? 1 : 0;
}
static inline unsigned strl__axis_second(unsigned axis)
{
    return axis == 2 ? 1 : 2;
}

/* Extracts tile (x, y, z). STRL_ERR_MEMORY where the mesh cannot grow. */
strl_status strl__tile_extract(const strl__field *field, const strl__grid *grid, const uint64_t tile[3], bool normals,
                               const strl__cube_table *table, strl__tile_scratch *scratch, strl__tile_mesh *mesh,
                               strl_error *err);

/* Counts the triangles in a box of cells (at most 63 along an axis) that starts at cell `first` of a grid of this step.
 */
uint64_t strl__tile_count(const strl__field *field, double step, const int64_t first[3], const unsigned cells[3],
                          const strl__cube_table *table, strl__tile_scratch *scratch);

#endif
