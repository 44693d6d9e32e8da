#include "viewer/screenshot.h"

#include "base/fail.h"
#include "base/memory.h"
#include "shared/image.h"
#include "viewer/free_name.h"

/* Alpha is coverage and no part of the picture. */
static void drop_alpha(uint8_t *pixels, size_t count)
{
    for (size_t p = 0; p < count; p++)
        for (size_t c = 0; c < 3; c++)
            pixels[3 * p + c] = pixels[4 * p + c];
}

strl_status strl_screenshot_write(strl_renderer *renderer, uint32_t width, uint32_t height, const char *folder,
                                  char *path, size_t path_size, strl_error *err)
{
    uint8_t *pixels = strl__alloc((size_t)width * height, 4);
    strl_status status = pixels ? strl_free_name(folder, "stroll_", ".png", path, path_size, err)
                                : strl__fail(err, STRL_ERR_MEMORY, "no memory for an image");
    if (status == STRL_OK)
        status = strl_renderer_read_colour(renderer, pixels, err);
    if (status == STRL_OK) {
        drop_alpha(pixels, (size_t)width * height);
        const strl_image image = {width, height, pixels};
        status = strl_image_write_png(&image, path, err);
    }
    strl__free(pixels);
    return status;
}
