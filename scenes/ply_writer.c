/* See ply_writer.h. */
#include "scenes/ply_writer.h"

#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "platform/file.h"
#include "platform/output.h"

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "records are copied as they lie in memory");

enum { HEADER_BYTES = 512, BUFFER_BYTES = 1 << 20, FACE_BYTES = 13 };

typedef struct stream {
    strl_file *file;
    uint8_t *buffer;
    size_t used;
    uint64_t offset; /* in the file, of the buffer's first byte */
} stream;

struct strl__ply_writer {
    strl_output *output;
    stream vertices; /* becomes the output, whose file it has */
    stream faces;    /* has a file without a name */
    char *path;
    strl__ply_layout layout;
    uint64_t vertex_count;
    uint64_t triangle_count;
};

static size_t record_bytes(strl__ply_layout layout)
{
    return layout == STRL__PLY_POSITION ? 12 : layout == STRL__PLY_POSITION_NORMAL ? 24 : 15;
}

static strl_status stream_init(stream *out, const char *path, strl_error *err)
{
    out->buffer = strl__alloc(BUFFER_BYTES, 1);
    if (!out->buffer)
        return strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for an output buffer of %d bytes", path, BUFFER_BYTES);
    return STRL_OK;
}

static strl_status stream_flush(stream *out, strl_error *err)
{
    strl_status status = strl_file_write(out->file, out->offset, out->buffer, out->used, err);
    if (status == STRL_OK) {
        out->offset += out->used;
        out->used = 0;
    }
    return status;
}

static strl_status stream_write(stream *out, const void *data, uint64_t bytes, strl_error *err)
{
    const uint8_t *from = data;
    while (bytes > 0) {
        if (out->used == BUFFER_BYTES) {
            strl_status status = stream_flush(out, err);
            if (status != STRL_OK)
                return status;
        }
        size_t room = BUFFER_BYTES - out->used;
        size_t part = bytes < room ? (size_t)bytes : room;
        memcpy(out->buffer + out->used, from, part);
        out->used += part;
        from += part;
        bytes -= part;
    }
    return STRL_OK;
}

strl_status strl__ply_create(const char *path, strl__ply_layout layout, strl__ply_writer **writer, strl_error *err)
{
    *writer = NULL;
    strl__ply_writer *self = strl__alloc_zero(1, sizeof *self);
    if (!self)
        return strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for the writer", path);
    self->layout = layout;
    self->path = strl__strdup(path);
    strl_status status = self->path ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for the path", path);
    if (status == STRL_OK)
        status = stream_init(&self->vertices, path, err);
    if (status == STRL_OK)
        status = stream_init(&self->faces, path, err);
    if (status == STRL_OK)
        status = strl_output_open(path, NULL, &self->output, err);
    if (status == STRL_OK)
        status = strl_output_spill(self->output, &self->faces.file, err);
    if (status != STRL_OK) {
        strl__ply_destroy(self);
        return status;
    }
    self->vertices.file = strl_output_file(self->output);
    self->vertices.offset = HEADER_BYTES;
    *writer = self;
    return STRL_OK;
}

void strl__ply_destroy(strl__ply_writer *writer)
{
    if (!writer)
        return;
    strl_output_close(writer->output);
    strl_file_close(writer->faces.file, NULL);
    strl__free(writer->vertices.buffer);
    strl__free(writer->faces.buffer);
    strl__free(writer->path);
    strl__free(writer);
}

strl_status strl__ply_vertices(strl__ply_writer *writer, const void *records, uint64_t count, strl_error *err)
{
    if (count > STRL__PLY_VERTICES_MAX - writer->vertex_count)
        return strl__fail(err, STRL_ERR_LIMIT, "%s: more than %u vertices, which PLY's int cannot number", writer->path,
                          STRL__PLY_VERTICES_MAX);
    writer->vertex_count += count;
    return stream_write(&writer->vertices, records, count * record_bytes(writer->layout), err);
}

strl_status strl__ply_triangles(strl__ply_writer *writer, const uint32_t *corners, uint64_t count, strl_error *err)
{
    stream *out = &writer->faces;
    writer->triangle_count += count;
    while (count > 0) {
        if (BUFFER_BYTES - out->used < FACE_BYTES) {
            strl_status status = stream_flush(out, err);
            if (status != STRL_OK)
                return status;
        }
        size_t room = (BUFFER_BYTES - out->used) / FACE_BYTES;
        size_t part = count < room ? (size_t)count : room;
        uint8_t *to = out->buffer + out->used;
        for (size_t i = 0; i < part; i++, to += FACE_BYTES, corners += 3) {
            to[0] = 3;
            memcpy(to + 1, corners, 3 * sizeof *corners);
        }
        out->used += part * FACE_BYTES;
        count -= part;
    }
    return STRL_OK;
}

uint64_t strl__ply_vertex_count(const strl__ply_writer *writer)
{
    return writer->vertex_count;
}

uint64_t strl__ply_triangle_count(const strl__ply_writer *writer)
{
    return writer->triangle_count;
}

/* A comment fills the header up to its fixed length. */
static strl_status write_header(strl__ply_writer *writer, strl_error *err)
{
    static const char *const attributes[] = {"", "property float nx\nproperty float ny\nproperty float nz\n",
                                             "property uchar red\nproperty uchar green\nproperty uchar blue\n"};
    static const char end[] = "\nend_header\n";
    char header[HEADER_BYTES + 1];
    int length = snprintf(header, sizeof header,
                          "ply\nformat binary_little_endian 1.0\ncomment made by stroll scene\nelement vertex %" PRIu64
                          "\nproperty float x\nproperty float y\nproperty float z\n%selement face %" PRIu64
                          "\nproperty list uchar int vertex_indices\ncomment ",
                          writer->vertex_count, attributes[writer->layout], writer->triangle_count);
    memset(header + length, '.', HEADER_BYTES - (size_t)length);
    memcpy(header + HEADER_BYTES - (sizeof end - 1), end, sizeof end - 1);
    return strl_file_write(writer->vertices.file, 0, header, HEADER_BYTES, err);
}

strl_status strl__ply_finish(strl__ply_writer *writer, strl_output_report report, void *context, uint64_t *bytes,
                             strl_error *err)
{
    strl_status status = stream_flush(&writer->vertices, err);
    if (status == STRL_OK)
        status = stream_flush(&writer->faces, err);
    if (status == STRL_OK)
        status = strl_output_append(writer->output, writer->faces.file, report, context, err);
    if (status == STRL_OK)
        status = write_header(writer, err);
    if (bytes)
        *bytes = strl_file_bytes(writer->vertices.file);
    return status == STRL_OK ? strl_output_finish(writer->output, false, err) : status;
}
