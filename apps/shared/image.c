#include "shared/image.h"

#include <inttypes.h>
#include <math.h>
#include <png.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "geometry/colour.h"
#include "platform/file.h"
#include "platform/output.h"

#define MOST_SIDE 16384u
#define MOST_SHEET_SIDE 8192u
#define CELL_WIDTH 320u
#define PFM_HEAD_BYTES 64

strl_status strl_image_init(strl_image *image, uint32_t width, uint32_t height, strl_error *err)
{
    *image = (strl_image){width, height, strl__alloc_zero((size_t)width * height, 3)};
    if (!image->rgb)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for an image of %" PRIu32 "x%" PRIu32 " pixels", width,
                          height);
    return STRL_OK;
}

void strl_image_deinit(strl_image *image)
{
    strl__free(image->rgb);
    *image = (strl_image){0};
}

strl_status strl_image_write_png(const strl_image *image, const char *path, strl_error *err)
{
    png_image png = {
        .version = PNG_IMAGE_VERSION, .width = image->width, .height = image->height, .format = PNG_FORMAT_RGB};
    strl_output *output = NULL;
    FILE *stream = NULL;
    strl_status status = strl_output_open(path, NULL, &output, err);
    if (status == STRL_OK)
        status = strl_output_stream(output, &stream, err);
    if (status == STRL_OK && !png_image_write_to_stdio(&png, stream, 0, image->rgb, 0, NULL))
        status = strl__fail(err, STRL_ERR_IO, "cannot write the image %s: %s", path, png.message);
    if (status == STRL_OK)
        status = strl_output_finish(output, false, err);
    strl_output_close(output);
    return status;
}

strl_status strl_image_read_png(strl_image *image, const char *path, strl_error *err)
{
    *image = (strl_image){0};
    png_image png = {.version = PNG_IMAGE_VERSION};
    if (!png_image_begin_read_from_file(&png, path))
        return strl__fail(err, STRL_ERR_FORMAT, "cannot read the image %s: %s", path, png.message);
    strl_status status;
    if (png.width > MOST_SIDE || png.height > MOST_SIDE)
        status = strl__fail(err, STRL_ERR_LIMIT, "the image %s has %ux%u pixels, expected at most %ux%u", path,
                            png.width, png.height, MOST_SIDE, MOST_SIDE);
    else
        status = strl_image_init(image, png.width, png.height, err);
    png.format = PNG_FORMAT_RGB;
    if (status == STRL_OK && !png_image_finish_read(&png, NULL, image->rgb, 0, NULL))
        status = strl__fail(err, STRL_ERR_FORMAT, "cannot read the image %s: %s", path, png.message);
    png_image_free(&png);
    if (status != STRL_OK)
        strl_image_deinit(image);
    return status;
}

strl_status strl_depth_write(const float *depth, uint32_t width, uint32_t height, const char *path, strl_error *err)
{
    strl_output *output = NULL;
    char head[PFM_HEAD_BYTES];
    int head_bytes = snprintf(head, sizeof head, "Pf\n%" PRIu32 " %" PRIu32 "\n-1.0\n", width, height);
    size_t row_bytes = (size_t)width * sizeof *depth;
    strl_status status = strl_output_open(path, NULL, &output, err);
    strl_file *file = status == STRL_OK ? strl_output_file(output) : NULL;
    if (status == STRL_OK)
        status = strl_file_write(file, 0, head, (size_t)head_bytes, err);
    for (uint32_t row = 0; status == STRL_OK && row < height; row++)
        status = strl_file_write(file, (uint64_t)head_bytes + row * row_bytes,
                                 depth + (size_t)(height - 1 - row) * width, row_bytes, err);
    if (status == STRL_OK)
        status = strl_output_finish(output, false, err);
    strl_output_close(output);
    return status;
}

/* Reads the three lines; *at is where the floats begin. */
static strl_status read_head(strl_file *file, uint32_t *width, uint32_t *height, uint64_t *at, strl_error *err)
{
    char head[PFM_HEAD_BYTES + 1];
    size_t got = 0;
    int used = 0;
    strl_status status = strl_file_read_some(file, 0, head, PFM_HEAD_BYTES, &got, err);
    if (status != STRL_OK)
        return status;
    head[got] = 0;
    float scale = 0;
    if (sscanf(head, "Pf%*1[\n]%" SCNu32 " %" SCNu32 "%*1[\n]%f%*1[\n]%n", width, height, &scale, &used) != 3 ||
        used == 0 || !(scale < 0))
        return strl__fail(err, STRL_ERR_FORMAT,
                          "%s is not a depth file: expected the head of a little-endian one-channel PFM",
                          strl_file_path(file));
    *at = (uint64_t)used;
    if (*width == 0 || *height == 0 || *width > MOST_SIDE || *height > MOST_SIDE)
        return strl__fail(err, STRL_ERR_LIMIT, "%s has %" PRIu32 "x%" PRIu32 " pixels, expected 1x1 to %ux%u",
                          strl_file_path(file), *width, *height, MOST_SIDE, MOST_SIDE);
    uint64_t expected = *at + (uint64_t)*width * *height * sizeof(float);
    if (strl_file_bytes(file) != expected)
        return strl__fail(err, STRL_ERR_FORMAT, "%s has %" PRIu64 " bytes, expected %" PRIu64, strl_file_path(file),
                          strl_file_bytes(file), expected);
    return STRL_OK;
}

strl_status strl_depth_read(float **depth, uint32_t *width, uint32_t *height, const char *path, strl_error *err)
{
    *depth = NULL;
    strl_file *file = NULL;
    uint64_t at = 0;
    strl_status status = strl_file_open(path, &file, err);
    if (status == STRL_OK)
        status = read_head(file, width, height, &at, err);
    if (status == STRL_OK) {
        *depth = strl__alloc((size_t)*width * *height, sizeof **depth);
        if (!*depth)
            status = strl__fail(err, STRL_ERR_MEMORY, "no memory for the depth of %s", path);
    }
    for (uint32_t row = 0; status == STRL_OK && row < *height; row++) {
        size_t row_bytes = (size_t)*width * sizeof **depth;
        status =
            strl_file_read(file, at + row * row_bytes, *depth + (size_t)(*height - 1 - row) * *width, row_bytes, err);
    }
    strl_file_close(file, NULL);
    if (status != STRL_OK) {
        strl__free(*depth);
        *depth = NULL;
    }
    return status;
}

strl_status strl_contact_sheet_init(strl_contact_sheet *sheet, uint32_t frames, uint32_t width, uint32_t height,
                                    const uint8_t background[3], strl_error *err)
{
    uint32_t columns = (uint32_t)ceil(sqrt(frames)), rows = (frames + columns - 1) / columns;
    uint32_t most_width = MOST_SHEET_SIDE / columns < CELL_WIDTH ? MOST_SHEET_SIDE / columns : CELL_WIDTH;
    most_width = most_width > 0 ? most_width : 1;
    uint32_t factor = (width + most_width - 1) / most_width;
    *sheet = (strl_contact_sheet){.columns = columns, .factor = factor};
    sheet->cell_width = (width + factor - 1) / factor;
    sheet->cell_height = (height + factor - 1) / factor;
    if ((uint64_t)sheet->cell_width * columns > MOST_SIDE || (uint64_t)sheet->cell_height * rows > MOST_SIDE)
        return strl__fail(err, STRL_ERR_LIMIT, "%" PRIu32 " frames are too many for one contact sheet", frames);
    strl_status status = strl_image_init(&sheet->image, sheet->cell_width * columns, sheet->cell_height * rows, err);
    for (size_t p = 0; status == STRL_OK && p < (size_t)sheet->image.width * sheet->image.height; p++)
        memcpy(sheet->image.rgb + 3 * p, background, 3);
    return status;
}

/* The mean in linear light of the frame's pixels that one sheet pixel stands for. */
static void average(const strl_image *image, uint32_t first_x, uint32_t first_y, uint32_t factor,
                    const float linear[256], uint8_t rgb[3])
{
    uint32_t end_x = first_x + factor < image->width ? first_x + factor : image->width;
    uint32_t end_y = first_y + factor < image->height ? first_y + factor : image->height;
    float sum[3] = {0}, count = (float)(end_x - first_x) * (float)(end_y - first_y);
    for (uint32_t y = first_y; y < end_y; y++)
        for (uint32_t x = first_x; x < end_x; x++)
            for (int c = 0; c < 3; c++)
                sum[c] += linear[image->rgb[3 * ((size_t)y * image->width + x) + (size_t)c]];
    for (int c = 0; c < 3; c++)
        rgb[c] = (uint8_t)strl_srgb_encode(fminf(sum[c] / count, 1));
}

void strl_contact_sheet_add(strl_contact_sheet *sheet, uint32_t frame, const strl_image *image)
{
    float linear[256];
    for (unsigned code = 0; code < 256; code++)
        linear[code] = strl_srgb_decode(code);
    uint32_t left = frame % sheet->columns * sheet->cell_width, top = frame / sheet->columns * sheet->cell_height;
    for (uint32_t y = 0; y < sheet->cell_height; y++)
        for (uint32_t x = 0; x < sheet->cell_width; x++) {
            uint8_t *out = sheet->image.rgb + 3 * ((size_t)(top + y) * sheet->image.width + left + x);
            average(image, x * sheet->factor, y * sheet->factor, sheet->factor, linear, out);
        }
}

void strl_contact_sheet_deinit(strl_contact_sheet *sheet)
{
    strl_image_deinit(&sheet->image);
}
