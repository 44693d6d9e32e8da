/* strl_pool_ordered. What a caller can see is what one thread would do with work(0), finish(0), work(1), finish(1) ...:
 * the items before a failed one are all finished, none after it is, and its failure is the one returned. */
#include <stdbool.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "jobs/gang.h"
#include "jobs/pool.h"
#include "platform/thread.h"

typedef struct pipeline {
    strl__gang gang; /* first: the gang is the pipeline */
    strl_slot_fn work;
    strl_slot_fn finish;
    void *context;
    strl_cancel *cancel;
    unsigned window;

    strl_mutex mutex; /* guards all below */
    strl_condition changed;
    bool *worked;      /* by slot: work has returned, finish has not */
    uint64_t next;     /* next item to claim */
    uint64_t finished; /* items whose finish has returned */
    uint64_t end;      /* items from here on are not claimed: count, or one past a failed item */
    bool cancelled;
    strl_status status; /* of the lowest item whose work failed */
    uint64_t failed_index;
    strl_error error;
} pipeline;

/* All below are called and left with the mutex held. */

static bool can_claim(const pipeline *self)
{
    return !self->cancelled && self->next < self->end && self->next - self->finished < self->window;
}

static void work_next(pipeline *self, unsigned worker)
{
    if (strl__cancelled(self->cancel)) {
        self->cancelled = true;
        strl_condition_broadcast(&self->changed);
        return;
    }
    uint64_t index = self->next++;
    unsigned slot = (unsigned)(index % self->window);
    strl_mutex_unlock(&self->mutex);
    strl_error error = {0};
    strl_status status = self->work(self->context, index, slot, worker, &error);
    strl_mutex_lock(&self->mutex);
    self->worked[slot] = true;
    if (status != STRL_OK) {
        self->end = self->next < self->end ? self->next : self->end;
        if (self->status == STRL_OK || index < self->failed_index) {
            self->status = status;
            self->failed_index = index;
            self->error = error;
        }
    }
    strl_condition_broadcast(&self->changed);
}

static strl_status finish_next(pipeline *self, strl_error *err)
{
    uint64_t index = self->finished;
    unsigned slot = (unsigned)(index % self->window);
    strl_mutex_unlock(&self->mutex);
    strl_status status = self->finish(self->context, index, slot, 0, err);
    strl_mutex_lock(&self->mutex);
    self->worked[slot] = false;
    self->finished++;
    strl_condition_broadcast(&self->changed);
    return status;
}

static void help_pipeline(strl__gang *gang, unsigned worker)
{
    pipeline *self = (pipeline *)gang;
    strl_mutex_lock(&self->mutex);
    while (!self->cancelled && self->next < self->end)
        if (can_claim(self))
            work_next(self, worker);
        else
            strl_condition_wait(&self->changed, &self->mutex);
    strl_mutex_unlock(&self->mutex);
}

/* The caller's part: finishing goes before working, because it frees slots. */
static strl_status drive(pipeline *self, uint64_t count, strl_error *err)
{
    strl_status status = STRL_OK;
    while (status == STRL_OK && self->finished < count) {
        if (self->cancelled || strl__cancelled(self->cancel)) {
            status = strl__fail(err, STRL_ERR_CANCELLED, "cancelled");
        } else if (self->status != STRL_OK && self->finished == self->failed_index) {
            status = self->status;
            if (err)
                *err = self->error;
        } else if (self->worked[self->finished % self->window]) {
            status = finish_next(self, err);
        } else if (can_claim(self)) {
            work_next(self, 0);
        } else {
            strl_condition_wait(&self->changed, &self->mutex);
        }
    }
    self->end = self->next; /* nothing more is claimed: helpers leave */
    strl_condition_broadcast(&self->changed);
    return status;
}

unsigned strl_pool_window(const strl_pool *pool, unsigned window)
{
    return window ? window : 4 * strl_pool_workers(pool);
}

strl_status strl_pool_ordered(strl_pool *pool, uint64_t count, unsigned window, strl_slot_fn work, strl_slot_fn finish,
                              void *context, strl_cancel *cancel, strl_error *err)
{
    pipeline self = {.gang.run = help_pipeline, .work = work, .finish = finish, .context = context, .cancel = cancel};
    self.window = strl_pool_window(pool, window);
    self.end = count;
    self.worked = strl__alloc_zero(self.window, sizeof *self.worked);
    if (!self.worked)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a window of %u items", self.window);
    strl_mutex_init(&self.mutex);
    strl_condition_init(&self.changed);
    strl__gang_enlist(pool, &self.gang, count < self.window ? (unsigned)count : self.window);
    strl_mutex_lock(&self.mutex);
    strl_status status = drive(&self, count, err);
    strl_mutex_unlock(&self.mutex);
    strl__gang_dismiss(pool, &self.gang);
    strl_condition_deinit(&self.changed);
    strl_mutex_deinit(&self.mutex);
    strl__free(self.worked);
    return status;
}
