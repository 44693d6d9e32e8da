/* Passes over the inputs: triangles are read in batches, by one thread at a time because a file has one order, and
 * worked on by all. */
#ifndef STRL_BUILD_INGEST_BATCHES_H
#define STRL_BUILD_INGEST_BATCHES_H

#include "build/context.h"

typedef struct strl_triangle_batch {
    strl_triangle *triangle; /* [capacity of the pass] */
    size_t count;
    uint64_t first;      /* triangles of this input before it */
    uint64_t bytes_done; /* of the input's file, with it */
} strl_triangle_batch;

typedef struct strl_batch_pass {
    strl_build_context *context;
    unsigned window;            /* slots */
    size_t capacity;            /* triangles of a batch */
    strl_triangle_batch *batch; /* [window] */
    /* As of strl_pool_ordered: work on any thread, finish in order. Neither is called for an empty batch. */
    strl_status (*work)(void *user, const strl_triangle_batch *batch, unsigned slot, unsigned worker, strl_error *err);
    strl_status (*finish)(void *user, const strl_triangle_batch *batch, unsigned slot, strl_error *err);
    void *user;
} strl_batch_pass;

/* Chooses window and capacity, so that with `bytes` more for each triangle of a slot all slots stay within their share
 * of the budget, and makes the batches. */
strl_status strl__batch_pass_create(strl_build_context *context, size_t bytes, strl_batch_pass *pass, strl_error *err);
void strl__batch_pass_deinit(strl_batch_pass *pass);
/* All triangles of one input, from where its reader stands. What work and finish see does not depend on the number of
 * threads, but for where batches end. */
strl_status strl__batch_pass_run(strl_batch_pass *pass, strl_reader *reader, strl_error *err);

#endif
