/* The window: GLFW, a GL context, and what the visitor did since the last frame. Main thread only. */
#ifndef STRL_VIEWER_WINDOW_H
#define STRL_VIEWER_WINDOW_H

#include <stdbool.h>
#include <stdint.h>

#include "stroll/error.h"
#include "viewer/action.h"

#define STRL_WINDOW_MOST_CLICKS 8u

/* A press of the left button without a drag. */
typedef struct strl_click {
    double at[2]; /* framebuffer pixels, y downward */
    bool twice;   /* the second of two in quick succession */
} strl_click;

/* Since the last frame. Drags, clicks and moves that the panel takes are not in it. */
typedef struct strl_window_input {
    double left[2], right[2]; /* drags in framebuffer pixels, y downward */
    double wheel;             /* ticks; up is positive */
    double way[3];            /* held keys: right, up, forward, each -1 to 1 */
    bool fast;
    strl_requests requests; /* of keys: once when one goes down */
    strl_click clicks[STRL_WINDOW_MOST_CLICKS];
    unsigned click_count;
    unsigned dropped_count; /* files let fall on the window at once */
    char dropped[4096];     /* the first of them; empty where its path is too long */
    bool touched;           /* something happened at all */
} strl_window_input;

typedef struct strl_window strl_window;

typedef struct strl_window_desc {
    const char *title;
    uint32_t size[2]; /* screen units */
    bool gl3;         /* ask for OpenGL 3.3 at once; else 4.5, and 3.3 where that is not there */
} strl_window_desc;

/* The context is current afterwards. STRL_ERR_UNSUPPORTED where there is no display or no context. */
strl_status strl_window_create(const strl_window_desc *desc, strl_window **window, strl_error *err);
void strl_window_destroy(strl_window *window);              /* NULL is legal */
struct GLFWwindow *strl_window_handle(strl_window *window); /* borrowed, for the panel */

/* Pixels to draw; 0x0 while the window is an icon. */
void strl_window_framebuffer_size(const strl_window *window, uint32_t size[2]);
/* Screen units, as strl_window_desc has them. */
void strl_window_size(const strl_window *window, uint32_t size[2]);
void strl_window_set_title(strl_window *window, const char *title);
/* Framebuffer pixels per screen unit. */
double strl_window_pixel_scale(const strl_window *window);
/* How many times larger than usual people here want text, in screen units. */
double strl_window_text_scale(const strl_window *window);
/* Where the mouse was when the last input was taken, screen units. */
void strl_window_cursor(const strl_window *window, double at[2]);
bool strl_window_should_close(const strl_window *window);

/* What the panel keeps for itself from now on: see strl_gui_takes_mouse. */
void strl_window_set_taken(strl_window *window, bool mouse, bool keyboard);
/* Waits up to seconds for something to happen (0: does not wait), then takes it. */
void strl_window_take_input(strl_window *window, double wait_seconds, strl_window_input *input);
void strl_window_swap(strl_window *window); /* with the screen's refresh where it has one */

#endif
