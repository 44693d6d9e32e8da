/* A file as a source. Each accepted read puts one job into a pool of the source's own; a job serves whichever waiting
 * read is the most urgent when it starts. */
#include "base/fail.h"
#include "base/memory.h"
#include "jobs/pool.h"
#include "platform/file.h"
#include "source/queue.h"

typedef struct file_source {
    strl_source base;
    strl_file *file; /* owned */
    strl_pool *pool; /* owned; NULL: reads happen inside poll */
    strl__read_queue queue;
} file_source;

static strl_status file_read(strl_source *source, uint64_t offset, void *data, size_t size, strl_error *err)
{
    return strl_file_read(((file_source *)source)->file, offset, data, size, err);
}

static void serve_one(void *context)
{
    file_source *self = context;
    strl__read_queue_serve(&self->queue, &self->base, file_read); /* none waits: it was cancelled */
}

static strl_status file_submit(strl_source *source, uint64_t token, uint64_t offset, size_t size, float urgency,
                               strl_error *err)
{
    file_source *self = (file_source *)source;
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

static bool file_poll(strl_source *source, strl_source_result *result)
{
    file_source *self = (file_source *)source;
    if (strl__read_queue_answer(&self->queue, result))
        return true;
    if (self->pool || !strl__read_queue_serve(&self->queue, source, file_read))
        return false;
    return strl__read_queue_answer(&self->queue, result);
}

static void file_cancel(strl_source *source, uint64_t token)
{
    strl__read_queue_cancel(&((file_source *)source)->queue, token);
}

static void file_close(strl_source *source)
{
    file_source *self = (file_source *)source;
    strl__read_queue_clear(&self->queue); /* first, or the pool would read all of it before it ends */
    strl_pool_destroy(self->pool);
    strl__read_queue_deinit(&self->queue);
    strl_file_close(self->file, NULL);
    strl__free(self);
}

strl_status strl_source_open_file(const char *path, unsigned threads, strl_source **source, strl_error *err)
{
    static const strl_source_class klass = {
        "file", file_submit, file_poll, file_cancel, file_read, file_close,
    };
    *source = NULL;
    file_source *self = strl__alloc_zero(1, sizeof *self);
    if (!self)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to open %.300s", path);
    strl__read_queue_init(&self->queue);
    strl_status status = strl_file_open(path, &self->file, err);
    if (status == STRL_OK && threads > 0)
        status = strl_pool_create(threads, &self->pool, err);
    if (status != STRL_OK) {
        file_close(&self->base);
        return status;
    }
    self->base = (strl_source){&klass, strl_file_bytes(self->file)};
    *source = &self->base;
    return STRL_OK;
}
