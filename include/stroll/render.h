/* A renderer turns a draw list into pixels. It holds copies of the nodes' vertices and indices within a
 * hard byte budget and knows nothing of where a list comes from. Image rows go from top to bottom.
 *
 * Call order: create -> (draw -> finish | read | present)* -> destroy. One thread at a time; a renderer
 * that made its own context makes it current in every call and leaves it current. */
#ifndef STROLL_RENDER_H
#define STROLL_RENDER_H

#include <stdbool.h>
#include <stdint.h>

#include "stroll/error.h"
#include "stroll/frame.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct strl_renderer strl_renderer;

typedef enum strl_backend {
    STRL_BACKEND_DEFAULT = 0, /* GL45 where the system has it, else GL3 */
    STRL_BACKEND_GL45,        /* OpenGL 4.5 core */
    STRL_BACKEND_GL3,         /* OpenGL 3.3 core or OpenGL ES 3.0 */
    STRL_BACKEND_NULL         /* draws nothing, checks every item, counts */
} strl_backend;

/* The smallest gpu_memory_bytes: the largest possible node and what moves it there. */
#define STRL_RENDERER_LEAST_GPU_BYTES (4u << 20)

/* Zero-initialise: every 0 but the size takes its default. */
typedef struct strl_renderer_desc {
    strl_backend backend;
    uint32_t width, height; /* of the image, in pixels */
    /* draws this many times wider and higher and filters in linear light; 0 = 1, at most 8 */
    uint32_t supersample;
    uint64_t gpu_memory_bytes; /* hard bound of all buffers of nodes, render targets apart; 0 = 512 MiB */
    /* use the GL context that is current (a window's); else a headless one is made and owned */
    bool current_context;
    bool gles;      /* GL3 without current_context: make an OpenGL ES context */
    bool core_only; /* GL3: no extension, not even clip control */
} strl_renderer_desc;

typedef enum strl_debug_colour {
    STRL_DEBUG_NONE = 0,
    STRL_DEBUG_CLUSTER, /* one colour a node */
    STRL_DEBUG_LEVEL,   /* one colour a level */
    STRL_DEBUG_ERROR    /* blue (0 px) over green to red (2 px and more) */
} strl_debug_colour;

typedef enum strl_part_style {
    STRL_PART_PLAIN = 0,
    STRL_PART_HIDDEN,
    STRL_PART_MARKED /* tinted */
} strl_part_style;

/* How to draw one list. Zero-initialise: every 0 takes its default. */
typedef struct strl_draw_options {
    strl_debug_colour debug;
    bool wireframe;        /* OpenGL ES draws the edges of backs too, whatever the list culls */
    bool flat;             /* normals of the triangles instead of those of the vertices */
    bool keep;             /* draw over the last image, which had the same camera, near and far */
    uint8_t background[3]; /* sRGB-encoded */
    float headlight;       /* strength of the light at the eye; 0 = 0.55 */
    double sky_up[3];      /* world direction from which the sky shines; zero = +z */
    double section[4];     /* world: only points p with x p.x + y p.y + z p.z <= w are drawn; zero = all */
    /* Of parts by number, strl_part_style each; parts past the end are plain. It works on items with labels, and on
     * placements with a part of their own. NULL = all plain. Borrowed for the draw. The version tells contents apart:
     * vertices are sent again only where it differs from that of the draw before; change it with the contents. */
    const uint8_t *part_styles;
    uint32_t part_count;
    uint64_t styles_version;
} strl_draw_options;

/* Of one draw. */
typedef struct strl_render_stats {
    uint64_t triangles;      /* in visible items */
    uint32_t items;          /* visible ones */
    uint32_t draws;          /* draw records given to the system */
    uint64_t uploaded_bytes; /* vertices and indices copied to the GPU in this draw */
    uint64_t uploaded_vertices;
    uint64_t uploaded_indices;
    uint32_t evictions; /* nodes thrown out of the budget in this draw */
    uint64_t gpu_bytes; /* all buffers of nodes now; never above gpu_memory_bytes */
} strl_render_stats;

/* Fails with STRL_ERR_UNSUPPORTED where the system has no such context, with STRL_ERR_LIMIT where the image
 * is larger than it can draw, with STRL_ERR_ARGUMENT where the image is not between 1x1 and 16384x16384 or
 * the budget is below the least. */
STRL_API strl_status strl_renderer_create(const strl_renderer_desc *desc, strl_renderer **renderer, strl_error *err);
STRL_API void strl_renderer_destroy(strl_renderer *renderer); /* NULL is legal */

STRL_API strl_backend strl_renderer_backend(const strl_renderer *renderer);
/* One line for people: the system's name of its renderer. Borrowed. */
STRL_API const char *strl_renderer_device(const strl_renderer *renderer);
/* The image has to be drawn anew. Fails as strl_renderer_create does. */
STRL_API strl_status strl_renderer_resize(strl_renderer *renderer, uint32_t width, uint32_t height, strl_error *err);

/* Draws the visible items. The camera's size is the renderer's. options and stats may be NULL. Does not wait for
 * the GPU. Fails with STRL_ERR_ARGUMENT where camera or list are not what stroll/frame.h says, with STRL_ERR_LIMIT
 * where one node alone does not fit the budget; the image is undefined then. */
STRL_API strl_status strl_renderer_draw(strl_renderer *renderer, const strl_camera *camera, const strl_draw_list *list,
                                        const strl_draw_options *options, strl_render_stats *stats, strl_error *err);
/* Waits until everything drawn is there. */
STRL_API void strl_renderer_finish(strl_renderer *renderer);

/* These fail with STRL_ERR_ARGUMENT where nothing has been drawn at this size yet.
 *
 * Copies the last image: sRGB-encoded RGBA8, width * height * 4 bytes. Alpha is the share of samples that a
 * triangle covers. */
STRL_API strl_status strl_renderer_read_colour(strl_renderer *renderer, uint8_t *rgba, strl_error *err);
/* Copies its depth: width * height distances along the view direction in world units, +infinity where there is only
 * background. With supersample it is that of the sample next to the pixel's centre (above and right of it). */
STRL_API strl_status strl_renderer_read_depth(strl_renderer *renderer, float *depth, strl_error *err);
/* Copies the last image to the window of the current context (framebuffer 0), scaled to it. Does not swap. */
STRL_API strl_status strl_renderer_present(strl_renderer *renderer, uint32_t window_width, uint32_t window_height,
                                           strl_error *err);

#ifdef __cplusplus
}
#endif
#endif
