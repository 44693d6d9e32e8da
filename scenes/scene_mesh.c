/* See scene_mesh.h. */
#include "scenes/scene_mesh.h"

#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"
#include "scenes/facets.h"
#include "scenes/shuffle.h"

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "records are copied as they lie in memory");

enum { PLY_HEADER_BYTES = 512, STL_TITLE_BYTES = 80, STL_HEADER_BYTES = 84 };

struct strl__scene_mesh {
    strl_output *output;
    strl__stream body;     /* onto the output, behind its header */
    strl__stream vertices; /* onto a spill, where they must wait */
    strl__stream faces;    /* onto a spill */
    strl__scene_mesh_desc desc;
    char *path; /* desc's, owned */
    bool is_stl;
    uint64_t vertex_count;
    uint64_t triangle_count;
};

/* What finish tells of its steps as one. */
typedef struct finishing {
    strl_output_report report;
    void *context;
    uint64_t done_before, total;
} finishing;

static size_t record_bytes(strl__scene_mesh_layout layout)
{
    return layout == STRL__SCENE_MESH_POSITION ? 12 : layout == STRL__SCENE_MESH_POSITION_NORMAL ? 24 : 15;
}

static bool vertices_wait(const strl__scene_mesh *writer)
{
    return writer->is_stl || writer->desc.shuffle;
}

static bool ends_in(const char *path, const char *ending)
{
    size_t length = strlen(path), own = strlen(ending);
    return length > own && strcasecmp(path + length - own, ending) == 0;
}

static strl_status find_format(strl__scene_mesh *writer, strl_error *err)
{
    strl_status status = strl_output_check(writer->path, err); /* no file at all is worse than a wrong ending */
    if (status != STRL_OK)
        return status;
    writer->is_stl = ends_in(writer->path, ".stl");
    if (writer->is_stl || ends_in(writer->path, ".ply"))
        return STRL_OK;
    return strl__fail(err, STRL_ERR_ARGUMENT,
                      "%s: a scene is written as PLY or STL, expected a name that ends in .ply or .stl", writer->path);
}

static strl_status open_files(strl__scene_mesh *writer, strl_error *err)
{
    strl_status status = strl_output_open(writer->path, NULL, &writer->output, err);
    if (status == STRL_OK && vertices_wait(writer))
        status = strl_output_spill(writer->output, &writer->vertices.file, err);
    if (status == STRL_OK)
        status = strl_output_spill(writer->output, &writer->faces.file, err);
    if (status != STRL_OK)
        return status;
    writer->body.file = strl_output_file(writer->output);
    writer->body.offset = writer->is_stl ? STL_HEADER_BYTES : PLY_HEADER_BYTES;
    return STRL_OK;
}

strl_status strl__scene_mesh_create(const strl__scene_mesh_desc *desc, strl__scene_mesh **writer, strl_error *err)
{
    *writer = NULL;
    strl__scene_mesh *self = strl__alloc_zero(1, sizeof *self);
    if (!self)
        return strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for the writer", desc->path);
    self->desc = *desc;
    self->path = strl__strdup(desc->path);
    self->desc.path = self->path;
    strl_status status = self->path ? find_format(self, err)
                                    : strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for the path", desc->path);
    strl__stream *const streams[] = {&self->body, &self->vertices, &self->faces};
    for (int i = 0; i < 3 && status == STRL_OK; i++)
        status = strl__stream_init(streams[i], desc->path, err);
    if (status == STRL_OK)
        status = open_files(self, err);
    if (status != STRL_OK) {
        strl__scene_mesh_destroy(self);
        return status;
    }
    *writer = self;
    return STRL_OK;
}

void strl__scene_mesh_destroy(strl__scene_mesh *writer)
{
    if (!writer)
        return;
    strl_output_close(writer->output);
    strl_file_close(writer->vertices.file, NULL);
    strl_file_close(writer->faces.file, NULL);
    strl__stream_deinit(&writer->body);
    strl__stream_deinit(&writer->vertices);
    strl__stream_deinit(&writer->faces);
    strl__free(writer->path);
    strl__free(writer);
}

strl_status strl__scene_mesh_vertices(strl__scene_mesh *writer, const void *records, uint64_t count, strl_error *err)
{
    if (count > STRL__SCENE_MESH_VERTICES_MAX - writer->vertex_count)
        return strl__fail(err, STRL_ERR_LIMIT, "%s: more than %u vertices, which PLY's int cannot number", writer->path,
                          STRL__SCENE_MESH_VERTICES_MAX);
    writer->vertex_count += count;
    return strl__stream_write(vertices_wait(writer) ? &writer->vertices : &writer->body, records,
                              count * record_bytes(writer->desc.layout), err);
}

strl_status strl__scene_mesh_triangles(strl__scene_mesh *writer, const uint32_t *corners, uint64_t count,
                                       strl_error *err)
{
    strl__stream *out = &writer->faces;
    writer->triangle_count += count;
    for (uint64_t i = 0; i < count; i++, corners += 3) {
        strl_status status = strl__stream_reserve(out, STRL__FACE_BYTES, err);
        if (status != STRL_OK)
            return status;
        uint8_t *to = out->buffer + out->used;
        to[0] = 3;
        memcpy(to + 1, corners, 3 * sizeof *corners);
        out->used += STRL__FACE_BYTES;
    }
    return STRL_OK;
}

uint64_t strl__scene_mesh_vertex_count(const strl__scene_mesh *writer)
{
    return writer->vertex_count;
}

uint64_t strl__scene_mesh_triangle_count(const strl__scene_mesh *writer)
{
    return writer->triangle_count;
}

/* ---- what is left to do when all is known ---- */

static strl_status report_step(void *context, uint64_t done, uint64_t total, strl_error *err)
{
    const finishing *steps = context;
    (void)total;
    return steps->report ? steps->report(steps->context, steps->done_before + done, steps->total, err) : STRL_OK;
}

/* Appends the records as they come, or in the given order. */
static strl_status write_records(strl__scene_mesh *writer, const strl__records *records, const strl__permutation *order,
                                 finishing *steps, strl_error *err)
{
    strl_file *spill = NULL;
    strl_status status = STRL_OK;
    if (!order) {
        status = strl__records_write(records, &writer->body, report_step, steps, err);
    } else {
        status = strl_output_spill(writer->output, &spill, err);
        const strl__shuffle shuffle = {order, writer->desc.memory_bytes / 2, spill, writer->path, report_step, steps};
        if (status == STRL_OK)
            status = strl__shuffle_write(&shuffle, records, &writer->body, err);
        strl_file_close(spill, NULL);
    }
    steps->done_before += records->count * records->bytes * (order ? 2 : 1);
    return status;
}

/* Faces whose vertices have moved. */
typedef struct renamed_faces {
    strl__spilled faces;
    const strl__permutation *vertices;
} renamed_faces;

static strl_status read_renamed(void *context, uint64_t first, size_t count, uint8_t *records, strl_error *err)
{
    renamed_faces *from = context;
    strl_status status = strl__spilled_read(&from->faces, first, count, records, err);
    for (size_t i = 0; status == STRL_OK && i < count; i++) {
        uint32_t corners[3];
        memcpy(corners, records + i * STRL__FACE_BYTES + 1, sizeof corners);
        for (int k = 0; k < 3; k++)
            corners[k] = (uint32_t)strl__permutation_at(from->vertices, corners[k]);
        memcpy(records + i * STRL__FACE_BYTES + 1, corners, sizeof corners);
    }
    return status;
}

static strl_status finish_shuffled_ply(strl__scene_mesh *writer, finishing *steps, strl_error *err)
{
    size_t bytes = record_bytes(writer->desc.layout);
    const strl__permutation vertex_order = strl__permutation_of(writer->vertex_count, writer->desc.seed ^ 1);
    const strl__permutation face_order = strl__permutation_of(writer->triangle_count, strl__mix64(writer->desc.seed));
    strl__spilled vertices = {writer->vertices.file, bytes};
    renamed_faces faces = {{writer->faces.file, STRL__FACE_BYTES}, &vertex_order};
    const strl__records records[] = {{writer->vertex_count, bytes, strl__spilled_read, &vertices},
                                     {writer->triangle_count, STRL__FACE_BYTES, read_renamed, &faces}};
    steps->total = 2 * (writer->vertex_count * bytes + writer->triangle_count * STRL__FACE_BYTES);
    strl_status status = write_records(writer, &records[0], &vertex_order, steps, err);
    return status == STRL_OK ? write_records(writer, &records[1], &face_order, steps, err) : status;
}

static strl_status finish_stl(strl__scene_mesh *writer, finishing *steps, strl_error *err)
{
    const strl__permutation order = strl__permutation_of(writer->triangle_count, strl__mix64(writer->desc.seed));
    strl__facets facets = {.faces = {writer->faces.file, STRL__FACE_BYTES},
                           .vertices = writer->vertices.file,
                           .vertex_bytes = record_bytes(writer->desc.layout),
                           .vertex_count = writer->vertex_count};
    const strl__records records = {writer->triangle_count, STRL__FACET_BYTES, strl__facets_read, &facets};
    steps->total = writer->triangle_count * STRL__FACET_BYTES * (writer->desc.shuffle ? 2 : 1);
    strl_status status = strl__facets_init(&facets, writer->desc.memory_bytes / 4, writer->path, err);
    if (status == STRL_OK)
        status = write_records(writer, &records, writer->desc.shuffle ? &order : NULL, steps, err);
    strl__facets_deinit(&facets);
    return status;
}

static strl_status write_stl_header(strl__scene_mesh *writer, strl_error *err)
{
    char header[STL_HEADER_BYTES] = "binary STL made by stroll scene";
    uint32_t count = (uint32_t)writer->triangle_count;
    memcpy(header + STL_TITLE_BYTES, &count, sizeof count);
    return strl_file_write(writer->body.file, 0, header, STL_HEADER_BYTES, err);
}

/* A comment fills the header up to its fixed length. */
static strl_status write_ply_header(strl__scene_mesh *writer, strl_error *err)
{
    static const char *const attributes[] = {"", "property float nx\nproperty float ny\nproperty float nz\n",
                                             "property uchar red\nproperty uchar green\nproperty uchar blue\n"};
    static const char end[] = "\nend_header\n";
    char header[PLY_HEADER_BYTES + 1];
    int length = snprintf(header, sizeof header,
                          "ply\nformat binary_little_endian 1.0\ncomment made by stroll scene\nelement vertex %" PRIu64
                          "\nproperty float x\nproperty float y\nproperty float z\n%selement face %" PRIu64
                          "\nproperty list uchar int vertex_indices\ncomment ",
                          writer->vertex_count, attributes[writer->desc.layout], writer->triangle_count);
    memset(header + length, '.', PLY_HEADER_BYTES - (size_t)length);
    memcpy(header + PLY_HEADER_BYTES - (sizeof end - 1), end, sizeof end - 1);
    return strl_file_write(writer->body.file, 0, header, PLY_HEADER_BYTES, err);
}

strl_status strl__scene_mesh_finish(strl__scene_mesh *writer, strl_output_report report, void *context, uint64_t *bytes,
                                    strl_error *err)
{
    finishing steps = {.report = report, .context = context};
    strl_status status = strl__stream_flush(&writer->faces, err);
    if (status == STRL_OK)
        status = strl__stream_flush(vertices_wait(writer) ? &writer->vertices : &writer->body, err);
    if (status == STRL_OK && writer->is_stl)
        status = finish_stl(writer, &steps, err);
    else if (status == STRL_OK && writer->desc.shuffle)
        status = finish_shuffled_ply(writer, &steps, err);
    else if (status == STRL_OK)
        status = strl_output_append(writer->output, writer->faces.file, report, context, err);
    if (status == STRL_OK && vertices_wait(writer))
        status = strl__stream_flush(&writer->body, err);
    if (status == STRL_OK)
        status = writer->is_stl ? write_stl_header(writer, err) : write_ply_header(writer, err);
    if (bytes)
        *bytes = strl_file_bytes(writer->body.file);
    return status == STRL_OK ? strl_output_finish(writer->output, false, err) : status;
}
