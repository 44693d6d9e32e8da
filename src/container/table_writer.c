/* Writing paged tables, bottom-up: a page of each depth is in memory; a full one is written and named in the one above.
 */
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "container/table.h"

#define LEVELS (STRL__TABLE_MAX_DEPTH + 1)

/* References to pages of depth `level`, waiting to become an index page of depth level + 1. */
typedef struct ref_list {
    uint8_t refs[STRL__TABLE_MAX_REFS * STRL__TABLE_REF_BYTES];
    uint32_t count;
    uint64_t first_item; /* of the first reference */
} ref_list;

struct strl__page_table_writer {
    uint64_t item_count;
    uint64_t leaf_first; /* number of the pending leaf's first item */
    uint32_t leaf_count; /* items of the pending leaf */
    uint32_t leaf_bytes; /* bytes of these items */
    uint8_t ends[STRL__TABLE_PAGE_BYTES];
    uint8_t items[STRL__TABLE_PAGE_BYTES];
    uint8_t page[STRL__TABLE_PAGE_BYTES];
    ref_list lists[LEVELS];
};

strl_status strl__sink_append(strl__sink *sink, const void *data, uint32_t bytes, strl_treelet_ref *ref,
                              strl_error *err)
{
    /* The gap up to the alignment is never written: a file's holes read as zeros. */
    uint64_t offset = (sink->end + STRL__ALIGNMENT - 1) / STRL__ALIGNMENT * STRL__ALIGNMENT;
    strl_status status = strl_file_write(sink->file, offset, data, bytes, err);
    if (status != STRL_OK)
        return status;
    sink->end = offset + bytes;
    *ref = (strl_treelet_ref){offset, bytes, strl__checksum(data, bytes)};
    return STRL_OK;
}

strl_status strl__page_table_writer_create(strl__page_table_writer **table, strl_error *err)
{
    *table = strl__alloc_zero(1, sizeof **table);
    return *table
               ? STRL_OK
               : strl__fail(err, STRL_ERR_MEMORY, "no memory for a table of the container (%zu bytes)", sizeof **table);
}

void strl__page_table_writer_destroy(strl__page_table_writer *table)
{
    strl__free(table);
}
uint64_t strl__page_table_writer_count(const strl__page_table_writer *table)
{
    return table->item_count;
}

static strl_status add_ref(strl__page_table_writer *table, strl__sink *sink, unsigned level,
                           const strl_treelet_ref *ref, uint64_t first_item, strl_error *err);

/* Turns the pending references of `level` into one index page. */
static strl_status flush_list(strl__page_table_writer *table, strl__sink *sink, unsigned level, strl_error *err)
{
    ref_list *list = &table->lists[level];
    uint32_t bytes = list->count * STRL__TABLE_REF_BYTES;
    strl__store_le(table->page, 4, list->count);
    strl__store_le(table->page + 4, 4, 0);
    memcpy(table->page + STRL__INDEX_HEAD_BYTES, list->refs, bytes);
    strl_treelet_ref ref;
    strl_status status = strl__sink_append(sink, table->page, STRL__INDEX_HEAD_BYTES + bytes, &ref, err);
    if (status != STRL_OK)
        return status;
    uint64_t first_item = list->first_item;
    list->count = 0;
    return add_ref(table, sink, level + 1, &ref, first_item, err);
}

static strl_status add_ref(strl__page_table_writer *table, strl__sink *sink, unsigned level,
                           const strl_treelet_ref *ref, uint64_t first_item, strl_error *err)
{
    ref_list *list = &table->lists[level];
    if (level == LEVELS - 1 && list->count)
        return strl__fail(err, STRL_ERR_LIMIT, "a table of the container would need more than %u levels of pages",
                          LEVELS);
    if (list->count == STRL__TABLE_MAX_REFS) {
        strl_status status = flush_list(table, sink, level, err);
        if (status != STRL_OK)
            return status;
    }
    if (list->count == 0)
        list->first_item = first_item;
    uint8_t *bytes = list->refs + list->count++ * STRL__TABLE_REF_BYTES;
    strl__store_le(bytes, 8, ref->offset);
    strl__store_le(bytes + 8, 8, first_item);
    strl__store_le(bytes + 16, 8, ref->checksum);
    strl__store_le(bytes + 24, 4, ref->bytes);
    strl__store_le(bytes + 28, 4, 0);
    return STRL_OK;
}

strl_status strl__page_table_writer_end_page(strl__page_table_writer *table, strl__sink *sink, strl_treelet_ref *page,
                                             strl_error *err)
{
    uint32_t ends = table->leaf_count * 4;
    strl__store_le(table->page, 4, table->leaf_count);
    memcpy(table->page + 4, table->ends, ends);
    memcpy(table->page + 4 + ends, table->items, table->leaf_bytes);
    strl_status status = strl__sink_append(sink, table->page, 4 + ends + table->leaf_bytes, page, err);
    if (status == STRL_OK)
        status = add_ref(table, sink, 0, page, table->leaf_first, err);
    if (status != STRL_OK)
        return status;
    table->leaf_first += table->leaf_count;
    table->leaf_count = table->leaf_bytes = 0;
    return STRL_OK;
}

static strl_status flush_leaf(strl__page_table_writer *table, strl__sink *sink, strl_error *err)
{
    strl_treelet_ref page;
    return strl__page_table_writer_end_page(table, sink, &page, err);
}

bool strl__page_table_writer_begins(const strl__page_table_writer *table, uint32_t bytes)
{
    uint64_t used = 4 + 4 * ((uint64_t)table->leaf_count + 1) + table->leaf_bytes;
    return table->leaf_count == 0 || used + bytes > STRL__TABLE_PAGE_BYTES;
}

strl_status strl__page_table_writer_add(strl__page_table_writer *table, strl__sink *sink, const void *head,
                                        uint32_t head_bytes, const void *body, uint32_t body_bytes, strl_error *err)
{
    if (table->leaf_count && strl__page_table_writer_begins(table, head_bytes + body_bytes)) {
        strl_status status = flush_leaf(table, sink, err);
        if (status != STRL_OK)
            return status;
    }
    uint8_t *item = table->items + table->leaf_bytes;
    if (head_bytes)
        memcpy(item, head, head_bytes);
    if (body_bytes)
        memcpy(item + head_bytes, body, body_bytes);
    table->leaf_bytes += head_bytes + body_bytes;
    strl__store_le(table->ends + 4 * table->leaf_count++, 4, table->leaf_bytes);
    table->item_count++;
    return STRL_OK;
}

static void read_only_ref(const ref_list *list, strl_treelet_ref *ref)
{
    ref->offset = strl__load_le(list->refs, 8);
    ref->checksum = strl__load_le(list->refs + 16, 8);
    ref->bytes = (uint32_t)strl__load_le(list->refs + 24, 4);
}

strl_status strl__page_table_writer_finish(strl__page_table_writer *table, strl__sink *sink, strl__section *section,
                                           strl_error *err)
{
    strl_status status = table->leaf_count ? flush_leaf(table, sink, err) : STRL_OK;
    for (unsigned level = 0; status == STRL_OK && level < LEVELS; level++) {
        bool above = false;
        for (unsigned higher = level + 1; higher < LEVELS; higher++)
            above |= table->lists[higher].count != 0;
        if (!above && table->lists[level].count == 1) {
            section->depth = level;
            section->item_count = table->item_count;
            read_only_ref(&table->lists[level], &section->ref);
            return STRL_OK;
        }
        if (table->lists[level].count)
            status = flush_list(table, sink, level, err);
    }
    return status != STRL_OK ? status : strl__fail(err, STRL_ERR_INTERNAL, "a table of the container has no item");
}
