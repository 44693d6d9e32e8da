#include "viewer/settings.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "platform/output.h"
#include "shared/folder.h"

#define MOST_BYTES (1024.0 * 1024 * 1024 * 1024)

/* A number of the root within [least, most]; 0 where there is none. */
static double number(const strl_settings *settings, const char *name, double least, double most)
{
    const json_t *value = json_object_get(settings->root, name);
    double found = json_is_number(value) ? json_number_value(value) : 0;
    return found >= least && found <= most ? found : 0;
}

static void read_values(strl_settings *settings)
{
    settings->size[0] = (uint32_t)number(settings, "width", 64, 16384);
    settings->size[1] = (uint32_t)number(settings, "height", 64, 16384);
    settings->error_px = number(settings, "error_px", 1e-3, 1e3);
    settings->memory_bytes = (uint64_t)number(settings, "memory_bytes", 1 << 20, MOST_BYTES);
    settings->gpu_memory_bytes = (uint64_t)number(settings, "gpu_memory_bytes", 4 << 20, MOST_BYTES);
    settings->text_scale = number(settings, "text_scale", 0.5, 4);
    settings->show_parts = json_is_true(json_object_get(settings->root, "show_parts"));
    settings->orthographic = json_is_true(json_object_get(settings->root, "orthographic"));
}

static strl_status load(strl_settings *settings, const char *path, strl_error *err)
{
    json_error_t json_error;
    settings->root = json_load_file(path, 0, &json_error);
    if (!settings->root)
        return strl__fail(err, STRL_ERR_FORMAT, "settings are not remembered: %s, line %d: %s", path, json_error.line,
                          json_error.text);
    if (json_is_object(settings->root)) {
        read_values(settings);
        return STRL_OK;
    }
    json_decref(settings->root);
    settings->root = NULL;
    return strl__fail(err, STRL_ERR_FORMAT, "settings are not remembered: %s holds no object", path);
}

strl_status strl_settings_load(strl_settings *settings, const char *path, strl_error *err)
{
    *settings = (strl_settings){0};
    strl_status status = path && strl_path_exists(path) ? load(settings, path, err) : STRL_OK;
    if (!settings->root)
        settings->root = json_object();
    if (path && status == STRL_OK)
        settings->path = strl__strdup(path);
    return status;
}

void strl_settings_renew(strl_settings *settings)
{
    json_t *root = settings->path ? json_load_file(settings->path, 0, NULL) : NULL;
    if (!json_is_object(root)) {
        json_decref(root);
        return;
    }
    json_decref(settings->root);
    settings->root = root;
    read_values(settings);
}

void strl_settings_deinit(strl_settings *settings)
{
    json_decref(settings->root);
    strl__free(settings->path);
    *settings = (strl_settings){0};
}

static void write_values(const strl_settings *settings)
{
    json_t *root = settings->root;
    json_object_set_new(root, "width", json_integer(settings->size[0]));
    json_object_set_new(root, "height", json_integer(settings->size[1]));
    json_object_set_new(root, "error_px", json_real(settings->error_px));
    json_object_set_new(root, "memory_bytes", json_integer((json_int_t)settings->memory_bytes));
    json_object_set_new(root, "gpu_memory_bytes", json_integer((json_int_t)settings->gpu_memory_bytes));
    json_object_set_new(root, "text_scale", json_real(settings->text_scale));
    json_object_set_new(root, "show_parts", json_boolean(settings->show_parts));
    json_object_set_new(root, "orthographic", json_boolean(settings->orthographic));
}

strl_status strl_settings_save(const strl_settings *settings, strl_error *err)
{
    strl_output *output = NULL;
    FILE *stream = NULL;
    if (!settings->path || !settings->root)
        return STRL_OK;
    write_values(settings);
    strl_status status = strl_folder_make_for(settings->path, err);
    if (status == STRL_OK)
        status = strl_output_open(settings->path, NULL, &output, err);
    if (status == STRL_OK)
        status = strl_output_stream(output, &stream, err);
    if (status == STRL_OK && json_dumpf(settings->root, stream, JSON_INDENT(1) | JSON_REAL_PRECISION(17)) != 0)
        status = strl__fail(err, STRL_ERR_IO, "cannot write the settings to %s", settings->path);
    if (status == STRL_OK)
        status = strl_output_finish(output, false, err);
    strl_output_close(output);
    return status;
}

/* ---- bookmarks */

static void name_model(const uint8_t model_id[16], char name[33])
{
    for (int i = 0; i < 16; i++)
        snprintf(name + 2 * i, 3, "%02x", model_id[i]);
}

void strl_settings_get_bookmarks(const strl_settings *settings, const uint8_t model_id[16], strl_bookmarks *bookmarks)
{
    char name[33];
    name_model(model_id, name);
    strl_bookmarks_read(bookmarks, json_object_get(json_object_get(settings->root, "bookmarks"), name));
}

void strl_settings_set_bookmarks(strl_settings *settings, const uint8_t model_id[16], const strl_bookmarks *bookmarks)
{
    char name[33];
    name_model(model_id, name);
    json_t *models = json_object_get(settings->root, "bookmarks");
    if (!json_is_object(models)) {
        models = json_object();
        json_object_set_new(settings->root, "bookmarks", models);
    }
    if (bookmarks->count > 0)
        json_object_set_new(models, name, strl_bookmarks_write(bookmarks));
    else
        json_object_del(models, name);
}
