#include "render/glcommon/target.h"

#include <inttypes.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"

/* Rows read back at a time: bounds the copy that a system without one-channel reads needs. */
#define READ_ROWS 64u

/* OpenGL 3.3 has no glTexStorage2D without an extension, ES 3.0 no unsized way to some formats. */
static GLuint make_texture(GLenum format, GLenum layout, GLenum type, uint32_t width, uint32_t height)
{
    GLuint name;
    glGenTextures(1, &name);
    glBindTexture(GL_TEXTURE_2D, name);
    if (!epoxy_is_desktop_gl() || epoxy_gl_version() >= 42 || epoxy_has_gl_extension("GL_ARB_texture_storage"))
        glTexStorage2D(GL_TEXTURE_2D, 1, format, (GLsizei)width, (GLsizei)height);
    else
        glTexImage2D(GL_TEXTURE_2D, 0, (GLint)format, (GLsizei)width, (GLsizei)height, 0, layout, type, NULL);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAX_LEVEL, 0);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    return name;
}

static GLuint make_framebuffer(GLuint colour, GLuint depth)
{
    GLuint name;
    glGenFramebuffers(1, &name);
    glBindFramebuffer(GL_FRAMEBUFFER, name);
    glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, colour, 0);
    if (depth)
        glFramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, depth, 0);
    return name;
}

static strl_status check_limits(uint32_t width, uint32_t height, uint32_t factor, strl_error *err)
{
    GLint side = 0, viewport[2] = {0, 0};
    glGetIntegerv(GL_MAX_TEXTURE_SIZE, &side);
    glGetIntegerv(GL_MAX_VIEWPORT_DIMS, viewport);
    uint64_t wide = (uint64_t)width * factor, high = (uint64_t)height * factor;
    if (wide > (uint64_t)side || high > (uint64_t)side || wide > (uint64_t)viewport[0] || high > (uint64_t)viewport[1])
        return strl__fail(err, STRL_ERR_LIMIT,
                          "an image of %" PRIu64 "x%" PRIu64 " samples is larger than this GL system draws (%d)", wide,
                          high, side);
    return STRL_OK;
}

strl_status strl__gl_target_init(strl_gl_target *target, uint32_t width, uint32_t height, uint32_t factor,
                                 strl_error *err)
{
    *target = (strl_gl_target){.width = width, .height = height, .factor = factor};
    strl_status status = check_limits(width, height, factor, err);
    if (status != STRL_OK)
        return status;
    while (glGetError() != GL_NO_ERROR)
        continue;
    uint32_t wide = width * factor, high = height * factor;
    target->colour = make_texture(GL_RGBA8, GL_RGBA, GL_UNSIGNED_BYTE, wide, high);
    target->depth = make_texture(GL_DEPTH_COMPONENT32F, GL_DEPTH_COMPONENT, GL_FLOAT, wide, high);
    target->samples = make_framebuffer(target->colour, target->depth);
    bool whole = glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
    if (factor > 1) {
        target->resolved_colour = make_texture(GL_RGBA8, GL_RGBA, GL_UNSIGNED_BYTE, width, height);
        target->resolved = make_framebuffer(target->resolved_colour, 0);
        whole = whole && glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
    }
    glGenVertexArrays(1, &target->empty_array);
    if (whole && glGetError() == GL_NO_ERROR)
        return STRL_OK;
    strl__gl_target_deinit(target);
    return strl__fail(err, STRL_ERR_MEMORY,
                      "the GL system cannot make a render target of %" PRIu32 "x%" PRIu32 " samples", wide, high);
}

void strl__gl_target_deinit(strl_gl_target *target)
{
    const GLuint framebuffers[] = {target->samples, target->resolved, target->bits};
    const GLuint textures[] = {target->colour, target->depth, target->resolved_colour, target->bits_colour};
    glDeleteFramebuffers(3, framebuffers);
    glDeleteTextures(4, textures);
    glDeleteVertexArrays(1, &target->empty_array);
    *target = (strl_gl_target){0};
}

void strl__gl_target_begin(strl_gl_target *target, const uint8_t background[3], bool keep)
{
    glBindFramebuffer(GL_FRAMEBUFFER, target->samples);
    glViewport(0, 0, (GLsizei)(target->width * target->factor), (GLsizei)(target->height * target->factor));
    glDisable(GL_BLEND);
    glDisable(GL_CULL_FACE);
    glDisable(GL_SCISSOR_TEST);
    glDisable(GL_STENCIL_TEST);
    glEnable(GL_DEPTH_TEST);
    glDepthFunc(GL_GREATER);
    glDepthMask(GL_TRUE);
    glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
    if (keep)
        return;
    const GLfloat colour[4] = {background[0] / 255.f, background[1] / 255.f, background[2] / 255.f, 0};
    const GLfloat nothing = 0;
    glClearBufferfv(GL_COLOR, 0, colour);
    glClearBufferfv(GL_DEPTH, 0, &nothing);
}

/* Runs a program once a pixel of the framebuffer, reading the texture. */
static void draw_screen(strl_gl_target *target, GLuint framebuffer, GLuint texture, const strl_gl_program *program)
{
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
    glViewport(0, 0, (GLsizei)target->width, (GLsizei)target->height);
    glDisable(GL_DEPTH_TEST);
    glUseProgram(program->name);
    glUniform1i(program->samples, 0);
    glUniform1i(program->factor, (GLint)target->factor);
    glActiveTexture(GL_TEXTURE0);
    glBindTexture(GL_TEXTURE_2D, texture);
    glBindVertexArray(target->empty_array);
    glDrawArrays(GL_TRIANGLES, 0, 3);
    glBindVertexArray(0);
}

/* The framebuffer that holds the image at output size, bound. */
static void bind_resolved(strl_gl_target *target, const strl_gl_program *resolve)
{
    if (target->factor > 1)
        draw_screen(target, target->resolved, target->colour, resolve);
    else
        glBindFramebuffer(GL_FRAMEBUFFER, target->samples);
}

static strl_status check_read(strl_error *err, const char *what)
{
    GLenum code = glGetError();
    return code == GL_NO_ERROR
               ? STRL_OK
               : strl__fail(err, STRL_ERR_INTERNAL, "GL error 0x%04x while reading the %s back", code, what);
}

strl_status strl__gl_target_read_colour(strl_gl_target *target, const strl_gl_program *resolve, uint8_t *rgba,
                                        strl_error *err)
{
    bind_resolved(target, resolve);
    glPixelStorei(GL_PACK_ALIGNMENT, 1);
    size_t row = (size_t)target->width * 4;
    for (uint32_t y = 0; y < target->height; y++)
        glReadPixels(0, (GLint)y, (GLsizei)target->width, 1, GL_RGBA, GL_UNSIGNED_BYTE,
                     rgba + (target->height - 1 - y) * row);
    return check_read(err, "image");
}

static strl_status make_bits(strl_gl_target *target, strl_error *err)
{
    if (target->bits)
        return STRL_OK;
    target->bits_colour = make_texture(GL_R32UI, GL_RED_INTEGER, GL_UNSIGNED_INT, target->width, target->height);
    target->bits = make_framebuffer(target->bits_colour, 0);
    if (glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE)
        return STRL_OK;
    return strl__fail(err, STRL_ERR_MEMORY, "the GL system cannot make a target to read depth from");
}

strl_status strl__gl_target_read_depth(strl_gl_target *target, const strl_gl_program *program,
                                       const strl_gl_projection *projection, bool es, float *depth, strl_error *err)
{
    strl_status status = make_bits(target, err);
    if (status != STRL_OK)
        return status;
    /* ES reads integers in four channels only. */
    size_t channels = es ? 4 : 1, width = target->width;
    uint32_t *rows = strl__alloc(width * READ_ROWS, channels * sizeof *rows);
    if (!rows)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to read depth back");
    glUseProgram(program->name);
    glUniform4fv(program->projection, 1, projection->values);
    glUniform1i(program->orthographic, projection->orthographic);
    draw_screen(target, target->bits, target->depth, program);
    glPixelStorei(GL_PACK_ALIGNMENT, 1);
    for (uint32_t first = 0; first < target->height; first += READ_ROWS) {
        uint32_t count = target->height - first < READ_ROWS ? target->height - first : READ_ROWS;
        glReadPixels(0, (GLint)first, (GLsizei)width, (GLsizei)count, es ? GL_RGBA_INTEGER : GL_RED_INTEGER,
                     GL_UNSIGNED_INT, rows);
        for (uint32_t y = 0; y < count; y++)
            for (size_t x = 0; x < width; x++)
                memcpy(&depth[(target->height - 1 - first - y) * width + x], &rows[(y * width + x) * channels],
                       sizeof *depth);
    }
    strl__free(rows);
    return check_read(err, "depth");
}

void strl__gl_target_present(strl_gl_target *target, const strl_gl_program *resolve, uint32_t width, uint32_t height)
{
    bind_resolved(target, resolve);
    glBindFramebuffer(GL_READ_FRAMEBUFFER, target->factor > 1 ? target->resolved : target->samples);
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, 0);
    glBlitFramebuffer(0, 0, (GLint)target->width, (GLint)target->height, 0, 0, (GLint)width, (GLint)height,
                      GL_COLOR_BUFFER_BIT, width == target->width && height == target->height ? GL_NEAREST : GL_LINEAR);
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
}
