/* Heads of bricks: docs/format-payload.md, "Bricks". */
#include <inttypes.h>
#include <math.h>

#include "base/fail.h"
#include "verify/payload.h"

#define VERSION 3u
#define MOST_LEVELS 22u
#define MOST_SPLATS 4096u
#define MOST_SIDE 36u

enum brick_stream { SIDE = 0, CENTRE, COVERAGE, NORMAL, PARALLEL, COLOUR, LEVEL = 9, COUNT, STREAMS = 12 };

static strl_status check_levels(strl_cursor *cursor, uint32_t levels, const strl__vnode *node, uint32_t *splats,
                                strl_error *err)
{
    float above = INFINITY;
    *splats = 0;
    for (uint32_t i = 0; i < levels; i++) {
        float size = strl_cursor_f32(cursor);
        uint32_t end = strl_cursor_u16(cursor);
        if (!(size >= 0 && size <= above) || (i == 0 && size > node->geometric_max))
            return strl__fail(err, STRL_ERR_FORMAT,
                              "cells of level %u have the size %g, expected at most %g, and its record says %g", i + 1,
                              (double)size, (double)above, (double)node->geometric_max);
        if (end < *splats || end > MOST_SPLATS)
            return strl__fail(err, STRL_ERR_FORMAT, "splats of level %u end at %u, those above at %u, at most are %u",
                              i + 1, end, *splats, MOST_SPLATS);
        above = size;
        *splats = end;
    }
    return STRL_OK;
}

static strl_status read_streams(strl__v_payload *self, const uint8_t *bytes, size_t size)
{
    strl_cursor cursor = strl_cursor_make(bytes, size);
    self->words = strl_cursor_u32(&cursor);
    for (unsigned i = 0; i < 4; i++)
        self->coder[i] = strl_cursor_u32(&cursor);
    if (cursor.failed)
        return strl__fail(self->err, STRL_ERR_FORMAT, "a brick's streams of %zu bytes end within their first 20", size);
    return strl__v_payload_streams(self, &cursor, size, STREAMS);
}

/* Where the middle of so many units of 2^shift lies; the number of units is 32 bits. */
static int64_t middle(int32_t units, unsigned shift)
{
    int64_t unit = (int64_t)1 << shift;
    return units * unit + unit / 2;
}

static strl_status check_splats(strl__v_payload *self, uint32_t splats, const strl__vnode *node)
{
    int64_t centre[3] = {0};
    uint32_t side = 0;
    for (uint32_t i = 0; i < splats; i++) {
        side = (side + strl__v_residual(self, SIDE)) % 256;
        if (side > MOST_SIDE)
            return strl__fail(self->err, STRL_ERR_FORMAT, "splat %u has a side of 2^%u lattice units", i, side);
        unsigned shift = side < 5 ? 0 : side - 5;
        for (unsigned k = 0; k < 3; k++) {
            int32_t units = (int32_t)((uint32_t)(centre[k] >> shift) + strl__v_residual(self, CENTRE));
            centre[k] = middle(units, shift);
            int64_t at = node->anchor[k] + centre[k];
            if (centre[k] != (int32_t)centre[k] || at < node->box[0][k] || at > node->box[1][k])
                return strl__fail(self->err, STRL_ERR_FORMAT,
                                  "splat %u is at %" PRId64 " on axis %u, outside its node's box", i, at, k);
        }
        strl__v_pull(self, COVERAGE);
        strl__v_pull(self, PARALLEL);
        for (unsigned k = 0; k < 2; k++)
            strl__v_pull(self, NORMAL);
        for (unsigned k = 0; k < 4; k++)
            strl__v_pull(self, COLOUR + k);
    }
    return STRL_OK;
}

static strl_status check_runs(strl__v_payload *self, uint32_t levels, const strl__vnode *node)
{
    uint64_t sum = 0, before = levels + 1; /* of none */
    uint32_t runs = self->stream[LEVEL].count;
    for (uint32_t i = 0; i < runs; i++) {
        uint64_t up = strl__v_pull(self, LEVEL);
        if (i > 0 && up >= before)
            up++;
        if (up > levels)
            return strl__fail(self->err, STRL_ERR_FORMAT, "run %u is of a level %" PRIu64 " above the finest of %u", i,
                              up, levels);
        sum += (uint64_t)1 + strl__v_pull(self, up == 0 ? COUNT : COUNT + 1);
        before = up;
    }
    if (sum != node->triangle_count)
        return strl__fail(self->err, STRL_ERR_FORMAT, "its runs have %" PRIu64 " triangles, its record says %u", sum,
                          node->triangle_count);
    return STRL_OK;
}

strl_status strl__v_brick_check(const uint8_t *payload, const strl__vnode *node, strl_arena *arena, size_t *bytes,
                                strl_error *err)
{
    strl_cursor cursor = strl_cursor_make(payload, node->payload_bytes);
    strl__v_payload self = {.arena = arena, .err = err};
    uint32_t version = strl_cursor_u8(&cursor), levels = strl_cursor_u8(&cursor), coded = strl_cursor_u32(&cursor),
             splats;
    if (!cursor.failed && (version != VERSION || levels < 1 || levels > MOST_LEVELS))
        return strl__fail(err, STRL_ERR_FORMAT, "a brick of version %u with %u levels", version, levels);
    strl_status status = check_levels(&cursor, levels, node, &splats, err);
    const uint8_t *streams = strl_cursor_take(&cursor, coded);
    if (status == STRL_OK && !streams)
        status = strl__fail(err, STRL_ERR_FORMAT, "the payload of %u bytes ends within the head of a brick",
                            node->payload_bytes);
    if (status == STRL_OK)
        status = read_streams(&self, streams, coded);
    if (status == STRL_OK)
        status = check_splats(&self, splats, node);
    if (status == STRL_OK)
        status = check_runs(&self, levels, node);
    *bytes = cursor.at;
    return status == STRL_OK ? strl__v_payload_ends(&self) : status;
}
