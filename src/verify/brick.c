/* Heads of bricks: docs/format-payload.md, "Bricks". */
#include <math.h>

#include "base/cursor.h"
#include "base/fail.h"
#include "verify/mesh.h"

#define VERSION 2u
#define MOST_LEVELS 22u
#define MOST_SPLATS 4096u
#define SPLAT_BYTES 21u
#define RUN_BYTES 3u
#define MOST_SIDE 62u

static strl_status check_levels(strl_cursor *cursor, uint32_t levels, const strl__vnode *node, uint32_t *splats, strl_error *err)
{
    float above = INFINITY;
    *splats = 0;
    for (uint32_t i = 0; i < levels; i++) {
        float size = strl_cursor_f32(cursor);
        uint32_t end = strl_cursor_u16(cursor);
        if (!(size >= 0 && size <= above) || (i == 0 && size > node->geometric_max))
            return strl__fail(err, STRL_ERR_FORMAT, "cells of level %u have the size %g, expected at most %g, and its record says %g", i + 1,
                              (double)size, (double)above, (double)node->geometric_max);
        if (end < *splats || end > MOST_SPLATS)
            return strl__fail(err, STRL_ERR_FORMAT, "splats of level %u end at %u, those above at %u, at most are %u", i + 1, end, *splats,
                              MOST_SPLATS);
        above = size;
        *splats = end;
    }
    return STRL_OK;
}

static strl_status check_splats(strl_cursor *cursor, uint32_t splats, const strl__vnode *node, strl_error *err)
{
    for (uint32_t i = 0; i < splats && !cursor->failed; i++) {
        for (unsigned k = 0; k < 3; k++) {
            int64_t at = node->anchor[k] + (int32_t)strl_cursor_u32(cursor);
            if (!cursor->failed && (at < node->box[0][k] || at > node->box[1][k]))
                return strl__fail(err, STRL_ERR_FORMAT, "splat %u is at %lld on axis %u, outside its node's box", i, (long long)at, k);
        }
        uint32_t side = strl_cursor_u8(cursor);
        strl_cursor_take(cursor, SPLAT_BYTES - 13);
        if (side > MOST_SIDE)
            return strl__fail(err, STRL_ERR_FORMAT, "splat %u has a side of 2^%u lattice units", i, side);
    }
    return STRL_OK;
}

static strl_status check_runs(strl_cursor *cursor, uint32_t runs, uint32_t levels, const strl__vnode *node, strl_error *err)
{
    uint64_t sum = 0;
    for (uint32_t i = 0; i < runs && !cursor->failed; i++) {
        uint32_t level = strl_cursor_u8(cursor), count = strl_cursor_u16(cursor);
        sum += count;
        if (level > levels || (count == 0 && !cursor->failed))
            return strl__fail(err, STRL_ERR_FORMAT, "run %u has %u triangles of level %u of %u", i, count, level, levels);
    }
    if (!cursor->failed && sum != node->triangle_count)
        return strl__fail(err, STRL_ERR_FORMAT, "its runs have %llu triangles, its record says %u", (unsigned long long)sum,
                          node->triangle_count);
    return STRL_OK;
}

strl_status strl__v_brick_check(const uint8_t *payload, const strl__vnode *node, size_t *bytes, strl_error *err)
{
    strl_cursor cursor = strl_cursor_make(payload, node->payload_bytes);
    uint32_t version = strl_cursor_u8(&cursor), levels = strl_cursor_u8(&cursor), runs = strl_cursor_u32(&cursor), splats;
    if (!cursor.failed && (version != VERSION || levels < 1 || levels > MOST_LEVELS))
        return strl__fail(err, STRL_ERR_FORMAT, "a brick of version %u with %u levels", version, levels);
    strl_status status = check_levels(&cursor, levels, node, &splats, err);
    if (status == STRL_OK)
        status = check_splats(&cursor, splats, node, err);
    if (status == STRL_OK)
        status = check_runs(&cursor, runs, levels, node, err);
    if (status == STRL_OK && cursor.failed)
        status = strl__fail(err, STRL_ERR_FORMAT, "the payload of %u bytes ends within the head of a brick", node->payload_bytes);
    *bytes = cursor.at;
    return status;
}
