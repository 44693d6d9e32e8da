/* What comes from files and goes to them: the model, dropped files, settings. */
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "shared/naming.h"
#include "viewer/internal.h"

static strl_status name_part(void *context, uint32_t part, char *name, size_t size, strl_error *err)
{
    return strl_container_part(context, part, name, size, err);
}

strl_location strl__viewer_locate(const strl__viewer *v, const char *path)
{
    strl_location location = v->desc.location; /* whose cache serves whatever is opened */
    location.name = path;
    return location;
}

static strl_status open_walk(const strl__viewer *v, const char *path, strl_viewer_model **out, strl_error *err)
{
    strl_viewer_model *model = strl__alloc_zero(1, sizeof *model);
    *out = NULL;
    if (!model)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a model");
    const strl_location location = strl__viewer_locate(v, path);
    const strl_walk_desc how = {.memory_bytes = v->desc.memory_bytes,
                                .error_px = v->desc.error_px,
                                .splat_px = v->desc.splat_px,
                                .cull = v->desc.cull};
    strl_status status = strl_viewer_model_open(model, &location, &how, err);
    if (status == STRL_OK)
        *out = model;
    else
        strl__free(model);
    return strl_name_file(path, status, err);
}

static void set_model(strl__viewer *v, strl_viewer_model *model)
{
    if (v->model)
        strl_viewer_model_close(v->model);
    strl__free(v->model);
    v->model = model;
    v->list = (strl_draw_list){0}; /* it was the old walk's */
}

void strl__viewer_set_title(strl__viewer *v)
{
    char title[256];
    const char *slash = strrchr(v->shown, '/');
    snprintf(title, sizeof title, "%.200s - Stroll", slash ? slash + 1 : v->shown);
    if (v->window)
        strl_window_set_title(v->window, title);
}

strl_status strl__viewer_make_renderer(strl__viewer *v, strl_error *err)
{
    const strl_renderer_desc desc = {.backend = v->desc.backend,
                                     .width = v->size[0] ? v->size[0] : 1,
                                     .height = v->size[1] ? v->size[1] : 1,
                                     .gpu_memory_bytes = v->desc.gpu_memory_bytes,
                                     .current_context = true};
    strl_renderer *renderer = NULL;
    strl_status status = strl_renderer_create(&desc, &renderer, err);
    if (status != STRL_OK)
        return status;
    strl_renderer_destroy(v->renderer);
    v->renderer = renderer;
    return STRL_OK;
}

strl_status strl__viewer_open_model(strl__viewer *v, const char *path, strl_error *err)
{
    strl_viewer_model *model = NULL;
    strl_parts parts = {0};
    strl_status status = open_walk(v, path, &model, err);
    if (status != STRL_OK)
        return status;
    const strl_container_info *info = strl_container_get_info(model->container);
    status = strl_parts_init(&parts, info->part_count, name_part, model->container, err);
    /* Keys of nodes are the walk's: what the renderer holds under them belongs to the old one. */
    if (status == STRL_OK && v->renderer)
        status = strl__viewer_make_renderer(v, err);
    if (status != STRL_OK) {
        strl_parts_deinit(&parts);
        strl_viewer_model_close(model);
        strl__free(model);
        return strl_name_file(path, status, err);
    }
    set_model(v, model);
    strl__viewer_drop_index(v);
    strl_parts_deinit(&v->parts);
    v->parts = parts;
    v->controls.search[0] = 0;
    bool is_other = strcmp(v->path, path) != 0;
    char shown[sizeof v->shown];
    snprintf(v->path, sizeof v->path, "%s", path);
    snprintf(v->shown, sizeof v->shown, "%s", strl_location_shown(path, shown, sizeof shown));
    v->mesh[0] = 0;
    strl__viewer_set_title(v);
    strl_settings_renew(&v->settings);
    strl_settings_get_bookmarks(&v->settings, info->model_id, &v->bookmarks);
    strl__viewer_reset(v);
    if (is_other) /* a path, which has been saved, leads through the model that was there */
        strl_recorder_deinit(&v->recorder);
    strl_journal_write(v->journal, "opened",
                       json_pack("{s:o,s:I,s:I,s:i}", "file", strl_journal_text(v->shown), "triangles",
                                 (json_int_t)model->triangles, "triangles_placed",
                                 (json_int_t)(model->placed < INT64_MAX ? model->placed : INT64_MAX), "parts",
                                 (int)info->part_count));
    if (model->triangles == 0)
        strl__viewer_say(v, "the model is empty: of its file %llu lines, %llu points and no triangle were found",
                         (unsigned long long)info->dropped_lines, (unsigned long long)info->dropped_points);
    return STRL_OK;
}

static bool is_same_model(const strl_viewer_model *a, const strl_viewer_model *b)
{
    const uint8_t *id = strl_container_get_info(a->container)->model_id;
    return memcmp(id, strl_container_get_info(b->container)->model_id, 16) == 0;
}

/* The walk and the renderer begin anew, the rest stays. */
strl_status strl__viewer_set_budgets(strl__viewer *v, strl_error *err)
{
    strl_viewer_model *model = NULL;
    uint64_t memory = v->desc.memory_bytes, gpu_memory = v->desc.gpu_memory_bytes;
    v->desc.memory_bytes = (uint64_t)((double)v->controls.memory_mib * (1 << 20));
    v->desc.gpu_memory_bytes = (uint64_t)((double)v->controls.gpu_memory_mib * (1 << 20));
    strl_status status = open_walk(v, v->path, &model, err);
    if (status == STRL_OK && !is_same_model(v->model, model))
        status = strl__fail(err, STRL_ERR_ARGUMENT, "%s holds another model now: drop it here to open that", v->shown);
    if (status == STRL_OK)
        status = strl__viewer_make_renderer(v, err);
    if (status == STRL_OK) {
        set_model(v, model);
        return STRL_OK;
    }
    if (model)
        strl_viewer_model_close(model);
    strl__free(model);
    v->desc.memory_bytes = memory, v->desc.gpu_memory_bytes = gpu_memory;
    v->controls.memory_mib = (float)memory / (1 << 20), v->controls.gpu_memory_mib = (float)gpu_memory / (1 << 20);
    return status;
}

/* ---- dropped files */

static void open_built(strl__viewer *v)
{
    strl_error err = {0};
    if (strl__viewer_open_model(v, v->news.container, &err) != STRL_OK) {
        strl__viewer_say(v, "%s", err.message);
        return;
    }
    memcpy(v->mesh, v->news.mesh, sizeof v->mesh);
    if (v->news.warning[0])
        strl__viewer_say(v, "warning: %s", v->news.warning);
    else if (v->news.built_before)
        strl__viewer_say(v, "built before, and younger than the mesh; files that the mesh names are not compared: "
                            "\"build again\" is in the panel");
}

void strl__viewer_build_again(strl__viewer *v)
{
    strl_error err = {0};
    if (v->mesh[0] && strl_opener_start(v->opener, v->mesh, true, &err) != STRL_OK)
        strl__viewer_say(v, "%s", err.message);
}

void strl__viewer_poll_opener(strl__viewer *v)
{
    strl_opener_poll(v->opener, &v->news);
    v->cancels = v->cancels && v->news.state == STRL_OPENER_BUILDS;
    if (v->news.state == STRL_OPENER_READY) {
        open_built(v);
        v->frames_left = STRL__FRAMES_AFTER_INPUT;
    }
    if (v->news.state == STRL_OPENER_FAILED) {
        strl_journal_write(v->journal, "build", json_pack("{s:o}", "failed", strl_journal_text(v->news.error.message)));
        if (v->news.warning[0])
            strl__viewer_say(v, "warning: %s", v->news.warning);
        strl__viewer_say(v, "%s", v->news.error.status == STRL_ERR_CANCELLED ? "cancelled" : v->news.error.message);
        v->frames_left = STRL__FRAMES_AFTER_INPUT;
    }
}

/* ---- settings */

/* What nobody has touched in the window stays as it was remembered, whatever the command line said this time. */
void strl__viewer_remember(strl__viewer *v, bool bookmarks)
{
    strl_error err = {0};
    strl_settings *settings = &v->settings;
    strl_settings_renew(settings);
    if ((double)v->controls.error_px != v->begun.error_px)
        settings->error_px = v->controls.error_px;
    if (v->desc.memory_bytes != v->begun.memory_bytes)
        settings->memory_bytes = v->desc.memory_bytes;
    if (v->desc.gpu_memory_bytes != v->begun.gpu_memory_bytes)
        settings->gpu_memory_bytes = v->desc.gpu_memory_bytes;
    uint32_t size[2];
    strl_window_size(v->window, size);
    if (size[0] >= 64 && size[1] >= 64 && (size[0] != v->begun.size[0] || size[1] != v->begun.size[1]))
        memcpy(settings->size, size, sizeof size);
    if (v->controls.text_scale != v->begun_controls.text_scale)
        settings->text_scale = v->controls.text_scale;
    if (v->controls.parts != v->begun_controls.parts)
        settings->show_parts = v->controls.parts;
    if (v->controls.orthographic != v->begun_controls.orthographic)
        settings->orthographic = v->controls.orthographic;
    if (bookmarks)
        strl_settings_set_bookmarks(settings, strl_container_get_info(v->model->container)->model_id, &v->bookmarks);
    if (strl_settings_save(settings, &err) != STRL_OK)
        strl__viewer_say(v, "%s", err.message);
}
