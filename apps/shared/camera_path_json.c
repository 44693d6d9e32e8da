/* Camera paths as JSON files. */
#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "platform/output.h"
#include "shared/camera_path.h"

#define MOST_FRAMES 1000000u

static bool read_vector(const json_t *frame, const char *name, double out[3])
{
    const json_t *array = json_object_get(frame, name);
    if (json_array_size(array) != 3)
        return false;
    for (size_t i = 0; i < 3; i++) {
        const json_t *number = json_array_get(array, i);
        if (!json_is_number(number))
            return false;
        out[i] = json_number_value(number);
    }
    return true;
}

static strl_status read_frames(const json_t *root, const char *file, strl_camera_path *path, strl_error *err)
{
    const json_t *frames = json_object_get(root, "frames"), *fov = json_object_get(root, "fov_y_deg");
    size_t count = json_array_size(frames);
    if (count == 0 || count > MOST_FRAMES)
        return strl__fail(err, STRL_ERR_FORMAT, "path file %s: expected \"frames\" with 1 to %u entries, found %zu",
                          file, MOST_FRAMES, count);
    *path = (strl_camera_path){json_is_number(fov) ? json_number_value(fov) : 60, count,
                               strl__alloc_zero(count, sizeof *path->frames)};
    if (!path->frames)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a path of %zu frames", count);
    for (size_t f = 0; f < count; f++) {
        const json_t *entry = json_array_get(frames, f);
        strl_path_frame *frame = &path->frames[f];
        if (!read_vector(entry, "eye", frame->eye) || !read_vector(entry, "target", frame->target) ||
            !read_vector(entry, "up", frame->up))
            return strl__fail(err, STRL_ERR_FORMAT,
                              "path file %s: frame %zu: expected eye, target and up of three numbers each", file, f);
        const char *fault = strl_path_fault(path, f);
        if (fault)
            return strl__fail(err, STRL_ERR_FORMAT, "path file %s: frame %zu: %s", file, f, fault);
    }
    return STRL_OK;
}

strl_status strl_path_load(const char *file, strl_camera_path *path, strl_error *err)
{
    *path = (strl_camera_path){0};
    json_error_t json_error;
    FILE *stream = fopen(file, "rb");
    if (!stream)
        return strl__fail(err, STRL_ERR_IO, "cannot open the path file %s: %s", file, strerror(errno));
    json_t *root = json_loadf(stream, 0, &json_error);
    fclose(stream);
    if (!root)
        return strl__fail(err, STRL_ERR_FORMAT, "path file %s: line %d: %s", file, json_error.line, json_error.text);
    strl_status status = read_frames(root, file, path, err);
    json_decref(root);
    if (status != STRL_OK)
        strl_path_deinit(path);
    return status;
}

static json_t *vector_of(const double v[3])
{
    return json_pack("[f,f,f]", v[0], v[1], v[2]);
}

strl_status strl_path_save(const strl_camera_path *path, const char *file, strl_error *err)
{
    json_t *frames = json_array();
    for (size_t f = 0; f < path->count; f++) {
        const strl_path_frame *frame = &path->frames[f];
        json_array_append_new(frames, json_pack("{s:o,s:o,s:o}", "eye", vector_of(frame->eye), "target",
                                                vector_of(frame->target), "up", vector_of(frame->up)));
    }
    json_t *root = json_pack("{s:f,s:o}", "fov_y_deg", path->fov_y_deg, "frames", frames);
    strl_output *output = NULL;
    FILE *stream = NULL;
    strl_status status = root && json_array_size(frames) == path->count
                             ? strl_output_open(file, NULL, &output, err)
                             : strl__fail(err, STRL_ERR_MEMORY, "no memory to write the path file %s", file);
    if (status == STRL_OK)
        status = strl_output_stream(output, &stream, err);
    if (status == STRL_OK && json_dumpf(root, stream, JSON_COMPACT | JSON_REAL_PRECISION(17)) != 0)
        status = strl__fail(err, STRL_ERR_IO, "cannot write the path file %s", file);
    if (status == STRL_OK)
        status = strl_output_finish(output, false, err);
    strl_output_close(output);
    json_decref(root);
    return status;
}
