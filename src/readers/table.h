/* A table of fixed-size records of any length, seen through a window of bounded size. Its records
 * lie where they are in the input file, or are appended one by one: they then stay in memory while
 * they fit, else go to a spill file.
 *
 * Call order: (place | (build -> append* -> finish)) -> (load -> record*)* -> deinit. */
#ifndef STRL_READERS_TABLE_H
#define STRL_READERS_TABLE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "platform/file.h"
#include "readers/record.h"
#include "stroll/error.h"

typedef struct strl__table {
    strl__layout layout;
    strl_file *file;         /* where the records lie; borrowed, or == spill; NULL: all are in the window */
    strl_file *spill;        /* owned */
    const char *scratch_dir; /* borrowed; NULL: no place to spill to */
    uint64_t offset;         /* of the first record in file */
    uint64_t count;          /* records */
    uint8_t *window;         /* owned */
    size_t window_capacity;  /* bytes allocated */
    size_t window_limit;     /* bytes that may be allocated; at least one record */
    uint64_t window_first;   /* record */
    uint64_t window_count;   /* records in the window */
} strl__table;

/* A table that does not fit window_limit is given a quarter of it: sweeping needs no more, and the
 * sort can use the rest. */
#define STRL__TABLE_NARROW 4u

/* The records lie in file, which is borrowed; the caller has checked that they lie inside it. */
void strl__table_place(strl__table *table, const strl__layout *layout, strl_file *file, uint64_t offset, uint64_t count,
                       size_t window_limit);
/* scratch_dir is borrowed for the life of the table. */
void strl__table_build(strl__table *table, const strl__layout *layout, const char *scratch_dir, size_t window_limit);
strl_status strl__table_append(strl__table *table, const void *record, strl_error *err);
strl_status strl__table_finish(strl__table *table, strl_error *err);
void strl__table_deinit(strl__table *table);

/* All records fit the window at once. */
static inline bool strl__table_is_resident(const strl__table *table)
{
    return table->count <= table->window_limit / table->layout.stride;
}

/* Records that fit the window. */
static inline uint64_t strl__table_window_records(const strl__table *table)
{
    return table->window_limit / table->layout.stride;
}

/* The bytes that the window may take from now on. */
static inline size_t strl__table_window_bytes(const strl__table *table)
{
    return strl__table_is_resident(table) ? (size_t)table->count * table->layout.stride : table->window_limit;
}

/* Has records first..last (inclusive, < count, no more than fit) in the window. */
strl_status strl__table_load(strl__table *table, uint64_t first, uint64_t last, strl_error *err);

/* A record that was loaded; valid until the next load. */
static inline const uint8_t *strl__table_record(const strl__table *table, uint64_t index)
{
    return table->window + (size_t)(index - table->window_first) * table->layout.stride;
}

#endif
