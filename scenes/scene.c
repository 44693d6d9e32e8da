/* The list of scenes and what all of them have in common. */
#include "scenes/scene.h"

#include <inttypes.h>
#include <string.h>

#include "base/fail.h"
#include "scenes/generator.h"
#include "scenes/landscape/landscape.h"
#include "scenes/plant/plant.h"

typedef struct scene_entry {
    strl_scene_info info;
    strl_status (*generate)(strl__scene_run *run, strl_error *err);
    strl__scene_mesh_layout layout;
    /* [material_count] of a scene in parts: it writes to run->parts, not to run->writer */
    const strl__material *materials;
    unsigned material_count;
    /* it is in parts as glTF alone, where this writes it */
    strl_status (*generate_gltf)(strl__scene_run *run, strl_error *err);
} scene_entry;

#define SCENE(scene, text, least, most)                                                                                \
    .info = {.name = (scene), .summary = (text), .triangles_min = (least), .triangles_max = (most)}

static const scene_entry scenes[] = {
    {SCENE("isosurface",
           "turbulent mixing layer: high genus, many layers, open at its four side walls only (count within 2 %)", 1000,
           4000000000),
     .generate = strl__scene_isosurface, .layout = STRL__SCENE_MESH_POSITION_NORMAL},
    {SCENE("painted-plane",
           "square of jittered triangles with a pattern of sharp edges in vertex colours (count within 2 %)", 1000,
           4000000000),
     .generate = strl__scene_painted_plane, .layout = STRL__SCENE_MESH_POSITION_COLOUR},
    {SCENE("plain-plane", "the same square in one colour", 1000, 4000000000), .generate = strl__scene_plain_plane,
     .layout = STRL__SCENE_MESH_POSITION_COLOUR},
    {SCENE("boxes", "separate boxes of any orientation and size in a cube (count rounded down to whole boxes)", 12,
           3200000000),
     .generate = strl__scene_boxes, .layout = STRL__SCENE_MESH_POSITION},
    {SCENE(
         "plant",
         "power plant of named parts, 12 to 100,000 triangles each: pipes, vessels, steel, bolts; also as glTF and OBJ",
         10000, 4000000000),
     .generate = strl__scene_plant, .materials = strl__plant_materials, .material_count = STRL__PLANT_MATERIALS},
    {SCENE(
         "chessboard",
         "square of fixed size whose fields are black and white pairs of triangles (whole rows of fields); as glTF copies of 64 x 64 "
         "fields",
         2, 1000000000),
     .generate = strl__scene_chessboard, .layout = STRL__SCENE_MESH_POSITION_COLOUR,
     .materials = strl__chessboard_materials, .material_count = STRL__CHESSBOARD_MATERIALS,
     .generate_gltf = strl__scene_chessboard_copies},
    {SCENE(
         "landscape",
         "hills, houses, a forest of detailed trees; in glTF each kind is there once and has copies, other formats have "
         "the copies' triangles (count within 2 %)",
         500000, 4000000000),
     .generate = strl__scene_landscape, .materials = strl__landscape_materials,
     .material_count = STRL__LANDSCAPE_MATERIALS},
    {.info = {.name = "array",
              .summary = "--copies of the model --of FILE on a square grid, turned at random, as glTF with one mesh",
              .triangles_max = UINT64_MAX,
              .copies = true}},
};

enum { SCENE_COUNT = sizeof scenes / sizeof scenes[0] };

const strl_scene_info *strl_scene_at(size_t index)
{
    return index < SCENE_COUNT ? &scenes[index].info : NULL;
}

strl_status strl__scene_report(const strl__scene_run *run, const char *phase, uint64_t done, uint64_t total,
                               strl_error *err)
{
    const strl_scene_progress *progress = run->progress;
    if (progress && progress->report && !progress->report(progress->context, phase, done, total))
        return strl__fail(err, STRL_ERR_CANCELLED, "%s: stopped by the caller", run->desc->path);
    return STRL_OK;
}

static strl_status find_scene(const strl_scene_desc *desc, const scene_entry **entry, strl_error *err)
{
    *entry = NULL;
    if (!desc->name || !desc->path)
        return strl__fail(err, STRL_ERR_ARGUMENT, "a scene needs a name and a path");
    for (size_t i = 0; i < SCENE_COUNT && !*entry; i++)
        *entry = strcmp(scenes[i].info.name, desc->name) == 0 ? &scenes[i] : NULL;
    if (!*entry)
        return strl__fail(err, STRL_ERR_ARGUMENT, "there is no scene \"%s\"", desc->name);
    const strl_scene_info *info = &(*entry)->info;
    if (desc->triangles < info->triangles_min || desc->triangles > info->triangles_max)
        return strl__fail(err, STRL_ERR_LIMIT,
                          "scene %s has %" PRIu64 " to %" PRIu64
                          " triangles (PLY numbers vertices with an int), not %" PRIu64,
                          info->name, info->triangles_min, info->triangles_max, desc->triangles);
    return STRL_OK;
}

static strl_status report_finish(void *context, uint64_t done, uint64_t total, strl_error *err)
{
    return strl__scene_report(context, "arranging", done, total, err);
}

static bool is_in_parts(const scene_entry *entry, const char *path)
{
    return entry->generate_gltf ? strl__path_ends_in(path, ".gltf") : entry->materials != NULL;
}

static strl_status generate_parts(const scene_entry *entry, strl__scene_run *run, strl_scene_result *result,
                                  strl_error *err)
{
    const strl_scene_desc *desc = run->desc;
    const strl__parts_desc parts = {.path = desc->path,
                                    .materials = entry->materials,
                                    .material_count = entry->material_count,
                                    .no_normals = desc->no_normals,
                                    .shuffle = desc->shuffle,
                                    .seed = desc->seed,
                                    .memory_bytes = desc->memory_bytes,
                                    .buffer_bytes = desc->buffer_bytes};
    strl_status status = strl__parts_writer_create(&parts, &run->parts, err);
    if (status != STRL_OK)
        return status;
    status = (entry->generate_gltf ? entry->generate_gltf : entry->generate)(run, err);
    if (status == STRL_OK)
        status = run->parts->finish(run->parts, report_finish, run, err);
    if (status == STRL_OK && result)
        *result =
            (strl_scene_result){run->parts->vertices, run->parts->triangles, run->parts->bytes, run->parts->parts};
    run->parts->destroy(run->parts);
    return status;
}

static strl_status generate(const scene_entry *entry, strl__scene_run *run, strl_scene_result *result, strl_error *err)
{
    strl_scene_result made = {0};
    const strl_scene_desc *desc = run->desc;
    bool bare = entry->layout == STRL__SCENE_MESH_POSITION_NORMAL && desc->no_normals;
    const strl__scene_mesh_desc mesh = {.path = desc->path,
                                        .layout = bare ? STRL__SCENE_MESH_POSITION : entry->layout,
                                        .shuffle = desc->shuffle,
                                        .seed = desc->seed,
                                        .memory_bytes = desc->memory_bytes};
    strl_status status = strl__scene_mesh_create(&mesh, &run->writer, err);
    if (status == STRL_OK)
        status = entry->generate(run, err);
    if (status == STRL_OK)
        status = strl__scene_mesh_finish(run->writer, report_finish, run, &made.bytes, err);
    if (status == STRL_OK && result) {
        made.vertices = strl__scene_mesh_vertex_count(run->writer);
        made.triangles = strl__scene_mesh_triangle_count(run->writer);
        made.parts = 1;
        *result = made;
    }
    strl__scene_mesh_destroy(run->writer);
    return status;
}

strl_status strl_scene_write(const strl_scene_desc *desc, const strl_scene_progress *progress,
                             strl_scene_result *result, strl_error *err)
{
    if (result)
        *result = (strl_scene_result){0};
    strl_scene_desc full = *desc;
    full.triangles = desc->triangles ? desc->triangles : 1000000;
    full.memory_bytes = desc->memory_bytes ? desc->memory_bytes : (uint64_t)256 << 20;
    full.buffer_bytes = desc->buffer_bytes ? desc->buffer_bytes : (uint64_t)256 << 20;
    const scene_entry *entry;
    strl_status status = find_scene(&full, &entry, err);
    if (status != STRL_OK)
        return status;
    strl_pool *own_pool = NULL;
    if (!full.pool) {
        status = strl_pool_create(0, &own_pool, err);
        full.pool = own_pool;
    }
    strl__scene_run run = {.desc = &full, .progress = progress};
    if (status == STRL_OK && entry->info.copies)
        status = strl__scene_array(&run, result, err);
    else if (status == STRL_OK)
        status = (is_in_parts(entry, full.path) ? generate_parts : generate)(entry, &run, result, err);
    strl_pool_destroy(own_pool);
    return status;
}
