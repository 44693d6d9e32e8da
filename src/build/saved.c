#include "build/saved.h"

#include "base/fail.h"
#include "base/memory.h"

#define PIECE_BYTES ((size_t)64 << 10)

static strl_status append(strl_saved_writer *writer, strl_error *err)
{
    if (writer->bytes.failed)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to save a stage");
    strl_status status = strl_spill_append(writer->spill, writer->bytes.data, writer->bytes.size, err);
    writer->bytes.size = 0;
    return status;
}

strl_status strl_saved_put(strl_saved_writer *writer, strl_error *err)
{
    return writer->bytes.size < PIECE_BYTES && !writer->bytes.failed ? STRL_OK : append(writer, err);
}

strl_status strl_saved_finish(strl_saved_writer *writer, strl_status status, strl_error *err)
{
    if (!status)
        status = append(writer, err);
    strl__free(writer->bytes.data);
    writer->bytes = (strl_writer){0};
    return status;
}

uint64_t strl_saved_left(const strl_saved_reader *reader)
{
    return strl_spill_bytes(reader->spill) - reader->at + strl_cursor_left(&reader->cursor);
}

strl_status strl_saved_get(strl_saved_reader *reader, uint64_t bytes, strl_error *err)
{
    size_t left = strl_cursor_left(&reader->cursor);
    if (bytes <= left)
        return STRL_OK;
    uint64_t more = strl_spill_bytes(reader->spill) - reader->at;
    if (bytes > left + more)
        return strl_saved_fail("a stage ends too early", err);
    size_t need = bytes < PIECE_BYTES ? PIECE_BYTES : (size_t)bytes;
    if (left)
        memmove(reader->buffer, reader->buffer + reader->cursor.at, left);
    if (need > reader->capacity && !strl__grow(&reader->buffer, &reader->capacity, need, 1))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to go on with a saved stage");
    size_t size = more < need - left ? (size_t)more : need - left;
    strl_status status = strl_spill_read(reader->spill, reader->at, reader->buffer + left, size, err);
    reader->at += size;
    reader->cursor = strl_cursor_make(reader->buffer, status ? 0 : left + size);
    return status;
}

void strl_saved_reader_deinit(strl_saved_reader *reader)
{
    strl__free(reader->buffer);
    *reader = (strl_saved_reader){0};
}

strl_status strl_saved_fail(const char *what, strl_error *err)
{
    return strl__fail(err, STRL_ERR_FORMAT, "the stages that an earlier build has saved cannot be used (%s)", what);
}
