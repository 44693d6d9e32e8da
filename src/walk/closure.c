/* Which groups split: the closure of what single nodes ask for (Quick-VDR 4.3 and 5.1, forced splits).
 *
 * A node that is too coarse asks for its group; a group that splits needs all its members, so the
 * groups of its members' parents must have split too, and so on up to the root. A group's error and
 * box in the file bound everything at and below it: they say where to look, but they grow with every
 * level, and to split by them alone would draw far more than anybody asked for. So a descent by
 * these bounds first notes who asks for themselves, and what they need above them is then marked
 * from the finest level up. */
#include <string.h>

#include "base/hash.h"
#include "walk/descent.h"

static bool add_demand(strl__demands *demands, uint32_t group, bool asked)
{
    if (!strl__grow(&demands->items, &demands->capacity, demands->count + 1, sizeof *demands->items))
        return false;
    demands->items[demands->count++] = (strl__demand){group, asked};
    return true;
}

static bool add_need(strl__demands *demands, uint32_t above, uint32_t below)
{
    if (!strl__grow(&demands->needs, &demands->need_capacity, demands->need_count + 1, sizeof *demands->needs))
        return false;
    demands->needs[demands->need_count++] = (strl__need){above, below};
    return true;
}

/* Notes the group's demand, and that it needs the groups above its members. */
static strl_status note_group(strl__descent *c, const strl__group *group)
{
    strl_walk *walk = c->walk;
    strl__demands *demands = &walk->demands;
    uint32_t index = demands->count;
    bool asked = false;
    for (uint32_t i = group->first; i != STRL_NONE; i = walk->level.items[i].next) {
        const strl__visit *visit = &walk->level.items[i];
        asked = asked || strl__asks_itself(c, visit->node->record);
        if (visit->above != STRL_NONE && !add_need(demands, visit->above, index))
            return strl__no_memory(c->err);
    }
    return add_demand(demands, group->id, asked) ? STRL_OK : strl__no_memory(c->err);
}

static strl_status explore_group(strl__descent *c, const strl__group *group)
{
    strl_walk *walk = c->walk;
    if (!strl__is_complete(walk, group))
        return STRL_OK;
    double px = strl__group_px(c, walk->level.items[group->first].node->record);
    if (!(px > c->cut->allowed_px))
        return STRL_OK;
    strl__outlook worst;
    bool front = c->cut->kind == STRL__CUT_FRONT;
    strl_status status = note_group(c, group);
    if (status == STRL_OK)
        status = strl__find_children(c, group, px, front ? &walk->missing : &walk->prefetch, &worst);
    if (status != STRL_OK)
        return status;
    c->cut->records_missing |= worst == STRL__RECORDS_ABSENT;
    /* where some children are absent, their groups are not complete */
    for (size_t i = 0; i < walk->children.count; i++) {
        if (!strl__add_visit(&walk->below, walk->children.items[i], false))
            return strl__no_memory(c->err);
        walk->below.items[walk->below.count - 1].above = walk->demands.count - 1;
    }
    return STRL_OK;
}

/* A need's upper group was noted before its lower one: from the last need up, every demand is final
 * when it is passed on. */
static bool close_upward(strl__demands *demands)
{
    for (size_t i = demands->need_count; i-- > 0;)
        if (demands->items[demands->needs[i].below].asked)
            demands->items[demands->needs[i].above].asked = true;
    size_t size = 16;
    while (size < 2 * (size_t)demands->count)
        size *= 2;
    if (!strl__grow(&demands->table, &demands->table_capacity, size, sizeof *demands->table))
        return false;
    memset(demands->table, 0, size * sizeof *demands->table);
    demands->table_mask = size - 1;
    for (uint32_t i = 0; i < demands->count; i++) {
        size_t slot = (size_t)strl__mix64(demands->items[i].group) & demands->table_mask;
        while (demands->table[slot])
            slot = (slot + 1) & demands->table_mask;
        demands->table[slot] = i + 1;
    }
    return true;
}

bool strl__is_asked_for(const strl_walk *walk, uint32_t group)
{
    const strl__demands *demands = &walk->demands;
    size_t slot = (size_t)strl__mix64(group) & demands->table_mask;
    while (demands->table[slot] && demands->items[demands->table[slot] - 1].group != group)
        slot = (slot + 1) & demands->table_mask;
    return demands->table[slot] && demands->items[demands->table[slot] - 1].asked;
}

strl_status strl__find_demands(strl__descent *c, strl__node *root)
{
    strl_walk *walk = c->walk;
    strl_status status = STRL_OK;
    walk->demands.count = 0;
    walk->demands.need_count = 0;
    walk->level.count = 0;
    if (!strl__add_visit(&walk->level, root, true))
        return strl__no_memory(c->err);
    while (status == STRL_OK && walk->level.count > 0) {
        status = strl__gather_groups(walk, c->err);
        walk->below.count = 0;
        for (size_t i = 0; status == STRL_OK && i < walk->groups.count; i++)
            status = explore_group(c, &walk->groups.items[i]);
        strl__visits done = walk->level;
        walk->level = walk->below;
        walk->below = done;
    }
    walk->level.count = 0;
    return status != STRL_OK || close_upward(&walk->demands) ? status : strl__no_memory(c->err);
}
