/* A walk: one visitor's session. Camera in, draw list out; residency and prefetch in between. No GL, no thread of its own,
 * never a wait inside a frame. One thread at a time. */
#ifndef STROLL_WALK_H
#define STROLL_WALK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "stroll/error.h"
#include "stroll/frame.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct strl_walk strl_walk;

/* Where decoding runs. submit hands over a job; it may run at any time on any thread until it has returned.
 * NULL in strl_walk_desc: jobs run inside strl_walk_pump on the walk's thread. */
typedef struct strl_executor {
    void *context;
    strl_status (*submit)(void *context, void (*run)(void *job), void *job, strl_error *err);
} strl_executor;

/* How to walk. Zero-initialise: every 0 takes its default. */
typedef struct strl_walk_desc {
    uint64_t memory_bytes;     /* hard bound of decoded nodes and node records held; 0 = 512 MiB. Pages that wait for decoding
                                  come on top: requests_in_flight of them at most */
    double error_px;           /* allowed pixel error; 0 = 1 */
    uint32_t requests_in_flight; /* 0 = 16; at most 256 */
    const strl_executor *executor; /* borrowed for the life of the walk */
    bool labels; /* keep the part and material of each vertex: 8 bytes a vertex more, within memory_bytes */
} strl_walk_desc;

typedef struct strl_walk_stats {
    uint64_t frame;
    uint64_t triangles;        /* in visible items */
    uint32_t nodes;            /* visible items */
    uint32_t nodes_culled;     /* active, but outside the frustum */
    uint32_t missing_nodes;    /* nodes of the wanted front that are not drawn yet; where the records of their parents' children are
                                  missing too, those parents */
    uint32_t requests;         /* reads submitted in this frame */
    uint32_t requests_pending;
    uint64_t bytes_read;       /* answered in this frame */
    uint64_t resident_bytes;   /* decoded nodes and node records held, reads under way included */
    uint64_t splits, collapses;           /* of nodes, in this frame */
    uint64_t dependent_splits; /* those that only another member of the dependency group asked for */
    uint64_t dependent_collapses; /* those of nodes that had stayed split for another member alone */
    uint64_t vertex_splits, vertex_collapses;       /* progressive-mesh steps done in this frame */
    double allowed_error_px;   /* error_px, or more where the budget is tight */
    float max_error_px;        /* largest claimed among visible items */
    uint64_t select_ns;        /* time in strl_walk_frame */
    uint64_t faults;           /* reads or pages that failed since the walk began */
    char last_fault[256];      /* the newest one's sentence; empty = none */
} strl_walk_stats;

struct strl_source;
/* Opens the container behind source and owns the source from then on, also on failure. */
strl_status strl_walk_open(struct strl_source *source, const strl_walk_desc *desc, strl_walk **walk, strl_error *err);
void strl_walk_close(strl_walk *walk); /* NULL is legal; waits for decode jobs that are running */

/* The model's bounds in world units: min xyz, max xyz. */
void strl_walk_bounds(const strl_walk *walk, double bounds[6]);
void strl_walk_set_error_px(strl_walk *walk, double error_px);

/* Takes what has arrived, refines the front for the camera, asks for what is missing. The list is borrowed until the next call. */
strl_status strl_walk_frame(strl_walk *walk, const strl_camera *camera, strl_draw_list *list, strl_error *err);
/* Runs decode jobs inline for up to budget_ns (only without executor). Returns how many ran. */
uint64_t strl_walk_pump(strl_walk *walk, uint64_t budget_ns);
/* True where the last frame's front is the wanted one: nothing is missing and nothing pending for it. What has failed three
 * times in a row is not waited for, though it is asked for again: missing_nodes still counts it. Without a tight budget a settled
 * draw list is a function of camera and error alone. */
bool strl_walk_settled(const strl_walk *walk);
const strl_walk_stats *strl_walk_get_stats(const strl_walk *walk); /* borrowed */

#ifdef __cplusplus
}
#endif
#endif
