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
    parts->selected = strl__alloc_zero(part_count, 1);
    parts->styles = strl__alloc_zero(part_count, 1);
    parts->hidden_before = strl__alloc_zero((size_t)part_count + 1, sizeof *parts->hidden_before);
    parts->selected_before = strl__alloc_zero((size_t)part_count + 1, sizeof *parts->selected_before);
    if (parts->hidden && parts->selected && parts->styles && parts->hidden_before && parts->selected_before)
        return STRL_OK;
    strl_parts_deinit(parts);
    return strl__fail(err, STRL_ERR_MEMORY, "no memory for the styles of %u parts", part_count);
}

void strl_parts_deinit(strl_parts *parts)
{
    strl_part_tree_deinit(&parts->tree);
    strl__free(parts->hidden);
    strl__free(parts->selected);
    strl__free(parts->styles);
    strl__free(parts->hidden_before);
    strl__free(parts->selected_before);
    *parts = (strl_parts){0};
}

static uint32_t cut_count(const strl_parts *parts, uint32_t first, uint32_t count)
{
    uint32_t all = parts->tree.part_count;
    return first >= all ? 0 : count < all - first ? count : all - first;
}

static void change(strl_parts *parts)
{
    uint32_t all = parts->tree.part_count;
    for (uint32_t place = 0; place < all; place++) {
        bool hidden = parts->hidden[place], selected = parts->selected[place];
        parts->hidden_before[place + 1] = parts->hidden_before[place] + hidden;
        parts->selected_before[place + 1] = parts->selected_before[place] + selected;
        parts->styles[parts->tree.order[place]] = (uint8_t)(hidden     ? STRL_PART_HIDDEN
                                                            : selected ? STRL_PART_MARKED
                                                                       : STRL_PART_PLAIN);
    }
    parts->hidden_count = parts->hidden_before[all];
    parts->selected_count = parts->selected_before[all];
    parts->version++;
}

void strl_parts_select(strl_parts *parts, uint32_t first, uint32_t count)
{
    count = cut_count(parts, first, count);
    memset(parts->selected, 0, parts->tree.part_count);
    if (count > 0)
        memset(parts->selected + first, 1, count);
    change(parts);
}

void strl_parts_select_found(strl_parts *parts)
{
    for (uint32_t place = 0; place < parts->tree.part_count; place++)
        parts->selected[place] = strl_part_tree_found_in(&parts->tree, place, 1) > 0;
    change(parts);
}

void strl_parts_hide(strl_parts *parts, uint32_t first, uint32_t count, bool hide)
{
    count = cut_count(parts, first, count);
    if (count > 0)
        memset(parts->hidden + first, hide, count);
    change(parts);
}

void strl_parts_hide_selected(strl_parts *parts, bool hide)
{
    for (uint32_t place = 0; place < parts->tree.part_count; place++)
        if (parts->selected[place])
            parts->hidden[place] = hide;
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

void strl_parts_isolate_selected(strl_parts *parts)
{
    uint32_t all = parts->tree.part_count;
    bool alone = parts->hidden_count == all - parts->selected_count;
    for (uint32_t place = 0; place < all; place++)
        alone = alone && !(parts->hidden[place] && parts->selected[place]);
    for (uint32_t place = 0; parts->selected_count > 0 && place < all; place++)
        parts->hidden[place] = !alone && !parts->selected[place];
    change(parts);
}

void strl_parts_show_all(strl_parts *parts)
{
    strl_parts_hide(parts, 0, parts->tree.part_count, false);
}

uint32_t strl_parts_hidden_in(const strl_parts *parts, uint32_t first, uint32_t count)
{
    count = cut_count(parts, first, count);
    return count > 0 ? parts->hidden_before[first + count] - parts->hidden_before[first] : 0;
}

uint32_t strl_parts_selected_in(const strl_parts *parts, uint32_t first, uint32_t count)
{
    count = cut_count(parts, first, count);
    return count > 0 ? parts->selected_before[first + count] - parts->selected_before[first] : 0;
}

uint32_t strl_parts_first_selected(const strl_parts *parts)
{
    const uint8_t *found = parts->selected_count > 0 ? memchr(parts->selected, 1, parts->tree.part_count) : NULL;
    return found ? (uint32_t)(found - parts->selected) : UINT32_MAX;
}
