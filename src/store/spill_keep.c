/* Kept streams: saved by one run, restored and checked by the next. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"
#include "store/spill_internal.h"

#define CHECK_STEPS 256u /* read at once: 4 MiB */
#define RESTORED_BUFFER_BYTES ((size_t)256 << 10)

/* ---- checksums ---- */

bool strl__spill_reach_sums(strl_spill *spill, uint64_t bytes)
{
    void *sums = spill->sums;
    if (bytes / STRL__SPILL_STEP >= SIZE_MAX ||
        !strl__grow(&sums, &spill->sum_capacity, (size_t)(bytes / STRL__SPILL_STEP) + 1, sizeof *spill->sums))
        return false;
    spill->sums = sums;
    if (!spill->tail)
        spill->tail = strl__alloc(STRL__SPILL_STEP, 1);
    return spill->tail != NULL;
}

void strl__spill_add_sums(strl_spill *spill, const void *data, size_t size)
{
    const uint8_t *bytes = data;
    while (size > 0) {
        size_t here = STRL__SPILL_STEP - spill->tail_bytes;
        here = here < size ? here : size;
        if (here == STRL__SPILL_STEP) {
            spill->sums[spill->sum_count++] = strl__checksum(bytes, here);
        } else {
            memcpy(spill->tail + spill->tail_bytes, bytes, here);
            spill->tail_bytes += here;
            if (spill->tail_bytes == STRL__SPILL_STEP) {
                spill->sums[spill->sum_count++] = strl__checksum(spill->tail, STRL__SPILL_STEP);
                spill->tail_bytes = 0;
            }
        }
        bytes += here;
        size -= here;
    }
}

static uint64_t step_count(uint64_t bytes)
{
    return bytes / STRL__SPILL_STEP + (bytes % STRL__SPILL_STEP != 0);
}

/* ---- saving ---- */

void strl__spill_postpone(strl_spill *spill, uint64_t step)
{
    bool none = spill->postponed_first == spill->postponed_end;
    if (none || step < spill->postponed_first)
        spill->postponed_first = (size_t)step;
    if (none || step >= spill->postponed_end)
        spill->postponed_end = (size_t)step + 1;
}

static uint16_t dropped_of(const strl_spill *spill, uint64_t step)
{
    uint16_t dropped = step < spill->dropped_capacity ? spill->dropped[step] : 0;
    return dropped < STRL__SPILL_STEP ? dropped : (uint16_t)STRL__SPILL_STEP;
}

/* Name, bytes, then for each step the bytes of it that were dropped and, where they are not all, its checksum. */
static void save_stream(const strl_spill *spill, strl_writer *writer)
{
    size_t length = strlen(spill->name);
    uint64_t bytes = atomic_load(&spill->flushed);
    strl_writer_u8(writer, (uint8_t)length);
    strl_writer_bytes(writer, spill->name, length);
    strl_writer_u64(writer, bytes);
    for (uint64_t step = 0; step < step_count(bytes); step++) {
        uint16_t dropped = dropped_of(spill, step);
        strl_writer_u16(writer, dropped);
        if (dropped < STRL__SPILL_STEP)
            strl_writer_u64(writer, step < spill->sum_count ? spill->sums[step]
                                                            : strl__checksum(spill->tail, spill->tail_bytes));
    }
}

strl_status strl_spill_set_save(strl_spill_set *set, strl_writer *writer, strl_error *err)
{
    uint32_t count = 0;
    strl_status status = STRL_OK;
    /* only the calling thread changes the list, and flushing takes the mutex */
    for (strl_spill *spill = set->open; spill && status == STRL_OK; spill = spill->next)
        if (spill->kept) {
            status = strl_spill_flush(spill, err);
            count++;
        }
    if (status != STRL_OK)
        return status;
    strl_writer_u64(writer, strl_spill_set_peak_bytes(set));
    strl_writer_u32(writer, count);
    strl_mutex_lock(&set->mutex);
    for (const strl_spill *spill = set->open; spill; spill = spill->next)
        if (spill->kept)
            save_stream(spill, writer);
    strl_mutex_unlock(&set->mutex);
    return writer->failed ? strl__fail(err, STRL_ERR_MEMORY, "no memory to save what is in the scratch folder %.300s",
                                       set->directory)
                          : STRL_OK;
}

static void give_back(strl_spill *spill)
{
    for (size_t step = spill->postponed_first; step < spill->postponed_end; step++)
        if (spill->dropped[step] == STRL__SPILL_STEP)
            strl__spill_punch(spill, step);
    spill->postponed_first = spill->postponed_end = 0;
}

void strl_spill_set_settle(strl_spill_set *set)
{
    strl_mutex_lock(&set->mutex);
    strl_spill *retired = set->retired;
    set->retired = NULL;
    for (strl_spill *spill = set->open; spill; spill = spill->next)
        if (spill->kept)
            give_back(spill);
    strl_mutex_unlock(&set->mutex);
    while (retired) {
        strl_spill *next = retired->next;
        strl__spill_delete(retired, NULL); /* a file that stays costs disk until the build ends */
        retired = next;
    }
}

/* ---- restoring ---- */

static strl_status fail_damaged(strl_error *err)
{
    return strl__fail(err, STRL_ERR_FORMAT, "the list of scratch files of the earlier run is damaged");
}

static strl_status reopen(strl_spill *spill, const char *path, strl_error *err)
{
    return strl_file_reopen(path, atomic_load(&spill->flushed), &spill->file, err);
}

/* The last checksum may be that of a part of a step: it lies behind those that count. */
static strl_status read_steps(strl_spill *spill, strl_cursor *saved, strl_error *err)
{
    uint64_t bytes = atomic_load(&spill->flushed), steps = step_count(bytes);
    if (steps > strl_cursor_left(saved) / 2) /* a step takes two bytes at least */
        return fail_damaged(err);
    if (!strl__spill_reach_sums(spill, bytes) || !strl__spill_reach_step(spill, steps + 1))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the checksums of the scratch file %.300s", spill->name);
    for (uint64_t step = 0; step < steps; step++) {
        uint16_t dropped = strl_cursor_u16(saved);
        bool whole = bytes - step * STRL__SPILL_STEP >= STRL__SPILL_STEP;
        if (dropped > (whole ? STRL__SPILL_STEP : bytes % STRL__SPILL_STEP))
            return fail_damaged(err);
        spill->dropped[step] = dropped;
        spill->sums[step] = dropped < STRL__SPILL_STEP ? strl_cursor_u64(saved) : 0;
    }
    spill->sum_count = (size_t)(bytes / STRL__SPILL_STEP);
    return saved->failed ? fail_damaged(err) : STRL_OK;
}

/* The bytes after the last whole step, to which more may be appended. */
static strl_status load_tail(strl_spill *spill, strl_error *err)
{
    uint64_t bytes = atomic_load(&spill->flushed);
    spill->tail_bytes = (size_t)(bytes % STRL__SPILL_STEP);
    return strl_file_read(spill->file, bytes - spill->tail_bytes, spill->tail, spill->tail_bytes, err);
}

static strl_status restore_file(strl_spill *spill, strl_error *err)
{
    uint64_t bytes = atomic_load(&spill->flushed), gone = 0;
    strl_status status = strl__spill_with_path(spill, reopen, err);
    for (uint64_t step = 0; step < spill->sum_count && status == STRL_OK; step++)
        if (spill->dropped[step] == STRL__SPILL_STEP) { /* the earlier run may have ended before it gave them back */
            spill->dropped[step] = STRL__SPILL_GONE;
            gone += strl_file_punch(spill->file, step * STRL__SPILL_STEP, STRL__SPILL_STEP) ? STRL__SPILL_STEP : 0;
        }
    spill->given_back = gone;
    if (status == STRL_OK)
        status = strl__spill_reserve(spill->set, bytes - gone, err);
    if (status == STRL_OK) {
        strl__spill_count(spill->set, bytes - gone, true);
        status = load_tail(spill, err);
    }
    return status;
}

static strl_status restore_stream(strl_spill_set *set, strl_cursor *saved, strl_error *err)
{
    char name[256] = "";
    uint8_t length = strl_cursor_u8(saved);
    const uint8_t *text = strl_cursor_take(saved, length);
    uint64_t bytes = strl_cursor_u64(saved);
    if (saved->failed || memchr(text, 0, length))
        return fail_damaged(err);
    memcpy(name, text, length);
    strl_spill *spill = NULL;
    strl_status status = strl__spill_new(set, name, &spill, err);
    if (status != STRL_OK)
        return status;
    spill->kept = spill->waits = true;
    spill->buffer_bytes = RESTORED_BUFFER_BYTES;
    atomic_store(&spill->flushed, bytes);
    status = read_steps(spill, saved, err);
    if (status == STRL_OK)
        status = restore_file(spill, err);
    if (status != STRL_OK) {
        strl__spill_unlink(set, spill);
        strl__spill_release(spill);
    }
    return status;
}

strl_status strl_spill_set_restore(strl_spill_set *set, strl_cursor *saved, strl_error *err)
{
    uint64_t peak_bytes = strl_cursor_u64(saved);
    uint32_t count = strl_cursor_u32(saved);
    strl_status status = saved->failed ? fail_damaged(err) : STRL_OK;
    for (uint32_t i = 0; i < count && status == STRL_OK; i++)
        status = restore_stream(set, saved, err);
    strl_mutex_lock(&set->mutex);
    set->peak_bytes = set->peak_bytes < peak_bytes ? peak_bytes : set->peak_bytes;
    strl_mutex_unlock(&set->mutex);
    return status;
}

/* ---- checking ---- */

typedef struct checking {
    uint8_t *bytes; /* [CHECK_STEPS] steps */
    uint64_t done, total;
    strl_status (*report)(void *context, uint64_t done, uint64_t total, strl_error *err);
    void *context;
} checking;

static strl_status compare_step(const strl_spill *spill, uint64_t step, const uint8_t *bytes, size_t size,
                                strl_error *err)
{
    uint64_t found = strl__checksum(bytes, size);
    if (spill->dropped[step] >= STRL__SPILL_STEP || found == spill->sums[step])
        return STRL_OK;
    return strl__fail(err, STRL_ERR_FORMAT,
                      "the scratch file %.250s is damaged: expected the checksum %016" PRIx64 " of bytes %" PRIu64
                      " to %" PRIu64 ", found %016" PRIx64,
                      strl_file_path(spill->file), spill->sums[step], step * STRL__SPILL_STEP,
                      step * STRL__SPILL_STEP + size - 1, found);
}

static bool all_gone(const strl_spill *spill, uint64_t step, uint64_t count)
{
    while (count > 0 && spill->dropped[step + count - 1] >= STRL__SPILL_STEP)
        count--;
    return count == 0;
}

static strl_status check_stream(strl_spill *spill, checking *check, strl_error *err)
{
    uint64_t bytes = atomic_load(&spill->flushed), steps = step_count(bytes);
    strl_status status = STRL_OK;
    for (uint64_t first = 0; first < steps && status == STRL_OK; first += CHECK_STEPS) {
        uint64_t at = first * STRL__SPILL_STEP, count = steps - first < CHECK_STEPS ? steps - first : CHECK_STEPS;
        size_t size = (size_t)(bytes - at < count * STRL__SPILL_STEP ? bytes - at : count * STRL__SPILL_STEP);
        bool needed = !all_gone(spill, first, count);
        if (needed)
            status = strl_file_read(spill->file, at, check->bytes, size, err);
        for (uint64_t i = 0; i < count && needed && status == STRL_OK; i++) {
            size_t offset = (size_t)(i * STRL__SPILL_STEP), left = size - offset;
            status = compare_step(spill, first + i, check->bytes + offset,
                                  left < STRL__SPILL_STEP ? left : STRL__SPILL_STEP, err);
        }
        check->done += size;
        if (status == STRL_OK && check->report)
            status = check->report(check->context, check->done, check->total, err);
    }
    return status;
}

strl_status strl_spill_set_check(strl_spill_set *set,
                                 strl_status (*report)(void *context, uint64_t done, uint64_t total, strl_error *err),
                                 void *context, strl_error *err)
{
    checking check = {.report = report, .context = context};
    strl_status status = STRL_OK;
    check.bytes = strl__alloc(CHECK_STEPS, STRL__SPILL_STEP);
    if (!check.bytes)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to check the scratch folder %.300s", set->directory);
    for (const strl_spill *spill = set->open; spill; spill = spill->next)
        check.total += spill->waits ? atomic_load(&spill->flushed) : 0;
    for (strl_spill *spill = set->open; spill && status == STRL_OK; spill = spill->next)
        if (spill->waits)
            status = check_stream(spill, &check, err);
    strl__free(check.bytes);
    return status;
}

strl_status strl_spill_take(strl_spill_set *set, const char *name, strl_spill **spill, strl_error *err)
{
    strl_spill *found = set->open;
    while (found && (!found->waits || strcmp(found->name, name) != 0))
        found = found->next;
    *spill = found;
    if (!found)
        return strl__fail(err, STRL_ERR_FORMAT, "the earlier run did not save the scratch file %.200s in %.200s", name,
                          set->directory);
    found->waits = false;
    return STRL_OK;
}

bool strl_spill_set_uses(strl_spill_set *set, const char *file)
{
    size_t suffix = sizeof STRL_SPILL_SUFFIX - 1, length = strlen(file);
    if (length <= suffix || strcmp(file + length - suffix, STRL_SPILL_SUFFIX) != 0)
        return false;
    strl_mutex_lock(&set->mutex);
    const strl_spill *spill = set->open;
    while (spill && (strlen(spill->name) != length - suffix || strncmp(spill->name, file, length - suffix) != 0))
        spill = spill->next;
    strl_mutex_unlock(&set->mutex);
    return spill != NULL;
}
