#include "build/ingest/batches.h"

#include "base/fail.h"
#include "base/memory.h"
#include "platform/thread.h"

#define MOST_TRIANGLES 8192u
#define LEAST_TRIANGLES 64u
#define SHARES_OF_MEMORY 8u
#define SLOTS_OF_WORKER 2u
/* The pipeline wants to know how many items there are; where the input ends is not known, so there are several
 * pipelines. */
#define ROUND 256u

typedef struct reading {
    strl_batch_pass *pass;
    strl_reader *reader;
    strl_mutex mutex; /* guards all below and the reader */
    strl_condition changed;
    uint64_t turn; /* the item that reads next */
    uint64_t triangles;
    bool ended;
} reading;

strl_status strl__batch_pass_create(strl_build_context *context, size_t bytes, strl_batch_pass *pass, strl_error *err)
{
    unsigned window = SLOTS_OF_WORKER * strl_pool_workers(context->pool);
    uint64_t fits = context->memory_bytes / SHARES_OF_MEMORY / (window * (sizeof(strl_triangle) + bytes));
    *pass = (strl_batch_pass){.context = context, .window = window};
    pass->capacity = fits > MOST_TRIANGLES ? MOST_TRIANGLES : fits < LEAST_TRIANGLES ? LEAST_TRIANGLES : (size_t)fits;
    pass->batch = strl__alloc_zero(window, sizeof *pass->batch);
    bool good = pass->batch != NULL;
    for (unsigned i = 0; i < window && good; i++) {
        pass->batch[i].triangle = strl__alloc(pass->capacity, sizeof *pass->batch[i].triangle);
        good = pass->batch[i].triangle != NULL;
    }
    return good ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "no memory to read the input");
}

void strl__batch_pass_deinit(strl_batch_pass *pass)
{
    for (unsigned i = 0; pass->batch && i < pass->window; i++)
        strl__free(pass->batch[i].triangle);
    strl__free(pass->batch);
    *pass = (strl_batch_pass){0};
}

/* Items are begun in order, so whoever's turn it is has begun. */
static strl_status read_in_turn(reading *r, uint64_t index, strl_triangle_batch *batch, strl_error *err)
{
    strl_status status = STRL_OK;
    batch->count = 0;
    strl_mutex_lock(&r->mutex);
    while (r->turn != index)
        strl_condition_wait(&r->changed, &r->mutex);
    if (!r->ended)
        status = strl_reader_next(r->reader, batch->triangle, r->pass->capacity, &batch->count, err);
    r->ended = r->ended || status || batch->count == 0;
    batch->first = r->triangles;
    batch->bytes_done = strl_reader_bytes_done(r->reader);
    r->triangles += batch->count;
    r->turn++;
    strl_condition_broadcast(&r->changed);
    strl_mutex_unlock(&r->mutex);
    return status;
}

static strl_status work(void *context, uint64_t index, unsigned slot, unsigned worker, strl_error *err)
{
    reading *r = context;
    strl_triangle_batch *batch = &r->pass->batch[slot];
    strl_status status = read_in_turn(r, index, batch, err);
    return status || !batch->count ? status : r->pass->work(r->pass->user, batch, slot, worker, err);
}

static strl_status finish(void *context, uint64_t index, unsigned slot, unsigned worker, strl_error *err)
{
    reading *r = context;
    const strl_triangle_batch *batch = &r->pass->batch[slot];
    (void)index;
    (void)worker;
    return batch->count ? r->pass->finish(r->pass->user, batch, slot, err) : STRL_OK;
}

strl_status strl__batch_pass_run(strl_batch_pass *pass, strl_reader *reader, strl_error *err)
{
    reading r = {.pass = pass, .reader = reader};
    strl_status status = STRL_OK;
    strl_mutex_init(&r.mutex);
    strl_condition_init(&r.changed);
    while (!status && !r.ended) {
        r.turn = 0;
        status = strl_pool_ordered(pass->context->pool, ROUND, pass->window, work, finish, &r, NULL, err);
    }
    strl_condition_deinit(&r.changed);
    strl_mutex_deinit(&r.mutex);
    return status;
}
