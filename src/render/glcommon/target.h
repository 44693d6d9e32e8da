/* Where an image is drawn and how it comes back: colour and reversed float depth, supersampled, resolved in linear
 * light. */
#ifndef STRL_RENDER_GLCOMMON_TARGET_H
#define STRL_RENDER_GLCOMMON_TARGET_H

#include <epoxy/gl.h>
#include <stdint.h>

#include "render/glcommon/program.h"

typedef struct strl_gl_target {
    uint32_t width, height, factor;   /* output pixels; samples are factor times as many each way */
    GLuint samples, colour, depth;    /* framebuffer and its textures */
    GLuint resolved, resolved_colour; /* 0 where factor is 1 */
    GLuint bits, bits_colour;         /* for reading depth; made at the first read */
    GLuint empty_array;               /* a vertex array without attributes */
} strl_gl_target;

/* From world to depth buffer and back. */
typedef struct strl_gl_projection {
    float values[4]; /* u_projection of the shaders */
    int orthographic;
} strl_gl_projection;

strl_status strl__gl_target_init(strl_gl_target *target, uint32_t width, uint32_t height, uint32_t factor,
                                 strl_error *err);
void strl__gl_target_deinit(strl_gl_target *target);

/* Binds the samples for drawing; clears unless keep. */
void strl__gl_target_begin(strl_gl_target *target, const uint8_t background[3], bool keep);
strl_status strl__gl_target_read_colour(strl_gl_target *target, const strl_gl_program *resolve, uint8_t *rgba,
                                        strl_error *err);
strl_status strl__gl_target_read_depth(strl_gl_target *target, const strl_gl_program *program,
                                       const strl_gl_projection *projection, bool es, float *depth, strl_error *err);
/* To framebuffer 0, scaled. */
void strl__gl_target_present(strl_gl_target *target, const strl_gl_program *resolve, uint32_t width, uint32_t height);

#endif
