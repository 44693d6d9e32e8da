/* Suballocation: which granules of a slab are free. First fit, neighbours are joined. No GL. */
#ifndef STRL_RENDER_GL45_RANGES_H
#define STRL_RENDER_GL45_RANGES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define STRL_RANGES_NONE UINT32_MAX

typedef struct strl_range {
    uint32_t first, count;
} strl_range;

typedef struct strl_ranges {
    strl_range *free; /* sorted, no two touch */
    size_t count, capacity;
    size_t taken; /* blocks out */
} strl_ranges;

/* One free range [0, total). False without memory. */
bool strl__ranges_init(strl_ranges *ranges, uint32_t total);
void strl__ranges_deinit(strl_ranges *ranges);
/* The first granule of `count` (> 0) free ones; STRL_RANGES_NONE where there is no such range or no memory. */
uint32_t strl__ranges_take(strl_ranges *ranges, uint32_t count);
/* Gives back what take has given. Cannot fail: take has made the room it needs. */
void strl__ranges_give(strl_ranges *ranges, uint32_t first, uint32_t count);

#endif
