/* A GL context without a window. A window's context needs none of this: see strl_renderer_desc.current_context. */
#ifndef STRL_RENDER_GLCOMMON_CONTEXT_H
#define STRL_RENDER_GLCOMMON_CONTEXT_H

#include <stdbool.h>

#include "stroll/error.h"

typedef struct strl_gl_context strl_gl_context;

typedef struct strl_gl_context_desc {
    bool gles;        /* OpenGL ES instead of OpenGL core */
    int major, minor; /* least version */
} strl_gl_context_desc;

/* Makes it current. STRL_ERR_UNSUPPORTED where the system has no such context. */
strl_status strl__gl_context_create(const strl_gl_context_desc *desc, strl_gl_context **context, strl_error *err);
void strl__gl_context_make_current(strl_gl_context *context); /* NULL: leaves the caller's alone */
void strl__gl_context_destroy(strl_gl_context *context);      /* NULL is legal */

#endif
