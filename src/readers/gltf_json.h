/* Splits a JSON text of any length into the elements of its top-level lists, so that only one
 * element is ever a tree in memory (which takes up to 18 times its text). Of each element
 * - "extras" become null: nobody here reads them, and they can be most of the text;
 * - strings that begin with data: become "data:@OFFSET+BYTES", where the string stands in the file.
 * What is passed over is not checked beyond its brackets and strings. */
#ifndef STRL_READERS_GLTF_JSON_H
#define STRL_READERS_GLTF_JSON_H

#include <jansson.h>
#include <stdbool.h>
#include <stdint.h>

#include "readers/input.h"
#include "stroll/error.h"

#define STRL__JSON_WHOLE UINT64_MAX

typedef struct strl__json_sink {
    void *context;
    size_t most_bytes; /* of one element's text */
    /* Whether a top-level member is to be taken, else it is passed over. */
    bool (*wants)(void *context, const char *member);
    /* index: of the element, or STRL__JSON_WHOLE where the member is no list. value is borrowed. */
    strl_status (*take)(void *context, const char *member, uint64_t index, const json_t *value, strl_error *err);
    /* Tells that the element at a byte of the file is longer than most_bytes. */
    strl_status (*refuse)(void *context, uint64_t at, size_t bytes, strl_error *err);
} strl__json_sink;

/* From where the input stands to its end. path is for sentences. */
strl_status strl__json_split(strl__input *input, const char *path, const strl__json_sink *sink, strl_error *err);

#endif
