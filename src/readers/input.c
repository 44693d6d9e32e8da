#include "readers/input.h"

#include <inttypes.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"

strl_status strl__input_init(strl__input *input, strl_file *file, size_t capacity, strl_error *err)
{
    *input = (strl__input){
        .file = file, .name = strl_file_path(file), .capacity = capacity, .file_bytes = strl_file_bytes(file)};
    return strl__input_wake(input, err);
}

void strl__input_rest(strl__input *input)
{
    strl__free(input->buffer);
    input->buffer = NULL;
}

strl_status strl__input_wake(strl__input *input, strl_error *err)
{
    if (input->buffer)
        return STRL_OK;
    input->buffer = strl__alloc(input->capacity + 1, 1);
    if (!input->buffer)
        return strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for a read buffer of %zu bytes", input->name,
                          input->capacity);
    strl__input_seek(input, 0, 1);
    return STRL_OK;
}

void strl__input_deinit(strl__input *input)
{
    strl__free(input->buffer);
    *input = (strl__input){0};
}

void strl__input_seek(strl__input *input, uint64_t offset, uint64_t line)
{
    input->file_bytes = strl_file_bytes(input->file);
    input->at = input->end = input->buffer;
    input->buffer[0] = 0;
    input->end_offset = offset < input->file_bytes ? offset : input->file_bytes;
    input->line = line;
    input->failed = false;
}

strl_status strl__input_status(const strl__input *input, strl_error *err)
{
    if (!input->failed)
        return STRL_OK;
    if (err)
        *err = input->failure;
    return input->failure.status;
}

static void stop_here(strl__input *input)
{
    input->failed = true;
    input->file_bytes = input->end_offset;
}

void strl__input_refill(strl__input *input, size_t bytes)
{
    size_t kept = (size_t)(input->end - input->at);
    memmove(input->buffer, input->at, kept);
    input->at = input->buffer;
    input->end = input->buffer + kept;
    while (kept < bytes && input->end_offset < input->file_bytes) {
        size_t got = 0;
        if (strl_file_read_some(input->file, input->end_offset, input->buffer + kept, input->capacity - kept, &got,
                                &input->failure)) {
            got = 0; /* part of it may have come; where reading stopped must not depend on that */
            stop_here(input);
        } else if (got == 0) {
            strl__fail(&input->failure, STRL_ERR_FORMAT,
                       "%s ends at byte %" PRIu64 ", but it had %" PRIu64 " bytes when it was opened", input->name,
                       input->end_offset, input->file_bytes);
            stop_here(input);
        }
        kept += got;
        input->end += got;
        input->end_offset += got;
        if (input->end_offset > input->file_bytes && !input->failed) { /* the file grew: the rest is not ours */
            size_t excess = (size_t)(input->end_offset - input->file_bytes);
            input->end -= excess;
            input->end_offset -= excess;
        }
    }
    input->buffer[input->end - input->buffer] = 0;
}

bool strl__input_skip(strl__input *input, uint64_t bytes)
{
    uint64_t buffered = (uint64_t)(input->end - input->at);
    if (bytes <= buffered) {
        input->at += bytes;
        return true;
    }
    if (bytes > strl__input_left(input))
        return false;
    input->end_offset += bytes - buffered;
    input->at = input->end = input->buffer;
    input->buffer[0] = 0;
    return true;
}
