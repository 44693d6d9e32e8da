/* The input, read once: its triangles on the lattice as a sum of hashes, and its surface, unquantised, as
 * chunks in a scratch file. */
#ifndef STRL_VERIFY_INPUT_H
#define STRL_VERIFY_INPUT_H

#include "verify/mesh.h"
#include "verify/pieces.h"
#include "verify/surface.h"

typedef struct strl__vinput {
    uint64_t kept;      /* triangles with three different lattice corners */
    uint64_t triangles; /* all that the readers announced */
    uint64_t nonfinite, degenerate, lines, points;
    strl__hash128 sum;     /* of the kept triangles */
    double rounding;       /* lattice units: what doubles cannot tell apart at these coordinates */
    strl__surface surface; /* of the kept triangles */
    strl_file *file;       /* of chunks */
    uint64_t *offset;      /* [surface.count] of a chunk in the file */
    uint64_t *bytes;       /* [surface.count] */
} strl__vinput;

/* Reads what the tree is of from desc->inputs. Uses desc->scratch_dir; what it leaves there goes with deinit. */
strl_status strl__v_input_read(strl__model *model, const strl__vtree *tree, const strl__vpiece *piece,
                               strl__vinput *input, strl_error *err);
void strl__v_input_deinit(strl__vinput *input);
/* The multiset of triangles. */
void strl__v_check_leaves(strl__model *model, const strl__vtree *tree, const strl__vinput *input);
/* Counts and drops of all trees' inputs against the header. */
void strl__v_check_drops(strl__model *model, const strl__vinput *total);

/* ---- from readers to regions ---- */

/* Splits space so that each region has about as many of the tree's leaf triangles. Regions only make chunks
 * compact. */
typedef struct strl__region_split {
    double at;
    uint32_t child[2]; /* an index, or a region with the top bit set */
    unsigned axis;
} strl__region_split;

#define STRL__REGION 0x80000000u

typedef struct strl__region {
    uint32_t *blocks; /* owned */
    size_t block_count, block_capacity;
    uint8_t *buffer; /* owned; the block that is being filled */
    uint32_t fill;   /* triangles in it */
    uint32_t last;   /* triangles in the last block written */
} strl__region;

/* A spill of triangles (nine doubles each, lattice units) in blocks of equal size. */
typedef struct strl__regions {
    strl__region_split *splits; /* owned */
    uint32_t split_count, count;
    strl__region *items; /* [count], owned */
    uint32_t block_triangles;
    uint32_t blocks; /* in the file */
    strl_file *file;
} strl__regions;

#define STRL__SOUP_BYTES (9 * sizeof(double))

strl_status strl__v_regions_create(const strl__model *model, const strl__vtree *tree, uint32_t count,
                                   strl__regions *regions, strl_error *err);
strl_status strl__v_regions_add(strl__regions *regions, const double corners[9], strl_error *err);
strl_status strl__v_regions_flush(strl__regions *regions, strl_error *err);
void strl__v_regions_destroy(strl__regions *regions);

#endif
