/* A source whose bytes another program reads. Its callback is not trusted to keep its word. */
#include <inttypes.h>

#include "base/fail.h"
#include "base/memory.h"
#include "source/fetched.h"

typedef struct callback_source {
    strl__fetched fetched;
    strl_source_callbacks callbacks;
    char *name; /* owned; NULL = none */
} callback_source;

static strl_status callback_read(strl_source *source, uint64_t offset, void *data, size_t size, strl_error *err)
{
    callback_source *self = (callback_source *)source;
    strl_error own = {0}; /* a callback that fails without a sentence must not leave an older one */
    strl_status status = self->callbacks.read(self->callbacks.context, offset, data, size, &own);
    if (status == STRL_OK)
        return STRL_OK;
    own.message[sizeof own.message - 1] = 0;
    return own.message[0]
               ? strl__fail(err, status, "%s", own.message)
               : strl__fail(err, status, "the callback could not read %zu bytes at byte %" PRIu64, size, offset);
}

static void release(callback_source *self)
{
    strl__fetched_deinit(&self->fetched);
    strl__free(self->name);
    strl__free(self);
}

static void callback_close(strl_source *source)
{
    const strl_source_callbacks callbacks = ((callback_source *)source)->callbacks;
    release((callback_source *)source);
    if (callbacks.close)
        callbacks.close(callbacks.context);
}

strl_status strl_source_open_callbacks(const strl_source_callbacks *callbacks, unsigned threads, strl_source **source,
                                       strl_error *err)
{
    static const strl_source_class klass = {
        .kind = "callback",
        .submit = strl__fetched_submit,
        .poll = strl__fetched_poll,
        .cancel = strl__fetched_cancel,
        .read = callback_read,
        .close = callback_close,
    };
    *source = NULL;
    if (!callbacks->read)
        return strl__fail(err, STRL_ERR_ARGUMENT, "a source of callbacks has no read");
    callback_source *self = strl__alloc_zero(1, sizeof *self);
    if (!self)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to open a source of callbacks");
    self->callbacks = *callbacks;
    strl_status status = strl__fetched_init(&self->fetched, threads, err);
    if (status == STRL_OK && callbacks->name && !(self->name = strl__strdup(callbacks->name)))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory to open %.300s", callbacks->name);
    if (status != STRL_OK) {
        release(self);
        return status;
    }
    self->fetched.base = (strl_source){&klass, callbacks->bytes, self->name};
    *source = &self->fetched.base;
    return STRL_OK;
}
