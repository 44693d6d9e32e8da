/* Seeded models for tests and benchmarks, streamed into a binary PLY or STL file, or, where they have parts, into glTF
 * or OBJ files, of any size in constant memory. The name, the count and the seed fix every byte of the file, on every
 * machine and for every number of threads. */
#ifndef STRL_SCENES_SCENE_H
#define STRL_SCENES_SCENE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "jobs/pool.h"
#include "stroll/error.h"

/* What to write. Zero-initialise: every 0 takes its default. */
typedef struct strl_scene_desc {
    const char *name; /* one of strl_scene_info's names */
    /* the output, .ply or .stl, of parts .gltf or .obj too, of the chessboard .gltf; appears, or replaces an older
     * file, when it is whole (platform/output.h). NAME.gltf comes with NAME_000.bin and so on, NAME.obj with
     * NAME.mtl; the file that names the others is renamed last */
    const char *path;
    /* of the array: the file that is copied, of any kind that readers know. What it places itself is written out;
     * refused where meshes of 256 triangles or more become more than ten times as many by that */
    const char *of;
    uint64_t copies;      /* of the array; 0 = 100 */
    const char *importer; /* of the array: the program that reads foreign formats (readers/reader.h) */
    uint64_t triangles;   /* wanted; 0 = 1,000,000. strl_scene_info says how closely a scene keeps to it */
    uint64_t seed;
    uint64_t memory_bytes; /* budget of the buffers; 0 = 256 MiB */
    strl_pool *pool;       /* borrowed; NULL = the caller's thread alone */
    strl_cancel *cancel;   /* may be NULL */
    bool no_normals;       /* leave nx ny nz out, where the scene has them; STL has none of vertices */
    uint64_t buffer_bytes; /* most bytes of one .bin of glTF, unless one part is larger; 0 = 256 MiB */
    /* vertices and triangles of PLY, triangles of STL, in a random order that the seed fixes */
    bool shuffle;
} strl_scene_desc;

/* Called on the caller's thread. done and total are items of one phase (tiles, rows); false cancels. */
typedef struct strl_scene_progress {
    bool (*report)(void *context, const char *phase, uint64_t done, uint64_t total); /* NULL = silent */
    void *context;
} strl_scene_progress;

/* What a user is told about a scene; strings are static. */
typedef struct strl_scene_info {
    const char *name;
    const char *summary;
    uint64_t triangles_min;
    uint64_t triangles_max; /* PLY's vertex index is a 32-bit int */
    bool copies;            /* has copies of a model, and as many triangles as these */
} strl_scene_info;

/* The index-th scene, NULL past the last one. */
const strl_scene_info *strl_scene_at(size_t index);

/* What was written. */
typedef struct strl_scene_result {
    uint64_t vertices; /* of the surface; STL repeats them in every triangle */
    uint64_t triangles;
    uint64_t bytes; /* of all files */
    uint64_t parts;
} strl_scene_result;

/* Writes the scene. On failure no output and no temporary file is left; an older output keeps its bytes.
 * progress, result and err may be NULL. */
strl_status strl_scene_write(const strl_scene_desc *desc, const strl_scene_progress *progress,
                             strl_scene_result *result, strl_error *err);

#endif
