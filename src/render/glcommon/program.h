/* Shader programs from the one source of shaders/, for whatever dialect the context speaks. */
#ifndef STRL_RENDER_GLCOMMON_PROGRAM_H
#define STRL_RENDER_GLCOMMON_PROGRAM_H

#include <epoxy/gl.h>
#include <stdbool.h>

#include "stroll/error.h"

/* What the context can do; decides version line and defines. */
typedef struct strl_gl_dialect {
    bool es;
    bool item_attributes; /* items as instanced attributes (4.5); else uniforms */
    bool symmetric_depth; /* no clip control: depth is written by the fragment shader */
} strl_gl_dialect;

typedef struct strl_gl_program {
    GLuint name;                                                                  /* 0 = not made yet */
    GLint projection, orthographic, sky_up, headlight, flat, section, rows, base; /* -1 where the program has none */
    GLint samples, factor;
} strl_gl_program;

typedef enum strl_gl_program_kind {
    STRL_GL_NODE,
    STRL_GL_NODE_ALPHA,
    STRL_GL_RESOLVE,
    STRL_GL_DEPTH,
    STRL_GL_PROGRAM_KINDS
} strl_gl_program_kind;

strl_status strl__gl_program_init(strl_gl_program *program, strl_gl_program_kind kind, const strl_gl_dialect *dialect,
                                  strl_error *err);
void strl__gl_program_deinit(strl_gl_program *program);

#endif
