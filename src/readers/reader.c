/* Opening, recognising and driving a format. Five eighths of the budget are for windows on vertices
 * and faces under way, an eighth is for names, a 32nd for the input; the rest is for polygons and
 * small change. */
#include "readers/reader.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"
#include "readers/internal.h"
#include "readers/stranger.h"
#include "readers/text.h"
#include "readers/utf16.h"

#define MEMORY_DEFAULT ((uint64_t)256 << 20)
#define INPUT_BYTES_MAX ((uint64_t)1 << 20)

/* The most certain signature first. */
static const strl__format *const formats[] = {&strl__format_glb, &strl__format_ply, &strl__format_gltf,
                                              &strl__format_stl, &strl__format_obj};

bool strl__has_extension(const char *path, const char *extension)
{
    size_t length = strlen(path), wanted = strlen(extension);
    if (length <= wanted || path[length - wanted - 1] != '.')
        return false;
    for (size_t i = 0; i < wanted; i++)
        if ((path[length - wanted + i] | 0x20) != extension[i])
            return false;
    return true;
}

/* The first bytes for a sentence: what is not printable becomes a question mark. */
static void show_start(const strl__input *input, char *text, size_t size)
{
    size_t length = (size_t)(input->end - input->at);
    length = length < size - 1 ? length : size - 1;
    for (size_t i = 0; i < length; i++)
        text[i] = input->at[i] >= 0x20 && input->at[i] < 0x7f ? input->at[i] : '?';
    text[length] = 0;
}

static strl_status recognise(strl_reader *reader, strl_error *err)
{
    if (reader->opened.bytes == 0)
        return strl__fail(err, STRL_ERR_FORMAT, "%s: expected a mesh, found an empty file", reader->path);
    strl__input_want(&reader->input, STRL__TOKEN_BYTES);
    strl_status status = strl__input_status(&reader->input, err);
    if (status)
        return status;
    if (strl__stranger_is_pointer(reader->input.at, (size_t)(reader->input.end - reader->input.at)))
        return strl__fail(err, STRL_ERR_UNSUPPORTED,
                          "%s: expected a mesh, found a Git LFS pointer: " STRL__POINTER_ADVICE, reader->path);
    const bool foreign = strl__assimp_extension(reader->path) != NULL;
    for (size_t i = 0; i < sizeof formats / sizeof *formats && !reader->format; i++)
        if (!(foreign && formats[i]->weak) && formats[i]->recognises(&reader->input, reader->opened.bytes))
            reader->format = formats[i];
    reader->is_certain = reader->format != NULL;
    for (size_t i = 0; i < sizeof formats / sizeof *formats && !reader->format; i++)
        if (strl__has_extension(reader->path, formats[i]->name))
            reader->format = formats[i];
    if (!reader->format && (foreign || strl__assimp_recognises(&reader->input)))
        reader->format = &strl__format_assimp;
    if (reader->format)
        return STRL_OK;
    const char *stranger = strl__stranger_describe(&reader->input, reader->path);
    if (stranger)
        return strl__fail(err, STRL_ERR_UNSUPPORTED, "%s: expected a mesh, found %s", reader->path, stranger);
    char found[32];
    show_start(&reader->input, found, sizeof found);
    return strl__fail(err, STRL_ERR_UNSUPPORTED,
                      "%s: expected a PLY, STL, OBJ or glTF file by its first bytes or its name's "
                      "ending, or a name's ending that assimp knows, found one that begins with '%s'",
                      reader->path, found);
}

static strl_status open_file(strl_reader *reader, const strl_reader_desc *desc, strl_error *err)
{
    reader->path = strl__strdup(desc->path);
    reader->scratch_dir = desc->scratch_dir ? strl__strdup(desc->scratch_dir) : NULL;
    if (!reader->path || (desc->scratch_dir && !reader->scratch_dir))
        return strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for a path", desc->path);
    strl_status status = strl_file_open(desc->path, &reader->file, err);
    if (!status)
        status = strl_file_stat(reader->file, &reader->opened, err);
    uint64_t input_bytes = reader->memory_bytes / 32;
    if (!status)
        status = strl__input_init(&reader->input, reader->file,
                                  (size_t)(input_bytes < INPUT_BYTES_MAX ? input_bytes : INPUT_BYTES_MAX), err);
    if (!status)
        status = strl__utf16_decode(reader, &reader->decoded, err);
    return status;
}

static void close_format(strl_reader *reader)
{
    if (reader->format && reader->format->close && reader->state)
        reader->format->close(reader);
    strl__free(reader->state);
    reader->state = NULL;
}

static strl_status open_format(strl_reader *reader, strl_error *err)
{
    strl_status status = reader->format ? STRL_OK : recognise(reader, err);
    if (status)
        return status;
    reader->state = strl__alloc_zero(1, reader->format->state_bytes);
    if (!reader->state)
        return strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for a reader", reader->path);
    strl__input_seek(&reader->input, 0, 1);
    reader->default_up = reader->format->default_up;
    reader->default_unit = reader->format->default_unit;
    return reader->format->open(reader, err);
}

/* What the format's own reader has found to be of a version that it does not read. */
static strl_status give_to_importer(strl_reader *reader, strl_error *err)
{
    close_format(reader);
    reader->is_foreign = false;
    reader->format = &strl__format_assimp;
    return open_format(reader, err);
}

strl_status strl__reader_open_as(const strl_reader_desc *desc, const strl__format *format, strl_reader **out,
                                 strl_error *err)
{
    *out = NULL;
    uint64_t memory_bytes = desc->memory_bytes ? desc->memory_bytes : MEMORY_DEFAULT;
    if (memory_bytes < STRL__READER_MEMORY_LEAST)
        return strl__fail(err, STRL_ERR_ARGUMENT,
                          "%s: %" PRIu64 " bytes of memory are too few, a reader needs %" PRIu64, desc->path,
                          memory_bytes, STRL__READER_MEMORY_LEAST);
    strl_reader *reader = strl__alloc_zero(1, sizeof *reader);
    if (!reader)
        return strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for a reader", desc->path);
    reader->format = format;
    reader->memory_bytes = memory_bytes;
    reader->whole_bytes = desc->whole_bytes;
    uint64_t names_bytes = desc->names_bytes ? desc->names_bytes : memory_bytes / 8;
    strl__names_init(&reader->parts, (size_t)names_bytes, strl__reader_advise_more(reader));
    strl__names_init(&reader->materials, (size_t)(names_bytes / 2), strl__reader_advise_more(reader));
    reader->child = desc->child;
    reader->most_pieces = desc->most_pieces;
    strl_status status = open_file(reader, desc, err);
    if (!status)
        status = open_format(reader, err);
    if (status && reader->is_foreign && !format)
        status = give_to_importer(reader, err);
    reader->child = (strl_reader_child){0};
    if (!status)
        *out = reader;
    else
        strl_reader_close(reader);
    return status;
}

strl_status strl_reader_open(const strl_reader_desc *desc, strl_reader **reader, strl_error *err)
{
    return strl__reader_open_as(desc, NULL, reader, err);
}

static void release_tables(strl_reader *reader)
{
    strl__table_deinit(&reader->vertices);
    strl__table_deinit(&reader->normals);
    strl__table_deinit(&reader->texcoords);
    strl__batch_deinit(&reader->batch);
}

void strl_reader_close(strl_reader *reader)
{
    if (!reader)
        return;
    close_format(reader);
    release_tables(reader);
    strl__input_deinit(&reader->input);
    strl__names_deinit(&reader->parts);
    strl__names_deinit(&reader->materials);
    strl__names_deinit(&reader->missing);
    for (size_t i = 0; i < reader->beside_count; i++)
        strl__free(reader->beside[i].path);
    strl__free(reader->beside);
    strl__textures_deinit(&reader->textures);
    strl_file_close(reader->decoded, NULL); /* without a name: nothing of it is left */
    strl_file_close(reader->file, NULL);    /* only read from */
    strl__free(reader->scratch_dir);
    strl__free(reader->path);
    strl__free(reader);
}

void strl_reader_info_get(const strl_reader *reader, strl_reader_info *info)
{
    *info = (strl_reader_info){
        .format = reader->format->name,
        .default_up = reader->default_up,
        .default_unit = reader->default_unit,
        .triangles_hint = reader->triangles_hint,
        .hint_is_exact = reader->hint_is_exact,
        .is_certain = reader->is_certain,
        .file_bytes = reader->all_bytes ? reader->all_bytes : reader->opened.bytes,
    };
}

strl_status strl__reader_init_batch(strl_reader *reader, bool indexed, strl_error *err)
{
    const strl__table *tables[3] = {&reader->vertices, &reader->normals, &reader->texcoords};
    const uint64_t images = indexed && reader->texcoords.count ? reader->textures.limit_bytes : 0;
    strl__batch_desc desc = {.indexed = indexed, .bytes = (size_t)(reader->memory_bytes / 8 * 5 - images)};
    desc.indexed_normals = indexed && reader->normals.count > 0;
    desc.indexed_texcoords = indexed && reader->texcoords.count > 0;
    for (unsigned i = 0; i < 3; i++)
        if (indexed && tables[i]->count > 0) {
            const size_t window = strl__table_window_bytes(tables[i]);
            desc.sorted = desc.sorted || !strl__table_is_resident(tables[i]);
            desc.bytes -= window < desc.bytes ? window : desc.bytes;
        }
    return strl__batch_init(&reader->batch, &desc, err);
}

static strl_status make_ready(strl_reader *reader, strl_error *err)
{
    strl_status status = strl__input_wake(&reader->input, err);
    if (!status && !reader->prepared) {
        release_tables(reader);
        status = reader->format->prepare(reader, err);
        reader->prepared = !status;
    }
    if (!status && !reader->started) {
        status = reader->format->start(reader, err);
        reader->started = !status;
    }
    return status;
}

static strl_status read_batch(strl_reader *reader, strl_error *err)
{
    strl__batch_reset(&reader->batch);
    strl_status status = reader->format->fill(reader, err);
    if (!status && reader->batch.vertex)
        status = strl__batch_resolve(&reader->batch, &reader->vertices, reader->normals.count ? &reader->normals : NULL,
                                     err);
    if (!status && reader->batch.texcoord)
        status = strl__batch_resolve_texcoords(&reader->batch, &reader->texcoords, err);
    if (!status && reader->format->paint)
        status = reader->format->paint(reader, err);
    return status;
}

/* What texture coordinates each material has, by which they are told in fewer bits. */
static void note_texcoords(strl_reader *reader, const strl_triangle *triangles, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        const strl_triangle *triangle = &triangles[i];
        if (!(triangle->flags & STRL_TRIANGLE_HAS_TEXCOORD))
            continue;
        strl__name *material = &reader->materials.items[triangle->material];
        for (unsigned k = 0; k < 6; k++) {
            const float value = triangle->texcoord[k / 2][k % 2];
            if (value < material->least[k % 2])
                material->least[k % 2] = value;
            if (value > material->most[k % 2])
                material->most[k % 2] = value;
        }
    }
}

static strl_status next_triangles(strl_reader *reader, strl_triangle *triangles, size_t capacity, size_t *count,
                                  strl_error *err)
{
    strl_status status = reader->rests ? STRL_OK : make_ready(reader, err);
    while (!status && !reader->rests && *count < capacity) {
        size_t added = 0;
        status = strl__batch_emit(&reader->batch, triangles + *count, capacity - *count, &added, &reader->drops, err);
        if (reader->batch.has_texcoord)
            note_texcoords(reader, triangles + *count, added);
        *count += added;
        if (status || added > 0)
            continue;
        if (reader->ended)
            break;
        status = read_batch(reader, err);
    }
    return status;
}

strl_status strl_reader_next(strl_reader *reader, strl_triangle *triangles, size_t capacity, size_t *count,
                             strl_error *err)
{
    *count = 0;
    if (!reader->failed) {
        strl_status status = next_triangles(reader, triangles, capacity, count, &reader->failure);
        if (!status)
            return STRL_OK;
        reader->failed = true;
        *count = 0;
    }
    if (err)
        *err = reader->failure;
    return reader->failure.status;
}

void strl__reader_advise(const strl_reader *reader, uint64_t needed, uint64_t limit, char advice[STRL__ADVICE_BYTES])
{
    const uint64_t whole = reader->whole_bytes ? reader->whole_bytes : reader->memory_bytes;
    const double megabytes = (double)whole / (double)limit * (double)needed / (1 << 20);
    snprintf(advice, STRL__ADVICE_BYTES,
             reader->whole_bytes ? "--memory %.0fM would do" : "reading it takes about %.0fM of memory",
             ceil(megabytes));
}

const char *strl__reader_advise_more(const strl_reader *reader)
{
    return reader->whole_bytes ? "more --memory may help" : "more memory may help";
}

strl_status strl__reader_check_unchanged(strl_file *file, const strl_file_info *opened, strl_error *err)
{
    strl_file_info now;
    strl_status status = strl_file_stat(file, &now, err);
    if (status)
        return status;
    if (now.bytes != opened->bytes || now.modified_ns != opened->modified_ns)
        return strl__fail(err, STRL_ERR_IO,
                          "%s has changed while it was read: it had %" PRIu64 " bytes, now it has %" PRIu64
                          " and a time of change %s",
                          strl_file_path(file), opened->bytes, now.bytes,
                          now.modified_ns != opened->modified_ns ? "of its own" : "as before");
    return STRL_OK;
}

strl_status strl_reader_rewind(strl_reader *reader, strl_error *err)
{
    strl_status status = strl__reader_check_unchanged(reader->file, &reader->opened, err);
    if (!status && reader->format->check_unchanged)
        status = reader->format->check_unchanged(reader, err);
    if (status)
        return status;
    reader->started = reader->ended = reader->failed = reader->rests = false;
    reader->drops = (strl_reader_drops){0};
    strl__batch_reset(&reader->batch);
    return STRL_OK;
}

uint32_t strl_reader_piece_count(const strl_reader *reader)
{
    return reader->piece_count + 1;
}

void strl_reader_piece_get(const strl_reader *reader, uint32_t piece, strl_reader_piece *facts)
{
    *facts = (strl_reader_piece){.triangles = reader->triangles_hint, .placements = 1};
    if (reader->piece_count)
        reader->format->piece_get(reader, piece, facts);
}

strl_status strl_reader_select(strl_reader *reader, uint32_t piece, strl_error *err)
{
    if (piece > reader->piece_count)
        return strl__fail(err, STRL_ERR_ARGUMENT, "%s: there is no piece %u, expected one of %u", reader->path, piece,
                          reader->piece_count + 1);
    reader->piece = piece;
    return strl_reader_rewind(reader, err);
}

strl_status strl_reader_begin_placements(strl_reader *reader, strl_error *err)
{
    strl_status status = strl_reader_rewind(reader, err);
    if (!status && reader->piece_count)
        status = reader->format->start_placements(reader, err);
    return status;
}

strl_status strl_reader_next_placement(strl_reader *reader, strl_reader_placement *placement, bool *found,
                                       strl_error *err)
{
    *found = false;
    return reader->piece_count ? reader->format->next_placement(reader, placement, found, err) : STRL_OK;
}

void strl_reader_rest(strl_reader *reader)
{
    if (reader->vertices.count)
        reader->listed_vertices = reader->vertices.count;
    release_tables(reader);
    strl__textures_rest(&reader->textures);
    strl__input_rest(&reader->input);
    if (reader->format->rest)
        reader->format->rest(reader);
    reader->prepared = reader->started = false;
    reader->ended = reader->rests = true;
}

void strl_reader_drops_get(const strl_reader *reader, strl_reader_drops *drops)
{
    *drops = reader->drops;
}

void strl_reader_costs_get(const strl_reader *reader, strl_reader_costs *costs)
{
    *costs = reader->costs;
}

uint64_t strl_reader_vertex_count(const strl_reader *reader)
{
    return reader->listed_vertices ? reader->listed_vertices : reader->vertices.count;
}

uint32_t strl_reader_missing_count(const strl_reader *reader)
{
    return (uint32_t)reader->missing.count;
}

const char *strl_reader_missing(const strl_reader *reader, uint32_t index)
{
    return reader->missing.items[index].text;
}

/* An entry of its own and no limit of their number: each of them was opened. */
strl_status strl__reader_note_beside(strl_reader *reader, const char *path, const strl_file_info *info, strl_error *err)
{
    strl__beside made = {.key = strl__checksum(path, strlen(path))};
    for (size_t i = 0; i < reader->beside_count; i++)
        if (reader->beside[i].key == made.key && strcmp(reader->beside[i].path, path) == 0)
            return STRL_OK;
    reader->beside_bytes += strlen(path) + sizeof made;
    if (reader->beside_bytes > reader->memory_bytes / 64)
        return strl__fail(err, STRL_ERR_LIMIT,
                          "%s: the names of the files that it names take more than the %" PRIu64
                          " bytes that the memory budget allows: %s",
                          reader->path, reader->memory_bytes / 64, strl__reader_advise_more(reader));
    strl_status status = info ? STRL_OK : strl_path_stat(path, &made.info, err);
    if (status)
        return status;
    if (info)
        made.info = *info;
    made.path = strl__strdup(path);
    if (!made.path || !strl__grow(&reader->beside, &reader->beside_capacity, reader->beside_count + 1, sizeof made)) {
        strl__free(made.path);
        return strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for a path", reader->path);
    }
    reader->beside[reader->beside_count++] = made;
    return STRL_OK;
}

uint32_t strl_reader_beside_count(const strl_reader *reader)
{
    return (uint32_t)reader->beside_count;
}

const char *strl_reader_beside(const strl_reader *reader, uint32_t index, strl_file_info *info)
{
    *info = reader->beside[index].info;
    return reader->beside[index].path;
}

bool strl_reader_material_image(const strl_reader *reader, uint32_t material, strl_reader_image *image)
{
    if (material >= reader->materials.count || reader->materials.items[material].texture == STRL__NO_TEXTURE)
        return false;
    const strl__name *name = &reader->materials.items[material];
    const strl__texture *texture = &reader->textures.items[name->texture];
    *image = (strl_reader_image){.reference = reader->textures.pictures[texture->picture].reference,
                                 .wrap = {texture->wrap[0], texture->wrap[1]},
                                 .texcoord_min = {name->least[0], name->least[1]},
                                 .texcoord_max = {name->most[0], name->most[1]}};
    return true;
}

uint32_t strl_reader_missing_image_count(const strl_reader *reader)
{
    return reader->textures.unusable_count;
}

const char *strl_reader_missing_image(const strl_reader *reader)
{
    return reader->textures.first_unusable.message;
}

uint64_t strl_reader_bytes_done(const strl_reader *reader)
{
    if (!reader->started)
        return 0;
    return reader->format->bytes_done ? reader->format->bytes_done(reader) : strl__input_offset(&reader->input);
}

uint32_t strl_reader_part_count(const strl_reader *reader)
{
    return reader->parts.count ? (uint32_t)reader->parts.count : 1;
}

const char *strl_reader_part_name(const strl_reader *reader, uint32_t part)
{
    return part < reader->parts.count ? reader->parts.items[part].text : "";
}

uint32_t strl_reader_material_count(const strl_reader *reader)
{
    return reader->materials.count ? (uint32_t)reader->materials.count : 1;
}

const char *strl_reader_material(const strl_reader *reader, uint32_t material, uint32_t *rgba)
{
    bool known = material < reader->materials.count;
    *rgba = known ? reader->materials.items[material].rgba : 0xffffffffu;
    return known ? reader->materials.items[material].text : "";
}
