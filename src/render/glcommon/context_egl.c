/* Headless contexts by EGL: Mesa's surfaceless platform first, then the devices one by one. */
#include <epoxy/egl.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "render/glcommon/context.h"

#define MOST_DEVICES 16

struct strl_gl_context {
    EGLDisplay display; /* shared by the process and never terminated: other contexts may live on it */
    EGLContext context;
};

static bool has_client_extension(const char *name)
{
    const char *all = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
    return all && strstr(all, name) != NULL;
}

/* A context on the display, or EGL_NO_CONTEXT. */
static EGLContext create_on(EGLDisplay display, const strl_gl_context_desc *desc)
{
    EGLint major, minor, count = 0;
    if (display == EGL_NO_DISPLAY || !eglInitialize(display, &major, &minor))
        return EGL_NO_CONTEXT;
    if (!eglBindAPI(desc->gles ? EGL_OPENGL_ES_API : EGL_OPENGL_API))
        return EGL_NO_CONTEXT;
    const EGLint wanted[] = {EGL_SURFACE_TYPE, EGL_DONT_CARE, EGL_RENDERABLE_TYPE,
                             desc->gles ? EGL_OPENGL_ES3_BIT : EGL_OPENGL_BIT, EGL_NONE};
    EGLConfig config;
    if (!eglChooseConfig(display, wanted, &config, 1, &count) || count < 1)
        return EGL_NO_CONTEXT;
    const EGLint core[] = {EGL_CONTEXT_MAJOR_VERSION_KHR,
                           desc->major,
                           EGL_CONTEXT_MINOR_VERSION_KHR,
                           desc->minor,
                           EGL_CONTEXT_OPENGL_PROFILE_MASK_KHR,
                           EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT_KHR,
                           EGL_NONE};
    const EGLint embedded[] = {EGL_CONTEXT_MAJOR_VERSION_KHR, desc->major, EGL_CONTEXT_MINOR_VERSION_KHR, desc->minor,
                               EGL_NONE};
    EGLContext context = eglCreateContext(display, config, EGL_NO_CONTEXT, desc->gles ? embedded : core);
    if (context != EGL_NO_CONTEXT && !eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context)) {
        eglDestroyContext(display, context);
        context = EGL_NO_CONTEXT;
    }
    return context;
}

static bool create_on_devices(const strl_gl_context_desc *desc, strl_gl_context *made)
{
    EGLDeviceEXT devices[MOST_DEVICES];
    EGLint count = 0;
    if (!has_client_extension("EGL_EXT_device_enumeration") || !has_client_extension("EGL_EXT_platform_device") ||
        !eglQueryDevicesEXT(MOST_DEVICES, devices, &count))
        return false;
    for (EGLint d = 0; d < count; d++) {
        made->display = eglGetPlatformDisplayEXT(EGL_PLATFORM_DEVICE_EXT, devices[d], NULL);
        made->context = create_on(made->display, desc);
        if (made->context != EGL_NO_CONTEXT)
            return true;
    }
    return false;
}

strl_status strl__gl_context_create(const strl_gl_context_desc *desc, strl_gl_context **context, strl_error *err)
{
    *context = NULL;
    if (!has_client_extension("EGL_EXT_platform_base"))
        return strl__fail(err, STRL_ERR_UNSUPPORTED,
                          "this system's EGL has no platforms, so there is no context without a window");
    strl_gl_context *made = strl__alloc_zero(1, sizeof *made);
    if (!made)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a GL context");
    if (has_client_extension("EGL_MESA_platform_surfaceless")) {
        made->display = eglGetPlatformDisplayEXT(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, NULL);
        made->context = create_on(made->display, desc);
    }
    if (made->context == EGL_NO_CONTEXT && !create_on_devices(desc, made)) {
        strl__free(made);
        return strl__fail(err, STRL_ERR_UNSUPPORTED, "this system has no %s %d.%d context without a window",
                          desc->gles ? "OpenGL ES" : "OpenGL core", desc->major, desc->minor);
    }
    *context = made;
    return STRL_OK;
}

void strl__gl_context_make_current(strl_gl_context *context)
{
    if (context && eglGetCurrentContext() != context->context)
        eglMakeCurrent(context->display, EGL_NO_SURFACE, EGL_NO_SURFACE, context->context);
}

void strl__gl_context_destroy(strl_gl_context *context)
{
    if (!context)
        return;
    if (eglGetCurrentContext() == context->context)
        eglMakeCurrent(context->display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    eglDestroyContext(context->display, context->context);
    strl__free(context);
}
