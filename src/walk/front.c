/* The cut through the trees (Quick-VDR 5.1, 5.2), found anew from the roots in each frame, level by
 * level, dependency group by dependency group. What a level decides the next one never contradicts
 * (closure.c); should a file's bounds be wrong, a group that is not complete stays coarse, and the cut
 * is whole all the same. */
#include "walk/descent.h"

#include <math.h>

static strl_status add_active(strl__descent *c, strl__node *node, bool open)
{
    strl__front *front = &c->walk->front;
    if (!strl__grow(&front->items, &front->capacity, front->count + 1, sizeof *front->items))
        return strl__no_memory(c->err);
    strl__active *active = &front->items[front->count++];
    *active = (strl__active){.node = node, .placement = c->index, .placed = c->placement, .open = open};
    active->box = strl__world_box(c->tree, c->placement, node->record->box_min, node->record->box_max);
    active->sight = strl_view_sight(c->cut->view, &active->box);
    return STRL_OK;
}

/* One level below the front is worth having (5.5.1): a split then does not wait. */
static strl_status prefetch_children(strl__descent *c, const strl__group *group, double px)
{
    strl_walk *walk = c->walk;
    strl__outlook worst;
    double urgency = STRL__PREFETCH_SHARE * px / c->cut->allowed_px;
    if (urgency < walk->prefetch_floor)
        return STRL_OK;
    bool waits = c->cut->waits; /* no frame waits for what it does not want */
    strl_status status = strl__find_children(c, group, urgency, &walk->prefetch, &worst);
    c->cut->waits = waits;
    for (size_t i = 0; status == STRL_OK && worst == STRL__HERE && i < walk->children.count; i++) {
        strl__node *child = walk->children.items[i];
        if (child->residency == STRL__PENDING)
            child->request->touched_frame = walk->frame;
        else if (child->residency == STRL__RESIDENT ? !strl__add_node(&walk->ahead, child)
                                                    : !strl__ask_for_child(c, child, &walk->prefetch, urgency))
            status = strl__no_memory(c->err);
    }
    return status;
}

static uint32_t count_inactive(const strl_walk *walk, const strl__group *group)
{
    uint32_t inactive = 0;
    for (uint32_t i = group->first; i != STRL_NONE; i = walk->level.items[i].next)
        inactive += !walk->level.items[i].active;
    return inactive;
}

static strl_status add_members(strl__descent *c, const strl__group *group, bool open)
{
    strl_walk *walk = c->walk;
    if (c->cut->kind != STRL__CUT_FRONT)
        return STRL_OK;
    for (uint32_t i = group->first; i != STRL_NONE; i = walk->level.items[i].next) {
        const strl__visit *visit = &walk->level.items[i];
        strl_status status = visit->active ? add_active(c, visit->node, open) : STRL_OK;
        if (status != STRL_OK)
            return status;
    }
    return STRL_OK;
}

/* The group is not split: those of its members that are active are the front. `missing` of the
 * wanted nodes are not there. */
static strl_status stay(strl__descent *c, const strl__group *group, uint32_t missing)
{
    c->cut->missing += missing;
    return add_members(c, group, false);
}

/* Whether the states that are held of it do. */
static bool suffices(const strl__descent *c, const strl__node *child)
{
    const strl__mesh *mesh = &child->mesh;
    if (mesh->held == mesh->step_count)
        return true;
    const strl_box box = strl__world_box(c->tree, c->placement, child->record->box_min, child->record->box_max);
    double px = strl_view_error_px(c->cut->view, &box, mesh->errors[mesh->held] * c->placement->length_scale);
    return px / strl__splat_ratio(c->walk, c->tree) <= c->cut->allowed_px;
}

/* What is to come of a brick that may be opened partly is estimated by those that came. Any of them needs the room, for
 * a moment, to be decoded as a whole. What it holds beyond its need does not count: it goes as soon as room is wanted.
 */
static uint64_t child_bytes(const strl__descent *c, const strl__node *child)
{
    bool is_here = child->residency == STRL__RESIDENT, opens_partly = strl__opens_partly(c->walk, child);
    uint64_t held = strl__node_held_bytes(c->walk, child), whole = strl__node_bytes(child->record, c->walk->labels);
    if (!opens_partly || (is_here && !c->walk->is_tight))
        return held;
    float closed_size = strl__closed_size_of(c, child, STRL__LEAST_RESERVE);
    if (is_here && suffices(c, child))
        return held - strl__node_excess(c->walk, child, closed_size);
    c->cut->slack_bytes = whole > c->cut->slack_bytes ? whole : c->cut->slack_bytes;
    uint64_t expected = strl__expected_bytes(c->walk, child, closed_size);
    return is_here && held > expected ? held : expected;
}

/* Bytes of the group's children that this traversal has not counted yet. */
static uint64_t new_bytes(const strl__descent *c)
{
    const strl_walk *walk = c->walk;
    uint64_t bytes = 0;
    for (size_t i = 0; i < walk->children.count; i++)
        if (walk->children.items[i]->counted_pass != walk->pass)
            bytes += child_bytes(c, walk->children.items[i]);
    return bytes;
}

static bool is_ready(const strl_walk *walk, const strl__group *group)
{
    for (uint32_t i = group->first; i != STRL_NONE; i = walk->level.items[i].next)
        if (!walk->level.items[i].active)
            return false;
    for (size_t i = 0; i < walk->children.count; i++)
        if (walk->children.items[i]->residency != STRL__RESIDENT)
            return false;
    return true;
}

/* What the cut does with a child besides descending into it. */
static bool want_child(strl__descent *c, strl__node *child, double px)
{
    strl_walk *walk = c->walk;
    bool front = c->cut->kind == STRL__CUT_FRONT;
    if (c->cut->kind == STRL__CUT_PROBE)
        return true;
    if (front && !strl__add_node(&walk->wanted, child))
        return false;
    if (child->residency == STRL__RESIDENT) {
        if (front && walk->is_tight && !child->request)
            child->closed_size = strl__closed_size_of(c, child, STRL__LEAST_RESERVE);
        return front || strl__add_node(&walk->ahead, child);
    }
    c->cut->waits = true;
    if (child->residency == STRL__PENDING) {
        child->request->touched_frame = walk->frame;
        if (front)
            strl__note_size(c, child);
        return true;
    }
    return front ? strl__ask_for_child(c, child, &walk->missing, px)
                 : strl__ask_for_child(c, child, &walk->prefetch, STRL__PREFETCH_SHARE * px / c->cut->allowed_px);
}

static strl_status note_split(strl__descent *c, const strl__group *group)
{
    strl__splits *split = &c->walk->split;
    if (c->cut->kind != STRL__CUT_FRONT)
        return STRL_OK;
    if (!strl__grow(&split->items, &split->capacity, split->count + group->members, sizeof *split->items))
        return strl__no_memory(c->err);
    for (uint32_t i = group->first; i != STRL_NONE; i = c->walk->level.items[i].next) {
        strl__node *node = c->walk->level.items[i].node;
        bool by_group = group->members > 1 && !strl__asks_itself(c, node->record);
        split->items[split->count++] = (strl__split){node, by_group};
    }
    return STRL_OK;
}

/* The group is to split, and its children's records are in walk->children. */
static strl_status descend(strl__descent *c, const strl__group *group, double px)
{
    strl_walk *walk = c->walk;
    bool ready = is_ready(walk, group);
    c->cut->backfacing += c->turned_away;
    for (size_t i = 0; i < walk->children.count; i++) {
        strl__node *child = walk->children.items[i];
        child->counted_pass = walk->pass;
        if (!want_child(c, child, px) || !strl__add_visit(&walk->below, child, ready))
            return strl__no_memory(c->err);
    }
    if (!ready)
        return stay(c, group, 0);
    /* drawn with what is below */
    strl_status status = c->tree->structure == STRL_STRUCTURE_SAMPLES ? add_members(c, group, true) : STRL_OK;
    return status ? status : note_split(c, group);
}

static strl_status keep(strl__descent *c, const strl__group *group, bool complete, double px)
{
    bool ahead = complete && px > 0 && c->cut->kind == STRL__CUT_FRONT;
    strl_status status = ahead ? prefetch_children(c, group, px) : STRL_OK;
    return status == STRL_OK ? stay(c, group, count_inactive(c->walk, group)) : status;
}

static strl_status visit_group(strl__descent *c, const strl__group *group)
{
    strl_walk *walk = c->walk;
    strl__cut *cut = c->cut;
    bool complete = strl__is_complete(walk, group), front = cut->kind == STRL__CUT_FRONT;
    double px = strl__group_px(c, walk->level.items[group->first].node->record);
    if (!complete || !strl__is_asked_for(walk, walk->level.items[group->first].node->record->group))
        return keep(c, group, complete, px);
    strl__outlook worst;
    strl_status status = strl__find_children(c, group, front ? px : STRL__PREFETCH_SHARE * px,
                                             front ? &walk->missing : &walk->prefetch, &worst);
    if (status != STRL_OK)
        return status;
    cut->records_missing |= worst == STRL__RECORDS_ABSENT;
    if (worst != STRL__HERE)
        return stay(c, group, group->members);
    uint64_t slack = cut->slack_bytes, bytes = new_bytes(c), taken = cut->bytes + cut->slack_bytes;
    if (taken > cut->capacity_bytes || bytes > cut->capacity_bytes - taken) {
        cut->overflow = !cut->stop_at_capacity;
        cut->slack_bytes = slack; /* they do not come */
        return stay(c, group, count_inactive(walk, group));
    }
    cut->bytes += bytes;
    return descend(c, group, px);
}

/* ---- traversal */

static strl_status visit_levels(strl__descent *c)
{
    strl_walk *walk = c->walk;
    while (walk->level.count > 0 && !c->cut->overflow) {
        strl_status status = strl__gather_groups(walk, c->err);
        walk->below.count = 0;
        for (size_t i = 0; status == STRL_OK && i < walk->groups.count && !c->cut->overflow; i++)
            status = visit_group(c, &walk->groups.items[i]);
        if (status != STRL_OK)
            return status;
        strl__visits done = walk->level;
        walk->level = walk->below;
        walk->below = done;
    }
    return STRL_OK;
}

static strl_status visit_placement(strl__descent *c)
{
    strl_walk *walk = c->walk;
    strl__node *root = walk->trees[c->placement->tree].root;
    if (strl__faces_away(&c->facing, root->record)) {
        c->cut->backfacing++;
        return STRL_OK;
    }
    strl_status status = strl__find_demands(c, root);
    if (status != STRL_OK)
        return status;
    if (!strl__add_visit(&walk->level, root, true))
        return strl__no_memory(c->err);
    return visit_levels(c);
}

/* Roots stay, seen or not: what comes into view is never missing. */
static strl_status keep_roots(strl_walk *walk, const strl__cut *cut, strl_error *err)
{
    for (uint32_t tree = 0; tree < walk->tree_count; tree++) {
        strl__node *root = walk->trees[tree].root;
        if (!root)
            continue;
        root->treelet->touched_frame = walk->frame;
        if (cut->kind == STRL__CUT_FRONT && !strl__add_node(&walk->wanted, root))
            return strl__no_memory(err);
    }
    return STRL_OK;
}

strl_status strl__cut_run(strl_walk *walk, strl__cut *cut, strl_error *err)
{
    walk->pass++;
    cut->bytes = walk->root_bytes;
    if (cut->kind == STRL__CUT_FRONT) {
        walk->wanted.count = walk->split.count = walk->ahead.count = 0;
        walk->missing.count = walk->prefetch.count = walk->along.count = walk->front.count = walk->wanted_runs.count =
            0;
        for (unsigned size = 0; size < STRL__FAR_SIZES; size++)
            walk->far[size].count = 0, walk->far[size].px = 0;
        walk->far_far = 0;
        walk->fill_work = STRL__FILL_WORK;
    }
    strl_status status = keep_roots(walk, cut, err);
    uint32_t i = 0;
    for (;; i++) {
        const strl__placement *placement = NULL;
        if (status == STRL_OK)
            status = strl__placements_next(walk, cut, i, &i, &placement, err);
        if (status != STRL_OK || !placement || cut->overflow)
            break;
        const strl_tree *tree = walk->trees[placement->tree].tree;
        strl__descent c = {.walk = walk, .cut = cut, .index = i, .placement = placement, .tree = tree, .err = err};
        if (walk->cull == STRL_CULL_BACK)
            c.facing = strl__facing_find(cut->view, tree, placement->transform);
        status = visit_placement(&c);
    }
    return status;
}

void strl__cut_commit(strl_walk *walk)
{
    strl_walk_stats *stats = &walk->stats;
    walk->looked_at = 0;
    /* Order of age: what may be wanted soon, then what is wanted, is the youngest. */
    for (size_t i = 0; i < walk->ahead.count; i++)
        strl__node_touch(walk, walk->ahead.items[i]);
    for (size_t i = 0; i < walk->wanted.count; i++) {
        walk->wanted.items[i]->wanted_frame = walk->frame;
        strl__node_touch(walk, walk->wanted.items[i]);
    }
    for (size_t i = 0; i < walk->wanted_runs.count; i++) {
        walk->wanted_runs.items[i]->wanted_frame = walk->frame;
        strl__run_touch(walk, walk->wanted_runs.items[i]);
    }
    for (size_t i = 0; i < walk->split.count; i++) {
        strl__node *node = walk->split.items[i].node;
        bool began = node->split_frame + 1 != walk->frame && node->split_frame != walk->frame;
        stats->splits += began;
        stats->dependent_splits += began && walk->split.items[i].by_group;
        node->split_frame = walk->frame;
    }
    for (size_t i = 0; i < walk->split_before.count; i++) {
        strl__node *node = walk->split_before.items[i].node;
        bool ended = node->split_frame + 1 == walk->frame;
        stats->collapses += ended;
        stats->dependent_collapses += ended && walk->split_before.items[i].by_group;
    }
    strl__splits done = walk->split_before;
    walk->split_before = walk->split;
    walk->split = done;
}
