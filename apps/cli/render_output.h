/* Where images go: PNG files, depth files, the contact sheet, the path, one line of statistics a frame. */
#ifndef STRL_CLI_RENDER_OUTPUT_H
#define STRL_CLI_RENDER_OUTPUT_H

#include <stdio.h>

#include "platform/output.h"
#include "render_model.h"
#include "shared/camera_path.h"
#include "shared/image.h"

typedef struct strl_render_output_desc {
    const char *path;  /* NAME.png or a folder, which is made; NULL = no images */
    const char *stats; /* NULL = none */
    bool depth;
    bool realtime; /* say so in the statistics */
    uint32_t size[2];
    uint8_t background[3];           /* sRGB, of the contact sheet where it has no frame */
    const strl_camera_path *cameras; /* borrowed */
} strl_render_output_desc;

typedef struct strl_render_output {
    strl_render_output_desc desc;
    bool folder;
    bool made_folder; /* by us: removed again where nothing came into it */
    strl_output *stats;
    FILE *stats_stream; /* onto stats; borrowed */
    strl_image image;
    uint8_t *rgba;
    float *depth;
    strl_contact_sheet sheet;
} strl_render_output;

/* Whether images could go to `path` (NULL = none), for before the work. */
strl_status strl_render_output_check(const char *path, strl_error *err);
/* On failure nothing is left to release. */
strl_status strl_render_output_init(strl_render_output *output, const strl_render_output_desc *desc, strl_error *err);
/* Reads the renderer's image back and writes what is wanted of frame `frame`. */
strl_status strl_render_output_add(strl_render_output *output, size_t frame, strl_renderer *renderer,
                                   const strl_image_stats *stats, strl_error *err);
/* Writes what belongs to all frames together. */
strl_status strl_render_output_finish(strl_render_output *output, strl_error *err);
/* After finish, or instead of it: then the images so far stay, each of which is whole, and the rest is removed. */
void strl_render_output_deinit(strl_render_output *output);

#endif
