/* Draws a walk with OpenGL 3.3 of our own and writes a PNG: nothing of Stroll's renderer is used.
 *
 *     cc draw_gl.c $(pkg-config --cflags --libs stroll epoxy egl libpng) -lm -o draw_gl
 *     ./draw_gl model.stroll image.png */
#include <epoxy/egl.h>
#include <epoxy/gl.h>
#include <inttypes.h>
#include <png.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

#include "orbit.h"

#define WIDTH 1280u
#define HEIGHT 720u

/* begin: shaders */
/* A vertex reaches the shader as integers. anchor - eye cell (64 bits, in two words) plus the vertex's
 * offset is added exactly, and only the sum becomes a float: two nodes that share a vertex get the same
 * bits, so there is no crack between them, and near the eye, where it matters, the sum is small and the
 * float exact. */
static const char vertex_shader[] =
    "#version 330 core\n"
    "layout(location = 0) in ivec3 position;\n"
    "layout(location = 1) in uvec2 normal;\n"
    "layout(location = 2) in vec4 rgba;\n"
    "uniform vec4 to_view[3];\n" /* rows: lattice steps from the eye's cell to view space, x right, y up, z forward */
    "uniform vec3 normal_to_view[3];\n"
    "uniform ivec3 base_low, base_high;\n"
    "uniform vec4 projection;\n" /* 1 / tan x, 1 / tan y, and the two numbers of the depth */
    "out vec3 view_normal;\n"
    "out vec3 view;\n"
    "out vec4 colour;\n"
    "invariant gl_Position;\n"
    "vec3 exact_sum(ivec3 offset)\n"
    "{\n"
    "    uvec3 low = uvec3(base_low) + uvec3(offset);\n"
    "    ivec3 carry = ivec3(lessThan(low, uvec3(base_low)));\n"
    "    ivec3 high = base_high + (offset >> 31) + carry;\n"
    "    ivec3 negative = high >> 31;\n"
    "    low = (low ^ uvec3(negative)) - uvec3(negative);\n"
    "    high = (high ^ negative) - (negative & ivec3(equal(low, uvec3(0u))));\n"
    "    vec3 magnitude = vec3(high) * 4294967296.0 + vec3(low);\n"
    "    return mix(magnitude, -magnitude, lessThan(negative, ivec3(0)));\n"
    "}\n"
    "vec3 decoded(uvec2 octahedral)\n"
    "{\n"
    "    vec2 p = vec2(octahedral & 1023u) * (2.0 / 1023.0) - 1.0;\n" /* the spread of splats lies above */
    "    float z = 1.0 - abs(p.x) - abs(p.y), fold = max(-z, 0.0);\n"
    "    p += vec2(p.x >= 0.0 ? -fold : fold, p.y >= 0.0 ? -fold : fold);\n"
    "    return normalize(vec3(p, z));\n"
    "}\n"
    "void main()\n"
    "{\n"
    "    vec3 local = exact_sum(position), n = decoded(normal);\n"
    "    for (int i = 0; i < 3; i++) {\n"
    "        view[i] = dot(to_view[i].xyz, local) + to_view[i].w;\n"
    "        view_normal[i] = dot(normal_to_view[i], n);\n"
    "    }\n"
    "    colour = rgba;\n"
    "    gl_Position = vec4(view.xy * projection.xy, view.z * projection.z + projection.w, view.z);\n"
    "}\n";

static const char fragment_shader[] =
    "#version 330 core\n"
    "in vec3 view_normal;\n"
    "in vec3 view;\n"
    "in vec4 colour;\n"
    "out vec4 pixel;\n"
    "void main()\n"
    "{\n"
    "    float facing = abs(dot(normalize(view_normal), normalize(view)));\n" /* a light at the eye; both sides */
    "    pixel = vec4(colour.rgb * (0.25 + 0.75 * facing), 1.0);\n"
    "}\n";
/* end: shaders */

/* begin: types */
/* A node of the draw list on the GPU. */
typedef struct gpu_node {
    uint64_t key;
    uint64_t frame; /* of the last list that had it */
    GLuint vertex_array, vertices, indices;
    uint32_t index_capacity;
} gpu_node;

typedef struct drawer {
    EGLDisplay display;
    EGLContext context;
    GLuint program, framebuffer, colour, depth;
    GLint to_view, normal_to_view, base_low, base_high, projection;
    gpu_node *nodes;
    size_t node_count, node_capacity;
    uint64_t uploaded_bytes;
} drawer;
/* end: types */

/* begin: context */
static strl_status create_context(drawer *d, strl_error *err)
{
    static const EGLint config_wanted[] = {EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_SURFACE_TYPE, EGL_DONT_CARE,
                                           EGL_NONE};
    static const EGLint context_wanted[] = {
        EGL_CONTEXT_MAJOR_VERSION,           3,       EGL_CONTEXT_MINOR_VERSION, 3, EGL_CONTEXT_OPENGL_PROFILE_MASK,
        EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT, EGL_NONE};
    EGLConfig config;
    EGLint count = 0;
    d->display = eglGetPlatformDisplayEXT(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, NULL);
    if (d->display == EGL_NO_DISPLAY || !eglInitialize(d->display, NULL, NULL) || !eglBindAPI(EGL_OPENGL_API) ||
        !eglChooseConfig(d->display, config_wanted, &config, 1, &count) || count < 1)
        return strl_error_set(err, STRL_ERR_UNSUPPORTED, "this system has no OpenGL without a window");
    d->context = eglCreateContext(d->display, config, EGL_NO_CONTEXT, context_wanted);
    if (d->context == EGL_NO_CONTEXT || !eglMakeCurrent(d->display, EGL_NO_SURFACE, EGL_NO_SURFACE, d->context))
        return strl_error_set(err, STRL_ERR_UNSUPPORTED, "this system has no OpenGL 3.3");
    return STRL_OK;
}

static GLuint compile(GLenum kind, const char *text)
{
    GLuint shader = glCreateShader(kind);
    glShaderSource(shader, 1, &text, NULL);
    glCompileShader(shader);
    return shader;
}

static strl_status create_program(drawer *d, strl_error *err)
{
    GLint linked = 0;
    GLuint vertex = compile(GL_VERTEX_SHADER, vertex_shader), fragment = compile(GL_FRAGMENT_SHADER, fragment_shader);
    d->program = glCreateProgram();
    glAttachShader(d->program, vertex);
    glAttachShader(d->program, fragment);
    glLinkProgram(d->program);
    glDeleteShader(vertex);
    glDeleteShader(fragment);
    glGetProgramiv(d->program, GL_LINK_STATUS, &linked);
    if (!linked)
        return strl_error_set(err, STRL_ERR_UNSUPPORTED, "the shaders of the guide do not compile here");
    d->to_view = glGetUniformLocation(d->program, "to_view");
    d->normal_to_view = glGetUniformLocation(d->program, "normal_to_view");
    d->base_low = glGetUniformLocation(d->program, "base_low");
    d->base_high = glGetUniformLocation(d->program, "base_high");
    d->projection = glGetUniformLocation(d->program, "projection");
    return STRL_OK;
}

static strl_status create_target(drawer *d, strl_error *err)
{
    glGenRenderbuffers(1, &d->colour);
    glBindRenderbuffer(GL_RENDERBUFFER, d->colour);
    glRenderbufferStorage(GL_RENDERBUFFER, GL_RGBA8, WIDTH, HEIGHT);
    glGenRenderbuffers(1, &d->depth);
    glBindRenderbuffer(GL_RENDERBUFFER, d->depth);
    glRenderbufferStorage(GL_RENDERBUFFER, GL_DEPTH_COMPONENT32F, WIDTH, HEIGHT);
    glGenFramebuffers(1, &d->framebuffer);
    glBindFramebuffer(GL_FRAMEBUFFER, d->framebuffer);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, d->colour);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, d->depth);
    if (glCheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
        return strl_error_set(err, STRL_ERR_UNSUPPORTED, "the framebuffer is not complete");
    return STRL_OK;
}
/* end: context */

/* begin: upload */
/* Linear, because a front has some hundred nodes; a program with many models has a hash table here. */
static gpu_node *find_node(drawer *d, uint64_t key)
{
    for (size_t i = 0; i < d->node_count; i++)
        if (d->nodes[i].key == key)
            return &d->nodes[i];
    return NULL;
}

/* Vertices of a key never change. */
static gpu_node *add_node(drawer *d, const strl_draw_item *item)
{
    if (d->node_count == d->node_capacity) {
        size_t capacity = d->node_capacity ? 2 * d->node_capacity : 64;
        gpu_node *nodes = realloc(d->nodes, capacity * sizeof *nodes);
        if (!nodes)
            return NULL;
        d->nodes = nodes;
        d->node_capacity = capacity;
    }
    gpu_node *node = &d->nodes[d->node_count++];
    *node = (gpu_node){.key = item->key};
    glGenVertexArrays(1, &node->vertex_array);
    glBindVertexArray(node->vertex_array);
    glGenBuffers(1, &node->vertices);
    glGenBuffers(1, &node->indices);
    glBindBuffer(GL_ARRAY_BUFFER, node->vertices);
    glBufferData(GL_ARRAY_BUFFER, (GLsizeiptr)(item->vertex_count * sizeof *item->vertices), item->vertices,
                 GL_STATIC_DRAW);
    glVertexAttribIPointer(0, 3, GL_INT, sizeof(strl_vertex), (void *)offsetof(strl_vertex, position));
    glVertexAttribIPointer(1, 2, GL_UNSIGNED_SHORT, sizeof(strl_vertex), (void *)offsetof(strl_vertex, normal));
    glVertexAttribPointer(2, 4, GL_UNSIGNED_BYTE, GL_TRUE, sizeof(strl_vertex), (void *)offsetof(strl_vertex, rgba));
    for (GLuint i = 0; i < 3; i++)
        glEnableVertexAttribArray(i);
    d->uploaded_bytes += item->vertex_count * sizeof *item->vertices;
    return node;
}

/* Indices are a function of (key, state): all of them for a node that was away, else those that may have changed. */
static void upload_indices(drawer *d, gpu_node *node, const strl_draw_item *item, uint64_t frame)
{
    uint32_t first = item->dirty_first, count = item->dirty_count;
    bool whole = frame == 0 || node->frame + 1 != frame;
    if (frame != 0 && node->frame == frame)
        return; /* another placement of the node: in one list all have the same indices */
    glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, node->indices);
    if (item->index_count > node->index_capacity) {
        node->index_capacity = item->index_count + item->index_count / 2;
        glBufferData(GL_ELEMENT_ARRAY_BUFFER, (GLsizeiptr)(node->index_capacity * sizeof(uint16_t)), NULL,
                     GL_DYNAMIC_DRAW);
        whole = true;
    }
    if (whole)
        first = 0, count = item->index_count;
    if (count)
        glBufferSubData(GL_ELEMENT_ARRAY_BUFFER, (GLintptr)(first * sizeof(uint16_t)),
                        (GLsizeiptr)(count * sizeof(uint16_t)), item->indices + first);
    node->frame = frame;
    d->uploaded_bytes += count * sizeof(uint16_t);
}

/* What the last list did not have is given back; a program with a budget keeps some of it. */
static void drop_unused(drawer *d, uint64_t frame)
{
    size_t kept = 0;
    for (size_t i = 0; i < d->node_count; i++) {
        gpu_node *node = &d->nodes[i];
        if (node->frame == frame) {
            d->nodes[kept++] = *node;
            continue;
        }
        glDeleteVertexArrays(1, &node->vertex_array);
        glDeleteBuffers(1, &node->vertices);
        glDeleteBuffers(1, &node->indices);
    }
    d->node_count = kept;
}
/* end: upload */

/* begin: view */
typedef struct view_basis {
    double axes[3][3]; /* right, up, forward */
    double tan_x, tan_y;
} view_basis;

static void cross(const double a[3], const double b[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

static void normalize(double v[3])
{
    double length = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (int i = 0; i < 3; i++)
        v[i] /= length;
}

static view_basis basis_of(const strl_camera *camera)
{
    view_basis basis;
    double *right = basis.axes[0], *up = basis.axes[1], *forward = basis.axes[2];
    for (int i = 0; i < 3; i++)
        forward[i] = camera->target[i] - camera->eye[i];
    normalize(forward);
    cross(forward, camera->up, right);
    normalize(right);
    cross(right, forward, up);
    basis.tan_y = tan(camera->fov_y_deg * 3.14159265358979323846 / 360);
    basis.tan_x = basis.tan_y * camera->width / camera->height;
    return basis;
}
/* end: view */

/* begin: place */
/* Cofactors of the 3x3 part: they turn normals, and divided by the determinant, transposed, they are the inverse. */
static void cofactors_of(const double m[12], double out[3][3])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            int a = (i + 1) % 3, b = (i + 2) % 3, c = (j + 1) % 3, e = (j + 2) % 3;
            out[i][j] = m[4 * a + c] * m[4 * b + e] - m[4 * a + e] * m[4 * b + c];
        }
}

/* The lattice cell next to the eye: the same for all nodes of a placement. */
static void find_eye_cell(const strl_draw_item *item, const double eye[3], double cofactors[3][3], int64_t cell[3])
{
    const double *m = item->transform;
    double determinant = m[0] * cofactors[0][0] + m[1] * cofactors[0][1] + m[2] * cofactors[0][2];
    for (int j = 0; j < 3; j++) {
        double point = 0;
        for (int i = 0; i < 3; i++)
            point += cofactors[i][j] * (eye[i] - m[4 * i + 3]);
        double found = (point / determinant - item->origin[j]) / item->step;
        cell[j] = isfinite(found) && fabs(found) < 0x1p61 ? (int64_t)round(found) : 0;
    }
}

/* With c a vertex's cell and r the eye's, both integers:
 *     view = V L step (c - r)  +  V (L (origin + step r) + t - eye)
 * where L and t are the placement and V the camera's axes. The first part is the shader's; the second is
 * small and made here. */
static void place(const drawer *d, const strl_camera *camera, const view_basis *basis, const strl_draw_item *item)
{
    const double *m = item->transform;
    double cofactors[3][3], offset[3];
    int64_t cell[3];
    GLfloat rows[12], normals[9];
    GLint low[3], high[3];
    cofactors_of(m, cofactors);
    find_eye_cell(item, camera->eye, cofactors, cell);
    for (int i = 0; i < 3; i++) {
        offset[i] = m[4 * i + 3] - camera->eye[i];
        for (int j = 0; j < 3; j++)
            offset[i] += m[4 * i + j] * (item->origin[j] + item->step * (double)cell[j]);
        uint64_t base = (uint64_t)item->anchor[i] - (uint64_t)cell[i];
        low[i] = (GLint)(uint32_t)base;
        high[i] = (GLint)(uint32_t)(base >> 32);
    }
    for (int row = 0; row < 3; row++) {
        const double *axis = basis->axes[row];
        for (int j = 0; j < 3; j++) {
            rows[4 * row + j] = (GLfloat)(item->step * (axis[0] * m[j] + axis[1] * m[4 + j] + axis[2] * m[8 + j]));
            normals[3 * row + j] =
                (GLfloat)(axis[0] * cofactors[0][j] + axis[1] * cofactors[1][j] + axis[2] * cofactors[2][j]);
        }
        rows[4 * row + 3] = (GLfloat)(axis[0] * offset[0] + axis[1] * offset[1] + axis[2] * offset[2]);
    }
    glUniform4fv(d->to_view, 3, rows);
    glUniform3fv(d->normal_to_view, 3, normals);
    glUniform3iv(d->base_low, 1, low);
    glUniform3iv(d->base_high, 1, high);
}
/* end: place */

/* begin: draw */
static strl_status draw(drawer *d, const strl_camera *camera, const strl_draw_list *list, strl_error *err)
{
    view_basis basis = basis_of(camera);
    /* what lies at the far plane is to be seen */
    double near = list->near_distance, far = list->far_distance * 1.0001;
    glViewport(0, 0, WIDTH, HEIGHT);
    glEnable(GL_DEPTH_TEST);
    glClearColor(0.1f, 0.11f, 0.13f, 1);
    glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
    glUseProgram(d->program);
    glUniform4f(d->projection, (GLfloat)(1 / basis.tan_x), (GLfloat)(1 / basis.tan_y),
                (GLfloat)((far + near) / (far - near)), (GLfloat)(-2 * far * near / (far - near)));
    for (uint32_t i = 0; i < list->count; i++) {
        const strl_draw_item *item = &list->items[i];
        if (!item->visible || item->draw_count == 0)
            continue;
        gpu_node *node = find_node(d, item->key);
        if (!node && !(node = add_node(d, item)))
            return strl_error_set(err, STRL_ERR_MEMORY, "no memory for a node");
        glBindVertexArray(node->vertex_array);
        upload_indices(d, node, item, list->frame);
        place(d, camera, &basis, item);
        if (item->point_px > 0) /* splats */
            glPointSize(item->point_px);
        glDrawElements(item->point_px > 0 ? GL_POINTS : GL_TRIANGLES, (GLsizei)item->draw_count, GL_UNSIGNED_SHORT,
                       (void *)(item->draw_first * sizeof(uint16_t)));
    }
    drop_unused(d, list->frame);
    return glGetError() == GL_NO_ERROR ? STRL_OK : strl_error_set(err, STRL_ERR_INTERNAL, "OpenGL reports an error");
}
/* end: draw */

/* begin: image */
static strl_status write_image(const char *path, strl_error *err)
{
    png_image image = {.version = PNG_IMAGE_VERSION, .width = WIDTH, .height = HEIGHT, .format = PNG_FORMAT_RGBA};
    const png_int_32 stride = 4 * (png_int_32)WIDTH;
    png_byte *pixels = malloc((size_t)stride * HEIGHT);
    if (!pixels)
        return strl_error_set(err, STRL_ERR_MEMORY, "no memory for an image");
    glReadPixels(0, 0, WIDTH, HEIGHT, GL_RGBA, GL_UNSIGNED_BYTE, pixels);
    int good = png_image_write_to_file(&image, path, 0, pixels, -stride, NULL); /* GL's rows go upwards */
    free(pixels);
    return good ? STRL_OK : strl_error_set(err, STRL_ERR_IO, "the image cannot be written");
}
/* end: image */

/* begin: main */
/* Ten frames as they come, then frames of one place until everything is there that the pixel error asks for. */
static strl_status walk_and_draw(drawer *d, strl_walk *walk, strl_error *err)
{
    strl_status status = STRL_OK;
    for (int frame = 0; status == STRL_OK && (frame <= 10 || !strl_walk_settled(walk)); frame++) {
        strl_camera camera = orbit(walk, 0.05 * (frame < 10 ? frame : 10), WIDTH, HEIGHT);
        strl_draw_list list;
        strl_walk_pump(walk, 4000000);
        status = strl_walk_frame(walk, &camera, &list, err);
        if (status == STRL_OK)
            status = draw(d, &camera, &list, err);
    }
    const strl_walk_stats *stats = strl_walk_get_stats(walk);
    printf("%" PRIu32 " nodes, %" PRIu64 " triangles, wrong by at most %.2f pixels, %" PRIu64 " bytes uploaded\n",
           stats->nodes, stats->triangles, stats->max_error_px, d->uploaded_bytes);
    return status;
}

static void destroy(drawer *d)
{
    drop_unused(d, UINT64_MAX); /* no list has this number */
    free(d->nodes);
    if (d->context != EGL_NO_CONTEXT) {
        eglMakeCurrent(d->display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
        eglDestroyContext(d->display, d->context);
    }
}

int main(int argc, char **argv)
{
    strl_error err = {0};
    strl_source *source = NULL;
    strl_walk *walk = NULL;
    drawer d = {.context = EGL_NO_CONTEXT};
    if (argc != 3) {
        fprintf(stderr, "usage: draw_gl MODEL.stroll IMAGE.png\n");
        return 2;
    }
    strl_status status = strl_source_open_file(argv[1], 2, &source, &err);
    if (status == STRL_OK)
        status = strl_walk_open(source, NULL, &walk, &err);
    if (status == STRL_OK)
        status = create_context(&d, &err);
    if (status == STRL_OK)
        status = create_program(&d, &err);
    if (status == STRL_OK)
        status = create_target(&d, &err);
    if (status == STRL_OK)
        status = walk_and_draw(&d, walk, &err);
    if (status == STRL_OK)
        status = write_image(argv[2], &err);
    if (status != STRL_OK)
        fprintf(stderr, "draw_gl: %s\n", err.message);
    destroy(&d);
    strl_walk_close(walk);
    return status == STRL_OK ? 0 : 1;
}
/* end: main */
