/* Paged tables: placements and runs of them, parts, materials, images. docs/format.md, "Paged tables". */
#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "base/cursor.h"
#include "base/fail.h"
#include "base/memory.h"
#include "verify/mesh.h"
#include "verify/model.h"
#include "verify/pieces.h"

#define PAGE_BYTES 65536u
#define MOST_REFS 2040u
#define REF_BYTES 32u
#define PLACEMENT_BYTES 104u
#define MOST_NAME_BYTES 32000u

typedef struct table {
    strl__model *model;
    unsigned kind;
    const char *name_of_kind;
    double bounds[6];        /* of the placements so far */
    const double *tree_area; /* [tree_count] NULL: everything is checked; else areas alone are summed up */
    double area;             /* of the page's placements so far */
    bool samples;            /* of a tree that adds up is one of them */
    size_t name_bytes;       /* of the name before, in the same page */
    uint8_t name[MOST_NAME_BYTES];
} table;

#define TABLE_RULE(table, condition, key, ...)                                                                         \
    do {                                                                                                               \
        strl__v_checked((table)->model->checks, STRL_VERIFY_TABLES, 1);                                                \
        if (!(condition))                                                                                              \
            strl__v_flaw((table)->model->checks, STRL_VERIFY_TABLES, (uint64_t)(table)->kind << 56 | (key),            \
                         __VA_ARGS__);                                                                                 \
    } while (0)

/* Bytes of one UTF-8 sequence at text, 0 where it is none (RFC 3629: shortest form, no surrogates, up to
 * U+10FFFF). */
static size_t utf8_sequence(const uint8_t *text, size_t left)
{
    uint8_t lead = text[0];
    size_t size = lead < 0x80 ? 1 : lead < 0xc2 ? 0 : lead < 0xe0 ? 2 : lead < 0xf0 ? 3 : lead < 0xf5 ? 4 : 0;
    if (size == 0 || size > left || lead == 0)
        return 0;
    for (size_t i = 1; i < size; i++)
        if ((text[i] & 0xc0) != 0x80)
            return 0;
    if ((lead == 0xe0 && text[1] < 0xa0) || (lead == 0xed && text[1] > 0x9f) || (lead == 0xf0 && text[1] < 0x90) ||
        (lead == 0xf4 && text[1] > 0x8f))
        return 0;
    return size;
}

/* Puts the name together: so many bytes of the one before, then the rest. False where it can't be. */
static bool read_name(table *self, uint64_t item, const uint8_t *tail, size_t bytes)
{
    size_t shared = bytes < 2 ? SIZE_MAX : tail[0] | (size_t)tail[1] << 8;
    bool good = shared <= self->name_bytes && shared + bytes - 2 <= MOST_NAME_BYTES;
    TABLE_RULE(self, good, item, "%s %" PRIu64 ": %zu bytes after %zu of the %zu of the name before",
               self->name_of_kind, item, bytes, shared, self->name_bytes);
    if (good) {
        memcpy(self->name + shared, tail + 2, bytes - 2);
        self->name_bytes = shared + bytes - 2;
    }
    return good;
}

static void check_name(table *self, uint64_t item, const uint8_t *text, size_t bytes)
{
    size_t at = 0, step = 1;
    while (at < bytes && (step = utf8_sequence(text + at, bytes - at)) != 0)
        at += step;
    TABLE_RULE(self, at == bytes && bytes <= MOST_NAME_BYTES, item,
               "%s %" PRIu64 ": its name of %zu bytes is not UTF-8 of at most 32000 bytes (byte %zu)",
               self->name_of_kind, item, bytes, at);
}

static void widen_bounds(table *self, uint64_t item, const strl__vtree *tree, const double m[12])
{
    double box[2][3];
    for (unsigned row = 0; row < 3; row++) {
        double low = m[4 * row + 3], high = low;
        for (unsigned k = 0; k < 3; k++) {
            double a = m[4 * row + k] * (tree->origin[k] + tree->step * (double)tree->box[0][k]);
            double b = m[4 * row + k] * (tree->origin[k] + tree->step * (double)tree->box[1][k]);
            low += fmin(a, b);
            high += fmax(a, b);
        }
        self->bounds[row] = fmin(self->bounds[row], low);
        self->bounds[3 + row] = fmax(self->bounds[3 + row], high);
        box[0][row] = low;
        box[1][row] = high;
    }
    strl__v_run_placement(self->model, item, box[0], box[1]);
}

static void check_placement(table *self, uint64_t item, const uint8_t *bytes, size_t size)
{
    strl_cursor cursor = strl_cursor_make(bytes, size);
    uint32_t tree = strl_cursor_u32(&cursor), own_part = strl_cursor_u32(&cursor);
    double m[12];
    bool finite = true;
    for (unsigned i = 0; i < 12; i++) {
        m[i] = strl_cursor_f64(&cursor);
        finite = finite && isfinite(m[i]);
    }
    if (self->tree_area) { /* all else was sound when it was read before */
        self->area += tree < self->model->tree_count ? self->tree_area[tree] * strl__v_area_scale(m) : 0;
        self->samples |= tree < self->model->tree_count && !strl__replaces(&self->model->trees[tree]);
        return;
    }
    bool good = size == PLACEMENT_BYTES && tree < self->model->tree_count &&
                own_part <= self->model->sections[STRL__PARTS].item_count && finite;
    TABLE_RULE(self, good, item, "placement %" PRIu64 ": %zu bytes, tree %u of %u, its own part plus one %u, %s", item,
               size, tree, self->model->tree_count, own_part, finite ? "finite" : "not finite");
    if (good) {
        widen_bounds(self, item, &self->model->trees[tree], m);
        strl__hash_add(&self->model->placements,
                       strl__hash_placement(tree, strl__v_compares_parts(self->model) ? own_part : 0, m));
    }
}

/* Empty where the material has none. */
static void check_image(table *self, uint64_t item, const uint8_t *bytes, size_t size)
{
    strl_cursor cursor = strl_cursor_make(bytes, size);
    uint32_t wrap_u = strl_cursor_u8(&cursor), wrap_v = strl_cursor_u8(&cursor), reserved = strl_cursor_u16(&cursor);
    bool finite = true;
    for (unsigned i = 0; i < 4; i++) {
        float number = strl_cursor_f32(&cursor);
        finite = finite && isfinite(number) && (i < 2 || number >= 0);
    }
    if (size == 0)
        return;
    bool good = !cursor.failed && wrap_u <= 2 && wrap_v <= 2 && reserved == 0 && finite;
    TABLE_RULE(self, good, item, "image %" PRIu64 ": %zu bytes, wraps %u and %u, reserved word %u, %s", item, size,
               wrap_u, wrap_v, reserved, finite ? "a good range" : "a bad range");
    if (good)
        check_name(self, item, bytes + cursor.at, size - cursor.at);
}

static void check_item(table *self, uint64_t item, const uint8_t *bytes, size_t size)
{
    if (self->kind == STRL__IMAGES) {
        check_image(self, item, bytes, size);
        return;
    }
    if (self->kind == STRL__PLACEMENTS) {
        check_placement(self, item, bytes, size);
        return;
    }
    if (self->kind == STRL__RUNS) {
        strl__v_run_read(self->model, item, bytes, size);
        return;
    }
    size_t head = self->kind == STRL__MATERIALS ? 4 : 0;
    TABLE_RULE(self, size >= head, item, "%s %" PRIu64 ": %zu bytes are too few", self->name_of_kind, item, size);
    if (size >= head && read_name(self, item, bytes + head, size - head))
        check_name(self, item, self->name, self->name_bytes);
}

static void check_leaf(table *self, const uint8_t *bytes, size_t size, uint64_t first, uint64_t count)
{
    strl_cursor cursor = strl_cursor_make(bytes, size);
    uint32_t items = strl_cursor_u32(&cursor);
    bool good = items == count && items <= (size - 4) / 4;
    TABLE_RULE(self, good, first, "%s page from item %" PRIu64 ": %u items, expected %" PRIu64, self->name_of_kind,
               first, items, count);
    if (!good)
        return;
    size_t head = 4 + (size_t)items * 4, before = 0;
    self->name_bytes = 0;
    self->area = 0;
    self->samples = false;
    for (uint32_t i = 0; i < items; i++) {
        size_t end = strl_cursor_u32(&cursor);
        good = end >= before && end <= size - head && (i + 1 < items || end == size - head);
        TABLE_RULE(self, good, first + i, "%s %" PRIu64 ": ends at %zu of %zu, after %zu", self->name_of_kind,
                   first + i, end, size - head, before);
        if (!good)
            return;
        check_item(self, first + i, bytes + head + before, end - before);
        before = end;
    }
}

static strl_status check_page(table *self, const strl__place *place, uint32_t depth, uint64_t first, uint64_t count,
                              strl_error *err);

static strl_status check_index(table *self, const uint8_t *bytes, size_t size, uint32_t depth, uint64_t first,
                               uint64_t count, strl_error *err)
{
    strl_cursor cursor = strl_cursor_make(bytes, size);
    uint32_t refs = strl_cursor_u32(&cursor), reserved = strl_cursor_u32(&cursor);
    bool good = refs >= 1 && refs <= MOST_REFS && reserved == 0 && size == 8 + (size_t)refs * REF_BYTES;
    TABLE_RULE(self, good, first, "%s index page from item %" PRIu64 ": %u references in %zu bytes", self->name_of_kind,
               first, refs, size);
    strl_status status = STRL_OK;
    for (uint32_t i = 0; good && status == STRL_OK && i < refs; i++) {
        strl__place place = {.offset = strl_cursor_u64(&cursor)};
        uint64_t from = strl_cursor_u64(&cursor), end = first + count;
        place.checksum = strl_cursor_u64(&cursor);
        place.bytes = strl_cursor_u32(&cursor);
        uint32_t zero = strl_cursor_u32(&cursor);
        if (i + 1 < refs)
            end = strl__load_le(bytes + cursor.at + 8, 8);
        good = zero == 0 && place.bytes <= PAGE_BYTES && from < end && end <= first + count && (i > 0 || from == first);
        TABLE_RULE(self, good, from,
                   "%s index page from item %" PRIu64 ": reference %u is for items %" PRIu64 " to %" PRIu64,
                   self->name_of_kind, first, i, from, end);
        if (good)
            status = check_page(self, &place, depth - 1, from, end - from, err);
    }
    return status;
}

static void end_run(table *self, const strl__place *place, uint64_t first, uint64_t count)
{
    if (self->tree_area) {
        strl__v_run_area(self->model, first, self->area, self->samples);
        return;
    }
    strl__v_run_page(self->model, first, count, place);
    strl__v_run_end(self->model, first);
}

static strl_status check_page(table *self, const strl__place *place, uint32_t depth, uint64_t first, uint64_t count,
                              strl_error *err)
{
    bool good = place->bytes >= 8 && place->bytes <= PAGE_BYTES;
    TABLE_RULE(self, good, first, "%s page from item %" PRIu64 ": %u bytes, expected 8 to 65536", self->name_of_kind,
               first, place->bytes);
    if (!good)
        return STRL_OK;
    uint8_t *bytes = strl__alloc(place->bytes, 1);
    if (!bytes)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a page of names");
    strl_status status = strl__v_fetch(self->model, place, self->name_of_kind, first, bytes, &good, err);
    if (status == STRL_OK && good && depth > 0)
        status = check_index(self, bytes, place->bytes, depth, first, count, err);
    else if (status == STRL_OK && good)
        check_leaf(self, bytes, place->bytes, first, count);
    if (status == STRL_OK && good && depth == 0 && self->kind == STRL__PLACEMENTS)
        end_run(self, place, first, count);
    strl__free(bytes);
    return status;
}

/* Exact but for the rounding of the sums: a few units in the last place of the largest term. */
static void check_bounds(table *self)
{
    const double *found = self->bounds, *said = self->model->bounds;
    double scale = 0;
    for (unsigned i = 0; i < 6; i++)
        scale = fmax(scale, fabs(found[i]));
    for (unsigned i = 0; i < 6; i++)
        TABLE_RULE(self, fabs(found[i] - said[i]) <= 1e-12 * scale, 0,
                   "header: bounds %u are %.17g, the placements' are %.17g", i, said[i], found[i]);
}

strl_status strl__v_read_tables(strl__model *model, strl_error *err)
{
    static const char *const names[STRL__SECTIONS] = {NULL, NULL, "placement", "part", "material", "image", "run"};
    static const unsigned kinds[] = {STRL__RUNS, STRL__PLACEMENTS, STRL__PARTS, STRL__MATERIALS, STRL__IMAGES};
    strl_status status = strl__v_runs_create(model, err);
    for (unsigned i = 0; status == STRL_OK && i < sizeof kinds / sizeof *kinds; i++) {
        const unsigned kind = kinds[i];
        const strl__section *section = &model->sections[kind];
        if (section->item_count == 0)
            continue; /* images and runs may be absent */
        table self = {.model = model,
                      .kind = kind,
                      .name_of_kind = names[kind],
                      .bounds = {INFINITY, INFINITY, INFINITY, -INFINITY, -INFINITY, -INFINITY}};
        status = check_page(&self, &section->place, section->depth, 0, section->item_count, err);
        if (status == STRL_OK && kind == STRL__PLACEMENTS)
            check_bounds(&self);
    }
    return status;
}

strl_status strl__v_read_areas(strl__model *model, const double *area, strl_error *err)
{
    const strl__section *section = &model->sections[STRL__PLACEMENTS];
    table self = {.model = model, .kind = STRL__PLACEMENTS, .name_of_kind = "placement", .tree_area = area};
    return check_page(&self, &section->place, section->depth, 0, section->item_count, err);
}
