/* Names in the container are UTF-8 without a zero byte. Internal. */
#ifndef STRL_CONTAINER_NAMES_H
#define STRL_CONTAINER_NAMES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Length of the UTF-8 sequence (Unicode 15, table 3-7) at text, 1 to 4; 0 where there is none within `left` bytes. */
unsigned strl__utf8_length(const uint8_t *text, size_t left);
/* Whether all of it is UTF-8 without a zero byte. */
bool strl__utf8_is_name(const uint8_t *text, size_t bytes);
/* Copies a zero-terminated name, each byte that is not UTF-8 replaced by U+FFFD. False where it needs more than
 * capacity bytes. out is not terminated. */
bool strl__utf8_clean(const char *name, uint8_t *out, size_t capacity, size_t *bytes);

#endif
