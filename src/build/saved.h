/* Fields of a stream of a checkpoint, little-endian: written through a small buffer, read back through another. */
#ifndef STRL_BUILD_SAVED_H
#define STRL_BUILD_SAVED_H

#include "base/cursor.h"
#include "store/spill.h"

typedef struct strl_saved_writer {
    strl_spill *spill; /* borrowed */
    strl_writer bytes; /* fields go in here; owned */
} strl_saved_writer;

/* Between two records: appends what there is, once it is worth it. */
strl_status strl_saved_put(strl_saved_writer *writer, strl_error *err);
/* Appends the rest and releases the buffer, in any case. `status`: of the writing so far, which is returned if it is a
 * failure. */
strl_status strl_saved_finish(strl_saved_writer *writer, strl_status status, strl_error *err);

typedef struct strl_saved_reader {
    strl_spill *spill; /* borrowed */
    uint64_t at;       /* of the next byte to be read into the buffer */
    uint8_t *buffer;   /* owned */
    size_t capacity;
    strl_cursor cursor; /* over the buffer: fields come out of here */
} strl_saved_reader;

/* Makes the next `bytes` bytes readable through the cursor; fails where the stream has fewer left. */
strl_status strl_saved_get(strl_saved_reader *reader, uint64_t bytes, strl_error *err);
/* Bytes that the cursor has not passed yet. */
uint64_t strl_saved_left(const strl_saved_reader *reader);
void strl_saved_reader_deinit(strl_saved_reader *reader);

/* What a checkpoint says cannot be: `what` is the thing. */
strl_status strl_saved_fail(const char *what, strl_error *err);

#endif
