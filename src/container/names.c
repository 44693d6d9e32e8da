/* Part and material names: docs/format.md, "Paged tables". */
#include "container/names.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "base/cursor.h"
#include "base/fail.h"
#include "container/opened.h"

unsigned strl__utf8_length(const uint8_t *text, size_t left)
{
    if (left == 0 || text[0] < 0x80)
        return left != 0;
    unsigned length = text[0] >= 0xf0 ? 4 : text[0] >= 0xe0 ? 3 : 2;
    if (text[0] < 0xc2 || text[0] > 0xf4 || length > left)
        return 0;
    for (unsigned i = 1; i < length; i++)
        if ((text[i] & 0xc0) != 0x80)
            return 0;
    /* Overlong forms, surrogates, and what lies past U+10FFFF. */
    if ((text[0] == 0xe0 && text[1] < 0xa0) || (text[0] == 0xed && text[1] > 0x9f) ||
        (text[0] == 0xf0 && text[1] < 0x90) || (text[0] == 0xf4 && text[1] > 0x8f))
        return 0;
    return length;
}

bool strl__utf8_is_name(const uint8_t *text, size_t bytes)
{
    for (size_t at = 0; at < bytes;) {
        unsigned length = text[at] ? strl__utf8_length(text + at, bytes - at) : 0;
        if (!length)
            return false;
        at += length;
    }
    return true;
}

bool strl__utf8_clean(const char *name, uint8_t *out, size_t capacity, size_t *bytes)
{
    const uint8_t *text = (const uint8_t *)name;
    size_t size = strlen(name), used = 0;
    for (size_t at = 0; at < size;) {
        unsigned length = strl__utf8_length(text + at, size - at);
        const void *piece = length ? (const void *)(text + at) : "\xef\xbf\xbd";
        size_t piece_bytes = length ? length : 3;
        if (piece_bytes > capacity - used)
            return false;
        memcpy(out + used, piece, piece_bytes);
        used += piece_bytes;
        at += length ? length : 1;
    }
    *bytes = used;
    return true;
}

/* Cut at a character's border, so that what fits stays UTF-8. */
static void copy_cut(const uint8_t *text, size_t bytes, char *name, size_t size)
{
    size_t used = 0;
    while (used < bytes) {
        unsigned length = strl__utf8_length(text + used, bytes - used);
        if (used + length >= size)
            break;
        used += length;
    }
    if (size) {
        memcpy(name, text, used);
        name[used] = 0;
    }
}

static strl_status name_fault(const strl__table *table, uint64_t item, uint32_t bytes, strl_error *err)
{
    return strl__fail(err, STRL_ERR_FORMAT,
                      "table of %s: item %" PRIu64 " of %" PRIu32
                      " bytes is not a name in UTF-8 of at most %u bytes that begins as the one before it",
                      table->name, item, bytes, STRL__MAX_NAME_BYTES);
}

/* The name after table->last in the page that begins with item `first`, or the first one there: then it is told by
 * nothing. */
static strl_status next_name(strl__table *table, const uint8_t *item, uint32_t bytes, uint32_t head_bytes,
                             uint64_t index, uint64_t first, strl_error *err)
{
    strl__name *name = table->last;
    uint32_t head = head_bytes + 2, before = index == first ? 0 : name->bytes;
    uint32_t shared = bytes < head ? 0 : (uint32_t)strl__load_le(item + head_bytes, 2);
    if (bytes < head || shared > before || bytes - head > STRL__MAX_NAME_BYTES - shared)
        return name_fault(table, index, bytes, err);
    memcpy(name->text + shared, item + head, bytes - head);
    name->bytes = shared + bytes - head;
    name->item = index;
    name->first = first;
    return STRL_OK;
}

/* From the page's first name, or from the one that was asked for last where that comes before. */
static strl_status find_name(strl_container *container, strl__table *table, uint32_t index, uint32_t head_bytes,
                             uint8_t *head, strl_error *err)
{
    const uint8_t *item;
    uint32_t bytes;
    uint64_t first, other;
    strl_status status = strl__page_table_get(table, container->source, index, &item, &bytes, &first, err);
    if (status != STRL_OK)
        return status;
    if (bytes < head_bytes)
        return name_fault(table, index, bytes, err);
    if (head_bytes)
        memcpy(head, item, head_bytes);
    if (!table->last) {
        table->last = strl__alloc(1, sizeof *table->last);
        if (!table->last)
            return strl__fail(err, STRL_ERR_MEMORY, "no memory for a name of the table of %s", table->name);
        table->last->first = UINT64_MAX;
    }
    bool goes_on = table->last->first == first && table->last->item <= index;
    uint64_t at = goes_on ? table->last->item + 1 : first;
    for (; at <= index && status == STRL_OK; at++) {
        status = strl__page_table_get(table, container->source, at, &item, &bytes, &other, err);
        if (status == STRL_OK)
            status = next_name(table, item, bytes, head_bytes, at, first, err);
    }
    if (status != STRL_OK)
        table->last->first = UINT64_MAX;
    return status;
}

static strl_status get_name(strl_container *container, strl__table *table, uint32_t index, uint32_t head_bytes,
                            uint8_t *head, char *name, size_t size, strl_error *err)
{
    if (size)
        name[0] = 0;
    strl_status status = find_name(container, table, index, head_bytes, head, err);
    if (status == STRL_OK && !strl__utf8_is_name(table->last->text, table->last->bytes))
        status = name_fault(table, index, table->last->bytes, err);
    if (status != STRL_OK)
        return strl_source_fail(container->source, status, err);
    copy_cut(table->last->text, table->last->bytes, name, size);
    return STRL_OK;
}

/* In the order of the format; ranges were checked. */
static void decode_image(const uint8_t head[STRL__IMAGE_HEAD_BYTES], strl_material_image *image)
{
    strl_cursor in = strl_cursor_make(head, STRL__IMAGE_HEAD_BYTES);
    for (int k = 0; k < 2; k++)
        image->wrap[k] = (strl_wrap)strl_cursor_u8(&in);
    strl_cursor_u16(&in);
    for (int k = 0; k < 2; k++)
        image->texcoord_min[k] = strl_cursor_f32(&in);
    for (int k = 0; k < 2; k++)
        image->texcoord_extent[k] = strl_cursor_f32(&in);
}

static bool image_is_good(const strl_material_image *image)
{
    bool good = true;
    for (int k = 0; k < 2; k++)
        good = good && image->wrap[k] <= STRL_WRAP_MIRROR && isfinite(image->texcoord_min[k]) &&
               isfinite(image->texcoord_extent[k]) && image->texcoord_extent[k] >= 0;
    return good;
}

strl_status strl_container_material_image(strl_container *container, uint32_t material, char *reference, size_t size,
                                          strl_material_image *image, strl_error *err)
{
    const uint8_t *item = NULL;
    uint32_t bytes = 0;
    uint64_t first;
    *image = (strl_material_image){0};
    if (size)
        reference[0] = 0;
    if (material >= container->header.info.material_count)
        return strl__fail(err, STRL_ERR_ARGUMENT, "there is no material %" PRIu32 ", expected less than %" PRIu32,
                          material, container->header.info.material_count);
    if (!container->header.info.has_images)
        return STRL_OK;
    strl_status status =
        strl__page_table_get(&container->images, container->source, material, &item, &bytes, &first, err);
    if (status != STRL_OK)
        return strl_source_fail(container->source, status, err);
    if (bytes == 0)
        return STRL_OK;
    bool is_whole = bytes >= STRL__IMAGE_HEAD_BYTES;
    uint32_t length = is_whole ? bytes - STRL__IMAGE_HEAD_BYTES : 0;
    const uint8_t *text = item + STRL__IMAGE_HEAD_BYTES;
    if (is_whole)
        decode_image(item, image);
    if (!is_whole || length > STRL__MAX_NAME_BYTES || !strl__utf8_is_name(text, length) || !image_is_good(image))
        return strl_source_fail(container->source,
                                strl__fail(err, STRL_ERR_FORMAT,
                                           "table of images: item %" PRIu32 " of %" PRIu32
                                           " bytes has a bad range or way to repeat, or a reference that is no UTF-8",
                                           material, bytes),
                                err);
    copy_cut(text, length, reference, size);
    image->reference = reference;
    return STRL_OK;
}

strl_status strl_container_part(strl_container *container, uint32_t part, char *name, size_t size, strl_error *err)
{
    return get_name(container, &container->parts, part, 0, NULL, name, size, err);
}

strl_status strl_container_material(strl_container *container, uint32_t material, char *name, size_t size,
                                    uint32_t *rgba, strl_error *err)
{
    uint8_t head[STRL__MATERIAL_HEAD_BYTES] = {0};
    strl_status status = get_name(container, &container->materials, material, sizeof head, head, name, size, err);
    *rgba = (uint32_t)strl__load_le(head, 4);
    return status;
}
