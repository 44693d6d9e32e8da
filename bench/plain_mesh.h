/* Triangle meshes for the programs that measure Stroll from outside: a PLY reader and writer and nothing else. It
 * shares no code with Stroll's readers on purpose, and reads what they need: binary little-endian, scalar vertex
 * properties, faces of three corners. */
#ifndef BENCH_PLAIN_MESH_H
#define BENCH_PLAIN_MESH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct plain_mesh {
    double *position; /* three a vertex; owned */
    uint32_t *corner; /* three a triangle, below vertex_count; owned */
    size_t vertex_count, triangle_count;
} plain_mesh;

/* False after a sentence on standard error; the mesh is then empty. */
bool plain_mesh_read(const char *path, plain_mesh *mesh);

/* Vertices that no corner names are left out. `position`: three floats a vertex. */
bool plain_mesh_write(const char *path, const float *position, size_t vertex_count, const uint32_t *corner,
                      size_t triangle_count);

void plain_mesh_free(plain_mesh *mesh);

/* Length of the diagonal of the box round all vertices. */
double plain_mesh_diagonal(const plain_mesh *mesh);

/* Memory or the end of the program. */
void *plain_allocate(size_t count, size_t size);

#endif
