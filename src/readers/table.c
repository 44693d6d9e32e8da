#include "readers/table.h"

#include <inttypes.h>
#include <stdio.h>

#include "base/fail.h"
#include "base/memory.h"

void strl__table_place(strl__table *table, const strl__layout *layout, strl_file *file, uint64_t offset, uint64_t count,
                       size_t window_limit)
{
    *table = (strl__table){.layout = *layout, .file = file, .offset = offset, .count = count};
    table->window_limit = window_limit;
    if (file && !strl__table_is_resident(table))
        table->window_limit /= STRL__TABLE_NARROW;
    if (table->window_limit < layout->stride)
        table->window_limit = layout->stride;
}

void strl__table_build(strl__table *table, const strl__layout *layout, const char *scratch_dir, size_t window_limit)
{
    strl__table_place(table, layout, NULL, 0, 0, window_limit);
    table->scratch_dir = scratch_dir;
}

void strl__table_deinit(strl__table *table)
{
    strl_file_close(table->spill, NULL); /* already unlinked: a late write error harms nobody */
    strl__free(table->window);
    *table = (strl__table){0};
}

/* Unlinked at once, so that nothing is left behind even when the process is killed. */
static strl_status create_spill(strl__table *table, strl_error *err)
{
    if (!table->scratch_dir)
        return strl__fail(err, STRL_ERR_ARGUMENT,
                          "the vertices do not fit %zu bytes of memory and no scratch folder was given",
                          table->window_limit);
    char name[40];
    snprintf(name, sizeof name, "reader-%" PRIxPTR ".spill", (uintptr_t)table);
    char *path = strl_path_join(table->scratch_dir, name);
    if (!path)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the path of a spill file");
    strl_status status = strl_file_create(path, &table->spill, err);
    if (!status)
        status = strl_path_remove(path, err);
    strl__free(path);
    table->file = table->spill;
    return status;
}

static strl_status flush(strl__table *table, strl_error *err)
{
    strl_status status = table->spill ? STRL_OK : create_spill(table, err);
    if (!status)
        status = strl_file_write(table->spill, table->window_first * table->layout.stride, table->window,
                                 (size_t)table->window_count * table->layout.stride, err);
    table->window_first += table->window_count;
    table->window_count = 0;
    return status;
}

static strl_status reserve(strl__table *table, size_t bytes, strl_error *err)
{
    if (bytes <= table->window_capacity)
        return STRL_OK;
    size_t wanted = table->window_capacity + table->window_capacity / 2;
    wanted = wanted < bytes ? bytes : wanted;
    wanted = wanted > table->window_limit ? table->window_limit : wanted;
    uint8_t *grown = strl__realloc(table->window, wanted, 1);
    if (!grown)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a window of %zu bytes on the vertices", wanted);
    table->window = grown;
    table->window_capacity = wanted;
    return STRL_OK;
}

strl_status strl__table_append(strl__table *table, const void *record, strl_error *err)
{
    size_t stride = table->layout.stride;
    size_t used = (size_t)table->window_count * stride;
    if (used + stride > table->window_capacity) {
        strl_status status;
        if (used + stride > table->window_limit) {
            status = flush(table, err);
            used = 0;
        } else {
            status = reserve(table, used + stride < 4096 && table->window_limit >= 4096 ? 4096 : used + stride, err);
        }
        if (status)
            return status;
    }
    memcpy(table->window + used, record, stride);
    table->window_count++;
    table->count++;
    return STRL_OK;
}

strl_status strl__table_finish(strl__table *table, strl_error *err)
{
    if (!table->spill)
        return STRL_OK;
    strl_status status = table->window_count ? flush(table, err) : STRL_OK;
    strl__free(table->window);
    table->window = NULL;
    table->window_capacity = 0;
    table->window_first = 0;
    table->window_limit /= STRL__TABLE_NARROW;
    return status;
}

strl_status strl__table_load(strl__table *table, uint64_t first, uint64_t last, strl_error *err)
{
    if (first >= table->window_first && last < table->window_first + table->window_count)
        return STRL_OK;
    if (strl__table_is_resident(table)) {
        first = 0;
        last = table->count - 1;
    }
    size_t bytes = (size_t)(last - first + 1) * table->layout.stride;
    table->window_count = 0;
    strl_status status = reserve(table, bytes, err);
    if (!status)
        status = strl_file_read(table->file, table->offset + first * table->layout.stride, table->window, bytes, err);
    if (!status) {
        table->window_first = first;
        table->window_count = last - first + 1;
    }
    return status;
}
