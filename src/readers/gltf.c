/* glTF 2.0, as JSON or in its binary container. */
#include "readers/gltf.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "base/cursor.h"
#include "base/fail.h"
#include "readers/text.h"

#define GLB_MAGIC 0x46546c67u
#define CHUNK_JSON 0x4e4f534au
#define CHUNK_BINARY 0x004e4942u
#define HEADER_BYTES 12u
#define CHUNK_HEADER_BYTES 8u
#define CHANGES_OF_AN_IMAGE 16u /* so often each may be decoded anew, on average */
#define LEAST_IMAGES 4u         /* that fit together */

static bool glb_recognises(const strl__input *input, uint64_t file_bytes)
{
    (void)file_bytes;
    return input->end - input->at >= 4 && strl__load_32(input->at, false) == GLB_MAGIC;
}

/* An object that says "asset" soon. Others are known by their names. */
static bool gltf_recognises(const strl__input *input, uint64_t file_bytes)
{
    static const char word[] = "\"asset\"";
    const char *at = input->at;
    (void)file_bytes;
    if (input->end - at >= 3 && memcmp(at, "\xef\xbb\xbf", 3) == 0)
        at += 3;
    while (strl__is_blank(*at) || strl__is_line_end(*at))
        at++;
    return *at == '{' && memmem(at, (size_t)(input->end - at), word, sizeof word - 1) != NULL;
}

/* ---- container */

typedef struct chunk {
    uint64_t offset, bytes; /* of what it holds */
    uint32_t type;
} chunk;

static strl_status read_chunk(strl_reader *reader, uint64_t at, uint64_t end, chunk *found, strl_error *err)
{
    uint8_t header[CHUNK_HEADER_BYTES];
    if (end - at < sizeof header)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "%s, byte %" PRIu64 ": expected the 8 bytes of a chunk's header, found "
                          "the end of the file",
                          reader->path, at);
    strl_status status = strl_file_read(reader->file, at, header, sizeof header, err);
    if (status)
        return status;
    *found = (chunk){.offset = at + sizeof header,
                     .bytes = strl__load_le(header, 4),
                     .type = (uint32_t)strl__load_le(header + 4, 4)};
    if (found->bytes <= end - found->offset)
        return STRL_OK;
    return strl__fail(err, STRL_ERR_FORMAT,
                      "%s, byte %" PRIu64 ": expected a chunk of %" PRIu64 " bytes, found %" PRIu64
                      " to the end of the file",
                      reader->path, at, found->bytes, end - found->offset);
}

/* Only zeros may follow the last chunk: three bytes of padding that some programs leave out of the
 * length, or what is no chunk's header. */
static strl_status read_later_chunks(strl__gltf *gltf, uint64_t at, uint64_t end, strl_error *err)
{
    strl_status status = STRL_OK;
    while (!status && end - at >= CHUNK_HEADER_BYTES) {
        chunk found;
        status = read_chunk(gltf->reader, at, end, &found, err);
        if (status)
            break;
        if (found.type == CHUNK_BINARY && !gltf->has_binary) {
            gltf->has_binary = true;
            gltf->binary_offset = found.offset;
            gltf->binary_bytes = found.bytes;
        }
        at = found.offset + found.bytes;
    }
    return status;
}

static strl_status read_container(strl__gltf *gltf, chunk *json, strl_error *err)
{
    strl_reader *reader = gltf->reader;
    uint8_t header[HEADER_BYTES];
    if (reader->opened.bytes < sizeof header)
        return strl__fail(err, STRL_ERR_FORMAT, "%s: expected the 12 bytes of a GLB header, found %" PRIu64,
                          reader->path, reader->opened.bytes);
    strl_status status = strl_file_read(reader->file, 0, header, sizeof header, err);
    if (status)
        return status;
    const uint64_t magic = strl__load_le(header, 4), version = strl__load_le(header + 4, 4);
    const uint64_t end = strl__load_le(header + 8, 4);
    if (magic != GLB_MAGIC)
        return strl__fail(err, STRL_ERR_FORMAT, "%s: expected a GLB's first bytes, 'glTF'", reader->path);
    if (version != 2)
        return strl__fail(err, STRL_ERR_UNSUPPORTED,
                          "%s: expected a GLB of version 2, found %" PRIu64 ": convert it to glTF 2.0", reader->path,
                          version);
    if (end > reader->opened.bytes || end < sizeof header)
        return strl__fail(err, STRL_ERR_FORMAT, "%s: announces %" PRIu64 " bytes, found a file of %" PRIu64,
                          reader->path, end, reader->opened.bytes);
    status = read_chunk(reader, sizeof header, end, json, err);
    if (status)
        return status;
    if (json->type != CHUNK_JSON)
        return strl__fail(err, STRL_ERR_FORMAT, "%s, byte 12: expected a chunk of JSON, found type 0x%08x",
                          reader->path, json->type);
    return read_later_chunks(gltf, json->offset + json->bytes, end, err);
}

/* ---- opening */

/* What is read of the files named beside the model counts for progress as well. */
static void add_up(strl__gltf *gltf)
{
    strl_reader *reader = gltf->reader;
    reader->all_bytes = reader->opened.bytes;
    for (size_t i = 0; i < gltf->buffer_count; i++)
        if (gltf->buffers[i].is_beside)
            reader->all_bytes += gltf->buffers[i].opened.bytes;
    reader->triangles_hint = gltf->triangles;
    reader->hint_is_exact = true;
    reader->listed_vertices = gltf->vertices;
}

/* Images have what tables leave of the half, a quarter of all at most. */
static void share_out(strl__gltf *gltf)
{
    strl__textures *textures = &gltf->reader->textures;
    gltf->table_bytes += textures->capacity * sizeof *textures->items;
    gltf->table_bytes += textures->picture_capacity * sizeof *textures->pictures;
    const uint64_t half = gltf->reader->memory_bytes / 2, held = gltf->table_bytes + gltf->arena.total_bytes;
    const uint64_t left = held < half ? half - held : 0;
    if (textures->limit_bytes > left)
        textures->limit_bytes = left;
}

/* Images that take turns again and again must fit together, at the cost of detail: else each turn decodes one anew. */
static void share_out_images(strl__gltf *gltf)
{
    strl__textures *textures = &gltf->reader->textures;
    const uint64_t count = textures->keys.count;
    if (gltf->image_changes > CHANGES_OF_AN_IMAGE * count)
        textures->image_bytes = textures->limit_bytes / (count < LEAST_IMAGES ? count : LEAST_IMAGES);
}

static strl_status open_json(strl_reader *reader, strl_error *err)
{
    strl__gltf *gltf = strl__gltf_of(reader);
    gltf->window = strl__alloc(STRL__GLTF_WINDOW_BYTES + STRL__GLTF_ELEMENT_BYTES_MAX, 1);
    if (!gltf->window)
        return strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for a window", reader->path);
    strl_status status = strl__gltf_parse(gltf, err);
    if (!status)
        status = strl__gltf_link(gltf, err);
    if (!status)
        status = strl__gltf_link_maps(gltf, err);
    share_out(gltf);
    if (!status)
        status = strl__gltf_check_scene(gltf, err);
    share_out_images(gltf);
    if (!status)
        add_up(gltf);
    return status;
}

static void init(strl_reader *reader)
{
    strl__gltf *gltf = strl__gltf_of(reader);
    gltf->reader = reader;
    gltf->scene = STRL__NO_ITEM;
    gltf->table_limit = reader->memory_bytes / 16 * 7;
    strl_arena_init(&gltf->arena, (size_t)gltf->table_limit);
    strl__textures_init(&reader->textures, reader->memory_bytes / 4, strl__reader_advise_more(reader));
    reader->textures.open = strl__gltf_open_picture;
    reader->textures.context = gltf;
    gltf->paint.measured = STRL__NO_ITEM;
    gltf->last_picture = STRL__NO_ITEM;
}

static strl_status gltf_open(strl_reader *reader, strl_error *err)
{
    init(reader);
    strl__text_skip_byte_order_mark(&reader->input);
    return open_json(reader, err);
}

static strl_status glb_open(strl_reader *reader, strl_error *err)
{
    chunk json;
    init(reader);
    strl_status status = read_container(strl__gltf_of(reader), &json, err);
    if (status)
        return status;
    strl__input_seek(&reader->input, json.offset, 1);
    reader->input.file_bytes = json.offset + json.bytes;
    return open_json(reader, err);
}

/* ---- reading */

static strl_status gltf_prepare(strl_reader *reader, strl_error *err)
{
    const strl__gltf *gltf = strl__gltf_of(reader);
    uint64_t most = 0;
    for (size_t i = 0; i < gltf->primitive_count; i++) {
        const strl__gltf_primitive *primitive = &gltf->primitives[i];
        if (primitive->position < gltf->accessor_count && gltf->accessors[primitive->position].count > most)
            most = gltf->accessors[primitive->position].count;
    }
    const strl__batch_desc desc = {.indexed = true,
                                   .sorted = most > strl__gltf_table_bytes(reader) / sizeof(strl__corner),
                                   .bytes = (size_t)(reader->memory_bytes / 8)};
    strl__gltf_empty_table(reader); /* corners that are known keep their normals and colours */
    return strl__batch_init(&reader->batch, &desc, err);
}

static strl_status gltf_start(strl_reader *reader, strl_error *err)
{
    strl__gltf *gltf = strl__gltf_of(reader);
    (void)err;
    strl__gltf_rewind(gltf);
    gltf->pass.is_alone = reader->piece > 0;
    gltf->pass.mesh = reader->piece ? gltf->pieces[reader->piece - 1] : STRL__NO_ITEM;
    return STRL_OK;
}

/* What of a primitive becomes no triangle. */
static void count_drops(strl__gltf *gltf, const strl__gltf_primitive *primitive, uint64_t times)
{
    strl_reader_drops *drops = &gltf->reader->drops;
    if (primitive->position == STRL__NO_ITEM)
        return; /* what else it names was not checked */
    const uint64_t elements = strl__gltf_element_count(gltf, primitive);
    if (primitive->mode == 0)
        drops->points += elements * times;
    else if (primitive->mode < 4)
        drops->lines += times * (primitive->mode == 1   ? elements / 2
                                 : primitive->mode == 2 ? elements - (elements > 0)
                                                        : elements);
    else if (primitive->mode == 4 ? elements % 3 != 0 : elements > 0 && elements < 3)
        drops->degenerate_faces += times; /* corners are left that make no face */
}

/* Those without any are passed over at once: they may have as many instances as a file cares to say. */
static bool has_triangles(const strl__gltf *gltf, const strl__gltf_primitive *primitive)
{
    return primitive->position != STRL__NO_ITEM &&
           strl__gltf_triangle_count(primitive->mode, strl__gltf_element_count(gltf, primitive)) > 0;
}

/* To the next primitive of triangles of the mesh at hand, instance by instance. NULL: its end. */
static const strl__gltf_primitive *find_in_mesh(strl__gltf *gltf, uint64_t instances)
{
    strl__gltf_pass *pass = &gltf->pass;
    const strl__gltf_mesh *mesh = &gltf->meshes[pass->mesh];
    for (; pass->primitive < mesh->primitive_count; pass->primitive++) {
        const strl__gltf_primitive *primitive = &gltf->primitives[mesh->first_primitive + pass->primitive];
        if (pass->instance == 0)
            count_drops(gltf, primitive, instances);
        if (pass->instance < instances && has_triangles(gltf, primitive))
            return primitive;
        pass->instance = 0;
    }
    return NULL;
}

/* Node by node. NULL: the end. */
static const strl__gltf_primitive *find_placement(strl__gltf *gltf)
{
    strl__gltf_pass *pass = &gltf->pass;
    if (pass->is_alone)
        return find_in_mesh(gltf, 1);
    for (;;) {
        const strl__gltf_node *node = pass->has_node ? &gltf->nodes[pass->node] : NULL;
        if (node && node->mesh != STRL__NO_ITEM && gltf->meshes[node->mesh].piece == 0) {
            pass->mesh = node->mesh;
            const strl__gltf_primitive *found = find_in_mesh(gltf, strl__gltf_instance_count(node));
            if (found)
                return found;
        }
        pass->primitive = 0;
        pass->instance = 0;
        if (!strl__gltf_next_node(gltf))
            return NULL;
    }
}

static strl_status gltf_fill(strl_reader *reader, strl_error *err)
{
    strl__gltf *gltf = strl__gltf_of(reader);
    strl__gltf_pass *pass = &gltf->pass;
    strl_status status = STRL_OK;
    if (!pass->has_placement) {
        const strl__gltf_primitive *primitive = find_placement(gltf);
        reader->ended = !primitive;
        if (!primitive)
            return STRL_OK;
        status = strl__gltf_begin_placement(gltf, primitive, err);
        pass->has_placement = !status;
    }
    const strl__gltf_mesh *mesh = &gltf->meshes[pass->mesh];
    if (!status)
        status = strl__gltf_add_triangles(gltf, &gltf->primitives[mesh->first_primitive + pass->primitive], err);
    if (!status && pass->triangle == pass->triangle_count) {
        pass->has_placement = false;
        pass->instance++;
    }
    return status;
}

static uint64_t gltf_bytes_done(const strl_reader *reader)
{
    const strl__gltf *gltf = strl__gltf_of(reader);
    const uint64_t triangles =
        reader->piece ? gltf->meshes[gltf->pieces[reader->piece - 1]].triangles : gltf->rest_triangles;
    if (reader->ended || triangles == 0)
        return reader->all_bytes;
    double share = (double)gltf->pass.done / (double)triangles;
    return (uint64_t)(fmin(share, 1) * (double)reader->all_bytes);
}

static strl_status gltf_check_unchanged(const strl_reader *reader, strl_error *err)
{
    return strl__gltf_check_unchanged(strl__gltf_of(reader), err);
}

static void gltf_rest(strl_reader *reader)
{
    strl__gltf *gltf = strl__gltf_of(reader);
    strl__gltf_end_paint(gltf);
    strl__gltf_rest_decoded(gltf);
    strl__gltf_rest_buffers(gltf);
}

static void gltf_close(strl_reader *reader)
{
    strl__gltf *gltf = strl__gltf_of(reader);
    strl__gltf_close_buffers(gltf);
    strl__gltf_close_decoded(gltf);
    strl__gltf_end_paint(gltf);
    strl_arena_deinit(&gltf->arena);
    strl__free(gltf->accessors);
    strl__free(gltf->views);
    strl__free(gltf->buffers);
    strl__free(gltf->meshes);
    strl__free(gltf->primitives);
    strl__free(gltf->nodes);
    strl__free(gltf->materials);
    strl__free(gltf->scenes);
    strl__free(gltf->maps);
    strl__free(gltf->samplers);
    strl__free(gltf->images);
    strl__free(gltf->pieces);
    strl__free(gltf->children);
    strl__free(gltf->roots);
    strl__free(gltf->world);
    strl__free(gltf->window);
}

const strl__format strl__format_glb = {
    .name = "glb",
    .default_up = STRL_AXIS_Y,
    .default_unit = "m",
    .state_bytes = sizeof(strl__gltf),
    .recognises = glb_recognises,
    .open = glb_open,
    .prepare = gltf_prepare,
    .start = gltf_start,
    .fill = gltf_fill,
    .bytes_done = gltf_bytes_done,
    .check_unchanged = gltf_check_unchanged,
    .rest = gltf_rest,
    .close = gltf_close,
    .piece_get = strl__gltf_piece_get,
    .start_placements = strl__gltf_start_placements,
    .next_placement = strl__gltf_next_placement,
};

const strl__format strl__format_gltf = {
    .name = "gltf",
    .default_up = STRL_AXIS_Y,
    .default_unit = "m",
    .state_bytes = sizeof(strl__gltf),
    .recognises = gltf_recognises,
    .open = gltf_open,
    .prepare = gltf_prepare,
    .start = gltf_start,
    .fill = gltf_fill,
    .bytes_done = gltf_bytes_done,
    .check_unchanged = gltf_check_unchanged,
    .rest = gltf_rest,
    .close = gltf_close,
    .piece_get = strl__gltf_piece_get,
    .start_placements = strl__gltf_start_placements,
    .next_placement = strl__gltf_next_placement,
};
