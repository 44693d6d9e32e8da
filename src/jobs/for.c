/* strl_pool_for. Items are claimed in index order and a claimed item always runs, so every item below a failed one
 * has run too: which failure is the lowest does not depend on the threads. */
#include <stdbool.h>

#include "base/fail.h"
#include "jobs/gang.h"
#include "jobs/pool.h"
#include "platform/thread.h"

typedef struct loop {
    strl__gang gang; /* first: the gang is the loop */
    strl_job_fn job;
    void *context;
    strl_cancel *cancel;
    uint64_t count;
    _Atomic uint64_t next; /* next item to claim; count once an item has failed */
    atomic_bool cancelled; /* an item was left because of cancel */

    strl_mutex mutex; /* guards the failure */
    strl_status status;
    uint64_t failed_index;
    strl_error error;
} loop;

static bool claim(loop *self, uint64_t *index)
{
    uint64_t next = atomic_load(&self->next);
    do {
        if (next >= self->count)
            return false;
        if (strl__cancelled(self->cancel)) {
            atomic_store(&self->cancelled, true);
            return false;
        }
    } while (!atomic_compare_exchange_weak(&self->next, &next, next + 1));
    *index = next;
    return true;
}

static void note_failure(loop *self, uint64_t index, strl_status status, const strl_error *error)
{
    atomic_store(&self->next, self->count);
    strl_mutex_lock(&self->mutex);
    if (self->status == STRL_OK || index < self->failed_index) {
        self->status = status;
        self->failed_index = index;
        self->error = *error;
    }
    strl_mutex_unlock(&self->mutex);
}

static void run_items(strl__gang *gang, unsigned worker)
{
    loop *self = (loop *)gang;
    uint64_t index;
    while (claim(self, &index)) {
        strl_error error = {0};
        strl_status status = self->job(self->context, index, worker, &error);
        if (status != STRL_OK)
            note_failure(self, index, status, &error);
    }
}

strl_status strl_pool_for(strl_pool *pool, uint64_t count, strl_job_fn job, void *context, strl_cancel *cancel,
                          strl_error *err)
{
    loop self = {.gang.run = run_items, .job = job, .context = context, .cancel = cancel, .count = count};
    strl_mutex_init(&self.mutex);
    if (count > 1)
        strl__gang_enlist(pool, &self.gang, count - 1 < UINT32_MAX ? (unsigned)(count - 1) : UINT32_MAX);
    run_items(&self.gang, 0);
    if (count > 1)
        strl__gang_dismiss(pool, &self.gang);
    strl_mutex_deinit(&self.mutex);
    if (self.status != STRL_OK) {
        if (err)
            *err = self.error;
        return self.status;
    }
    if (atomic_load(&self.cancelled))
        return strl__fail(err, STRL_ERR_CANCELLED, "cancelled");
    return STRL_OK;
}
