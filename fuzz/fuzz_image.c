/* PNG and JPEG from memory: refused with a sentence, or decoded within the limit to texels whose colours are in range
 * wherever one looks. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "readers/image.h"

#define LIMIT ((uint64_t)1 << 20)

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static strl_status read_bytes(void *context, uint64_t offset, void *out, size_t size, strl_error *err)
{
    (void)err;
    memcpy(out, (const uint8_t *)context + offset, size);
    return STRL_OK;
}

static void check(bool holds)
{
    if (!holds)
        abort();
}

static void check_image(const strl__image *image, const strl__srgb *srgb)
{
    static const double places[] = {-1e300, -3.7, 0, 0.33, 0.5, 1, 2.01, 1e9, INFINITY, NAN};
    const unsigned count = sizeof places / sizeof *places;
    check(image->bytes <= LIMIT && image->level_count >= 1);
    for (unsigned i = 0; i < count * count * 3; i++) {
        const strl__image_spot spot = {.u = places[i % count],
                                       .v = places[i / count % count],
                                       .footprint = i % 7 ? 1 << i % 11 : places[i % count],
                                       .wrap = {(strl__wrap)(i % 3), (strl__wrap)(i / count % 3)}};
        double rgba[4];
        strl__image_sample(image, srgb, &spot, rgba);
        for (unsigned k = 0; k < 4; k++)
            check(rgba[k] >= -1e-9 && rgba[k] <= 1 + 1e-9);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const strl__image_source source = {(void *)(uintptr_t)data, read_bytes, size};
    const strl__image_room room = {.limit_bytes = LIMIT};
    strl__image image;
    strl__srgb srgb;
    strl_error err = {0};
    strl__srgb_init(&srgb);
    strl_status status = strl__image_decode(&source, &room, &srgb, &image, &err);
    check(!status == !err.message[0]);
    if (!status)
        check_image(&image, &srgb);
    strl__image_deinit(&image);
    return 0;
}
