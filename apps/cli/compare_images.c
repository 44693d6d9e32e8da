#include "compare_images.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>

#define MOST_DB 100.0
#define VISIBLE_STEPS 16 /* of 255 */

typedef struct frame_size {
    int width, height;
} frame_size;

static bool covered(const float *depth, size_t pixel)
{
    return isfinite(depth[pixel]);
}

/* How many pixels of the neighbourhood lie in the image, and how many of those are covered. */
static void count_neighbours(const float *depth, frame_size size, int x, int y, int reach, int *inside,
                             int *covered_count)
{
    *inside = *covered_count = 0;
    for (int dy = -reach; dy <= reach; dy++)
        for (int dx = -reach; dx <= reach; dx++) {
            if (x + dx < 0 || y + dy < 0 || x + dx >= size.width || y + dy >= size.height)
                continue;
            *inside += 1;
            *covered_count += covered(depth, (size_t)(y + dy) * (size_t)size.width + (size_t)(x + dx));
        }
}

static void compare_coverage(const float *reference, const float *image, frame_size size, int x, int y,
                             strl_compare_frame *result)
{
    size_t pixel = (size_t)y * (size_t)size.width + (size_t)x;
    /* Where both agree there is nothing to find: most pixels. */
    if (covered(reference, pixel) == covered(image, pixel))
        return;
    int inside, count;
    count_neighbours(reference, size, x, y, 2, &inside, &count);
    result->uncovered += count == inside;
    result->overcovered += count == 0;
}

static void compare_depth(const float *reference, const float *image, frame_size size, int x, int y, double widen,
                          strl_compare_frame *result)
{
    size_t pixel = (size_t)y * (size_t)size.width + (size_t)x;
    if (!covered(reference, pixel) || !covered(image, pixel))
        return;
    double least = INFINITY, largest = -INFINITY, margin = widen * reference[pixel];
    for (int dy = -1; dy <= 1; dy++)
        for (int dx = -1; dx <= 1; dx++) {
            if (x + dx < 0 || y + dy < 0 || x + dx >= size.width || y + dy >= size.height)
                continue;
            float depth = reference[(size_t)(y + dy) * (size_t)size.width + (size_t)(x + dx)];
            if (isfinite(depth))
                least = fmin(least, depth), largest = fmax(largest, depth);
        }
    result->both++;
    result->depth_outside += image[pixel] < least - margin || image[pixel] > largest + margin;
}

static double psnr(const strl_compare_side *a, const strl_compare_side *b, size_t pixels, uint64_t *either)
{
    double sum = 0;
    *either = 0;
    for (size_t p = 0; p < pixels; p++) {
        if (!covered(a->depth, p) && !covered(b->depth, p))
            continue;
        ++*either;
        for (size_t c = 0; c < 3; c++) {
            double difference = (double)a->rgb[3 * p + c] - b->rgb[3 * p + c];
            sum += difference * difference;
        }
    }
    if (sum == 0)
        return MOST_DB;
    return fmin(MOST_DB, 10 * log10(255.0 * 255.0 * 3 * (double)*either / sum));
}

static void count_differing(const strl_compare_side *a, const strl_compare_side *b, size_t pixels,
                            strl_compare_frame *result)
{
    for (size_t p = 0; p < pixels; p++) {
        int most = 0;
        if (!covered(a->depth, p) && !covered(b->depth, p))
            continue;
        for (size_t c = 0; c < 3; c++) {
            int difference = abs(a->rgb[3 * p + c] - b->rgb[3 * p + c]);
            most = difference > most ? difference : most;
        }
        result->differing += most > 0;
        result->visibly_differing += most > VISIBLE_STEPS;
    }
}

void strl_compare_images(const strl_compare_side *reference, const strl_compare_side *image, uint32_t width,
                         uint32_t height, double error_px, double focal_px, strl_compare_frame *result)
{
    frame_size size = {(int)width, (int)height};
    *result = (strl_compare_frame){0};
    for (int y = 0; y < size.height; y++)
        for (int x = 0; x < size.width; x++) {
            compare_coverage(reference->depth, image->depth, size, x, y, result);
            compare_depth(reference->depth, image->depth, size, x, y, error_px / focal_px, result);
        }
    result->psnr_db = psnr(reference, image, (size_t)width * height, &result->either);
    count_differing(reference, image, (size_t)width * height, result);
}
