/* Scene `array`: copies of any model on a square grid, as one mesh of glTF and one node with EXT_mesh_gpu_instancing.
 * Triangles are streamed as they are read, each with corners of its own, so memory does not grow with the model;
 * materials become colours of vertices.
 *
 *   NAME_000.bin: corners (position, normal, colour: 32 bytes), then moves, then turns of the copies */
#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"
#include "readers/reader.h"
#include "scenes/generator.h"
#include "scenes/parts/gltf_json.h"

#define SPACING 1.25        /* of the model's sides */
#define MOST_WRITTEN_OUT 10 /* times the triangles of a model that has copies itself */
enum { ENDING = 5, AT_ONCE = 1024, CORNER_BYTES = 32, COPIES_DEFAULT = 100 };

typedef struct array_corner {
    float position[3], normal[3];
    uint16_t colour[4]; /* linear but for alpha */
} array_corner;

_Static_assert(sizeof(array_corner) == CORNER_BYTES, "corners are written as they lie in memory");

typedef struct array_scene {
    const strl__scene_run *run;
    strl_reader *reader;
    strl_output *gltf, *bin;
    strl__stream stream, text;
    uint16_t linear[256];     /* of sRGB */
    strl_triangle *triangles; /* [AT_ONCE] */
    array_corner *corners;    /* [3 * AT_ONCE] */
    float low[3], high[3];
    uint64_t count, copies; /* triangles */
    bool has_normals;
    int up;
} array_scene;

static void make_linear(uint16_t linear[256])
{
    for (int i = 0; i < 256; i++) {
        const double value = i / 255.0;
        linear[i] = (uint16_t)lround(65535 * (value <= 0.04045 ? value / 12.92 : pow((value + 0.055) / 1.055, 2.4)));
    }
}

static uint8_t channel(uint32_t rgba, int k)
{
    return (uint8_t)(rgba >> 8 * k);
}

static void put_corner(array_scene *scene, const strl_triangle *triangle, int c, uint32_t material, array_corner *to)
{
    *to = (array_corner){{0}, {0}, {0}};
    for (int k = 0; k < 3; k++) {
        to->position[k] = (float)triangle->position[c][k];
        to->normal[k] = triangle->normal[c][k];
        scene->low[k] = fminf(scene->low[k], to->position[k]);
        scene->high[k] = fmaxf(scene->high[k], to->position[k]);
        const uint32_t product = (uint32_t)channel(triangle->colour[c], k) * channel(material, k);
        to->colour[k] = scene->linear[(product + 127) / 255];
    }
    to->colour[3] = (uint16_t)((uint32_t)channel(triangle->colour[c], 3) * channel(material, 3) * 65535 / 65025);
}

static strl_status copy_some(array_scene *scene, size_t *count, strl_error *err)
{
    strl_status status = strl_reader_next(scene->reader, scene->triangles, AT_ONCE, count, err);
    for (size_t i = 0; i < *count && status == STRL_OK; i++) {
        uint32_t rgba;
        strl_reader_material(scene->reader, scene->triangles[i].material, &rgba);
        scene->has_normals = scene->has_normals || scene->triangles[i].flags & STRL_TRIANGLE_HAS_NORMAL;
        for (int c = 0; c < 3; c++)
            put_corner(scene, &scene->triangles[i], c, rgba, &scene->corners[3 * i + (size_t)c]);
    }
    scene->count += *count;
    return status == STRL_OK ? strl__stream_write(&scene->stream, scene->corners, *count * 3 * CORNER_BYTES, err)
                             : status;
}

static strl_status copy_triangles(array_scene *scene, strl_error *err)
{
    strl_reader_info info;
    size_t count = 1;
    strl_status status = STRL_OK;
    strl_reader_info_get(scene->reader, &info);
    while (status == STRL_OK && count) {
        status = copy_some(scene, &count, err);
        if (status == STRL_OK)
            status =
                strl__scene_report(scene->run, "copying", strl_reader_bytes_done(scene->reader), info.file_bytes, err);
    }
    if (status == STRL_OK && scene->count == 0)
        return strl__fail(err, STRL_ERR_FORMAT, "%s: expected a triangle, found none", scene->run->desc->of);
    if (status == STRL_OK && scene->count > UINT32_MAX / 3)
        return strl__fail(err, STRL_ERR_LIMIT, "%s: expected at most %u triangles in one mesh, found %" PRIu64,
                          scene->run->desc->of, UINT32_MAX / 3, scene->count);
    return status;
}

/* ---- copies */

/* Row by row in the plane across the up axis. */
static void place_copy(const array_scene *scene, uint64_t index, float move[3], float turn[4])
{
    const uint64_t side = (uint64_t)ceil(sqrt((double)scene->copies));
    const int a = (scene->up + 1) % 3, b = (scene->up + 2) % 3;
    const double x = SPACING * (double)(scene->high[a] - scene->low[a]),
                 y = SPACING * (double)(scene->high[b] - scene->low[b]);
    const double spacing = fmax(fmax(x, y), 1e-30);
    double c, s;
    strl__circle((double)(strl__mix64(strl__mix64(scene->run->desc->seed) + index) >> 11) * 0x1p-54, &c, &s);
    memset(move, 0, 3 * sizeof *move);
    memset(turn, 0, 4 * sizeof *turn);
    /* Turned about its own middle: that stays where the grid has it. */
    const double middle[2] = {(double)(scene->low[a] + scene->high[a]) / 2,
                              (double)(scene->low[b] + scene->high[b]) / 2};
    const double cosine = c * c - s * s, sine = 2 * c * s;
    move[a] = (float)(spacing * (double)(index % side) + middle[0] - (cosine * middle[0] - sine * middle[1]));
    move[b] = (float)(spacing * (double)(index / side) + middle[1] - (sine * middle[0] + cosine * middle[1]));
    turn[scene->up] = (float)s;
    turn[3] = (float)c;
}

static strl_status put_copies(array_scene *scene, strl_error *err)
{
    strl_status status = STRL_OK;
    for (int pass = 0; pass < 2; pass++)
        for (uint64_t i = 0; i < scene->copies && status == STRL_OK; i++) {
            float move[3], turn[4];
            place_copy(scene, i, move, turn);
            status = pass == 0 ? strl__stream_write(&scene->stream, move, sizeof move, err)
                               : strl__stream_write(&scene->stream, turn, sizeof turn, err);
        }
    return status == STRL_OK ? strl__stream_flush(&scene->stream, err) : status;
}

/* ---- text */

static strl_status put_accessor(array_scene *scene, const char *head, uint64_t count, const char *type, strl_error *err)
{
    return strl__json_print(&scene->text, err, "%s,\"count\":%" PRIu64 ",\"type\":\"%s\"", head, count, type);
}

static strl_status put_accessors(array_scene *scene, strl_error *err)
{
    const uint64_t corners = 3 * scene->count;
    strl__stream *text = &scene->text;
    strl_status status =
        put_accessor(scene, "\"accessors\":[\n{\"bufferView\":0,\"componentType\":5126", corners, "VEC3", err);
    if (status == STRL_OK)
        status = strl__json_floats(text, "min", scene->low, 3, err);
    if (status == STRL_OK)
        status = strl__json_floats(text, "max", scene->high, 3, err);
    if (status == STRL_OK)
        status =
            put_accessor(scene, "},\n{\"bufferView\":0,\"byteOffset\":24,\"componentType\":5123,\"normalized\":true",
                         corners, "VEC4", err);
    if (status == STRL_OK)
        status = put_accessor(scene, "},\n{\"bufferView\":1,\"componentType\":5126", scene->copies, "VEC3", err);
    if (status == STRL_OK)
        status = put_accessor(scene, "},\n{\"bufferView\":2,\"componentType\":5126", scene->copies, "VEC4", err);
    if (status == STRL_OK && scene->has_normals)
        status =
            put_accessor(scene, "},\n{\"bufferView\":0,\"byteOffset\":12,\"componentType\":5126", corners, "VEC3", err);
    return status == STRL_OK ? strl__json_print(text, err, "}],\n") : status;
}

static strl_status put_views(array_scene *scene, const char *bin, strl_error *err)
{
    const uint64_t corners = 3 * scene->count * CORNER_BYTES, moves = scene->copies * 12, turns = scene->copies * 16;
    strl__stream *text = &scene->text;
    strl_status status = strl__json_print(text, err, "\"buffers\":[{\"uri\":\"");
    if (status == STRL_OK)
        status = strl__json_uri(text, strl__path_name(bin), err);
    return status == STRL_OK
               ? strl__json_print(text, err,
                                  "\",\"byteLength\":%" PRIu64 "}],\n\"bufferViews\":["
                                  "{\"buffer\":0,\"byteLength\":%" PRIu64 ",\"byteStride\":%d,\"target\":34962},\n"
                                  "{\"buffer\":0,\"byteOffset\":%" PRIu64 ",\"byteLength\":%" PRIu64 "},\n"
                                  "{\"buffer\":0,\"byteOffset\":%" PRIu64 ",\"byteLength\":%" PRIu64 "}],\n",
                                  corners + moves + turns, corners, CORNER_BYTES, corners, moves, corners + moves,
                                  turns)
               : status;
}

static strl_status put_text(array_scene *scene, const char *bin, strl_error *err)
{
    strl__stream *text = &scene->text;
    strl_status status = strl__json_print(
        text, err,
        "{\"asset\":{\"version\":\"2.0\",\"generator\":\"stroll scene\"},"
        "\"extensionsUsed\":[\"EXT_mesh_gpu_instancing\"],\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\n");
    if (status == STRL_OK)
        status = strl__json_print(
            text, err,
            "\"nodes\":[{\"name\":\"ARRAY\"%s,\"mesh\":0,\"extensions\":{\"EXT_mesh_gpu_instancing\":{\"attributes\":"
            "{\"TRANSLATION\":2,\"ROTATION\":3}}}}],\n\"meshes\":[{\"name\":\"COPIED\",\"primitives\":[{\"attributes\":"
            "{\"POSITION\":0,\"COLOR_0\":1%s}}]}],\n",
            /* glTF has y up */
            scene->up == 2 ? ",\"rotation\":[-0.70710678,0,0,0.70710678]" : "",
            scene->has_normals ? ",\"NORMAL\":4" : "");
    if (status == STRL_OK)
        status = put_accessors(scene, err);
    if (status == STRL_OK)
        status = put_views(scene, bin, err);
    if (status == STRL_OK)
        status = strl__json_print(text, err, "\"materials\":[]}\n");
    return status == STRL_OK ? strl__stream_flush(text, err) : status;
}

/* ---- the whole */

/* Copies of copies would need a node for each: glTF's nodes have one parent, and its instances no children. What a
 * model places is written out, which a forest is not made for. */
static strl_status check_copies(const strl_scene_desc *desc, const strl_reader *reader, strl_error *err)
{
    uint64_t own = 0, placed = 0;
    for (uint32_t i = 0; i < strl_reader_piece_count(reader); i++) {
        strl_reader_piece piece;
        strl_reader_piece_get(reader, i, &piece);
        own += piece.triangles;
        placed += piece.triangles * piece.placements;
    }
    return placed / MOST_WRITTEN_OUT <= own
               ? STRL_OK
               : strl__fail(err, STRL_ERR_LIMIT,
                            "%s: it places its %" PRIu64 " triangles so often that they are %" PRIu64
                            ", and an array has them written out: expected at most %d times as many",
                            desc->of, own, placed, MOST_WRITTEN_OUT);
}

static strl_status open_model(array_scene *scene, strl_error *err)
{
    const strl_scene_desc *desc = scene->run->desc;
    strl_reader_desc reading = {.path = desc->of,
                                .memory_bytes = desc->memory_bytes,
                                .child = {.importer = desc->importer},
                                .most_pieces = STRL_READER_MOST_PIECES};
    strl_status status = strl_reader_open(&reading, &scene->reader, err);
    if (status != STRL_OK || strl_reader_piece_count(scene->reader) == 1)
        return status;
    status = check_copies(desc, scene->reader, err);
    strl_reader_close(scene->reader);
    scene->reader = NULL;
    reading.most_pieces = 0;
    return status == STRL_OK ? strl_reader_open(&reading, &scene->reader, err) : status;
}

static strl_status open_all(array_scene *scene, const char *bin, strl_error *err)
{
    const strl_scene_desc *desc = scene->run->desc;
    strl_reader_info info;
    scene->triangles = strl__alloc(AT_ONCE, sizeof *scene->triangles);
    scene->corners = strl__alloc((size_t)3 * AT_ONCE, sizeof *scene->corners);
    if (!scene->triangles || !scene->corners)
        return strl__fail(err, STRL_ERR_MEMORY, "%s: no memory to copy triangles", desc->path);
    strl_status status = open_model(scene, err);
    if (status == STRL_OK)
        status = strl_output_open(desc->path, NULL, &scene->gltf, err);
    if (status == STRL_OK)
        status = strl_output_open(bin, NULL, &scene->bin, err);
    if (status == STRL_OK)
        status = strl__stream_init(&scene->stream, bin, err);
    if (status == STRL_OK)
        status = strl__stream_init(&scene->text, desc->path, err);
    if (status != STRL_OK)
        return status;
    strl_reader_info_get(scene->reader, &info);
    scene->up = (int)info.default_up;
    scene->stream.file = strl_output_file(scene->bin);
    scene->text.file = strl_output_file(scene->gltf);
    return STRL_OK;
}

static strl_status write_all(array_scene *scene, const char *bin, strl_error *err)
{
    strl_status status = copy_triangles(scene, err);
    if (status == STRL_OK)
        status = put_copies(scene, err);
    if (status == STRL_OK)
        status = put_text(scene, bin, err);
    if (status == STRL_OK)
        status = strl_output_finish(scene->bin, false, err);
    return status == STRL_OK ? strl_output_finish(scene->gltf, false, err) : status;
}

strl_status strl__scene_array(const strl__scene_run *run, strl_scene_result *result, strl_error *err)
{
    const strl_scene_desc *desc = run->desc;
    array_scene scene = {.run = run,
                         .copies = desc->copies ? desc->copies : COPIES_DEFAULT,
                         .low = {INFINITY, INFINITY, INFINITY},
                         .high = {-INFINITY, -INFINITY, -INFINITY}};
    if (!desc->of || !strl__path_ends_in(desc->path, ".gltf"))
        return strl__fail(err, STRL_ERR_ARGUMENT,
                          "%s: an array is of a file and written as glTF, expected a name that ends in .gltf",
                          desc->path);
    char *bin = strl__path_sibling(desc->path, ENDING, "_000.bin");
    make_linear(scene.linear);
    strl_status status =
        bin ? open_all(&scene, bin, err) : strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for a path", desc->path);
    if (status == STRL_OK)
        status = write_all(&scene, bin, err);
    if (status == STRL_OK && result)
        *result = (strl_scene_result){3 * scene.count * scene.copies, scene.count * scene.copies,
                                      scene.stream.offset + scene.text.offset, scene.copies};
    strl_reader_close(scene.reader);
    strl__stream_deinit(&scene.stream);
    strl__stream_deinit(&scene.text);
    strl_output_close(scene.bin);
    strl_output_close(scene.gltf);
    strl__free(scene.triangles);
    strl__free(scene.corners);
    strl__free(bin);
    return status;
}
