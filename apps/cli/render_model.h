/* What `stroll render` draws: an input file as read, a container's finest level, or a walk through a container. Each
 * turns a camera into an image of a renderer. */
#ifndef STRL_CLI_RENDER_MODEL_H
#define STRL_CLI_RENDER_MODEL_H

#include <stdbool.h>
#include <stdint.h>

#include "progress.h"
#include "shared/location.h"
#include "stroll/error.h"
#include "stroll/frame.h"
#include "stroll/render.h"

/* Of one image; what --stats writes. */
typedef struct strl_image_stats {
    uint64_t frame_ns, select_ns, draw_ns; /* frame: from camera to finished pixels; select: of the last front */
    /* from the command's begin to finished pixels, opening and images before included */
    uint64_t elapsed_ns;
    uint64_t triangles, bytes_read, resident_bytes, gpu_bytes, uploaded_bytes;
    uint64_t splats;
    uint32_t nodes, nodes_culled, nodes_backfacing, draws, requests, missing_nodes, evictions;
    uint32_t fronts; /* selected until the front was resident */
    float max_error_px;
    double allowed_error_px;
    uint64_t disk_waits;  /* of the drawing thread between camera and finished pixels, see strl_thread_disk_waits */
    uint64_t faults;      /* reads and pages that failed so far; they may have healed since */
    char last_fault[256]; /* the newest one's sentence; empty = none */
    bool remote;
    strl_network_stats network; /* since the model was opened */
} strl_image_stats;

typedef struct strl_render_model strl_render_model;

typedef struct strl_render_model_class {
    strl_status (*draw)(strl_render_model *model, strl_renderer *renderer, const strl_camera *camera,
                        const strl_draw_options *options, strl_image_stats *stats, strl_error *err);
    void (*idle)(strl_render_model *model, uint64_t budget_ns); /* time between two images; may be NULL */
    void (*close)(strl_render_model *model);
} strl_render_model_class;

struct strl_render_model {
    const strl_render_model_class *klass;
    double bounds[6]; /* world, min xyz, max xyz */
    unsigned up_axis;
    char unit[16]; /* "" = unknown */
};

typedef struct strl_render_model_desc {
    strl_location location;
    bool full;     /* a container's finest level; an input file can be drawn in no other way */
    bool realtime; /* a walk that never waits */
    double error_px, splat_px;
    strl_cull cull;
    uint64_t memory_bytes; /* of the walk's decoded nodes */
    strl_cli_progress *progress;
} strl_render_model_desc;

/* Recognises by content what the file is; an address is taken for a container. */
strl_status strl_render_model_open(const strl_render_model_desc *desc, strl_render_model **model, strl_error *err);

strl_status strl_render_soup_open(const strl_render_model_desc *desc, strl_render_model **model, strl_error *err);
strl_status strl_render_full_open(const strl_render_model_desc *desc, strl_render_model **model, strl_error *err);
strl_status strl_render_walk_open(const strl_render_model_desc *desc, strl_render_model **model, strl_error *err);

/* Near and far of a list whose visible boxes lie between least and largest along the view. The eye may stand inside a
 * box; the depth buffer still wants a near plane before it. */
void strl_render_set_range(strl_draw_list *list, double least, double largest);
/* Adds a renderer's figures of one draw. */
void strl_render_add_stats(strl_image_stats *stats, const strl_render_stats *drawn);

#endif
