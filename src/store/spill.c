#include "store/spill.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "store/spill_internal.h"

#define DEFAULT_BUFFER_BYTES ((size_t)256 << 10)

strl_status strl_spill_set_create(const char *directory, uint64_t limit_bytes, strl_spill_set **set, strl_error *err)
{
    *set = NULL;
    strl_file_info info;
    strl_status status = strl_path_stat(directory, &info, err);
    if (status != STRL_OK)
        return status;
    if (!info.is_directory)
        return strl__fail(err, STRL_ERR_IO, "scratch: expected a folder, found the file %.300s", directory);
    strl_spill_set *made = strl__alloc_zero(1, sizeof *made);
    char *copy = strl__strdup(directory);
    if (!made || !copy) {
        strl__free(copy);
        strl__free(made);
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the scratch folder %.300s", directory);
    }
    made->directory = copy;
    made->limit_bytes = limit_bytes;
    strl_mutex_init(&made->mutex);
    *set = made;
    return STRL_OK;
}

void strl__spill_release(strl_spill *spill)
{
    strl_file_close(spill->file, NULL); /* a late write error concerns bytes nobody will read */
    strl__free(spill->buffer);
    strl__free(spill->dropped);
    strl__free(spill->sums);
    strl__free(spill->tail);
    strl__free(spill->name);
    strl__free(spill);
}

static void release_list(strl_spill *first)
{
    while (first) {
        strl_spill *next = first->next;
        strl__spill_release(first);
        first = next;
    }
}

void strl_spill_set_destroy(strl_spill_set *set)
{
    if (!set)
        return;
    release_list(set->open);
    release_list(set->retired); /* the last save may need their files */
    strl_mutex_deinit(&set->mutex);
    strl__free(set->directory);
    strl__free(set);
}

uint64_t strl_spill_set_bytes(strl_spill_set *set)
{
    strl_mutex_lock(&set->mutex);
    uint64_t bytes = set->bytes;
    strl_mutex_unlock(&set->mutex);
    return bytes;
}

uint64_t strl_spill_set_peak_bytes(strl_spill_set *set)
{
    strl_mutex_lock(&set->mutex);
    uint64_t bytes = set->peak_bytes;
    strl_mutex_unlock(&set->mutex);
    return bytes;
}

/* Before the bytes are written, so that streams of several threads cannot pass the limit together. */
strl_status strl__spill_reserve(strl_spill_set *set, uint64_t size, strl_error *err)
{
    strl_status status = STRL_OK;
    strl_mutex_lock(&set->mutex);
    if (set->limit_bytes && (set->bytes > set->limit_bytes || size > set->limit_bytes - set->bytes))
        status =
            strl__fail(err, STRL_ERR_LIMIT,
                       "scratch in %.300s holds %" PRIu64 " bytes, %" PRIu64 " more would pass its limit of %" PRIu64,
                       set->directory, set->bytes, size, set->limit_bytes);
    else
        set->bytes += size;
    strl_mutex_unlock(&set->mutex);
    return status;
}

void strl__spill_count(strl_spill_set *set, uint64_t size, bool written)
{
    strl_mutex_lock(&set->mutex);
    if (!written)
        set->bytes -= size;
    else if (set->peak_bytes < set->bytes)
        set->peak_bytes = set->bytes;
    strl_mutex_unlock(&set->mutex);
}

static bool is_listed(const strl_spill *list, const char *name)
{
    while (list && strcmp(list->name, name) != 0)
        list = list->next;
    return list != NULL;
}

static bool link_stream(strl_spill_set *set, strl_spill *spill)
{
    strl_mutex_lock(&set->mutex);
    bool same = is_listed(set->open, spill->name) || is_listed(set->retired, spill->name);
    if (!same) {
        spill->next = set->open;
        set->open = spill;
    }
    strl_mutex_unlock(&set->mutex);
    return !same;
}

void strl__spill_unlink(strl_spill_set *set, const strl_spill *spill)
{
    strl_mutex_lock(&set->mutex);
    strl_spill **at = &set->open;
    while (*at != spill)
        at = &(*at)->next;
    *at = spill->next;
    strl_mutex_unlock(&set->mutex);
}

/* A linked stream without a file yet; its name is taken from then on. */
strl_status strl__spill_new(strl_spill_set *set, const char *name, strl_spill **spill, strl_error *err)
{
    if (!*name || strchr(name, '/') || name[0] == '.' || strlen(name) > STRL__SPILL_NAME_BYTES)
        return strl__fail(err, STRL_ERR_ARGUMENT, "\"%.300s\" is no name for a scratch file", name);
    strl_spill *made = strl__alloc_zero(1, sizeof *made);
    char *copy = strl__strdup(name);
    strl_status status = STRL_OK;
    if (!made || !copy) {
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for the scratch file %.300s", name);
    } else {
        made->set = set;
        made->name = copy;
        if (!link_stream(set, made))
            status = strl__fail(err, STRL_ERR_ARGUMENT, "the scratch file %.300s is open already", name);
    }
    if (status != STRL_OK) {
        strl__free(copy);
        strl__free(made);
        return status;
    }
    *spill = made;
    return STRL_OK;
}

strl_status strl__spill_with_path(strl_spill *spill,
                                  strl_status (*call)(strl_spill *spill, const char *path, strl_error *err),
                                  strl_error *err)
{
    char file[STRL__SPILL_NAME_BYTES + sizeof STRL_SPILL_SUFFIX];
    snprintf(file, sizeof file, "%s" STRL_SPILL_SUFFIX, spill->name);
    char *path = strl_path_join(spill->set->directory, file);
    strl_status status = path ? call(spill, path, err)
                              : strl__fail(err, STRL_ERR_MEMORY, "no memory for the scratch file %.300s", spill->name);
    strl__free(path);
    return status;
}

static strl_status create_file(strl_spill *spill, const char *path, strl_error *err)
{
    return strl_file_create(path, &spill->file, err);
}

static strl_status open_stream(strl_spill_set *set, const char *name, size_t buffer_bytes, bool kept,
                               strl_spill **spill, strl_error *err)
{
    *spill = NULL;
    strl_spill *made = NULL;
    strl_status status = strl__spill_new(set, name, &made, err);
    if (status != STRL_OK)
        return status;
    made->kept = kept;
    made->buffer_bytes = buffer_bytes ? buffer_bytes : DEFAULT_BUFFER_BYTES;
    status = strl__spill_with_path(made, create_file, err);
    if (status != STRL_OK) {
        strl__spill_unlink(set, made);
        strl__spill_release(made);
        return status;
    }
    *spill = made;
    return STRL_OK;
}

strl_status strl_spill_open(strl_spill_set *set, const char *name, size_t buffer_bytes, strl_spill **spill,
                            strl_error *err)
{
    return open_stream(set, name, buffer_bytes, false, spill, err);
}

strl_status strl_spill_open_kept(strl_spill_set *set, const char *name, size_t buffer_bytes, strl_spill **spill,
                                 strl_error *err)
{
    return open_stream(set, name, buffer_bytes, true, spill, err);
}

static strl_status write_at_end(strl_spill *spill, const void *data, size_t size, strl_error *err)
{
    uint64_t end = atomic_load(&spill->flushed);
    if (spill->kept && !strl__spill_reach_sums(spill, end + size))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the checksums of the scratch file %.300s", spill->name);
    strl_status status = strl__spill_reserve(spill->set, size, err);
    if (status != STRL_OK)
        return status;
    status = strl_file_write(spill->file, end, data, size, err);
    strl__spill_count(spill->set, size, status == STRL_OK);
    if (status == STRL_OK && spill->kept)
        strl__spill_add_sums(spill, data, size);
    if (status == STRL_OK)
        atomic_store(&spill->flushed, end + size);
    return status;
}

static strl_status write_buffer(strl_spill *spill, strl_error *err)
{
    if (spill->buffered == 0)
        return STRL_OK;
    strl_status status = write_at_end(spill, spill->buffer, spill->buffered, err);
    if (status == STRL_OK)
        spill->buffered = 0;
    return status;
}

strl_status strl_spill_append(strl_spill *spill, const void *data, size_t size, strl_error *err)
{
    if (size == 0)
        return STRL_OK;
    if (size > spill->buffer_bytes - spill->buffered) {
        strl_status status = write_buffer(spill, err);
        if (status != STRL_OK)
            return status;
        if (size >= spill->buffer_bytes)
            return write_at_end(spill, data, size, err);
    }
    if (!spill->buffer && !(spill->buffer = strl__alloc(spill->buffer_bytes, 1)))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu bytes of buffer before the scratch file %.300s",
                          spill->buffer_bytes, spill->name);
    memcpy(spill->buffer + spill->buffered, data, size);
    spill->buffered += size;
    return STRL_OK;
}

strl_status strl_spill_flush(strl_spill *spill, strl_error *err)
{
    strl_status status = write_buffer(spill, err);
    if (status == STRL_OK) {
        strl__free(spill->buffer);
        spill->buffer = NULL;
    }
    return status;
}

uint64_t strl_spill_bytes(const strl_spill *spill)
{
    return atomic_load(&spill->flushed) + spill->buffered;
}

/* Whether one of the bytes has been given back. */
static bool is_gone(strl_spill *spill, uint64_t offset, size_t size)
{
    bool gone = false;
    strl_mutex_lock(&spill->set->mutex);
    for (uint64_t step = offset / STRL__SPILL_STEP; size > 0 && step <= (offset + size - 1) / STRL__SPILL_STEP; step++)
        gone |= step < spill->dropped_capacity && spill->dropped[step] >= STRL__SPILL_STEP;
    strl_mutex_unlock(&spill->set->mutex);
    return gone;
}

strl_status strl_spill_read(strl_spill *spill, uint64_t offset, void *data, size_t size, strl_error *err)
{
    uint64_t end = atomic_load(&spill->flushed);
    if (offset > end || size > end - offset)
        return strl__fail(err, STRL_ERR_ARGUMENT,
                          "read of %zu bytes at byte %" PRIu64 " of the scratch file %.200s, which has %" PRIu64, size,
                          offset, spill->name, end);
    if (is_gone(spill, offset, size))
        return strl__fail(err, STRL_ERR_ARGUMENT,
                          "read of %zu bytes at byte %" PRIu64 " of the scratch file %.200s, which were dropped", size,
                          offset, spill->name);
    return strl_file_read(spill->file, offset, data, size, err);
}

void strl__spill_punch(strl_spill *spill, uint64_t step)
{
    spill->dropped[step] = STRL__SPILL_GONE;
    if (strl_file_punch(spill->file, step * STRL__SPILL_STEP, STRL__SPILL_STEP)) {
        spill->given_back += STRL__SPILL_STEP;
        spill->set->bytes -= STRL__SPILL_STEP;
    }
}

/* Zeros up to `steps` items of the table. Without memory nothing more is given back, which costs disk alone. */
bool strl__spill_reach_step(strl_spill *spill, uint64_t steps)
{
    size_t before = spill->dropped_capacity;
    if (steps <= before)
        return true;
    void *table = spill->dropped;
    if (steps > SIZE_MAX || !strl__grow(&table, &spill->dropped_capacity, (size_t)steps, sizeof *spill->dropped))
        return false;
    spill->dropped = table;
    memset(spill->dropped + before, 0, (spill->dropped_capacity - before) * sizeof *spill->dropped);
    return true;
}

void strl_spill_drop(strl_spill *spill, uint64_t offset, uint64_t size)
{
    strl_mutex_lock(&spill->set->mutex);
    bool good = size > 0 && strl__spill_reach_step(spill, (offset + size - 1) / STRL__SPILL_STEP + 1);
    while (good && size > 0) {
        uint64_t step = offset / STRL__SPILL_STEP, here = STRL__SPILL_STEP - offset % STRL__SPILL_STEP;
        here = here < size ? here : size;
        spill->dropped[step] = (uint16_t)(spill->dropped[step] + here);
        if (spill->dropped[step] == STRL__SPILL_STEP) {
            if (spill->kept)
                strl__spill_postpone(spill, step);
            else
                strl__spill_punch(spill, step);
        }
        offset += here;
        size -= here;
    }
    strl_mutex_unlock(&spill->set->mutex);
}

static strl_status remove_file(strl_spill *spill, const char *path, strl_error *err)
{
    (void)spill;
    return strl_path_remove(path, err);
}

strl_status strl__spill_delete(strl_spill *spill, strl_error *err)
{
    strl_spill_set *set = spill->set;
    strl_status status = strl__spill_with_path(spill, remove_file, err);
    if (status == STRL_OK)
        strl__spill_count(set, atomic_load(&spill->flushed) - spill->given_back, false);
    strl__spill_release(spill);
    return status;
}

strl_status strl_spill_close_and_delete(strl_spill *spill, strl_error *err)
{
    if (!spill)
        return STRL_OK;
    strl_spill_set *set = spill->set;
    strl__spill_unlink(set, spill);
    if (!spill->kept)
        return strl__spill_delete(spill, err);
    strl_mutex_lock(&set->mutex);
    spill->next = set->retired;
    set->retired = spill;
    strl_mutex_unlock(&set->mutex);
    return STRL_OK;
}

void strl_spill_close(strl_spill *spill)
{
    if (spill && spill->kept) {
        strl__spill_unlink(spill->set, spill);
        strl__spill_release(spill);
    } else {
        strl_spill_close_and_delete(spill, NULL);
    }
}
