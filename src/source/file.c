/* A file as a source. */
#include "base/fail.h"
#include "base/memory.h"
#include "platform/file.h"
#include "source/fetched.h"

typedef struct file_source {
    strl__fetched fetched;
    strl_file *file; /* owned */
} file_source;

static strl_status file_read(strl_source *source, uint64_t offset, void *data, size_t size, strl_error *err)
{
    return strl_file_read(((file_source *)source)->file, offset, data, size, err);
}

static void file_close(strl_source *source)
{
    file_source *self = (file_source *)source;
    strl__fetched_deinit(&self->fetched);
    strl_file_close(self->file, NULL);
    strl__free(self);
}

strl_status strl_source_open_file(const char *path, unsigned threads, strl_source **source, strl_error *err)
{
    static const strl_source_class klass = {
        .kind = "file",
        .submit = strl__fetched_submit,
        .poll = strl__fetched_poll,
        .cancel = strl__fetched_cancel,
        .read = file_read,
        .close = file_close,
    };
    *source = NULL;
    file_source *self = strl__alloc_zero(1, sizeof *self);
    if (!self)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to open %.300s", path);
    strl_status status = strl__fetched_init(&self->fetched, threads, err);
    if (status == STRL_OK)
        status = strl_file_open(path, &self->file, err);
    if (status != STRL_OK) {
        file_close(&self->fetched.base);
        return status;
    }
    self->fetched.base = (strl_source){&klass, strl_file_bytes(self->file), strl_file_path(self->file)};
    *source = &self->fetched.base;
    return STRL_OK;
}
