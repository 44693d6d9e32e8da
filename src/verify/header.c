/* Header and trees section: docs/format.md, "Header" and "Trees section". */
#include <inttypes.h>
#include <math.h>
#include <string.h>
#include <xxhash.h>

#include "base/cursor.h"
#include "base/fail.h"
#include "base/memory.h"
#include "verify/model.h"

#define HEADER_BYTES 4096u
#define TREE_BYTES 144u
#define LATTICE_LIMIT ((int64_t)1 << 62)

bool strl__v_place_good(strl__model *model, const strl__place *place, const char *what, uint64_t key)
{
    strl__v_checked(model->checks, STRL_VERIFY_REFERENCES, 1);
    if (place->offset % 64 == 0 && place->offset >= HEADER_BYTES && place->bytes > 0 &&
        place->offset <= model->file_bytes && place->bytes <= model->file_bytes - place->offset)
        return true;
    strl__v_flaw(model->checks, STRL_VERIFY_REFERENCES, key,
                 "%s: bytes %" PRIu64 " to %" PRIu64
                 " are not a multiple of 64 from byte 4096 on inside the file of %" PRIu64 " bytes",
                 what, place->offset, place->offset + place->bytes, model->file_bytes);
    return false;
}

strl_status strl__v_fetch(strl__model *model, const strl__place *place, const char *what, uint64_t key, uint8_t *data,
                          bool *good, strl_error *err)
{
    *good = false;
    if (!strl__v_place_good(model, place, what, key))
        return STRL_OK;
    strl_status status = strl_file_read(model->file, place->offset, data, place->bytes, err);
    if (status != STRL_OK)
        return status;
    uint64_t found = XXH3_64bits(data, place->bytes);
    strl__v_checked(model->checks, STRL_VERIFY_CHECKSUMS, 1);
    *good = found == place->checksum;
    if (!*good)
        strl__v_flaw(model->checks, STRL_VERIFY_CHECKSUMS, key,
                     "%s at byte %" PRIu64 ": its checksum is %016" PRIx64 ", expected %016" PRIx64, what,
                     place->offset, found, place->checksum);
    return STRL_OK;
}

/* A header fault: all of them share one kind and one key, the first is told. */
#define HEADER_RULE(model, condition, ...)                                                                             \
    do {                                                                                                               \
        strl__v_checked((model)->checks, STRL_VERIFY_HEADER, 1);                                                       \
        if (!(condition))                                                                                              \
            strl__v_flaw((model)->checks, STRL_VERIFY_HEADER, 0, __VA_ARGS__);                                         \
    } while (0)

static void check_identity(strl__model *model, const uint8_t bytes[HEADER_BYTES])
{
    uint8_t copy[HEADER_BYTES];
    XXH128_canonical_t id;
    memcpy(copy, bytes, HEADER_BYTES);
    memset(copy + 32, 0, 8);
    uint64_t expected = strl__load_le(bytes + 32, 8), found = XXH3_64bits(copy, HEADER_BYTES);
    strl__v_checked(model->checks, STRL_VERIFY_CHECKSUMS, 1);
    if (found != expected)
        strl__v_flaw(model->checks, STRL_VERIFY_CHECKSUMS, 0,
                     "header: its checksum is %016" PRIx64 ", expected %016" PRIx64, found, expected);
    memset(copy + 16, 0, 16);
    XXH128_canonicalFromHash(&id, XXH3_128bits(copy, HEADER_BYTES));
    HEADER_RULE(model, memcmp(id.digest, bytes + 16, 16) == 0, "header: the model id is not that of the content");
}

static void read_section(strl__model *model, strl_cursor *cursor, uint32_t number, uint32_t *kind_before)
{
    uint32_t kind = strl_cursor_u32(cursor), depth = strl_cursor_u32(cursor);
    strl__section section = {.depth = depth, .item_count = strl_cursor_u64(cursor)};
    section.place.offset = strl_cursor_u64(cursor);
    section.place.bytes = strl_cursor_u32(cursor);
    uint32_t reserved = strl_cursor_u32(cursor);
    section.place.checksum = strl_cursor_u64(cursor);
    HEADER_RULE(model, kind > *kind_before, "header: section %u is of kind %u, not above that before it (%u)", number,
                kind, *kind_before);
    *kind_before = kind;
    HEADER_RULE(model, (kind > 0 && kind < STRL__SECTIONS) || kind >= 0x80000000u,
                "header: section %u is of unknown kind %u", number, kind);
    HEADER_RULE(model, depth <= 3 && reserved == 0 && (depth == 0 || (kind != STRL__TREES && kind < STRL__SECTIONS)),
                "header: section %u of kind %u has depth %u and reserved word %u", number, kind, depth, reserved);
    HEADER_RULE(model, (kind != STRL__IMAGES && kind != STRL__RUNS) || section.item_count > 0,
                "header: the section of kind %u has no item", kind);
    if (kind > 0 && kind < STRL__SECTIONS)
        model->sections[kind] = section;
    strl__v_place_good(model, &section.place, "header: a section", number);
}

static void check_sections(strl__model *model)
{
    const strl__section *s = model->sections;
    const uint64_t least[STRL__SECTIONS] = {0, 1, 1, 1, 1, 0, 0};
    const uint64_t most[STRL__SECTIONS] = {
        0, 512, model->file_bytes / 104, UINT32_MAX - 1, UINT32_MAX - 1, UINT32_MAX - 1, model->file_bytes / 80};
    const uint64_t placements = s[STRL__PLACEMENTS].item_count;
    const uint64_t runs = placements > STRL__RUN_PLACEMENTS ? (placements - 1) / STRL__RUN_PLACEMENTS + 1 : 0;
    HEADER_RULE(model, s[STRL__IMAGES].item_count == 0 || s[STRL__IMAGES].item_count == s[STRL__MATERIALS].item_count,
                "header: images of %" PRIu64 " materials, expected of all %" PRIu64, s[STRL__IMAGES].item_count,
                s[STRL__MATERIALS].item_count);
    HEADER_RULE(model, s[STRL__RUNS].item_count == runs,
                "header: %" PRIu64 " runs of %" PRIu64 " placements, expected %" PRIu64, s[STRL__RUNS].item_count,
                placements, runs);
    for (unsigned kind = STRL__TREES; kind < STRL__SECTIONS; kind++)
        HEADER_RULE(model, s[kind].item_count >= least[kind] && s[kind].item_count <= most[kind],
                    "header: section kind %u has %" PRIu64 " items, expected %" PRIu64 " to %" PRIu64, kind,
                    s[kind].item_count, least[kind], most[kind]);
    HEADER_RULE(model, s[STRL__TREES].place.bytes == s[STRL__TREES].item_count * TREE_BYTES,
                "header: %" PRIu64 " trees take %u bytes, expected %u each", s[STRL__TREES].item_count,
                s[STRL__TREES].place.bytes, TREE_BYTES);
}

static void check_unit(strl__model *model, const uint8_t unit[16])
{
    bool ended = false, good = unit[15] == 0;
    for (unsigned i = 0; i < 16; i++) {
        good = good && !(ended && unit[i]);
        ended = ended || unit[i] == 0;
    }
    HEADER_RULE(model, good, "header: the unit is not padded with zeros");
}

static void read_fields(strl__model *model, const uint8_t bytes[HEADER_BYTES])
{
    strl_cursor cursor = strl_cursor_make(bytes, HEADER_BYTES);
    cursor.at = 40;
    model->file_bytes = strl_cursor_u64(&cursor);
    HEADER_RULE(model, model->file_bytes == strl_file_bytes(model->file),
                "header: the file has %" PRIu64 " bytes, expected %" PRIu64, strl_file_bytes(model->file),
                model->file_bytes);
    if (model->file_bytes > strl_file_bytes(model->file))
        model->file_bytes = strl_file_bytes(model->file);
    check_unit(model, bytes + 48);
    cursor.at = 64;
    uint32_t up = strl_cursor_u32(&cursor), flags = strl_cursor_u32(&cursor);
    HEADER_RULE(model, up <= 2, "header: up axis %u, expected 0 to 2", up);
    HEADER_RULE(model, flags <= 3, "header: flags %u, expected 0 to 3", flags);
    model->closed = flags & 2;
    model->triangles_in = strl_cursor_u64(&cursor);
    model->dropped_nonfinite = strl_cursor_u64(&cursor);
    model->dropped_degenerate = strl_cursor_u64(&cursor);
    model->dropped_lines = strl_cursor_u64(&cursor);
    model->dropped_points = strl_cursor_u64(&cursor);
    for (unsigned i = 0; i < 6; i++)
        model->bounds[i] = strl_cursor_f64(&cursor);
    for (unsigned k = 0; k < 3; k++)
        HEADER_RULE(model,
                    isfinite(model->bounds[k]) && isfinite(model->bounds[3 + k]) &&
                        model->bounds[k] <= model->bounds[3 + k],
                    "header: the bounds of axis %u are %g to %g", k, model->bounds[k], model->bounds[3 + k]);
    uint32_t sections = strl_cursor_u32(&cursor), reserved = strl_cursor_u32(&cursor), kind = 0;
    HEADER_RULE(model, sections >= 4 && sections <= 64 && reserved == 0, "header: %u sections and reserved word %u",
                sections, reserved);
    for (uint32_t i = 0; i < sections && i < 64; i++)
        read_section(model, &cursor, i, &kind);
    check_sections(model);
    for (bool zero = true; zero && cursor.at < HEADER_BYTES; cursor.at++) {
        zero = bytes[cursor.at] == 0;
        HEADER_RULE(model, zero, "header: reserved byte %zu is %u", cursor.at, bytes[cursor.at]);
    }
}

strl_status strl__v_read_header(strl__model *model, bool *sound, strl_error *err)
{
    uint8_t bytes[HEADER_BYTES];
    size_t got;
    *sound = false;
    strl_status status = strl_file_read_some(model->file, 0, bytes, sizeof bytes, &got, err);
    if (status != STRL_OK)
        return status;
    model->file_bytes = strl_file_bytes(model->file);
    bool named = got == sizeof bytes && memcmp(bytes, "STROLL\x1a\n", 8) == 0;
    HEADER_RULE(model, named, "header: the file does not begin with a header of 4096 bytes and the word STROLL");
    if (!named)
        return STRL_OK;
    uint32_t version = (uint32_t)strl__load_le(bytes + 8, 4), size = (uint32_t)strl__load_le(bytes + 12, 4);
    HEADER_RULE(model, version == 1 && size == HEADER_BYTES, "header: version %u of %u bytes, expected 1 of 4096",
                version, size);
    if (version != 1 || size != HEADER_BYTES)
        return STRL_OK;
    check_identity(model, bytes);
    read_fields(model, bytes);
    *sound = !strl__v_flawed(model->checks, STRL_VERIFY_HEADER) &&
             !strl__v_flawed(model->checks, STRL_VERIFY_CHECKSUMS) &&
             !strl__v_flawed(model->checks, STRL_VERIFY_REFERENCES);
    return STRL_OK;
}

static bool step_good(double step)
{
    int exponent;
    return isfinite(step) && step > 0 && frexp(step, &exponent) == 0.5 && exponent - 1 >= -512 && exponent - 1 <= 512;
}

static bool box_good(int64_t box[2][3])
{
    for (unsigned k = 0; k < 3; k++)
        if (box[0][k] > box[1][k] || box[0][k] < -LATTICE_LIMIT || box[1][k] > LATTICE_LIMIT)
            return false;
    return true;
}

static void decode_tree(const uint8_t bytes[TREE_BYTES], strl__vtree *tree, bool *reserved_zero)
{
    strl_cursor cursor = strl_cursor_make(bytes, TREE_BYTES);
    tree->structure = strl_cursor_u32(&cursor);
    tree->level_count = strl_cursor_u32(&cursor);
    tree->node_count = strl_cursor_u32(&cursor);
    tree->group_count = strl_cursor_u32(&cursor);
    for (unsigned k = 0; k < 3; k++)
        tree->origin[k] = strl_cursor_f64(&cursor);
    tree->step = strl_cursor_f64(&cursor);
    for (unsigned i = 0; i < 6; i++)
        tree->box[i / 3][i % 3] = strl_cursor_i64(&cursor);
    tree->triangle_count = strl_cursor_u64(&cursor);
    tree->vertex_count = strl_cursor_u64(&cursor);
    tree->root_triangles = strl_cursor_u32(&cursor);
    tree->leaf_geometric = strl_cursor_f32(&cursor);
    tree->root.offset = strl_cursor_u64(&cursor);
    tree->root.bytes = strl_cursor_u32(&cursor);
    *reserved_zero = strl_cursor_u32(&cursor) == 0;
    tree->root.checksum = strl_cursor_u64(&cursor);
}

static void check_tree(strl__model *model, strl__vtree *tree, bool reserved_zero)
{
    uint32_t t = tree->index;
    HEADER_RULE(model, tree->structure >= 1 && tree->structure <= 3, "tree %u: structure %u, expected 1 to 3", t,
                tree->structure);
    HEADER_RULE(
        model, tree->node_count >= 1 && tree->node_count < UINT32_MAX && tree->node_count <= model->file_bytes / 240,
        "tree %u: %u nodes cannot stand in a file of %" PRIu64 " bytes", t, tree->node_count, model->file_bytes);
    HEADER_RULE(model, tree->level_count >= 1 && tree->level_count <= 65535 && tree->level_count <= tree->node_count,
                "tree %u: %u levels of %u nodes", t, tree->level_count, tree->node_count);
    HEADER_RULE(model, tree->group_count >= 1 && tree->group_count <= tree->node_count,
                "tree %u: %u groups of %u nodes", t, tree->group_count, tree->node_count);
    HEADER_RULE(model, isfinite(tree->origin[0]) && isfinite(tree->origin[1]) && isfinite(tree->origin[2]),
                "tree %u: the origin is not finite", t);
    HEADER_RULE(model, step_good(tree->step), "tree %u: step %g is not a power of two from 2^-512 to 2^512", t,
                tree->step);
    HEADER_RULE(model, box_good(tree->box), "tree %u: its box is upside down or outside 2^62", t);
    HEADER_RULE(model, tree->leaf_geometric >= 0 && isfinite(tree->leaf_geometric), "tree %u: leaf error %g", t,
                (double)tree->leaf_geometric);
    HEADER_RULE(model, reserved_zero, "tree %u: a reserved word is not zero", t);
}

strl_status strl__v_read_trees(strl__model *model, bool *sound, strl_error *err)
{
    const strl__section *section = &model->sections[STRL__TREES];
    *sound = false;
    uint8_t *bytes = strl__alloc(section->place.bytes, 1);
    model->trees = strl__alloc_zero((size_t)section->item_count, sizeof *model->trees);
    strl_status status = STRL_OK;
    bool good = false;
    if (!bytes || !model->trees)
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for %" PRIu64 " trees", section->item_count);
    else
        status = strl__v_fetch(model, &section->place, "trees section", 0, bytes, &good, err);
    for (uint32_t t = 0; status == STRL_OK && good && t < section->item_count; t++) {
        bool reserved_zero;
        model->trees[t].index = t;
        decode_tree(bytes + (size_t)t * TREE_BYTES, &model->trees[t], &reserved_zero);
        check_tree(model, &model->trees[t], reserved_zero);
    }
    if (status == STRL_OK && good)
        model->tree_count = (uint32_t)section->item_count;
    *sound = good && !strl__v_flawed(model->checks, STRL_VERIFY_HEADER);
    strl__free(bytes);
    return status;
}

void strl__v_trees_deinit(strl__model *model)
{
    for (uint32_t t = 0; t < model->tree_count; t++) {
        strl__free(model->trees[t].nodes);
        strl__free(model->trees[t].page_first);
        strl__free(model->trees[t].group_first);
    }
    strl__free(model->trees);
    strl__free(model->runs);
    model->trees = NULL;
    model->runs = NULL;
}
