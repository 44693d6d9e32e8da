/* A container for tests: a height field, eight bisections deep, built in memory by the project's
 * own kernels, with dependency groups of one to three nodes on every level. The rim of the field is
 * kept, so that every state of every cut covers the same square. */
#ifndef GRID_MODEL_H
#define GRID_MODEL_H

#include <stddef.h>
#include <stdint.h>

#include "container/container.h"

#define GRID_QUADS 96     /* along a side */
#define GRID_SPACING 1024 /* lattice units between vertices */
#define GRID_DEPTH 8      /* bisections from root to leaves */
#define GRID_STEP 0x1p-10 /* model units a lattice unit: a quad is one unit wide */
#define GRID_LEAVES (1u << GRID_DEPTH)
#define GRID_NODES (2 * GRID_LEAVES - 1)

/* Writes the model into a file in the scratch directory and returns its bytes (the caller's,
 * strl__free). placements: 1, or 2 where the second stands beside the first, half as large. Fails
 * the running test on any error. */
uint8_t *grid_model_create(unsigned placements, size_t *size);

/* The vertex (row * (GRID_QUADS + 1) + column) at a lattice position; UINT32_MAX where there is
 * none. */
uint32_t grid_vertex_at(const int64_t position[3]);

#endif
