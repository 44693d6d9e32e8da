/* What the panels show. */
#ifndef STRL_VIEWER_FACTS_H
#define STRL_VIEWER_FACTS_H

#include "viewer/bookmarks.h"
#include "viewer/parts.h"
#include "viewer/picks.h"
#include "viewer/recorder.h"
#include "viewer/section.h"

/* Everything is borrowed for the call. */
typedef struct strl_gui_facts {
    const char *model, *device, *unit; /* unit "" = unknown */
    uint64_t model_triangles, placed_triangles,
        placements; /* placed: each tree's as often as it is placed; 0 = unknown */
    double fps, frame_ms, select_ms;
    bool idle; /* nothing moves: no frame is drawn until something does */
    uint64_t triangles, resident_bytes, memory_bytes, gpu_bytes, gpu_memory_bytes, faults;
    uint32_t nodes, nodes_culled, draws, requests, missing_nodes;
    double allowed_error_px, max_error_px;
    double speed; /* of flying and walking, world units a second */
    bool remote;  /* the model is: then the next two are of its link */
    double megabits_per_second, latency_ms;
    const char *last_fault;  /* empty = none */
    const char *message;     /* empty = none */
    const char *keys;        /* the help's lines */
    const float (*lines)[4]; /* x y x y in framebuffer pixels */
    uint32_t line_count;
    float marks[STRL_MOST_PICKS][2]; /* where the picks are, framebuffer pixels */
    bool mark_shown[STRL_MOST_PICKS];
    const strl_parts *parts;
    uint32_t reveal; /* a row of the part tree to scroll to; UINT32_MAX = none */
    const strl_picks *picks;
    const strl_section *section;
    double section_range[2];
    const strl_bookmarks *bookmarks;
    const strl_recorder *recorder;
    const char *mesh; /* that was dropped and of which the model was built; "" = none */
    bool builds;      /* a mesh that was dropped */
    double build_share;
    const char *build_text;
} strl_gui_facts;

#endif
