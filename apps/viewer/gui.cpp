/* The panels' life, the main one, and what lies over the picture. */
#include <cfloat>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <new>

#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>

#include "viewer/gui_panels.hpp"

extern "C" {
#include "base/fail.h"
}

struct strl_gui {
    ImGuiContext *context;
    float scale;
    float laid_out[3]; /* width, height and scale for which the panels have their places */
    bool menu_open;
};

namespace strl_panels
{

void row(const char *name, const char *value)
{
    ImGui::TableNextRow();
    ImGui::TableNextColumn();
    ImGui::TextColored(faint, "%s", name);
    ImGui::TableNextColumn();
    ImGui::TextUnformatted(value);
}

void real_row(const char *name, const char *format, double value)
{
    char text[32];
    std::snprintf(text, sizeof text, format, value);
    row(name, text);
}

void heading(const char *text)
{
    ImGui::Spacing();
    ImGui::TextColored(faint, "%s", text);
    ImGui::Separator();
}

ImGuiCond when_of(const place &at)
{
    return at.anew ? ImGuiCond_Always : ImGuiCond_FirstUseEver;
}

bool begin_table(const char *name)
{
    return ImGui::BeginTable(name, 2, ImGuiTableFlags_SizingStretchSame);
}

} // namespace strl_panels

using namespace strl_panels;

namespace
{

const ImU32 line_colour = IM_COL32(255, 200, 60, 220);

/* 1234567 -> "1.23 M"; up to four digits stay as they are. */
void format_count(char *text, size_t size, uint64_t value)
{
    const char *units[] = {"", " K", " M", " G", " T"};
    double scaled = (double)value;
    int unit = 0;
    for (double most = 9999.5; scaled >= most && unit < 4; most = 999.5)
        scaled /= 1000, unit++;
    std::snprintf(text, size, unit == 0 ? "%.0f%s" : scaled < 100 ? "%.2f%s" : "%.0f%s", scaled, units[unit]);
}

void format_bytes(char *text, size_t size, uint64_t value)
{
    const char *units[] = {"B", "KiB", "MiB", "GiB", "TiB"};
    double scaled = (double)value;
    int unit = 0;
    while (scaled >= 1000 && unit < 4)
        scaled /= 1024, unit++;
    std::snprintf(text, size, unit == 0 || scaled >= 100 ? "%.0f %s" : "%.1f %s", scaled, units[unit]);
}

void apply_style(float scale)
{
    ImGuiStyle &style = ImGui::GetStyle();
    style = ImGuiStyle();
    ImGui::StyleColorsDark();
    style.WindowRounding = 6;
    style.FrameRounding = style.GrabRounding = 4;
    style.WindowBorderSize = 0;
    style.WindowPadding = ImVec2(12, 10);
    style.Colors[ImGuiCol_WindowBg] = ImVec4(0.07f, 0.08f, 0.10f, 0.82f);
    style.Colors[ImGuiCol_PlotHistogram] = ImVec4(0.26f, 0.52f, 0.80f, 1);
    style.ScaleAllSizes(scale);
    ImFontConfig font;
    font.SizePixels = std::floor(13 * scale);
    ImGui::GetIO().Fonts->Clear();
    ImGui::GetIO().Fonts->AddFontDefault(&font);
}

void count_row(const char *name, uint64_t value)
{
    char text[32];
    format_count(text, sizeof text, value);
    row(name, text);
}

void budget(const char *name, uint64_t used, uint64_t most)
{
    char used_text[32], most_text[32], text[80];
    format_bytes(used_text, sizeof used_text, used);
    format_bytes(most_text, sizeof most_text, most);
    std::snprintf(text, sizeof text, "%s %s of %s", name, used_text, most_text);
    ImGui::ProgressBar(most ? (float)((double)used / (double)most) : 0, ImVec2(-1, 0), text);
}

/* On the line of what was before it, where there is room. */
void button(strl_gui_controls *controls, const char *label, strl_action action)
{
    float width = ImGui::CalcTextSize(label).x + 2 * ImGui::GetStyle().FramePadding.x;
    float left = ImGui::GetItemRectMax().x + ImGui::GetStyle().ItemSpacing.x;
    if (left + width <= ImGui::GetWindowPos().x + ImGui::GetWindowContentRegionMax().x)
        ImGui::SameLine();
    if (ImGui::Button(label))
        strl_requests_add(&controls->requests, action, STRL_ACTION_SELECTION);
}

void show_controls(const strl_gui_facts *facts, strl_gui_controls *controls)
{
    ImGui::SetNextItemWidth(-1);
    ImGui::SliderFloat("##error", &controls->error_px, STRL_GUI_LEAST_ERROR_PX, STRL_GUI_MOST_ERROR_PX,
                       "pixel error %.2f", ImGuiSliderFlags_Logarithmic | ImGuiSliderFlags_AlwaysClamp);
    int mode = controls->mode;
    ImGui::RadioButton("orbit", &mode, STRL_NAVIGATOR_ORBIT);
    ImGui::SameLine();
    ImGui::RadioButton("fly", &mode, STRL_NAVIGATOR_FLY);
    ImGui::SameLine();
    ImGui::RadioButton("walk", &mode, STRL_NAVIGATOR_WALK);
    controls->mode = (strl_navigator_mode)mode;
    if (mode != STRL_NAVIGATOR_ORBIT)
        ImGui::TextColored(faint, "%.3g %s/s", facts->speed, facts->unit[0] ? facts->unit : "units");
    ImGui::Checkbox("orthographic", &controls->orthographic);
    ImGui::SameLine();
    bool parts = controls->parts;
    if (ImGui::Checkbox("parts", &parts))
        strl_requests_add(&controls->requests, STRL_ACTION_PARTS, 0);
    int debug = controls->debug;
    ImGui::SetNextItemWidth(-1);
    ImGui::Combo("##colours", &debug, "colours of the model\0colours by cluster\0colours by level\0colours by error\0");
    controls->debug = (strl_debug_colour)debug;
    ImGui::Checkbox("wireframe", &controls->wireframe);
    ImGui::SameLine();
    ImGui::Checkbox("flat", &controls->flat);
    ImGui::SameLine();
    ImGui::Checkbox("freeze", &controls->frozen);
    if (ImGui::Button("home"))
        strl_requests_add(&controls->requests, STRL_ACTION_HOME, STRL_ACTION_SELECTION);
    button(controls, "reset", STRL_ACTION_RESET);
    button(controls, "picture", STRL_ACTION_SCREENSHOT);
    button(controls, facts->section->on ? "whole" : "section", STRL_ACTION_SECTION);
    button(controls, "help", STRL_ACTION_HELP);
}

/* In force when it is let go: both begin anew then. */
void budget_slider(const char *format, float *mib, const char *name, strl_requests *requests)
{
    ImGui::SetNextItemWidth(-1);
    ImGui::SliderFloat(name, mib, STRL_GUI_LEAST_MIB, STRL_GUI_MOST_MIB, format,
                       ImGuiSliderFlags_Logarithmic | ImGuiSliderFlags_AlwaysClamp);
    if (ImGui::IsItemDeactivatedAfterEdit())
        strl_requests_add(requests, STRL_ACTION_BUDGETS, 0);
}

void show_memory(const strl_gui_facts *facts, strl_gui_controls *controls)
{
    heading("memory");
    budget("nodes", facts->resident_bytes, facts->memory_bytes);
    budget("GPU", facts->gpu_bytes, facts->gpu_memory_bytes);
    if (!ImGui::CollapsingHeader("budgets and text"))
        return;
    budget_slider("nodes %.0f MiB", &controls->memory_mib, "##memory", &controls->requests);
    budget_slider("GPU %.0f MiB", &controls->gpu_memory_mib, "##gpu", &controls->requests);
    /* By steps: a slider would move under the hand as the text grows. */
    if (ImGui::SmallButton("smaller text"))
        controls->text_scale = std::fmax(controls->text_scale / 1.1f, 0.6f);
    ImGui::SameLine();
    if (ImGui::SmallButton("larger text"))
        controls->text_scale = std::fmin(controls->text_scale * 1.1f, 3.0f);
}

void show_statistics(const strl_gui_facts *facts)
{
    heading("frame");
    if (!begin_table("statistics"))
        return;
    if (facts->idle)
        row("frames/s", "still");
    else
        real_row("frames/s", "%.1f", facts->fps);
    real_row("frame", "%.1f ms", facts->frame_ms);
    real_row("select", "%.2f ms", facts->select_ms);
    count_row("triangles", facts->triangles);
    count_row("nodes", facts->nodes);
    count_row("culled", facts->nodes_culled);
    count_row("draws", facts->draws);
    count_row("requests", facts->requests);
    count_row("missing nodes", facts->missing_nodes);
    real_row("allowed error", "%.2f px", facts->allowed_error_px);
    if (std::isfinite(facts->max_error_px))
        real_row("largest error", "%.2f px", facts->max_error_px);
    else
        row("largest error", "unbounded"); /* the eye stands in a node's box */
    if (facts->remote) {
        real_row("network", "%.1f Mbit/s", facts->megabits_per_second);
        real_row("latency", "%.1f ms", facts->latency_ms);
    }
    if (facts->faults)
        count_row("faults", facts->faults);
    ImGui::EndTable();
}

void show_size(const strl_gui_facts *facts)
{
    char stored[32], placed[32];
    const char *plural = facts->model_triangles == 1 ? "" : "s";
    format_count(stored, sizeof stored, facts->model_triangles);
    format_count(placed, sizeof placed, facts->placed_triangles ? facts->placed_triangles : facts->placements);
    if (facts->placed_triangles == facts->model_triangles || facts->placements == 1)
        ImGui::TextColored(faint, "%s triangle%s", stored, plural);
    else if (facts->placed_triangles)
        ImGui::TextColored(faint, "%s triangles as placed, %s stored", placed, stored);
    else
        ImGui::TextColored(faint, "%s triangle%s stored, %s placements", stored, plural, placed);
}

void show_panel(const place &at, const strl_gui_facts *facts, strl_gui_controls *controls)
{
    float width = panel_width * at.scale, room = at.height - 2 * margin * at.scale;
    ImGui::SetNextWindowPos(ImVec2(margin * at.scale, margin * at.scale), when_of(at));
    ImGui::SetNextWindowSizeConstraints(ImVec2(width, 0), ImVec2(width, room > 1 ? room : 1));
    ImGui::Begin("Stroll", NULL,
                 ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoFocusOnAppearing | ImGuiWindowFlags_NoNav);
    const char *slash = std::strrchr(facts->model, '/');
    ImGui::TextWrapped("%s", slash ? slash + 1 : facts->model);
    if (ImGui::IsItemHovered())
        ImGui::SetTooltip("%s", facts->model);
    show_size(facts);
    if (facts->mesh[0] && !facts->builds && ImGui::SmallButton("build again"))
        strl_requests_add(&controls->requests, STRL_ACTION_BUILD_AGAIN, 0);
    if (facts->recorder->state == STRL_RECORDER_RECORDS)
        ImGui::TextColored(warning, "recording, %.1f s: M ends and saves it",
                           (double)facts->recorder->path.count / STRL_RECORDER_RATE);
    show_controls(facts, controls);
    if (ImGui::CollapsingHeader("bookmarks"))
        show_bookmarks(facts, controls);
    if (ImGui::CollapsingHeader("path"))
        show_path(facts, controls);
    show_memory(facts, controls);
    show_statistics(facts);
    if (facts->last_fault[0]) {
        ImGui::PushStyleColor(ImGuiCol_Text, warning);
        ImGui::TextWrapped("%s", facts->last_fault);
        ImGui::PopStyleColor();
    }
    ImGui::PushStyleColor(ImGuiCol_Text, faint);
    ImGui::TextWrapped("%s", facts->device);
    ImGui::PopStyleColor();
    ImGui::End();
}

const ImGuiWindowFlags overlay_flags = ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_AlwaysAutoResize |
                                       ImGuiWindowFlags_NoNav | ImGuiWindowFlags_NoInputs |
                                       ImGuiWindowFlags_NoSavedSettings;

/* Letters become smaller where the window is too small for them. */
void show_help(const char *keys)
{
    ImVec2 size = ImGui::GetIO().DisplaySize, text = ImGui::CalcTextSize(keys);
    ImVec2 padding = ImGui::GetStyle().WindowPadding;
    float fit = std::fmin((size.x - 2 * padding.x) / text.x, (size.y - 2 * padding.y) / text.y);
    ImGui::SetNextWindowPos(ImVec2(size.x * 0.5f, size.y * 0.5f), ImGuiCond_Always, ImVec2(0.5f, 0.5f));
    ImGui::SetNextWindowBgAlpha(0.94f);
    ImGui::Begin("##help", NULL, overlay_flags);
    ImGui::SetWindowFontScale(std::fmin(std::fmax(fit, 0.2f), 1.0f));
    ImGui::TextUnformatted(keys);
    ImGui::End();
}

/* Of the window's width: sentences with long names go over several lines. */
const float message_share = 0.75f;

void show_message(float scale, const char *message)
{
    ImVec2 size = ImGui::GetIO().DisplaySize;
    ImGui::SetNextWindowPos(ImVec2(size.x * 0.5f, size.y - margin * scale), ImGuiCond_Always, ImVec2(0.5f, 1));
    ImGui::Begin("##message", NULL, overlay_flags);
    ImGui::PushTextWrapPos(size.x * message_share);
    ImGui::TextUnformatted(message);
    ImGui::PopTextWrapPos();
    ImGui::End();
}

void show_lines(const strl_gui_facts *facts)
{
    ImDrawList *list = ImGui::GetBackgroundDrawList();
    ImVec2 scale = ImGui::GetIO().DisplayFramebufferScale;
    if (!(scale.x > 0) || !(scale.y > 0))
        return;
    for (uint32_t i = 0; i < facts->line_count; i++) {
        const float *at = facts->lines[i];
        list->AddLine(ImVec2(at[0] / scale.x, at[1] / scale.y), ImVec2(at[2] / scale.x, at[3] / scale.y), line_colour,
                      1.5f);
    }
}

/* Of a menu or a choice. */
bool is_menu_open()
{
    return ImGui::IsPopupOpen("", ImGuiPopupFlags_AnyPopup);
}

/* The panels have no navigation by keys, which would do this. */
void close_menu_by_key()
{
    if (is_menu_open() && ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Escape), false))
        ImGui::SetWindowFocus(NULL);
}

place place_panels(strl_gui *gui)
{
    ImVec2 size = ImGui::GetIO().DisplaySize;
    const float wanted[3] = {size.x, size.y, gui->scale};
    bool anew = std::memcmp(wanted, gui->laid_out, sizeof wanted) != 0;
    std::memcpy(gui->laid_out, wanted, sizeof wanted);
    return place{gui->scale, size.x, size.y, anew};
}

} // namespace

strl_status strl_gui_create(struct GLFWwindow *window, double scale, strl_gui **gui, strl_error *err)
{
    *gui = new (std::nothrow) strl_gui{};
    if (!*gui)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the panel");
    (*gui)->scale = (float)scale;
    (*gui)->context = ImGui::CreateContext();
    ImGui::GetIO().IniFilename = NULL; /* a viewer leaves no files behind */
    apply_style((*gui)->scale);
    if (ImGui_ImplGlfw_InitForOpenGL(window, true)) {
        if (ImGui_ImplOpenGL3_Init("#version 330 core"))
            return STRL_OK;
        ImGui_ImplGlfw_Shutdown();
    }
    ImGui::DestroyContext((*gui)->context);
    delete *gui;
    *gui = NULL;
    return strl__fail(err, STRL_ERR_UNSUPPORTED, "the panel cannot be drawn with this GL system");
}

void strl_gui_destroy(strl_gui *gui)
{
    if (!gui)
        return;
    ImGui::SetCurrentContext(gui->context);
    ImGui_ImplOpenGL3_Shutdown();
    ImGui_ImplGlfw_Shutdown();
    ImGui::DestroyContext(gui->context);
    delete gui;
}

void strl_gui_set_scale(strl_gui *gui, double scale)
{
    ImGui::SetCurrentContext(gui->context);
    gui->scale = (float)scale;
    apply_style(gui->scale);
    ImGui_ImplOpenGL3_DestroyFontsTexture();
    ImGui_ImplOpenGL3_CreateFontsTexture();
}

void strl_gui_show(strl_gui *gui, const strl_gui_facts *facts, strl_gui_controls *controls)
{
    ImGui::SetCurrentContext(gui->context);
    ImGui_ImplOpenGL3_NewFrame();
    ImGui_ImplGlfw_NewFrame();
    ImGui::NewFrame();
    close_menu_by_key();
    place at = place_panels(gui);
    show_lines(facts);
    show_marks(facts);
    show_panel(at, facts, controls);
    show_section(at, facts, controls);
    if (controls->parts)
        show_parts(at, facts, controls);
    show_picks(at, facts, controls);
    show_build(at, facts, controls);
    if (controls->help)
        show_help(facts->keys);
    if (facts->message[0])
        show_message(gui->scale, facts->message);
    gui->menu_open = is_menu_open();
    ImGui::Render();
    ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
}

bool strl_gui_takes_mouse(const strl_gui *gui)
{
    ImGui::SetCurrentContext(gui->context);
    return ImGui::GetIO().WantCaptureMouse;
}

bool strl_gui_takes_keyboard(const strl_gui *gui)
{
    ImGui::SetCurrentContext(gui->context);
    return ImGui::GetIO().WantTextInput || gui->menu_open;
}
