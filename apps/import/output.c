#include "output.h"

#include <errno.h>
#include <string.h>
#include <unistd.h>

#include "base/cursor.h"
#include "base/hash.h"
#include "base/memory.h"

#define SLOTS (2 * STRL_IMPORT_CORNERS_MOST) /* of the table of vertices; a power of two */

struct import_output {
    int descriptor;
    bool failed;
    uint64_t checksum;
    uint32_t material;
    bool has_normals, has_colours;
    /* The block under way. */
    bool needs_doubles, has_polygons;
    uint32_t vertex_count, face_count, corner_count;
    import_vertex vertices[STRL_IMPORT_CORNERS_MOST];
    uint16_t face_corners[STRL_IMPORT_CORNERS_MOST / 3];
    uint16_t corners[STRL_IMPORT_CORNERS_MOST];
    uint16_t slots[SLOTS]; /* index of a vertex + 1; 0 = free */
    uint8_t record[STRL_IMPORT_RECORD_HEAD + STRL_IMPORT_RECORD_MOST];
};

/* ---- bytes ---- */

static bool write_all(int descriptor, const void *data, size_t size)
{
    const uint8_t *at = data;
    while (size > 0) {
        ssize_t written = write(descriptor, at, size);
        if (written < 0 && errno == EINTR)
            continue;
        if (written <= 0)
            return false;
        at += written;
        size -= (size_t)written;
    }
    return true;
}

static uint8_t *put_le(uint8_t *at, unsigned bytes, uint64_t value)
{
    strl__store_le(at, bytes, value);
    return at + bytes;
}

static uint8_t *put_f32(uint8_t *at, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return put_le(at, 4, bits);
}

static uint8_t *put_f64(uint8_t *at, double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return put_le(at, 8, bits);
}

static uint8_t *put_text(uint8_t *at, const char *text, size_t most)
{
    size_t length = strnlen(text, most);
    memcpy(at, text, length);
    return at + length;
}

static uint8_t *payload_of(import_output *output)
{
    return output->record + STRL_IMPORT_RECORD_HEAD;
}

/* The record whose payload ends at `end`. */
static void send(import_output *output, enum strl_import_record kind, const uint8_t *end)
{
    size_t size = (size_t)(end - output->record);
    put_le(put_le(output->record, 4, kind), 4, size - STRL_IMPORT_RECORD_HEAD);
    if (kind != STRL_IMPORT_END)
        output->checksum = strl__mix64(output->checksum ^ strl__checksum(output->record, size));
    if (!output->failed && !write_all(output->descriptor, output->record, size))
        output->failed = true;
}

void import_write_magic(int descriptor)
{
    write_all(descriptor, STRL_IMPORT_MAGIC, STRL_IMPORT_MAGIC_BYTES);
}

void import_write_error(int descriptor, enum strl_import_reason reason, const char *sentence)
{
    uint8_t record[STRL_IMPORT_RECORD_HEAD + 4 + STRL_IMPORT_TEXT_MOST];
    uint8_t *at = put_le(record + STRL_IMPORT_RECORD_HEAD, 4, reason);
    at = put_text(at, sentence, STRL_IMPORT_TEXT_MOST);
    size_t size = (size_t)(at - record);
    put_le(put_le(record, 4, STRL_IMPORT_ERROR), 4, size - STRL_IMPORT_RECORD_HEAD);
    write_all(descriptor, record, size);
}

/* ---- blocks ---- */

static uint8_t *put_vertices(const import_output *output, uint8_t *at)
{
    for (uint32_t i = 0; i < output->vertex_count; i++)
        for (int k = 0; k < 3; k++) {
            double value = output->vertices[i].position[k];
            at = output->needs_doubles ? put_f64(at, value) : put_f32(at, (float)value);
        }
    for (uint32_t i = 0; output->has_normals && i < output->vertex_count; i++)
        for (int k = 0; k < 3; k++)
            at = put_f32(at, output->vertices[i].normal[k]);
    for (uint32_t i = 0; output->has_colours && i < output->vertex_count; i++)
        at = put_le(at, 4, output->vertices[i].colour);
    return at;
}

static void end_block(import_output *output)
{
    if (output->face_count == 0)
        return;
    uint32_t flags = (output->has_normals ? STRL_IMPORT_NORMALS : 0) | (output->has_colours ? STRL_IMPORT_COLOURS : 0) |
                     (output->needs_doubles ? STRL_IMPORT_DOUBLES : 0) |
                     (output->has_polygons ? STRL_IMPORT_POLYGONS : 0);
    uint8_t *at = put_le(payload_of(output), 4, flags);
    at = put_le(at, 4, output->material);
    at = put_le(at, 4, output->vertex_count);
    at = put_le(at, 4, output->face_count);
    at = put_le(at, 4, output->corner_count);
    at = put_vertices(output, at);
    for (uint32_t i = 0; output->has_polygons && i < output->face_count; i++)
        at = put_le(at, 2, output->face_corners[i]);
    for (uint32_t i = 0; i < output->corner_count; i++)
        at = put_le(at, 2, output->corners[i]);
    send(output, STRL_IMPORT_BLOCK, at);
    output->vertex_count = output->face_count = output->corner_count = 0;
    output->needs_doubles = output->has_polygons = false;
    memset(output->slots, 0, sizeof output->slots);
}

/* Many importers give each face its own copies of its corners; in a block each is written once. */
static uint16_t find_vertex(import_output *output, const import_vertex *vertex)
{
    size_t slot = (size_t)strl__checksum(vertex, sizeof *vertex) & (SLOTS - 1);
    for (; output->slots[slot]; slot = (slot + 1) & (SLOTS - 1)) {
        uint16_t index = (uint16_t)(output->slots[slot] - 1);
        if (memcmp(&output->vertices[index], vertex, sizeof *vertex) == 0)
            return index;
    }
    for (int k = 0; k < 3; k++)
        output->needs_doubles |= (double)(float)vertex->position[k] != vertex->position[k];
    output->vertices[output->vertex_count] = *vertex;
    output->slots[slot] = (uint16_t)++output->vertex_count;
    return (uint16_t)(output->vertex_count - 1);
}

void import_output_begin(import_output *output, uint32_t material, bool has_normals, bool has_colours)
{
    if (material == output->material && has_normals == output->has_normals && has_colours == output->has_colours)
        return;
    end_block(output);
    output->material = material;
    output->has_normals = has_normals;
    output->has_colours = has_colours;
}

void import_output_face(import_output *output, const import_vertex *corners, uint32_t corner_count)
{
    if (output->corner_count + corner_count > STRL_IMPORT_CORNERS_MOST)
        end_block(output);
    for (uint32_t i = 0; i < corner_count; i++)
        output->corners[output->corner_count++] = find_vertex(output, &corners[i]);
    output->face_corners[output->face_count++] = (uint16_t)corner_count;
    output->has_polygons |= corner_count > 3;
}

uint64_t import_output_most_bytes(uint64_t pieces, uint64_t faces, uint64_t corners)
{
    /* A block ends early by less than a third of its corners unless a larger polygon follows, which begins the next. */
    uint64_t blocks = pieces + corners / (STRL_IMPORT_CORNERS_MOST / 2) + 1;
    return blocks * (STRL_IMPORT_RECORD_HEAD + STRL_IMPORT_BLOCK_HEAD) + faces * 2 + corners * (24 + 12 + 4 + 2);
}

/* ---- other records ---- */

import_output *import_output_create(int descriptor)
{
    import_output *output = strl__alloc_zero(1, sizeof *output);
    if (output) {
        output->descriptor = descriptor;
        output->material = STRL_IMPORT_NO_MATERIAL;
    }
    return output;
}

void import_output_destroy(import_output *output)
{
    strl__free(output);
}

void import_output_facts(import_output *output, const import_facts *facts)
{
    uint8_t *at = put_le(payload_of(output), 4, facts->up);
    at = put_f64(at, facts->unit_metres);
    at = put_le(at, 8, facts->triangles);
    at = put_le(at, 8, facts->stream_most);
    memcpy(at, facts->format, sizeof facts->format);
    send(output, STRL_IMPORT_FACTS, at + sizeof facts->format);
}

void import_output_part(import_output *output, const char *name)
{
    end_block(output);
    send(output, STRL_IMPORT_PART, put_text(payload_of(output), name, STRL_IMPORT_NAME_MOST));
}

void import_output_material(import_output *output, uint32_t rgba, const char *name)
{
    end_block(output);
    uint8_t *at = put_le(payload_of(output), 4, rgba);
    send(output, STRL_IMPORT_MATERIAL, put_text(at, name, STRL_IMPORT_NAME_MOST));
}

void import_output_end(import_output *output, const import_totals *totals)
{
    end_block(output);
    uint8_t *at = put_le(payload_of(output), 8, totals->triangles);
    at = put_le(at, 8, totals->lines);
    at = put_le(at, 8, totals->points);
    at = put_le(at, 8, totals->empty_faces);
    at = put_le(at, 8, output->checksum);
    send(output, STRL_IMPORT_END, at);
}

bool import_output_failed(const import_output *output)
{
    return output->failed;
}
