/* What the walk's tests share: a source that notices waits, cameras, settling, and the checks of a
 * draw list. */
#ifndef WALK_CHECKS_H
#define WALK_CHECKS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "source/source.h"
#include "stroll/walk.h"

/* Wraps another source (owned). Fails the test on a blocking read once `walking` is set; holds back
 * a share of the answers. */
typedef struct watched_source {
    strl_source base;
    strl_source *inner;
    bool walking;
    unsigned hold_percent; /* of polls that find nothing, whatever has arrived */
    uint64_t random;
    uint64_t room_bytes;                      /* as a slow link says; 0 = there is nothing to wait for */
    uint64_t link_bytes;                      /* that still come before the test sets it anew; of a slow link alone */
    uint64_t wanted_bytes, most_wanted_bytes; /* asked for and not answered: now, and at most */
    uint32_t asked[256];                      /* bytes, by the token's last byte, which is the walk's slot */
    uint64_t came_bytes;
    uint64_t read_bytes;            /* while somebody waited */
    uint64_t offsets[512];          /* that were read, those waited for included */
    unsigned offset_count, repeats; /* of them; reads of one of them */
    strl_source_result held;        /* waits for the link */
    bool holds;
} watched_source;

watched_source *watched_source_open(strl_source *inner);
strl_source *memory_source(const uint8_t *data, size_t size);

/* A deterministic number in [0, 1); the state is advanced. */
double next_random(uint64_t *state);
/* Anywhere over or beside the model, looking at some point of it. */
strl_camera random_camera(uint64_t *state);
/* Frame `at` of a smooth flight low over the model; two frames are a fraction of a quad apart. */
strl_camera flight_camera(unsigned at);

/* Opens a walk, or fails the test. */
strl_walk *open_walk(strl_source *source, const strl_walk_desc *desc);
/* Frames and pumps until the walk has settled; fails the test where it does not in max_frames. */
strl_draw_list settle(strl_walk *walk, const strl_camera *camera, unsigned max_frames);
strl_draw_list walk_frame(strl_walk *walk, const strl_camera *camera);
/* A frame and what is decoded after it, of which the n-th allocation fails: it gets through, or says that there is no
 * memory. */
strl_status walk_frame_without_memory(strl_walk *walk, const strl_camera *camera, uint64_t n, strl_draw_list *list);

/* By code of the tests' own: in pixels from the image's upper left corner, and the depth along the line of sight in the
 * model's unit; false behind the eye. */
bool project_vertex(const strl_camera *camera, const strl_draw_item *item, const strl_vertex *vertex, double pixel[2],
                    double *depth);
/* The items of a placement cover the height field without a crack: every edge inside is run as
 * often in one direction as in the other (nodes may meet in an edge of four triangles), each open
 * one lies on the rim, and the areas add up exactly. */
void check_cut_is_closed(const strl_draw_list *list, uint32_t placement);
/* The same nodes in the same states with the same indices. */
void check_same_lists(const strl_draw_list *a, const strl_draw_list *b);
/* A copy that outlives the next frame; release with free_list. Vertices are not copied. */
strl_draw_list copy_list(const strl_draw_list *list);
void free_list(strl_draw_list *list);

#endif
