/* What image.c and its decoders share. A decoder reads the header, calls begin, and then row for
 * each row from the top. */
#ifndef STRL_READERS_IMAGE_INTERNAL_H
#define STRL_READERS_IMAGE_INTERNAL_H

#include <stdbool.h>

#include "readers/image.h"

typedef struct strl__image_making {
    const strl__image_source *source;
    const strl__image_room *room;
    const strl__srgb *srgb;
    strl__image *image;
    double *sums; /* owned; of the row under way, four a texel; NULL: nothing is halved */
    uint32_t row; /* of the file, next */
} strl__image_making;

/* working_bytes: what the decoder will take beside the image. */
strl_status strl__image_begin(strl__image_making *making, uint64_t width, uint64_t height, uint64_t working_bytes,
                              strl_error *err);
/* R, G, B, A of each texel of the next row. */
void strl__image_row(strl__image_making *making, const uint8_t *row);

/* From the source, with words that follow the image's name. */
strl_status strl__image_read(const strl__image_making *making, uint64_t at, void *data, size_t size, strl_error *err);

strl_status strl__image_read_png(strl__image_making *making, strl_error *err);
strl_status strl__image_read_jpeg(strl__image_making *making, strl_error *err);

#endif
