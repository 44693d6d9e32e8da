/* What a build was asked for, so that another request is not answered with the stages of this one. */
#include <inttypes.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "build/checkpoint.h"
#include "platform/file.h"
#include "stroll/version.h"

static void write_text(strl_writer *writer, const char *text)
{
    size_t length = strlen(text);
    strl_writer_u32(writer, (uint32_t)length);
    strl_writer_bytes(writer, text, length);
}

static void write_file(strl_writer *writer, const char *path, const strl_file_info *info)
{
    write_text(writer, path);
    strl_writer_u64(writer, info->bytes);
    strl_writer_u64(writer, info->modified_ns);
}

strl_status strl__request_write(const strl_build_context *context, strl_writer *writer, strl_error *err)
{
    const strl_build_desc *desc = context->desc;
    write_text(writer, STRL_VERSION);
    strl_writer_f64(writer, desc->grid);
    strl_writer_u8(writer, desc->compact);
    strl_writer_u8(writer, (uint8_t)desc->up_axis);
    write_text(writer, desc->unit ? desc->unit : "");
    strl_writer_u8(writer, desc->no_dependencies);
    strl_writer_u8(writer, desc->certify);
    strl_writer_u8(writer, context->run == strl__samples_run);
    strl_writer_f64(writer, desc->probability);
    strl_writer_u32(writer, desc->input_count);
    for (uint32_t i = 0; i < desc->input_count; i++) {
        strl_file_info info;
        strl_status status = strl_path_stat(desc->inputs[i], &info, err);
        if (status)
            return status;
        write_file(writer, desc->inputs[i], &info);
    }
    strl_writer_u32(writer, context->beside_count);
    strl_writer_bytes(writer, context->beside.data, context->beside.size);
    return STRL_OK; /* the writer's failure is its owner's to see */
}

strl_status strl__request_note_beside(strl_build_context *context, const strl_reader *reader, strl_error *err)
{
    const uint32_t count = strl_reader_beside_count(reader);
    for (uint32_t i = 0; i < count; i++) {
        strl_file_info info;
        const char *path = strl_reader_beside(reader, i, &info);
        write_file(&context->beside, path, &info);
        context->beside_count++;
    }
    return context->beside.failed ? strl__fail(err, STRL_ERR_MEMORY, "no memory for the names of %u files", count)
                                  : STRL_OK;
}

/* A saved text, not terminated. */
typedef struct saved_text {
    const char *text; /* borrowed */
    uint32_t length;
} saved_text;

/* How much of it is for a sentence. */
static int shown(saved_text saved)
{
    return saved.length < 120 ? (int)saved.length : 120;
}

static saved_text read_text(strl_cursor *saved)
{
    uint32_t length = strl_cursor_u32(saved);
    const uint8_t *text = strl_cursor_take(saved, length);
    return text ? (saved_text){(const char *)text, length} : (saved_text){"", 0};
}

static bool is_same(saved_text saved, const char *text)
{
    return strlen(text) == saved.length && memcmp(saved.text, text, saved.length) == 0;
}

static const char *or_default(const char *text, const char *without)
{
    return *text ? text : without;
}

static strl_status compare_flag(const char *name, bool now, bool saved, strl_error *err)
{
    return now == saved ? STRL_OK
                        : strl__fail(err, STRL_ERR_ARGUMENT, "%s is %s, in the build to be resumed it was not", name,
                                     now ? "given" : "left out");
}

static strl_status compare_structure(const strl_build_context *context, strl_cursor *saved, strl_error *err)
{
    static const char *const names[] = {"clusters", "samples"};
    bool now = context->run == strl__samples_run, before = strl_cursor_u8(saved);
    double probability = strl_cursor_f64(saved);
    if (now != before)
        return strl__fail(err, STRL_ERR_ARGUMENT, "--structure is %s, in the build to be resumed it was %s", names[now],
                          names[before]);
    return !now || probability == context->desc->probability
               ? STRL_OK
               : strl__fail(err, STRL_ERR_ARGUMENT,
                            "--probability is %.17g, in the build to be resumed it was %.17g (0 = the default)",
                            context->desc->probability, probability);
}

static strl_status compare_options(const strl_build_context *context, strl_cursor *saved, strl_error *err)
{
    const strl_build_desc *desc = context->desc;
    static const char *const axes[] = {"auto", "x", "y", "z"};
    double grid = strl_cursor_f64(saved);
    bool compact = strl_cursor_u8(saved);
    unsigned up = strl_cursor_u8(saved), up_now = (unsigned)desc->up_axis;
    saved_text unit = read_text(saved);
    const char *unit_now = desc->unit ? desc->unit : "";
    bool no_dependencies = strl_cursor_u8(saved), certify = strl_cursor_u8(saved);
    if (!(grid == desc->grid))
        return strl__fail(err, STRL_ERR_ARGUMENT, "--grid is %g, in the build to be resumed it was %g (0 = chosen)",
                          desc->grid, grid);
    if (up != up_now)
        return strl__fail(err, STRL_ERR_ARGUMENT, "--up is %s, in the build to be resumed it was %s", axes[up_now & 3],
                          axes[up & 3]);
    if (!is_same(unit, unit_now))
        return strl__fail(err, STRL_ERR_ARGUMENT, "--unit is %s, in the build to be resumed it was %.*s",
                          or_default(unit_now, "unknown"), unit.length ? shown(unit) : 7,
                          unit.length ? unit.text : "unknown");
    strl_status status = compare_flag("--compact", desc->compact, compact, err);
    if (!status)
        status = compare_flag("--no-dependencies", desc->no_dependencies, no_dependencies, err);
    if (!status)
        status = compare_flag("--certify", desc->certify, certify, err);
    return status ? status : compare_structure(context, saved, err);
}

/* A file's facts, against those that are saved next. */
static strl_status compare_file(const char *path, strl_cursor *saved, strl_error *err)
{
    uint64_t bytes = strl_cursor_u64(saved), modified_ns = strl_cursor_u64(saved);
    strl_file_info info;
    strl_status status = strl_path_stat(path, &info, err);
    if (status)
        return status;
    if (info.bytes != bytes)
        return strl__fail(err, STRL_ERR_ARGUMENT,
                          "%.200s has %" PRIu64 " bytes, when the build to be resumed began it had %" PRIu64, path,
                          info.bytes, bytes);
    if (info.modified_ns != modified_ns)
        return strl__fail(err, STRL_ERR_ARGUMENT, "%.200s was changed after the build to be resumed began", path);
    return STRL_OK;
}

static strl_status compare_input(const char *path, strl_cursor *saved, strl_error *err)
{
    saved_text name = read_text(saved);
    if (!is_same(name, path))
        return strl__fail(err, STRL_ERR_ARGUMENT, "an input is %.120s, in the build to be resumed it was %.*s", path,
                          shown(name), name.text);
    return compare_file(path, saved, err);
}

/* No option names these: an input does. */
static strl_status compare_beside(strl_cursor *saved, strl_error *err)
{
    saved_text name = read_text(saved);
    char *path = strl__alloc((size_t)name.length + 1, 1);
    if (!path)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a path");
    memcpy(path, name.text, name.length);
    path[name.length] = 0;
    strl_status status = compare_file(path, saved, err);
    strl__free(path);
    return status;
}

static strl_status compare_all_beside(strl_build_context *context, strl_cursor *saved, strl_error *err)
{
    const uint32_t count = strl_cursor_u32(saved);
    const size_t left = strl_cursor_left(saved);
    const uint8_t *start = saved->data + (saved->size - left);
    strl_status status = STRL_OK;
    for (uint32_t i = 0; i < count && !status; i++)
        status = compare_beside(saved, err);
    if (status)
        return status;
    strl_writer_bytes(&context->beside, start, left - strl_cursor_left(saved));
    context->beside_count = count;
    return context->beside.failed ? strl__fail(err, STRL_ERR_MEMORY, "no memory for the names of %u files", count)
                                  : STRL_OK;
}

strl_status strl__request_compare(strl_build_context *context, strl_cursor *saved, strl_error *err)
{
    const strl_build_desc *desc = context->desc;
    saved_text version = read_text(saved);
    if (!is_same(version, STRL_VERSION))
        return strl__fail(err, STRL_ERR_FORMAT, "this is version %s, the build to be resumed was made by version %.*s",
                          STRL_VERSION, shown(version), version.text);
    strl_status status = compare_options(context, saved, err);
    uint32_t count = strl_cursor_u32(saved);
    if (!status && count != desc->input_count)
        return strl__fail(err, STRL_ERR_ARGUMENT, "the inputs are %u, in the build to be resumed they were %u",
                          desc->input_count, count);
    for (uint32_t i = 0; i < count && !status; i++)
        status = compare_input(desc->inputs[i], saved, err);
    return status ? status : compare_all_beside(context, saved, err);
}
