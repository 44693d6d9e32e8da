/* A forward window over a file, for text and for records. A failed read is sticky: the window then
 * behaves as if the file ended there, so that parsers need no check after every token; whoever
 * meets the end asks strl__input_status first. */
#ifndef STRL_READERS_INPUT_H
#define STRL_READERS_INPUT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "platform/file.h"
#include "stroll/error.h"

/* The longest token of text, and so what a parser may look at without asking again. */
#define STRL__TOKEN_BYTES 4096u

typedef struct strl__input {
    strl_file *file;  /* borrowed */
    const char *name; /* for sentences: the file's path, or the one of the file that it was made from; borrowed */
    char *buffer;     /* owned; capacity + 1 bytes */
    size_t capacity;
    const char *at;      /* next byte */
    const char *end;     /* end of what is in the buffer; *end is 0 and readable */
    uint64_t end_offset; /* of `end` in the file */
    uint64_t file_bytes; /* where reading stops */
    uint64_t line;       /* of `at`, from 1; kept by the text functions */
    bool failed;
    strl_error failure;
} strl__input;

/* capacity >= STRL__TOKEN_BYTES. */
strl_status strl__input_init(strl__input *input, strl_file *file, size_t capacity, strl_error *err);
void strl__input_deinit(strl__input *input);
/* Gives the buffer back. */
void strl__input_rest(strl__input *input);
/* Makes a buffer that was given back, at the beginning of the file. */
strl_status strl__input_wake(strl__input *input, strl_error *err);
/* Forgets an earlier failure. */
void strl__input_seek(strl__input *input, uint64_t offset, uint64_t line);
/* The failed read, if there was one. */
strl_status strl__input_status(const strl__input *input, strl_error *err);
/* Tries to have `bytes` (<= capacity) bytes from `at` on in the buffer. Moves what `at` points at.
 */
void strl__input_refill(strl__input *input, size_t bytes);
/* Passes over bytes; false where the file ends before. */
bool strl__input_skip(strl__input *input, uint64_t bytes);

static inline uint64_t strl__input_offset(const strl__input *input)
{
    return input->end_offset - (uint64_t)(input->end - input->at);
}

/* Bytes of the file that were not consumed yet. */
static inline uint64_t strl__input_left(const strl__input *input)
{
    return input->file_bytes - strl__input_offset(input);
}

/* False where fewer than `bytes` are left in the file. */
static inline bool strl__input_want(strl__input *input, size_t bytes)
{
    if (__builtin_expect((size_t)(input->end - input->at) < bytes && input->end_offset < input->file_bytes, 0))
        strl__input_refill(input, bytes);
    return (size_t)(input->end - input->at) >= bytes;
}

#endif
