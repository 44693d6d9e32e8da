/* The public face: checks arguments, completes defaults, hands over to a backend. */
#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "render/renderer.h"

#define DEFAULT_GPU_BYTES (512u << 20)
#define MOST_SUPERSAMPLE 8u
#define DEFAULT_HEADLIGHT 0.55f

static strl_status check_size(uint32_t width, uint32_t height, strl_error *err)
{
    if (width == 0 || height == 0 || width > 16384 || height > 16384)
        return strl__fail(err, STRL_ERR_ARGUMENT,
                          "an image of %" PRIu32 "x%" PRIu32 " pixels is not between 1x1 and 16384x16384", width,
                          height);
    return STRL_OK;
}

static strl_status complete(strl_renderer_desc *desc, strl_error *err)
{
    if (desc->supersample == 0)
        desc->supersample = 1;
    if (desc->gpu_memory_bytes == 0)
        desc->gpu_memory_bytes = DEFAULT_GPU_BYTES;
    if (desc->supersample > MOST_SUPERSAMPLE)
        return strl__fail(err, STRL_ERR_ARGUMENT, "supersample is %" PRIu32 ", expected 1 to %u", desc->supersample,
                          MOST_SUPERSAMPLE);
    if (desc->gpu_memory_bytes < STRL_RENDERER_LEAST_GPU_BYTES)
        return strl__fail(err, STRL_ERR_ARGUMENT, "a GPU memory budget of %" PRIu64 " bytes is below the least, %u",
                          desc->gpu_memory_bytes, STRL_RENDERER_LEAST_GPU_BYTES);
    return check_size(desc->width, desc->height, err);
}

strl_status strl_renderer_create(const strl_renderer_desc *desc, strl_renderer **renderer, strl_error *err)
{
    *renderer = NULL;
    strl_renderer_desc full = *desc;
    strl_status status = complete(&full, err);
    if (status != STRL_OK)
        return status;
    switch (full.backend) {
    case STRL_BACKEND_NULL:
        return strl__null_renderer_create(&full, renderer, err);
    case STRL_BACKEND_GL45:
        return strl__gl45_renderer_create(&full, renderer, err);
    case STRL_BACKEND_GL3:
        return strl__gl3_renderer_create(&full, renderer, err);
    case STRL_BACKEND_DEFAULT:
        break;
    default:
        return strl__fail(err, STRL_ERR_ARGUMENT, "there is no renderer backend %d", (int)full.backend);
    }
    status = strl__gl45_renderer_create(&full, renderer, err);
    if (status == STRL_ERR_UNSUPPORTED)
        status = strl__gl3_renderer_create(&full, renderer, err);
    return status;
}

void strl_renderer_destroy(strl_renderer *renderer)
{
    if (renderer)
        renderer->klass->destroy(renderer);
}

strl_backend strl_renderer_backend(const strl_renderer *renderer)
{
    return renderer->klass->backend;
}

const char *strl_renderer_device(const strl_renderer *renderer)
{
    return renderer->device;
}

strl_status strl_renderer_resize(strl_renderer *renderer, uint32_t width, uint32_t height, strl_error *err)
{
    strl_status status = check_size(width, height, err);
    if (status != STRL_OK || (width == renderer->desc.width && height == renderer->desc.height))
        return status;
    renderer->desc.width = width;
    renderer->desc.height = height;
    renderer->drawn = false;
    return renderer->klass->resize(renderer, err);
}

static void complete_options(strl_draw_options *options)
{
    if (options->headlight == 0)
        options->headlight = DEFAULT_HEADLIGHT;
    double *up = options->sky_up, length = sqrt(up[0] * up[0] + up[1] * up[1] + up[2] * up[2]);
    if (!(length > 0) || !isfinite(length))
        up[0] = up[1] = 0, up[2] = length = 1;
    for (int i = 0; i < 3; i++)
        up[i] /= length;
    for (int i = 0; i < 4; i++)
        if (!isfinite(options->section[i]))
            memset(options->section, 0, sizeof options->section);
}

strl_status strl_renderer_draw(strl_renderer *renderer, const strl_camera *camera, const strl_draw_list *list,
                               const strl_draw_options *options, strl_render_stats *stats, strl_error *err)
{
    strl_draw_setup setup = {.camera = *camera,
                             .near_distance = list->near_distance,
                             .far_distance = list->far_distance,
                             .cull_back = list->cull == STRL_CULL_BACK,
                             .supersample = renderer->desc.supersample};
    strl_render_stats unwanted;
    if (!stats)
        stats = &unwanted;
    memset(stats, 0, sizeof *stats);
    if (options)
        setup.options = *options;
    complete_options(&setup.options);
    if (!strl_view_init(&setup.view, camera))
        return strl__fail(err, STRL_ERR_ARGUMENT,
                          "the camera is degenerate: eye, target, up or angle do not make a view");
    if (camera->width != renderer->desc.width || camera->height != renderer->desc.height)
        return strl__fail(err, STRL_ERR_ARGUMENT,
                          "the camera's image is %" PRIu32 "x%" PRIu32 ", the renderer's %" PRIu32 "x%" PRIu32,
                          camera->width, camera->height, renderer->desc.width, renderer->desc.height);
    if (list->cull != STRL_CULL_NONE && list->cull != STRL_CULL_BACK)
        return strl__fail(err, STRL_ERR_ARGUMENT, "the draw list culls faces of a kind %d, which there is not",
                          (int)list->cull);
    if (list->count == 0)
        setup.near_distance = setup.far_distance = 1;
    else if (!(setup.near_distance > 0) || !(setup.far_distance >= setup.near_distance) ||
             !isfinite(setup.far_distance))
        return strl__fail(err, STRL_ERR_ARGUMENT, "the draw list reaches from %g to %g, expected 0 < near <= far",
                          setup.near_distance, setup.far_distance);
    strl_status status = renderer->klass->draw(renderer, &setup, list, stats, err);
    renderer->drawn = renderer->drawn || status == STRL_OK;
    return status;
}

void strl_renderer_finish(strl_renderer *renderer)
{
    renderer->klass->finish(renderer);
}

static strl_status check_drawn(const strl_renderer *renderer, strl_error *err)
{
    return renderer->drawn ? STRL_OK : strl__fail(err, STRL_ERR_ARGUMENT, "nothing has been drawn at this size yet");
}

strl_status strl_renderer_read_colour(strl_renderer *renderer, uint8_t *rgba, strl_error *err)
{
    strl_status status = check_drawn(renderer, err);
    return status != STRL_OK ? status : renderer->klass->read_colour(renderer, rgba, err);
}

strl_status strl_renderer_read_depth(strl_renderer *renderer, float *depth, strl_error *err)
{
    strl_status status = check_drawn(renderer, err);
    return status != STRL_OK ? status : renderer->klass->read_depth(renderer, depth, err);
}

strl_status strl_renderer_present(strl_renderer *renderer, uint32_t window_width, uint32_t window_height,
                                  strl_error *err)
{
    strl_status status = check_drawn(renderer, err);
    if (status == STRL_OK)
        status = check_size(window_width, window_height, err);
    return status != STRL_OK ? status : renderer->klass->present(renderer, window_width, window_height, err);
}
