#include "readers/import_stream.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "base/cursor.h"
#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"

/* The window holds one record of the largest size. */
#define WINDOW_BYTES ((size_t)STRL_IMPORT_RECORD_HEAD + STRL_IMPORT_RECORD_MOST)
/* An eighth of the budget is for names; numbers of materials take a share of what polygons leave. */
#define MATERIALS_MOST ((size_t)1 << 16)

/* One record, in the window until the next is asked for. */
typedef struct import_record {
    uint32_t kind;
    strl_cursor payload;
} import_record;

/* ---- sentences ---- */

static strl_status expected(strl_reader *reader, const char *what, strl_error *err)
{
    strl__import *state = reader->state;
    strl_status failed = strl__input_status(&state->input, err);
    if (failed)
        return failed;
    return strl__fail(err, STRL_ERR_FORMAT,
                      "%s: the stream of triangles that was imported from it is broken: expected %s "
                      "at byte %" PRIu64,
                      reader->path, what, state->record_at);
}

/* The importer's own words; control characters and bytes beyond ASCII would make them unreadable. */
static strl_status tell_error(strl_reader *reader, strl_cursor payload, strl_error *err)
{
    strl__import *state = reader->state;
    char *text = state->told;
    state->error_told = true;
    uint32_t reason = strl_cursor_u32(&payload);
    size_t length = strl_cursor_left(&payload);
    const uint8_t *bytes = strl_cursor_take(&payload, length);
    size_t used = length < STRL_IMPORT_TEXT_MOST ? length : STRL_IMPORT_TEXT_MOST;
    for (size_t i = 0; i < used; i++)
        text[i] = bytes[i] >= 0x20 && bytes[i] < 0x7f ? (char)bytes[i] : ' ';
    text[used] = 0;
    strl_status status = reason == STRL_IMPORT_MEMORY        ? STRL_ERR_MEMORY
                         : reason == STRL_IMPORT_UNSUPPORTED ? STRL_ERR_UNSUPPORTED
                                                             : STRL_ERR_FORMAT;
    return strl__fail(err, status, "%s: %s", reader->path,
                      used ? text : "it cannot be imported, for a reason that was not told");
}

/* ---- frames ---- */

/* Head and payload of the next record lie in the file whole; neither is passed. */
static strl_status peek(strl_reader *reader, uint32_t *kind, uint32_t *bytes, strl_error *err)
{
    strl__import *state = reader->state;
    strl__input *input = &state->input;
    state->record_at = strl__input_offset(input);
    if (!strl__input_want(input, STRL_IMPORT_RECORD_HEAD))
        return expected(reader, "a record", err);
    *kind = strl__load_32(input->at, false);
    *bytes = strl__load_32(input->at + 4, false);
    if (*kind < STRL_IMPORT_FACTS || *kind > STRL_IMPORT_ERROR)
        return expected(reader, "a record of a known kind", err);
    if (*bytes > STRL_IMPORT_RECORD_MOST)
        return expected(reader, "a record of at most 768 KiB", err);
    if (STRL_IMPORT_RECORD_HEAD + *bytes > strl__input_left(input))
        return expected(reader, "a whole record", err);
    return STRL_OK;
}

static strl_status next_record(strl_reader *reader, import_record *record, strl_error *err)
{
    strl__import *state = reader->state;
    strl__input *input = &state->input;
    uint32_t bytes = 0;
    strl_status status = peek(reader, &record->kind, &bytes, err);
    if (status)
        return status;
    const size_t whole = STRL_IMPORT_RECORD_HEAD + (size_t)bytes;
    if (!strl__input_want(input, whole))
        return expected(reader, "a whole record", err);
    if (record->kind != STRL_IMPORT_END)
        state->checksum = strl__mix64(state->checksum ^ strl__checksum(input->at, whole));
    record->payload = strl_cursor_make(input->at + STRL_IMPORT_RECORD_HEAD, bytes);
    input->at += whole;
    return STRL_OK;
}

bool strl__import_facts_parse(const uint8_t *start, strl__import_facts *facts)
{
    strl_cursor cursor = strl_cursor_make(start, STRL__IMPORT_START_BYTES);
    if (memcmp(strl_cursor_take(&cursor, STRL_IMPORT_MAGIC_BYTES), STRL_IMPORT_MAGIC, STRL_IMPORT_MAGIC_BYTES) != 0)
        return false;
    uint32_t kind = strl_cursor_u32(&cursor), bytes = strl_cursor_u32(&cursor);
    uint32_t up = strl_cursor_u32(&cursor);
    facts->unit_metres = strl_cursor_f64(&cursor);
    facts->triangles = strl_cursor_u64(&cursor);
    facts->stream_most = strl_cursor_u64(&cursor);
    memcpy(facts->format, strl_cursor_take(&cursor, STRL_IMPORT_FORMAT_BYTES), STRL_IMPORT_FORMAT_BYTES);
    facts->format[STRL_IMPORT_FORMAT_BYTES] = 0;
    facts->up = (strl_axis)up;
    return kind == STRL_IMPORT_FACTS && bytes == STRL_IMPORT_FACTS_BYTES && up <= STRL_AXIS_Z &&
           facts->unit_metres >= 0 && __builtin_isfinite(facts->unit_metres);
}

/* After the magic; where the stream tells an error first, there are no facts. */
static strl_status scan_start(strl_reader *reader, strl_error *err)
{
    strl__import *state = reader->state;
    strl__input *input = &state->input;
    if (!strl__input_want(input, STRL_IMPORT_MAGIC_BYTES) ||
        memcmp(input->at, STRL_IMPORT_MAGIC, STRL_IMPORT_MAGIC_BYTES) != 0)
        return expected(reader, "the word " STRL_IMPORT_MAGIC, err);
    if (strl__input_want(input, STRL__IMPORT_START_BYTES) &&
        strl__import_facts_parse((const uint8_t *)input->at, &state->facts)) {
        input->at += STRL__IMPORT_START_BYTES;
        return STRL_OK;
    }
    import_record record;
    input->at += STRL_IMPORT_MAGIC_BYTES;
    strl_status status = next_record(reader, &record, err);
    if (status)
        return status;
    return record.kind == STRL_IMPORT_ERROR ? tell_error(reader, record.payload, err)
                                            : expected(reader, "facts or an error", err);
}

strl_status strl__import_scan(strl_reader *reader, strl_error *err)
{
    strl__import *state = reader->state;
    strl__input_deinit(&state->input);
    strl_status status = strl__input_init(&state->input, state->spool, WINDOW_BYTES, err);
    if (!status)
        status = scan_start(reader, err);
    uint32_t kind = STRL_IMPORT_FACTS, bytes = 0;
    while (!status && kind != STRL_IMPORT_END) {
        import_record record;
        status = peek(reader, &kind, &bytes, err);
        if (!status && kind == STRL_IMPORT_ERROR)
            status = next_record(reader, &record, err);
        if (!status && kind == STRL_IMPORT_ERROR)
            return tell_error(reader, record.payload, err);
        if (!status && !strl__input_skip(&state->input, STRL_IMPORT_RECORD_HEAD + (uint64_t)bytes))
            status = expected(reader, "a whole record", err);
    }
    state->record_at = strl__input_offset(&state->input);
    if (!status && strl__input_left(&state->input) > 0)
        status = expected(reader, "nothing more", err);
    return status;
}

/* ---- records ---- */

static strl_status add_name(strl_reader *reader, strl__names *names, const char *text, size_t length, uint32_t *index,
                            strl_error *err)
{
    strl_status status = strl__names_add(names, text, length, index, err);
    return status ? strl__fail_context(err, status, "%s", reader->path) : STRL_OK;
}

static strl_status take_part(strl_reader *reader, strl_cursor payload, strl_error *err)
{
    strl__import *state = reader->state;
    size_t length = strl_cursor_left(&payload);
    if (length > STRL_IMPORT_NAME_MOST)
        return expected(reader, "a name of at most 1023 bytes", err);
    const char *text = (const char *)strl_cursor_take(&payload, length);
    strl_status status = add_name(reader, &reader->parts, text, length, &state->part, err);
    state->part_known = !status;
    return status;
}

/* Materials of one name may differ in colour; a name stands for one colour here, so a later one
 * takes its number into its name. Every pass names them alike, because the first one's colour is
 * there already. */
static strl_status name_material(strl_reader *reader, const char *text, size_t length, uint32_t rgba, uint32_t *index,
                                 strl_error *err)
{
    strl__import *state = reader->state;
    strl__names *names = &reader->materials;
    char name[STRL_IMPORT_NAME_MOST + 16];
    size_t known = names->count;
    strl_status status = add_name(reader, names, text, length, index, err);
    if (status)
        return status;
    if (*index < known && names->items[*index].rgba != rgba) {
        int used = snprintf(name, sizeof name, "%.*s #%zu", (int)(length < 1000 ? length : 1000), text,
                            state->material_count + 1);
        known = names->count;
        status = add_name(reader, names, name, (size_t)used, index, err);
    }
    if (!status && *index >= known)
        names->items[*index].rgba = rgba;
    return status;
}

static strl_status take_material(strl_reader *reader, strl_cursor payload, strl_error *err)
{
    strl__import *state = reader->state;
    uint32_t rgba = strl_cursor_u32(&payload), index;
    size_t length = strl_cursor_left(&payload);
    if (payload.failed || length > STRL_IMPORT_NAME_MOST)
        return expected(reader, "a material with a name of at most 1023 bytes", err);
    if (state->material_count == MATERIALS_MOST)
        return strl__fail(err, STRL_ERR_LIMIT, "%s: expected at most %zu materials", reader->path, MATERIALS_MOST);
    const char *text = (const char *)strl_cursor_take(&payload, length);
    strl_status status = name_material(reader, text, length, rgba, &index, err);
    if (status)
        return status;
    if (!strl__grow(&state->materials, &state->material_capacity, state->material_count + 1, sizeof *state->materials))
        return strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for %zu materials", reader->path,
                          state->material_count + 1);
    state->materials[state->material_count++] = index;
    return STRL_OK;
}

/* The material of a block; the first block without one makes the plain one. */
static strl_status find_material(strl_reader *reader, uint32_t number, uint32_t *index, strl_error *err)
{
    strl__import *state = reader->state;
    if (number < state->material_count) {
        *index = state->materials[number];
        return STRL_OK;
    }
    if (number != STRL_IMPORT_NO_MATERIAL)
        return expected(reader, "a block of a material that came before it", err);
    strl_status status = state->plain_known ? STRL_OK : name_material(reader, "", 0, 0xffffffffu, &state->plain, err);
    state->plain_known = !status;
    *index = state->plain;
    return status;
}

static strl_status take_end(strl_reader *reader, strl_cursor payload, strl_error *err)
{
    strl__import *state = reader->state;
    uint64_t triangles = strl_cursor_u64(&payload), lines = strl_cursor_u64(&payload);
    uint64_t points = strl_cursor_u64(&payload), empty = strl_cursor_u64(&payload);
    uint64_t checksum = strl_cursor_u64(&payload);
    if (payload.failed || strl_cursor_left(&payload) > 0)
        return expected(reader, "an end of 40 bytes", err);
    if (triangles != state->triangles || triangles != state->facts.triangles)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "%s: the stream of triangles that was imported from it is broken: it "
                          "announces %" PRIu64 " triangles, ends with %" PRIu64 " and has %" PRIu64,
                          reader->path, state->facts.triangles, triangles, state->triangles);
    if (checksum != state->checksum)
        return expected(reader, "another checksum in the end", err);
    reader->drops.lines += lines;
    reader->drops.points += points;
    reader->drops.degenerate_faces += empty;
    reader->ended = true;
    return STRL_OK;
}

/* ---- blocks ---- */

/* A block whose sizes agree. */
typedef struct import_block {
    uint32_t flags, material, vertex_count, face_count, corner_count;
    const uint8_t *positions, *normals, *colours; /* the last two NULL where absent */
    const uint8_t *face_corners;                  /* NULL: triangles */
    const uint8_t *corners;
} import_block;

static bool parse_block(strl_cursor *payload, import_block *block)
{
    block->flags = strl_cursor_u32(payload);
    block->material = strl_cursor_u32(payload);
    block->vertex_count = strl_cursor_u32(payload);
    block->face_count = strl_cursor_u32(payload);
    block->corner_count = strl_cursor_u32(payload);
    if (payload->failed || (block->flags & ~(uint32_t)STRL_IMPORT_ALL_FLAGS) != 0 || block->vertex_count == 0 ||
        block->vertex_count > STRL_IMPORT_CORNERS_MOST || block->face_count == 0 ||
        block->corner_count > STRL_IMPORT_CORNERS_MOST || block->face_count > block->corner_count / 3)
        return false;
    if (!(block->flags & STRL_IMPORT_POLYGONS) && block->corner_count != 3 * block->face_count)
        return false;
    size_t vertices = block->vertex_count;
    block->positions = strl_cursor_take(payload, vertices * (block->flags & STRL_IMPORT_DOUBLES ? 24 : 12));
    block->normals = block->flags & STRL_IMPORT_NORMALS ? strl_cursor_take(payload, vertices * 12) : NULL;
    block->colours = block->flags & STRL_IMPORT_COLOURS ? strl_cursor_take(payload, vertices * 4) : NULL;
    block->face_corners =
        block->flags & STRL_IMPORT_POLYGONS ? strl_cursor_take(payload, (size_t)block->face_count * 2) : NULL;
    block->corners = strl_cursor_take(payload, (size_t)block->corner_count * 2);
    return !payload->failed && strl_cursor_left(payload) == 0;
}

static void load_corner(const import_block *block, uint32_t vertex, strl__corner *corner)
{
    bool doubles = block->flags & STRL_IMPORT_DOUBLES;
    const uint8_t *position = block->positions + (size_t)vertex * (doubles ? 24 : 12);
    for (unsigned k = 0; k < 3; k++)
        corner->position[k] =
            doubles ? strl__load_f64(position + 8 * k, false) : (double)strl__load_f32(position + 4 * k, false);
    bool finite = block->normals != NULL;
    for (unsigned k = 0; k < 3; k++) {
        corner->normal[k] = block->normals ? strl__load_f32(block->normals + 12 * (size_t)vertex + 4 * k, false) : 0;
        finite = finite && __builtin_isfinite(corner->normal[k]);
    }
    if (!finite)
        memset(corner->normal, 0, sizeof corner->normal);
    corner->colour = block->colours ? strl__load_32(block->colours + 4 * (size_t)vertex, false) : 0xffffffffu;
}

/* False where an index is too large. */
static bool load_corners(const import_block *block, strl__corner *corners)
{
    for (uint32_t i = 0; i < block->corner_count; i++) {
        uint32_t vertex = strl__load_16(block->corners + 2 * (size_t)i, false);
        if (vertex >= block->vertex_count)
            return false;
        load_corner(block, vertex, &corners[i]);
    }
    return true;
}

/* Counts first: a face must not be added before all of them are known to fit. */
static bool faces_fit(const import_block *block)
{
    uint64_t corners = 0;
    if (!block->face_corners)
        return true;
    for (uint32_t f = 0; f < block->face_count; f++) {
        uint32_t count = strl__load_16(block->face_corners + 2 * (size_t)f, false);
        if (count < 3)
            return false;
        corners += count;
    }
    return corners == block->corner_count;
}

static void add_faces(strl_reader *reader, const import_block *block, uint32_t material)
{
    strl__import *state = reader->state;
    reader->batch.has_corner_colour = block->colours != NULL;
    for (uint32_t f = 0; f < block->face_count; f++) {
        uint32_t count = block->face_corners ? strl__load_16(block->face_corners + 2 * (size_t)f, false) : 3;
        const strl__face face = {count, state->part, material, 0xffffffffu};
        strl__batch_add(&reader->batch, &face);
        state->triangles += count - 2;
    }
}

static strl_status take_block(strl_reader *reader, strl_cursor payload, strl_error *err)
{
    strl__import *state = reader->state;
    strl__batch *batch = &reader->batch;
    import_block block;
    uint32_t material = 0;
    if (!parse_block(&payload, &block) || !faces_fit(&block))
        return expected(reader, "a block whose counts fit its size", err);
    if (!load_corners(&block, batch->corners + batch->corner_count))
        return expected(reader, "a block whose corners are among its vertices", err);
    strl_status status = find_material(reader, block.material, &material, err);
    if (!status && !state->part_known) {
        status = add_name(reader, &reader->parts, "", 0, &state->part, err);
        state->part_known = !status;
    }
    if (!status)
        add_faces(reader, &block, material);
    return status;
}

/* ---- as a format ---- */

strl_status strl__import_prepare(strl_reader *reader, strl_error *err)
{
    return strl__reader_init_batch(reader, false, err);
}

strl_status strl__import_start(strl_reader *reader, strl_error *err)
{
    strl__import *state = reader->state;
    state->material_count = 0;
    state->triangles = state->checksum = 0;
    state->part_known = state->plain_known = false;
    strl__input_seek(&state->input, STRL_IMPORT_MAGIC_BYTES, 1);
    import_record facts = {0}; /* as the scan has found them; for the checksum */
    return next_record(reader, &facts, err);
}

/* A batch has colours at all corners or at none, so one record fills it. */
strl_status strl__import_fill(strl_reader *reader, strl_error *err)
{
    import_record record;
    strl_status status = next_record(reader, &record, err);
    if (status)
        return status;
    switch (record.kind) {
    case STRL_IMPORT_PART:
        return take_part(reader, record.payload, err);
    case STRL_IMPORT_MATERIAL:
        return take_material(reader, record.payload, err);
    case STRL_IMPORT_BLOCK:
        return take_block(reader, record.payload, err);
    case STRL_IMPORT_END:
        return take_end(reader, record.payload, err);
    case STRL_IMPORT_ERROR:
        return tell_error(reader, record.payload, err);
    default:
        return expected(reader, "facts only once", err);
    }
}

/* The name of a length; NULL where there is none so long. */
static const char *unit_name(double metres)
{
    static const struct {
        const char *name;
        double metres;
    } units[] = {{"um", 1e-6}, {"mm", 0.001},  {"cm", 0.01},   {"dm", 0.1},    {"m", 1},
                 {"km", 1000}, {"in", 0.0254}, {"ft", 0.3048}, {"yd", 0.9144}, {"mi", 1609.344}};
    for (size_t i = 0; i < sizeof units / sizeof *units; i++)
        if (metres > units[i].metres * 0.999999 && metres < units[i].metres * 1.000001)
            return units[i].name;
    return NULL;
}

void strl__import_note_facts(strl_reader *reader)
{
    const strl__import *state = reader->state;
    reader->default_up = state->facts.up;
    reader->default_unit = unit_name(state->facts.unit_metres);
    reader->triangles_hint = state->facts.triangles;
    reader->hint_is_exact = true;
    reader->is_certain = true;
}

uint64_t strl__import_bytes_done(const strl_reader *reader)
{
    const strl__import *state = reader->state;
    uint64_t whole = strl_file_bytes(state->spool);
    double share = whole ? (double)strl__input_offset(&state->input) / (double)whole : 1;
    return (uint64_t)(share * (double)reader->opened.bytes);
}

void strl__import_close(strl_reader *reader)
{
    strl__import *state = reader->state;
    strl__input_deinit(&state->input);
    if (state->owns_spool)
        strl_file_close(state->spool, NULL); /* without a name: nothing of it is left */
    strl__free(state->materials);
    *state = (strl__import){0};
}

static strl_status import_open(strl_reader *reader, strl_error *err)
{
    strl__import *state = reader->state;
    state->spool = reader->file;
    strl_status status = strl__import_scan(reader, err);
    strl__import_note_facts(reader);
    return status;
}

const strl__format strl__format_import = {
    .name = "import",
    .default_up = STRL_AXIS_Y,
    .state_bytes = sizeof(strl__import),
    .open = import_open,
    .prepare = strl__import_prepare,
    .start = strl__import_start,
    .fill = strl__import_fill,
    .close = strl__import_close,
    .bytes_done = strl__import_bytes_done,
};
