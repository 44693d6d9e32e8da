/* PNG by libpng, whose failures come back by longjmp: what it leaves is in one structure. */
#include <inttypes.h>
#include <png.h>
#include <setjmp.h>
#include <stdio.h>

#include "base/fail.h"
#include "base/memory.h"
#include "readers/image_internal.h"

#define CHUNK_BYTES_MAX ((size_t)1 << 20)
#define CHUNKS_MAX 64u
#define WORKING_BYTES 24u /* a column: two rows of up to 8 bytes a texel */
#define LEAST_RATIO 1040u /* deflate makes no more of a byte */

typedef struct png_job {
    strl__image_making *making;
    uint64_t at; /* in the source */
    png_structp png;
    png_infop info;
    uint8_t *rows; /* owned: one row, or all of an interlaced image */
    bool interlaced;
    strl_error failure; /* of reading, or what libpng says */
} png_job;

static void on_error(png_structp png, png_const_charp text)
{
    png_job *job = png_get_error_ptr(png);
    if (!job->failure.status)
        strl__fail(&job->failure, STRL_ERR_FORMAT, "is damaged: %.80s", text);
    png_longjmp(png, 1);
}

static void on_warning(png_structp png, png_const_charp text)
{
    (void)png;
    (void)text;
}

static void on_read(png_structp png, png_bytep data, size_t size)
{
    png_job *job = png_get_io_ptr(png);
    if (strl__image_read(job->making, job->at, data, size, &job->failure))
        png_error(png, "cannot read");
    job->at += size;
}

static png_voidp on_alloc(png_structp png, png_alloc_size_t size)
{
    png_job *job = png_get_mem_ptr(png);
    void *block = strl__alloc(size, 1);
    if (!block)
        strl__fail(&job->failure, STRL_ERR_MEMORY, "no memory to decode a PNG image");
    return block;
}

static void on_free(png_structp png, png_voidp block)
{
    (void)png;
    strl__free(block);
}

/* Eight bits a channel, four channels, whatever the file has. */
static void set_transforms(const png_job *job)
{
    const png_structp png = job->png;
    png_set_expand(png);
    png_set_scale_16(png);
    png_set_gray_to_rgb(png);
    png_set_add_alpha(png, 255, PNG_FILLER_AFTER);
}

static void begin(png_job *job)
{
    const png_structp png = job->png;
    png_read_info(png, job->info);
    const uint64_t width = png_get_image_width(png, job->info);
    const uint64_t height = png_get_image_height(png, job->info);
    const uint64_t stored = png_get_rowbytes(png, job->info) * height;
    job->interlaced = png_get_interlace_type(png, job->info) != PNG_INTERLACE_NONE;
    if (stored / LEAST_RATIO > job->making->source->bytes)
        strl__fail(&job->failure, STRL_ERR_FORMAT, "announces %" PRIu64 " x %" PRIu64 " texels in %" PRIu64 " bytes",
                   width, height, job->making->source->bytes);
    set_transforms(job);
    if (!job->failure.status)
        strl__image_begin(job->making, width, height,
                          4 * width * (job->interlaced ? height : 1) + WORKING_BYTES * width, &job->failure);
    if (!job->failure.status) {
        job->rows = strl__alloc((size_t)(4 * width), job->interlaced ? (size_t)height : 1);
        if (!job->rows)
            strl__fail(&job->failure, STRL_ERR_MEMORY, "no memory to decode a PNG image");
    }
    if (job->failure.status)
        png_error(png, "cannot begin");
}

/* Returns 0, or -1 after a failure. */
static int read_all(png_job *job)
{
    if (setjmp(png_jmpbuf(job->png)))
        return -1;
    png_set_user_limits(job->png, STRL__IMAGE_SIDE_MAX, STRL__IMAGE_SIDE_MAX);
    png_set_chunk_malloc_max(job->png, CHUNK_BYTES_MAX);
    png_set_chunk_cache_max(job->png, CHUNKS_MAX);
    png_set_read_fn(job->png, job, on_read);
    begin(job);
    const uint32_t height = job->making->image->height;
    const size_t stride = 4 * (size_t)job->making->image->width;
    const int passes = png_set_interlace_handling(job->png);
    png_read_update_info(job->png, job->info);
    if (png_get_rowbytes(job->png, job->info) != stride)
        png_error(job->png, "its rows are of another size");
    for (int pass = 0; pass < passes; pass++)
        for (uint32_t y = 0; y < height; y++) {
            uint8_t *row = job->rows + (job->interlaced ? y * stride : 0);
            png_read_row(job->png, row, NULL);
            if (pass == passes - 1)
                strl__image_row(job->making, row);
        }
    return 0;
}

strl_status strl__image_read_png(strl__image_making *making, strl_error *err)
{
    png_job job = {.making = making};
    job.png = png_create_read_struct_2(PNG_LIBPNG_VER_STRING, &job, on_error, on_warning, &job, on_alloc, on_free);
    job.info = job.png ? png_create_info_struct(job.png) : NULL;
    int failed = job.info ? read_all(&job) : -1;
    if (!job.info)
        job.failure.status = STRL_ERR_MEMORY;
    png_destroy_read_struct(&job.png, &job.info, NULL);
    strl__free(job.rows);
    if (!failed)
        return STRL_OK;
    return strl__fail(err, job.failure.status, "%s", job.failure.message);
}
