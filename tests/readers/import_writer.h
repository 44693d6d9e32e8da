/* Streams of the import protocol, written by other code than the importer's: from the words of import_protocol.h. */
#ifndef STRL_TESTS_READERS_IMPORT_WRITER_H
#define STRL_TESTS_READERS_IMPORT_WRITER_H

#include <string.h>

#include "base/cursor.h"
#include "base/hash.h"
#include "base/memory.h"
#include "readers/import_protocol.h"

typedef struct import_writer {
    strl_writer bytes;
    size_t record_at; /* of the record under way */
    uint64_t checksum;
} import_writer;

static inline void import_begin(import_writer *stream, uint32_t kind)
{
    stream->record_at = stream->bytes.size;
    strl_writer_u32(&stream->bytes, kind);
    strl_writer_u32(&stream->bytes, 0);
}

static inline void import_end_record(import_writer *stream)
{
    uint8_t *record = stream->bytes.data + stream->record_at;
    size_t size = stream->bytes.size - stream->record_at;
    strl__store_le(record + 4, 4, size - 8);
    stream->checksum = strl__mix64(stream->checksum ^ strl__checksum(record, size));
}

static inline void import_write_facts(import_writer *stream, uint32_t up, uint64_t triangles)
{
    strl_writer_bytes(&stream->bytes, "STRLIMP1", 8);
    import_begin(stream, 1);
    strl_writer_u32(&stream->bytes, up);
    strl_writer_f64(&stream->bytes, 0.25);
    strl_writer_u64(&stream->bytes, triangles);
    strl_writer_u64(&stream->bytes, 100000);
    strl_writer_bytes(&stream->bytes, "test\0\0\0\0\0\0\0\0\0\0\0\0", 16);
    import_end_record(stream);
}

static inline void import_write_part(import_writer *stream, const char *name)
{
    import_begin(stream, 2);
    strl_writer_bytes(&stream->bytes, name, strlen(name));
    import_end_record(stream);
}

static inline void import_write_material(import_writer *stream, uint32_t rgba, const char *name)
{
    import_begin(stream, 3);
    strl_writer_u32(&stream->bytes, rgba);
    strl_writer_bytes(&stream->bytes, name, strlen(name));
    import_end_record(stream);
}

/* The head of a block. */
static inline void import_begin_block(import_writer *stream, uint32_t flags, uint32_t material, uint32_t vertices,
                                      uint32_t faces, uint32_t corners)
{
    const uint32_t head[] = {flags, material, vertices, faces, corners};
    import_begin(stream, 4);
    for (int i = 0; i < 5; i++)
        strl_writer_u32(&stream->bytes, head[i]);
}

static inline void import_write_floats(import_writer *stream, const float *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        strl_writer_f32(&stream->bytes, values[i]);
}

static inline void import_write_shorts(import_writer *stream, const uint16_t *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        strl_writer_u16(&stream->bytes, values[i]);
}

/* A triangle (x, 0, 0) (x + 1, 0, 0) (x, 1, 0). */
static inline void import_write_triangle(import_writer *stream, uint32_t material, float x)
{
    const float positions[] = {x, 0, 0, x + 1, 0, 0, x, 1, 0};
    const uint16_t corners[] = {0, 1, 2};
    import_begin_block(stream, 0, material, 3, 1, 3);
    import_write_floats(stream, positions, 9);
    import_write_shorts(stream, corners, 3);
    import_end_record(stream);
}

static inline void import_write_totals(import_writer *stream, uint64_t triangles, uint64_t lines, uint64_t points,
                                       uint64_t empty)
{
    const uint64_t totals[] = {triangles, lines, points, empty, stream->checksum};
    import_begin(stream, 5);
    for (int i = 0; i < 5; i++)
        strl_writer_u64(&stream->bytes, totals[i]);
    import_end_record(stream);
}

static inline void import_write_error(import_writer *stream, uint32_t reason, const char *text)
{
    import_begin(stream, 6);
    strl_writer_u32(&stream->bytes, reason);
    strl_writer_bytes(&stream->bytes, text, strlen(text));
    import_end_record(stream);
}

static inline void import_writer_deinit(import_writer *stream)
{
    strl__free(stream->bytes.data);
    *stream = (import_writer){0};
}

#endif
