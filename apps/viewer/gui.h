/* The panel, the help and the lines drawn over the picture: everything that Dear ImGui does, behind a C face. */
#ifndef STRL_VIEWER_GUI_H
#define STRL_VIEWER_GUI_H

#include <stdbool.h>
#include <stdint.h>

#include "stroll/error.h"
#include "stroll/render.h"

#ifdef __cplusplus
extern "C" {
#endif

struct GLFWwindow;
typedef struct strl_gui strl_gui;

/* What the visitor can set, by panel or key. */
typedef struct strl_gui_controls {
    float error_px;
    strl_debug_colour debug;
    bool wireframe, flat, frozen, fly, help;
    bool home, reset, screenshot; /* buttons; set by strl_gui_show, cleared by whoever obeys */
} strl_gui_controls;

#define STRL_GUI_LEAST_ERROR_PX 0.1f
#define STRL_GUI_MOST_ERROR_PX 100.0f

/* What the panel shows. Strings are borrowed for the call. */
typedef struct strl_gui_facts {
    const char *model, *device;
    uint64_t model_triangles;
    double fps, frame_ms, select_ms;
    bool idle; /* nothing moves: no frame is drawn until something does */
    uint64_t triangles, resident_bytes, memory_bytes, gpu_bytes, gpu_memory_bytes, faults;
    uint32_t nodes, nodes_culled, draws, requests, missing_nodes;
    double allowed_error_px, max_error_px;
    double speed;            /* of flying, world units a second */
    const char *last_fault;  /* empty = none */
    const char *message;     /* empty = none */
    const char *keys;        /* the help's lines */
    const float (*lines)[4]; /* x y x y in framebuffer pixels, of a frozen camera's view */
    uint32_t line_count;
} strl_gui_facts;

/* The window's context is current and its callbacks are installed: the panel listens in front of them.
 * scale: of text and widgets, 1 = 13 screen units high. */
strl_status strl_gui_create(struct GLFWwindow *window, double scale, strl_gui **gui, strl_error *err);
void strl_gui_destroy(strl_gui *gui); /* NULL is legal; before the window */

/* One frame: lays the panel out, changes controls, draws to the window's framebuffer. */
void strl_gui_show(strl_gui *gui, const strl_gui_facts *facts, strl_gui_controls *controls);
/* What happens next belongs to the panel, as far as the last frame knew. */
bool strl_gui_takes_mouse(const strl_gui *gui);
bool strl_gui_takes_keyboard(const strl_gui *gui);

#ifdef __cplusplus
}
#endif
#endif
