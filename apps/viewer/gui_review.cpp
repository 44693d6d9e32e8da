/* The panels for reviewing: parts, picks, section, bookmarks, paths, builds. */
#include <cstdio>

#include "viewer/gui_panels.hpp"

namespace strl_panels
{

namespace
{

/* Of the window's height; picks are below. */
const float parts_share = 0.52f;

const ImU32 mark_colour = IM_COL32(90, 200, 255, 255), ring_colour = IM_COL32(0, 0, 0, 200);

void tooltip(const char *text)
{
    if (ImGui::IsItemHovered())
        ImGui::SetTooltip("%s", text);
}

bool asks(strl_gui_controls *controls, const char *label, strl_action action, uint32_t index)
{
    bool pressed = ImGui::Button(label);
    if (pressed)
        strl_requests_add(&controls->requests, action, index);
    return pressed;
}

/* Apart from what is clicked: a label's text would be an identity there, and ends at ##. */
void draw_label(ImVec2 at, const char *text)
{
    ImGui::GetWindowDrawList()->AddText(at, ImGui::GetColorU32(ImGuiCol_Text), text[0] ? text : "(no name)");
}

/* A panel that is not there at first: wherever the visitor has put it, else at (x, y) of the window. */
void begin_panel(const place &at, const char *name, float x, float y, float pivot_x, float pivot_y, float height)
{
    float room = at.height - 2 * margin * at.scale;
    ImGui::SetNextWindowPos(ImVec2(x, y), when_of(at), ImVec2(pivot_x, pivot_y));
    if (height > 0)
        ImGui::SetNextWindowSize(ImVec2(panel_width * at.scale, height < room ? height : room), when_of(at));
    else
        ImGui::SetNextWindowSizeConstraints(ImVec2(panel_width * at.scale, 0), ImVec2(panel_width * at.scale, room));
    ImGui::Begin(name, NULL,
                 ImGuiWindowFlags_NoFocusOnAppearing | ImGuiWindowFlags_NoNav |
                     (height > 0 ? 0 : ImGuiWindowFlags_AlwaysAutoResize));
}

/* ---- parts */

void part_menu(uint32_t node, strl_gui_controls *controls)
{
    const struct {
        const char *label;
        strl_action action;
    } items[] = {{"look at it", STRL_ACTION_LOOK},
                 {"hide", STRL_ACTION_HIDE},
                 {"show", STRL_ACTION_SHOW},
                 {"show it alone, or all again", STRL_ACTION_ISOLATE}};
    if (!ImGui::BeginPopupContextItem())
        return;
    for (const auto &item : items)
        if (ImGui::MenuItem(item.label)) {
            strl_requests_add(&controls->requests, STRL_ACTION_SELECT, node);
            strl_requests_add(&controls->requests, item.action, node);
        }
    ImGui::EndPopup();
}

void part_row(const strl_parts *parts, uint32_t index, strl_gui_controls *controls)
{
    const strl_part_tree *tree = &parts->tree;
    const strl_part_node *node = &tree->nodes[index];
    const char *name = tree->text + node->name;
    bool has_children = index + 1 < node->end;
    uint32_t hidden = strl_parts_hidden_in(parts, node->first_part, node->part_count);
    bool shown = hidden < node->part_count;
    bool selected = strl_parts_selected_in(parts, node->first_part, node->part_count) == node->part_count;
    ImGui::PushID((int)index);
    if (ImGui::Checkbox("##shown", &shown))
        strl_requests_add(&controls->requests, shown ? STRL_ACTION_SHOW : STRL_ACTION_HIDE, index);
    ImGui::SameLine(0, ImGui::GetStyle().ItemInnerSpacing.x + node->depth * ImGui::GetFontSize() * 0.8f);
    if (has_children && ImGui::ArrowButton("##open", node->open ? ImGuiDir_Down : ImGuiDir_Right))
        strl_requests_add(&controls->requests, STRL_ACTION_OPEN_NODE, index);
    else if (!has_children && node->depth > 0) /* in line with those that have an arrow */
        ImGui::Dummy(ImVec2(ImGui::GetFrameHeight(), ImGui::GetFrameHeight()));
    if (has_children || node->depth > 0)
        ImGui::SameLine();
    char label[300];
    if (has_children)
        std::snprintf(label, sizeof label, "%.*s (%u)", (int)node->name_bytes, name, node->part_count);
    else
        std::snprintf(label, sizeof label, "%.*s", (int)node->name_bytes, name);
    if (hidden > 0)
        ImGui::PushStyleColor(ImGuiCol_Text, faint);
    ImVec2 at = ImGui::GetCursorScreenPos();
    at.y += ImGui::GetStyle().FramePadding.y;
    if (ImGui::Selectable("##row", selected, ImGuiSelectableFlags_AllowDoubleClick,
                          ImVec2(0, ImGui::GetFrameHeight()))) {
        strl_requests_add(&controls->requests, STRL_ACTION_SELECT, index);
        if (ImGui::IsMouseDoubleClicked(0))
            strl_requests_add(&controls->requests, STRL_ACTION_LOOK, index);
    }
    tooltip(node->is_part ? strl_part_tree_name(tree, tree->order[node->first_part]) : label);
    part_menu(index, controls);
    draw_label(at, label);
    if (hidden > 0)
        ImGui::PopStyleColor();
    ImGui::PopID();
}

/* What the search has found is selected, then hidden or left alone. */
void show_found(const strl_parts *parts, strl_gui_controls *controls)
{
    uint32_t found = strl_part_tree_found_in(&parts->tree, 0, parts->tree.part_count);
    const struct {
        const char *label;
        strl_action action;
    } buttons[] = {{"select##found", STRL_ACTION_SELECT},
                   {"hide##found", STRL_ACTION_HIDE},
                   {"alone##found", STRL_ACTION_ISOLATE}};
    if (!parts->tree.search[0])
        return;
    ImGui::AlignTextToFramePadding();
    ImGui::TextColored(faint, "%u found", found);
    for (const auto &button : buttons) {
        ImGui::SameLine();
        if (!ImGui::Button(button.label) || found == 0)
            continue;
        strl_requests_add(&controls->requests, STRL_ACTION_SELECT, STRL_ACTION_FOUND);
        if (button.action != STRL_ACTION_SELECT)
            strl_requests_add(&controls->requests, button.action, STRL_ACTION_SELECTION);
    }
}

} // namespace

void show_parts(const place &at, const strl_gui_facts *facts, strl_gui_controls *controls)
{
    const strl_parts *parts = facts->parts;
    begin_panel(at, "Parts", at.width - margin * at.scale, margin * at.scale, 1, 0, at.height * parts_share);
    ImGui::SetNextItemWidth(-1);
    ImGui::InputTextWithHint("##search", "search", controls->search, sizeof controls->search);
    show_found(parts, controls);
    asks(controls, "hide", STRL_ACTION_HIDE, STRL_ACTION_SELECTION);
    ImGui::SameLine();
    asks(controls, "alone", STRL_ACTION_ISOLATE, STRL_ACTION_SELECTION);
    ImGui::SameLine();
    asks(controls, "show all", STRL_ACTION_SHOW_ALL, 0);
    ImGui::SameLine();
    asks(controls, "look", STRL_ACTION_LOOK, STRL_ACTION_SELECTION);
    ImGui::TextColored(faint, "%u part%s, %u selected, %u hidden", parts->tree.part_count,
                       parts->tree.part_count == 1 ? "" : "s", parts->selected_count, parts->hidden_count);
    ImGui::BeginChild("rows");
    if (facts->reveal != UINT32_MAX)
        ImGui::SetScrollY((float)facts->reveal * ImGui::GetFrameHeightWithSpacing() - ImGui::GetWindowHeight() / 2);
    ImGuiListClipper clipper;
    clipper.Begin((int)parts->tree.row_count, ImGui::GetFrameHeightWithSpacing());
    while (clipper.Step())
        for (int r = clipper.DisplayStart; r < clipper.DisplayEnd; r++)
            part_row(parts, parts->tree.rows[r], controls);
    ImGui::EndChild();
    ImGui::End();
}

/* ---- picks */

static void show_distance(const strl_gui_facts *facts)
{
    double difference[3], distance = strl_picks_distance(facts->picks, difference);
    if (distance < 0)
        return;
    heading("from the pick before");
    if (!begin_table("distance"))
        return;
    real_row("distance", "%.9g", distance);
    real_row("along x", "%.9g", difference[0]);
    real_row("along y", "%.9g", difference[1]);
    real_row("along z", "%.9g", difference[2]);
    ImGui::EndTable();
}

void show_picks(const place &at, const strl_gui_facts *facts, strl_gui_controls *controls)
{
    const strl_picked *newest = strl_picks_newest(facts->picks);
    if (!newest)
        return;
    begin_panel(at, "Pick", at.width - margin * at.scale, at.height * parts_share + 2 * margin * at.scale, 1, 0, 0);
    ImGui::TextWrapped("%s", newest->part[0] ? newest->part : "(a part without a name)");
    if (begin_table("pick")) {
        row("material", newest->material[0] ? newest->material : "none");
        row("unit", facts->unit[0] ? facts->unit : "unknown");
        real_row("x", "%.12g", newest->pick.point[0]);
        real_row("y", "%.12g", newest->pick.point[1]);
        real_row("z", "%.12g", newest->pick.point[2]);
        real_row("surface within", "%.3g", newest->pick.error);
        ImGui::EndTable();
    }
    show_distance(facts);
    asks(controls, "forget", STRL_ACTION_FORGET_PICKS, 0);
    ImGui::SameLine();
    asks(controls, "section here", STRL_ACTION_SECTION_NORMAL, 0);
    ImGui::End();
}

void show_marks(const strl_gui_facts *facts)
{
    ImDrawList *list = ImGui::GetBackgroundDrawList();
    ImVec2 scale = ImGui::GetIO().DisplayFramebufferScale;
    if (!(scale.x > 0) || !(scale.y > 0))
        return;
    for (uint32_t p = 0; p < facts->picks->count; p++) {
        ImVec2 here(facts->marks[p][0] / scale.x, facts->marks[p][1] / scale.y);
        if (!facts->mark_shown[p])
            continue;
        if (p + 2 == facts->picks->count && facts->mark_shown[p + 1])
            list->AddLine(here, ImVec2(facts->marks[p + 1][0] / scale.x, facts->marks[p + 1][1] / scale.y), mark_colour,
                          1.5f);
        list->AddCircleFilled(here, 5, ring_colour);
        list->AddCircleFilled(here, 3.5f, mark_colour);
    }
}

/* ---- section */

void show_section(const place &at, const strl_gui_facts *facts, strl_gui_controls *controls)
{
    if (!facts->section->on)
        return;
    const char *axes[] = {"x", "y", "z"};
    /* Beside the main panel, or below where the parts are there. */
    float left = (panel_width + 2 * margin) * at.scale;
    bool room = at.width >= left + (panel_width + margin) * at.scale + (controls->parts ? left : 0);
    begin_panel(at, "Section", room ? left : margin * at.scale,
                room ? margin * at.scale : at.height - margin * at.scale, 0, room ? 0 : 1, 0);
    for (uint32_t axis = 0; axis < 3; axis++) {
        asks(controls, axes[axis], STRL_ACTION_SECTION_AXIS, axis);
        ImGui::SameLine();
    }
    asks(controls, "surface", STRL_ACTION_SECTION_NORMAL, 0);
    tooltip("along the surface of the newest pick");
    ImGui::SameLine();
    asks(controls, "3 picks", STRL_ACTION_SECTION_POINTS, 0);
    tooltip("through the last three picks");
    ImGui::SetNextItemWidth(-1);
    ImGui::SliderScalar("##offset", ImGuiDataType_Double, &controls->section_offset, &facts->section_range[0],
                        &facts->section_range[1], "%.9g", ImGuiSliderFlags_AlwaysClamp);
    const double *n = facts->section->normal;
    ImGui::TextColored(faint, "normal %.3f %.3f %.3f", n[0], n[1], n[2]);
    asks(controls, "other side", STRL_ACTION_SECTION_FLIP, 0);
    ImGui::SameLine();
    asks(controls, "off", STRL_ACTION_SECTION, 0);
    ImGui::End();
}

/* ---- bookmarks and paths */

void show_bookmarks(const strl_gui_facts *facts, strl_gui_controls *controls)
{
    ImGui::SetNextItemWidth(-ImGui::GetFontSize() * 4);
    bool entered = ImGui::InputTextWithHint("##name", "name of this view", controls->bookmark,
                                            sizeof controls->bookmark, ImGuiInputTextFlags_EnterReturnsTrue);
    ImGui::SameLine();
    if (!asks(controls, "keep", STRL_ACTION_BOOKMARK, 0) && entered)
        strl_requests_add(&controls->requests, STRL_ACTION_BOOKMARK, 0);
    for (uint32_t b = 0; b < facts->bookmarks->count; b++) {
        ImGui::PushID((int)b);
        if (ImGui::SmallButton("x"))
            strl_requests_add(&controls->requests, STRL_ACTION_DROP_BOOKMARK, b);
        ImGui::SameLine();
        ImVec2 here = ImGui::GetCursorScreenPos();
        if (ImGui::Selectable("##bookmark"))
            strl_requests_add(&controls->requests, STRL_ACTION_GO_BOOKMARK, b);
        draw_label(here, facts->bookmarks->items[b].name);
        ImGui::PopID();
    }
}

void show_path(const strl_gui_facts *facts, strl_gui_controls *controls)
{
    const strl_recorder *recorder = facts->recorder;
    bool records = recorder->state == STRL_RECORDER_RECORDS, replays = recorder->state == STRL_RECORDER_REPLAYS;
    asks(controls, records ? "end and save" : "record", STRL_ACTION_RECORD, 0);
    ImGui::SameLine();
    asks(controls, replays ? "stop" : "replay", STRL_ACTION_REPLAY, 0);
    ImGui::SameLine();
    ImGui::TextColored(records ? warning : faint, "%.1f s", (double)recorder->path.count / STRL_RECORDER_RATE);
}

/* ---- builds */

void show_build(const place &at, const strl_gui_facts *facts, strl_gui_controls *controls)
{
    if (!facts->builds)
        return;
    ImGui::SetNextWindowPos(ImVec2(at.width / 2, at.height / 2), ImGuiCond_Always, ImVec2(0.5f, 0.5f));
    ImGui::SetNextWindowBgAlpha(0.94f);
    ImGui::Begin("Building", NULL,
                 ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoCollapse | ImGuiWindowFlags_NoNav);
    ImGui::ProgressBar((float)facts->build_share, ImVec2(panel_width * at.scale, 0));
    ImGui::TextUnformatted(facts->build_text);
    asks(controls, "cancel", STRL_ACTION_CANCEL_BUILD, 0);
    ImGui::End();
}

} // namespace strl_panels
