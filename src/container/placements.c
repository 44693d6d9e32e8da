/* Placements and runs of them: docs/format.md, "Paged tables". */
#include <inttypes.h>
#include <math.h>

#include "base/fail.h"
#include "base/hash.h"
#include "container/opened.h"
#include "geometry/octahedral.h"

static strl_status decode(const strl_container *container, uint64_t index, const uint8_t *item, uint32_t bytes,
                          strl_placement *placement, strl_error *err)
{
    strl_cursor in = strl_cursor_make(item, bytes);
    placement->tree = strl_cursor_u32(&in);
    placement->own_part = strl_cursor_u32(&in);
    for (int i = 0; i < 12; i++)
        placement->transform[i] = strl_cursor_f64(&in);
    if (in.failed || strl_cursor_left(&in))
        return strl__fail(err, STRL_ERR_FORMAT, "placement %" PRIu64 ": %" PRIu32 " bytes, expected %u", index, bytes,
                          STRL__PLACEMENT_BYTES);
    if (placement->tree >= container->header.info.tree_count)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "placement %" PRIu64 ": tree is %" PRIu32 ", expected less than %" PRIu32, index,
                          placement->tree, container->header.info.tree_count);
    if (placement->own_part > container->header.info.part_count)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "placement %" PRIu64 ": part is %" PRIu32 ", expected less than %" PRIu32, index,
                          placement->own_part - 1, container->header.info.part_count);
    for (int i = 0; i < 12; i++)
        if (!isfinite(placement->transform[i]))
            return strl__fail(err, STRL_ERR_FORMAT, "placement %" PRIu64 ": number %d of its transform is not finite",
                              index, i);
    return STRL_OK;
}

strl_status strl_container_placement(strl_container *container, uint64_t index, strl_placement *placement,
                                     strl_error *err)
{
    const uint8_t *item;
    uint32_t bytes;
    *placement = (strl_placement){0};
    uint64_t first;
    strl_status status =
        strl__page_table_get(&container->placements, container->source, index, &item, &bytes, &first, err);
    if (status == STRL_OK)
        status = decode(container, index, item, bytes, placement, err);
    return strl_source_fail(container->source, status, err);
}

/* ---- runs */

uint32_t strl_container_run_count(const strl_container *container)
{
    return (uint32_t)container->runs.section.item_count; /* bounded by the placements' page references */
}

static uint32_t placements_of(const strl_container *container, uint32_t run)
{
    uint64_t left = container->header.info.placement_count - (uint64_t)run * STRL_RUN_PLACEMENTS;
    return left < STRL_RUN_PLACEMENTS ? (uint32_t)left : STRL_RUN_PLACEMENTS;
}

static bool is_box(const strl_run *facts)
{
    for (int axis = 0; axis < 3; axis++)
        if (!isfinite(facts->box_min[axis]) || !isfinite(facts->box_max[axis]) ||
            facts->box_min[axis] > facts->box_max[axis])
            return false;
    return true;
}

static strl_status decode_run(const strl_container *container, uint32_t run, const uint8_t *item, uint32_t bytes,
                              strl_run *facts, strl_error *err)
{
    strl_cursor in = strl_cursor_make(item, bytes);
    for (int axis = 0; axis < 3; axis++)
        facts->box_min[axis] = strl_cursor_f64(&in);
    for (int axis = 0; axis < 3; axis++)
        facts->box_max[axis] = strl_cursor_f64(&in);
    facts->far.area = strl_cursor_f32(&in);
    facts->far.rgba = strl_cursor_u32(&in);
    uint16_t spread_and_normal = strl_cursor_u16(&in);
    facts->far.normal[0] = spread_and_normal & STRL_OCT_MAX;
    facts->far.spread = (uint8_t)(spread_and_normal >> STRL__RUN_SPREAD_SHIFT);
    facts->far.normal[1] = strl_cursor_u16(&in);
    facts->page.bytes = strl_cursor_u32(&in);
    facts->page.offset = strl_cursor_u64(&in);
    facts->page.checksum = strl_cursor_u64(&in);
    uint32_t expected = 4 + placements_of(container, run) * (4 + STRL__PLACEMENT_BYTES);
    if (in.failed || strl_cursor_left(&in))
        return strl__fail(err, STRL_ERR_FORMAT, "run %" PRIu32 ": %" PRIu32 " bytes, expected %u", run, bytes,
                          STRL__RUN_BYTES);
    if (!is_box(facts))
        return strl__fail(err, STRL_ERR_FORMAT, "run %" PRIu32 ": its box is not finite, or a min is above its max",
                          run);
    if (!(facts->far.area >= 0) || !isfinite(facts->far.area) || facts->far.normal[1] > STRL_OCT_MAX)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "run %" PRIu32
                          ": its area is %g, the second number of its normal %u, expected finite, >= 0, and at most %d",
                          run, (double)facts->far.area, facts->far.normal[1], STRL_OCT_MAX);
    if (facts->page.bytes != expected)
        return strl__fail(err, STRL_ERR_FORMAT, "run %" PRIu32 ": its page has %" PRIu32 " bytes, expected %" PRIu32,
                          run, facts->page.bytes, expected);
    return strl__ref_check(&facts->page, container->header.info.file_bytes, "page of placements", err);
}

strl_status strl_container_run(strl_container *container, uint32_t run, strl_run *facts, strl_error *err)
{
    const uint8_t *item;
    uint32_t bytes;
    uint64_t first;
    *facts = (strl_run){0};
    strl_status status = strl__page_table_get(&container->runs, container->source, run, &item, &bytes, &first, err);
    if (status == STRL_OK)
        status = decode_run(container, run, item, bytes, facts, err);
    return strl_source_fail(container->source, status, err);
}

strl_status strl_run_check(const strl_container *container, uint32_t run, const strl_run *facts, const void *data,
                           size_t size, strl_error *err)
{
    const uint8_t *bytes = data;
    uint32_t count = placements_of(container, run);
    uint64_t found = strl__checksum(bytes, size);
    if (size != facts->page.bytes || found != facts->page.checksum)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "page of placements at byte %" PRIu64 ": %zu bytes with the checksum %016" PRIx64
                          ", expected %" PRIu32 " with %016" PRIx64,
                          facts->page.offset, size, found, facts->page.bytes, facts->page.checksum);
    bool good = strl__load_le(bytes, 4) == count;
    for (uint32_t i = 0; i < count; i++)
        good = good && strl__load_le(bytes + 4 + (size_t)4 * i, 4) == (i + 1) * STRL__PLACEMENT_BYTES;
    return good ? STRL_OK
                : strl__fail(err, STRL_ERR_FORMAT,
                             "page of placements at byte %" PRIu64 ": it is not one of %" PRIu32 " placements",
                             facts->page.offset, count);
}

strl_status strl_run_placement(const strl_container *container, uint64_t index, const void *data,
                               strl_placement *placement, strl_error *err)
{
    uint32_t count = placements_of(container, (uint32_t)(index / STRL_RUN_PLACEMENTS)),
             within = index % STRL_RUN_PLACEMENTS;
    const uint8_t *items = (const uint8_t *)data + 4 + (size_t)4 * count;
    return decode(container, index, items + (size_t)within * STRL__PLACEMENT_BYTES, STRL__PLACEMENT_BYTES, placement,
                  err);
}

void strl_placed_box(const strl_tree *tree, const double transform[12], const int64_t min[3], const int64_t max[3],
                     double placed_min[3], double placed_max[3])
{
    for (int row = 0; row < 3; row++) {
        const double *m = transform + 4 * row;
        placed_min[row] = placed_max[row] = m[3];
        for (int i = 0; i < 3; i++) {
            double a = m[i] * (tree->origin[i] + tree->step * (double)min[i]);
            double b = m[i] * (tree->origin[i] + tree->step * (double)max[i]);
            placed_min[row] += a < b ? a : b;
            placed_max[row] += a < b ? b : a;
        }
    }
}
