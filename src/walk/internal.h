/* What the files of walk/ share.
 *
 * A frame runs: answers and finished decodes (requests.c) -> the groups that must split for the
 * camera (closure.c) and the part of that cut that residency allows (front.c, under budget.c's
 * allowed error) -> states of the front's meshes (refine.c) -> reads for what is missing (requests.c
 * over residency.c) -> draw list (draw.c).
 *
 * Invariants: (1) a group splits as a whole, only when all its members are active and all children
 * of all members are resident, so that the front is a cut without cracks whatever is resident; (2)
 * nodes of the wanted cut and all their ancestors carry wanted_frame = this frame and are not
 * evicted, so that collapsing never waits; (3) resident_bytes counts meshes, records,
 * placements, pages kept and reservations of reads under way, and never exceeds memory_bytes (beside it there are, for
 * a moment, meshes that were replaced); (4) a run of placements whose page is not there is drawn as a point; a page
 * that the front points into carries wanted_frame = this frame. */
#ifndef STRL_WALK_INTERNAL_H
#define STRL_WALK_INTERNAL_H

#include <stdatomic.h>

#include "base/fail.h"
#include "container/treelet.h"
#include "frame/view.h"
#include "stroll/walk.h"

#define STRL__MAX_REQUESTS 256u
/* bytes that a decoded node may take beside what its record says: splats of an empty brick */
#define STRL__SPLAT_ROOM 2048u
#define STRL__PREVIEW_ROOM (STRL_BRICK_SPLATS * sizeof(strl_splat)) /* the same of the first node of a tree */
#define STRL__PREFETCH_SHARE 1e-3 /* what may be wanted later comes after all that is wanted now */
#define STRL__LEAST_GUARD 1.25
#define STRL__HALVINGS (STRL_BRICK_LEVELS + 1)
#define STRL__MOST_POINT_PX 64.0 /* what every GL draws */

typedef enum strl__residency { STRL__ABSENT, STRL__PENDING, STRL__RESIDENT } strl__residency;

/* When something that failed may be asked for again. */
typedef struct strl__retry {
    uint32_t failures; /* in a row */
    uint64_t frame;    /* not before this frame, */
    bool is_unread;    /* unless it was the source that failed, and it has come back: */
    uint64_t returns;  /* the walk's, when it failed */
    /* the last time it was asked for before its frame: only the end of a lasting outage calls it again */
    bool was_early;
} strl__retry;

/* A decoded node: one block of at most strl__node_bytes, which `vertices` begins. indices[k]
 * = resolve(corner k, state) for all corners, also those of triangles that the state does not have
 * yet; of a node that several placements draw (`shared`), each in its state, the corners of some states are there, one
 * after the other, and nothing of it changes. The corners that a vertex v >= base_vertices moves (those in its subtree
 * of the parent forest) are corners[moved_first[v - base] ...], moved_count of them. */
typedef struct strl__mesh {
    uint32_t vertex_count, base_vertices, triangle_count, step_count;
    uint32_t state; /* of the indices; 0 where shared */
    /* the finest state whose triangles and splats are here: step_count but of bricks that show few (brick.c) */
    uint32_t held;
    uint64_t spare_bytes; /* of strl__node_bytes, that a brick does without */
    bool shared;
    uint32_t index_total;  /* in indices, of all states; shared */
    strl_vertex *vertices; /* owned, with all that follows; NULL = not resident */
    uint32_t *corners;
    uint32_t *moved_first, *moved_count; /* [vertex_count - base_vertices] */
    uint32_t *triangle_end;              /* [step_count + 1] */
    uint32_t *index_first;               /* [step_count + 1] where the corners of a state begin; NULL: all at 0 */
    float *errors;                       /* [step_count + 1], lattice units, the larger of both kinds */
    uint16_t *vertex_end;                /* [step_count + 1] */
    uint16_t *parents;                   /* [vertex_count - base_vertices] */
    uint16_t *indices;                   /* [3 * triangle_count] */
    uint16_t (*finest)[3];               /* [triangle_count], corners of the finest state; leaves may have none */
    strl_vertex_label *labels;           /* [vertex_count]; NULL where the walk keeps none */
    strl_splat *splats;                  /* of bricks: by state, those of state s before splat_end[s] */
    uint16_t *splat_end;                 /* [step_count]; NULL where it is no brick */
} strl__mesh;

typedef struct strl__node {
    const strl_node *record;
    struct strl__treelet *treelet;
    struct strl__node *older, *newer; /* residency list; resident nodes only */
    struct strl__request *request;    /* while pending, or resident and on its way with more states */
    struct strl__node *next_asked;    /* while the request is not answered */
    struct strl__node *decoded_by;    /* while pending: the node whose mesh the payload is told by, or NULL */
    uint32_t decoding;                /* pending nodes that are decoded by this one: it is not evicted */
    strl__mesh mesh;                  /* resident nodes only */
    uint64_t load;                    /* serial number of the mesh's load */
    /* of a brick: cells no larger than this need not be opened, lattice units; 0 = all must */
    float closed_size;
    strl__residency residency;
    strl__retry retry;
    uint64_t counted_pass;  /* last traversal that counted its bytes */
    uint64_t wanted_frame;  /* last frame whose wanted cut has it at or above itself */
    uint64_t touched_frame; /* the same or prefetched */
    uint64_t front_frame;   /* last frame in whose front it was */
    uint64_t drawn_frame;   /* the same and visible */
    uint64_t split_frame;   /* last frame in which it was split */
    uint32_t dirty_first, dirty_end;
} strl__node;

/* A page of records and what the walk knows of each node. */
typedef struct strl__treelet {
    uint32_t tree, index;
    strl__residency residency;
    strl__retry retry;
    uint32_t pins;  /* nodes resident or pending */
    uint64_t bytes; /* counted in resident_bytes */
    uint64_t touched_frame;
    strl_treelet_ref ref;
    strl_treelet data;
    strl__node nodes[STRL_TREELET_NODES];
} strl__treelet;

/* Open-addressed map of (tree, index) to treelet. */
typedef struct strl__treelets {
    strl__treelet **slots; /* owned with what they point at */
    size_t capacity;       /* a power of two, or 0 */
    size_t count;
} strl__treelets;

typedef struct strl__placement {
    uint32_t tree, own_part;
    double transform[12];
    double length_scale; /* world units per lattice unit, at most */
} strl__placement;

#define STRL__FAN 16u /* placements, runs or boxes under one box */
#define STRL__RUN_BOXES (STRL_RUN_PLACEMENTS / STRL__FAN)

/* The placements of a run, and what each STRL__FAN of them look like from outside. */
typedef struct strl__run_page {
    strl_box boxes[STRL__RUN_BOXES];
    strl_far fars[STRL__RUN_BOXES];
    uint32_t count;
    strl__placement items[]; /* [count] */
} strl__run_page;

typedef struct strl__run {
    strl_run facts;
    strl__run_page *page;            /* owned; resident ones only */
    struct strl__run *older, *newer; /* residency list; resident ones that may go */
    struct strl__request *request;   /* while pending */
    strl__residency residency;
    strl__retry retry;
    uint64_t wanted_frame;  /* last frame whose front may point into the page */
    uint64_t touched_frame; /* the same or looked at */
} strl__run;

/* Boxes over STRL__FAN runs each, or over the boxes of the level below (placements.c). */
typedef struct strl__bound_level {
    strl_box *boxes; /* [count], owned */
    strl_far *fars;  /* [count], owned */
    uint32_t count;
} strl__bound_level;

#define STRL__BOUND_LEVELS 4u /* for 2^24 placements */

/* Of splats: shares of the allowed size, a cell being as a rule half as large as the one above; then those that close
 * holes, STRL__MOST_POINT_PX and halves of it, two for each. */
#define STRL__POINT_SHARES 4u
#define STRL__MISSING_SIZES 8u
#define STRL__POINT_SIZES (STRL__POINT_SHARES + STRL__MISSING_SIZES)

/* Splats of a brick. */
typedef struct strl__splat_run {
    const strl_node *record;
    const strl_splat *splats;
    uint32_t count;
} strl__splat_run;

/* Of a tree: the finest splats of its root's brick. */
typedef struct strl__preview {
    strl__splat_run run;
    unsigned least_side; /* of a cell, as in strl_splat; UINT8_MAX where there is none */
} strl__preview;

/* Points of a placement that has items of its own. */
typedef struct strl__placed_points {
    size_t active; /* the first of the front's items that are of it */
    uint32_t count[STRL__POINT_SIZES];
} strl__placed_points;

typedef struct strl__walk_tree {
    const strl_tree *tree; /* borrowed from the container */
    strl__node *root;      /* NULL where no placement uses the tree */
    bool used, shared;     /* by a placement; by several. Where there are many placements both are taken to be so. */
    strl_far far;
    strl__preview preview; /* of the root, which stays */
} strl__walk_tree;

/* Points of one size, for what is not drawn itself. */
typedef struct strl__far_points {
    strl_vertex *items;
    strl_vertex_label *labels; /* [count], of the placements' own parts; NULL where the walk keeps none */
    size_t count, capacity, label_capacity;
    double px; /* the largest box that one of them stands for, in pixels */
} strl__far_points;

#define STRL__FILL_WORK 32768u /* of a frame */
#define STRL__FAR_SIZES 7u     /* 0: the size of the allowed error; k: 2^k pixels, for runs that are not there yet */

/* A page's bytes, shared by the decode jobs of its nodes. They have the checksum that `ref` tells. */
typedef struct strl__page {
    atomic_uint references;
    strl_page_ref ref;
    uint8_t *data; /* owned; ref.bytes of them */
} strl__page;

#define STRL__KEPT_PAGES 64u

enum { STRL__JOB_QUEUED, STRL__JOB_RUNNING, STRL__JOB_DONE, STRL__JOB_ABANDONED };

/* Decodes one node. Whole in itself: an abandoned job that runs after the walk is closed releases
 * itself. */
typedef struct strl__job {
    atomic_int phase;
    strl__page *page;
    strl_node record;
    bool labels;                      /* wanted */
    bool shared;                      /* as strl__mesh */
    float closed_size;                /* as strl__node */
    strl__node *node;                 /* the walk's thread only */
    bool is_waiting;                  /* for the node by which it is decoded; the walk's thread only */
    strl_payload_reference reference; /* that node's mesh, which stays as long as the job may run */
    strl__mesh mesh;                  /* result; its block is owned */
    strl_status status;
    strl_error error;
} strl__job;

typedef struct strl__request {
    bool used, answered, cancelled;
    uint64_t token;
    uint64_t touched_frame;               /* last frame that wanted something of it */
    uint64_t offset;                      /* of the page */
    strl__treelet *treelet;               /* records asked for, or */
    strl__run *run;                       /* placements; both NULL = a page for nodes */
    uint32_t node_count;                  /* asked for; after the answer: not decoded yet */
    strl__node *first_asked, *last_asked; /* until the answer */
} strl__request;

/* Something to read: a node's mesh, the treelet with the children of a node, or the page of a run. */
typedef struct strl__candidate {
    float urgency;
    uint32_t treelet; /* index within the tree where it is records; STRL_NONE = the node's mesh */
    strl__node *node; /* the node, or the one whose treelet names the wanted treelet; NULL = a run's page */
    strl__run *run;
} strl__candidate;

typedef struct strl__candidates {
    strl__candidate *items;
    size_t count, capacity;
} strl__candidates;

typedef struct strl__nodes {
    strl__node **items;
    size_t count, capacity;
} strl__nodes;

/* Of the front: the items of one placement. */
typedef struct strl__placed_range {
    size_t first, end;
    double distance; /* along the view direction */
} strl__placed_range;

typedef struct strl__placed_ranges {
    strl__placed_range *items;
    size_t count, capacity;
} strl__placed_ranges;

typedef struct strl__runs {
    strl__run **items;
    size_t count, capacity;
} strl__runs;

typedef struct strl__split {
    strl__node *node;
    bool by_group; /* only another member of its group asked for it */
} strl__split;

typedef struct strl__splits {
    strl__split *items;
    size_t count, capacity;
} strl__splits;

/* A node at the level in work. */
typedef struct strl__visit {
    strl__node *node;
    uint32_t next;  /* next member of its group, STRL_NONE at the end */
    uint32_t above; /* demand of its parent's group, STRL_NONE for a root; while demands are looked for */
    bool active;    /* false: wanted, but its parents could not split yet */
} strl__visit;

typedef struct strl__visits {
    strl__visit *items;
    size_t count, capacity;
} strl__visits;

typedef struct strl__group {
    uint32_t id, first, last, members;
} strl__group;

typedef struct strl__groups {
    strl__group *items;
    size_t count, capacity;
    uint32_t *table; /* index of a group + 1, by hash of its id */
    size_t table_capacity;
} strl__groups;

typedef struct strl__demand {
    uint32_t group;
    bool asked; /* to split */
} strl__demand;

/* `below` can split only where `above` does; indices of demands, above < below. */
typedef struct strl__need {
    uint32_t above, below;
} strl__need;

/* Groups of one placement that a frame may have to split. */
typedef struct strl__demands {
    strl__demand *items;
    uint32_t count;
    size_t capacity;
    strl__need *needs;
    size_t need_count, need_capacity;
    uint32_t *table; /* index of a demand + 1, by hash of its group */
    size_t table_mask, table_capacity;
} strl__demands;

typedef struct strl__active {
    strl__node *node;
    uint32_t placement;            /* its number */
    const strl__placement *placed; /* the placement; its page stays for the frame */
    bool open;                     /* of a sample tree: drawn with what is below it */
    uint32_t state;                /* to be drawn in */
    strl_box box;                  /* world */
    strl_sight sight;              /* of the box */
} strl__active;

typedef struct strl__front {
    strl__active *items;
    size_t count, capacity;
} strl__front;

typedef enum strl__cut_kind {
    STRL__CUT_FRONT,   /* finds the front, collects what it misses */
    STRL__CUT_PROBE,   /* only counts bytes; asks for records */
    STRL__CUT_PREFETCH /* touches what it finds, collects the rest as prefetch */
} strl__cut_kind;

/* One traversal from the roots. */
typedef struct strl__cut {
    strl__cut_kind kind;
    const strl_view *view;
    double allowed_px;
    uint64_t capacity_bytes;
    bool stop_at_capacity; /* groups stay coarse where the next split would not fit; otherwise
                              overflow is set */
    uint64_t bytes;        /* result: of all nodes of the cut and their ancestors */
    uint64_t slack_bytes;  /* of the capacity, that stays free so that any of the nodes can be decoded */
    bool overflow;         /* result: more than capacity; the rest is undefined */
    bool records_missing;  /* result: the cut ends early for want of records that are on their way */
    bool waits;            /* result: something is missing that has not been given up */
    uint32_t backfacing;   /* result: nodes left out with all below them, see facing.c */
    uint32_t missing;      /* result: nodes of the wanted front that are not in the front, or groups'
                             members cut short */
} strl__cut;

struct strl_walk {
    strl_container *container; /* owned */
    strl_source *source;       /* the container's */
    strl_executor executor;    /* submit NULL: inline */
    uint64_t memory_bytes;
    double error_px;
    double splat_ratio; /* pixels of a splat for each of the allowed error */
    bool labels;        /* kept for each vertex */
    strl_cull cull;
    double bounds[6];
    strl__walk_tree *trees;
    uint32_t tree_count;
    uint32_t placement_count, run_count;
    strl__run *runs; /* [run_count]; of one alone the page is always there */
    strl__run *oldest_run, *newest_run;
    strl__bound_level bound_levels[STRL__BOUND_LEVELS];
    uint32_t bound_level_count;
    uint64_t root_bytes; /* meshes of the roots */

    uint64_t frame, pass, loads, tokens;
    uint32_t coarsening; /* allowed error = error_px * 2^(coarsening / 4) */
    bool settled;
    /* Of bricks that may be opened partly, those of late, by how often their coarsest cells are halved: what is then
     * held, of how much (strl__node_bytes). */
    double opened_bytes[STRL__HALVINGS], brick_bytes[STRL__HALVINGS];
    double share_guard; /* what has not come is taken for so many times what that tells */
    uint32_t renewals;  /* resident nodes of which another mesh is on its way */
    bool stands;        /* the camera is that of the frame before */
    bool went_finer;    /* since it stands, into more memory than is proved to do */
    bool lacked_room;   /* once, for more states of a brick */
    bool is_tight;      /* memory is: the cut looks at what more is to come of bricks that are here */

    strl__treelets treelets;
    uint64_t treelet_bytes;   /* part of resident_bytes */
    uint64_t placement_bytes; /* the same: what stays of placements; 0 where there are few */
    uint64_t kept_bytes;      /* the same: pages that came a moment ago */
    uint64_t resident_bytes;
    strl__node *oldest, *newest;
    void **retired; /* [retired_count], owned with what they point at */
    size_t retired_count, retired_capacity;
    strl__page *kept[STRL__KEPT_PAGES]; /* the oldest first */
    size_t kept_count;

    strl__request requests[STRL__MAX_REQUESTS];
    uint32_t requests_in_flight, requests_pending;
    /* the source's last answer was a failure; in this frame one thing that waits may be asked for */
    bool is_away, is_looking;
    uint64_t away_ns, look_ns; /* since when; when to look next */
    uint64_t returns;          /* how often it came back, */
    uint64_t lasting_return;   /* the last of these that ended a lasting outage; 0 = none did */
    uint64_t room;             /* bytes that the source still has room for in this frame */
    strl__job **jobs;          /* owned, in order of submission */
    size_t job_count, job_capacity;

    strl__visits level, below; /* scratch of a traversal */
    strl__groups groups;
    strl__demands demands;
    strl__nodes children; /* of the group in work */
    strl__nodes wanted;   /* the wanted cut and all above it */
    /* how many of them, from the first on, were looked at for what they can give back in this frame */
    size_t looked_at;
    strl__nodes ahead;                /* resident, likely to be wanted soon */
    strl__runs wanted_runs;           /* of which the front has placements, or may have */
    strl__splits split, split_before; /* of this frame and the last */
    strl__candidates missing, prefetch;
    float prefetch_floor; /* what is less urgent is not looked for: there is more than enough of what is (requests.c) */
    strl__candidates along; /* left out of the cut: they come where their page is read for others */
    strl__front front;
    strl_draw_item *items;
    size_t item_capacity;
    strl_vertex *points; /* splats of the frame */
    size_t point_count, point_capacity;
    uint64_t hole_work;                 /* of the frame: left, see points.h */
    strl__placed_ranges ranges;         /* of the frame */
    strl__placed_points *placed_points; /* of the frame */
    size_t placed_count, placed_capacity;
    float scattered[256]; /* of a splat's coverage: 0 = the faces are a wall, 1 = there is nearly none */
    strl__far_points far[STRL__FAR_SIZES];      /* of the frame */
    strl__far_points merged[STRL__POINT_SIZES]; /* splats of placements that show few, of the frame */
    uint32_t fill_work;                         /* of the frame: boxes of missing runs that may still be halved */
    double far_near, far_far;                   /* depths of their boxes; far_far 0: there is none */
    uint16_t *numbers;                          /* 0, 1, 2, ...; NULL where there was no splat yet */
    strl_camera camera;                         /* of the last frame */
    strl_walk_stats stats;
};

/* mesh.c: thread-safe. */
/* What a decoded node takes at most, known before anything is fetched. */
uint64_t strl__node_bytes(const strl_node *record, bool labels);
/* closed_size: as of strl__node; 0 where the mesh must have all of its states. */
strl_status strl__mesh_create(const strl_node *record, const void *page, size_t size,
                              const strl_payload_reference *reference, bool labels, bool shared, float closed_size,
                              strl__mesh *mesh, strl_error *err);
/* The finest state of a node's mesh, for the payload of another node. */
strl_payload_reference strl__mesh_reference(const strl__node *from, const strl_node *record);
void strl__mesh_deinit(strl__mesh *mesh);
/* Moves to another state in time proportional to the corners that change; widens [*first, *end) to
 * hold them. */
void strl__mesh_set_state(strl__mesh *mesh, uint32_t state, uint32_t *first, uint32_t *end);

/* placements.c */
/* The runs, or all placements where they are one run; tells which trees are used. */
strl_status strl__placements_load(strl_walk *walk, strl_error *err);
/* Whether all placements are looked at, wherever the camera is: they need neither boxes nor summaries. */
bool strl__placements_are_few(const strl_walk *walk);
/* Boxes over them, and the walk's bounds. Roots must be there. */
strl_status strl__placements_bound(strl_walk *walk, strl_error *err);
void strl__placements_deinit(strl_walk *walk);
/* *next: the first placement from `from` on that the camera may see, *placed; placement_count where there is none.
 * Those before it that are too far away to be told apart, or not there yet, are drawn as points by a cut that finds the
 * front. */
strl_status strl__placements_next(strl_walk *walk, strl__cut *cut, uint32_t from, uint32_t *next,
                                  const strl__placement **placed, strl_error *err);

void strl__box_include(strl_box *box, const strl_box *other);

/* runs.c */
uint32_t strl__run_placements(const strl_walk *walk, const strl__run *run);
uint64_t strl__run_bytes(uint32_t placements);              /* of a page in memory */
strl__run_page *strl__run_page_create(uint32_t placements); /* NULL without memory */
strl_status strl__run_page_place(const strl_walk *walk, strl__run_page *page, uint32_t within, uint64_t index,
                                 const strl_placement *stored, strl_error *err);
/* Boxes and summaries. Roots must be there. */
void strl__run_page_bound(const strl_walk *walk, strl__run_page *page);
strl_box strl__placement_box(const strl_walk *walk, const strl__placement *placement);
strl_far strl__placement_far(const strl_walk *walk, const strl__placement *placement);
/* Pixels that the tree is allowed for each of the allowed error. */
double strl__splat_ratio(const strl_walk *walk, const strl_tree *tree);
/* absent -> pending; room must be there */
void strl__run_reserve(strl_walk *walk, strl__run *run, strl__request *request);
void strl__run_release(strl_walk *walk, strl__run *run); /* pending -> absent */
/* Pending -> resident; a failure leaves it pending. */
strl_status strl__run_load(strl_walk *walk, strl__run *run, const void *data, size_t size, strl_error *err);
void strl__run_touch(strl_walk *walk, strl__run *run); /* now the youngest */
void strl__run_evict(strl_walk *walk, strl__run *run);

/* far.c */
/* Whether the box projects to at most the allowed error. *px: to how much. */
bool strl__is_far(const strl__cut *cut, const strl_box *box, double *px);
/* A point for what the box holds, which projects to px. own_part: of the placement that it is, as of strl_draw_item; 0
 * = none or several. */
strl_status strl__far_draw(strl_walk *walk, const strl__cut *cut, const strl_box *box, const strl_far *far, double px,
                           uint32_t own_part, strl_error *err);
/* Points that cover what the camera sees of the box, for what it holds is not there yet. */
strl_status strl__far_fill(strl_walk *walk, const strl__cut *cut, const strl_box *box, const strl_far *far,
                           strl_error *err);
/* Room for one more, its label set; NULL: no memory. */
strl_vertex *strl__far_points_add(strl__far_points *points, bool labels, uint32_t own_part);
void strl__far_points_deinit(strl__far_points *points);
/* These points lie on a lattice of cells of this size, counted from the least corner of the model's box; far_cell: the
 * nearest one. */
double strl__far_step(const strl_walk *walk);
int32_t strl__far_cell(double at);
double strl__far_px(double allowed_px, unsigned size);
/* All of an item of such points but themselves; what they stand for is at most box_px large. */
strl_draw_item strl__far_item(const strl_walk *walk, double point_px, double box_px);

/* treelets.c */
strl__treelet *strl__treelets_find(const strl__treelets *treelets, uint32_t tree, uint32_t index);
/* owned from then on; false: no memory */
bool strl__treelets_insert(strl__treelets *treelets, strl__treelet *treelet);
void strl__treelets_remove(strl__treelets *treelets, strl__treelet *treelet); /* and releases it */
void strl__treelets_deinit(strl__treelets *treelets);

/* pages.c */
/* Of bytes that have been checked, which it owns from then on; its one reference is the caller's. NULL without memory:
 * then data still is. */
strl__page *strl__page_create(const strl_page_ref *ref, uint8_t *data);
strl__page *strl__page_share(strl__page *page);          /* a further reference; NULL is legal */
void strl__page_release(strl__page *page);               /* thread-safe; NULL is legal */
void strl__page_keep(strl_walk *walk, strl__page *page); /* for a while, where there is room for it */
/* a kept one; borrowed; NULL = there is none */
strl__page *strl__page_find(strl_walk *walk, const strl_page_ref *ref);
bool strl__page_drop_oldest(strl_walk *walk); /* false: none is kept */

/* residency.c */
/* Evicts what has waited longest and that this frame does not need until `bytes` fit; evict_before:
 * only what was touched before that frame; where that is this one too and memory is tight, what bricks hold beyond
 * their need goes as well, by a shorter copy that is made first. False where it does not fit. */
bool strl__make_room(strl_walk *walk, uint64_t bytes, uint64_t evict_before);
uint64_t strl__idle_since(const strl_walk *walk); /* what was touched before this frame is needed for nothing soon */
/* A treelet without content yet, its bytes reserved; NULL where there is no room or no memory. */
strl__treelet *strl__treelet_reserve(strl_walk *walk, uint32_t tree, uint32_t index, const strl_treelet_ref *ref);
strl_status strl__treelet_load(strl_walk *walk, strl__treelet *treelet, const void *data, size_t size, strl_error *err);
void strl__treelet_evict_cold(strl_walk *walk, uint64_t before_frame);
/* The node with this id; NULL where its records are not there. */
strl__node *strl__node_find(strl_walk *walk, uint32_t tree, uint32_t id);
/* The node by which the node is decoded may not go until it is let go. False where it is
 * neither there nor on its way. */
bool strl__node_hold(strl_walk *walk, strl__node *node);
void strl__node_let_go(strl__node *node);
/* absent -> pending, or resident and more to come; room must be there */
void strl__node_reserve(strl_walk *walk, strl__node *node);
void strl__node_release(strl_walk *walk, strl__node *node); /* pending -> absent, or nothing more to come */
/* pending or resident -> resident */
void strl__node_install(strl_walk *walk, strl__node *node, const strl__mesh *mesh);
/* Of a resident one: what is held beyond what cells of that size need, and may be dropped. */
uint64_t strl__node_excess(const strl_walk *walk, const strl__node *node, float closed_size);
/* What will be held of a brick that has not come, as far as one knows. */
uint64_t strl__expected_bytes(const strl_walk *walk, const strl__node *node, float closed_size);
/* Before any has come. */
void strl__expect_nothing(strl_walk *walk);
/* Whether of the node no more may be held than it shows. */
bool strl__opens_partly(const strl_walk *walk, const strl__node *node);
/* What it takes, or will at most. */
uint64_t strl__node_held_bytes(const strl_walk *walk, const strl__node *node);
/* Meshes that others replaced since the last frame: its list has borrowed them. */
void strl__retired_free(strl_walk *walk);
void strl__node_touch(strl_walk *walk, strl__node *node); /* now the youngest */

/* faults.c */
void strl__note_fault(strl_walk *walk, const strl_error *error);
void strl__back_off(const strl_walk *walk, strl__retry *retry, bool is_unread);
/* it has failed and is not to be asked for yet */
bool strl__is_waiting(const strl_walk *walk, const strl__retry *retry);
bool strl__is_given_up(const strl_walk *walk, const strl__retry *retry); /* nobody waits for it any more */
void strl__retry_asked(const strl_walk *walk, strl__retry *retry);
void strl__source_answers(strl_walk *walk);
void strl__source_fails(strl_walk *walk);
void strl__begin_look(strl_walk *walk); /* once a frame, after the answers */

/* requests.c */
void strl__requests_receive(strl_walk *walk);
void strl__requests_submit(strl_walk *walk);
/* Puts them partly in order: none before items[at] is less urgent than that one, and none behind it more. Hoare's
 * selection, in a time that grows as their count. at < count. */
void strl__candidates_select(strl__candidates *candidates, size_t at);
uint64_t strl__jobs_pump(strl_walk *walk, uint64_t budget_ns);
void strl__jobs_abandon(strl_walk *walk);

/* front.c */
strl_status strl__cut_run(strl_walk *walk, strl__cut *cut, strl_error *err);
/* Makes the last front cut the frame's: what it wants is kept, splits and collapses are counted. */
void strl__cut_commit(strl_walk *walk);
strl_box strl__world_box(const strl_tree *tree, const strl__placement *placement, const int64_t min[3],
                         const int64_t max[3]);

/* budget.c: runs the front cut with the least error that fits. */
strl_status strl__budget_cut(strl_walk *walk, const strl_view *view, strl__cut *cut, strl_error *err);

/* refine.c */
void strl__refine_front(strl_walk *walk);

/* brick.c: thread-safe. Vertices and labels are the caller's to fill in: those of pm whose numbers are in *from (of
 * arena), [mesh->vertex_count]; NULL = all in their order. */
strl_status strl__brick_create(const strl_node *record, const strl_pm *pm, const strl_brick_head *head, bool labels,
                               float closed_size, strl_arena *arena, strl__mesh *mesh, const uint16_t **from,
                               strl_error *err);
/* Bytes of the mesh that go by trimming it to what strl__brick_create would have kept; 0 where it is no brick. */
uint64_t strl__brick_excess(const strl__mesh *mesh, float closed_size);
/* False without memory, or where it is in a finer state: then nothing changes. */
bool strl__brick_trim(strl__mesh *mesh, float closed_size);

/* splats.c */
strl__preview strl__preview_of(const strl__node *node);
void strl__points_prepare(strl_walk *walk);

/* points.c: behind the other items of the list. */
strl_status strl__draw_splats(strl_walk *walk, const strl_view *view, strl_draw_list *list, strl_error *err);

/* draw.c: `record`: NULL = of the whole tree. */
void strl__item_place(strl_draw_item *item, const strl_tree *tree, const strl_node *record,
                      const strl__placement *placement);
strl_status strl__draw_list(strl_walk *walk, const strl_view *view, strl_draw_list *list, strl_error *err);

#endif
