/* One frame: front, picture, panels. */
#include <math.h>
#include <string.h>

#include "frame/view.h"
#include "platform/thread.h"
#include "shared/naming.h"
#include "viewer/frustum.h"
#include "viewer/internal.h"
#include "viewer/screenshot.h"

static void take_screenshot(strl__viewer *v)
{
    char path[4096];
    strl_error err = {0};
    if (strl_screenshot_write(v->renderer, v->size[0], v->size[1], v->desc.screenshots, path, sizeof path, &err) !=
        STRL_OK) {
        strl__viewer_say(v, "%s", err.message);
        return;
    }
    strl__viewer_say(v, "saved %.300s", path);
    strl_journal_write(v->journal, "screenshot", json_pack("{s:o}", "file", strl_journal_text(path)));
}

static strl_draw_options draw_options(const strl__viewer *v)
{
    strl_draw_options options = {.debug = v->controls.debug,
                                 .wireframe = v->controls.wireframe,
                                 .flat = v->controls.flat,
                                 .background = {30, 33, 38}};
    options.sky_up[v->model->up_axis] = 1;
    strl_section_plane(&v->section, options.section);
    if (v->parts.hidden_count > 0 || v->parts.selected_count > 0) {
        options.part_styles = v->parts.styles;
        options.part_count = v->parts.tree.part_count;
        options.styles_version = v->parts.version;
    }
    return options;
}

/* While frozen, the walk goes on for the camera as it was, and the list is seen by another. */
static strl_status select_nodes(strl__viewer *v, strl_error *err)
{
    bool was_frozen = v->frozen.width > 0;
    if (v->controls.frozen && !was_frozen)
        v->frozen = v->camera;
    else if (!v->controls.frozen)
        v->frozen = (strl_camera){0};
    strl_walk_set_error_px(v->model->walk, v->controls.error_px);
    strl_status status = strl_walk_frame(v->model->walk, v->controls.frozen ? &v->frozen : &v->camera, &v->list, err);
    if (status != STRL_OK)
        return strl_name_file(v->path, status, err);
    v->clock.select_ns += strl_walk_get_stats(v->model->walk)->select_ns;
    v->frozen_far = v->list.count > 0 ? v->list.far_distance : v->navigator.radius;
    if (v->controls.frozen && !strl_viewer_set_range(&v->list, &v->camera))
        v->list.count = 0;
    return STRL_OK;
}

/* ---- panels */

static void gather_statistics(const strl__viewer *v, const strl_render_stats *drawn, strl_gui_facts *facts)
{
    const strl_walk_stats *walk = strl_walk_get_stats(v->model->walk);
    facts->fps = v->clock.fps;
    facts->frame_ms = v->clock.frame_ms;
    facts->select_ms = v->clock.select_mean_ms;
    facts->triangles = drawn->triangles;
    facts->resident_bytes = walk->resident_bytes;
    facts->memory_bytes = v->desc.memory_bytes;
    facts->gpu_bytes = drawn->gpu_bytes;
    facts->gpu_memory_bytes = v->desc.gpu_memory_bytes;
    facts->faults = walk->faults;
    facts->nodes = walk->nodes;
    facts->nodes_culled = walk->nodes_culled;
    facts->draws = drawn->draws;
    facts->requests = walk->requests_pending;
    facts->missing_nodes = walk->missing_nodes;
    facts->allowed_error_px = walk->allowed_error_px;
    facts->max_error_px = walk->max_error_px;
    facts->remote = walk->remote;
    facts->megabits_per_second = walk->network.bytes_per_second * 8e-6;
    facts->latency_ms = (double)walk->network.latency_ns * 1e-6;
    facts->last_fault = walk->last_fault;
}

/* Where a point is in the picture. False behind the eye. */
static bool project(const strl_view *view, const strl_camera *camera, const double point[3], float out[2])
{
    double x = 0, y = 0, z = 0;
    for (int i = 0; i < 3; i++) {
        x += view->right[i] * (point[i] - view->eye[i]);
        y += view->up[i] * (point[i] - view->eye[i]);
        z += view->forward[i] * (point[i] - view->eye[i]);
    }
    if (!(z > 0))
        return false;
    x /= view->orthographic ? view->half_width : z * view->tan_x;
    y /= view->orthographic ? view->half_height : z * view->tan_y;
    out[0] = (float)((1 + x) / 2 * camera->width);
    out[1] = (float)((1 - y) / 2 * camera->height);
    return fabs(x) < 4 && fabs(y) < 4;
}

static void gather_marks(const strl__viewer *v, strl_gui_facts *facts)
{
    strl_view view;
    if (!strl_view_init(&view, &v->camera))
        return;
    for (uint32_t p = 0; p < v->picks.count; p++)
        facts->mark_shown[p] = project(&view, &v->camera, v->picks.items[p].pick.point, facts->marks[p]);
}

static strl_gui_facts gather_facts(const strl__viewer *v, const strl_render_stats *drawn)
{
    strl_gui_facts facts = {
        .model = v->shown,
        .device = v->device,
        .unit = strl_container_get_info(v->model->container)->unit,
        .model_triangles = v->model->triangles,
        .placed_triangles = v->model->placed,
        .placements = strl_container_get_info(v->model->container)->placement_count,
        .idle = v->resting,
        .speed = strl_navigator_speed(&v->navigator),
        .keys = strl_viewer_keys,
        .message = strl_clock_ns() < v->message_end_ns ? v->message : "",
        .parts = &v->parts,
        .reveal = v->reveal,
        .picks = &v->picks,
        .section = &v->section,
        .bookmarks = &v->bookmarks,
        .recorder = &v->recorder,
        .mesh = v->mesh,
        .builds = v->news.state == STRL_OPENER_BUILDS,
        .build_share = v->news.share,
        .build_text = v->news.text,
    };
    gather_statistics(v, drawn, &facts);
    gather_marks(v, &facts);
    strl_section_range(&v->section, v->model->bounds, facts.section_range);
    return facts;
}

/* The slider's own value changes only while somebody holds it. */
static void take_section(strl__viewer *v, double before)
{
    if (!v->section.on || v->controls.section_offset == before)
        return;
    v->section.offset = v->controls.section_offset;
    strl__viewer_journal_section(v);
}

static void show_panels(strl__viewer *v, const strl_render_stats *drawn)
{
    float lines[STRL_FRUSTUM_LINES][4];
    strl_gui_facts facts = gather_facts(v, drawn);
    double scale = strl_window_text_scale(v->window) * v->controls.text_scale;
    facts.lines = (const float(*)[4])lines;
    if (v->controls.frozen)
        facts.line_count = strl_frustum_lines(&v->frozen, v->frozen_far, &v->camera, lines);
    if (scale != v->text_scale)
        strl_gui_set_scale(v->gui, v->text_scale = scale);
    double offset = v->controls.section_offset = v->section.offset;
    strl_gui_show(v->gui, &facts, &v->controls);
    v->reveal = UINT32_MAX;
    v->shows_rest = facts.idle && !facts.message[0];
    take_section(v, offset);
    if (strcmp(v->controls.search, v->parts.tree.search) != 0)
        strl_part_tree_search(&v->parts.tree, v->controls.search);
    strl_window_set_taken(v->window, strl_gui_takes_mouse(v->gui), strl_gui_takes_keyboard(v->gui));
}

static void tell(strl__viewer *v, uint64_t start_ns, double asked_px, uint64_t triangles)
{
    const strl_walk_stats *walk = strl_walk_get_stats(v->model->walk);
    const strl_viewer_frame frame = {.frame_ns = strl_clock_ns() - start_ns,
                                     .select_ns = walk->select_ns,
                                     .triangles = triangles,
                                     .missing_nodes = walk->missing_nodes,
                                     .memory_bytes = v->desc.memory_bytes,
                                     .asked_px = asked_px,
                                     .splat_px = v->desc.splat_px,
                                     .allowed_px = walk->allowed_error_px,
                                     .max_error_px = walk->max_error_px};
    v->frames_shown++;
    if (v->desc.shown)
        v->desc.shown(v->desc.context, &frame);
}

strl_status strl__viewer_draw(strl__viewer *v, strl_error *err)
{
    uint64_t start_ns = strl_clock_ns();
    double asked_px = v->controls.error_px; /* the panel may change it for the next frame */
    strl_render_stats drawn;
    strl_draw_options options = draw_options(v);
    strl_status status = select_nodes(v, err);
    if (status == STRL_OK)
        status = strl_renderer_draw(v->renderer, &v->camera, &v->list, &options, &drawn, err);
    if (status == STRL_OK)
        status = strl_renderer_present(v->renderer, v->size[0], v->size[1], err);
    if (status != STRL_OK)
        return status;
    if (v->screenshot)
        take_screenshot(v);
    v->screenshot = false;
    show_panels(v, &drawn);
    strl_window_swap(v->window);
    tell(v, start_ns, asked_px, drawn.triangles);
    return STRL_OK;
}
