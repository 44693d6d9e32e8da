#include "render_model.h"

#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "container/layout.h"
#include "platform/file.h"

#define LEAST_NEAR 1e-6

static strl_status is_container(const char *path, bool *answer, strl_error *err)
{
    strl_file *file = NULL;
    char magic[8];
    size_t got = 0;
    strl_status status = strl_file_open(path, &file, err);
    if (status == STRL_OK)
        status = strl_file_read_some(file, 0, magic, sizeof magic, &got, err);
    *answer = status == STRL_OK && got == sizeof magic && memcmp(magic, STRL__MAGIC, sizeof magic) == 0;
    strl_file_close(file, NULL);
    return status;
}

strl_status strl_render_model_open(const strl_render_model_desc *desc, strl_render_model **model, strl_error *err)
{
    *model = NULL;
    if (strstr(desc->path, "://"))
        return strl__fail(err, STRL_ERR_UNSUPPORTED,
                          "%s: models behind an address are not supported yet, expected a file", desc->path);
    bool container;
    strl_status status = is_container(desc->path, &container, err);
    if (status != STRL_OK)
        return status;
    if (container)
        return desc->full ? strl_render_full_open(desc, model, err) : strl_render_walk_open(desc, model, err);
    if (!desc->full)
        return strl__fail(err, STRL_ERR_ARGUMENT,
                          "%s is not a container: build one first (stroll build), or draw its triangles as read "
                          "with --full",
                          desc->path);
    return strl_render_soup_open(desc, model, err);
}

void strl_render_set_range(strl_draw_list *list, double least, double largest)
{
    list->far_distance = largest > 0 && isfinite(largest) ? largest : 1;
    list->near_distance = fmin(fmax(least, list->far_distance * LEAST_NEAR), list->far_distance / 2);
}

void strl_render_add_stats(strl_image_stats *stats, const strl_render_stats *drawn)
{
    stats->triangles += drawn->triangles;
    stats->nodes += drawn->items;
    stats->draws += drawn->draws;
    stats->uploaded_bytes += drawn->uploaded_bytes;
    stats->evictions += drawn->evictions;
    stats->gpu_bytes = drawn->gpu_bytes;
}
