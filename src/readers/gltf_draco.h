/* KHR_draco_mesh_compression through libdraco, which is C++: nothing else here is, and no exception
 * leaves. */
#ifndef STRL_READERS_GLTF_DRACO_H
#define STRL_READERS_GLTF_DRACO_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct strl__draco strl__draco; /* a decoded mesh */

/* What the bytes announce, before anything is decoded. Returns 0, or -1 where that cannot be read:
 * damaged, a point cloud, or a version before 2.2. */
int strl__draco_announced(const uint8_t *data, size_t size, uint64_t *faces, uint64_t *points);
/* NULL where the bytes are damaged or memory ends; then `why` is a short text. */
strl__draco *strl__draco_decode(const uint8_t *data, size_t size, char why[120]);
uint64_t strl__draco_face_count(const strl__draco *mesh);
uint64_t strl__draco_point_count(const strl__draco *mesh);
/* Corners of faces first.. as indices of points; first + count <= face_count. */
void strl__draco_faces(const strl__draco *mesh, uint64_t first, size_t count, uint32_t *corners);
/* Components of an attribute by its unique id; 0 where there is none such. */
unsigned strl__draco_components(const strl__draco *mesh, uint32_t id);
/* Of points first..; integers as they are. first + count <= point_count. Returns 0, or -1. */
int strl__draco_numbers(const strl__draco *mesh, uint32_t id, uint64_t first, size_t count,
                        unsigned components, double *numbers);
void strl__draco_close(strl__draco *mesh); /* NULL is legal */

#ifdef __cplusplus
}
#endif
#endif
