/* Images (PNG by libpng, JPEG by libjpeg) as pyramids of RGBA8, for looking up colours. What a file
 * announces is checked against limits before it sizes anything; an image that does not fit is
 * halved, row by row, while it is decoded. */
#ifndef STRL_READERS_IMAGE_H
#define STRL_READERS_IMAGE_H

#include <stddef.h>
#include <stdint.h>

#include "readers/srgb.h"
#include "stroll/error.h"

#define STRL__IMAGE_SIDE_MAX 65535u
#define STRL__IMAGE_TEXELS_MAX ((uint64_t)1 << 28)
#define STRL__IMAGE_LEVELS_MAX 17u

/* Where a file's bytes come from. */
typedef struct strl__image_source {
    void *context;
    /* Exactly size bytes, inside of it. */
    strl_status (*read)(void *context, uint64_t offset, void *data, size_t size, strl_error *err);
    uint64_t bytes;
} strl__image_source;

typedef struct strl__image_level {
    uint32_t width, height;
    size_t first; /* texel */
} strl__image_level;

typedef struct strl__image {
    uint32_t width, height; /* as the file has them */
    unsigned halvings;      /* of the finest level that is held */
    unsigned level_count;   /* each half of the one before, rounded up, to one texel */
    strl__image_level level[STRL__IMAGE_LEVELS_MAX];
    uint8_t *texels; /* owned; R, G, B (sRGB-encoded), A; rows from the top */
    uint64_t bytes;  /* of texels */
} strl__image;

/* Memory for a decoder and its image together. */
typedef struct strl__image_room {
    uint64_t limit_bytes;
    uint64_t image_bytes; /* of them for the image alone, which is halved until it fits; 0 = all */
    const char *advice;   /* static: how to get more; NULL: none */
    void *context;
    /* Called once, before they are taken; bytes <= limit. May be NULL. */
    void (*make)(void *context, uint64_t bytes);
} strl__image_room;

/* STRL_ERR_MEMORY where the heap ends; any other failure is the file's, and `err` says why in words
 * that follow its name: "is cut off". */
strl_status strl__image_decode(const strl__image_source *source, const strl__image_room *room, const strl__srgb *srgb,
                               strl__image *image, strl_error *err);
void strl__image_deinit(strl__image *image);

typedef enum strl__wrap { STRL__WRAP_REPEAT, STRL__WRAP_CLAMP, STRL__WRAP_MIRROR } strl__wrap;

/* Where to look: u to the right and v down, 1 = the whole image; footprint: the side of the square
 * that is averaged, in texels of the file. */
typedef struct strl__image_spot {
    double u, v, footprint;
    strl__wrap wrap[2];
} strl__image_spot;

/* Linear light R, G, B, and A, each 0..1: between the two levels next to the footprint. */
void strl__image_sample(const strl__image *image, const strl__srgb *srgb, const strl__image_spot *spot, double rgba[4]);

#endif
