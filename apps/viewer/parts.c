#include "viewer/parts.h"

#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "stroll/render.h"

strl_status strl_parts_init(strl_parts *parts, uint32_t part_count, strl_part_name_fn name, void *context,
                            strl_error *err)
{
    *parts = (strl_parts){.version = 1};
    strl_status status = strl_part_tree_init(&parts->tree, part_count, 0, name, context, err);
    if (status != STRL_OK)
        return status;
    parts->hidden = strl__alloc_zero(part_count, 1);
    parts->styles = strl__alloc_zero(part_count, 1);
    if (parts->hidden && parts->styles)
        return STRL_OK;
    strl_parts_deinit(parts);
    return strl__fail(err, STRL_ERR_MEMORY, "no memory for the styles of %u parts", part_count);
}

void strl_parts_deinit(strl_parts *parts)
{
    strl_part_tree_deinit(&parts->tree);
    strl__free(parts->hidden);
    strl__free(parts->styles);
    *parts = (strl_parts){0};
}

static uint32_t cut_count(const strl_parts *parts, uint32_t first, uint32_t count)
{
    uint32_t all = parts->tree.part_count;
    return first >= all ? 0 : count < all - first ? count : all - first;
}

static void change(strl_parts *parts)
{
    parts->version++;
    parts->hidden_count = strl_parts_hidden_in(parts, 0, parts->tree.part_count);
    for (uint32_t place = 0; place < parts->tree.part_count; place++) {
        bool selected = place >= parts->selected_first && place - parts->selected_first < parts->selected_count;
        parts->styles[parts->tree.order[place]] = (uint8_t)(parts->hidden[place] ? STRL_PART_HIDDEN
                                                            : selected           ? STRL_PART_MARKED
                                                                                 : STRL_PART_PLAIN);
    }
}

void strl_parts_select(strl_parts *parts, uint32_t first, uint32_t count)
{
    parts->selected_first = first;
    parts->selected_count = cut_count(parts, first, count);
    change(parts);
}

void strl_parts_hide(strl_parts *parts, uint32_t first, uint32_t count, bool hide)
{
    count = cut_count(parts, first, count);
    if (count > 0)
        memset(parts->hidden + first, hide, count);
    change(parts);
}

void strl_parts_isolate(strl_parts *parts, uint32_t first, uint32_t count)
{
    count = cut_count(parts, first, count);
    if (count == 0)
        return;
    uint32_t all = parts->tree.part_count;
    bool alone = strl_parts_hidden_in(parts, first, count) == 0 && parts->hidden_count == all - count;
    memset(parts->hidden, !alone, all);
    memset(parts->hidden + first, 0, count);
    change(parts);
}

void strl_parts_show_all(strl_parts *parts)
{
    strl_parts_hide(parts, 0, parts->tree.part_count, false);
}

uint32_t strl_parts_hidden_in(const strl_parts *parts, uint32_t first, uint32_t count)
{
    uint32_t hidden = 0;
    count = cut_count(parts, first, count);
    for (uint32_t i = 0; i < count; i++)
        hidden += parts->hidden[first + i] != 0;
    return hidden;
}
