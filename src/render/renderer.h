/* What every backend implements. A backend's own struct starts with a strl_renderer. */
#ifndef STRL_RENDER_RENDERER_H
#define STRL_RENDER_RENDERER_H

#include "frame/view.h"
#include "stroll/render.h"

/* One draw, checked and completed: no defaults left. */
typedef struct strl_draw_setup {
    strl_camera camera;
    strl_view view;
    double near_distance, far_distance;
    bool cull_back; /* of triangles, as the list says */
    strl_draw_options options;
    uint32_t supersample;
} strl_draw_setup;

typedef struct strl_renderer_class {
    strl_backend backend;
    strl_status (*draw)(strl_renderer *renderer, const strl_draw_setup *setup, const strl_draw_list *list,
                        strl_render_stats *stats, strl_error *err);
    void (*finish)(strl_renderer *renderer);
    strl_status (*resize)(strl_renderer *renderer, strl_error *err); /* to desc.width and desc.height */
    strl_status (*read_colour)(strl_renderer *renderer, uint8_t *rgba, strl_error *err);
    strl_status (*read_depth)(strl_renderer *renderer, float *depth, strl_error *err);
    strl_status (*present)(strl_renderer *renderer, uint32_t width, uint32_t height, strl_error *err);
    void (*destroy)(strl_renderer *renderer);
} strl_renderer_class;

struct strl_renderer {
    const strl_renderer_class *klass;
    strl_renderer_desc desc; /* completed: no defaults left */
    bool drawn;              /* there is an image to read */
    char device[128];
};

/* desc is completed. */
strl_status strl__null_renderer_create(const strl_renderer_desc *desc, strl_renderer **renderer, strl_error *err);
strl_status strl__gl3_renderer_create(const strl_renderer_desc *desc, strl_renderer **renderer, strl_error *err);
strl_status strl__gl45_renderer_create(const strl_renderer_desc *desc, strl_renderer **renderer, strl_error *err);

#endif
