/* Hidden and marked parts, by the vertices that go to the GPU: a hidden vertex has alpha 0, which the screen-door
 * pattern never draws; a marked one is tinted. Costs nothing in frames in which the styles do not change. */
#ifndef STRL_RENDER_STYLE_H
#define STRL_RENDER_STYLE_H

#include "render/cache.h"
#include "stroll/render.h"

/* Three parts of this and one of its own colour are a marked part's; sRGB codes. */
extern const uint8_t strl__style_mark[3];

/* Of the part that the whole placement is. */
strl_part_style strl__item_style(const strl_draw_item *item, const strl_draw_options *options);

/* Whether what the entry holds was styled otherwise than options want it; brings the entry's words on it up to date.
 * The caller then uploads the vertices again. A new entry needs it too, and its vertices in any case. */
bool strl__style_update(strl_cache_entry *entry, const strl_draw_item *item, const strl_draw_options *options);

/* The vertices to upload: the item's own where the entry is plain, else *copy, which grows. NULL without memory. */
const strl_vertex *strl__style_vertices(const strl_cache_entry *entry, const strl_draw_item *item,
                                        const strl_draw_options *options, strl_vertex **copy, size_t *capacity);

#endif
