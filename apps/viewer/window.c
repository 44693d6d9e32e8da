#include "viewer/window.h"

#include <epoxy/gl.h>
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"

struct strl_window {
    GLFWwindow *handle;
    strl_window_input pending;
    double cursor[2]; /* where it was last */
    bool dragging[2]; /* left, right: went down outside the panel */
    bool mouse_taken, keyboard_taken;
};

static const struct {
    int key;
    strl_action action;
} bindings[] = {
    {GLFW_KEY_O, STRL_ACTION_ORBIT},         {GLFW_KEY_F, STRL_ACTION_FLY},
    {GLFW_KEY_H, STRL_ACTION_HOME},          {GLFW_KEY_R, STRL_ACTION_RESET},
    {GLFW_KEY_0, STRL_ACTION_NO_COLOURS},    {GLFW_KEY_1, STRL_ACTION_CLUSTER_COLOURS},
    {GLFW_KEY_2, STRL_ACTION_LEVEL_COLOURS}, {GLFW_KEY_3, STRL_ACTION_ERROR_COLOURS},
    {GLFW_KEY_X, STRL_ACTION_WIREFRAME},     {GLFW_KEY_L, STRL_ACTION_FLAT},
    {GLFW_KEY_C, STRL_ACTION_FREEZE},        {GLFW_KEY_P, STRL_ACTION_SCREENSHOT},
    {GLFW_KEY_F1, STRL_ACTION_HELP},         {GLFW_KEY_ESCAPE, STRL_ACTION_QUIT},
};

/* ---- what GLFW tells */

static void add_action(strl_window *window, strl_action action)
{
    strl_window_input *input = &window->pending;
    if (input->action_count < STRL_WINDOW_MOST_ACTIONS)
        input->actions[input->action_count++] = action;
}

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
            add_action(window, bindings[b].action);
}

/* By character: plus and minus lie elsewhere on each keyboard. A held key repeats. */
static void on_character(GLFWwindow *handle, unsigned character)
{
    strl_window *window = glfwGetWindowUserPointer(handle);
    window->pending.touched = true;
    if (window->keyboard_taken)
        return;
    if (character == '+' || character == '=')
        add_action(window, STRL_ACTION_COARSER);
    else if (character == '-')
        add_action(window, STRL_ACTION_FINER);
}

static void on_button(GLFWwindow *handle, int button, int action, int modifiers)
{
    (void)modifiers;
    strl_window *window = glfwGetWindowUserPointer(handle);
    window->pending.touched = true;
    if (button == GLFW_MOUSE_BUTTON_LEFT || button == GLFW_MOUSE_BUTTON_RIGHT)
        window->dragging[button == GLFW_MOUSE_BUTTON_RIGHT] = action == GLFW_PRESS && !window->mouse_taken;
}

/* Drags are summed here and not from frame to frame, so that a slow frame loses nothing. */
static void on_cursor(GLFWwindow *handle, double x, double y)
{
    strl_window *window = glfwGetWindowUserPointer(handle);
    double scale = strl_window_pixel_scale(window), dx = (x - window->cursor[0]) * scale,
           dy = (y - window->cursor[1]) * scale;
    strl_window_input *input = &window->pending;
    input->touched = true;
    if (window->dragging[0])
        input->left[0] += dx, input->left[1] += dy;
    if (window->dragging[1])
        input->right[0] += dx, input->right[1] += dy;
    window->cursor[0] = x;
    window->cursor[1] = y;
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
    if (window->keyboard_taken)
        return;
    input->way[0] = held(window, GLFW_KEY_D, GLFW_KEY_A);
    input->way[1] = held(window, GLFW_KEY_E, GLFW_KEY_Q);
    input->way[2] = held(window, GLFW_KEY_W, GLFW_KEY_S);
    input->fast = glfwGetKey(window->handle, GLFW_KEY_LEFT_SHIFT) == GLFW_PRESS ||
                  glfwGetKey(window->handle, GLFW_KEY_RIGHT_SHIFT) == GLFW_PRESS;
    if (input->way[0] != 0 || input->way[1] != 0 || input->way[2] != 0)
        input->touched = true;
}

void strl_window_swap(strl_window *window)
{
    glfwSwapBuffers(window->handle);
}
