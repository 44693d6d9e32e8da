/* What the C++ files of the panels share. */
#ifndef STRL_VIEWER_GUI_PANELS_HPP
#define STRL_VIEWER_GUI_PANELS_HPP

#include <imgui.h>

#include "viewer/gui.h"

namespace strl_panels
{

const ImVec4 faint = ImVec4(0.62f, 0.66f, 0.70f, 1), warning = ImVec4(1.0f, 0.68f, 0.25f, 1);
const float panel_width = 290, margin = 12;

/* A panel in its column; the window may be too small for it. */
struct place {
    float scale;
    float width, height; /* of the window, screen units */
    bool anew;           /* panels go back to their places: the window's or the text's size is another */
};

ImGuiCond when_of(const place &at);
void heading(const char *text);
bool begin_table(const char *name);
void row(const char *name, const char *value);
void real_row(const char *name, const char *format, double value);

/* gui_review.cpp */
void show_parts(const place &at, const strl_gui_facts *facts, strl_gui_controls *controls);
void show_picks(const place &at, const strl_gui_facts *facts, strl_gui_controls *controls);
void show_section(const place &at, const strl_gui_facts *facts, strl_gui_controls *controls);
void show_bookmarks(const strl_gui_facts *facts, strl_gui_controls *controls);
void show_path(const strl_gui_facts *facts, strl_gui_controls *controls);
void show_build(const place &at, const strl_gui_facts *facts, strl_gui_controls *controls);
void show_marks(const strl_gui_facts *facts);

} // namespace strl_panels

#endif
