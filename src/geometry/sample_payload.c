#include "geometry/sample_payload.h"

#include <inttypes.h>
#include <math.h>

#include "base/fail.h"
#include "geometry/payload_streams.h"

/* In the order in which they lie in a head. */
enum {
    SIDE = 0,
    CENTRE,
    COVERAGE,
    NORMAL,
    PARALLEL,
    COLOUR, /* green, red, blue, alpha */
    LEVEL = COLOUR + 4,
    COUNT, /* of the finest level's runs, then of the others' */
    STREAMS = COUNT + 2
};

static const unsigned colour_shift[4] = {8, 0, 16, 24};

static uint8_t colour_of(uint32_t rgba, unsigned k)
{
    return (uint8_t)(rgba >> colour_shift[k]);
}

/* ---- writing */

/* What is to be added to `before`, modulo 256. */
static uint32_t byte_residual(uint8_t value, uint8_t before)
{
    return strl__zigzag((uint32_t)(int32_t)(int8_t)(uint8_t)(value - before));
}

static void push_splat(struct strl__streams_out *streams, const strl_splat *splat, const strl_splat *before)
{
    unsigned shift = strl_splat_shift(splat->side);
    strl__push(streams, SIDE, byte_residual(splat->side, before->side));
    for (unsigned k = 0; k < 3; k++)
        strl__push(streams, CENTRE,
                   strl__zigzag((uint32_t)(splat->centre[k] >> shift) - (uint32_t)(before->centre[k] >> shift)));
    strl__push(streams, COVERAGE, 255u - splat->coverage);
    for (unsigned k = 0; k < 2; k++)
        strl__push(streams, NORMAL, byte_residual(splat->normal[k], before->normal[k]));
    strl__push(streams, PARALLEL, 255u - splat->parallel);
    uint8_t green = (uint8_t)(colour_of(splat->rgba, 0) - colour_of(before->rgba, 0));
    for (unsigned k = 0; k < 4; k++)
        strl__push(streams, COLOUR + k,
                   byte_residual(colour_of(splat->rgba, k),
                                 (uint8_t)(colour_of(before->rgba, k) + (k == 1 || k == 2 ? green : 0))));
}

static void push_runs(struct strl__streams_out *streams, const strl_brick_head *head)
{
    for (uint32_t i = 0, before = UINT32_MAX, up; i < head->run_count; i++, before = up) {
        up = head->level_count - head->run[i].level;
        strl__push(streams, LEVEL, up > before ? up - 1 : up);
        strl__push(streams, COUNT + (up > 0), head->run[i].count - 1);
    }
}

strl_status strl_brick_head_write(const strl_brick_head *head, strl_writer *writer, strl_error *err)
{
    struct strl__streams_out streams = {0};
    const strl_splat white = {.rgba = UINT32_MAX};
    for (uint32_t i = 0; i < strl_brick_splats(head); i++)
        push_splat(&streams, &head->splat[i], i ? &head->splat[i - 1] : &white);
    push_runs(&streams, head);
    strl_writer_u8(writer, STRL_BRICK_VERSION);
    strl_writer_u8(writer, (uint8_t)head->level_count);
    size_t length_at = writer->size;
    strl_writer_u32(writer, 0);
    for (uint32_t i = 0; i < head->level_count; i++) {
        strl_writer_f32(writer, head->error[i]);
        strl_writer_u16(writer, (uint16_t)head->splat_end[i]);
    }
    size_t start = writer->size;
    strl_status status = strl__streams_write(&streams, STREAMS, start, 0, writer, err);
    if (!status)
        strl__store_le(writer->data + length_at, 4, writer->size - start);
    strl__streams_deinit(&streams);
    return status;
}

/* ---- reading */

static strl_status read_levels(strl_cursor *cursor, strl_brick_head *head, strl_error *err)
{
    if (head->level_count < 1 || head->level_count > STRL_BRICK_LEVELS)
        return strl__fail(err, STRL_ERR_FORMAT, "a brick has %u levels, expected 1 to %u", head->level_count,
                          STRL_BRICK_LEVELS);
    for (uint32_t i = 0; i < head->level_count; i++) {
        head->error[i] = strl_cursor_f32(cursor);
        head->splat_end[i] = strl_cursor_u16(cursor);
        if (!(head->error[i] >= 0) || isinf(head->error[i]) || (i && head->error[i] > head->error[i - 1]))
            return strl__fail(err, STRL_ERR_FORMAT,
                              "level %u of a brick has the size %g, expected one from 0 to that of the level above", i,
                              (double)head->error[i]);
        if (head->splat_end[i] > STRL_BRICK_SPLATS || (i && head->splat_end[i] < head->splat_end[i - 1]))
            return strl__fail(
                err, STRL_ERR_FORMAT,
                "the splats of level %u of a brick end at %u, expected at most %u and no less than those above", i,
                head->splat_end[i], STRL_BRICK_SPLATS);
    }
    return STRL_OK;
}

static uint8_t pull_byte(struct strl__streams_in *streams, unsigned id, uint8_t before)
{
    return (uint8_t)(before + strl__unzigzag(strl__pull(streams, id)));
}

static uint32_t pull_colour(struct strl__streams_in *streams, uint32_t before)
{
    uint8_t green = pull_byte(streams, COLOUR, 0);
    uint32_t rgba = 0;
    for (unsigned k = 0; k < 4; k++) {
        uint8_t value = (uint8_t)(colour_of(before, k) + (k < 3 ? green : 0));
        rgba |= (uint32_t)(k ? pull_byte(streams, COLOUR + k, value) : value) << colour_shift[k];
    }
    return rgba;
}

/* False where a coordinate does not fit. */
static bool pull_centre(struct strl__streams_in *streams, const strl_splat *before, strl_splat *splat)
{
    unsigned shift = strl_splat_shift(splat->side);
    for (unsigned k = 0; k < 3; k++) {
        int32_t unit = (int32_t)((uint32_t)(before->centre[k] >> shift) + strl__unzigzag(strl__pull(streams, CENTRE)));
        int64_t place = (int64_t)unit * ((int64_t)1 << shift);
        if (place < INT32_MIN || place > INT32_MAX)
            return false;
        splat->centre[k] = strl_splat_place((int32_t)place, splat->side);
    }
    return true;
}

static strl_status take_splats(struct strl__streams_in *streams, strl_brick_head *head, strl_error *err)
{
    strl_splat before = {.rgba = UINT32_MAX};
    for (uint32_t i = 0; i < strl_brick_splats(head); i++) {
        strl_splat splat = {.side = pull_byte(streams, SIDE, before.side)};
        if (splat.side > STRL_SPLAT_MOST_SIDE)
            return strl__fail(err, STRL_ERR_FORMAT, "a splat has a side of 2^%u lattice units, at most 2^%u is allowed",
                              splat.side, STRL_SPLAT_MOST_SIDE);
        if (!pull_centre(streams, &before, &splat))
            return strl__fail(err, STRL_ERR_FORMAT,
                              "a splat lies further from its brick's anchor than 32 bits can say");
        splat.coverage = (uint8_t)(255u - strl__pull(streams, COVERAGE));
        for (unsigned k = 0; k < 2; k++)
            splat.normal[k] = pull_byte(streams, NORMAL, before.normal[k]);
        splat.parallel = (uint8_t)(255u - strl__pull(streams, PARALLEL));
        splat.rgba = pull_colour(streams, before.rgba);
        head->splat[i] = before = splat;
    }
    return STRL_OK;
}

static strl_status take_runs(struct strl__streams_in *streams, uint32_t triangles, strl_brick_head *head,
                             strl_error *err)
{
    uint64_t sum = 0;
    for (uint64_t i = 0, before = UINT64_MAX; i < head->run_count; i++) {
        uint64_t up = strl__pull(streams, LEVEL);
        up += up >= before;
        if (up > head->level_count)
            return strl__fail(err, STRL_ERR_FORMAT,
                              "run %" PRIu64 " of a brick is %" PRIu64 " levels above the finest of %u", i, up,
                              head->level_count);
        uint64_t count = (uint64_t)strl__pull(streams, COUNT + (up > 0)) + 1;
        head->run[i] = (strl_brick_run){head->level_count - (uint32_t)up, (uint32_t)count};
        before = up;
        sum += count;
    }
    return sum == triangles
               ? STRL_OK
               : strl__fail(err, STRL_ERR_FORMAT, "the runs of a brick have %" PRIu64 " triangles, its mesh has %u",
                            sum, triangles);
}

static strl_status read_streams(strl_cursor *cursor, uint32_t triangles, strl_arena *arena, strl_arena *scratch,
                                strl_brick_head *head, strl_error *err)
{
    struct strl__streams_in streams;
    strl_status status = strl__streams_read(cursor, STREAMS, cursor->size, 0, scratch, &streams, err);
    if (status)
        return status;
    uint32_t splats = strl_brick_splats(head);
    head->run_count = streams.stream[LEVEL].count;
    if (streams.stream[SIDE].count != splats || head->run_count > triangles)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "a brick of %u triangles has %u runs, and %u splats, of which its levels have %u", triangles,
                          head->run_count, streams.stream[SIDE].count, splats);
    head->splat = strl_arena_alloc(arena, splats, sizeof *head->splat);
    head->run = strl_arena_alloc(arena, head->run_count, sizeof *head->run);
    if (!head->splat || !head->run)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %u splats and %u runs", splats, head->run_count);
    status = take_splats(&streams, head, err);
    if (!status)
        status = take_runs(&streams, triangles, head, err);
    if (!status && !strl__streams_done(&streams))
        status = strl__fail(err, STRL_ERR_FORMAT,
                            "the streams of a brick's head are not all as long as its splats and runs ask");
    return status;
}

strl_status strl_brick_head_read(const void *data, size_t size, uint32_t triangles, strl_arena *arena,
                                 strl_brick_head *head, size_t *bytes, strl_error *err)
{
    strl_cursor cursor = strl_cursor_make(data, size);
    *head = (strl_brick_head){0};
    unsigned version = strl_cursor_u8(&cursor);
    if (version != STRL_BRICK_VERSION)
        return strl__fail(err, STRL_ERR_FORMAT, "a brick begins with %u, expected %u", version, STRL_BRICK_VERSION);
    head->level_count = strl_cursor_u8(&cursor);
    uint32_t length = strl_cursor_u32(&cursor);
    strl_status status = read_levels(&cursor, head, err);
    if (status)
        return status;
    const uint8_t *coded = strl_cursor_take(&cursor, length);
    if (!coded)
        return strl__fail(err, STRL_ERR_FORMAT, "a brick of %zu bytes ends within its head", size);
    strl_cursor streams = strl_cursor_make(coded, length);
    strl_arena scratch;
    size_t left = arena->limit_bytes > arena->total_bytes ? arena->limit_bytes - arena->total_bytes : 1;
    strl_arena_init(&scratch, arena->limit_bytes ? left : 0);
    status = read_streams(&streams, triangles, arena, &scratch, head, err);
    strl_arena_deinit(&scratch);
    *bytes = cursor.at;
    return status;
}
