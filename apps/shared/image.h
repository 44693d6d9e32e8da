/* Pictures in files: PNG for colour, PFM for depth, and the contact sheet. Rows go from top to bottom in memory. */
#ifndef STRL_APPS_IMAGE_H
#define STRL_APPS_IMAGE_H

#include <stdint.h>

#include "stroll/error.h"

/* sRGB-encoded RGB8. */
typedef struct strl_image {
    uint32_t width, height;
    uint8_t *rgb; /* owned; 3 * width * height */
} strl_image;

strl_status strl_image_init(strl_image *image, uint32_t width, uint32_t height, strl_error *err); /* black */
void strl_image_deinit(strl_image *image);
strl_status strl_image_write_png(const strl_image *image, const char *path, strl_error *err);
strl_status strl_image_read_png(strl_image *image, const char *path, strl_error *err);

/* Depth is a PFM file: the line "Pf", the line "WIDTH HEIGHT", the line "-1.0" (little-endian), then 32-bit floats,
 * bottom row first. Distances along the view direction in world units; +infinity = background. */
strl_status strl_depth_write(const float *depth, uint32_t width, uint32_t height, const char *path, strl_error *err);
/* *depth is the caller's (strl__free). */
strl_status strl_depth_read(float **depth, uint32_t *width, uint32_t *height, const char *path, strl_error *err);

/* All frames of a path as small pictures in one. */
typedef struct strl_contact_sheet {
    strl_image image;
    uint32_t columns, factor; /* factor: frame pixels per sheet pixel each way */
    uint32_t cell_width, cell_height;
} strl_contact_sheet;

/* background: where there is no frame, sRGB. */
strl_status strl_contact_sheet_init(strl_contact_sheet *sheet, uint32_t frames, uint32_t width, uint32_t height,
                                    const uint8_t background[3], strl_error *err);
void strl_contact_sheet_add(strl_contact_sheet *sheet, uint32_t frame, const strl_image *image);
void strl_contact_sheet_deinit(strl_contact_sheet *sheet);

#endif
