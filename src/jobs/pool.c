/* The pool's threads, the queue of submitted jobs and the list of gangs. Gangs go first: somebody waits for them. */
#include "jobs/pool.h"

#include <stdbool.h>

#include "base/fail.h"
#include "base/memory.h"
#include "jobs/gang.h"
#include "platform/thread.h"

#define MOST_THREADS 1024u

typedef struct submitted {
    struct submitted *next;
    void (*run)(void *context);
    void *context;
} submitted;

typedef struct worker {
    strl_pool *pool;
    strl_thread *thread;
    unsigned slot; /* 1 + index; slot 0 is the caller's */
} worker;

struct strl_pool {
    unsigned threads;
    worker *workers; /* owned, `threads` of them */

    strl_mutex mutex; /* guards all below */
    strl_condition work_came;
    strl_condition helper_left;
    submitted *first;
    submitted *last;
    strl__gang *gangs; /* those that still want helpers, first come first served */
    bool stopping;
};

static submitted *take_submitted(strl_pool *pool)
{
    submitted *job = pool->first;
    if (job) {
        pool->first = job->next;
        if (!pool->first)
            pool->last = NULL;
    }
    return job;
}

static void run_submitted(submitted *job)
{
    job->run(job->context);
    strl__free(job);
}

static void unlink_gang(strl_pool *pool, strl__gang *gang)
{
    for (strl__gang **at = &pool->gangs; *at; at = &(*at)->next)
        if (*at == gang) {
            *at = gang->next;
            return;
        }
}

/* Called and left with the mutex held. */
static void help(strl_pool *pool, strl__gang *gang, unsigned slot)
{
    gang->active++;
    if (--gang->wanted == 0)
        unlink_gang(pool, gang);
    strl_mutex_unlock(&pool->mutex);
    gang->run(gang, slot);
    strl_mutex_lock(&pool->mutex);
    if (--gang->active == 0)
        strl_condition_broadcast(&pool->helper_left);
}

static void worker_main(void *context)
{
    const worker *self = context;
    strl_pool *pool = self->pool;
    strl_mutex_lock(&pool->mutex);
    for (;;) {
        submitted *job;
        if (pool->gangs) {
            help(pool, pool->gangs, self->slot);
        } else if ((job = take_submitted(pool)) != NULL) {
            strl_mutex_unlock(&pool->mutex);
            run_submitted(job);
            strl_mutex_lock(&pool->mutex);
        } else if (pool->stopping) {
            break;
        } else {
            strl_condition_wait(&pool->work_came, &pool->mutex);
        }
    }
    strl_mutex_unlock(&pool->mutex);
}

static strl_status start_workers(strl_pool *pool, strl_error *err)
{
    for (unsigned i = 0; i < pool->threads; i++) {
        worker *self = &pool->workers[i];
        self->pool = pool;
        self->slot = 1 + i;
        strl_status status = strl_thread_start(&self->thread, worker_main, self, err);
        if (status != STRL_OK)
            return status;
    }
    return STRL_OK;
}

strl_status strl_pool_create(unsigned threads, strl_pool **pool, strl_error *err)
{
    *pool = NULL;
    if (threads > MOST_THREADS)
        return strl__fail(err, STRL_ERR_ARGUMENT, "a pool has at most %u threads, %u were asked for", MOST_THREADS,
                          threads);
    strl_pool *made = strl__alloc_zero(1, sizeof *made);
    worker *workers = strl__alloc_zero(threads, sizeof *workers);
    if (!made || !workers) {
        strl__free(workers);
        strl__free(made);
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a pool of %u threads", threads);
    }
    made->threads = threads;
    made->workers = workers;
    strl_mutex_init(&made->mutex);
    strl_condition_init(&made->work_came);
    strl_condition_init(&made->helper_left);
    strl_status status = start_workers(made, err);
    if (status != STRL_OK) {
        strl_pool_destroy(made);
        return status;
    }
    *pool = made;
    return STRL_OK;
}

void strl_pool_destroy(strl_pool *pool)
{
    if (!pool)
        return;
    strl_mutex_lock(&pool->mutex);
    pool->stopping = true;
    strl_condition_broadcast(&pool->work_came);
    strl_mutex_unlock(&pool->mutex);
    for (unsigned i = 0; i < pool->threads; i++)
        strl_thread_join(pool->workers[i].thread);
    strl_pool_pump(pool, UINT64_MAX); /* a pool without threads still has its jobs */
    strl_condition_deinit(&pool->helper_left);
    strl_condition_deinit(&pool->work_came);
    strl_mutex_deinit(&pool->mutex);
    strl__free(pool->workers);
    strl__free(pool);
}

unsigned strl_pool_threads(const strl_pool *pool)
{
    return pool->threads;
}

unsigned strl_pool_workers(const strl_pool *pool)
{
    return pool->threads + 1;
}

void strl__gang_enlist(strl_pool *pool, strl__gang *gang, unsigned helpers)
{
    gang->next = NULL;
    gang->active = 0;
    gang->wanted = helpers < pool->threads ? helpers : pool->threads;
    if (gang->wanted == 0)
        return;
    strl_mutex_lock(&pool->mutex);
    strl__gang **end = &pool->gangs;
    while (*end)
        end = &(*end)->next;
    *end = gang;
    strl_condition_broadcast(&pool->work_came);
    strl_mutex_unlock(&pool->mutex);
}

void strl__gang_dismiss(strl_pool *pool, strl__gang *gang)
{
    strl_mutex_lock(&pool->mutex);
    unlink_gang(pool, gang);
    gang->wanted = 0;
    while (gang->active)
        strl_condition_wait(&pool->helper_left, &pool->mutex);
    strl_mutex_unlock(&pool->mutex);
}

strl_status strl_pool_submit(strl_pool *pool, void (*run)(void *context), void *context, strl_error *err)
{
    submitted *job = strl__alloc(1, sizeof *job);
    if (!job)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to queue a job");
    *job = (submitted){NULL, run, context};
    strl_mutex_lock(&pool->mutex);
    if (pool->last)
        pool->last->next = job;
    else
        pool->first = job;
    pool->last = job;
    strl_condition_signal(&pool->work_came);
    strl_mutex_unlock(&pool->mutex);
    return STRL_OK;
}

uint64_t strl_pool_pump(strl_pool *pool, uint64_t budget_ns)
{
    uint64_t start_ns = strl_clock_ns();
    uint64_t ran = 0;
    do {
        strl_mutex_lock(&pool->mutex);
        submitted *job = take_submitted(pool);
        strl_mutex_unlock(&pool->mutex);
        if (!job)
            break;
        run_submitted(job);
        ran++;
    } while (strl_clock_ns() - start_ns < budget_ns);
    return ran;
}
