/* Reading paged tables: from the root page down to the leaf that holds the item. */
#include "container/table.h"

#include <inttypes.h>

#include "base/fail.h"
#include "base/hash.h"

static strl_status page_fault(const strl__table *table, const strl__page_table_page *page, const char *what,
                              strl_error *err)
{
    return strl__fail(err, STRL_ERR_FORMAT,
                      "table of %s, page at byte %" PRIu64 " of %" PRIu32 " bytes for items %" PRIu64 " to %" PRIu64
                      ": %s",
                      table->name, page->ref.offset, page->ref.bytes, page->first, page->end - 1, what);
}

static strl_status check_leaf(const strl__table *table, const strl__page_table_page *page, strl_error *err)
{
    uint64_t count = page->ref.bytes >= 4 ? strl__load_le(page->data, 4) : 0, head = 4 + 4 * count;
    if (count != page->end - page->first || head > page->ref.bytes)
        return page_fault(table, page, "it does not hold that number of items", err);
    uint64_t last = 0;
    for (uint64_t i = 0; i < count; i++) {
        uint64_t end = strl__load_le(page->data + 4 + 4 * i, 4);
        if (end < last)
            return page_fault(table, page, "the ends of its items are out of order", err);
        last = end;
    }
    if (head + last != page->ref.bytes)
        return page_fault(table, page, "its last item does not end where the page ends", err);
    return STRL_OK;
}

static uint64_t first_item_of(const strl__page_table_page *page, uint64_t ref)
{
    return strl__load_le(page->data + STRL__INDEX_HEAD_BYTES + ref * STRL__TABLE_REF_BYTES + 8, 8);
}

static strl_status check_index(const strl__table *table, const strl__page_table_page *page, strl_error *err)
{
    uint64_t count =
        page->ref.bytes >= STRL__INDEX_HEAD_BYTES ? strl__load_le(page->data, 8) : 0; /* with the reserved field */
    if (count < 1 || count > STRL__TABLE_MAX_REFS ||
        STRL__INDEX_HEAD_BYTES + count * STRL__TABLE_REF_BYTES != page->ref.bytes)
        return page_fault(table, page, "its number of references does not fit", err);
    for (uint64_t i = 0; i < count; i++) {
        uint64_t first = first_item_of(page, i);
        if (i == 0 ? first != page->first : first <= first_item_of(page, i - 1) || first >= page->end)
            return page_fault(table, page, "the first items of its references are out of order", err);
    }
    return STRL_OK;
}

/* Makes *page hold what ref names and checks it. */
static strl_status load(strl__table *table, unsigned depth, strl_source *source, const strl_treelet_ref *ref,
                        uint64_t first, uint64_t end, strl_error *err)
{
    strl__page_table_page *page = &table->pages[depth];
    if (page->end == end && page->first == first && page->ref.offset == ref->offset && page->ref.bytes == ref->bytes &&
        page->ref.checksum == ref->checksum)
        return STRL_OK;
    page->end = 0;
    if (ref->bytes > STRL__TABLE_PAGE_BYTES)
        return strl__fail(err, STRL_ERR_FORMAT, "table of %s: a page of %" PRIu32 " bytes, expected at most %u",
                          table->name, ref->bytes, STRL__TABLE_PAGE_BYTES);
    strl_status status = strl__ref_check(ref, source->bytes, table->name, err);
    if (status != STRL_OK)
        return status;
    if (!page->data)
        page->data = strl__alloc(STRL__TABLE_PAGE_BYTES, 1);
    if (!page->data)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a page of the table of %s", table->name);
    const strl_source_span span = {ref->offset, ref->bytes, page->data, ref->checksum};
    status = strl_source_read_known(source, &span, err);
    if (status != STRL_OK)
        return status;
    strl__page_table_page candidate = {page->data, *ref, first, end};
    if (strl__checksum(page->data, ref->bytes) != ref->checksum) {
        strl_source_doubt(source, ref->offset, ref->bytes);
        return page_fault(table, &candidate, "its checksum is not the expected one", err);
    }
    status = depth ? check_index(table, &candidate, err) : check_leaf(table, &candidate, err);
    if (status == STRL_OK)
        *page = candidate;
    return status;
}

/* The reference of an index page that leads to item `index`; narrows [*first, *end) to what lies below it. */
static void descend(const strl__page_table_page *page, uint64_t index, strl_treelet_ref *ref, uint64_t *first,
                    uint64_t *end)
{
    uint64_t low = 0, high = strl__load_le(page->data, 4);
    while (high - low > 1) {
        uint64_t middle = (low + high) / 2;
        if (first_item_of(page, middle) <= index)
            low = middle;
        else
            high = middle;
    }
    if (high < strl__load_le(page->data, 4))
        *end = first_item_of(page, high);
    *first = first_item_of(page, low);
    const uint8_t *bytes = page->data + STRL__INDEX_HEAD_BYTES + low * STRL__TABLE_REF_BYTES;
    ref->offset = strl__load_le(bytes, 8);
    ref->checksum = strl__load_le(bytes + 16, 8);
    ref->bytes = (uint32_t)strl__load_le(bytes + 24, 4);
}

strl_status strl__page_table_get(strl__table *table, strl_source *source, uint64_t index, const uint8_t **item,
                                 uint32_t *bytes, uint64_t *page_first, strl_error *err)
{
    *item = NULL;
    *bytes = 0;
    *page_first = 0;
    uint64_t first = 0, end = table->section.item_count;
    if (index >= end)
        return strl__fail(err, STRL_ERR_ARGUMENT, "there is no item %" PRIu64 " in the table of %" PRIu64 " %s", index,
                          end, table->name);
    strl_treelet_ref ref = table->section.ref;
    for (unsigned depth = table->section.depth; depth > 0; depth--) {
        strl_status status = load(table, depth, source, &ref, first, end, err);
        if (status != STRL_OK)
            return status;
        descend(&table->pages[depth], index, &ref, &first, &end);
    }
    strl_status status = load(table, 0, source, &ref, first, end, err);
    if (status != STRL_OK)
        return status;
    const uint8_t *ends = table->pages[0].data + 4;
    uint64_t within = index - first;
    uint32_t start = within ? (uint32_t)strl__load_le(ends + 4 * (within - 1), 4) : 0;
    *bytes = (uint32_t)strl__load_le(ends + 4 * within, 4) - start;
    *item = ends + 4 * (end - first) + start;
    *page_first = first;
    return STRL_OK;
}

void strl__page_table_deinit(strl__table *table)
{
    for (unsigned depth = 0; depth <= STRL__TABLE_MAX_DEPTH; depth++)
        strl__free(table->pages[depth].data);
    strl__free(table->last);
}
