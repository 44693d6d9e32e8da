/* Reads a scene's PLY back, by its own few lines, and counts what makes a mesh sound. */
#ifndef STRL_TESTS_SCENES_MESH_CHECK_H
#define STRL_TESTS_SCENES_MESH_CHECK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct mesh_check {
    uint8_t *bytes; /* the whole file */
    size_t size;
    uint32_t vertex_count;
    uint32_t triangle_count;
    size_t record_bytes;
    const uint8_t *records;
    uint32_t *corners; /* 3 per triangle */
} mesh_check;

/* Fails the test where the file is not exactly a header, the vertices and the triangles. */
void mesh_check_load(mesh_check *mesh, const char *path);
void mesh_check_free(mesh_check *mesh);
void mesh_check_position(const mesh_check *mesh, uint32_t vertex, float position[3]);
void mesh_check_normal(const mesh_check *mesh, uint32_t vertex, float normal[3]);
/* The face's normal, twice as long as its area. */
void mesh_check_face(const mesh_check *mesh, uint32_t triangle, double normal[3]);

typedef struct mesh_topology {
    uint64_t edges;
    uint64_t open_edges;    /* used by one triangle */
    uint64_t crowded_edges; /* used by more than two, or twice in the same direction */
    uint64_t open_inside;   /* open edges that do not lie on one of the walls x, y = least or most */
    uint64_t unused_vertices;
    uint64_t components;
    uint64_t rims;       /* closed lines of open edges */
    uint64_t fans_apart; /* vertices whose triangles are not one fan */
    int64_t genus;       /* of all components together */
} mesh_topology;

void mesh_check_topology(const mesh_check *mesh, mesh_topology *topology);
uint64_t mesh_check_duplicate_positions(const mesh_check *mesh);

#endif
