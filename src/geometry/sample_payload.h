/* What stands before the mesh in a payload of a sample tree: splats, and which triangles are drawn beside them
 * (docs/format-payload.md, "Bricks"). */
#ifndef STRL_GEOMETRY_SAMPLE_PAYLOAD_H
#define STRL_GEOMETRY_SAMPLE_PAYLOAD_H

#include "base/cursor.h"
#include "base/memory.h"
#include "stroll/error.h"

/* Stands for all that lies in a cell of the octree. */
typedef struct strl_splat {
    int32_t centre[3];  /* of what lies in it, lattice units from the node's anchor */
    uint8_t side;       /* of the cell: 2^side lattice units */
    uint8_t coverage;   /* 255 = as much as a wall through the cell */
    uint8_t normal[2];  /* octahedral, of both sides */
    uint8_t parallel;   /* 255 = all faces are parallel, 0 = any direction */
    uint32_t rgba;      /* mean colour, sRGB-encoded */
} strl_splat;

#define STRL_SPLAT_BYTES 21u /* in a payload */
#define STRL_MAX_SPLATS 8u
/* First byte of such a payload; that of a mesh's is 1. */
#define STRL_BRICK_VERSION 2u

/* The front part of a payload. */
typedef struct strl_sample_head {
    uint32_t splat_count;
    strl_splat splat[STRL_MAX_SPLATS];
    uint32_t run_count;   /* of triangles in the order of the mesh: of splats, large, of splats, ... */
    const uint32_t *run;  /* [run_count] borrowed; none = all are of splats */
} strl_sample_head;

/* Appends it. */
void strl_sample_head_write(const strl_sample_head *head, strl_writer *writer);
/* *bytes: its length; the mesh's payload follows. Runs come from arena. triangles: of the mesh, which runs must sum up to. */
strl_status strl_sample_head_read(const void *data, size_t size, uint32_t triangles, strl_arena *arena, strl_sample_head *head,
                                  size_t *bytes, strl_error *err);

#endif
