/* OpenGL 3.3 core and ES 3.0: each node has a vertex array and two buffers of its own; items are drawn one by one, so a
 * node that was drawn can make room for the next one of the same list. */
#include <epoxy/gl.h>
#include <inttypes.h>
#include <stddef.h>

#include "base/fail.h"
#include "base/memory.h"
#include "render/check.h"
#include "render/glcommon/gl.h"
#include "render/style.h"

typedef struct gl3_renderer {
    strl_gl gl;
    uint64_t node_bytes; /* in buffers */
    uint16_t *lines;     /* scratch for ES, which has no polygon mode */
    size_t lines_capacity;
    strl_vertex *styled; /* scratch */
    size_t styled_capacity;
} gl3_renderer;

/* One draw call's worth of context. */
typedef struct gl3_draw {
    gl3_renderer *self;
    uint64_t frame;
    bool lines;    /* draw expanded indices */
    bool discards; /* all fragments may be cut off: ES has no clip distances */
    const strl_draw_options *options;
    strl_render_stats *stats;
} gl3_draw;

static void release(gl3_renderer *self, strl_cache_entry *entry)
{
    glDeleteVertexArrays(1, &entry->place.names.array);
    glDeleteBuffers(1, &entry->place.names.vertices);
    glDeleteBuffers(1, &entry->place.names.indices);
    self->node_bytes -= entry->bytes;
    strl__cache_remove(&self->gl.cache, entry);
}

static void set_attributes(void)
{
    glEnableVertexAttribArray(0);
    glVertexAttribIPointer(0, 3, GL_INT, sizeof(strl_vertex), (const void *)offsetof(strl_vertex, position));
    glEnableVertexAttribArray(1);
    glVertexAttribIPointer(1, 2, GL_UNSIGNED_SHORT, sizeof(strl_vertex), (const void *)offsetof(strl_vertex, normal));
    glEnableVertexAttribArray(2);
    glVertexAttribPointer(2, 4, GL_UNSIGNED_BYTE, GL_TRUE, sizeof(strl_vertex),
                          (const void *)offsetof(strl_vertex, rgba));
}

static strl_status make_room(gl3_draw *draw, uint64_t bytes, strl_error *err)
{
    gl3_renderer *self = draw->self;
    uint64_t budget = self->gl.base.desc.gpu_memory_bytes;
    while (self->gl.cache.oldest && self->node_bytes + bytes > budget) {
        release(self, self->gl.cache.oldest);
        draw->stats->evictions++;
    }
    if (bytes > budget)
        return strl__fail(err, STRL_ERR_LIMIT, "a node needs %" PRIu64 " bytes of GPU memory, the budget is %" PRIu64,
                          bytes, budget);
    return STRL_OK;
}

/* Splats are points in a wireframe too. */
static bool drawn_as_lines(const gl3_draw *draw, const strl_draw_item *item)
{
    return draw->lines && !(item->point_px > 0);
}

/* Room for a quarter more indices than now, so that refining does not mean a new buffer each time. */
static uint32_t index_room(const strl_draw_item *item, bool lines)
{
    uint32_t room = item->index_count + item->index_count / 4;
    return lines ? room * 2 : room;
}

static strl_status add(gl3_draw *draw, const strl_draw_item *item, strl_cache_entry **entry, strl_error *err)
{
    gl3_renderer *self = draw->self;
    bool lines = drawn_as_lines(draw, item);
    uint32_t room = index_room(item, lines);
    uint64_t vertex_bytes = item->vertex_count * sizeof(strl_vertex), index_bytes = room * sizeof(uint16_t);
    strl_status status = make_room(draw, vertex_bytes + index_bytes, err);
    if (status != STRL_OK)
        return status;
    strl_cache_entry *made = strl__cache_add(&self->gl.cache, item->key);
    if (!made)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the renderer's table of nodes");
    made->bytes = vertex_bytes + index_bytes;
    made->index_capacity = room;
    made->lines = lines;
    made->translucent = strl__item_is_translucent(item);
    self->node_bytes += made->bytes;
    glGenVertexArrays(1, &made->place.names.array);
    glBindVertexArray(made->place.names.array);
    GLuint buffers[2];
    glGenBuffers(2, buffers);
    made->place.names.vertices = buffers[0], made->place.names.indices = buffers[1];
    glBindBuffer(GL_ARRAY_BUFFER, buffers[0]);
    glBufferData(GL_ARRAY_BUFFER, (GLsizeiptr)vertex_bytes, NULL, GL_STATIC_DRAW);
    set_attributes();
    glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, buffers[1]);
    glBufferData(GL_ELEMENT_ARRAY_BUFFER, (GLsizeiptr)index_bytes, NULL, GL_DYNAMIC_DRAW);
    *entry = made;
    return STRL_OK;
}

static strl_status upload_vertices(gl3_draw *draw, const strl_cache_entry *entry, const strl_draw_item *item,
                                   strl_error *err)
{
    gl3_renderer *self = draw->self;
    const strl_vertex *vertices =
        strl__style_vertices(entry, item, draw->options, &self->styled, &self->styled_capacity);
    if (!vertices)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the styled vertices of node %" PRIu32, item->node);
    glBindBuffer(GL_ARRAY_BUFFER, entry->place.names.vertices);
    glBufferSubData(GL_ARRAY_BUFFER, 0, (GLsizeiptr)(item->vertex_count * sizeof *vertices), vertices);
    draw->stats->uploaded_vertices += item->vertex_count;
    return STRL_OK;
}

/* Three lines for each triangle that the index range touches. */
static strl_status upload_lines(gl3_draw *draw, const strl_draw_item *item, uint32_t first, uint32_t count,
                                strl_error *err)
{
    gl3_renderer *self = draw->self;
    uint32_t first_triangle = first / 3, end_triangle = (first + count + 2) / 3, at = 0;
    if (!strl__grow(&self->lines, &self->lines_capacity, (size_t)(end_triangle - first_triangle) * 6,
                    sizeof *self->lines))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the lines of a wireframe");
    for (uint32_t t = first_triangle; t < end_triangle; t++) {
        const uint16_t *corner = item->indices + 3 * t;
        for (int side = 0; side < 3; side++) {
            self->lines[at++] = corner[side];
            self->lines[at++] = corner[(side + 1) % 3];
        }
    }
    glBufferSubData(GL_ELEMENT_ARRAY_BUFFER, (GLintptr)(first_triangle * 6 * sizeof(uint16_t)),
                    (GLsizeiptr)(at * sizeof(uint16_t)), self->lines);
    return STRL_OK;
}

static strl_status upload_indices(gl3_draw *draw, const strl_draw_item *item, strl_cache_upload upload, strl_error *err)
{
    if (upload.index_count == 0)
        return STRL_OK;
    draw->stats->uploaded_indices += upload.index_count;
    if (drawn_as_lines(draw, item))
        return upload_lines(draw, item, upload.first_index, upload.index_count, err);
    glBufferSubData(GL_ELEMENT_ARRAY_BUFFER, (GLintptr)(upload.first_index * sizeof(uint16_t)),
                    (GLsizeiptr)(upload.index_count * sizeof(uint16_t)), item->indices + upload.first_index);
    return STRL_OK;
}

/* The item's entry, resident, up to date, its vertex array bound. */
static strl_status make_resident(gl3_draw *draw, const strl_draw_item *item, strl_cache_entry **out, strl_error *err)
{
    strl_cache_entry *entry = strl__cache_find(&draw->self->gl.cache, item->key);
    bool lines = drawn_as_lines(draw, item);
    uint32_t needed = lines ? item->index_count * 2 : item->index_count;
    if (entry &&
        (entry->lines != lines || entry->vertex_count != item->vertex_count || entry->index_capacity < needed)) {
        release(draw->self, entry);
        entry = NULL;
    }
    strl_cache_upload upload = strl__cache_plan(entry, item, draw->frame);
    bool vertices = upload.vertices;
    if (entry) {
        glBindVertexArray(entry->place.names.array);
        strl__cache_touch(&draw->self->gl.cache, entry);
    } else {
        strl_status status = add(draw, item, &entry, err);
        if (status != STRL_OK)
            return status;
    }
    vertices |= strl__style_update(entry, item, draw->options);
    strl_status status = vertices ? upload_vertices(draw, entry, item, err) : STRL_OK;
    if (status == STRL_OK)
        status = upload_indices(draw, item, upload, err);
    if (status != STRL_OK) {
        release(draw->self, entry);
        return status;
    }
    strl__cache_commit(entry, item, draw->frame);
    *out = entry;
    return STRL_OK;
}

static strl_status draw_item(gl3_draw *draw, const strl_draw_item *item, const strl_gl_item *record, strl_error *err)
{
    strl_cache_entry *entry;
    strl_status status = make_resident(draw, item, &entry, err);
    if (status != STRL_OK)
        return status;
    if (entry->hidden)
        return STRL_OK;
    bool points = item->point_px > 0, discards = entry->translucent || entry->hides || draw->discards;
    const strl_gl_program *program = &draw->self->gl.programs[discards ? STRL_GL_NODE_ALPHA : STRL_GL_NODE];
    glUseProgram(program->name);
    glUniform4fv(program->rows, 6, record->rows[0]);
    glUniform4iv(program->base, 2, record->base[0]);
    bool lines = drawn_as_lines(draw, item);
    uint32_t copies = lines ? 2 : 1;
    glDrawElements(points  ? GL_POINTS
                   : lines ? GL_LINES
                           : GL_TRIANGLES,
                   (GLsizei)(copies * item->draw_count), GL_UNSIGNED_SHORT,
                   (const void *)(uintptr_t)(copies * item->draw_first * sizeof(uint16_t)));
    draw->stats->triangles += points ? 0 : item->draw_count / 3;
    draw->stats->items++;
    draw->stats->draws++;
    return STRL_OK;
}

static strl_status gl3_draw_list(strl_renderer *renderer, const strl_draw_setup *setup, const strl_draw_list *list,
                                 strl_render_stats *stats, strl_error *err)
{
    gl3_renderer *self = (gl3_renderer *)renderer;
    bool es = self->gl.dialect.es;
    gl3_draw draw = {.self = self,
                     .frame = list->frame,
                     .lines = setup->options.wireframe && es,
                     .discards = strl__gl_has_section(setup) && es,
                     .options = &setup->options,
                     .stats = stats};
    strl_gl_placing placing = {0};
    strl_status status = STRL_OK;
    strl__gl_make_current(&self->gl);
    strl__gl_begin_draw(&self->gl, setup);
    for (uint32_t i = 0; status == STRL_OK && i < list->count; i++) {
        const strl_draw_item *item = &list->items[i];
        if (!item->visible || item->draw_count == 0 || strl__item_style(item, &setup->options) == STRL_PART_HIDDEN)
            continue;
        status = strl__check_item_counts(item, err);
        if (status != STRL_OK)
            continue;
        strl_gl_item record;
        strl__gl_item_make(&placing, setup, item, &record);
        if (setup->cull_back)
            strl__gl_set_fronts(placing.mirrors);
        status = draw_item(&draw, item, &record, err);
    }
    stats->uploaded_bytes = stats->uploaded_vertices * sizeof(strl_vertex) + stats->uploaded_indices * sizeof(uint16_t);
    stats->gpu_bytes = self->node_bytes;
    strl_status ended = strl__gl_end_draw(&self->gl, status == STRL_OK ? err : NULL);
    return status != STRL_OK ? status : ended;
}

static void gl3_destroy(strl_renderer *renderer)
{
    gl3_renderer *self = (gl3_renderer *)renderer;
    strl__gl_make_current(&self->gl);
    while (self->gl.cache.oldest)
        release(self, self->gl.cache.oldest);
    strl__gl_deinit(&self->gl);
    strl__free(self->lines);
    strl__free(self->styled);
    strl__free(self);
}

static const strl_renderer_class gl3_class = {
    .backend = STRL_BACKEND_GL3,
    .draw = gl3_draw_list,
    .finish = strl__gl_finish,
    .resize = strl__gl_resize,
    .read_colour = strl__gl_read_colour,
    .read_depth = strl__gl_read_depth,
    .present = strl__gl_present,
    .destroy = gl3_destroy,
};

strl_status strl__gl3_renderer_create(const strl_renderer_desc *desc, strl_renderer **renderer, strl_error *err)
{
    gl3_renderer *self = strl__alloc_zero(1, sizeof *self);
    if (!self)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a renderer");
    strl_status status = strl__gl_init(&self->gl, &gl3_class, desc, err);
    if (status != STRL_OK) {
        strl__free(self);
        return status;
    }
    *renderer = &self->gl.base;
    return STRL_OK;
}
