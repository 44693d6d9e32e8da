#include "render_output.h"

#include <ctype.h>
#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <string.h>
#include <strings.h>

#include "base/fail.h"
#include "base/memory.h"
#include "platform/file.h"

#define MOST_SHEET_FRAMES 10000u

static bool ends_in_png(const char *path)
{
    size_t length = strlen(path);
    return length > 4 && strcasecmp(path + length - 4, ".png") == 0;
}

/* Whether the name's end looks like that of another kind of file: a dot and two to six letters and digits, not digits
 * alone. */
static bool has_extension(const char *path)
{
    const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path, *dot = strrchr(name, '.');
    size_t length = dot && dot > name ? strlen(dot + 1) : 0;
    if (length < 2 || length > 6)
        return false;
    bool letter = false;
    for (const char *at = dot + 1; *at; at++) {
        if (!isalnum((unsigned char)*at))
            return false;
        letter |= isalpha((unsigned char)*at) != 0;
    }
    return letter;
}

/* A folder that is there takes the frames; of one that is not, its own folder must be there. */
static strl_status check_folder(const char *path, strl_error *err)
{
    strl_file_info info;
    if (strl_path_stat(path, &info, NULL) == STRL_OK && info.is_directory) {
        char *first = strl_path_join(path, "frame_00000.png");
        strl_status status =
            first ? strl_output_check(first, err) : strl__fail(err, STRL_ERR_MEMORY, "no memory for a path");
        strl__free(first);
        return status;
    }
    if (strl_path_exists(path))
        return strl__fail(err, STRL_ERR_ARGUMENT, "%s is not a folder: images go to NAME.png or into a folder", path);
    if (has_extension(path))
        return strl__fail(err, STRL_ERR_ARGUMENT,
                          "images go to NAME.png or into a folder, found %s (a new folder with a dot in its "
                          "name is %s/)",
                          path, path);
    size_t length = strlen(path);
    char *name = strl__strdup(path);
    if (!name)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a path");
    while (length > 1 && name[length - 1] == '/')
        name[--length] = 0;
    strl_status status = strl_output_check(name, err);
    strl__free(name);
    return status;
}

strl_status strl_render_output_check(const char *path, strl_error *err)
{
    return !path ? STRL_OK : *path && !ends_in_png(path) ? check_folder(path, err) : strl_output_check(path, err);
}

static strl_status make_folder(strl_render_output *output, strl_error *err)
{
    const strl_render_output_desc *desc = &output->desc;
    if (!output->folder && desc->cameras->count > 1)
        return strl__fail(err, STRL_ERR_ARGUMENT, "%zu frames need a folder to go to, found the file name %s",
                          desc->cameras->count, desc->path);
    output->made_folder = output->folder && !strl_path_exists(desc->path);
    return output->folder ? strl_path_make_directory(desc->path, err) : STRL_OK;
}

static strl_status allocate(strl_render_output *output, strl_error *err)
{
    const uint32_t *size = output->desc.size;
    size_t frames = output->desc.cameras->count, pixels = (size_t)size[0] * size[1];
    strl_status status = strl_image_init(&output->image, size[0], size[1], err);
    output->rgba = strl__alloc(pixels, 4);
    output->depth = strl__alloc(pixels, sizeof *output->depth);
    if (status == STRL_OK && (!output->rgba || !output->depth))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for an image of %" PRIu32 "x%" PRIu32 " pixels", size[0],
                            size[1]);
    if (status == STRL_OK && output->folder && frames > 1 && frames <= MOST_SHEET_FRAMES)
        status =
            strl_contact_sheet_init(&output->sheet, (uint32_t)frames, size[0], size[1], output->desc.background, err);
    return status;
}

strl_status strl_render_output_init(strl_render_output *output, const strl_render_output_desc *desc, strl_error *err)
{
    *output = (strl_render_output){.desc = *desc, .folder = desc->path && !ends_in_png(desc->path)};
    strl_status status = strl_render_output_check(desc->path, err);
    if (status == STRL_OK && desc->path)
        status = make_folder(output, err);
    if (status == STRL_OK)
        status = allocate(output, err);
    if (status == STRL_OK && desc->stats)
        status = strl_output_open(desc->stats, NULL, &output->stats, err);
    if (status == STRL_OK && desc->stats)
        status = strl_output_stream(output->stats, &output->stats_stream, err);
    if (status != STRL_OK)
        strl_render_output_deinit(output);
    return status;
}

/* The name of one of a frame's files, owned by the caller. */
static char *frame_path(const strl_render_output *output, size_t frame, const char *extension)
{
    if (output->folder) {
        char name[48];
        snprintf(name, sizeof name, "frame_%05zu%s", frame, extension);
        return strl_path_join(output->desc.path, name);
    }
    char *path = strl__strdup(output->desc.path);
    if (path && strcmp(extension, ".png") != 0) /* the image has the name as given, .PNG too */
        memcpy(path + strlen(path) - 4, extension, 4);
    return path;
}

static strl_status write_image(strl_render_output *output, size_t frame, strl_error *err)
{
    size_t pixels = (size_t)output->image.width * output->image.height;
    for (size_t p = 0; p < pixels; p++)
        memcpy(output->image.rgb + 3 * p, output->rgba + 4 * p, 3);
    char *path = frame_path(output, frame, ".png");
    strl_status status = path ? strl_image_write_png(&output->image, path, err)
                              : strl__fail(err, STRL_ERR_MEMORY, "no memory for a path");
    strl__free(path);
    if (status == STRL_OK && output->sheet.image.rgb)
        strl_contact_sheet_add(&output->sheet, (uint32_t)frame, &output->image);
    return status;
}

static strl_status write_depth(strl_render_output *output, size_t frame, strl_error *err)
{
    char *path = frame_path(output, frame, ".pfm");
    strl_status status = path ? strl_depth_write(output->depth, output->image.width, output->image.height, path, err)
                              : strl__fail(err, STRL_ERR_MEMORY, "no memory for a path");
    strl__free(path);
    return status;
}

static uint64_t count_covered(const strl_render_output *output)
{
    uint64_t covered = 0;
    for (size_t p = 0; p < (size_t)output->image.width * output->image.height; p++)
        covered += isfinite(output->depth[p]);
    return covered;
}

/* JSON has no infinity, which is the pixel error of a box round the eye. */
static json_t *real_or_null(double value)
{
    return isfinite(value) ? json_real(value) : json_null();
}

/* Since the model was opened, like faults: what is of interest are differences and the last line. */
static int add_network(json_t *line, const strl_network_stats *n)
{
    json_t *network =
        json_pack("{s:I,s:I,s:I,s:I,s:I,s:I,s:I,s:I,s:f,s:f}", "requests", (json_int_t)n->requests, "reads",
                  (json_int_t)n->reads, "merged_reads", (json_int_t)n->merged_reads, "retries", (json_int_t)n->retries,
                  "failures", (json_int_t)n->failures, "bytes", (json_int_t)n->bytes, "cache_hits",
                  (json_int_t)n->cache_hits, "cache_bytes", (json_int_t)n->cache_bytes, "latency_ms",
                  (double)n->latency_ns * 1e-6, "bytes_per_second", n->bytes_per_second);
    return json_object_set_new(line, "network", network);
}

static strl_status write_stats(strl_render_output *output, size_t frame, const strl_image_stats *s, strl_error *err)
{
    /* cull_ms: frustum culling is part of selecting; occlusion will have a stage of its own. */
    json_t *line =
        json_pack("{s:I,s:b,s:f,s:f,s:f,s:f,s:f}", "frame", (json_int_t)frame, "realtime", output->desc.realtime,
                  "elapsed_ms", (double)s->elapsed_ns * 1e-6, "frame_ms", (double)s->frame_ns * 1e-6, "select_ms",
                  (double)s->select_ns * 1e-6, "cull_ms", 0.0, "draw_ms", (double)s->draw_ns * 1e-6);
    const struct {
        const char *name;
        uint64_t value;
    } counts[] = {{"triangles", s->triangles},
                  {"splats", s->splats},
                  {"nodes", s->nodes},
                  {"nodes_culled", s->nodes_culled},
                  {"nodes_backfacing", s->nodes_backfacing},
                  {"draws", s->draws},
                  {"requests", s->requests},
                  {"bytes_read", s->bytes_read},
                  {"resident_bytes", s->resident_bytes},
                  {"gpu_bytes", s->gpu_bytes},
                  {"uploaded_bytes", s->uploaded_bytes},
                  {"evictions", s->evictions},
                  {"covered_pixels", count_covered(output)},
                  {"missing_nodes", s->missing_nodes},
                  {"disk_waits", s->disk_waits},
                  {"fronts", s->fronts},
                  {"faults", s->faults}};
    int failed = !line;
    for (size_t c = 0; c < sizeof counts / sizeof *counts; c++)
        failed |= json_object_set_new(line, counts[c].name, json_integer((json_int_t)counts[c].value));
    failed |= json_object_set_new(line, "max_error_px", real_or_null(s->max_error_px));
    failed |= json_object_set_new(line, "allowed_error_px", real_or_null(s->allowed_error_px));
    failed |= json_object_set_new(line, "last_fault", json_string(s->last_fault));
    if (s->remote)
        failed |= add_network(line, &s->network);
    if (!failed)
        failed = json_dumpf(line, output->stats_stream, JSON_COMPACT | JSON_REAL_PRECISION(8)) != 0 ||
                 fputc('\n', output->stats_stream) == EOF;
    json_decref(line);
    return failed ? strl__fail(err, STRL_ERR_IO, "cannot write %s", output->desc.stats) : STRL_OK;
}

strl_status strl_render_output_add(strl_render_output *output, size_t frame, strl_renderer *renderer,
                                   const strl_image_stats *stats, strl_error *err)
{
    strl_status status = STRL_OK;
    bool images = output->desc.path != NULL;
    if (images)
        status = strl_renderer_read_colour(renderer, output->rgba, err);
    if (status == STRL_OK && (output->stats || (images && output->desc.depth)))
        status = strl_renderer_read_depth(renderer, output->depth, err);
    if (status == STRL_OK && images)
        status = write_image(output, frame, err);
    if (status == STRL_OK && images && output->desc.depth)
        status = write_depth(output, frame, err);
    if (status == STRL_OK && output->stats)
        status = write_stats(output, frame, stats, err);
    return status;
}

strl_status strl_render_output_finish(strl_render_output *output, strl_error *err)
{
    strl_status status = STRL_OK;
    if (output->folder) {
        char *sheet = strl_path_join(output->desc.path, "contact.png"),
             *cameras = strl_path_join(output->desc.path, "path.json");
        if (!sheet || !cameras)
            status = strl__fail(err, STRL_ERR_MEMORY, "no memory for a path");
        if (status == STRL_OK && output->sheet.image.rgb)
            status = strl_image_write_png(&output->sheet.image, sheet, err);
        if (status == STRL_OK)
            status = strl_path_save(output->desc.cameras, cameras, err);
        strl__free(sheet);
        strl__free(cameras);
    }
    return status == STRL_OK && output->stats ? strl_output_finish(output->stats, false, err) : status;
}

void strl_render_output_deinit(strl_render_output *output)
{
    strl_output_close(output->stats);
    if (output->made_folder)
        strl_path_remove_if_empty(output->desc.path);
    strl_image_deinit(&output->image);
    strl_contact_sheet_deinit(&output->sheet);
    strl__free(output->rgba);
    strl__free(output->depth);
    *output = (strl_render_output){0};
}
