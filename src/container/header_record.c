/* The header: docs/format.md, "Header". */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <xxhash.h>

#include "base/fail.h"
#include "base/hash.h"
#include "container/record.h"

/* The id covers all but itself and the checksum, both of which must be zero in `bytes`. */
static void compute_model_id(const uint8_t bytes[STRL__HEADER_BYTES], uint8_t id[16])
{
    XXH128_canonical_t canonical;
    XXH128_canonicalFromHash(&canonical, XXH3_128bits(bytes, STRL__HEADER_BYTES));
    memcpy(id, canonical.digest, 16);
}

static void encode_section(strl_writer *out, const strl__section *section)
{
    strl_writer_u32(out, section->kind);
    strl_writer_u32(out, section->depth);
    strl_writer_u64(out, section->item_count);
    strl_writer_u64(out, section->ref.offset);
    strl_writer_u32(out, section->ref.bytes);
    strl_writer_u32(out, 0);
    strl_writer_u64(out, section->ref.checksum);
}

void strl__header_encode(strl__header *header, uint8_t bytes[STRL__HEADER_BYTES])
{
    static const uint8_t no_id[16] = {0};
    strl_container_info *info = &header->info;
    memset(bytes, 0, STRL__HEADER_BYTES);
    strl_writer out = {.data = bytes, .capacity = STRL__HEADER_BYTES};
    strl_writer_bytes(&out, STRL__MAGIC, 8);
    strl_writer_u32(&out, STRL__VERSION);
    strl_writer_u32(&out, STRL__HEADER_BYTES);
    strl_writer_bytes(&out, no_id, sizeof no_id);
    strl_writer_u64(&out, 0); /* checksum */
    strl_writer_u64(&out, info->file_bytes);
    strl_writer_bytes(&out, info->unit, sizeof info->unit);
    strl_writer_u32(&out, info->up_axis);
    strl_writer_u32(&out, (info->has_colour ? STRL__FLAG_COLOUR : 0) | (info->closed_hint ? STRL__FLAG_CLOSED : 0));
    strl_writer_u64(&out, info->triangles_in);
    strl_writer_u64(&out, info->dropped_nonfinite);
    strl_writer_u64(&out, info->dropped_degenerate);
    strl_writer_u64(&out, info->dropped_lines);
    strl_writer_u64(&out, info->dropped_points);
    for (int i = 0; i < 6; i++)
        strl_writer_f64(&out, info->bounds[i]);
    unsigned sections = 0;
    for (unsigned i = 0; i < STRL__KNOWN_SECTIONS; i++)
        sections += header->sections[i].item_count > 0;
    strl_writer_u32(&out, sections);
    strl_writer_u32(&out, 0);
    for (unsigned i = 0; i < STRL__KNOWN_SECTIONS; i++)
        if (header->sections[i].item_count > 0)
            encode_section(&out, &header->sections[i]);
    compute_model_id(bytes, info->model_id);
    memcpy(bytes + STRL__AT_MODEL_ID, info->model_id, 16);
    strl__store_le(bytes + STRL__AT_CHECKSUM, 8, strl__checksum(bytes, STRL__HEADER_BYTES));
}

static strl_status check_identity(const uint8_t bytes[STRL__HEADER_BYTES], strl_error *err)
{
    if (memcmp(bytes, STRL__MAGIC, 8) != 0)
        return strl__fail(err, STRL_ERR_FORMAT, "not a Stroll container: the first 8 bytes are not its magic number");
    uint32_t version = (uint32_t)strl__load_le(bytes + STRL__AT_VERSION, 4);
    if (version != STRL__VERSION)
        return strl__fail(err, STRL_ERR_UNSUPPORTED, "container version is %" PRIu32 ", expected %u", version,
                          STRL__VERSION);
    uint8_t copy[STRL__HEADER_BYTES];
    memcpy(copy, bytes, sizeof copy);
    uint64_t stored = strl__load_le(copy + STRL__AT_CHECKSUM, 8);
    memset(copy + STRL__AT_CHECKSUM, 0, 8);
    uint64_t found = strl__checksum(copy, sizeof copy);
    if (found != stored)
        return strl__fail(err, STRL_ERR_FORMAT, "header: checksum is %016" PRIx64 ", expected %016" PRIx64, found,
                          stored);
    uint8_t id[16];
    memset(copy + STRL__AT_MODEL_ID, 0, 16);
    compute_model_id(copy, id);
    if (memcmp(id, bytes + STRL__AT_MODEL_ID, 16) != 0)
        return strl__fail(err, STRL_ERR_FORMAT, "header: the model id does not belong to this content");
    return STRL_OK;
}

static strl_status decode_facts(strl_cursor *in, strl_container_info *info, strl_error *err)
{
    strl_cursor_u32(in); /* version, checked before */
    info->version = STRL__VERSION;
    uint32_t header_bytes = strl_cursor_u32(in);
    memcpy(info->model_id, strl_cursor_take(in, 16), 16);
    strl_cursor_u64(in); /* checksum, checked before */
    info->file_bytes = strl_cursor_u64(in);
    memcpy(info->unit, strl_cursor_take(in, sizeof info->unit), sizeof info->unit);
    info->up_axis = strl_cursor_u32(in);
    uint32_t flags = strl_cursor_u32(in);
    info->has_colour = flags & STRL__FLAG_COLOUR;
    info->closed_hint = flags & STRL__FLAG_CLOSED ? 1 : 0;
    info->triangles_in = strl_cursor_u64(in);
    info->dropped_nonfinite = strl_cursor_u64(in);
    info->dropped_degenerate = strl_cursor_u64(in);
    info->dropped_lines = strl_cursor_u64(in);
    info->dropped_points = strl_cursor_u64(in);
    for (int i = 0; i < 6; i++)
        info->bounds[i] = strl_cursor_f64(in);
    if (header_bytes != STRL__HEADER_BYTES)
        return strl__fail(err, STRL_ERR_FORMAT, "header: its size is %" PRIu32 ", expected %u", header_bytes,
                          STRL__HEADER_BYTES);
    if (info->unit[sizeof info->unit - 1] != 0)
        return strl__fail(err, STRL_ERR_FORMAT, "header: the unit is not terminated within 16 bytes");
    if (info->up_axis > 2)
        return strl__fail(err, STRL_ERR_FORMAT, "header: up axis is %" PRIu32 ", expected 0 to 2", info->up_axis);
    if (flags & ~(STRL__FLAG_COLOUR | STRL__FLAG_CLOSED))
        return strl__fail(err, STRL_ERR_FORMAT, "header: flags are 0x%" PRIx32 ", expected 0x0 to 0x3", flags);
    for (int i = 0; i < 3; i++)
        if (!isfinite(info->bounds[i]) || !isfinite(info->bounds[i + 3]) || info->bounds[i] > info->bounds[i + 3])
            return strl__fail(err, STRL_ERR_FORMAT,
                              "header: bounds on axis %d are %g to %g, expected finite and in order", i,
                              info->bounds[i], info->bounds[i + 3]);
    return STRL_OK;
}

static const char *const section_names[] = {"trees", "placements", "parts", "materials", "images", "runs"};

static strl_status check_known_section(const strl__section *section, uint64_t file_bytes, strl_error *err)
{
    const char *name = section_names[section->kind - 1];
    bool table = section->kind != STRL__SECTION_TREES;
    /* An item of a table takes at least 4 bytes; that bounds what any later count can claim. */
    uint64_t most = !table                                      ? STRL__MAX_TREES
                    : section->kind == STRL__SECTION_PLACEMENTS ? file_bytes / STRL__PLACEMENT_BYTES
                    : section->kind == STRL__SECTION_RUNS       ? file_bytes / STRL__RUN_BYTES
                    : file_bytes / 4 < STRL_NONE - 1            ? file_bytes / 4
                                                                : STRL_NONE - 1;
    if (section->item_count < 1 || section->item_count > most)
        return strl__fail(err, STRL_ERR_FORMAT, "section %s: %" PRIu64 " items, expected 1 to %" PRIu64, name,
                          section->item_count, most);
    if (section->depth > (table ? STRL__TABLE_MAX_DEPTH : 0))
        return strl__fail(err, STRL_ERR_FORMAT, "section %s: depth is %" PRIu32 ", expected at most %u", name,
                          section->depth, table ? STRL__TABLE_MAX_DEPTH : 0);
    if (table && section->ref.bytes > STRL__TABLE_PAGE_BYTES)
        return strl__fail(err, STRL_ERR_FORMAT, "section %s: its page has %" PRIu32 " bytes, expected at most %u", name,
                          section->ref.bytes, STRL__TABLE_PAGE_BYTES);
    if (!table && section->ref.bytes != section->item_count * STRL__TREE_BYTES)
        return strl__fail(err, STRL_ERR_FORMAT, "section %s: %" PRIu32 " bytes, expected %" PRIu64, name,
                          section->ref.bytes, section->item_count * STRL__TREE_BYTES);
    char what[32];
    snprintf(what, sizeof what, "section %s", name);
    return strl__ref_check(&section->ref, file_bytes, what, err);
}

/* Sections that are there only where others ask for them. */
static strl_status check_optional(const strl__header *header, strl_error *err)
{
    const strl__section *sections = header->sections;
    const uint64_t images = sections[STRL__SECTION_IMAGES - 1].item_count,
                   materials = sections[STRL__SECTION_MATERIALS - 1].item_count;
    const uint64_t runs = sections[STRL__SECTION_RUNS - 1].item_count,
                   placements = sections[STRL__SECTION_PLACEMENTS - 1].item_count;
    const uint64_t of_placements = placements > STRL_RUN_PLACEMENTS ? (placements - 1) / STRL_RUN_PLACEMENTS + 1 : 0;
    if (images && images != materials)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "section images: %" PRIu64 " items, expected one for each of %" PRIu64 " materials", images,
                          materials);
    if (runs != of_placements)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "section runs: %" PRIu64 " items, expected %" PRIu64 " for %" PRIu64 " placements", runs,
                          of_placements, placements);
    return STRL_OK;
}

static strl_status decode_sections(strl_cursor *in, strl__header *header, strl_error *err)
{
    uint32_t count = strl_cursor_u32(in), reserved = strl_cursor_u32(in), last_kind = 0, known = 0;
    if (count > STRL__MAX_SECTIONS || reserved)
        return strl__fail(err, STRL_ERR_FORMAT, "header: %" PRIu32 " sections, expected at most %u", count,
                          STRL__MAX_SECTIONS);
    for (uint32_t i = 0; i < count; i++) {
        strl__section section;
        section.kind = strl_cursor_u32(in);
        section.depth = strl_cursor_u32(in);
        section.item_count = strl_cursor_u64(in);
        section.ref.offset = strl_cursor_u64(in);
        section.ref.bytes = strl_cursor_u32(in);
        reserved = strl_cursor_u32(in);
        section.ref.checksum = strl_cursor_u64(in);
        if (section.kind <= last_kind || reserved)
            return strl__fail(err, STRL_ERR_FORMAT,
                              "header: section %" PRIu32 " of kind %" PRIu32
                              " is out of order or uses a reserved field",
                              i, section.kind);
        last_kind = section.kind;
        if (section.kind >= STRL__SECTION_OPTIONAL)
            continue;
        if (section.kind > STRL__KNOWN_SECTIONS)
            return strl__fail(err, STRL_ERR_UNSUPPORTED, "header: section of the unknown kind %" PRIu32, section.kind);
        strl_status status = check_known_section(&section, header->info.file_bytes, err);
        if (status != STRL_OK)
            return status;
        header->sections[section.kind - 1] = section;
        known += section.kind <= STRL__REQUIRED_SECTIONS;
    }
    if (known != STRL__REQUIRED_SECTIONS)
        return strl__fail(err, STRL_ERR_FORMAT, "header: %" PRIu32 " of the %u required sections are present", known,
                          STRL__REQUIRED_SECTIONS);
    strl_status status = check_optional(header, err);
    if (status != STRL_OK)
        return status;
    while (strl_cursor_left(in))
        if (strl_cursor_u8(in))
            return strl__fail(err, STRL_ERR_FORMAT, "header: a reserved byte is not zero");
    return STRL_OK;
}

strl_status strl__header_decode(const uint8_t bytes[STRL__HEADER_BYTES], uint64_t source_bytes, strl__header *header,
                                strl_error *err)
{
    memset(header, 0, sizeof *header);
    strl_status status = check_identity(bytes, err);
    if (status != STRL_OK)
        return status;
    strl_cursor in = strl_cursor_make(bytes, STRL__HEADER_BYTES);
    strl_cursor_take(&in, 8);
    status = decode_facts(&in, &header->info, err);
    if (status != STRL_OK)
        return status;
    strl_container_info *info = &header->info;
    if (info->file_bytes != source_bytes)
        return strl__fail(err, STRL_ERR_FORMAT, "the file has %" PRIu64 " bytes, expected %" PRIu64 " from its header",
                          source_bytes, info->file_bytes);
    status = decode_sections(&in, header, err);
    info->tree_count = (uint32_t)header->sections[STRL__SECTION_TREES - 1].item_count;
    info->placement_count = header->sections[STRL__SECTION_PLACEMENTS - 1].item_count;
    info->part_count = (uint32_t)header->sections[STRL__SECTION_PARTS - 1].item_count;
    info->has_images = header->sections[STRL__SECTION_IMAGES - 1].item_count > 0;
    info->material_count = (uint32_t)header->sections[STRL__SECTION_MATERIALS - 1].item_count;
    return status;
}
