/* What both GL backends share: context, programs, target, table of nodes, and all of the renderer's calls but draw. */
#ifndef STRL_RENDER_GLCOMMON_GL_H
#define STRL_RENDER_GLCOMMON_GL_H

#include "render/cache.h"
#include "render/glcommon/context.h"
#include "render/glcommon/item.h"
#include "render/glcommon/program.h"
#include "render/glcommon/target.h"
#include "render/renderer.h"

typedef struct strl_gl {
    strl_renderer base;
    strl_gl_context *context; /* owned; NULL where the caller's is used */
    strl_gl_dialect dialect;
    strl_gl_target target;
    strl_gl_program programs[STRL_GL_PROGRAM_KINDS];
    strl_gl_projection projection; /* of the last draw */
    strl_cache cache;
} strl_gl;

/* gl is zeroed and starts the backend's struct. On failure nothing is left to release. */
strl_status strl__gl_init(strl_gl *gl, const strl_renderer_class *klass, const strl_renderer_desc *desc,
                          strl_error *err);
/* The backend has released the places of the cache's entries. */
void strl__gl_deinit(strl_gl *gl);
void strl__gl_make_current(strl_gl *gl);

/* Whether the draw has a plane that cuts. */
bool strl__gl_has_section(const strl_draw_setup *setup);
/* The winding of the fronts of what is drawn next; of a draw that culls. */
void strl__gl_set_fronts(bool mirrors);
/* Everything but the items: state, target, uniforms of both node programs. */
void strl__gl_begin_draw(strl_gl *gl, const strl_draw_setup *setup);
/* Leaves the context as others expect to find it. Fails where GL has recorded an error. */
strl_status strl__gl_end_draw(strl_gl *gl, strl_error *err);

void strl__gl_finish(strl_renderer *renderer);
strl_status strl__gl_resize(strl_renderer *renderer, strl_error *err);
strl_status strl__gl_read_colour(strl_renderer *renderer, uint8_t *rgba, strl_error *err);
strl_status strl__gl_read_depth(strl_renderer *renderer, float *depth, strl_error *err);
strl_status strl__gl_present(strl_renderer *renderer, uint32_t width, uint32_t height, strl_error *err);

#endif
