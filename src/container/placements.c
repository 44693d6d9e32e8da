/* Placements: docs/format.md, "Paged tables". */
#include <inttypes.h>
#include <math.h>

#include "base/fail.h"
#include "container/opened.h"

static strl_status decode(const strl_container *container, uint64_t index, const uint8_t *item, uint32_t bytes,
                          strl_placement *placement, strl_error *err)
{
    strl_cursor in = strl_cursor_make(item, bytes);
    placement->tree = strl_cursor_u32(&in);
    placement->own_part = strl_cursor_u32(&in);
    for (int i = 0; i < 12; i++)
        placement->transform[i] = strl_cursor_f64(&in);
    if (in.failed || strl_cursor_left(&in))
        return strl__fail(err, STRL_ERR_FORMAT,
                          "placement %" PRIu64 ": %" PRIu32 " bytes, expected %u", index, bytes, STRL__PLACEMENT_BYTES);
    if (placement->tree >= container->header.info.tree_count)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "placement %" PRIu64 ": tree is %" PRIu32 ", expected less than %" PRIu32, index,
                          placement->tree, container->header.info.tree_count);
    if (placement->own_part > container->header.info.part_count)
        return strl__fail(err, STRL_ERR_FORMAT, "placement %" PRIu64 ": part is %" PRIu32 ", expected less than %" PRIu32, index,
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
    strl_status status = strl__page_table_get(&container->placements, container->source, index, &item, &bytes, &first, err);
    if (status == STRL_OK)
        status = decode(container, index, item, bytes, placement, err);
    return strl_source_fail(container->source, status, err);
}
