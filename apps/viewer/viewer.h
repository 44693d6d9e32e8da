/* `stroll view`: a window on a container, for walking through it and reviewing it. */
#ifndef STRL_VIEWER_VIEWER_H
#define STRL_VIEWER_VIEWER_H

#include <stdint.h>

#include "shared/location.h"
#include "stroll/error.h"
#include "stroll/render.h"

/* One frame that has been shown. */
typedef struct strl_viewer_frame {
    uint64_t frame_ns, select_ns; /* frame: from the camera to the swap of the window's buffers */
    uint64_t triangles;
    uint32_t missing_nodes;
    uint64_t memory_bytes;       /* the walk's budget */
    double asked_px, allowed_px; /* pixel error: of the panel; more where memory is tight */
    double splat_px;             /* of sample trees, as asked for */
    double max_error_px;         /* of what was drawn; infinite where the eye is inside a node's box */
} strl_viewer_frame;

/* Zero-initialise: every 0 but location.name takes what the settings remember, else its default. Strings are borrowed
 * for the call. */
typedef struct strl_viewer_desc {
    strl_location location;  /* of a container */
    const char *screenshots; /* the folder where pictures and paths go, made at the first; NULL = the current one */
    const char *settings;    /* the file that remembers; NULL = nothing is remembered */
    /* the folder for containers of meshes from folders that cannot be written; NULL = none */
    const char *cache;
    const char *camera_path; /* a path file to replay, at once; NULL = none */
    const char *journal;     /* a file for what happens, one JSON object a line; NULL = none */
    strl_backend backend;    /* STRL_BACKEND_NULL is no window's */
    uint32_t size[2];        /* of the window in screen units; 0 = 1280x720 */
    double error_px;         /* 0 = 1 */
    double splat_px;         /* of sample trees, as in strl_walk_desc; 0 = error_px */
    strl_cull cull;
    uint64_t memory_bytes;     /* of decoded nodes; 0 = 512 MiB */
    uint64_t gpu_memory_bytes; /* of buffers of nodes; 0 = 512 MiB */
    /* the window closes after as many, and never rests till then; 0 = when it is told to */
    uint64_t frames;
    void (*shown)(void *context, const strl_viewer_frame *frame); /* after each frame; may be NULL */
    void *context;
} strl_viewer_desc;

/* Runs until the window is closed. On the program's first thread; STRL_ERR_UNSUPPORTED where there is no display. */
strl_status strl_viewer_run(const strl_viewer_desc *desc, strl_error *err);

/* Keys and mouse, one a line, for people. */
extern const char strl_viewer_keys[];

#endif
