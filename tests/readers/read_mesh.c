/* read_mesh FILE [MEMORY_BYTES [SCRATCH_DIR [MOST_PIECES]]]: what a reader gives, as one JSON object for scripts:
 * the triangles (the first 4,096 of them), a hash of all positions, drops, parts, materials. Reads
 * twice and exits 3 where the two passes differ. A refusal is {"error": SENTENCE}. */
#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "readers/reader.h"

#define BATCH 509u
#define SHOWN 4096u

typedef struct pass_result {
    uint64_t count, hash;
    strl_reader_drops drops;
    json_t *triangles; /* NULL: they are not listed */
} pass_result;

/* FNV-1a over the coordinates in 1/1024, so that a script can do the same sum. */
static uint64_t hash_number(uint64_t hash, double value)
{
    int64_t rounded = fabs(value) < 1e15 ? (int64_t)floor(value * 1024 + 0.5) : INT64_MAX;
    for (unsigned i = 0; i < 8; i++)
        hash = (hash ^ ((uint64_t)rounded >> (8 * i) & 255)) * 1099511628211u;
    return hash;
}

static json_t *show(const strl_triangle *t)
{
    json_t *positions = json_array(), *normals = json_array(), *colours = json_array();
    json_t *texcoords = json_array(); /* none where there are none */
    for (unsigned i = 0; i < 9; i++) {
        json_array_append_new(positions, json_real(t->position[i / 3][i % 3]));
        json_array_append_new(normals, json_real((double)t->normal[i / 3][i % 3]));
    }
    for (unsigned i = 0; i < 3; i++)
        json_array_append_new(colours, json_integer(t->colour[i]));
    for (unsigned i = 0; i < 6 && t->flags & STRL_TRIANGLE_HAS_TEXCOORD; i++)
        json_array_append_new(texcoords, json_real((double)t->texcoord[i / 2][i % 2]));
    return json_pack("{s:o,s:o,s:o,s:o,s:I,s:I,s:I}", "positions", positions, "normals", normals, "colours", colours,
                     "texcoords", texcoords, "part", (json_int_t)t->part, "material", (json_int_t)t->material, "flags",
                     (json_int_t)t->flags);
}

static strl_status read_pass(strl_reader *reader, pass_result *pass, strl_error *err)
{
    static strl_triangle triangles[BATCH];
    strl_status status;
    size_t count;
    pass->hash = 14695981039346656037u;
    do {
        status = strl_reader_next(reader, triangles, BATCH, &count, err);
        for (size_t i = 0; i < count && !status; i++) {
            for (unsigned k = 0; k < 9; k++)
                pass->hash = hash_number(pass->hash, triangles[i].position[k / 3][k % 3]);
            if (pass->triangles && pass->count < SHOWN)
                json_array_append_new(pass->triangles, show(&triangles[i]));
            pass->count++;
        }
    } while (!status && count);
    strl_reader_drops_get(reader, &pass->drops);
    return status;
}

/* Each piece, and placements, the first 4,096 of them. */
static strl_status add_pieces(strl_reader *reader, json_t *result, strl_error *err)
{
    json_t *pieces = json_array(), *placements = json_array();
    strl_reader_placement placement;
    uint64_t count = 0;
    bool found = true;
    strl_status status = STRL_OK;
    for (uint32_t p = 0; p < strl_reader_piece_count(reader) && !status; p++) {
        strl_reader_piece facts;
        pass_result pass = {0};
        char hash[24];
        strl_reader_piece_get(reader, p, &facts);
        status = strl_reader_select(reader, p, err);
        if (!status)
            status = read_pass(reader, &pass, err);
        snprintf(hash, sizeof hash, "%016" PRIx64, pass.hash);
        json_array_append_new(pieces,
                              json_pack("{s:I,s:I,s:b,s:I,s:s,s:I,s:I}", "announced", (json_int_t)facts.triangles,
                                        "placements", (json_int_t)facts.placements, "empty", (int)facts.is_empty,
                                        "count", (json_int_t)pass.count, "hash", hash, "lines",
                                        (json_int_t)pass.drops.lines, "points", (json_int_t)pass.drops.points));
    }
    if (!status)
        status = strl_reader_begin_placements(reader, err);
    while (!status && found) {
        status = strl_reader_next_placement(reader, &placement, &found, err);
        if (status || !found || ++count > SHOWN)
            continue;
        json_t *numbers = json_array();
        for (unsigned i = 0; i < 12; i++)
            json_array_append_new(numbers, json_real(placement.transform[i]));
        json_array_append_new(placements, json_pack("[I,o,s]", (json_int_t)placement.piece, numbers,
                                                    strl_reader_part_name(reader, placement.part)));
    }
    strl_reader_drops drops;
    strl_reader_drops_get(reader, &drops);
    json_object_set_new(result, "pieces", pieces);
    json_object_set_new(result, "placements", placements);
    json_object_set_new(result, "placement_count", json_integer((json_int_t)count));
    json_object_set_new(result, "placement_nonfinite", json_integer((json_int_t)drops.nonfinite));
    return status;
}

static json_t *describe(const strl_reader *reader, const pass_result *pass)
{
    char hash[24];
    strl_reader_info info;
    json_t *parts = json_array(), *materials = json_array();
    strl_reader_info_get(reader, &info);
    for (uint32_t i = 0; i < strl_reader_part_count(reader); i++)
        json_array_append_new(parts, json_string(strl_reader_part_name(reader, i)));
    for (uint32_t i = 0; i < strl_reader_material_count(reader); i++) {
        uint32_t rgba;
        const char *name = strl_reader_material(reader, i, &rgba);
        json_array_append_new(materials, json_pack("[s,I]", name, (json_int_t)rgba));
    }
    snprintf(hash, sizeof hash, "%016" PRIx64, pass->hash);
    return json_pack("{s:s,s:s,s:i,s:I,s:b,s:I,s:I,s:I,s:I,s:s,s:I,s:I,s:I,s:I,s:o,s:o,s:O,s:I,s:s}", "format",
                     info.format, "unit", info.default_unit ? info.default_unit : "", "up", (int)info.default_up,
                     "hint", (json_int_t)info.triangles_hint, "exact", (int)info.hint_is_exact, "bytes",
                     (json_int_t)info.file_bytes, "bytes_done", (json_int_t)strl_reader_bytes_done(reader), "vertices",
                     (json_int_t)strl_reader_vertex_count(reader), "count", (json_int_t)pass->count, "hash", hash,
                     "nonfinite", (json_int_t)pass->drops.nonfinite, "degenerate",
                     (json_int_t)pass->drops.degenerate_faces, "lines", (json_int_t)pass->drops.lines, "points",
                     (json_int_t)pass->drops.points, "parts", parts, "materials", materials, "triangles",
                     pass->triangles, "missing_images", (json_int_t)strl_reader_missing_image_count(reader),
                     "missing_image", strl_reader_missing_image(reader));
}

int main(int argc, char **argv)
{
    const strl_reader_desc desc = {.path = argc > 1 ? argv[1] : "",
                                   .scratch_dir = argc > 3 && *argv[3] ? argv[3] : NULL,
                                   .most_pieces = argc > 4 ? (uint32_t)strtoul(argv[4], NULL, 10) : 0,
                                   .memory_bytes = argc > 2 ? strtoull(argv[2], NULL, 10) : 0};
    strl_reader *reader = NULL;
    strl_error err = {0};
    pass_result first = {.triangles = json_array()}, second = {0};
    strl_status status = strl_reader_open(&desc, &reader, &err);
    if (!status)
        status = read_pass(reader, &first, &err);
    if (!status) {
        strl_reader_rest(reader);
        status = strl_reader_rewind(reader, &err);
    }
    if (!status)
        status = read_pass(reader, &second, &err);
    json_t *result = status ? json_pack("{s:s}", "error", err.message) : describe(reader, &first);
    if (!status && argc > 4 && add_pieces(reader, result, &err))
        json_object_set_new(result, "error", json_string(err.message));
    json_dumpf(result, stdout, JSON_COMPACT | JSON_REAL_PRECISION(17));
    puts("");
    json_decref(result);
    json_decref(first.triangles);
    strl_reader_close(reader);
    if (!status && (first.count != second.count || first.hash != second.hash))
        return 3;
    return status ? 1 : 0;
}
