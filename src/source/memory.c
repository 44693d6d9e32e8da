/* Bytes in memory as a source: what tests and the browser's whole-file fetch use. */
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "source/fetched.h"

typedef struct memory_source {
    strl__fetched fetched;
    const uint8_t *data; /* borrowed */
} memory_source;

static strl_status memory_read(strl_source *source, uint64_t offset, void *data, size_t size, strl_error *err)
{
    (void)err;
    if (size)
        memcpy(data, ((memory_source *)source)->data + offset, size);
    return STRL_OK;
}

static void memory_close(strl_source *source)
{
    strl__fetched_deinit(&((memory_source *)source)->fetched);
    strl__free(source);
}

strl_status strl_source_open_memory(const void *data, size_t size, strl_source **source, strl_error *err)
{
    static const strl_source_class klass = {
        .kind = "memory",
        .submit = strl__fetched_submit,
        .poll = strl__fetched_poll,
        .cancel = strl__fetched_cancel,
        .read = memory_read,
        .close = memory_close,
    };
    *source = NULL;
    memory_source *self = strl__alloc_zero(1, sizeof *self);
    if (!self)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to open a memory source");
    strl__fetched_init(&self->fetched, 0, NULL); /* without threads it cannot fail */
    self->fetched.base = (strl_source){.klass = &klass, .bytes = size};
    self->data = data;
    *source = &self->fetched.base;
    return STRL_OK;
}
