/* Pieces of a sample tree: the largest cells that lie in one bucket. Each is made by one worker on its own; what it
 * hands up to the top of the tree is its root cell with the triangles that this stores, and the triangles that are too
 * large for it. */
#ifndef STRL_BUILD_SAMPLES_CHUNK_H
#define STRL_BUILD_SAMPLES_CHUNK_H

#include "build/ingest/buckets.h"
#include "build/samples/brick.h"

/* A triangle on its way up. */
typedef struct strl_risen {
    strl_soup_triangle triangle;
    uint64_t key;
    float weight;  /* of a root's item */
    uint8_t limit; /* depth of the smallest cell that holds it */
} strl_risen;

/* Bricks of one depth below a piece's root. */
typedef struct strl_stored_run {
    uint64_t at, bytes; /* in the stream of bricks */
    uint32_t count;
} strl_stored_run;

typedef struct strl_chunk {
    uint64_t key;     /* first of its cell */
    strl_octant root; /* items: of `item` */
    strl_risen *item; /* owned; what the root stores and has drawn */
    uint32_t item_count;
    /* [below_count] upper cells below the root, each before what is below it, children as places in this array; owned
     */
    strl_octant *below;
    uint32_t below_count, below_capacity;
    strl_node first; /* record of its first brick, where it has any */
    uint32_t run_count;
    strl_stored_run *run; /* [run_count] by depth; owned */
} strl_chunk;

typedef struct strl_chunks {
    strl_chunk *chunk; /* in the order of the curve; owned */
    size_t count, capacity;
    strl_risen *risen; /* too large for their chunks; owned */
    size_t risen_count, risen_capacity;
} strl_chunks;

void strl_chunks_deinit(strl_chunks *chunks);

/* A brick in the stream: this, then its payload. In the machine's own order. */
typedef struct strl_stored_brick {
    strl_node record;
    uint32_t parent, first_child; /* numbers within the runs above and below; STRL_NO_BRICK = none */
    uint32_t payload_bytes;
} strl_stored_brick;

typedef struct strl_sample_stage {
    strl_build_context *context;
    const strl_ingest *ingest;
    strl_buckets *buckets;
    double coupons;
    strl_spill *bricks, *pieces; /* pieces: what buckets have handed up, for a checkpoint; NULL where none is made */
    strl_chunks chunks;
    uint32_t finished, saved; /* buckets, and as of the last checkpoint */
    uint64_t saved_at_ns;
    uint64_t done, triangles, vertices;
} strl_sample_stage;

/* All pieces, from the first bucket that is not finished: stage "sort". Uses up the buckets. */
strl_status strl_chunks_make(strl_sample_stage *stage, strl_error *err);
/* What is above them, and the container. */
strl_status strl_samples_write(strl_sample_stage *stage, strl_error *err);

/* ---- checkpoints (samples_save.c); nothing where the context keeps none */
/* After ingest: opens the streams of bricks and pieces, and saves. */
strl_status strl_samples_begin(strl_sample_stage *stage, strl_error *err);
/* One more bucket is finished: the last `pieces` and `risen` of all are what it has handed up. Saves from time to time.
 */
strl_status strl_samples_note(strl_sample_stage *stage, size_t pieces, size_t risen, strl_error *err);
/* Ingest, buckets and what finished buckets have handed up, from the checkpoint that the context goes on with. */
strl_status strl_samples_restore(strl_sample_stage *stage, strl_ingest *ingest, strl_error *err);

strl_status strl_octree_prepare(strl_octree *octree, const strl_sample_stage *stage, uint32_t triangles,
                                strl_error *err);

#endif
