/* KHR_draco_mesh_compression through libdraco, which is C++: nothing else here is, and no exception
 * leaves. */
#ifndef STRL_READERS_GLTF_DRACO_H
#define STRL_READERS_GLTF_DRACO_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct strl__draco strl__draco; /* a decoded mesh */

/* What the bytes announce. */
typedef struct strl__draco_facts {
    uint64_t faces, points;      /* points: before seams part them */
    uint64_t connectivity_bytes; /* of memory that decoding the faces takes, about, with the bytes */
    bool is_edgebreaker;
} strl__draco_facts;

/* How much memory the attributes may take beside that, and what they want, about; 0: it was not come
 * so far. */
typedef struct strl__draco_room {
    uint64_t bytes, wanted;
} strl__draco_room;

/* Before anything is decoded. Returns 0, or -1 where that cannot be read: damaged, a point cloud, or
 * a version before 2.2. */
int strl__draco_announced(const uint8_t *data, size_t size, strl__draco_facts *facts);
/* NULL where the bytes are damaged, memory ends or the room; then `why` is a short text. */
strl__draco *strl__draco_decode(const uint8_t *data, size_t size, const strl__draco_facts *facts,
                                strl__draco_room *room, char why[120]);
uint64_t strl__draco_face_count(const strl__draco *mesh);
uint64_t strl__draco_point_count(const strl__draco *mesh);
/* Corners of faces first.. as indices of points; first + count <= face_count. */
void strl__draco_faces(const strl__draco *mesh, uint64_t first, size_t count, uint32_t *corners);
/* Components of an attribute by its unique id; 0 where there is none such. */
unsigned strl__draco_components(const strl__draco *mesh, uint32_t id);
/* Of points first..; integers as they are. first + count <= point_count. Returns 0, or -1. */
int strl__draco_numbers(const strl__draco *mesh, uint32_t id, uint64_t first, size_t count, unsigned components,
                        double *numbers);
void strl__draco_close(strl__draco *mesh); /* NULL is legal */

#ifdef __cplusplus
}
#endif
#endif
