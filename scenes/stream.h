/* A file written from its start to its end through a buffer. */
#ifndef STRL_SCENES_STREAM_H
#define STRL_SCENES_STREAM_H

#include <stddef.h>
#include <stdint.h>

#include "platform/file.h"

typedef struct strl__stream {
    strl_file *file; /* borrowed */
    uint8_t *buffer;
    size_t used, capacity;
    uint64_t offset; /* in the file, of the buffer's first byte */
} strl__stream;

/* Of a stream that is zero but for what is set; the file may be set later. path: for the sentence. */
strl_status strl__stream_init(strl__stream *stream, const char *path, strl_error *err);
void strl__stream_deinit(strl__stream *stream);
strl_status strl__stream_write(strl__stream *stream, const void *data, uint64_t bytes, strl_error *err);
/* Room for `bytes` (at most the capacity) at buffer + used, for who makes records in place and adds to `used`. */
strl_status strl__stream_reserve(strl__stream *stream, size_t bytes, strl_error *err);
strl_status strl__stream_flush(strl__stream *stream, strl_error *err);

#endif
