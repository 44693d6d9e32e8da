/* Streams an indexed triangle mesh into a binary little-endian PLY or STL file, in the order given or in a seeded
 * random one. PLY wants its counts first and all vertices before the faces, STL wants each triangle with its corners:
 * what cannot be written yet waits in spills beside the output, and the header, of a fixed length, comes last. The
 * output appears by the final rename. Order of calls: create, any mix of vertices and triangles, then finish; destroy
 * always (without finish it removes everything). A triangle may name vertices that come after it. */
#ifndef STRL_SCENES_SCENE_MESH_H
#define STRL_SCENES_SCENE_MESH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "platform/output.h"

#define STRL__SCENE_MESH_VERTICES_MAX 0x7fffffffu /* vertex indices are PLY's int */

typedef struct strl__scene_mesh strl__scene_mesh;

typedef enum strl__scene_mesh_layout {
    STRL__SCENE_MESH_POSITION,        /* float x y z: 12 bytes */
    STRL__SCENE_MESH_POSITION_NORMAL, /* float x y z nx ny nz: 24 bytes */
    STRL__SCENE_MESH_POSITION_COLOUR  /* float x y z, uchar red green blue: 15 bytes */
} strl__scene_mesh_layout;

typedef struct strl__scene_mesh_desc {
    const char *path;               /* ends in .ply or .stl, which says the format */
    strl__scene_mesh_layout layout; /* of the vertices as they are given; STL keeps the positions alone */
    bool shuffle;                   /* vertices and triangles of PLY, triangles of STL, in an order of this seed */
    uint64_t seed;
    uint64_t memory_bytes; /* of what finish holds */
} strl__scene_mesh_desc;

strl_status strl__scene_mesh_create(const strl__scene_mesh_desc *desc, strl__scene_mesh **writer, strl_error *err);
/* Packed records as above. */
strl_status strl__scene_mesh_vertices(strl__scene_mesh *writer, const void *records, uint64_t count, strl_error *err);
/* Three vertex indices per triangle. */
strl_status strl__scene_mesh_triangles(strl__scene_mesh *writer, const uint32_t *corners, uint64_t count,
                                       strl_error *err);
uint64_t strl__scene_mesh_vertex_count(const strl__scene_mesh *writer);
uint64_t strl__scene_mesh_triangle_count(const strl__scene_mesh *writer);
/* report: of what finish has to write, see strl_output_append; may be NULL. *bytes: of the file; may be NULL. */
strl_status strl__scene_mesh_finish(strl__scene_mesh *writer, strl_output_report report, void *context, uint64_t *bytes,
                                    strl_error *err);
void strl__scene_mesh_destroy(strl__scene_mesh *writer); /* NULL is legal */

#endif
