#include "viewer/window.h"

#include <epoxy/gl.h>
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"

/* Screen units and seconds. */
#define DRAG_UNITS 4.0
#define TWICE_SECONDS 0.35

struct strl_window {
    GLFWwindow *handle;
    strl_window_input pending;
    double cursor[2];  /* where it was last */
    bool dragging[2];  /* left, right: went down outside the panel */
    double pressed[2]; /* where the left button went down, then as far as its drag has been told */
    bool moved;        /* too far since then for a click */
    double clicked[2], click_time;
    bool mouse_taken, keyboard_taken;
};

static const struct {
    int key;
    strl_action action;
} bindings[] = {
    {GLFW_KEY_O, STRL_ACTION_ORBIT},
    {GLFW_KEY_F, STRL_ACTION_FLY},
    {GLFW_KEY_G, STRL_ACTION_WALK},
    {GLFW_KEY_5, STRL_ACTION_ORTHOGRAPHIC},
    {GLFW_KEY_H, STRL_ACTION_HOME},
    {GLFW_KEY_R, STRL_ACTION_RESET},
    {GLFW_KEY_V, STRL_ACTION_LOOK},
    {GLFW_KEY_0, STRL_ACTION_NO_COLOURS},
    {GLFW_KEY_1, STRL_ACTION_CLUSTER_COLOURS},
    {GLFW_KEY_2, STRL_ACTION_LEVEL_COLOURS},
    {GLFW_KEY_3, STRL_ACTION_ERROR_COLOURS},
    {GLFW_KEY_X, STRL_ACTION_WIREFRAME},
    {GLFW_KEY_L, STRL_ACTION_FLAT},
    {GLFW_KEY_C, STRL_ACTION_FREEZE},
    {GLFW_KEY_P, STRL_ACTION_SCREENSHOT},
    {GLFW_KEY_BACKSPACE, STRL_ACTION_FORGET_PICKS},
    {GLFW_KEY_T, STRL_ACTION_PARTS},
    {GLFW_KEY_DELETE, STRL_ACTION_HIDE},
    {GLFW_KEY_I, STRL_ACTION_ISOLATE},
    {GLFW_KEY_U, STRL_ACTION_SHOW_ALL},
    {GLFW_KEY_K, STRL_ACTION_SECTION},
    {GLFW_KEY_J, STRL_ACTION_SECTION_NORMAL},
    {GLFW_KEY_B, STRL_ACTION_BOOKMARK},
    {GLFW_KEY_N, STRL_ACTION_NEXT_BOOKMARK},
    {GLFW_KEY_M, STRL_ACTION_RECORD},
    {GLFW_KEY_SPACE, STRL_ACTION_REPLAY},
    {GLFW_KEY_F1, STRL_ACTION_HELP},
    {GLFW_KEY_ESCAPE, STRL_ACTION_QUIT},
};

/* By what is written on them, which lies elsewhere on each keyboard; these repeat while held. */
static const struct {
    unsigned character;
    strl_action action;
} characters[] = {
    {'+', STRL_ACTION_COARSER},       {'=', STRL_ACTION_COARSER},      {'-', STRL_ACTION_FINER},
    {'.', STRL_ACTION_SECTION_FORTH}, {',', STRL_ACTION_SECTION_BACK},
};

/* ---- what GLFW tells */

static void on_key(GLFWwindow *handle, int key, int scancode, int action, int modifiers)
{
    (void)scancode;
    strl_window *window = glfwGetWindowUserPointer(handle);
    window->pending.touched = true;
    if (action != GLFW_PRESS || window->keyboard_taken ||
        (modifiers & (GLFW_MOD_CONTROL | GLFW_MOD_ALT | GLFW_MOD_SUPER)))
        return;
    for (size_t b = 0; b < sizeof bindings / sizeof *bindings; b++)
        if (bindings[b].key == key)
            strl_requests_add(&window->pending.requests, bindings[b].action, STRL_ACTION_SELECTION);
}

static void on_character(GLFWwindow *handle, unsigned character)
{
    strl_window *window = glfwGetWindowUserPointer(handle);
    window->pending.touched = true;
    for (size_t c = 0; !window->keyboard_taken && c < sizeof characters / sizeof *characters; c++)
        if (characters[c].character == character)
            strl_requests_add(&window->pending.requests, characters[c].action, 0);
}

static void add_click(strl_window *window)
{
    strl_window_input *input = &window->pending;
    double scale = strl_window_pixel_scale(window), now = glfwGetTime();
    bool near = hypot(window->cursor[0] - window->clicked[0], window->cursor[1] - window->clicked[1]) < DRAG_UNITS;
    bool twice = near && now - window->click_time < TWICE_SECONDS;
    window->click_time = twice ? -TWICE_SECONDS : now; /* a third one is a first one */
    memcpy(window->clicked, window->cursor, sizeof window->clicked);
    if (input->click_count < STRL_WINDOW_MOST_CLICKS)
        input->clicks[input->click_count++] =
            (strl_click){{window->cursor[0] * scale, window->cursor[1] * scale}, twice};
}

static void on_button(GLFWwindow *handle, int button, int action, int modifiers)
{
    (void)modifiers;
    strl_window *window = glfwGetWindowUserPointer(handle);
    window->pending.touched = true;
    if (button != GLFW_MOUSE_BUTTON_LEFT && button != GLFW_MOUSE_BUTTON_RIGHT)
        return;
    bool right = button == GLFW_MOUSE_BUTTON_RIGHT, down = action == GLFW_PRESS;
    if (!right && !down && window->dragging[0] && !window->moved)
        add_click(window);
    window->dragging[right] = down && !window->mouse_taken;
    if (!right) {
        window->moved = false;
        memcpy(window->pressed, window->cursor, sizeof window->pressed);
    }
}

/* Drags are summed here and not from frame to frame, so that a slow frame loses nothing. A hand that clicks trembles:
 * the first few units of a left drag count when it turns out to be one. */
static void on_cursor(GLFWwindow *handle, double x, double y)
{
    strl_window *window = glfwGetWindowUserPointer(handle);
    double scale = strl_window_pixel_scale(window);
    strl_window_input *input = &window->pending;
    input->touched = true;
    if (window->dragging[1]) {
        input->right[0] += (x - window->cursor[0]) * scale;
        input->right[1] += (y - window->cursor[1]) * scale;
    }
    window->cursor[0] = x;
    window->cursor[1] = y;
    window->moved = window->moved || hypot(x - window->pressed[0], y - window->pressed[1]) >= DRAG_UNITS;
    if (!window->dragging[0] || !window->moved)
        return;
    input->left[0] += (x - window->pressed[0]) * scale;
    input->left[1] += (y - window->pressed[1]) * scale;
    memcpy(window->pressed, window->cursor, sizeof window->pressed);
}

static void on_drop(GLFWwindow *handle, int count, const char **paths)
{
    strl_window *window = glfwGetWindowUserPointer(handle);
    window->pending.touched = true;
    if (count < 1)
        return;
    size_t bytes = strlen(paths[0]);
    window->pending.dropped_count = (unsigned)count;
    bytes = bytes < sizeof window->pending.dropped ? bytes : 0;
    memcpy(window->pending.dropped, paths[0], bytes);
    window->pending.dropped[bytes] = 0;
}

static void on_scroll(GLFWwindow *handle, double x, double y)
{
    (void)x;
    strl_window *window = glfwGetWindowUserPointer(handle);
    window->pending.touched = true;
    if (!window->mouse_taken)
        window->pending.wheel += y;
}

static void on_change(GLFWwindow *handle)
{
    strl_window *window = glfwGetWindowUserPointer(handle);
    window->pending.touched = true;
}

static void on_resize(GLFWwindow *handle, int width, int height)
{
    (void)width, (void)height;
    on_change(handle);
}

static void on_focus(GLFWwindow *handle, int focused)
{
    (void)focused;
    on_change(handle);
}

static void install_callbacks(strl_window *window)
{
    glfwSetWindowUserPointer(window->handle, window);
    glfwSetKeyCallback(window->handle, on_key);
    glfwSetCharCallback(window->handle, on_character);
    glfwSetMouseButtonCallback(window->handle, on_button);
    glfwSetCursorPosCallback(window->handle, on_cursor);
    glfwSetScrollCallback(window->handle, on_scroll);
    glfwSetDropCallback(window->handle, on_drop);
    glfwSetFramebufferSizeCallback(window->handle, on_resize);
    glfwSetWindowFocusCallback(window->handle, on_focus);
    glfwSetWindowRefreshCallback(window->handle, on_change);
    glfwSetInputMode(window->handle, GLFW_STICKY_KEYS, GLFW_TRUE); /* a tap between two slow frames still counts */
    glfwGetCursorPos(window->handle, &window->cursor[0], &window->cursor[1]);
}

/* ---- making it */

static const char *last_complaint(void)
{
    const char *text = NULL;
    glfwGetError(&text);
    return text ? text : "the system gives no reason";
}

static GLFWwindow *open_handle(const strl_window_desc *desc, int major, int minor)
{
    glfwDefaultWindowHints();
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, major);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, minor);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    glfwWindowHint(GLFW_OPENGL_FORWARD_COMPAT, GLFW_TRUE);
    /* The renderer has a target of its own; the window only takes the finished picture. */
    glfwWindowHint(GLFW_DEPTH_BITS, 0);
    glfwWindowHint(GLFW_STENCIL_BITS, 0);
    return glfwCreateWindow((int)desc->size[0], (int)desc->size[1], desc->title, NULL, NULL);
}

strl_status strl_window_create(const strl_window_desc *desc, strl_window **window, strl_error *err)
{
    *window = NULL;
    strl_window *made = strl__alloc_zero(1, sizeof *made);
    if (!made)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a window");
    if (!glfwInit()) {
        strl__free(made);
        return strl__fail(err, STRL_ERR_UNSUPPORTED,
                          "no window can be opened: %s (stroll render draws without a display)", last_complaint());
    }
    if (!desc->gl3)
        made->handle = open_handle(desc, 4, 5);
    if (!made->handle)
        made->handle = open_handle(desc, 3, 3);
    if (!made->handle) {
        strl_status status = strl__fail(err, STRL_ERR_UNSUPPORTED,
                                        "no window with OpenGL 3.3 or later can be opened: %s", last_complaint());
        strl_window_destroy(made);
        return status;
    }
    glfwMakeContextCurrent(made->handle);
    glfwSwapInterval(1);
    install_callbacks(made);
    made->click_time = -TWICE_SECONDS;
    *window = made;
    return STRL_OK;
}

void strl_window_destroy(strl_window *window)
{
    if (!window)
        return;
    if (window->handle)
        glfwDestroyWindow(window->handle);
    glfwTerminate();
    strl__free(window);
}

/* ---- using it */

struct GLFWwindow *strl_window_handle(strl_window *window)
{
    return window->handle;
}

void strl_window_framebuffer_size(const strl_window *window, uint32_t size[2])
{
    int width = 0, height = 0;
    glfwGetFramebufferSize(window->handle, &width, &height);
    size[0] = width > 0 ? (uint32_t)width : 0;
    size[1] = height > 0 ? (uint32_t)height : 0;
}

void strl_window_size(const strl_window *window, uint32_t size[2])
{
    int width = 0, height = 0;
    glfwGetWindowSize(window->handle, &width, &height);
    size[0] = width > 0 ? (uint32_t)width : 0;
    size[1] = height > 0 ? (uint32_t)height : 0;
}

void strl_window_set_title(strl_window *window, const char *title)
{
    glfwSetWindowTitle(window->handle, title);
}

double strl_window_pixel_scale(const strl_window *window)
{
    int pixels = 0, units = 0, unused;
    glfwGetFramebufferSize(window->handle, &pixels, &unused);
    glfwGetWindowSize(window->handle, &units, &unused);
    return units > 0 && pixels > 0 ? (double)pixels / units : 1;
}

double strl_window_text_scale(const strl_window *window)
{
    float x = 1, y = 1;
    glfwGetWindowContentScale(window->handle, &x, &y);
    double scale = y / strl_window_pixel_scale(window);
    return scale > 0.5 && scale < 8 ? scale : 1;
}

void strl_window_cursor(const strl_window *window, double at[2])
{
    memcpy(at, window->cursor, sizeof window->cursor);
}

bool strl_window_should_close(const strl_window *window)
{
    return glfwWindowShouldClose(window->handle);
}

void strl_window_set_taken(strl_window *window, bool mouse, bool keyboard)
{
    window->mouse_taken = mouse;
    window->keyboard_taken = keyboard;
}

static double held(const strl_window *window, int forth, int back)
{
    return (double)(glfwGetKey(window->handle, forth) == GLFW_PRESS) -
           (double)(glfwGetKey(window->handle, back) == GLFW_PRESS);
}

void strl_window_take_input(strl_window *window, double wait_seconds, strl_window_input *input)
{
    if (wait_seconds > 0)
        glfwWaitEventsTimeout(wait_seconds);
    else
        glfwPollEvents();
    *input = window->pending;
    window->pending = (strl_window_input){0};
    /* Asked also while a panel has the keyboard: a tap is kept until somebody asks, and would be a step later. */
    const double way[3] = {held(window, GLFW_KEY_D, GLFW_KEY_A), held(window, GLFW_KEY_E, GLFW_KEY_Q),
                           held(window, GLFW_KEY_W, GLFW_KEY_S)};
    if (window->keyboard_taken)
        return;
    memcpy(input->way, way, sizeof input->way);
    input->fast = glfwGetKey(window->handle, GLFW_KEY_LEFT_SHIFT) == GLFW_PRESS ||
                  glfwGetKey(window->handle, GLFW_KEY_RIGHT_SHIFT) == GLFW_PRESS;
    if (input->way[0] != 0 || input->way[1] != 0 || input->way[2] != 0)
        input->touched = true;
}

void strl_window_swap(strl_window *window)
{
    glfwSwapBuffers(window->handle);
}
