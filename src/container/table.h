/* Paged tables of byte strings: docs/format.md, "Paged tables". One codec for placements, parts and materials.
 * Internal. */
#ifndef STRL_CONTAINER_TABLE_H
#define STRL_CONTAINER_TABLE_H

#include "container/record.h"
#include "platform/file.h"

/* The end of a file that is being written: pieces are appended at the format's alignment. */
typedef struct strl__sink {
    strl_file *file; /* borrowed */
    uint64_t end;    /* bytes so far */
} strl__sink;

/* *ref: where the piece lies, with its checksum. */
strl_status strl__sink_append(strl__sink *sink, const void *data, uint32_t bytes, strl_treelet_ref *ref,
                              strl_error *err);

/* Builds a table from its items in order. All memory is taken at create: adding never allocates. */
typedef struct strl__page_table_writer strl__page_table_writer;
strl_status strl__page_table_writer_create(strl__page_table_writer **table, strl_error *err);
void strl__page_table_writer_destroy(strl__page_table_writer *table); /* NULL is legal */
uint64_t strl__page_table_writer_count(const strl__page_table_writer *table);
/* Whether the next item will be its page's first if it has so many bytes. */
bool strl__page_table_writer_begins(const strl__page_table_writer *table, uint32_t bytes);
/* The item is head followed by body; together at most STRL__MAX_NAME_BYTES + 6. */
strl_status strl__page_table_writer_add(strl__page_table_writer *table, strl__sink *sink, const void *head,
                                        uint32_t head_bytes, const void *body, uint32_t body_bytes, strl_error *err);
/* The next item will be its page's first. *page: where what is pending was written; at least one item is. */
strl_status strl__page_table_writer_end_page(strl__page_table_writer *table, strl__sink *sink, strl_treelet_ref *page,
                                             strl_error *err);
/* Writes what is pending; section gets depth, count and root. At least one item was added. */
strl_status strl__page_table_writer_finish(strl__page_table_writer *table, strl__sink *sink, strl__section *section,
                                           strl_error *err);

/* Looks items up, keeping one page of each depth. Zero-initialise but for name and section. */
typedef struct strl__page_table_page {
    uint8_t *data; /* owned, STRL__TABLE_PAGE_BYTES */
    strl_treelet_ref ref;
    uint64_t first, end; /* items that the page stands for; end 0: nothing is held */
} strl__page_table_page;

/* A name as it is told by the one before. */
typedef struct strl__name {
    uint64_t item, first; /* of the table; of its page */
    uint32_t bytes;
    uint8_t text[STRL__MAX_NAME_BYTES];
} strl__name;

typedef struct strl__table {
    const char *name; /* "parts"; static */
    strl__section section;
    strl__page_table_page pages[STRL__TABLE_MAX_DEPTH + 1]; /* by depth; 0 = leaf */
    strl__name *last; /* the name that was asked for last, owned; NULL = none yet, or no table of names */
} strl__table;

/* *item is borrowed until the next call; *first: the first item of its page. */
strl_status strl__page_table_get(strl__table *table, strl_source *source, uint64_t index, const uint8_t **item,
                                 uint32_t *bytes, uint64_t *first, strl_error *err);
void strl__page_table_deinit(strl__table *table);

#endif
