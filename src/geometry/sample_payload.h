/* What stands before the mesh in a payload of a sample tree: splats, and which triangles are drawn beside them
 * (docs/format-payload.md, "Bricks"). */
#ifndef STRL_GEOMETRY_SAMPLE_PAYLOAD_H
#define STRL_GEOMETRY_SAMPLE_PAYLOAD_H

#include "base/cursor.h"
#include "base/memory.h"
#include "geometry/octahedral.h"
#include "stroll/error.h"

/* Stands for all that lies in a cell of the octree. */
typedef struct strl_splat {
    int32_t centre[3]; /* of what lies in it, lattice units from the node's anchor; as of strl_splat_place */
    uint8_t side;      /* of the cell: 2^side lattice units */
    uint8_t coverage;  /* of the cell's side, as it is seen: 255 = as a wall through the cell */
    uint8_t normal[2]; /* octahedral, of both sides */
    uint8_t parallel;  /* 255 = all faces are parallel, 0 = any direction */
    uint32_t rgba;     /* mean colour, sRGB-encoded */
} strl_splat;

/* First byte of such a payload; that of a mesh's is 1. */
#define STRL_BRICK_VERSION 3u
#define STRL_BRICK_LEVELS 22u
#define STRL_BRICK_SPLATS 4096u
/* Of a cell: a 32nd of it is what 32 bits can say. */
#define STRL_SPLAT_MOST_SIDE 36u

/* A cell of side 1 covers at most sqrt(3) of an image, as much as a square of this side: the size of a cell is its side
 * times this. */
#define STRL_SQUARE_OF_CUBE 1.3160741

/* Centres are stored in units of 2^this, a 32nd of the cell's side. */
static inline unsigned strl_splat_shift(unsigned side)
{
    return side > 5 ? side - 5 : 0;
}
/* A centre's coordinate as it is stored: the middle of its unit. */
static inline int32_t strl_splat_place(int32_t centre, unsigned side)
{
    unsigned shift = strl_splat_shift(side);
    return shift ? (int32_t)((int64_t)(centre >> shift) * ((int64_t)1 << shift) + ((int64_t)1 << (shift - 1))) : centre;
}

/* Its normal as strl_oct_decode takes it, and as a direction of length 1. */
static inline void strl_splat_normal(const strl_splat *splat, uint16_t code[2])
{
    for (int k = 0; k < 2; k++)
        code[k] = (uint16_t)(splat->normal[k] * STRL_OCT_MAX / 255u);
}
static inline void strl_splat_line(const strl_splat *splat, float line[3])
{
    uint16_t code[2];
    strl_splat_normal(splat, code);
    strl_oct_decode(code, line);
}

/* Triangles that follow each other in the mesh and are of one level; the next run's is another one. */
typedef struct strl_brick_run {
    uint32_t level, count;
} strl_brick_run;

/* The front part of a payload. Level 0 are triangles that are always drawn; in state s those of levels up to s are, and
 * for what is finer the splats of level s + 1; in state level_count there is nothing finer. */
typedef struct strl_brick_head {
    uint32_t level_count; /* 0: the payload is a mesh's */
    /* [level_count] size of what the splats of level s + 1 stand for, lattice units; falling */
    float error[STRL_BRICK_LEVELS];
    uint32_t splat_end[STRL_BRICK_LEVELS]; /* [level_count] those of level s + 1 end before this one */
    strl_splat *splat;                     /* [splat_end of the last level] */
    uint32_t run_count;
    strl_brick_run *run; /* [run_count] of triangles in the order of the mesh */
} strl_brick_head;

static inline uint32_t strl_brick_splats(const strl_brick_head *head)
{
    return head->level_count ? head->splat_end[head->level_count - 1] : 0;
}

/* Appends it. */
strl_status strl_brick_head_write(const strl_brick_head *head, strl_writer *writer, strl_error *err);
/* *bytes: its length; the mesh's payload follows. Arrays come from arena. triangles: of the mesh, which runs must sum
 * up to. */
strl_status strl_brick_head_read(const void *data, size_t size, uint32_t triangles, strl_arena *arena,
                                 strl_brick_head *head, size_t *bytes, strl_error *err);

#endif
