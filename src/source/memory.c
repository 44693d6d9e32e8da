/* Bytes in memory as a source: what tests and the browser's whole-file fetch use. */
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "source/queue.h"

typedef struct memory_source {
    strl_source base;
    const uint8_t *data; /* borrowed */
    strl__read_queue queue;
} memory_source;

static strl_status memory_read(strl_source *source, uint64_t offset, void *data, size_t size, strl_error *err)
{
    (void)err;
    if (size)
        memcpy(data, ((memory_source *)source)->data + offset, size);
    return STRL_OK;
}

static strl_status memory_submit(strl_source *source, uint64_t token, uint64_t offset, size_t size, float urgency,
                                 strl_error *err)
{
    memory_source *self = (memory_source *)source;
    const strl__read_request request = {token, offset, size, urgency};
    strl__read *read;
    strl_mutex_lock(&self->queue.mutex);
    strl_status status = strl__read_queue_reserve(&self->queue, &request, &read, err);
    if (status == STRL_OK)
        strl__read_queue_push(&self->queue, read);
    strl_mutex_unlock(&self->queue.mutex);
    return status;
}

static bool memory_poll(strl_source *source, strl_source_result *result)
{
    memory_source *self = (memory_source *)source;
    if (strl__read_queue_answer(&self->queue, result))
        return true;
    return strl__read_queue_serve(&self->queue, source, memory_read) && strl__read_queue_answer(&self->queue, result);
}

static void memory_cancel(strl_source *source, uint64_t token)
{
    strl__read_queue_cancel(&((memory_source *)source)->queue, token);
}

static void memory_close(strl_source *source)
{
    strl__read_queue_deinit(&((memory_source *)source)->queue);
    strl__free(source);
}

strl_status strl_source_open_memory(const void *data, size_t size, strl_source **source, strl_error *err)
{
    static const strl_source_class klass = {
        "memory", memory_submit, memory_poll, memory_cancel, memory_read, memory_close,
    };
    *source = NULL;
    memory_source *self = strl__alloc_zero(1, sizeof *self);
    if (!self)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to open a memory source");
    self->base = (strl_source){&klass, size};
    self->data = data;
    strl__read_queue_init(&self->queue);
    *source = &self->base;
    return STRL_OK;
}
