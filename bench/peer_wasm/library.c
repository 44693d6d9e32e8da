/* libmeshoptimizer's C functions by its WebAssembly build: arguments are copied into the module's memory, results out.
 * The module's heap is a stack (sbrk), so what a call takes is given back at its end. */
#include "meshoptimizer.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "clusterizer.h"
#include "simplifier.h"

static Z_simplifier_instance_t simplifier;
static Z_clusterizer_instance_t clusterizer;

static void start(void)
{
    static int is_started;
    if (is_started)
        return;
    is_started = 1;
    wasm_rt_init();
    Z_simplifier_init_module();
    Z_clusterizer_init_module();
    Z_simplifier_instantiate(&simplifier);
    Z_clusterizer_instantiate(&clusterizer);
    Z_simplifierZ___wasm_call_ctors(&simplifier);
    Z_clusterizerZ___wasm_call_ctors(&clusterizer);
}

static u32 checked(u32 place)
{
    if (place == UINT32_MAX) {
        fprintf(stderr, "the WebAssembly module has no memory left\n");
        exit(1);
    }
    return place;
}

/* Room for so many bytes, filled with `bytes` where that is not NULL. */
static u32 put(const void *bytes, size_t size)
{
    u32 place = checked(Z_simplifierZ_sbrk(&simplifier, (u32)((size + 15) & ~(size_t)15)));
    if (bytes)
        memcpy(Z_simplifierZ_memory(&simplifier)->data + place, bytes, size);
    return place;
}

/* The same in the other module. */
static u32 put_cluster(const void *bytes, size_t size)
{
    u32 place = checked(Z_clusterizerZ_sbrk(&clusterizer, (u32)((size + 15) & ~(size_t)15)));
    if (bytes)
        memcpy(Z_clusterizerZ_memory(&clusterizer)->data + place, bytes, size);
    return place;
}

static void take(void *bytes, u32 place, size_t size)
{
    memcpy(bytes, Z_simplifierZ_memory(&simplifier)->data + place, size);
}

static void take_cluster(void *bytes, u32 place, size_t size)
{
    memcpy(bytes, Z_clusterizerZ_memory(&clusterizer)->data + place, size);
}

/* Gives back all that was put from `first` on. */
static void release(u32 first)
{
    Z_simplifierZ_sbrk(&simplifier, first - Z_simplifierZ_sbrk(&simplifier, 0));
}

size_t meshopt_buildMeshletsBound(size_t index_count, size_t max_vertices, size_t min_triangles)
{
    start();
    return Z_clusterizerZ_meshopt_buildMeshletsBound(&clusterizer, (u32)index_count, (u32)max_vertices,
                                                     (u32)min_triangles);
}

size_t meshopt_buildMeshletsFlex(struct meshopt_Meshlet *meshlets, unsigned *meshlet_vertices,
                                 unsigned char *meshlet_triangles, const unsigned *indices, size_t index_count,
                                 const float *positions, size_t vertex_count, size_t stride, size_t max_vertices,
                                 size_t min_triangles, size_t max_triangles, float cone_weight, float split_factor)
{
    size_t bound = meshopt_buildMeshletsBound(index_count, max_vertices, min_triangles);
    u32 meshlet = put_cluster(NULL, bound * sizeof *meshlets),
        vertex = put_cluster(NULL, index_count * sizeof *indices);
    u32 triangle = put_cluster(NULL, index_count), index = put_cluster(indices, index_count * sizeof *indices);
    u32 position = put_cluster(positions, vertex_count * stride);
    u32 count = Z_clusterizerZ_meshopt_buildMeshletsFlex(
        &clusterizer, meshlet, vertex, triangle, index, (u32)index_count, position, (u32)vertex_count, (u32)stride,
        (u32)max_vertices, (u32)min_triangles, (u32)max_triangles, cone_weight, split_factor);
    take_cluster(meshlets, meshlet, count * sizeof *meshlets);
    take_cluster(meshlet_vertices, vertex, index_count * sizeof *meshlet_vertices);
    take_cluster(meshlet_triangles, triangle, index_count);
    Z_clusterizerZ_sbrk(&clusterizer, meshlet - Z_clusterizerZ_sbrk(&clusterizer, 0));
    return count;
}

size_t meshopt_simplifyWithAttributes(unsigned *destination, const unsigned *indices, size_t index_count,
                                      const float *positions, size_t vertex_count, size_t stride,
                                      const float *attributes, size_t attributes_stride, const float *attribute_weights,
                                      size_t attribute_count, const unsigned char *vertex_lock,
                                      size_t target_index_count, float target_error, unsigned options,
                                      float *result_error)
{
    start();
    if (attributes || attribute_weights || attribute_count > 0)
        abort();
    u32 error = put(NULL, sizeof *result_error), coarse = put(NULL, index_count * sizeof *indices);
    u32 index = put(indices, index_count * sizeof *indices), position = put(positions, vertex_count * stride);
    u32 lock = put(vertex_lock, vertex_count), none = put(NULL, 16);
    u32 count = Z_simplifierZ_meshopt_simplifyWithAttributes(
        &simplifier, coarse, index, (u32)index_count, position, (u32)vertex_count, (u32)stride, none,
        (u32)attributes_stride, none, 0, lock, (u32)target_index_count, target_error, options, error);
    take(destination, coarse, count * sizeof *destination);
    take(result_error, error, sizeof *result_error);
    release(error);
    return count;
}

size_t meshopt_simplifySloppy(unsigned *destination, const unsigned *indices, size_t index_count,
                              const float *positions, size_t vertex_count, size_t stride,
                              const unsigned char *vertex_lock, size_t target_index_count, float target_error,
                              float *result_error)
{
    start();
    u32 error = put(NULL, sizeof *result_error), coarse = put(NULL, index_count * sizeof *indices);
    u32 index = put(indices, index_count * sizeof *indices), position = put(positions, vertex_count * stride);
    u32 lock = put(vertex_lock, vertex_count);
    u32 count =
        Z_simplifierZ_meshopt_simplifySloppy(&simplifier, coarse, index, (u32)index_count, position, (u32)vertex_count,
                                             (u32)stride, lock, (u32)target_index_count, target_error, error);
    take(destination, coarse, count * sizeof *destination);
    take(result_error, error, sizeof *result_error);
    release(error);
    return count;
}

float meshopt_simplifyScale(const float *positions, size_t vertex_count, size_t stride)
{
    start();
    u32 position = put(positions, vertex_count * stride);
    float scale = Z_simplifierZ_meshopt_simplifyScale(&simplifier, position, (u32)vertex_count, (u32)stride);
    release(position);
    return scale;
}
