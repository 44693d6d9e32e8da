/* The window's life and loop. Frames stop while nothing moves. */
#include "viewer/viewer.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "platform/thread.h"
#include "viewer/internal.h"

#define DEFAULT_WIDTH 1280u
#define DEFAULT_HEIGHT 720u
#define DEFAULT_BYTES (512ull << 20)
#define MOST_SIDE 16384u
#define MESSAGE_SECONDS 4.0
#define IDLE_SECONDS 0.5
#define BUILD_SECONDS 0.1 /* between two looks at what another thread does */
#define AVERAGE_SECONDS 0.5

const char strl_viewer_keys[] =
    "orbit          left drag turns, right drag shifts, wheel zooms\n"
    "fly, walk      W A S D move (Q E down and up), right drag looks, wheel sets the speed,\n"
    "               Shift is faster; a walker's eyes are 1.7 m above what lies below\n"
    "O F G          orbit, fly, walk\n"
    "5              orthographic or perspective\n"
    "H R            home: look at the whole model; reset everything\n"
    "click          picks: part, material, coordinates; two picks give a distance\n"
    "double click   looks at the part; so does V\n"
    "Backspace      forgets the picks\n"
    "T              list of parts\n"
    "Del I U        hide the selected part, show it alone, show all\n"
    "K J            section on and off; along the surface of the newest pick\n"
    ", .            move the section\n"
    "B N            bookmark this view; go to the next one\n"
    "M Space        record a path, and end and save it; replay it\n"
    "+ -            larger, smaller pixel error\n"
    "1 2 3 0        colours by cluster, level, error; of the model\n"
    "X L            wireframe; flat or smooth\n"
    "C              freeze what is selected and culled, and look at it from elsewhere\n"
    "P              save the picture as PNG\n"
    "drop a file    opens a container; builds one of a mesh first\n"
    "F1             this help\n"
    "Esc            cancel a build; quit\n";

void strl__viewer_say(strl__viewer *v, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(v->message, sizeof v->message, format, arguments);
    va_end(arguments);
    v->message_end_ns = strl_clock_ns() + (uint64_t)(MESSAGE_SECONDS * 1e9);
    strl_journal_write(v->journal, "said", json_pack("{s:o}", "text", strl_journal_text(v->message)));
}

/* ---- the loop */

static double tick(strl__frame_clock *clock)
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
static strl_status fit_size(strl__viewer *v, bool *drawable, strl_error *err)
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

/* With the cursor, by which a script knows that all it did before it moved there has been seen. */
static void tell_rest(strl__viewer *v)
{
    double cursor[2];
    strl_window_cursor(v->window, cursor);
    if (v->stirred)
        strl_journal_write(
            v->journal, "rest",
            json_pack("{s:[f,f],s:I}", "cursor", cursor[0], cursor[1], "frames", (json_int_t)v->frames_shown));
    v->stirred = false;
}

/* At rest the picture stays, unless people wait for something: a build, a part, a cursor that blinks where they type,
 * nodes that are asked for again. */
static bool needs_frame(const strl__viewer *v)
{
    const strl_walk_stats *walk = strl_walk_get_stats(v->model->walk);
    return !v->resting || v->frames_left > 0 || !v->shows_rest || v->news.state == STRL_OPENER_BUILDS ||
           v->look_waits || walk->missing_nodes > 0 || walk->requests_pending > 0 || strl_gui_takes_keyboard(v->gui);
}

/* Rests when the picture is the wanted one and nothing has happened for a few frames. */
static double decide_wait(strl__viewer *v, bool drawable)
{
    bool still = v->desc.frames == 0 && v->frames_left == 0 && strl_walk_settled(v->model->walk);
    if (!drawable || still) {
        v->resting = true;
        v->clock.last_ns = 0;
        tell_rest(v);
        return v->news.state == STRL_OPENER_BUILDS || v->look_waits ? BUILD_SECONDS : IDLE_SECONDS;
    }
    v->resting = false;
    v->stirred = true;
    v->frames_left -= v->frames_left > 0;
    return 0;
}

static void take_dropped(strl__viewer *v, const strl_window_input *input)
{
    strl_error err = {0};
    if (input->dropped_count == 0)
        return;
    if (!input->dropped[0])
        strl__viewer_say(v, "the path of the dropped file is too long");
    else if (strl_opener_start(v->opener, input->dropped, false, &err) != STRL_OK)
        strl__viewer_say(v, "%s", err.message);
    else if (input->dropped_count > 1)
        strl__viewer_say(v, "%s is opened, the other %u files are not", input->dropped, input->dropped_count - 1);
}

/* What keys, mouse and the panels of the last frame ask for. True: quit. */
static bool take_wishes(strl__viewer *v, const strl_window_input *input)
{
    const strl_requests asked[2] = {v->controls.requests, input->requests};
    bool quit = false;
    if (input->touched || asked[0].count > 0)
        v->frames_left = STRL__FRAMES_AFTER_INPUT;
    v->controls.requests.count = 0;
    /* What was clicked is what the last picture showed. */
    for (unsigned c = 0; c < input->click_count; c++)
        strl__viewer_click(v, &input->clicks[c]);
    for (int from = 0; from < 2; from++)
        for (uint32_t r = 0; r < asked[from].count; r++)
            quit = strl__viewer_obey(v, asked[from].items[r]) || quit;
    take_dropped(v, input);
    strl__viewer_poll_opener(v);
    strl__viewer_poll_index(v);
    return quit;
}

static strl_status run_loop(strl__viewer *v, strl_error *err)
{
    strl_status status = STRL_OK;
    bool quit = false, drawable = true;
    double wait = 0;
    while (status == STRL_OK && !quit && !strl_window_should_close(v->window)) {
        strl_window_input input;
        strl_window_take_input(v->window, wait, &input);
        double seconds = tick(&v->clock);
        quit = take_wishes(v, &input);
        status = fit_size(v, &drawable, err);
        if (status == STRL_OK && drawable && needs_frame(v)) {
            if (strl__viewer_move(v, &input, seconds) && v->frames_left == 0)
                v->frames_left = 1;
            status = strl__viewer_draw(v, err);
        }
        quit = quit || (v->desc.frames > 0 && v->frames_shown >= v->desc.frames);
        wait = decide_wait(v, drawable);
    }
    return status;
}

/* ---- life */

static strl_status open_window(strl__viewer *v, strl_error *err)
{
    const strl_window_desc window = {
        .title = "Stroll", .size = {v->desc.size[0], v->desc.size[1]}, .gl3 = v->desc.backend == STRL_BACKEND_GL3};
    strl_status status = strl_window_create(&window, &v->window, err);
    if (status != STRL_OK)
        return status;
    strl_window_framebuffer_size(v->window, v->size);
    status = strl__viewer_make_renderer(v, err);
    v->text_scale = strl_window_text_scale(v->window) * v->controls.text_scale;
    if (status == STRL_OK)
        status = strl_gui_create(strl_window_handle(v->window), v->text_scale, &v->gui, err);
    if (status == STRL_OK)
        snprintf(v->device, sizeof v->device, "%s, %s", strl_renderer_device(v->renderer),
                 strl_renderer_backend(v->renderer) == STRL_BACKEND_GL45 ? "OpenGL 4.5" : "OpenGL 3.3");
    return status;
}

/* The command line before the settings before the defaults. */
static void complete(strl_viewer_desc *desc, const strl_settings *settings)
{
    const uint32_t sides[2] = {DEFAULT_WIDTH, DEFAULT_HEIGHT};
    bool known = settings->size[0] > 0 && settings->size[1] > 0;
    for (int i = 0; i < 2; i++)
        desc->size[i] = desc->size[i] ? desc->size[i] : known ? settings->size[i] : sides[i];
    desc->screenshots = desc->screenshots ? desc->screenshots : ".";
    if (!(desc->error_px > 0))
        desc->error_px = settings->error_px > 0 ? settings->error_px : 1;
    if (!desc->memory_bytes)
        desc->memory_bytes = settings->memory_bytes ? settings->memory_bytes : DEFAULT_BYTES;
    if (!desc->gpu_memory_bytes)
        desc->gpu_memory_bytes = settings->gpu_memory_bytes ? settings->gpu_memory_bytes : DEFAULT_BYTES;
    desc->error_px = (float)desc->error_px; /* as the slider has it: so it is seen whether somebody has moved it */
}

static void begin_controls(strl__viewer *v)
{
    v->begun = v->desc;
    v->controls.memory_mib = (float)v->desc.memory_bytes / (1 << 20);
    v->controls.gpu_memory_mib = (float)v->desc.gpu_memory_bytes / (1 << 20);
    v->controls.text_scale = v->settings.text_scale > 0 ? (float)v->settings.text_scale : 1;
    v->controls.parts = v->settings.show_parts;
}

static strl_status open_viewer(strl__viewer *v, strl_error *err)
{
    strl_error slip = {0};
    strl_status status = strl_journal_open(v->desc.journal, &v->journal, err);
    if (status != STRL_OK)
        return status;
    strl_status remembers = strl_settings_load(&v->settings, v->desc.settings, &slip);
    complete(&v->desc, &v->settings);
    begin_controls(v);
    status = strl_opener_create(v->desc.cache, &v->opener, err);
    if (status == STRL_OK)
        status = strl__viewer_open_model(v, v->desc.location.name, err);
    if (status == STRL_OK && v->desc.camera_path)
        status = strl_recorder_load(&v->recorder, v->desc.camera_path, err);
    if (status == STRL_OK)
        status = open_window(v, err);
    if (status != STRL_OK)
        return status;
    v->controls.orthographic = v->settings.orthographic;
    v->begun_controls = v->controls;
    strl__viewer_set_title(v);
    if (remembers != STRL_OK)
        strl__viewer_say(v, "%s", slip.message);
    if (v->desc.camera_path)
        strl__viewer_toggle_replay(v);
    return STRL_OK;
}

static void close_viewer(strl__viewer *v)
{
    strl_opener_destroy(v->opener);
    strl_part_index_destroy(v->index);
    strl_gui_destroy(v->gui);
    strl_renderer_destroy(v->renderer);
    strl_window_destroy(v->window);
    if (v->model)
        strl_viewer_model_close(v->model);
    strl__free(v->model);
    strl_parts_deinit(&v->parts);
    strl_recorder_deinit(&v->recorder);
    strl_settings_deinit(&v->settings);
    strl_journal_close(v->journal);
    strl__free(v);
}

strl_status strl_viewer_run(const strl_viewer_desc *desc, strl_error *err)
{
    if (desc->backend == STRL_BACKEND_NULL)
        return strl__fail(err, STRL_ERR_ARGUMENT, "the null renderer draws nothing that a window could show");
    strl__viewer *v = strl__alloc_zero(1, sizeof *v);
    if (!v)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a viewer");
    v->desc = *desc;
    v->frames_left = STRL__FRAMES_AFTER_INPUT;
    v->reveal = UINT32_MAX;
    strl_status status = open_viewer(v, err);
    if (status == STRL_OK) {
        status = run_loop(v, err);
        strl__viewer_end_recording(v);
        strl__viewer_remember(v, false);
    }
    close_viewer(v);
    return status;
}
