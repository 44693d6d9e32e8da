/* Wavefront OBJ. Vertices and faces may stand in any order, so a first pass gathers v and vn (and
 * reads the mtllibs), and every further pass turns f into batches. o and g make parts, usemtl makes
 * materials. Texture coordinates are read where a material has an image, by two more passes (what
 * they are, and how large the faces round them are); free-form geometry and all other statements
 * are passed over. */
#include <inttypes.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "readers/mtl.h"
#include "readers/obj.h"
#include "readers/text.h"

typedef enum obj_keyword {
    OBJ_VERTEX,
    OBJ_NORMAL,
    OBJ_TEXCOORD,
    OBJ_FACE,
    OBJ_LINE,
    OBJ_POINT,
    OBJ_OBJECT,
    OBJ_GROUP,
    OBJ_USE_MATERIAL,
    OBJ_LIBRARY,
    OBJ_OTHER
} obj_keyword;

#define VERTEX_BYTES 28u  /* three doubles and a colour */
#define NORMAL_BYTES 12u  /* three floats */
#define TEXCOORD_BYTES 8u /* two floats */

static bool matches(const char *at, const char *word, size_t length)
{
    return memcmp(at, word, length) == 0 && (strl__is_blank(at[length]) || strl__is_line_end(at[length]));
}

/* The keyword at the start of a statement; its bytes are passed. A whole token can be looked at. */
static obj_keyword take_keyword(strl__input *input)
{
    static const struct {
        const char *word;
        uint8_t length;
        obj_keyword keyword;
    } words[] = {
        {"v", 1, OBJ_VERTEX},
        {"f", 1, OBJ_FACE},
        {"vn", 2, OBJ_NORMAL},
        {"vt", 2, OBJ_TEXCOORD},
        {"l", 1, OBJ_LINE},
        {"p", 1, OBJ_POINT},
        {"o", 1, OBJ_OBJECT},
        {"g", 1, OBJ_GROUP},
        {"fo", 2, OBJ_FACE},
        {"mtllib", 6, OBJ_LIBRARY},
        {"usemtl", 6, OBJ_USE_MATERIAL},
    };
    const char *at = input->at;
    for (size_t i = 0; i < sizeof words / sizeof *words; i++)
        if (*at == *words[i].word && input->end - at >= words[i].length &&
            matches(at, words[i].word, words[i].length)) {
            input->at += words[i].length;
            return words[i].keyword;
        }
    return OBJ_OTHER;
}

/* The first statement that is no comment must be one that OBJ files begin with. */
static bool obj_recognises(const strl__input *input, uint64_t file_bytes)
{
    static const char *const words[] = {"v", "vn", "vt", "f", "o", "g", "s", "mtllib", "usemtl", "l", "p"};
    (void)file_bytes;
    const char *at = input->at;
    if (input->end - at >= 3 && memcmp(at, "\xef\xbb\xbf", 3) == 0)
        at += 3;
    for (;;) {
        while (strl__is_blank(*at) || strl__is_line_end(*at))
            at++;
        if (*at != '#')
            break;
        while (at < input->end && !strl__is_line_end(*at))
            at++;
    }
    for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
        size_t length = strlen(words[i]);
        if (input->end - at > (ptrdiff_t)length && memcmp(at, words[i], length) == 0 && strl__is_blank(at[length]))
            return true;
    }
    return false;
}

static strl_status obj_open(strl_reader *reader, strl_error *err)
{
    (void)err;
    strl__textures_init(&reader->textures, reader->memory_bytes / 8, strl__reader_advise_more(reader));
    reader->textures.open = strl__obj_open_picture;
    reader->textures.context = reader;
    reader->triangles_hint = reader->opened.bytes / 60 + 1;
    return STRL_OK;
}

static strl_status read_coordinates(strl__input *input, double *values, unsigned least, unsigned most, unsigned *count,
                                    strl_error *err)
{
    for (*count = 0; *count < most; (*count)++) {
        strl__text_skip_blanks(input);
        if (*count >= least && (strl__text_at_line_end(input) || *input->at == '#'))
            break;
        if (!strl__text_number(input, &values[*count]))
            return strl__text_expected(input, "a number", err);
    }
    return STRL_OK;
}

/* v x y z [r g b]; a lone fourth number is a weight, which polygons do not use. */
static strl_status read_vertex(strl_reader *reader, strl_error *err)
{
    strl__obj *obj = reader->state;
    double values[6];
    unsigned count;
    strl_status status = read_coordinates(&reader->input, values, 3, 6, &count, err);
    if (status)
        return status;
    uint8_t record[VERTEX_BYTES];
    uint8_t *channel = record + 24;
    memcpy(record, values, 24);
    for (unsigned i = 0; i < 4; i++)
        channel[i] = count == 6 && i < 3 ? strl__colour_channel(STRL__F64, values[3 + i]) : 255;
    obj->has_colour = obj->has_colour || count == 6;
    return strl__table_append(&reader->vertices, record, err);
}

static strl_status read_normal(strl_reader *reader, strl_error *err)
{
    double values[3] = {0};
    unsigned count;
    strl_status status = read_coordinates(&reader->input, values, 3, 3, &count, err);
    const float normal[3] = {(float)values[0], (float)values[1], (float)values[2]};
    return status ? status : strl__table_append(&reader->normals, normal, err);
}

/* vt u [v [w]] */
static strl_status read_texcoord(strl_reader *reader, strl_error *err)
{
    double values[3] = {0};
    unsigned count;
    strl_status status = read_coordinates(&reader->input, values, 1, 3, &count, err);
    const float texcoord[2] = {(float)values[0], (float)values[1]};
    return status ? status : strl__table_append(&reader->texcoords, texcoord, err);
}

/* The library's path beside the model; owned by the caller. */
static char *library_path(const strl_reader *reader, const char *name, size_t length)
{
    const char *slash = strrchr(reader->path, '/');
    size_t folder = slash && name[0] != '/' ? (size_t)(slash + 1 - reader->path) : 0;
    char *path = strl__alloc(folder + length + 1, 1);
    if (!path)
        return NULL;
    memcpy(path, reader->path, folder);
    for (size_t i = 0; i < length; i++)
        path[folder + i] = name[i] == '\\' ? '/' : name[i];
    path[folder + length] = 0;
    return path;
}

/* Of one library; `why` as for strl__mtl_read. */
static strl_status read_library(strl_reader *reader, const char *name, size_t length, strl_error *why, strl_error *err)
{
    strl__obj *obj = reader->state;
    char *path = library_path(reader, name, length);
    strl_status status = path ? strl__mtl_read(path, &obj->library, &reader->textures, why, err)
                              : strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for a path", reader->path);
    if (!status && !why->status)
        status = strl__reader_note_beside(reader, path, NULL, err);
    strl__free(path);
    return status;
}

/* Once for each library, however often it is named. */
static strl_status note_missing(strl_reader *reader, const strl_error *why, strl_error *err)
{
    uint32_t index;
    strl_status status = strl__names_add(&reader->missing, why->message, strlen(why->message), &index, err);
    return status ? strl__fail_context(err, status, "%s, line %" PRIu64 ", missing libraries", reader->path,
                                       reader->input.line)
                  : STRL_OK;
}

/* Bytes of a name before a comment that the line ends in; the whole where there is none. */
static size_t before_comment(const char *name, size_t length)
{
    for (size_t i = 1; i < length; i++)
        if (name[i] == '#' && strl__is_blank(name[i - 1])) {
            while (i > 0 && strl__is_blank(name[i - 1]))
                i--;
            return i;
        }
    return length;
}

/* Each word of the line as a name, but one of whole_length bytes, which was tried. */
static strl_status read_words(strl_reader *reader, size_t whole_length, bool note, bool *found, strl_error *err)
{
    strl__input *input = &reader->input;
    strl_status status = STRL_OK;
    for (; !status && !strl__text_at_line_end(input) && *input->at != '#'; strl__text_skip_blanks(input)) {
        size_t length = strl__text_token(input);
        strl_error why = {0};
        if (length != whole_length) {
            status = read_library(reader, input->at, length, &why, err);
            *found = *found || (!status && !why.status);
        }
        if (!status && why.status && note)
            status = note_missing(reader, &why, err);
        input->at += length;
    }
    return status;
}

/* mtllib NAME..: the whole line is tried first, because names with blanks are more common than
 * several names. Where a word of it names a library the other words do too, and are missing; where
 * none does, the whole line is what is missing. */
static strl_status read_libraries(strl_reader *reader, strl_error *err)
{
    strl__input *input = &reader->input;
    strl__text_skip_blanks(input);
    const uint64_t offset = strl__input_offset(input), line = input->line;
    const size_t whole = strl__text_rest_of_line(input);
    const size_t length = before_comment(input->at, whole);
    strl_error why = {0};
    if (length == 0)
        return STRL_OK;
    strl_status status = read_library(reader, input->at, whole, &why, err);
    if (!status && why.status && length < whole) {
        why = (strl_error){0};
        status = read_library(reader, input->at, length, &why, err);
    }
    if (status || !why.status)
        return status;
    bool found = false;
    status = read_words(reader, length, false, &found, err);
    if (status || !found)
        return status ? status : note_missing(reader, &why, err);
    strl__input_seek(input, offset, line);
    strl__text_skip_blanks(input);
    return read_words(reader, length, true, &found, err);
}

static strl_status gather(strl_reader *reader, strl_error *err)
{
    strl__obj *obj = reader->state;
    strl__input *input = &reader->input;
    strl_status status = STRL_OK;
    for (; !status; strl__text_skip_line(input)) {
        strl__text_skip_blanks(input);
        if (input->at == input->end)
            return strl__input_status(input, err);
        switch (take_keyword(input)) {
        case OBJ_VERTEX:
            status = read_vertex(reader, err);
            break;
        case OBJ_NORMAL:
            status = read_normal(reader, err);
            break;
        case OBJ_TEXCOORD:
            obj->texcoords_seen++;
            break;
        case OBJ_LIBRARY:
            status = read_libraries(reader, err);
            break;
        case OBJ_OTHER:
            obj->others += *input->at != '#' && !strl__text_at_line_end(input);
            break;
        default:
            break;
        }
    }
    return status;
}

static void rewind_input(strl_reader *reader)
{
    strl__input_seek(&reader->input, 0, 1);
    strl__text_skip_byte_order_mark(&reader->input);
}

static strl_status gather_texcoords(strl_reader *reader, strl_error *err)
{
    strl__input *input = &reader->input;
    strl_status status = STRL_OK;
    for (rewind_input(reader); !status; strl__text_skip_line(input)) {
        strl__text_skip_blanks(input);
        if (input->at == input->end)
            return strl__input_status(input, err);
        if (take_keyword(input) == OBJ_TEXCOORD)
            status = read_texcoord(reader, err);
    }
    return status;
}

/* Some material has an image, and there are coordinates for it. */
static bool has_images(const strl__obj *obj)
{
    bool found = false;
    for (size_t i = 0; i < obj->library.count && !found; i++)
        found = obj->library.items[i].texture != STRL__NO_TEXTURE;
    return found && obj->texcoords_seen > 0;
}

static void build_tables(strl_reader *reader)
{
    const bool big_endian = __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__;
    strl__layout vertex = {
        .stride = VERTEX_BYTES, .big_endian = big_endian, .has_position = true, .has_colour = true, .has_alpha = true};
    strl__layout normal = {.stride = NORMAL_BYTES, .big_endian = big_endian, .has_normal = true};
    for (uint32_t i = 0; i < 4; i++)
        vertex.colour[i] = (strl__field){24 + i, STRL__U8};
    for (uint32_t i = 0; i < 3; i++) {
        vertex.position[i] = (strl__field){8 * i, STRL__F64};
        normal.normal[i] = (strl__field){4 * i, STRL__F32};
    }
    strl__layout texcoord = {.stride = TEXCOORD_BYTES,
                             .big_endian = big_endian,
                             .has_texcoord = true,
                             .texcoord = {{0, STRL__F32}, {4, STRL__F32}}};
    size_t window = (size_t)(reader->memory_bytes / 2);
    strl__table_build(&reader->vertices, &vertex, reader->scratch_dir, window / 3 * 2);
    strl__table_build(&reader->normals, &normal, reader->scratch_dir, window / 3);
    strl__table_build(&reader->texcoords, &texcoord, reader->scratch_dir, (size_t)(reader->memory_bytes / 16));
}

static strl_status obj_prepare(strl_reader *reader, strl_error *err)
{
    strl__obj *obj = reader->state;
    strl__names_deinit(&reader->missing);
    strl__names_init(&reader->missing, (size_t)(reader->memory_bytes / 64), strl__reader_advise_more(reader));
    if (obj->has_library)
        strl__names_deinit(&obj->library);
    strl__names_init(&obj->library, (size_t)(reader->memory_bytes / 32), strl__reader_advise_more(reader));
    obj->has_library = true;
    obj->has_colour = false;
    obj->others = 0;
    obj->texcoords_seen = 0;
    strl__free(obj->footprints);
    obj->footprints = NULL;
    reader->textures.count = 0; /* of the libraries, which are read again; pictures stay */
    build_tables(reader);
    rewind_input(reader);
    strl_status status = gather(reader, err);
    obj->has_images = !status && has_images(obj);
    if (obj->has_images)
        status = gather_texcoords(reader, err);
    if (!status)
        status = strl__table_finish(&reader->texcoords, err);
    if (!status)
        status = strl__table_finish(&reader->vertices, err);
    if (!status)
        status = strl__table_finish(&reader->normals, err);
    reader->vertices.layout.has_colour = obj->has_colour;
    if (!status)
        status = strl__reader_init_batch(reader, true, err);
    reader->is_certain = reader->is_certain || obj->others == 0;
    return status || !obj->has_images ? status : strl__obj_measure(reader, err);
}

strl_status strl__obj_start(strl_reader *reader, strl_error *err)
{
    strl__obj *obj = reader->state;
    (void)err;
    obj->vertices_seen = obj->normals_seen = obj->texcoords_seen = 0;
    obj->object.length = obj->group.length = obj->material.length = 0;
    obj->part_known = obj->material_known = false;
    reader->batch.has_corner_colour = obj->has_colour || obj->has_images;
    reader->batch.has_texcoord = obj->has_images;
    rewind_input(reader);
    return STRL_OK;
}

static void take_name(strl__input *input, strl__obj_name *name)
{
    strl__text_skip_blanks(input);
    size_t length = strl__text_rest_of_line(input);
    name->length = length < sizeof name->text ? length : sizeof name->text - 1;
    memcpy(name->text, input->at, name->length);
}

/* What the libraries say of a material. A black colour beside an image would leave nothing of it:
 * programs that write it mean the image alone. */
static strl_status define_material(strl_reader *reader, uint32_t defined, strl_error *err)
{
    strl__obj *obj = reader->state;
    const strl__name *from = &obj->library.items[defined];
    strl__name *to = &reader->materials.items[obj->material_index];
    const strl__image *image = NULL;
    strl_status status = STRL_OK;
    to->rgba = from->rgba;
    to->texture = from->texture;
    if (obj->has_images && to->texture != STRL__NO_TEXTURE && (to->rgba & 0xffffffu) == 0)
        status = strl__textures_get(&reader->textures, to->texture, &image, err);
    if (image)
        to->rgba |= 0xffffffu;
    return status;
}

/* Parts and materials are added when a first face has them. */
static strl_status name_face(strl_reader *reader, strl_error *err)
{
    strl__obj *obj = reader->state;
    strl_status status = STRL_OK;
    if (!obj->part_known) {
        char name[2 * sizeof obj->object.text];
        size_t length = obj->object.length;
        memcpy(name, obj->object.text, length);
        if (length > 0 && obj->group.length > 0)
            name[length++] = '/';
        memcpy(name + length, obj->group.text, obj->group.length);
        length += obj->group.length;
        status = strl__names_add(&reader->parts, name, length, &obj->part_index, err);
        obj->part_known = !status;
    }
    if (!status && !obj->material_known) {
        const strl__obj_name *material = &obj->material;
        uint32_t defined = strl__names_find(&obj->library, material->text, material->length);
        status = strl__names_add(&reader->materials, material->text, material->length, &obj->material_index, err);
        if (!status && defined != UINT32_MAX)
            status = define_material(reader, defined, err);
        obj->material_known = !status;
    }
    return status ? strl__fail_context(err, status, "%s, line %" PRIu64, reader->path, reader->input.line) : STRL_OK;
}

static strl_status index_fail(strl_reader *reader, const char *what, int64_t found, uint64_t count, strl_error *err)
{
    strl_status failed = strl__input_status(&reader->input, err);
    if (failed)
        return failed;
    return strl__fail(err, STRL_ERR_FORMAT,
                      "%s, line %" PRIu64 ": expected the index of one of %" PRIu64 " %s, found %" PRId64, reader->path,
                      reader->input.line, count, what, found);
}

/* From the file's count (1 = first, -1 = last so far) to ours. False where there is no such thing.
 */
static bool to_index(int64_t written, uint64_t seen, uint64_t count, uint64_t *index)
{
    *index = written > 0 ? (uint64_t)written - 1 : seen + (uint64_t)written; /* wraps where it is before the first */
    return written != 0 && *index < count && (written > 0 || (uint64_t)-written <= seen);
}

/* v, v/vt, v//vn or v/vt/vn, where what stands after a slash may be missing. */
static strl_status read_corner(strl_reader *reader, size_t slot, strl_error *err)
{
    strl__obj *obj = reader->state;
    strl__input *input = &reader->input;
    strl__batch *batch = &reader->batch;
    uint64_t normal = STRL__NO_INDEX, texcoord = STRL__NO_INDEX;
    int64_t written[3] = {0, 0, 0};
    bool given[3] = {false, false, false};
    const char *at = input->at;
    for (unsigned i = 0; i < 3; i++) {
        const char *after = strl__integer_parse(at, &written[i]);
        given[i] = after != NULL;
        at = after ? after : at;
        if (*at != '/' || i == 2)
            break;
        at++;
    }
    if (!given[0] || !strl__is_token_end(input, at))
        return strl__text_expected(input, "a corner such as 1, 1/2, 1//3 or 1/2/3", err);
    if (!to_index(written[0], obj->vertices_seen, reader->vertices.count, &batch->vertex[slot]))
        return index_fail(reader, "vertices", written[0], reader->vertices.count, err);
    /* Some programs write normal indices without any normals: those are as good as absent. */
    if (given[2] && reader->normals.count > 0 &&
        !to_index(written[2], obj->normals_seen, reader->normals.count, &normal))
        return index_fail(reader, "normals", written[2], reader->normals.count, err);
    if (batch->normal)
        batch->normal[slot] = normal;
    if (given[1] && !to_index(written[1], obj->texcoords_seen, reader->texcoords.count, &texcoord))
        texcoord = STRL__NO_INDEX; /* shows no image */
    if (batch->texcoord)
        batch->texcoord[slot] = texcoord;
    input->at = at;
    return STRL_OK;
}

/* At the first corner beyond the limit. */
static strl_status too_many_corners(strl_reader *reader, strl_error *err)
{
    strl__input *input = &reader->input;
    uint64_t count = STRL__POLYGON_CORNERS_MAX, line = input->line;
    for (; !strl__text_at_line_end(input) && *input->at != '#'; strl__text_skip_blanks(input)) {
        input->at += strl__text_token(input);
        count++;
    }
    strl_status failed = strl__input_status(input, err);
    return failed ? failed
                  : strl__fail(err, STRL_ERR_LIMIT,
                               "%s, line %" PRIu64 ": expected at most %u corners in a face, found %" PRIu64,
                               reader->path, line, STRL__POLYGON_CORNERS_MAX, count);
}

static strl_status read_face(strl_reader *reader, strl_error *err)
{
    strl__obj *obj = reader->state;
    strl__batch *batch = &reader->batch;
    strl__face face = {.colour = 0xffffffffu};
    for (;;) {
        strl__text_skip_blanks(&reader->input);
        if (strl__text_at_line_end(&reader->input) || *reader->input.at == '#')
            break;
        if (face.corner_count == STRL__POLYGON_CORNERS_MAX)
            return too_many_corners(reader, err);
        strl_status status = read_corner(reader, batch->corner_count + face.corner_count++, err);
        if (status)
            return status;
    }
    if (face.corner_count < 3) {
        reader->drops.degenerate_faces++;
        return STRL_OK;
    }
    if (!obj->part_known || !obj->material_known) {
        strl_status status = name_face(reader, err);
        if (status)
            return status;
    }
    face.part = obj->part_index;
    face.material = obj->material_index;
    strl__batch_add(batch, &face);
    return STRL_OK;
}

static strl_status read_statement(strl_reader *reader, strl_error *err)
{
    strl__obj *obj = reader->state;
    strl__input *input = &reader->input;
    switch (take_keyword(input)) {
    case OBJ_VERTEX:
        obj->vertices_seen++;
        break;
    case OBJ_NORMAL:
        obj->normals_seen++;
        break;
    case OBJ_TEXCOORD:
        obj->texcoords_seen++;
        break;
    case OBJ_FACE:
        return read_face(reader, err);
    case OBJ_LINE:
        reader->drops.lines++;
        break;
    case OBJ_POINT:
        reader->drops.points++;
        break;
    case OBJ_OBJECT:
        take_name(input, &obj->object);
        obj->group.length = 0;
        obj->part_known = false;
        break;
    case OBJ_GROUP:
        take_name(input, &obj->group);
        obj->part_known = false;
        break;
    case OBJ_USE_MATERIAL:
        take_name(input, &obj->material);
        obj->material_known = false;
        break;
    default:
        break;
    }
    return STRL_OK;
}

strl_status strl__obj_fill(strl_reader *reader, strl_error *err)
{
    strl__input *input = &reader->input;
    for (; !strl__batch_is_full(&reader->batch); strl__text_skip_line(input)) {
        strl__text_skip_blanks(input);
        if (input->at == input->end) {
            reader->ended = true;
            return strl__input_status(input, err);
        }
        strl_status status = read_statement(reader, err);
        if (status)
            return status;
    }
    return STRL_OK;
}

static void obj_close(strl_reader *reader)
{
    strl__obj *obj = reader->state;
    if (obj->has_library)
        strl__names_deinit(&obj->library);
    strl__free(obj->footprints);
}

static strl_status obj_paint(strl_reader *reader, strl_error *err)
{
    const strl__obj *obj = reader->state;
    return obj->has_images ? strl__obj_paint(reader, err) : STRL_OK;
}

const strl__format strl__format_obj = {
    .name = "obj",
    .default_up = STRL_AXIS_Y,
    .state_bytes = sizeof(strl__obj),
    .weak = true,
    .recognises = obj_recognises,
    .open = obj_open,
    .prepare = obj_prepare,
    .start = strl__obj_start,
    .fill = strl__obj_fill,
    .paint = obj_paint,
    .close = obj_close,
};
