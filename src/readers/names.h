/* A bounded table of names, each with a colour: parts and materials. An index never changes once it
 * was given. */
#ifndef STRL_READERS_NAMES_H
#define STRL_READERS_NAMES_H

#include <stddef.h>
#include <stdint.h>

#include "stroll/error.h"

/* Longer names are cut here. */
#define STRL__NAME_BYTES_MAX 1023u

typedef struct strl__name {
    char *text;              /* UTF-8; where it lies does not change */
    uint32_t rgba;           /* sRGB-encoded RGBA8, R in the lowest byte */
    uint32_t texture;        /* of a material: among the reader's; UINT32_MAX: none */
    float least[2], most[2]; /* texture coordinates of its triangles so far */
} strl__name;

typedef struct strl__names {
    strl__name *items; /* owned, as are the texts */
    size_t count, capacity;
    uint32_t *slots; /* open addressing; index + 1, 0 = free; owned */
    size_t slot_count;
    size_t text_bytes;
    size_t limit_bytes;
    const char *advice;
} strl__names;

/* advice: where they are too many, "more memory may help"; static. */
void strl__names_init(strl__names *names, size_t limit_bytes, const char *advice);
void strl__names_deinit(strl__names *names);
/* The index of a name, which is added (white) where it is new. Bytes that are not UTF-8 are taken
 * as Latin-1. */
strl_status strl__names_add(strl__names *names, const char *text, size_t length, uint32_t *index, strl_error *err);
/* Bytes of the well-formed UTF-8 sequence at text, 0 where there is none; left > 0. */
size_t strl__utf8_sequence(const unsigned char *text, size_t left);
/* The index of a name, UINT32_MAX where it is unknown. */
uint32_t strl__names_find(const strl__names *names, const char *text, size_t length);

#endif
