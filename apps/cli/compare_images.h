/* How far an image drawn with levels of detail is from its reference: coverage, depth, colour. */
#ifndef STRL_CLI_COMPARE_IMAGES_H
#define STRL_CLI_COMPARE_IMAGES_H

#include <stdint.h>

#include "shared/image.h"

/* One frame of one side. Both sides have the same size. A pixel is covered where depth is finite. */
typedef struct strl_compare_side {
    const uint8_t *rgb;
    const float *depth;
} strl_compare_side;

typedef struct strl_compare_frame {
    uint64_t uncovered;   /* pixels whose 5x5 neighbourhood is wholly covered in the reference, and background here */
    uint64_t overcovered; /* the same with covered and background exchanged */
    uint64_t both;        /* pixels covered in both */
    /* of them, those whose depth leaves the range of the reference's 3x3 neighbourhood, widened by
     * error_px * z / focal_px */
    uint64_t depth_outside;
    uint64_t either;            /* pixels covered in either */
    uint64_t differing;         /* of them, those of another colour */
    uint64_t visibly_differing; /* of them, those of which a channel differs by more than 16 of 255 */
    double psnr_db;             /* over RGB of those; at most 100; 100 where there is none */
} strl_compare_frame;

void strl_compare_images(const strl_compare_side *reference, const strl_compare_side *image, uint32_t width,
                         uint32_t height, double error_px, double focal_px, strl_compare_frame *result);

#endif
