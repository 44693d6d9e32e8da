#include "render/glcommon/gl.h"

#include <stdio.h>
#include <string.h>

#include "base/fail.h"

void strl__gl_make_current(strl_gl *gl)
{
    strl__gl_context_make_current(gl->context);
}

static strl_status open_context(strl_gl *gl, const strl_renderer_desc *desc, bool gl45, strl_error *err)
{
    if (!desc->current_context) {
        bool gles = desc->gles && !gl45;
        strl_gl_context_desc wanted = {gles, gl45 ? 4 : 3, gl45 ? 5 : gles ? 0 : 3};
        strl_status status = strl__gl_context_create(&wanted, &gl->context, err);
        if (status != STRL_OK)
            return status;
    }
    bool desktop = epoxy_is_desktop_gl();
    int version = epoxy_gl_version(), least = gl45 ? 45 : desktop ? 33 : 30;
    if (version < least || (gl45 && !desktop))
        return strl__fail(err, STRL_ERR_UNSUPPORTED, "the GL context has version %d.%d, expected at least %d.%d",
                          version / 10, version % 10, least / 10, least % 10);
    return STRL_OK;
}

static bool has_clip_control(const strl_gl_dialect *dialect, bool core_only)
{
    if (core_only)
        return false;
    return dialect->es ? epoxy_has_gl_extension("GL_EXT_clip_control")
                       : epoxy_gl_version() >= 45 || epoxy_has_gl_extension("GL_ARB_clip_control");
}

static void set_clip_control(const strl_gl_dialect *dialect, bool ours)
{
    if (dialect->symmetric_depth)
        return;
    GLenum depth = ours ? GL_ZERO_TO_ONE : GL_NEGATIVE_ONE_TO_ONE;
    if (dialect->es)
        glClipControlEXT(GL_LOWER_LEFT, depth);
    else
        glClipControl(GL_LOWER_LEFT, depth);
}

strl_status strl__gl_init(strl_gl *gl, const strl_renderer_class *klass, const strl_renderer_desc *desc,
                          strl_error *err)
{
    bool gl45 = klass->backend == STRL_BACKEND_GL45;
    gl->base = (strl_renderer){.klass = klass, .desc = *desc};
    strl_status status = open_context(gl, desc, gl45, err);
    if (status == STRL_OK) {
        gl->dialect = (strl_gl_dialect){.es = !epoxy_is_desktop_gl(), .item_attributes = gl45};
        gl->dialect.symmetric_depth = !has_clip_control(&gl->dialect, desc->core_only && !gl45);
        snprintf(gl->base.device, sizeof gl->base.device, "%s", (const char *)glGetString(GL_RENDERER));
        status = strl__cache_init(&gl->cache, err);
    }
    for (int kind = 0; status == STRL_OK && kind < STRL_GL_PROGRAM_KINDS; kind++)
        status = strl__gl_program_init(&gl->programs[kind], kind, &gl->dialect, err);
    if (status == STRL_OK)
        status = strl__gl_target_init(&gl->target, desc->width, desc->height, desc->supersample, err);
    if (status != STRL_OK)
        strl__gl_deinit(gl);
    return status;
}

void strl__gl_deinit(strl_gl *gl)
{
    bool has_context = gl->context || gl->base.desc.current_context;
    if (has_context) {
        strl__gl_make_current(gl);
        if (gl->target.samples)
            strl__gl_target_deinit(&gl->target);
        for (int kind = 0; kind < STRL_GL_PROGRAM_KINDS; kind++)
            strl__gl_program_deinit(&gl->programs[kind]);
    }
    strl__cache_deinit(&gl->cache);
    strl__gl_context_destroy(gl->context);
    gl->context = NULL;
}

static void set_projection(strl_gl *gl, const strl_draw_setup *setup)
{
    const strl_view *view = &setup->view;
    float *values = gl->projection.values;
    gl->projection.orthographic = view->orthographic;
    if (!view->orthographic) {
        values[0] = (float)(1 / view->tan_x), values[1] = (float)(1 / view->tan_y);
        values[2] = (float)setup->near_distance, values[3] = 0;
        return;
    }
    /* Linear depth clips at both ends: what lies exactly on them shall be drawn. */
    double depth = setup->far_distance - setup->near_distance, margin = 1e-3 * depth + 1e-6 * setup->far_distance;
    double near = setup->near_distance - margin, far = setup->far_distance + margin;
    values[0] = (float)(1 / view->half_width), values[1] = (float)(1 / view->half_height);
    values[2] = (float)far, values[3] = (float)(1 / (far - near));
}

bool strl__gl_has_section(const strl_draw_setup *setup)
{
    const double *plane = setup->options.section;
    return plane[0] != 0 || plane[1] != 0 || plane[2] != 0;
}

/* In view space: dot(xyz, p) + w >= 0 is drawn. */
static void find_section(const strl_draw_setup *setup, float out[4])
{
    const strl_view *view = &setup->view;
    const double *plane = setup->options.section, *axes[3] = {view->right, view->up, view->forward};
    double rest = strl__gl_has_section(setup) ? plane[3] : 1;
    for (int i = 0; i < 3; i++) {
        rest -= plane[i] * view->eye[i];
        out[i] = -(float)(axes[i][0] * plane[0] + axes[i][1] * plane[1] + axes[i][2] * plane[2]);
    }
    out[3] = (float)rest;
}

static void set_uniforms(strl_gl *gl, const strl_gl_program *program, const strl_draw_setup *setup)
{
    const strl_draw_options *options = &setup->options;
    const double *axes[3] = {setup->view.right, setup->view.up, setup->view.forward};
    float sky[3], section[4];
    for (int i = 0; i < 3; i++)
        sky[i] = (float)(axes[i][0] * options->sky_up[0] + axes[i][1] * options->sky_up[1] +
                         axes[i][2] * options->sky_up[2]);
    glUseProgram(program->name);
    glUniform4fv(program->projection, 1, gl->projection.values);
    glUniform1i(program->orthographic, gl->projection.orthographic);
    glUniform3fv(program->sky_up, 1, sky);
    glUniform1f(program->headlight, options->headlight);
    glUniform1i(program->flat, options->flat);
    find_section(setup, section);
    glUniform4fv(program->section, 1, section);
}

void strl__gl_set_fronts(bool mirrors)
{
    glFrontFace(mirrors ? GL_CW : GL_CCW);
}

void strl__gl_begin_draw(strl_gl *gl, const strl_draw_setup *setup)
{
    set_projection(gl, setup);
    strl__gl_target_begin(&gl->target, setup->options.background, setup->options.keep);
    set_clip_control(&gl->dialect, true);
    set_uniforms(gl, &gl->programs[STRL_GL_NODE], setup);
    set_uniforms(gl, &gl->programs[STRL_GL_NODE_ALPHA], setup);
    glCullFace(GL_BACK);
    if (setup->cull_back)
        glEnable(GL_CULL_FACE);
    else
        glDisable(GL_CULL_FACE);
    if (!gl->dialect.es) {
        glDisable(GL_FRAMEBUFFER_SRGB);
        glPolygonMode(GL_FRONT_AND_BACK, setup->options.wireframe ? GL_LINE : GL_FILL);
        glEnable(GL_PROGRAM_POINT_SIZE);
        if (strl__gl_has_section(setup))
            glEnable(GL_CLIP_DISTANCE0);
    }
}

strl_status strl__gl_end_draw(strl_gl *gl, strl_error *err)
{
    set_clip_control(&gl->dialect, false);
    glDisable(GL_CULL_FACE);
    strl__gl_set_fronts(false);
    if (!gl->dialect.es) {
        glPolygonMode(GL_FRONT_AND_BACK, GL_FILL);
        glDisable(GL_CLIP_DISTANCE0);
    }
    glBindVertexArray(0);
    glUseProgram(0);
    GLenum code = glGetError();
    if (code == GL_OUT_OF_MEMORY)
        return strl__fail(err, STRL_ERR_MEMORY, "the GL system has no memory left to draw with");
    return code == GL_NO_ERROR ? STRL_OK : strl__fail(err, STRL_ERR_INTERNAL, "GL error 0x%04x while drawing", code);
}

void strl__gl_finish(strl_renderer *renderer)
{
    strl__gl_make_current((strl_gl *)renderer);
    glFinish();
}

strl_status strl__gl_resize(strl_renderer *renderer, strl_error *err)
{
    strl_gl *gl = (strl_gl *)renderer;
    strl__gl_make_current(gl);
    strl__gl_target_deinit(&gl->target);
    return strl__gl_target_init(&gl->target, renderer->desc.width, renderer->desc.height, renderer->desc.supersample,
                                err);
}

strl_status strl__gl_read_colour(strl_renderer *renderer, uint8_t *rgba, strl_error *err)
{
    strl_gl *gl = (strl_gl *)renderer;
    strl__gl_make_current(gl);
    return strl__gl_target_read_colour(&gl->target, &gl->programs[STRL_GL_RESOLVE], rgba, err);
}

strl_status strl__gl_read_depth(strl_renderer *renderer, float *depth, strl_error *err)
{
    strl_gl *gl = (strl_gl *)renderer;
    strl__gl_make_current(gl);
    return strl__gl_target_read_depth(&gl->target, &gl->programs[STRL_GL_DEPTH], &gl->projection, gl->dialect.es, depth,
                                      err);
}

strl_status strl__gl_present(strl_renderer *renderer, uint32_t width, uint32_t height, strl_error *err)
{
    strl_gl *gl = (strl_gl *)renderer;
    (void)err;
    strl__gl_make_current(gl);
    strl__gl_target_present(&gl->target, &gl->programs[STRL_GL_RESOLVE], width, height);
    return STRL_OK;
}
