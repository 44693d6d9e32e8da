#include "source/fetched.h"

#include "base/memory.h"

strl_status strl__fetched_init(strl__fetched *self, unsigned threads, strl_error *err)
{
    strl__read_queue_init(&self->queue);
    return threads > 0 ? strl_pool_create(threads, &self->pool, err) : STRL_OK;
}

void strl__fetched_deinit(strl__fetched *self)
{
    strl__read_queue_clear(&self->queue); /* first, or the pool would read all of it before it ends */
    strl_pool_destroy(self->pool);
    strl__read_queue_deinit(&self->queue);
}

static void serve_one(void *context)
{
    strl__fetched *self = context;
    strl__read_queue_serve(&self->queue, &self->base, self->base.klass->read); /* none waits: it was cancelled */
}

strl_status strl__fetched_submit(strl_source *source, uint64_t token, uint64_t offset, size_t size, float urgency,
                                 strl_error *err)
{
    strl__fetched *self = (strl__fetched *)source;
    const strl__read_request request = {token, offset, size, urgency};
    strl__read *read;
    /* Held over both steps: a job that starts at once waits here until its read is in the queue. */
    strl_mutex_lock(&self->queue.mutex);
    strl_status status = strl__read_queue_reserve(&self->queue, &request, &read, err);
    if (status == STRL_OK && self->pool)
        status = strl_pool_submit(self->pool, serve_one, self, err);
    if (status == STRL_OK)
        strl__read_queue_push(&self->queue, read);
    else
        strl__free(read);
    strl_mutex_unlock(&self->queue.mutex);
    return status;
}

bool strl__fetched_poll(strl_source *source, strl_source_result *result)
{
    strl__fetched *self = (strl__fetched *)source;
    if (strl__read_queue_answer(&self->queue, result))
        return true;
    if (self->pool || !strl__read_queue_serve(&self->queue, source, source->klass->read))
        return false;
    return strl__read_queue_answer(&self->queue, result);
}

void strl__fetched_cancel(strl_source *source, uint64_t token)
{
    strl__read_queue_cancel(&((strl__fetched *)source)->queue, token);
}
