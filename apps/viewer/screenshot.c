#include "viewer/screenshot.h"

#include <inttypes.h>
#include <stdio.h>

#include "base/fail.h"
#include "base/memory.h"
#include "platform/file.h"
#include "shared/image.h"

#define MOST_SCREENSHOTS 100000u

static strl_status free_path(const char *folder, char **path, strl_error *err)
{
    for (uint32_t i = 0; i < MOST_SCREENSHOTS; i++) {
        char name[32];
        snprintf(name, sizeof name, "stroll_%05" PRIu32 ".png", i);
        *path = strl_path_join(folder, name);
        if (!*path)
            return strl__fail(err, STRL_ERR_MEMORY, "no memory for a path");
        if (!strl_path_exists(*path))
            return STRL_OK;
        strl__free(*path);
        *path = NULL;
    }
    return strl__fail(err, STRL_ERR_LIMIT, "%s holds %u screenshots already", folder, MOST_SCREENSHOTS);
}

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
    char *file = NULL;
    uint8_t *pixels = strl__alloc((size_t)width * height, 4);
    strl_status status =
        pixels ? strl_path_make_directory(folder, err) : strl__fail(err, STRL_ERR_MEMORY, "no memory for an image");
    if (status == STRL_OK)
        status = free_path(folder, &file, err);
    if (status == STRL_OK)
        status = strl_renderer_read_colour(renderer, pixels, err);
    if (status == STRL_OK) {
        drop_alpha(pixels, (size_t)width * height);
        const strl_image image = {width, height, pixels};
        status = strl_image_write_png(&image, file, err);
    }
    if (status == STRL_OK)
        snprintf(path, path_size, "%s", file);
    strl__free(file);
    strl__free(pixels);
    return status;
}
