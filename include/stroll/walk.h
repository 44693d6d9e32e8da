/* A walk: one visitor's session. Camera in, draw list out; residency and prefetch in between. No GL, no
 * thread of its own, never a wait inside a frame. One thread at a time.
 *
 * Call order: open -> (frame -> draw what it gave -> pump)* -> close. A draw list is legal input of
 * strl_renderer_draw, and of your own renderer: docs/guide/ has one. */
#ifndef STROLL_WALK_H
#define STROLL_WALK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "stroll/container.h"
#include "stroll/error.h"
#include "stroll/frame.h"
#include "stroll/source.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct strl_walk strl_walk;

/* Where decoding runs. submit hands over run(job): to be called exactly once, at any time, on any thread,
 * also inside submit, which then takes as long as a decode. A job that was accepted (STRL_OK) must be run
 * even after the walk was closed: it does nothing then but release itself. submit is called on the walk's
 * thread and may refuse with a sentence (strl_error_set): the node stays coarse and is asked for again
 * later. context must live until every accepted job has run. NULL in strl_walk_desc: jobs run inside
 * strl_walk_pump on the walk's thread. */
typedef struct strl_executor {
    void *context;
    strl_status (*submit)(void *context, void (*run)(void *job), void *job, strl_error *err);
} strl_executor;

/* How to walk. Zero-initialise: every 0 takes its default. */
typedef struct strl_walk_desc {
    /* hard bound of decoded nodes and node records held; 0 = 512 MiB. Pages that wait for decoding come on top:
     * requests_in_flight of them at most */
    uint64_t memory_bytes;
    double error_px; /* allowed pixel error; 0 = 1 */
    /* of sample trees: cells that cover no more than a square of this side are drawn as splats of at most it, which
     * is the pixel error that such trees are allowed; 0 = error_px. Where error_px is changed later, it changes in
     * proportion */
    double splat_px;
    /* 0 = 16, of a remote source 64; at most 256. Of a remote source fewer, as bandwidth and latency want it */
    uint32_t requests_in_flight;
    const strl_executor *executor; /* copied */
    /* STRL_CULL_BACK: the draw lists say so, and nodes that show nothing but backs are not in them, nor read */
    strl_cull cull;
    /* keep part, material and texture coordinate of each vertex: 12 bytes a vertex more, within memory_bytes */
    bool labels;
} strl_walk_desc;

typedef struct strl_walk_stats {
    uint64_t frame;
    uint64_t triangles;    /* in visible items */
    uint64_t splats;       /* beside them */
    uint32_t nodes;        /* visible items */
    uint32_t nodes_culled; /* active, but outside the frustum */
    /* left out, each with all that is below it: with STRL_CULL_BACK nothing of them would be seen. Of sample trees;
     * not in nodes_culled */
    uint32_t nodes_backfacing;
    /* nodes of the wanted front that are not drawn yet, or too coarsely; where the records of their parents'
     * children are missing too, those parents */
    uint32_t missing_nodes;
    uint32_t requests; /* reads submitted in this frame */
    uint32_t requests_pending;
    uint64_t bytes_read;          /* answered in this frame */
    uint64_t resident_bytes;      /* decoded nodes, node records and some pages held, reads under way included */
    uint64_t splits, collapses;   /* of nodes, in this frame */
    uint64_t dependent_splits;    /* those that only another member of the dependency group asked for */
    uint64_t dependent_collapses; /* those of nodes that had stayed split for another member alone */
    uint64_t vertex_splits, vertex_collapses; /* progressive-mesh steps done in this frame */
    /* error_px, or more where the budget is tight; of sample trees splat_px / error_px times as much is allowed */
    double allowed_error_px;
    /* largest claimed among visible items, of splats their size; infinite where the eye is inside a node's box */
    float max_error_px;
    uint64_t select_ns; /* time in strl_walk_frame */
    bool remote;        /* the source is: then what it has done since it was opened is in `network` */
    strl_network_stats network;
    uint64_t faults;      /* reads or pages that failed since the walk began */
    char last_fault[256]; /* the newest one's sentence; empty = none */
} strl_walk_stats;

/* Opens the container behind source and owns the source from then on, also on failure. Reads what a first
 * image needs, and waits for it. desc may be NULL. Fails as strl_container_open does, and with
 * STRL_ERR_MEMORY where the root does not fit memory_bytes. */
STRL_API strl_status strl_walk_open(strl_source *source, const strl_walk_desc *desc, strl_walk **walk, strl_error *err);
STRL_API void strl_walk_close(strl_walk *walk); /* NULL is legal; waits for decode jobs that are running */

/* The model's bounds in world units: min xyz, max xyz. */
STRL_API void strl_walk_bounds(const strl_walk *walk, double bounds[6]);
/* What the model is: unit, up axis, counts, names of parts. Borrowed; calls of it that may wait are legal
 * between two frames, on the walk's thread. */
STRL_API strl_container *strl_walk_container(strl_walk *walk);
/* From the next frame on. Not finite or not above 0: 1. */
STRL_API void strl_walk_set_error_px(strl_walk *walk, double error_px);

/* Takes what has arrived, refines the front for the camera, asks for what is missing. The list is borrowed
 * until the next call. Fails with STRL_ERR_ARGUMENT where the camera is degenerate: the list is empty then,
 * and the walk goes on. Reads and pages that fail are no failure of the frame: what they hold stays coarse,
 * and the statistics say why. */
STRL_API strl_status strl_walk_frame(strl_walk *walk, const strl_camera *camera, strl_draw_list *list, strl_error *err);
/* Runs decode jobs inline for up to budget_ns, one in any case (only without executor). Returns how many ran. */
STRL_API uint64_t strl_walk_pump(strl_walk *walk, uint64_t budget_ns);
/* True where the last frame's front is the wanted one: nothing is missing and nothing pending for it. What
 * has failed three times in a row (eight times where a network gave wrong bytes) is not waited for, though it is asked
 * for again: missing_nodes still counts it. Without a tight budget a settled draw list is a function of camera and
 * error alone. */
STRL_API bool strl_walk_settled(const strl_walk *walk);
/* Of the last frame. Borrowed until the walk is closed; the next frame overwrites it. */
STRL_API const strl_walk_stats *strl_walk_get_stats(const strl_walk *walk);

#ifdef __cplusplus
}
#endif
#endif
