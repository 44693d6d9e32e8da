#include "geometry/sample_payload.h"

#include <math.h>

#include "base/fail.h"

#define SPLAT_BYTES 21u
#define RUN_BYTES 3u
/* Of a run; longer ones are written as several. */
#define LONGEST_RUN 65535u

static void write_splat(const strl_splat *splat, strl_writer *writer)
{
    for (int k = 0; k < 3; k++)
        strl_writer_u32(writer, (uint32_t)splat->centre[k]);
    strl_writer_u8(writer, splat->side);
    strl_writer_u8(writer, splat->coverage);
    strl_writer_u8(writer, splat->normal[0]);
    strl_writer_u8(writer, splat->normal[1]);
    strl_writer_u8(writer, splat->parallel);
    strl_writer_u32(writer, splat->rgba);
}

void strl_brick_head_write(const strl_brick_head *head, strl_writer *writer)
{
    uint32_t runs = 0;
    for (uint32_t i = 0; i < head->run_count; i++)
        runs += (head->run[i].count + LONGEST_RUN - 1) / LONGEST_RUN;
    strl_writer_u8(writer, STRL_BRICK_VERSION);
    strl_writer_u8(writer, (uint8_t)head->level_count);
    strl_writer_u32(writer, runs);
    for (uint32_t i = 0; i < head->level_count; i++) {
        strl_writer_f32(writer, head->error[i]);
        strl_writer_u16(writer, (uint16_t)head->splat_end[i]);
    }
    for (uint32_t i = 0; i < strl_brick_splats(head); i++)
        write_splat(&head->splat[i], writer);
    for (uint32_t i = 0; i < head->run_count; i++)
        for (uint32_t left = head->run[i].count, part; left; left -= part) {
            part = left < LONGEST_RUN ? left : LONGEST_RUN;
            strl_writer_u8(writer, (uint8_t)head->run[i].level);
            strl_writer_u16(writer, (uint16_t)part);
        }
}

static strl_status read_levels(strl_cursor *cursor, strl_brick_head *head, strl_error *err)
{
    if (head->level_count < 1 || head->level_count > STRL_BRICK_LEVELS)
        return strl__fail(err, STRL_ERR_FORMAT, "a brick has %u levels, expected 1 to %u", head->level_count, STRL_BRICK_LEVELS);
    for (uint32_t i = 0; i < head->level_count; i++) {
        head->error[i] = strl_cursor_f32(cursor);
        head->splat_end[i] = strl_cursor_u16(cursor);
        if (!(head->error[i] >= 0) || isinf(head->error[i]) || (i && head->error[i] > head->error[i - 1]))
            return strl__fail(err, STRL_ERR_FORMAT, "level %u of a brick has the size %g, expected one from 0 to that of the level above",
                              i, (double)head->error[i]);
        if (head->splat_end[i] > STRL_BRICK_SPLATS || (i && head->splat_end[i] < head->splat_end[i - 1]))
            return strl__fail(err, STRL_ERR_FORMAT, "the splats of level %u of a brick end at %u, expected at most %u and no less than those above",
                              i, head->splat_end[i], STRL_BRICK_SPLATS);
    }
    return STRL_OK;
}

static strl_status read_splats(strl_cursor *cursor, strl_arena *arena, strl_brick_head *head, strl_error *err)
{
    uint32_t count = strl_brick_splats(head);
    if (count > strl_cursor_left(cursor) / SPLAT_BYTES)
        return strl__fail(err, STRL_ERR_FORMAT, "a brick of %zu bytes has %u splats", cursor->size, count);
    head->splat = strl_arena_alloc(arena, count, sizeof *head->splat);
    if (!head->splat)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %u splats", count);
    for (uint32_t i = 0; i < count; i++) {
        strl_splat *splat = &head->splat[i];
        for (int k = 0; k < 3; k++)
            splat->centre[k] = (int32_t)strl_cursor_u32(cursor);
        splat->side = strl_cursor_u8(cursor);
        splat->coverage = strl_cursor_u8(cursor);
        splat->normal[0] = strl_cursor_u8(cursor);
        splat->normal[1] = strl_cursor_u8(cursor);
        splat->parallel = strl_cursor_u8(cursor);
        splat->rgba = strl_cursor_u32(cursor);
        if (splat->side > 62)
            return strl__fail(err, STRL_ERR_FORMAT, "a splat has a side of 2^%u lattice units, at most 2^62 is allowed", splat->side);
    }
    return STRL_OK;
}

static strl_status read_runs(strl_cursor *cursor, uint32_t triangles, strl_arena *arena, strl_brick_head *head, strl_error *err)
{
    uint64_t sum = 0;
    if (head->run_count > strl_cursor_left(cursor) / RUN_BYTES)
        return strl__fail(err, STRL_ERR_FORMAT, "a brick of %zu bytes has %u runs", cursor->size, head->run_count);
    head->run = strl_arena_alloc(arena, head->run_count, sizeof *head->run);
    if (!head->run)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %u runs", head->run_count);
    for (uint32_t i = 0; i < head->run_count; i++) {
        head->run[i].level = strl_cursor_u8(cursor);
        head->run[i].count = strl_cursor_u16(cursor);
        sum += head->run[i].count;
        if (head->run[i].level > head->level_count)
            return strl__fail(err, STRL_ERR_FORMAT, "a brick of %u levels has triangles of level %u", head->level_count, head->run[i].level);
        if (head->run[i].count == 0)
            return strl__fail(err, STRL_ERR_FORMAT, "run %u of a brick has no triangle, expected at least one", i);
    }
    return sum == triangles ? STRL_OK
                            : strl__fail(err, STRL_ERR_FORMAT, "the runs of a brick have %llu triangles, its mesh has %u",
                                         (unsigned long long)sum, triangles);
}

strl_status strl_brick_head_read(const void *data, size_t size, uint32_t triangles, strl_arena *arena, strl_brick_head *head,
                                 size_t *bytes, strl_error *err)
{
    strl_cursor cursor = strl_cursor_make(data, size);
    *head = (strl_brick_head){0};
    unsigned version = strl_cursor_u8(&cursor);
    if (version != STRL_BRICK_VERSION)
        return strl__fail(err, STRL_ERR_FORMAT, "a brick begins with %u, expected %u", version, STRL_BRICK_VERSION);
    head->level_count = strl_cursor_u8(&cursor);
    head->run_count = strl_cursor_u32(&cursor);
    strl_status status = read_levels(&cursor, head, err);
    if (!status)
        status = read_splats(&cursor, arena, head, err);
    if (!status)
        status = read_runs(&cursor, triangles, arena, head, err);
    if (!status && cursor.failed)
        status = strl__fail(err, STRL_ERR_FORMAT, "a brick of %zu bytes ends within its head", size);
    *bytes = cursor.at;
    return status;
}
