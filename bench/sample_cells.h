/* A container of samples as triangles, each with the cell of the octree that stores it, found from the bytes: for
 * theorem.c. */
#ifndef STRL_BENCH_SAMPLE_CELLS_H
#define STRL_BENCH_SAMPLE_CELLS_H

#include "container/treelet.h"

typedef struct face {
    int32_t corner[3][3]; /* lattice, from the tree's least corner */
    uint32_t stored;      /* the cell that stores it has the side 2^stored */
    uint64_t key;         /* of its centroid */
} face;

/* The cell at[] * 2^side. */
typedef struct cell {
    int64_t at[3];
    uint32_t side;
} cell;

/* What is kept of a node for those below it. */
typedef struct brick {
    uint32_t owner; /* the side of the cell whose children it holds */
    uint32_t levels;
    size_t first[STRL_BRICK_LEVELS + 1]; /* cells of level l + 1: first[l] .. first[l + 1] */
} brick;

typedef struct model {
    strl_container *container;
    const strl_tree *tree;
    face *faces;
    size_t face_count, face_capacity;
    cell *cells;
    size_t cell_count, cell_capacity;
    brick *bricks;  /* [node_count] */
    unsigned shift; /* of coordinates in keys */
    uint64_t lost;  /* triangles for which no cell was found */
} model;

/* What a cell has below it and beside it in the cells above. */
typedef struct content {
    /* [3 count] corners by axis, in sides of the cell, from its centre; as seen by an eye, in samples */
    float *at[3], *image[3];
    uint8_t *drawn;       /* [count] 1 = stored by the cell, 2 = above it, 0 = below it */
    uint32_t *drawn_face; /* [drawn_count] */
    size_t capacity;
    uint32_t count, drawn_count;
    double area; /* over that of the cell's side */
} content;

static inline void cross(const float a[3], const float b[3], float out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
}

static inline float dot(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Reads the first tree of m->container; m is else zero. Faces come in the order of their keys, each cell once. */
strl_status load_model(model *m, strl_error *err);
void model_deinit(model *m);
/* The content of a cell as theorem.c has it; false without memory. */
bool gather(const model *m, const cell *c, content *to);
void content_deinit(content *c);
/* Of triangle t, twice as long as its area. */
void area_vector(const content *c, uint32_t t, float out[3]);

#endif
