#include "render/glcommon/program.h"

#include <string.h>

#include "base/fail.h"
#include "render/glcommon/shaders.h"

static strl_status compile(GLenum stage, const char *const *texts, int count, GLuint *shader, strl_error *err)
{
    *shader = glCreateShader(stage);
    glShaderSource(*shader, count, texts, NULL);
    glCompileShader(*shader);
    GLint done = 0;
    glGetShaderiv(*shader, GL_COMPILE_STATUS, &done);
    if (done)
        return STRL_OK;
    char log[320] = "";
    glGetShaderInfoLog(*shader, sizeof log, NULL, log);
    glDeleteShader(*shader);
    *shader = 0;
    return strl__fail(err, STRL_ERR_UNSUPPORTED, "the GL system refuses a shader of Stroll: %s", log);
}

static strl_status link_program(GLuint name, strl_error *err)
{
    glLinkProgram(name);
    GLint done = 0;
    glGetProgramiv(name, GL_LINK_STATUS, &done);
    if (done)
        return STRL_OK;
    char log[320] = "";
    glGetProgramInfoLog(name, sizeof log, NULL, log);
    return strl__fail(err, STRL_ERR_UNSUPPORTED, "the GL system refuses to link a program of Stroll: %s", log);
}

static void find_uniforms(strl_gl_program *program)
{
    GLuint name = program->name;
    program->projection = glGetUniformLocation(name, "u_projection");
    program->orthographic = glGetUniformLocation(name, "u_orthographic");
    program->sky_up = glGetUniformLocation(name, "u_sky_up");
    program->headlight = glGetUniformLocation(name, "u_headlight");
    program->flat = glGetUniformLocation(name, "u_flat");
    program->section = glGetUniformLocation(name, "u_section");
    program->rows = glGetUniformLocation(name, "u_rows");
    program->base = glGetUniformLocation(name, "u_base");
    program->samples = glGetUniformLocation(name, "u_samples");
    program->factor = glGetUniformLocation(name, "u_factor");
}

static const char *vertex_text(strl_gl_program_kind kind)
{
    return kind == STRL_GL_RESOLVE || kind == STRL_GL_DEPTH ? strl__shader_screen_vert : strl__shader_node_vert;
}

static const char *fragment_text(strl_gl_program_kind kind)
{
    if (kind == STRL_GL_RESOLVE)
        return strl__shader_resolve_frag;
    return kind == STRL_GL_DEPTH ? strl__shader_depth_frag : strl__shader_node_frag;
}

strl_status strl__gl_program_init(strl_gl_program *program, strl_gl_program_kind kind, const strl_gl_dialect *dialect,
                                  strl_error *err)
{
    const char *texts[] = {
        dialect->es                ? "#version 300 es\nprecision highp float;\nprecision highp int;\n"
        : dialect->item_attributes ? "#version 450 core\n"
                                   : "#version 330 core\n",
        dialect->item_attributes ? "#define STRL_ITEM_ATTRIBUTES\n" : "",
        dialect->symmetric_depth ? "#define STRL_SYMMETRIC_DEPTH\n" : "",
        kind == STRL_GL_NODE_ALPHA ? "#define STRL_ALPHA\n" : "",
        strl__shader_srgb,
        vertex_text(kind),
    };
    const int count = sizeof texts / sizeof *texts;
    GLuint vertex = 0, fragment = 0;
    *program = (strl_gl_program){0};
    strl_status status = compile(GL_VERTEX_SHADER, texts, count, &vertex, err);
    if (status != STRL_OK)
        goto done;
    texts[count - 1] = fragment_text(kind);
    status = compile(GL_FRAGMENT_SHADER, texts, count, &fragment, err);
    if (status != STRL_OK)
        goto done;
    program->name = glCreateProgram();
    glAttachShader(program->name, vertex);
    glAttachShader(program->name, fragment);
    status = link_program(program->name, err);
    if (status == STRL_OK)
        find_uniforms(program);
    else
        strl__gl_program_deinit(program);
done:
    glDeleteShader(vertex);
    glDeleteShader(fragment);
    return status;
}

void strl__gl_program_deinit(strl_gl_program *program)
{
    if (program->name)
        glDeleteProgram(program->name);
    *program = (strl_gl_program){0};
}
