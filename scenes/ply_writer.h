/* Streams an indexed triangle mesh into a binary little-endian PLY file. PLY wants its counts first and all vertices
 * before the faces: the header has a fixed length and is written last, the faces wait in a spill beside the output. The
 * output appears by the final rename.
 * Order of calls: create, any mix of vertices and faces, then finish; destroy always (without finish it removes
 * everything). */
#ifndef STRL_SCENES_PLY_WRITER_H
#define STRL_SCENES_PLY_WRITER_H

#include <stddef.h>
#include <stdint.h>

#include "platform/output.h"

#define STRL__PLY_VERTICES_MAX 0x7fffffffu /* vertex indices are PLY's int */

typedef struct strl__ply_writer strl__ply_writer;

typedef enum strl__ply_layout {
    STRL__PLY_POSITION,        /* float x y z: 12 bytes */
    STRL__PLY_POSITION_NORMAL, /* float x y z nx ny nz: 24 bytes */
    STRL__PLY_POSITION_COLOUR  /* float x y z, uchar red green blue: 15 bytes */
} strl__ply_layout;

strl_status strl__ply_create(const char *path, strl__ply_layout layout, strl__ply_writer **writer, strl_error *err);
/* Packed records as above. */
strl_status strl__ply_vertices(strl__ply_writer *writer, const void *records, uint64_t count, strl_error *err);
/* Three vertex indices per triangle. */
strl_status strl__ply_triangles(strl__ply_writer *writer, const uint32_t *corners, uint64_t count, strl_error *err);
uint64_t strl__ply_vertex_count(const strl__ply_writer *writer);
uint64_t strl__ply_triangle_count(const strl__ply_writer *writer);
/* report: of the faces, see strl_output_append; may be NULL. *bytes: of the file; may be NULL. */
strl_status strl__ply_finish(strl__ply_writer *writer, strl_output_report report, void *context, uint64_t *bytes,
                             strl_error *err);
void strl__ply_destroy(strl__ply_writer *writer); /* NULL is legal */

#endif
