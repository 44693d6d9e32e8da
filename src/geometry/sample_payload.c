#include "geometry/sample_payload.h"

#include "base/fail.h"

void strl_sample_head_write(const strl_sample_head *head, strl_writer *writer)
{
    strl_writer_u8(writer, STRL_BRICK_VERSION);
    strl_writer_u8(writer, (uint8_t)head->splat_count);
    strl_writer_u32(writer, head->run_count);
    for (uint32_t i = 0; i < head->splat_count; i++) {
        const strl_splat *splat = &head->splat[i];
        for (int k = 0; k < 3; k++)
            strl_writer_u32(writer, (uint32_t)splat->centre[k]);
        strl_writer_u8(writer, splat->side);
        strl_writer_u8(writer, splat->coverage);
        strl_writer_u8(writer, splat->normal[0]);
        strl_writer_u8(writer, splat->normal[1]);
        strl_writer_u8(writer, splat->parallel);
        strl_writer_u32(writer, splat->rgba);
    }
    for (uint32_t i = 0; i < head->run_count; i++)
        strl_writer_u32(writer, head->run[i]);
}

static strl_status read_runs(strl_cursor *cursor, uint32_t triangles, strl_arena *arena, strl_sample_head *head, strl_error *err)
{
    uint64_t sum = 0;
    if (head->run_count == 0)
        return STRL_OK;
    if (head->run_count > strl_cursor_left(cursor) / 4)
        return strl__fail(err, STRL_ERR_FORMAT, "a brick of %zu bytes has %u runs", cursor->size, head->run_count);
    uint32_t *run = strl_arena_alloc(arena, head->run_count, sizeof *run);
    if (!run)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %u runs", head->run_count);
    for (uint32_t i = 0; i < head->run_count; i++) {
        run[i] = strl_cursor_u32(cursor);
        sum += run[i];
    }
    head->run = run;
    return sum == triangles ? STRL_OK
                            : strl__fail(err, STRL_ERR_FORMAT, "the runs of a brick have %llu triangles, its mesh has %u",
                                         (unsigned long long)sum, triangles);
}

strl_status strl_sample_head_read(const void *data, size_t size, uint32_t triangles, strl_arena *arena, strl_sample_head *head,
                                  size_t *bytes, strl_error *err)
{
    strl_cursor cursor = strl_cursor_make(data, size);
    *head = (strl_sample_head){0};
    unsigned version = strl_cursor_u8(&cursor);
    head->splat_count = strl_cursor_u8(&cursor);
    head->run_count = strl_cursor_u32(&cursor);
    if (version != STRL_BRICK_VERSION)
        return strl__fail(err, STRL_ERR_FORMAT, "a brick begins with %u, expected %u", version, STRL_BRICK_VERSION);
    if (head->splat_count > STRL_MAX_SPLATS)
        return strl__fail(err, STRL_ERR_FORMAT, "a brick has %u splats, at most %u are allowed", head->splat_count, STRL_MAX_SPLATS);
    for (uint32_t i = 0; i < head->splat_count; i++) {
        strl_splat *splat = &head->splat[i];
        for (int k = 0; k < 3; k++)
            splat->centre[k] = (int32_t)strl_cursor_u32(&cursor);
        splat->side = strl_cursor_u8(&cursor);
        splat->coverage = strl_cursor_u8(&cursor);
        splat->normal[0] = strl_cursor_u8(&cursor);
        splat->normal[1] = strl_cursor_u8(&cursor);
        splat->parallel = strl_cursor_u8(&cursor);
        splat->rgba = strl_cursor_u32(&cursor);
        if (splat->side > 62)
            return strl__fail(err, STRL_ERR_FORMAT, "a splat has a side of 2^%u lattice units, at most 2^62 is allowed", splat->side);
    }
    strl_status status = read_runs(&cursor, triangles, arena, head, err);
    if (!status && cursor.failed)
        status = strl__fail(err, STRL_ERR_FORMAT, "a brick of %zu bytes ends within its head", size);
    *bytes = cursor.at;
    return status;
}
