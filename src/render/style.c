#include "render/style.h"

#include <string.h>

#include "base/memory.h"

const uint8_t strl__style_mark[3] = {255, 150, 30};

static strl_part_style style_of(const strl_draw_options *options, const strl_draw_item *item, uint32_t vertex)
{
    uint32_t part = item->labels[vertex].part;
    return part < options->part_count ? (strl_part_style)options->part_styles[part] : STRL_PART_PLAIN;
}

strl_part_style strl__item_style(const strl_draw_item *item, const strl_draw_options *options)
{
    uint32_t part = item->own_part - 1; /* of none: more than any count */
    return options->part_styles && part < options->part_count ? (strl_part_style)options->part_styles[part]
                                                              : STRL_PART_PLAIN;
}

bool strl__style_update(strl_cache_entry *entry, const strl_draw_item *item, const strl_draw_options *options)
{
    /* 0 is without styles, whatever version the caller begins with. */
    uint64_t version = options->part_styles ? options->styles_version + 1 : 0;
    if (!item->labels || entry->styles_version == version)
        return false;
    uint32_t hidden = 0, marked = 0;
    for (uint32_t v = 0; options->part_styles && v < item->vertex_count; v++) {
        strl_part_style style = style_of(options, item, v);
        hidden += style == STRL_PART_HIDDEN;
        marked += style == STRL_PART_MARKED;
    }
    bool was_styled = entry->styled;
    entry->styles_version = version;
    entry->styled = hidden || marked;
    entry->hides = hidden > 0;
    entry->hidden = hidden == item->vertex_count;
    return was_styled || entry->styled;
}

const strl_vertex *strl__style_vertices(const strl_cache_entry *entry, const strl_draw_item *item,
                                        const strl_draw_options *options, strl_vertex **copy, size_t *capacity)
{
    if (!entry->styled)
        return item->vertices;
    if (!strl__grow(copy, capacity, item->vertex_count, sizeof **copy))
        return NULL;
    memcpy(*copy, item->vertices, item->vertex_count * sizeof **copy);
    for (uint32_t v = 0; v < item->vertex_count; v++) {
        uint8_t *rgba = (*copy)[v].rgba;
        strl_part_style style = style_of(options, item, v);
        if (style == STRL_PART_HIDDEN)
            rgba[3] = 0;
        for (int i = 0; style == STRL_PART_MARKED && i < 3; i++)
            rgba[i] = (uint8_t)((rgba[i] + 3 * strl__style_mark[i]) / 4);
    }
    return *copy;
}
