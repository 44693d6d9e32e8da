/* One frame of the window: input -> navigator -> walk -> renderer -> panel. Frames stop while nothing moves. */
#include "viewer/viewer.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "platform/thread.h"
#include "shared/naming.h"
#include "viewer/frustum.h"
#include "viewer/gui.h"
#include "viewer/model.h"
#include "viewer/navigator.h"
#include "viewer/screenshot.h"
#include "viewer/window.h"

#define DEFAULT_WIDTH 1280u
#define DEFAULT_HEIGHT 720u
#define DEFAULT_BYTES (512ull << 20)
#define MOST_SIDE 16384u
#define ERROR_STEP 1.25f
#define MESSAGE_SECONDS 4.0
/* Frames drawn after the last thing that happened: the panel needs a few to settle. */
#define FRAMES_AFTER_INPUT 4u
#define IDLE_SECONDS 0.5
/* A step of flying never covers more than this, however long a frame took. */
#define MOST_STEP_SECONDS 0.1
#define AVERAGE_SECONDS 0.5

const char strl_viewer_keys[] =
    "orbit          left drag turns, right drag shifts, wheel zooms\n"
    "fly            W A S D move, Q E down and up, right drag looks, wheel sets the speed,\n"
    "               Shift is faster\n"
    "O F            orbit, fly\n"
    "H R            home: look at the whole model; reset everything\n"
    "+ -            larger, smaller pixel error\n"
    "1 2 3 0        colours by cluster, level, error; of the model\n"
    "X L            wireframe; flat or smooth\n"
    "C              freeze the camera that selects and culls, and look at its work from elsewhere\n"
    "P              save the picture as PNG\n"
    "F1             this help\n"
    "Esc            quit\n";

/* Means over the last stretch of frames, for people to read. */
typedef struct frame_clock {
    uint64_t last_ns, stretch_ns, select_ns; /* last_ns 0: the next frame follows a rest */
    uint32_t frames;
    double fps, frame_ms, select_mean_ms;
} frame_clock;

typedef struct viewer {
    strl_viewer_desc desc; /* completed: no defaults left */
    strl_viewer_model model;
    strl_window *window;
    strl_gui *gui;
    strl_renderer *renderer;
    strl_navigator navigator;
    strl_gui_controls controls;
    strl_camera camera, frozen; /* frozen: the walk's, where controls.frozen */
    double frozen_far;
    uint32_t size[2];
    frame_clock clock;
    uint32_t frames_left; /* to draw before resting */
    uint64_t frames_shown;
    bool resting;
    char message[320];
    uint64_t message_end_ns;
    char device[160];
} viewer;

/* ---- what the visitor wants */

static void say(viewer *v, const char *text)
{
    snprintf(v->message, sizeof v->message, "%s", text);
    v->message_end_ns = strl_clock_ns() + (uint64_t)(MESSAGE_SECONDS * 1e9);
}

static void take_screenshot(viewer *v)
{
    char path[280], text[320];
    strl_error err = {0};
    strl_status status =
        strl_screenshot_write(v->renderer, v->size[0], v->size[1], v->desc.screenshots, path, sizeof path, &err);
    snprintf(text, sizeof text, "%s%.300s", status == STRL_OK ? "saved " : "", status == STRL_OK ? path : err.message);
    say(v, text);
}

static void reset(viewer *v)
{
    strl_gui_controls old = v->controls;
    v->controls = (strl_gui_controls){
        .error_px = (float)v->desc.error_px, .help = old.help, .screenshot = old.screenshot};
    strl_navigator_init(&v->navigator, v->model.bounds, v->model.up_axis);
}

static void toggle_debug(viewer *v, strl_debug_colour colour)
{
    v->controls.debug = v->controls.debug == colour ? STRL_DEBUG_NONE : colour;
}

static void scale_error(viewer *v, float factor)
{
    /* --error may lie outside the slider's range: a key then leads no further out, and not to the other side. */
    float error_px = v->controls.error_px, least = fminf(error_px, STRL_GUI_LEAST_ERROR_PX);
    float most = fmaxf(error_px, STRL_GUI_MOST_ERROR_PX);
    v->controls.error_px = fminf(fmaxf(error_px * factor, least), most);
}

/* True: quit. */
static bool obey(viewer *v, strl_action action)
{
    strl_gui_controls *controls = &v->controls;
    switch (action) {
    case STRL_ACTION_ORBIT:
        controls->fly = false;
        break;
    case STRL_ACTION_FLY:
        controls->fly = true;
        break;
    case STRL_ACTION_HOME:
        strl_navigator_home(&v->navigator);
        break;
    case STRL_ACTION_RESET:
        reset(v); /* now: the same frame's later keys change what it resets */
        break;
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
        controls->screenshot = true;
        break;
    case STRL_ACTION_HELP:
        controls->help = !controls->help;
        break;
    case STRL_ACTION_QUIT:
        return true;
    }
    return false;
}

/* What the panel's buttons asked for. */
static void obey_controls(viewer *v)
{
    if (v->controls.reset)
        reset(v);
    if (v->controls.home)
        strl_navigator_home(&v->navigator);
    v->controls.home = v->controls.reset = false;
    strl_navigator_set_mode(&v->navigator, v->controls.fly ? STRL_NAVIGATOR_FLY : STRL_NAVIGATOR_ORBIT);
}

static void move(viewer *v, const strl_window_input *input, double seconds)
{
    v->navigator.view_height = v->size[1];
    strl_navigator_drag_left(&v->navigator, input->left[0], input->left[1]);
    strl_navigator_drag_right(&v->navigator, input->right[0], input->right[1]);
    strl_navigator_wheel(&v->navigator, input->wheel);
    strl_navigator_move(&v->navigator, input->way, input->fast, fmin(seconds, MOST_STEP_SECONDS));
}

/* ---- drawing */

static double tick(frame_clock *clock)
{
    uint64_t now = strl_clock_ns();
    double seconds = clock->last_ns ? (double)(now - clock->last_ns) * 1e-9 : 0;
    if (clock->last_ns) {
        clock->stretch_ns += now - clock->last_ns;
        clock->frames++;
    }
    clock->last_ns = now;
    if ((double)clock->stretch_ns * 1e-9 >= AVERAGE_SECONDS) {
        clock->frame_ms = (double)clock->stretch_ns * 1e-6 / clock->frames;
        clock->fps = 1e3 / clock->frame_ms;
        clock->select_mean_ms = (double)clock->select_ns * 1e-6 / clock->frames;
        clock->stretch_ns = clock->select_ns = clock->frames = 0;
    }
    return seconds;
}

/* A window can be an icon, and its framebuffer larger than a renderer's image. */
static strl_status fit_size(viewer *v, bool *drawable, strl_error *err)
{
    uint32_t size[2];
    strl_window_framebuffer_size(v->window, size);
    *drawable = size[0] > 0 && size[1] > 0;
    if (!*drawable)
        return STRL_OK;
    for (int i = 0; i < 2; i++)
        v->size[i] = size[i] < MOST_SIDE ? size[i] : MOST_SIDE;
    return strl_renderer_resize(v->renderer, v->size[0], v->size[1], err);
}

static strl_draw_options draw_options(const viewer *v)
{
    strl_draw_options options = {.debug = v->controls.debug,
                                 .wireframe = v->controls.wireframe,
                                 .flat = v->controls.flat,
                                 .background = {30, 33, 38}};
    options.sky_up[v->model.up_axis] = 1;
    return options;
}

/* While frozen, the walk goes on for the camera as it was, and the list is seen by another. */
static strl_status select_nodes(viewer *v, strl_draw_list *list, strl_error *err)
{
    bool was_frozen = v->frozen.width > 0;
    if (v->controls.frozen && !was_frozen)
        v->frozen = v->camera;
    else if (!v->controls.frozen)
        v->frozen = (strl_camera){0};
    strl_walk_set_error_px(v->model.walk, v->controls.error_px);
    strl_status status = strl_walk_frame(v->model.walk, v->controls.frozen ? &v->frozen : &v->camera, list, err);
    if (status != STRL_OK)
        return strl_name_file(v->desc.path, status, err);
    v->clock.select_ns += strl_walk_get_stats(v->model.walk)->select_ns;
    v->frozen_far = list->count > 0 ? list->far_distance : v->navigator.radius;
    if (v->controls.frozen && !strl_viewer_set_range(list, &v->camera))
        list->count = 0;
    return STRL_OK;
}

static strl_gui_facts gather_facts(const viewer *v, const strl_render_stats *drawn)
{
    const strl_walk_stats *walk = strl_walk_get_stats(v->model.walk);
    return (strl_gui_facts){
        .model = v->desc.path,
        .device = v->device,
        .model_triangles = v->model.triangles,
        .fps = v->clock.fps,
        .frame_ms = v->clock.frame_ms,
        .select_ms = v->clock.select_mean_ms,
        .idle = v->resting,
        .triangles = drawn->triangles,
        .resident_bytes = walk->resident_bytes,
        .memory_bytes = v->desc.memory_bytes,
        .gpu_bytes = drawn->gpu_bytes,
        .gpu_memory_bytes = v->desc.gpu_memory_bytes,
        .faults = walk->faults,
        .nodes = walk->nodes,
        .nodes_culled = walk->nodes_culled,
        .draws = drawn->draws,
        .requests = walk->requests_pending,
        .missing_nodes = walk->missing_nodes,
        .allowed_error_px = walk->allowed_error_px,
        .max_error_px = walk->max_error_px,
        .speed = v->navigator.speed,
        .last_fault = walk->last_fault,
        .keys = strl_viewer_keys,
        .message = strl_clock_ns() < v->message_end_ns ? v->message : "",
    };
}

static void show_panel(viewer *v, const strl_render_stats *drawn)
{
    float lines[STRL_FRUSTUM_LINES][4];
    strl_gui_facts facts = gather_facts(v, drawn);
    facts.lines = (const float(*)[4])lines;
    if (v->controls.frozen)
        facts.line_count = strl_frustum_lines(&v->frozen, v->frozen_far, &v->camera, lines);
    strl_gui_show(v->gui, &facts, &v->controls);
    strl_window_set_taken(v->window, strl_gui_takes_mouse(v->gui), strl_gui_takes_keyboard(v->gui));
}

static void tell(viewer *v, uint64_t start_ns, double asked_px, uint64_t triangles)
{
    const strl_walk_stats *walk = strl_walk_get_stats(v->model.walk);
    const strl_viewer_frame frame = {.frame_ns = strl_clock_ns() - start_ns,
                                     .select_ns = walk->select_ns,
                                     .triangles = triangles,
                                     .missing_nodes = walk->missing_nodes,
                                     .asked_px = asked_px,
                                     .allowed_px = walk->allowed_error_px,
                                     .max_error_px = walk->max_error_px};
    v->frames_shown++;
    if (v->desc.shown)
        v->desc.shown(v->desc.context, &frame);
}

static strl_status draw_frame(viewer *v, strl_error *err)
{
    uint64_t start_ns = strl_clock_ns();
    double asked_px = v->controls.error_px; /* the panel may change it for the next frame */
    strl_draw_list list;
    strl_render_stats drawn;
    strl_draw_options options = draw_options(v);
    v->camera = strl_navigator_camera(&v->navigator, v->size[0], v->size[1]);
    strl_status status = select_nodes(v, &list, err);
    if (status == STRL_OK)
        status = strl_renderer_draw(v->renderer, &v->camera, &list, &options, &drawn, err);
    if (status == STRL_OK)
        status = strl_renderer_present(v->renderer, v->size[0], v->size[1], err);
    if (status != STRL_OK)
        return status;
    if (v->controls.screenshot)
        take_screenshot(v);
    v->controls.screenshot = false;
    show_panel(v, &drawn);
    strl_window_swap(v->window);
    tell(v, start_ns, asked_px, drawn.triangles);
    return STRL_OK;
}

/* ---- the loop */

/* Rests when the picture is the wanted one and nothing has happened for a few frames. */
static double decide_wait(viewer *v, bool drawable)
{
    bool still = v->desc.frames == 0 && v->frames_left == 0 && strl_walk_settled(v->model.walk);
    if (!drawable || still) {
        v->resting = true;
        v->clock.last_ns = 0;
        return IDLE_SECONDS;
    }
    v->resting = false;
    v->frames_left -= v->frames_left > 0;
    return 0;
}

static strl_status run_loop(viewer *v, strl_error *err)
{
    strl_status status = STRL_OK;
    bool quit = false, drawable = true;
    double wait = 0;
    while (status == STRL_OK && !quit && !strl_window_should_close(v->window)) {
        strl_window_input input;
        strl_window_take_input(v->window, wait, &input);
        double seconds = tick(&v->clock);
        if (input.touched)
            v->frames_left = FRAMES_AFTER_INPUT;
        for (unsigned a = 0; a < input.action_count; a++)
            quit = obey(v, input.actions[a]) || quit;
        status = fit_size(v, &drawable, err);
        if (status == STRL_OK && drawable) {
            obey_controls(v);
            move(v, &input, seconds);
            status = draw_frame(v, err);
        }
        quit = quit || (v->desc.frames > 0 && v->frames_shown >= v->desc.frames);
        wait = decide_wait(v, drawable);
    }
    return status;
}

static strl_status open_window(viewer *v, strl_error *err)
{
    char title[256];
    const char *slash = strrchr(v->desc.path, '/');
    snprintf(title, sizeof title, "%.200s - Stroll", slash ? slash + 1 : v->desc.path);
    const strl_window_desc window = {
        .title = title, .size = {v->desc.size[0], v->desc.size[1]}, .gl3 = v->desc.backend == STRL_BACKEND_GL3};
    strl_status status = strl_window_create(&window, &v->window, err);
    if (status != STRL_OK)
        return status;
    strl_window_framebuffer_size(v->window, v->size);
    const strl_renderer_desc desc = {.backend = v->desc.backend,
                                     .width = v->size[0] ? v->size[0] : 1,
                                     .height = v->size[1] ? v->size[1] : 1,
                                     .gpu_memory_bytes = v->desc.gpu_memory_bytes,
                                     .current_context = true};
    status = strl_renderer_create(&desc, &v->renderer, err);
    if (status == STRL_OK)
        status = strl_gui_create(strl_window_handle(v->window), strl_window_text_scale(v->window), &v->gui, err);
    if (status == STRL_OK)
        snprintf(v->device, sizeof v->device, "%s, %s", strl_renderer_device(v->renderer),
                 strl_renderer_backend(v->renderer) == STRL_BACKEND_GL45 ? "OpenGL 4.5" : "OpenGL 3.3");
    return status;
}

static void complete(strl_viewer_desc *desc)
{
    desc->screenshots = desc->screenshots ? desc->screenshots : ".";
    desc->size[0] = desc->size[0] ? desc->size[0] : DEFAULT_WIDTH;
    desc->size[1] = desc->size[1] ? desc->size[1] : DEFAULT_HEIGHT;
    desc->error_px = desc->error_px > 0 ? desc->error_px : 1;
    desc->memory_bytes = desc->memory_bytes ? desc->memory_bytes : DEFAULT_BYTES;
    desc->gpu_memory_bytes = desc->gpu_memory_bytes ? desc->gpu_memory_bytes : DEFAULT_BYTES;
}

strl_status strl_viewer_run(const strl_viewer_desc *desc, strl_error *err)
{
    viewer v = {.desc = *desc, .frames_left = FRAMES_AFTER_INPUT};
    complete(&v.desc);
    if (v.desc.backend == STRL_BACKEND_NULL)
        return strl__fail(err, STRL_ERR_ARGUMENT, "the null renderer draws nothing that a window could show");
    strl_status status = strl_viewer_model_open(&v.model, v.desc.path, v.desc.memory_bytes, v.desc.error_px, err);
    if (status != STRL_OK)
        return strl_name_file(v.desc.path, status, err);
    reset(&v);
    status = open_window(&v, err);
    if (status == STRL_OK)
        status = run_loop(&v, err);
    strl_gui_destroy(v.gui);
    strl_renderer_destroy(v.renderer);
    strl_window_destroy(v.window);
    strl_viewer_model_close(&v.model);
    return status;
}
