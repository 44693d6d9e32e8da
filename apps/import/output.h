/* The stream on its way out: records of readers/import_protocol.h, written as they are made. */
#ifndef STRL_IMPORT_OUTPUT_H
#define STRL_IMPORT_OUTPUT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "readers/import_protocol.h"

typedef struct import_facts {
    unsigned up; /* 0 x, 1 y, 2 z */
    double unit_metres;
    uint64_t triangles, stream_most;
    char format[STRL_IMPORT_FORMAT_BYTES];
} import_facts;

/* What an end tells. */
typedef struct import_totals {
    uint64_t triangles, lines, points, empty_faces;
} import_totals;

/* A corner as it goes out; compared by content. */
typedef struct import_vertex {
    double position[3];
    float normal[3];
    uint32_t colour; /* sRGB-encoded RGBA8; 0xffffffff where absent */
} import_vertex;

typedef struct import_output import_output;

/* Nothing but records goes to the descriptor. NULL without memory. */
import_output *import_output_create(int descriptor);
/* After a failed write (the reader has gone) all that follows is dropped. */
void import_output_facts(import_output *output, const import_facts *facts);
void import_output_part(import_output *output, const char *name);
void import_output_material(import_output *output, uint32_t rgba, const char *name);
/* Of the faces that follow; a change ends the block. */
void import_output_begin(import_output *output, uint32_t material, bool has_normals, bool has_colours);
/* corner_count 3 to STRL_IMPORT_CORNERS_MOST. */
void import_output_face(import_output *output, const import_vertex *corners, uint32_t corner_count);
void import_output_end(import_output *output, const import_totals *totals);
bool import_output_failed(const import_output *output);
void import_output_destroy(import_output *output);

/* Bytes that blocks of so many faces and corners take at most, begun `pieces` times. */
uint64_t import_output_most_bytes(uint64_t pieces, uint64_t faces, uint64_t corners);

/* The magic, and an error of one sentence without its end as the stream's only or next record. Allocates nothing, for
 * when there is no memory left. */
void import_write_magic(int descriptor);
void import_write_error(int descriptor, enum strl_import_reason reason, const char *sentence);

#endif
