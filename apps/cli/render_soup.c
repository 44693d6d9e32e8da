/* An input file drawn as read: no weld, no lattice, no container. The reference for images. Its triangles are kept in
 * memory as batches of float vertices (about 20 bytes a triangle, and while a file without normals is read about 70
 * more); the renderer keeps on the GPU what its budget allows and streams the rest in every frame. */
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"
#include "frame/view.h"
#include "geometry/colour.h"
#include "geometry/octahedral.h"
#include "interrupt.h"
#include "platform/thread.h"
#include "readers/reader.h"
#include "render_model.h"
#include "render_normals.h"
#include "shared/importer.h"

/* What is read is held whole, however large, so that reading it may take more than a reader's default as well. */
#define READER_BYTES ((uint64_t)1 << 30)
#define IMPORTER_BYTES ((uint64_t)4 << 30)
#define READ_TRIANGLES 4096u
#define BATCH_VERTICES 65535u
#define BATCH_INDICES (3u * 65536u)
#define TABLE_SLOTS (1u << 17)
#define NO_VERTEX UINT32_MAX

typedef struct soup_batch {
    strl_vertex *vertices; /* owned */
    uint16_t *indices;     /* owned */
    uint32_t vertex_count, index_count;
    strl_box box; /* model units */
} soup_batch;

typedef struct soup_model {
    strl_render_model base;
    strl_cull cull;
    double origin[3]; /* the first corner of the file: positions are floats from there */
    soup_batch *batches;
    size_t batch_count, batch_capacity;
    strl_draw_item *items; /* one a batch */
} soup_model;

/* Reading: the batch under way and what its passes know. */
typedef struct soup_load {
    soup_model *model;
    strl_reader *reader;
    strl_cli_progress *progress;
    const char *stage;
    uint64_t file_bytes, triangles;
    bool has_origin, lacks_normals;
    strl_smooth_normals *normals; /* NULL where the file has all */
    strl_vertex *vertices;        /* [BATCH_VERTICES] */
    uint16_t *indices;            /* [BATCH_INDICES] */
    uint32_t *slots;              /* [TABLE_SLOTS] vertex by content */
    uint32_t vertex_count, index_count;
} soup_load;

typedef strl_status (*soup_take)(soup_load *load, const strl_triangle *triangle, strl_error *err);

static strl_status read_pass(soup_load *load, const char *stage, soup_take take, strl_error *err)
{
    strl_triangle *triangles = strl__alloc(READ_TRIANGLES, sizeof *triangles);
    strl_status status = triangles ? strl_reader_rewind(load->reader, err)
                                   : strl__fail(err, STRL_ERR_MEMORY, "no memory to read triangles");
    size_t count = 1;
    load->triangles = 0;
    while (status == STRL_OK && count > 0) {
        status = strl_reader_next(load->reader, triangles, READ_TRIANGLES, &count, err);
        for (size_t t = 0; status == STRL_OK && t < count; t++, load->triangles++)
            status = take(load, &triangles[t], err);
        strl_cli_progress_update(load->progress, stage, strl_reader_bytes_done(load->reader), load->file_bytes,
                                 "bytes");
        if (status == STRL_OK)
            status = strl_cli_check_interrupt(err);
    }
    strl__free(triangles);
    return status;
}

static bool has_normals(const strl_triangle *triangle)
{
    return triangle->flags & STRL_TRIANGLE_HAS_NORMAL;
}

static strl_status take_bounds(soup_load *load, const strl_triangle *triangle, strl_error *err)
{
    (void)err;
    double *bounds = load->model->base.bounds;
    if (!load->has_origin) {
        memcpy(load->model->origin, triangle->position[0], sizeof load->model->origin);
        memcpy(bounds, triangle->position[0], 3 * sizeof *bounds);
        memcpy(bounds + 3, triangle->position[0], 3 * sizeof *bounds);
        load->has_origin = true;
    }
    load->lacks_normals |= !has_normals(triangle);
    for (int c = 0; c < 3; c++)
        for (int i = 0; i < 3; i++) {
            bounds[i] = fmin(bounds[i], triangle->position[c][i]);
            bounds[3 + i] = fmax(bounds[3 + i], triangle->position[c][i]);
        }
    return STRL_OK;
}

static void float_positions(const soup_load *load, const strl_triangle *triangle, float out[3][3])
{
    for (int c = 0; c < 3; c++)
        for (int i = 0; i < 3; i++)
            out[c][i] = (float)(triangle->position[c][i] - load->model->origin[i]);
}

static strl_status take_normals(soup_load *load, const strl_triangle *triangle, strl_error *err)
{
    float position[3][3];
    float_positions(load, triangle, position);
    return strl_smooth_normals_add(load->normals, position, err);
}

/* ---- batches */

static strl_status close_batch(soup_load *load, strl_error *err)
{
    soup_model *model = load->model;
    if (load->index_count == 0)
        return STRL_OK;
    if (!strl__grow(&model->batches, &model->batch_capacity, model->batch_count + 1, sizeof *model->batches))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the list of batches");
    soup_batch batch = {.vertices = strl__alloc(load->vertex_count, sizeof *batch.vertices),
                        .indices = strl__alloc(load->index_count, sizeof *batch.indices),
                        .vertex_count = load->vertex_count,
                        .index_count = load->index_count};
    model->batches[model->batch_count++] = batch;
    if (!batch.vertices || !batch.indices)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to hold the model: %" PRIu64 " triangles are read",
                          load->triangles);
    memcpy(batch.vertices, load->vertices, load->vertex_count * sizeof *batch.vertices);
    memcpy(batch.indices, load->indices, load->index_count * sizeof *batch.indices);
    strl_box *box = &model->batches[model->batch_count - 1].box;
    for (uint32_t v = 0; v < load->vertex_count; v++)
        for (int i = 0; i < 3; i++) {
            float offset;
            memcpy(&offset, &batch.vertices[v].position[i], sizeof offset);
            box->min[i] = v == 0 ? offset : fmin(box->min[i], offset);
            box->max[i] = v == 0 ? offset : fmax(box->max[i], offset);
        }
    for (int i = 0; i < 3; i++)
        box->min[i] += model->origin[i], box->max[i] += model->origin[i];
    memset(load->slots, 0xff, TABLE_SLOTS * sizeof *load->slots);
    load->vertex_count = load->index_count = 0;
    return STRL_OK;
}

static uint16_t number_vertex(soup_load *load, const strl_vertex *vertex)
{
    uint32_t at = (uint32_t)strl__checksum(vertex, sizeof *vertex) & (TABLE_SLOTS - 1);
    while (load->slots[at] != NO_VERTEX && memcmp(&load->vertices[load->slots[at]], vertex, sizeof *vertex) != 0)
        at = (at + 1) & (TABLE_SLOTS - 1);
    if (load->slots[at] == NO_VERTEX) {
        load->slots[at] = load->vertex_count;
        load->vertices[load->vertex_count++] = *vertex;
    }
    return (uint16_t)load->slots[at];
}

static strl_status take_batches(soup_load *load, const strl_triangle *triangle, strl_error *err)
{
    if (load->vertex_count + 3 > BATCH_VERTICES || load->index_count + 3 > BATCH_INDICES) {
        strl_status status = close_batch(load, err);
        if (status != STRL_OK)
            return status;
    }
    uint32_t material = UINT32_MAX;
    strl_reader_material(load->reader, triangle->material, &material);
    float position[3][3];
    float_positions(load, triangle, position);
    for (int c = 0; c < 3; c++) {
        strl_vertex vertex;
        float computed[3];
        const float *normal = triangle->normal[c];
        memcpy(vertex.position, position[c], sizeof vertex.position);
        if (!has_normals(triangle)) {
            strl_smooth_normals_corner(load->normals, load->triangles, c, computed);
            normal = computed;
        }
        strl_oct_encode(normal, vertex.normal);
        uint32_t rgba = strl_rgba_multiply(triangle->colour[c], material);
        for (unsigned i = 0; i < 4; i++)
            vertex.rgba[i] = (uint8_t)(rgba >> 8 * i);
        load->indices[load->index_count++] = number_vertex(load, &vertex);
    }
    return STRL_OK;
}

static strl_status make_items(soup_model *model, strl_error *err)
{
    model->items = strl__alloc_zero(model->batch_count, sizeof *model->items);
    if (!model->items)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a draw list of %zu items", model->batch_count);
    for (size_t b = 0; b < model->batch_count; b++) {
        const soup_batch *batch = &model->batches[b];
        strl_draw_item *item = &model->items[b];
        *item = (strl_draw_item){.key = b + 1,
                                 .node = (uint32_t)b,
                                 .vertices = batch->vertices,
                                 .vertex_count = batch->vertex_count,
                                 .indices = batch->indices,
                                 .index_count = batch->index_count,
                                 .draw_count = batch->index_count,
                                 .positions = STRL_POSITIONS_FLOAT};
        memcpy(item->origin, model->origin, sizeof item->origin);
        for (int i = 0; i < 3; i++)
            item->transform[i * 5] = 1;
    }
    return STRL_OK;
}

static strl_status make_normals(soup_load *load, strl_error *err)
{
    strl_status status = strl_smooth_normals_create(&load->normals, err);
    if (status == STRL_OK)
        status = read_pass(load, "collect faces", take_normals, err);
    return status == STRL_OK ? strl_smooth_normals_finish(load->normals, err) : status;
}

static strl_status make_batches(soup_load *load, strl_error *err)
{
    load->vertices = strl__alloc(BATCH_VERTICES, sizeof *load->vertices);
    load->indices = strl__alloc(BATCH_INDICES, sizeof *load->indices);
    load->slots = strl__alloc(TABLE_SLOTS, sizeof *load->slots);
    if (!load->vertices || !load->indices || !load->slots)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a batch of triangles");
    memset(load->slots, 0xff, TABLE_SLOTS * sizeof *load->slots);
    strl_status status = read_pass(load, "load", take_batches, err);
    return status == STRL_OK ? close_batch(load, err) : status;
}

static bool go_on(void *context)
{
    strl_cli_progress_update(context, "import", 0, 0, "bytes");
    return !strl_cli_interrupted();
}

static strl_status load_soup(soup_model *model, const strl_render_model_desc *desc, strl_error *err)
{
    soup_load load = {.model = model, .progress = desc->progress};
    strl_reader_info info;
    const char *scratch = getenv("TMPDIR");
    const strl_reader_desc reading = {
        .path = desc->location.name,
        .scratch_dir = scratch ? scratch : "/tmp",
        .memory_bytes = READER_BYTES,
        .child = {
            .importer = strl_importer(), .memory_bytes = IMPORTER_BYTES, .go_on = go_on, .context = desc->progress}};
    strl_status status = strl_reader_open(&reading, &load.reader, err);
    if (status != STRL_OK)
        return status;
    strl_reader_info_get(load.reader, &info);
    load.file_bytes = info.file_bytes;
    model->base.up_axis = (unsigned)info.default_up;
    status = read_pass(&load, "read", take_bounds, err);
    if (status == STRL_OK && load.triangles == 0)
        status = strl__fail(err, STRL_ERR_FORMAT, "%s has no triangle to draw", desc->location.name);
    if (status == STRL_OK && load.lacks_normals)
        status = make_normals(&load, err);
    if (status == STRL_OK)
        status = make_batches(&load, err);
    if (status == STRL_OK)
        status = make_items(model, err);
    strl_smooth_normals_destroy(load.normals);
    strl__free(load.vertices);
    strl__free(load.indices);
    strl__free(load.slots);
    strl_reader_close(load.reader);
    return status;
}

/* ---- drawing */

static strl_status soup_draw(strl_render_model *model, strl_renderer *renderer, const strl_camera *camera,
                             const strl_draw_options *options, strl_image_stats *stats, strl_error *err)
{
    soup_model *self = (soup_model *)model;
    strl_view view;
    uint64_t start = strl_clock_ns();
    if (!strl_view_init(&view, camera))
        return strl__fail(err, STRL_ERR_ARGUMENT, "the camera is degenerate");
    double least = INFINITY, largest = 0;
    for (size_t b = 0; b < self->batch_count; b++) {
        double near_depth, far_depth;
        self->items[b].visible = strl_view_sees(&view, &self->batches[b].box);
        if (!self->items[b].visible) {
            stats->nodes_culled++;
            continue;
        }
        strl_view_depth_range(&view, &self->batches[b].box, &near_depth, &far_depth);
        least = fmin(least, near_depth), largest = fmax(largest, far_depth);
    }
    strl_draw_list list = {.items = self->items, .count = (uint32_t)self->batch_count, .cull = self->cull};
    strl_render_set_range(&list, least, largest);
    stats->select_ns = strl_clock_ns() - start;
    strl_render_stats drawn;
    strl_status status = strl_renderer_draw(renderer, camera, &list, options, &drawn, err);
    strl_renderer_finish(renderer);
    stats->frame_ns = strl_clock_ns() - start;
    stats->draw_ns = stats->frame_ns - stats->select_ns;
    strl_render_add_stats(stats, &drawn);
    return status;
}

static void soup_close(strl_render_model *model)
{
    soup_model *self = (soup_model *)model;
    for (size_t b = 0; b < self->batch_count; b++) {
        strl__free(self->batches[b].vertices);
        strl__free(self->batches[b].indices);
    }
    strl__free(self->batches);
    strl__free(self->items);
    strl__free(self);
}

static const strl_render_model_class soup_class = {.draw = soup_draw, .close = soup_close};

strl_status strl_render_soup_open(const strl_render_model_desc *desc, strl_render_model **model, strl_error *err)
{
    soup_model *self = strl__alloc_zero(1, sizeof *self);
    if (!self)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a model");
    self->base.klass = &soup_class;
    self->cull = desc->cull;
    strl_status status = load_soup(self, desc, err);
    if (status != STRL_OK) {
        soup_close(&self->base);
        return status;
    }
    *model = &self->base;
    return STRL_OK;
}
