/* JPEG by libjpeg, whose failures come back by longjmp: what it leaves is in one structure. */
#include <inttypes.h>
#include <setjmp.h>
#include <stdio.h>
#include <string.h>

#include <jpeglib.h>
#include <jerror.h>

#include "base/fail.h"
#include "base/memory.h"
#include "readers/image_internal.h"

#define SCANS_MAX 200 /* each passes over the whole image */
#define BUFFER_BYTES ((size_t)16 << 10)
#define WORKING_BYTES 128u /* a column: lines before and after their colours are turned */

typedef struct jpeg_job {
    struct jpeg_decompress_struct jpeg;
    struct jpeg_error_mgr errors;
    struct jpeg_source_mgr input;
    struct jpeg_progress_mgr progress;
    strl__image_making *making;
    uint64_t at;        /* in the source: behind what is in buffer */
    strl_error failure; /* of reading, or what libjpeg says */
    jmp_buf back;
    bool is_cut;         /* the file's last marker is not its own */
    uint8_t *line, *row; /* owned: as libjpeg gives it; as RGBA */
    uint8_t buffer[BUFFER_BYTES];
} jpeg_job;

static jpeg_job *job_of(j_common_ptr jpeg)
{
    return jpeg->client_data;
}

_Noreturn static void fail(jpeg_job *job)
{
    longjmp(job->back, 1);
}

_Noreturn static void on_error(j_common_ptr jpeg)
{
    jpeg_job *job = job_of(jpeg);
    char text[JMSG_LENGTH_MAX];
    jpeg->err->format_message(jpeg, text);
    if (jpeg->err->msg_code == JERR_OUT_OF_MEMORY)
        strl__fail(&job->failure, STRL_ERR_MEMORY, "no memory to decode a JPEG image");
    else
        strl__fail(&job->failure, STRL_ERR_FORMAT, "is damaged: %.80s", text);
    fail(job);
}

static void on_message(j_common_ptr jpeg)
{
    (void)jpeg;
}

static void on_warning(j_common_ptr jpeg, int level)
{
    jpeg->err->num_warnings += level < 0;
}

static void on_progress(j_common_ptr jpeg)
{
    jpeg_job *job = job_of(jpeg);
    if (job->jpeg.input_scan_number <= SCANS_MAX)
        return;
    strl__fail(&job->failure, STRL_ERR_LIMIT, "has more than the %d scans that are read", SCANS_MAX);
    fail(job);
}

static void on_begin(j_decompress_ptr jpeg)
{
    (void)jpeg;
}

static boolean on_fill(j_decompress_ptr jpeg)
{
    jpeg_job *job = job_of((j_common_ptr)jpeg);
    const uint64_t left = job->making->source->bytes - job->at;
    size_t size = left < BUFFER_BYTES ? (size_t)left : BUFFER_BYTES;
    if (size == 0 && !job->is_cut && job->at > 0) {
        job->is_cut = true; /* many lack their last marker and no more */
        job->buffer[0] = 0xff;
        job->buffer[1] = JPEG_EOI;
        size = 2;
    } else if (strl__image_read(job->making, job->at, job->buffer, size, &job->failure))
        fail(job);
    job->at += job->is_cut ? 0 : size;
    job->input.next_input_byte = job->buffer;
    job->input.bytes_in_buffer = size;
    return TRUE;
}

static void on_skip(j_decompress_ptr jpeg, long bytes)
{
    jpeg_job *job = job_of((j_common_ptr)jpeg);
    while (bytes > (long)job->input.bytes_in_buffer) {
        bytes -= (long)job->input.bytes_in_buffer;
        on_fill(jpeg);
    }
    if (bytes > 0) {
        job->input.next_input_byte += bytes;
        job->input.bytes_in_buffer -= (size_t)bytes;
    }
}

/* What several scans are gathered in: 64 coefficients a block, of each component. */
static uint64_t coefficient_bytes(const jpeg_job *job)
{
    const struct jpeg_decompress_struct *jpeg = &job->jpeg;
    uint64_t blocks = 0;
    for (int i = 0; i < jpeg->num_components; i++) {
        const jpeg_component_info *part = &jpeg->comp_info[i];
        blocks += ((uint64_t)part->width_in_blocks + (unsigned)part->h_samp_factor) *
                  ((uint64_t)part->height_in_blocks + (unsigned)part->v_samp_factor);
    }
    return blocks * sizeof(JBLOCK);
}

static void begin(jpeg_job *job)
{
    struct jpeg_decompress_struct *jpeg = &job->jpeg;
    jpeg_read_header(jpeg, TRUE);
    const uint64_t width = jpeg->image_width, height = jpeg->image_height;
    const bool is_grey = jpeg->jpeg_color_space == JCS_GRAYSCALE;
    const bool has_four = jpeg->num_components == 4;
    const uint64_t held = jpeg_has_multiple_scans(jpeg) ? coefficient_bytes(job) : 0;
    jpeg->out_color_space = is_grey ? JCS_GRAYSCALE : has_four ? JCS_CMYK : JCS_RGB;
    if (strl__image_begin(job->making, width, height, held + WORKING_BYTES * width, &job->failure))
        fail(job);
    job->line = strl__alloc((size_t)width, 4);
    job->row = strl__alloc((size_t)width, 4);
    if (!job->line || !job->row) {
        strl__fail(&job->failure, STRL_ERR_MEMORY, "no memory to decode a JPEG image");
        fail(job);
    }
    jpeg->mem->max_memory_to_use = 0; /* what it takes was counted */
    jpeg_start_decompress(jpeg);
}

/* Adobe's CMYK is inverted. */
static void to_rgba(const jpeg_job *job)
{
    const int components = job->jpeg.output_components;
    const uint8_t turn = components == 4 && !job->jpeg.saw_Adobe_marker ? 255 : 0;
    for (uint32_t x = 0; x < job->making->image->width; x++) {
        const uint8_t *in = job->line + (size_t)components * x;
        uint8_t *out = job->row + 4 * (size_t)x;
        for (int i = 0; i < 3; i++)
            out[i] = components == 1   ? in[0]
                     : components == 3 ? in[i]
                                       : (uint8_t)((in[i] ^ turn) * (in[3] ^ turn) / 255);
        out[3] = 255;
    }
}

/* Returns 0, or -1 after a failure. */
static int read_all(jpeg_job *job)
{
    if (setjmp(job->back))
        return -1;
    jpeg_create_decompress(&job->jpeg);
    job->jpeg.src = &job->input;
    job->jpeg.progress = &job->progress;
    begin(job);
    while (job->jpeg.output_scanline < job->jpeg.output_height) {
        JSAMPROW lines[1] = {job->line};
        if (jpeg_read_scanlines(&job->jpeg, lines, 1) != 1)
            fail(job);
        to_rgba(job);
        strl__image_row(job->making, job->row);
    }
    if (job->is_cut && (job->errors.num_warnings || jpeg_has_multiple_scans(&job->jpeg))) {
        strl__fail(&job->failure, STRL_ERR_FORMAT, "is cut off after %" PRIu64 " bytes", job->making->source->bytes);
        return -1;
    }
    return 0;
}

strl_status strl__image_read_jpeg(strl__image_making *making, strl_error *err)
{
    jpeg_job *job = strl__alloc_zero(1, sizeof *job);
    if (!job)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to decode a JPEG image");
    job->making = making;
    job->jpeg.err = jpeg_std_error(&job->errors);
    job->jpeg.client_data = job;
    job->errors.error_exit = on_error;
    job->errors.output_message = on_message;
    job->errors.emit_message = on_warning;
    job->progress.progress_monitor = on_progress;
    job->input = (struct jpeg_source_mgr){.init_source = on_begin,
                                          .fill_input_buffer = on_fill,
                                          .skip_input_data = on_skip,
                                          .resync_to_restart = jpeg_resync_to_restart,
                                          .term_source = on_begin};
    int failed = read_all(job);
    jpeg_destroy_decompress(&job->jpeg);
    strl_status status = STRL_OK;
    if (failed)
        status = job->failure.status ? strl__fail(err, job->failure.status, "%s", job->failure.message)
                                     : strl__fail(err, STRL_ERR_FORMAT, "is damaged");
    strl__free(job->line);
    strl__free(job->row);
    strl__free(job);
    return status;
}
