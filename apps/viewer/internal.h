/* What the files of the viewer's window share.
 *
 * A frame runs: input (window.c) -> what keys and panels ask for (obey.c), what was clicked (click.c), what was
 * dropped (files.c) -> where the camera is (move.c) -> front, picture, panels (frame.c). viewer.c has the loop. All on
 * one thread; builds (opener.c) and the index of parts (part_index.c) have one of their own. */
#ifndef STRL_VIEWER_INTERNAL_H
#define STRL_VIEWER_INTERNAL_H

#include "viewer/gui.h"
#include "viewer/journal.h"
#include "viewer/model.h"
#include "viewer/opener.h"
#include "viewer/part_index.h"
#include "viewer/settings.h"
#include "viewer/viewer.h"
#include "viewer/window.h"

/* Frames drawn after the last thing that happened: the panels need a few to settle. */
#define STRL__FRAMES_AFTER_INPUT 4u
#define STRL__GO_SECONDS 0.5

/* Means over the last stretch of frames, for people to read. */
typedef struct strl__frame_clock {
    uint64_t last_ns, stretch_ns, select_ns; /* last_ns 0: the next frame follows a rest */
    uint32_t frames;
    double fps, frame_ms, select_mean_ms;
} strl__frame_clock;

typedef struct strl__viewer {
    strl_viewer_desc desc;            /* completed: no defaults left */
    char path[4096];                  /* of the model that is open, or its address */
    char shown[4096];                 /* the same, as anybody may see it */
    char mesh[4096];                  /* that was dropped and of which it was built; "" = none */
    strl_viewer_desc begun;           /* as completed at the start: what has changed since then is remembered */
    strl_gui_controls begun_controls; /* the same */
    strl_viewer_model *model;         /* owned; never NULL while the window is open */
    strl_window *window;
    strl_gui *gui;
    double text_scale; /* that the panels have */
    strl_renderer *renderer;
    strl_navigator navigator;
    strl_gui_controls controls;
    strl_draw_list list;        /* of the last frame; borrowed from the walk until its next */
    strl_camera camera, frozen; /* camera: of the last frame; frozen: the walk's, where controls.frozen */
    double frozen_far;
    uint32_t size[2];
    strl__frame_clock clock;
    uint32_t frames_left; /* to draw before resting */
    uint64_t frames_shown;
    bool resting, stirred; /* stirred: something has moved since the last rest was told */
    bool shows_rest;       /* the panels say that nothing moves, and no message that will have to go */
    bool screenshot;       /* of the next frame; a flag, so that a reset in the same frame does not lose it */
    bool falls;            /* the walker is not at rest above the ground */
    strl_parts parts;
    strl_part_index *index; /* NULL until somebody looks at a part that is not drawn */
    bool look_waits;        /* for the index */
    uint32_t reveal;        /* a row to scroll to in the next frame */
    strl_picks picks;
    strl_section section;
    strl_bookmarks bookmarks;
    strl_recorder recorder;
    bool path_ends; /* with the camera of this frame: what the hand did before the key belongs to the path */
    strl_settings settings;
    strl_opener *opener;
    strl_opener_news news;
    bool cancels; /* the build at work has been told to end */
    FILE *journal;
    char message[512];
    uint64_t message_end_ns;
    char device[160];
} strl__viewer;

/* For a few seconds over the picture. */
void strl__viewer_say(strl__viewer *v, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* obey.c. True: quit. */
bool strl__viewer_obey(strl__viewer *v, strl_request request);
void strl__viewer_reset(strl__viewer *v);
void strl__viewer_journal_section(strl__viewer *v);

/* click.c */
void strl__viewer_click(strl__viewer *v, const strl_click *click);
strl_pick_filter strl__viewer_filter(const strl__viewer *v);
void strl__viewer_look(strl__viewer *v); /* at the selection; now, or once it is known where that is */
void strl__viewer_poll_index(strl__viewer *v);
/* With what waits for it. */
void strl__viewer_drop_index(strl__viewer *v);

/* move.c. Brings the camera up to date. True while something moves by itself. */
bool strl__viewer_move(strl__viewer *v, const strl_window_input *input, double seconds);
void strl__viewer_walk(strl__viewer *v); /* puts the visitor's feet on the ground */
void strl__viewer_toggle_record(strl__viewer *v);
void strl__viewer_toggle_replay(strl__viewer *v);
/* Saves what is being recorded, if anything is. */
void strl__viewer_end_recording(strl__viewer *v);
/* Before the camera goes elsewhere; a recording goes with it. */
void strl__viewer_end_replay(strl__viewer *v);

/* files.c */
strl_location strl__viewer_locate(const strl__viewer *v, const char *path); /* borrows path */
/* Instead of the model that is open; that stays on failure. The window and its context are there, or not yet. */
strl_status strl__viewer_open_model(strl__viewer *v, const char *path, strl_error *err);
void strl__viewer_set_title(strl__viewer *v); /* where there is a window */
strl_status strl__viewer_make_renderer(strl__viewer *v, strl_error *err);
strl_status strl__viewer_set_budgets(strl__viewer *v, strl_error *err);
void strl__viewer_poll_opener(strl__viewer *v);
void strl__viewer_build_again(strl__viewer *v); /* of the mesh that was dropped */
/* bookmarks: those of the model as the window has them, just read and changed. A failure is said, not returned: what
 * cannot be remembered stops nobody. */
void strl__viewer_remember(strl__viewer *v, bool bookmarks);

/* frame.c */
strl_status strl__viewer_draw(strl__viewer *v, strl_error *err);

#endif
