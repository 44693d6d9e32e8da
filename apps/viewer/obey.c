/* What keys and panels ask for. */
#include <math.h>
#include <string.h>

#include "viewer/internal.h"

#define ERROR_STEP 1.25f
/* Of the range in which a section meets the model. */
#define SECTION_STEP 0.01

void strl__viewer_reset(strl__viewer *v)
{
    strl_gui_controls old = v->controls;
    v->controls = (strl_gui_controls){.error_px = (float)v->desc.error_px,
                                      .help = old.help,
                                      .parts = old.parts,
                                      .memory_mib = old.memory_mib,
                                      .gpu_memory_mib = old.gpu_memory_mib,
                                      .text_scale = old.text_scale,
                                      .requests = old.requests};
    strl_navigator_init(&v->navigator, v->model->bounds, v->model->up_axis, v->model->unit_metres);
    strl__viewer_end_recording(v);
    strl__viewer_end_replay(v);
    strl_parts_select(&v->parts, 0, 0);
    strl_parts_show_all(&v->parts);
    v->picks.count = 0;
    v->section = (strl_section){0};
}

static void toggle_debug(strl__viewer *v, strl_debug_colour colour)
{
    v->controls.debug = v->controls.debug == colour ? STRL_DEBUG_NONE : colour;
}

static void scale_error(strl__viewer *v, float factor)
{
    /* --error may lie outside the slider's range: a key then leads no further out, and not to the other side. */
    float error_px = v->controls.error_px, least = fminf(error_px, STRL_GUI_LEAST_ERROR_PX);
    float most = fmaxf(error_px, STRL_GUI_MOST_ERROR_PX);
    v->controls.error_px = fminf(fmaxf(error_px * factor, least), most);
}

/* ---- parts */

/* Shown at what is selected. */
static void toggle_parts(strl__viewer *v)
{
    v->controls.parts = !v->controls.parts;
    if (v->controls.parts && v->parts.selected_count > 0)
        v->reveal = strl_part_tree_reveal(&v->parts.tree, v->parts.tree.order[strl_parts_first_selected(&v->parts)]);
}

static void select_parts(strl__viewer *v, uint32_t node)
{
    const strl_part_tree *tree = &v->parts.tree;
    if (node < tree->node_count)
        strl_parts_select(&v->parts, tree->nodes[node].first_part, tree->nodes[node].part_count);
    else if (node == STRL_ACTION_FOUND)
        strl_parts_select_found(&v->parts);
}

static void obey_node(strl__viewer *v, strl_action action, const strl_part_node *node)
{
    if (action == STRL_ACTION_ISOLATE)
        strl_parts_isolate(&v->parts, node->first_part, node->part_count);
    else
        strl_parts_hide(&v->parts, node->first_part, node->part_count, action == STRL_ACTION_HIDE);
}

static void obey_selection(strl__viewer *v, strl_action action)
{
    if (action == STRL_ACTION_ISOLATE)
        strl_parts_isolate_selected(&v->parts);
    else
        strl_parts_hide_selected(&v->parts, action == STRL_ACTION_HIDE);
}

static void obey_parts(strl__viewer *v, strl_request request)
{
    const strl_part_tree *tree = &v->parts.tree;
    if (request.action == STRL_ACTION_SELECT) {
        select_parts(v, request.index);
        return;
    }
    if (request.action != STRL_ACTION_SHOW_ALL && request.index >= tree->node_count && v->parts.selected_count == 0) {
        strl__viewer_say(v, "nothing is selected: click a part, or a line of the list");
        return;
    }
    if (request.action == STRL_ACTION_SHOW_ALL)
        strl_parts_show_all(&v->parts);
    else if (request.index < tree->node_count)
        obey_node(v, request.action, &tree->nodes[request.index]);
    else
        obey_selection(v, request.action);
    strl_journal_write(v->journal, "hidden", json_pack("{s:i}", "count", (int)v->parts.hidden_count));
}

/* ---- section */

void strl__viewer_journal_section(strl__viewer *v)
{
    strl_journal_write(v->journal, "section",
                       json_pack("{s:b,s:o,s:f}", "on", v->section.on, "normal", strl_journal_vector(v->section.normal),
                                 "offset", v->section.offset));
}

static void toggle_section(strl__viewer *v)
{
    const double *n = v->section.normal;
    if (n[0] == 0 && n[1] == 0 && n[2] == 0)
        strl_section_by_axis(&v->section, v->model->up_axis, v->model->bounds);
    else
        v->section.on = !v->section.on;
}

static void section_by_picks(strl__viewer *v)
{
    double points[3][3];
    if (v->picks.count < 3) {
        strl__viewer_say(v, "a section through three points: pick three first");
        return;
    }
    for (int i = 0; i < 3; i++)
        memcpy(points[i], v->picks.items[i].pick.point, sizeof points[i]);
    if (!strl_section_by_points(&v->section, (const double(*)[3])points, v->camera.eye))
        strl__viewer_say(v, "the last three picks lie in a line: no section goes through them alone");
}

static void section_by_normal(strl__viewer *v)
{
    const strl_picked *newest = strl_picks_newest(&v->picks);
    if (newest)
        strl_section_by_normal(&v->section, newest->pick.point, newest->pick.normal);
    else
        strl__viewer_say(v, "a section along a surface: pick a point on it first");
}

static void obey_section(strl__viewer *v, strl_request request)
{
    const double *bounds = v->model->bounds;
    switch (request.action) {
    case STRL_ACTION_SECTION:
        toggle_section(v);
        break;
    case STRL_ACTION_SECTION_AXIS:
        strl_section_by_axis(&v->section, request.index, bounds);
        break;
    case STRL_ACTION_SECTION_NORMAL:
        section_by_normal(v);
        break;
    case STRL_ACTION_SECTION_POINTS:
        section_by_picks(v);
        break;
    case STRL_ACTION_SECTION_FLIP:
        strl_section_flip(&v->section);
        break;
    default:
        if (v->section.on)
            strl_section_move(&v->section, bounds,
                              request.action == STRL_ACTION_SECTION_FORTH ? SECTION_STEP : -SECTION_STEP);
    }
    v->controls.section_offset = v->section.offset;
    strl__viewer_journal_section(v);
}

/* ---- bookmarks */

static void go_bookmark(strl__viewer *v, const strl_bookmark *bookmark)
{
    if (!bookmark) {
        strl__viewer_say(v, "there is no bookmark yet: B makes one");
        return;
    }
    strl__viewer_end_replay(v);
    v->controls.orthographic = bookmark->orthographic;
    strl_navigator_go(&v->navigator, &bookmark->pose, STRL__GO_SECONDS);
    strl__viewer_say(v, "%s", bookmark->name);
}

/* As they are now: another window of the same model may have written since. */
static void renew_bookmarks(strl__viewer *v)
{
    strl_settings_renew(&v->settings);
    strl_settings_get_bookmarks(&v->settings, strl_container_get_info(v->model->container)->model_id, &v->bookmarks);
}

static void drop_bookmark(strl__viewer *v, uint32_t index)
{
    if (index >= v->bookmarks.count)
        return;
    const strl_bookmark dropped = v->bookmarks.items[index];
    renew_bookmarks(v);
    strl_bookmarks_remove(&v->bookmarks, strl_bookmarks_find(&v->bookmarks, &dropped));
}

static void add_bookmark(strl__viewer *v)
{
    renew_bookmarks(v);
    if (strl_bookmarks_add(&v->bookmarks, v->controls.bookmark, &v->navigator))
        strl__viewer_say(v, "bookmark %s", v->bookmarks.items[v->bookmarks.count - 1].name);
    else
        strl__viewer_say(v, "there is no room for more than %u bookmarks of a model", STRL_MOST_BOOKMARKS);
}

static void obey_bookmarks(strl__viewer *v, strl_request request)
{
    if (request.action == STRL_ACTION_NEXT_BOOKMARK) {
        go_bookmark(v, strl_bookmarks_next(&v->bookmarks));
        return;
    }
    if (request.action == STRL_ACTION_GO_BOOKMARK) {
        go_bookmark(v, request.index < v->bookmarks.count ? &v->bookmarks.items[request.index] : NULL);
        return;
    }
    if (request.action == STRL_ACTION_DROP_BOOKMARK)
        drop_bookmark(v, request.index);
    else
        add_bookmark(v);
    v->controls.bookmark[0] = 0;
    strl__viewer_remember(v, true);
}

/* ---- camera and pictures */

static void go_home(strl__viewer *v)
{
    strl_pose home = strl_navigator_home(&v->navigator);
    strl__viewer_end_replay(v);
    strl_navigator_go(&v->navigator, &home, STRL__GO_SECONDS);
}

static void obey_camera(strl__viewer *v, strl_action action)
{
    switch (action) {
    case STRL_ACTION_ORBIT:
        v->controls.mode = STRL_NAVIGATOR_ORBIT;
        break;
    case STRL_ACTION_FLY:
        v->controls.mode = STRL_NAVIGATOR_FLY;
        break;
    case STRL_ACTION_WALK:
        v->controls.mode = STRL_NAVIGATOR_WALK;
        break;
    case STRL_ACTION_ORTHOGRAPHIC:
        v->controls.orthographic = !v->controls.orthographic;
        break;
    case STRL_ACTION_HOME:
        go_home(v);
        break;
    case STRL_ACTION_LOOK:
        strl__viewer_look(v);
        break;
    case STRL_ACTION_RECORD:
        strl__viewer_toggle_record(v);
        break;
    case STRL_ACTION_REPLAY:
        strl__viewer_toggle_replay(v);
        break;
    default:
        break;
    }
}

static void obey_picture(strl__viewer *v, strl_action action)
{
    strl_gui_controls *controls = &v->controls;
    switch (action) {
    case STRL_ACTION_NO_COLOURS:
        controls->debug = STRL_DEBUG_NONE;
        break;
    case STRL_ACTION_CLUSTER_COLOURS:
        toggle_debug(v, STRL_DEBUG_CLUSTER);
        break;
    case STRL_ACTION_LEVEL_COLOURS:
        toggle_debug(v, STRL_DEBUG_LEVEL);
        break;
    case STRL_ACTION_ERROR_COLOURS:
        toggle_debug(v, STRL_DEBUG_ERROR);
        break;
    case STRL_ACTION_WIREFRAME:
        controls->wireframe = !controls->wireframe;
        break;
    case STRL_ACTION_FLAT:
        controls->flat = !controls->flat;
        break;
    case STRL_ACTION_FREEZE:
        controls->frozen = !controls->frozen;
        break;
    case STRL_ACTION_COARSER:
        scale_error(v, ERROR_STEP);
        break;
    case STRL_ACTION_FINER:
        scale_error(v, 1 / ERROR_STEP);
        break;
    case STRL_ACTION_SCREENSHOT:
        v->screenshot = true;
        break;
    default:
        break;
    }
}

static void cancel_build(strl__viewer *v)
{
    strl_opener_cancel(v->opener);
    v->cancels = true;
}

static void set_budgets(strl__viewer *v)
{
    strl_error err = {0};
    if (strl__viewer_set_budgets(v, &err) != STRL_OK)
        strl__viewer_say(v, "%s", err.message);
}

/* Who presses Esc while a mesh is built means the build. */
static bool quit(strl__viewer *v)
{
    bool ends = v->news.state != STRL_OPENER_BUILDS || v->cancels;
    if (!ends)
        cancel_build(v);
    return ends;
}

bool strl__viewer_obey(strl__viewer *v, strl_request request)
{
    strl_action action = request.action;
    if (action == STRL_ACTION_RESET)
        strl__viewer_reset(v); /* now: the same frame's later keys change what it resets */
    else if (action == STRL_ACTION_HELP)
        v->controls.help = !v->controls.help;
    else if (action == STRL_ACTION_PARTS)
        toggle_parts(v);
    else if (action == STRL_ACTION_FORGET_PICKS)
        v->picks.count = 0;
    else if (action == STRL_ACTION_OPEN_NODE)
        strl_part_tree_toggle(&v->parts.tree, request.index);
    else if (action == STRL_ACTION_BUDGETS)
        set_budgets(v);
    else if (action == STRL_ACTION_CANCEL_BUILD)
        cancel_build(v);
    else if (action == STRL_ACTION_BUILD_AGAIN)
        strl__viewer_build_again(v);
    else if (action >= STRL_ACTION_SELECT && action <= STRL_ACTION_SHOW_ALL)
        obey_parts(v, request);
    else if (action >= STRL_ACTION_SECTION && action <= STRL_ACTION_SECTION_BACK)
        obey_section(v, request);
    else if (action >= STRL_ACTION_BOOKMARK && action <= STRL_ACTION_DROP_BOOKMARK)
        obey_bookmarks(v, request);
    else if (action >= STRL_ACTION_NO_COLOURS && action <= STRL_ACTION_SCREENSHOT)
        obey_picture(v, action);
    else
        obey_camera(v, action);
    return action == STRL_ACTION_QUIT && quit(v);
}
