#include "build/checkpoint.h"

#include <inttypes.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"
#include "platform/file.h"
#include "platform/output.h"
#include "build/saved.h"

/* The file: magic, format, checksum of the rest, then the rest. */
static const char MAGIC[8] = {'s', 't', 'r', 'l', 's', 't', 'o', 'p'};
#define FORMAT 9u /* changes with whatever any builder saves */
#define HEAD_BYTES 20u
#define MOST_BYTES (UINT64_C(1) << 32)

/* ---- writing ---- */

static void write_counters(const strl_build_context *context, strl_writer *writer)
{
    const strl_build_result *result = context->result;
    strl_writer_u64(writer, context->memory_bytes);
    strl_writer_u64(writer, result->triangles_in);
    strl_writer_u64(writer, result->dropped_nonfinite);
    strl_writer_u64(writer, result->dropped_degenerate);
    strl_writer_u64(writer, result->dropped_lines);
    strl_writer_u64(writer, result->dropped_points);
    strl_writer_f64(writer, result->dropped_longest);
    strl_writer_u64(writer, result->missing_libraries);
    strl_writer_u64(writer, result->missing_images);
    strl_writer_u32(writer, result->coarse_lattices);
}

static strl_status put_in_place(const strl_build_context *context, const strl_writer *file, strl_error *err)
{
    char *path = strl_path_join(context->scratch_dir, STRL_CHECKPOINT_NAME);
    if (!path)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a path");
    strl_output *output = NULL;
    strl_status status = strl_output_open(path, NULL, &output, err);
    if (!status)
        status = strl_file_write(strl_output_file(output), 0, file->data, file->size, err);
    if (!status)
        status = strl_output_finish(output, true, err);
    strl_output_close(output);
    strl__free(path);
    return status;
}

strl_status strl__checkpoint_write(strl_build_context *context, const strl_writer *words, strl_error *err)
{
    strl_writer file = {0};
    if (!context->keep)
        return STRL_OK;
    if (words->failed)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a checkpoint");
    strl_writer_bytes(&file, MAGIC, sizeof MAGIC);
    strl_writer_u32(&file, FORMAT);
    strl_writer_u64(&file, 0); /* its checksum */
    strl_status status = strl__request_write(context, &file, err);
    write_counters(context, &file);
    strl_writer_u32(&file, (uint32_t)words->size);
    strl_writer_bytes(&file, words->data, words->size);
    if (!status)
        status = strl_spill_set_save(context->spills, &file, err);
    if (!status && file.failed)
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for a checkpoint");
    if (!status) {
        strl__store_le(file.data + sizeof MAGIC + 4, 8, strl__checksum(file.data + HEAD_BYTES, file.size - HEAD_BYTES));
        status = put_in_place(context, &file, err);
    }
    strl__free(file.data);
    if (status)
        return status;
    context->has_checkpoint = true;
    strl_spill_set_settle(context->spills);
    return STRL_OK;
}

/* ---- reading ---- */

static strl_status load(const char *path, uint8_t **data, size_t *size, strl_error *err)
{
    strl_file *file = NULL;
    strl_status status = strl_file_open(path, &file, err);
    if (status)
        return status;
    uint64_t bytes = strl_file_bytes(file);
    *size = (size_t)bytes;
    *data = bytes < MOST_BYTES ? strl__alloc(*size, 1) : NULL;
    status = *data ? strl_file_read(file, 0, *data, *size, err)
                   : strl__fail(err, STRL_ERR_MEMORY, "no memory for %.300s of %" PRIu64 " bytes", path, bytes);
    strl_file_close(file, NULL);
    return status;
}

static strl_status check_head(const char *path, strl_cursor *cursor, strl_error *err)
{
    const uint8_t *magic = strl_cursor_take(cursor, sizeof MAGIC);
    uint32_t format = strl_cursor_u32(cursor);
    uint64_t expected = strl_cursor_u64(cursor);
    if (cursor->failed || memcmp(magic, MAGIC, sizeof MAGIC))
        return strl__fail(err, STRL_ERR_FORMAT, "%.300s is damaged: expected the words of a checkpoint at byte 0",
                          path);
    if (format != FORMAT)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "%.300s is of another version of the program: expected its format %u, found %u", path, FORMAT,
                          format);
    uint64_t found = strl__checksum(cursor->data + HEAD_BYTES, cursor->size - HEAD_BYTES);
    if (found != expected)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "%.300s is damaged: expected the checksum %016" PRIx64
                          " of bytes %u to %zu, found %016" PRIx64,
                          path, expected, HEAD_BYTES, cursor->size - 1, found);
    return STRL_OK;
}

static strl_status read_counters(strl_build_context *context, strl_cursor *cursor, strl_error *err)
{
    strl_build_result *result = context->result;
    uint64_t asked = context->memory_bytes;
    context->memory_bytes = strl_cursor_u64(cursor);
    result->triangles_in = strl_cursor_u64(cursor);
    result->dropped_nonfinite = strl_cursor_u64(cursor);
    result->dropped_degenerate = strl_cursor_u64(cursor);
    result->dropped_lines = strl_cursor_u64(cursor);
    result->dropped_points = strl_cursor_u64(cursor);
    result->dropped_longest = strl_cursor_f64(cursor);
    result->missing_libraries = strl_cursor_u64(cursor);
    result->missing_images = strl_cursor_u64(cursor);
    result->coarse_lattices = strl_cursor_u32(cursor);
    context->progress.triangles_in = result->triangles_in;
    if (context->memory_bytes < STRL_BUILD_LEAST_MEMORY)
        return strl_saved_fail("the memory of the build", err);
    if (asked < context->memory_bytes)
        return strl__fail(err, STRL_ERR_ARGUMENT,
                          "--memory is %" PRIu64 " bytes, in the build to be resumed it was %" PRIu64, asked,
                          context->memory_bytes);
    return STRL_OK;
}

static strl_status read_words(strl_build_context *context, strl_cursor *cursor, strl_error *err)
{
    uint32_t size = strl_cursor_u32(cursor);
    const uint8_t *words = strl_cursor_take(cursor, size);
    if (!words || !size)
        return strl__fail(err, STRL_ERR_FORMAT, "the checkpoint in %.300s is cut off", context->scratch_dir);
    strl_writer_bytes(&context->resumed, words, size);
    return context->resumed.failed ? strl__fail(err, STRL_ERR_MEMORY, "no memory for a checkpoint") : STRL_OK;
}

static strl_status report_check(void *context, uint64_t done, uint64_t total, strl_error *err)
{
    return strl__build_report(context, done, total, err);
}

static strl_status restore_streams(strl_build_context *context, strl_cursor *cursor, strl_error *err)
{
    strl__build_stage(context, "check what was finished");
    strl_status status = strl_spill_set_restore(context->spills, cursor, err);
    if (!status && strl_cursor_left(cursor))
        status = strl__fail(err, STRL_ERR_FORMAT, "the checkpoint in %.300s has %zu bytes too many",
                            context->scratch_dir, strl_cursor_left(cursor));
    return status ? status : strl_spill_set_check(context->spills, report_check, context, err);
}

static strl_status read_all(strl_build_context *context, const char *path, strl_error *err)
{
    uint8_t *data = NULL;
    size_t size = 0;
    strl_status status = load(path, &data, &size, err);
    strl_cursor cursor = strl_cursor_make(data, size);
    if (!status)
        status = check_head(path, &cursor, err);
    if (!status)
        status = strl__request_compare(context, &cursor, err);
    if (!status)
        status = read_counters(context, &cursor, err);
    if (!status)
        status = read_words(context, &cursor, err);
    if (!status)
        status = restore_streams(context, &cursor, err);
    strl__free(data);
    return status;
}

bool strl__checkpoint_exists(const char *scratch_dir)
{
    char *path = strl_path_join(scratch_dir, STRL_CHECKPOINT_NAME);
    bool exists = !path || strl_path_exists(path);
    strl__free(path);
    return exists;
}

strl_status strl__checkpoint_read(strl_build_context *context, strl_error *err)
{
    char *path = strl_path_join(context->scratch_dir, STRL_CHECKPOINT_NAME);
    if (!path)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a path");
    strl_status status = read_all(context, path, err);
    context->result->resumed = !status;
    strl__free(path);
    return status;
}
