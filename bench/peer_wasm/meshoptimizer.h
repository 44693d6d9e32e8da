/* What peer_dag calls of libmeshoptimizer 1.3; library.c has it. */
#ifndef PEER_WASM_MESHOPTIMIZER_H
#define PEER_WASM_MESHOPTIMIZER_H

#include <stddef.h>

#define MESHOPTIMIZER_VERSION 1030

enum { meshopt_SimplifyPermissive = 1 << 5 };

struct meshopt_Meshlet {
    unsigned vertex_offset, triangle_offset, vertex_count, triangle_count;
};

/* From the installed library, where they are the same. */
size_t meshopt_generateVertexRemap(unsigned *destination, const unsigned *indices, size_t index_count,
                                   const void *vertices, size_t vertex_count, size_t vertex_size);
void meshopt_remapVertexBuffer(void *destination, const void *vertices, size_t vertex_count, size_t vertex_size,
                               const unsigned *remap);

/* From WebAssembly. */
size_t meshopt_buildMeshletsBound(size_t index_count, size_t max_vertices, size_t min_triangles);
size_t meshopt_buildMeshletsFlex(struct meshopt_Meshlet *meshlets, unsigned *meshlet_vertices,
                                 unsigned char *meshlet_triangles, const unsigned *indices, size_t index_count,
                                 const float *positions, size_t vertex_count, size_t stride, size_t max_vertices,
                                 size_t min_triangles, size_t max_triangles, float cone_weight, float split_factor);
/* Attributes must be NULL and none: only the shape counts here. */
size_t meshopt_simplifyWithAttributes(unsigned *destination, const unsigned *indices, size_t index_count,
                                      const float *positions, size_t vertex_count, size_t stride,
                                      const float *attributes, size_t attributes_stride, const float *attribute_weights,
                                      size_t attribute_count, const unsigned char *vertex_lock,
                                      size_t target_index_count, float target_error, unsigned options,
                                      float *result_error);
size_t meshopt_simplifySloppy(unsigned *destination, const unsigned *indices, size_t index_count,
                              const float *positions, size_t vertex_count, size_t stride,
                              const unsigned char *vertex_lock, size_t target_index_count, float target_error,
                              float *result_error);
float meshopt_simplifyScale(const float *positions, size_t vertex_count, size_t stride);

#endif
