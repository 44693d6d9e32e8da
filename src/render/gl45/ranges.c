#include "render/gl45/ranges.h"

#include <string.h>

#include "base/memory.h"

bool strl__ranges_init(strl_ranges *ranges, uint32_t total)
{
    *ranges = (strl_ranges){0};
    if (!strl__grow(&ranges->free, &ranges->capacity, 1, sizeof *ranges->free))
        return false;
    ranges->free[0] = (strl_range){0, total};
    ranges->count = 1;
    return true;
}

void strl__ranges_deinit(strl_ranges *ranges)
{
    strl__free(ranges->free);
    *ranges = (strl_ranges){0};
}

static void remove_at(strl_ranges *ranges, size_t at)
{
    ranges->count--;
    memmove(&ranges->free[at], &ranges->free[at + 1], (ranges->count - at) * sizeof *ranges->free);
}

uint32_t strl__ranges_take(strl_ranges *ranges, uint32_t count)
{
    /* n blocks out leave at most n + 1 gaps. */
    if (!strl__grow(&ranges->free, &ranges->capacity, ranges->taken + 2, sizeof *ranges->free))
        return STRL_RANGES_NONE;
    for (size_t at = 0; at < ranges->count; at++) {
        strl_range *range = &ranges->free[at];
        if (range->count < count)
            continue;
        uint32_t first = range->first;
        range->first += count;
        range->count -= count;
        if (range->count == 0)
            remove_at(ranges, at);
        ranges->taken++;
        return first;
    }
    return STRL_RANGES_NONE;
}

void strl__ranges_give(strl_ranges *ranges, uint32_t first, uint32_t count)
{
    size_t low = 0, high = ranges->count;
    while (low < high) {
        size_t middle = (low + high) / 2;
        if (ranges->free[middle].first < first)
            low = middle + 1;
        else
            high = middle;
    }
    strl_range *before = low > 0 ? &ranges->free[low - 1] : NULL;
    strl_range *after = low < ranges->count ? &ranges->free[low] : NULL;
    bool joins_before = before && before->first + before->count == first;
    bool joins_after = after && first + count == after->first;
    ranges->taken--;
    if (joins_before) {
        before->count += count + (joins_after ? after->count : 0);
        if (joins_after)
            remove_at(ranges, low);
    } else if (joins_after) {
        after->first = first;
        after->count += count;
    } else {
        memmove(&ranges->free[low + 1], &ranges->free[low], (ranges->count - low) * sizeof *ranges->free);
        ranges->free[low] = (strl_range){first, count};
        ranges->count++;
    }
}
