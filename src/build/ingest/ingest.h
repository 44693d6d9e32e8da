/* Ingest, shared by all builders: inputs -> triangles on the lattice, sorted along a space-filling curve, cut into
 * cells of some dozens of triangles; the graph of cells that share lattice positions; and the shared positions
 * themselves.
 *
 *   reader --(bounds, edge lengths, sample)--> lattice, splitters
 *   reader --(quantise, drop)--> buckets --(sort)--> soup + cells + (position, cell) pairs
 *   pairs  --(by hash of position)--> cell graph + shared positions
 *
 * All arrays that stay in memory are per cell, and the number of cells is bounded by the memory budget. */
#ifndef STRL_BUILD_INGEST_INGEST_H
#define STRL_BUILD_INGEST_INGEST_H

#include "build/context.h"
#include "container/writer.h"

/* No normal was given: it is computed where all triangles round the vertex are at hand. */
#define STRL_NORMAL_MISSING 0xffffu

/* One corner of a triangle on the lattice. */
typedef struct strl_soup_corner {
    uint32_t position[3]; /* lattice cells from the tree's origin, below 2^31 */
    uint16_t normal[2];   /* octahedral, or STRL_NORMAL_MISSING */
    uint32_t colour;      /* sRGB-encoded RGBA8 */
    /* two codes of 16 bits over the range of the material's image, u lowest; 0 where it has none */
    uint32_t texcoord;
} strl_soup_corner;

typedef struct strl_soup_triangle {
    strl_soup_corner corner[3];
    uint32_t palette; /* index into strl_ingest.palette */
} strl_soup_triangle;

typedef struct strl_cell {
    uint64_t first; /* index of its first triangle in the soup */
    uint32_t count;
} strl_cell;

/* An edge of the cell graph: how many lattice positions two cells share. */
typedef struct strl_cell_edge {
    uint32_t a, b; /* cells, a < b */
    uint32_t weight;
} strl_cell_edge;

typedef struct strl_names {
    char **items;                /* owned */
    uint32_t *rgba;              /* of materials; NULL for parts */
    strl_material_image *images; /* of materials, references owned; NULL where no material has one */
    size_t count, capacity, rgba_capacity, image_capacity;
} strl_names;

typedef struct strl_ingest {
    double origin[3], step; /* lattice cell c is origin + step * c */
    double centre[3];       /* of the box of all that was read; not of a resumed build */
    double longest;         /* side of that box; nor this */
    double finest_step;     /* that the extent allows */
    double short_edge;      /* 99 of 100 edges are longer; 0 = there is none */
    bool is_coarse;         /* the step had to be more than a sixteenth of short_edge */
    unsigned curve_shift;   /* lattice coordinates lose so many bits on the curve, which has 21 of each axis */
    unsigned curve_spare;   /* halvings of the curve's cube in whose first part the whole model lies */
    float leaf_error;       /* lattice units: what quantisation moves a point at most */
    strl_axis up;
    char unit[16]; /* "" = unknown */
    bool has_normals, has_colours, has_texcoords;
    bool lacks_normals;      /* some corner has none */
    uint64_t triangle_count; /* kept */
    strl_spill *soup;        /* triangle_count records, packed (see soup.h) */
    strl_cell *cells;        /* [cell_count] in order of the curve */
    uint32_t cell_count;
    strl_cell_edge *edges; /* [edge_count], sorted by (a, b) */
    size_t edge_count;
    strl_spill *shared;          /* u32 words: x y z n cell[n], for each position that n >= 2 cells have */
    strl_palette_entry *palette; /* [palette_count] */
    size_t palette_count, palette_capacity;
    strl_names parts, materials;
} strl_ingest;

strl_status strl_ingest_run(strl_build_context *context, strl_ingest *ingest, strl_error *err);
void strl_ingest_deinit(strl_ingest *ingest);
/* Puts all of it but what is in soup and shared into two streams of a checkpoint: `graph`, which has the edges and ends
 * when it is deleted, and `ingest`, which has the rest. */
strl_status strl_ingest_save(strl_build_context *context, const strl_ingest *ingest, strl_spill **graph,
                             strl_error *err);
/* What was saved, from the streams of a checkpoint. with_edges: they are in it. with_soup: soup and shared are. *graph:
 * as above, NULL without edges. */
strl_status strl_ingest_restore(strl_build_context *context, bool with_edges, bool with_soup, strl_ingest *ingest,
                                strl_spill **graph, strl_error *err);
/* Deletes one of the streams when it is used up. */
strl_status strl_ingest_drop(strl_spill **stream, strl_error *err);

/* Reads `count` triangles from index `first`. scratch: count * strl_soup_bytes() bytes of the caller's. */
strl_status strl_ingest_read(const strl_ingest *ingest, uint64_t first, uint32_t count, void *scratch,
                             strl_soup_triangle *triangles, strl_error *err);
/* A cell whose triangles will not be read again. */
void strl_ingest_drop_cell(const strl_ingest *ingest, uint32_t cell);
/* Bytes of one packed record. */
size_t strl_soup_bytes(const strl_ingest *ingest);

#endif
