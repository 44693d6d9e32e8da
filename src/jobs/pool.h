/* An explicit pool of worker threads. There is no global pool. Results are written by index and reduced in order, so
 * that output never depends on the number of threads. A pool of 0 threads runs everything on the caller's thread. */
#ifndef STRL_JOBS_POOL_H
#define STRL_JOBS_POOL_H

#include <stdatomic.h>
#include <stdint.h>

#include "stroll/error.h"

typedef struct strl_pool strl_pool;

/* threads: workers to start; 0 = none. The pool is owned by the caller. */
strl_status strl_pool_create(unsigned threads, strl_pool **pool, strl_error *err);
void strl_pool_destroy(strl_pool *pool); /* finishes submitted jobs first; NULL is legal */
unsigned strl_pool_threads(const strl_pool *pool);
/* How many slots `worker` can take in the calls below: threads + 1, because the caller works too. */
unsigned strl_pool_workers(const strl_pool *pool);

/* Set by the owner from any thread; long loops look at it. */
typedef struct strl_cancel {
    atomic_bool requested;
} strl_cancel;

/* One item. `worker` < strl_pool_workers() names the thread's slot for scratch. */
typedef strl_status (*strl_job_fn)(void *context, uint64_t index, unsigned worker, strl_error *err);

/* Runs job(index) for every index in [0, count), the caller's thread included, and waits. After a failure no further
 * item starts; returns the failure of the lowest index that failed. Checks cancel (may be NULL) before each item. */
strl_status strl_pool_for(strl_pool *pool, uint64_t count, strl_job_fn job, void *context, strl_cancel *cancel,
                          strl_error *err);

/* A pipeline over [0, count): work(index) on any thread, then finish(index) on the caller's thread in index order; at
 * most `window` items are between the two (0 = 4 * workers). work and finish get slot = index % window, for per-item
 * buffers: a slot is not reused before finish of its item has returned. */
typedef strl_status (*strl_slot_fn)(void *context, uint64_t index, unsigned slot, unsigned worker, strl_error *err);
strl_status strl_pool_ordered(strl_pool *pool, uint64_t count, unsigned window, strl_slot_fn work, strl_slot_fn finish,
                              void *context, strl_cancel *cancel, strl_error *err);
/* The window that strl_pool_ordered uses for the given request. */
unsigned strl_pool_window(const strl_pool *pool, unsigned window);

/* Fire and forget: run(context) on some worker, in order of submission; with 0 threads it waits for strl_pool_pump. */
strl_status strl_pool_submit(strl_pool *pool, void (*run)(void *context), void *context, strl_error *err);
/* Runs submitted jobs on the calling thread until none is left or budget_ns has passed (one runs in any case). Returns
 * how many ran. */
uint64_t strl_pool_pump(strl_pool *pool, uint64_t budget_ns);

#endif
