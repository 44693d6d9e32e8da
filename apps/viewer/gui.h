/* The panels, the help and what is drawn over the picture: everything that Dear ImGui does, behind a C face. */
#ifndef STRL_VIEWER_GUI_H
#define STRL_VIEWER_GUI_H

#include <stdbool.h>
#include <stdint.h>

#include "stroll/error.h"
#include "stroll/render.h"
#include "viewer/action.h"
#include "viewer/facts.h"

#ifdef __cplusplus
extern "C" {
#endif

struct GLFWwindow;
typedef struct strl_gui strl_gui;

/* What the visitor can set, by panel or key. */
typedef struct strl_gui_controls {
    float error_px;
    strl_debug_colour debug;
    bool wireframe, flat, frozen, help, orthographic, parts;
    strl_navigator_mode mode;
    float memory_mib, gpu_memory_mib; /* in force once STRL_ACTION_BUDGETS is asked for */
    float text_scale;
    double section_offset;
    char search[STRL_PART_TREE_SEARCH], bookmark[STRL_BOOKMARK_NAME]; /* as typed */
    strl_requests requests; /* added by strl_gui_show, taken by whoever obeys */
} strl_gui_controls;

#define STRL_GUI_LEAST_ERROR_PX 0.1f
#define STRL_GUI_MOST_ERROR_PX 100.0f
#define STRL_GUI_LEAST_MIB 16.0f
#define STRL_GUI_MOST_MIB 16384.0f

/* The window's context is current and its callbacks are installed: the panel listens in front of them.
 * scale: of text and widgets, 1 = 13 screen units high. */
strl_status strl_gui_create(struct GLFWwindow *window, double scale, strl_gui **gui, strl_error *err);
void strl_gui_destroy(strl_gui *gui);                 /* NULL is legal; before the window */
void strl_gui_set_scale(strl_gui *gui, double scale); /* between frames */

/* One frame: lays the panels out, changes controls, draws to the window's framebuffer. */
void strl_gui_show(strl_gui *gui, const strl_gui_facts *facts, strl_gui_controls *controls);
/* What happens next belongs to the panels, as far as the last frame knew. */
bool strl_gui_takes_mouse(const strl_gui *gui);
bool strl_gui_takes_keyboard(const strl_gui *gui);

#ifdef __cplusplus
}
#endif
#endif
