/* See stream.h. */
#include "scenes/stream.h"

#include <string.h>

#include "base/fail.h"
#include "base/memory.h"

enum { BUFFER_BYTES = 1 << 20 };

strl_status strl__stream_init(strl__stream *stream, const char *path, strl_error *err)
{
    stream->capacity = BUFFER_BYTES;
    stream->buffer = strl__alloc(BUFFER_BYTES, 1);
    if (!stream->buffer)
        return strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for an output buffer of %d bytes", path, BUFFER_BYTES);
    return STRL_OK;
}

void strl__stream_deinit(strl__stream *stream)
{
    strl__free(stream->buffer);
    *stream = (strl__stream){0};
}

strl_status strl__stream_flush(strl__stream *stream, strl_error *err)
{
    strl_status status = strl_file_write(stream->file, stream->offset, stream->buffer, stream->used, err);
    if (status == STRL_OK) {
        stream->offset += stream->used;
        stream->used = 0;
    }
    return status;
}

strl_status strl__stream_reserve(strl__stream *stream, size_t bytes, strl_error *err)
{
    return stream->capacity - stream->used < bytes ? strl__stream_flush(stream, err) : STRL_OK;
}

strl_status strl__stream_write(strl__stream *stream, const void *data, uint64_t bytes, strl_error *err)
{
    const uint8_t *from = data;
    while (bytes > 0) {
        strl_status status = strl__stream_reserve(stream, 1, err);
        if (status != STRL_OK)
            return status;
        size_t room = stream->capacity - stream->used;
        size_t part = bytes < room ? (size_t)bytes : room;
        memcpy(stream->buffer + stream->used, from, part);
        stream->used += part;
        from += part;
        bytes -= part;
    }
    return STRL_OK;
}
