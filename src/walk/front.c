/* The cut through the trees (Quick-VDR 5.1, 5.2), found anew from the roots in each frame, level by
 * level, dependency group by dependency group. A group's error and box hold those of its children's
 * groups, so what a level decides the next one never contradicts; should a file say otherwise, a
 * group that is not complete stays coarse, and the cut is whole all the same. */
#include "walk/internal.h"

#include <math.h>
#include <string.h>

#include "base/hash.h"

/* Urgencies: records come before the nodes that they describe; what may be wanted later comes after
 * all that is wanted now. */
#define RECORDS_FIRST 4.0
#define PREFETCH_SHARE 1e-3
#define MOST_URGENT 1e30

typedef struct context {
    strl_walk *walk;
    strl__cut *cut;
    uint32_t index; /* of the placement */
    const strl__placement *placement;
    const strl_tree *tree;
    strl_error *err;
} context;

static strl_status no_memory(strl_error *err)
{
    return strl__fail(err, STRL_ERR_MEMORY, "no memory to refine the front");
}

/* ---- projected errors */

strl_box strl__world_box(const strl_tree *tree, const strl__placement *placement, const int64_t min[3],
                         const int64_t max[3])
{
    strl_box box;
    for (int row = 0; row < 3; row++) {
        const double *m = placement->transform + 4 * row;
        box.min[row] = box.max[row] = m[3];
        for (int i = 0; i < 3; i++) {
            double a = m[i] * (tree->origin[i] + tree->step * (double)min[i]);
            double b = m[i] * (tree->origin[i] + tree->step * (double)max[i]);
            box.min[row] += a < b ? a : b;
            box.max[row] += a < b ? b : a;
        }
    }
    return box;
}

static double group_px(const context *c, const strl_node *record)
{
    strl_box box = strl__world_box(c->tree, c->placement, record->group_box_min, record->group_box_max);
    double error = fmaxf(record->group_geometric, record->group_appearance);
    return strl_view_error_px(c->cut->view, &box, error * c->placement->length_scale);
}

static bool asks_itself(const context *c, const strl_node *record)
{
    strl_box box = strl__world_box(c->tree, c->placement, record->box_min, record->box_max);
    double error = fmaxf(record->geometric_min, record->appearance_min);
    return strl_view_error_px(c->cut->view, &box, error * c->placement->length_scale) > c->cut->allowed_px;
}

/* ---- lists */

static bool add_visit(strl__visits *visits, strl__node *node, bool active)
{
    if (!strl__grow(&visits->items, &visits->capacity, visits->count + 1, sizeof *visits->items))
        return false;
    visits->items[visits->count++] = (strl__visit){node, STRL_NONE, active};
    return true;
}

static bool add_node(strl__nodes *nodes, strl__node *node)
{
    if (!strl__grow(&nodes->items, &nodes->capacity, nodes->count + 1, sizeof *nodes->items))
        return false;
    nodes->items[nodes->count++] = node;
    return true;
}

static bool add_candidate(strl__candidates *candidates, strl__node *node, uint32_t treelet, double urgency)
{
    if (!strl__grow(&candidates->items, &candidates->capacity, candidates->count + 1, sizeof *candidates->items))
        return false;
    candidates->items[candidates->count++] = (strl__candidate){(float)fmin(urgency, MOST_URGENT), treelet, node};
    return true;
}

/* ---- children */

typedef enum outlook { HERE, RECORDS_ABSENT, BACKING_OFF } outlook;

/* True where a file's records contradict each other: the child is another node's. */
static bool is_foreign(const strl_node *parent, uint32_t parent_id, const strl_node *child)
{
    return child->parent != parent_id || child->level + 1 != parent->level;
}

static uint32_t id_of(const strl__node *node)
{
    return node->treelet->data.first_node + (uint32_t)(node - node->treelet->nodes);
}

static void check_child(strl_walk *walk, const strl__node *parent, strl__node *child)
{
    if (!is_foreign(parent->record, id_of(parent), child->record) || child->retry.frame > walk->frame)
        return;
    strl_error error = {0};
    strl__fail(&error, STRL_ERR_FORMAT, "tree %u: node %u is not the child of node %u that it is said to be",
               parent->treelet->tree, id_of(child), id_of(parent));
    strl__back_off(walk, &child->retry);
    strl__note_fault(walk, &error);
}

/* The records of one child, or a candidate for the treelet that has them. */
static outlook find_child(context *c, strl__node *parent, uint32_t id, double urgency, strl__candidates *to,
                          strl__node **child)
{
    strl_walk *walk = c->walk;
    *child = strl__node_find(walk, parent->treelet->tree, id);
    if (*child) {
        check_child(walk, parent, *child);
        bool waiting = (*child)->residency == STRL__ABSENT && (*child)->retry.frame > walk->frame;
        if (waiting && (*child)->retry.failures < STRL__GIVE_UP_FAILURES)
            c->cut->waits = true;
        return waiting ? BACKING_OFF : HERE;
    }
    const strl__treelet *treelet = strl__treelets_find(&walk->treelets, parent->treelet->tree, id / STRL_TREELET_NODES);
    if (treelet && treelet->residency == STRL__ABSENT && treelet->retry.frame > walk->frame) {
        c->cut->waits |= treelet->retry.failures < STRL__GIVE_UP_FAILURES;
        return BACKING_OFF;
    }
    c->cut->waits = true;
    add_candidate(to, parent, id / STRL_TREELET_NODES, urgency); /* without memory it is asked for in a later frame */
    return RECORDS_ABSENT;
}

/* Collects the children of all members in walk->children. The worst outlook of any. */
static strl_status find_children(context *c, const strl__group *group, double urgency, strl__candidates *to,
                                 outlook *worst)
{
    strl_walk *walk = c->walk;
    walk->children.count = 0;
    *worst = HERE;
    for (uint32_t i = group->first; i != STRL_NONE; i = walk->level.items[i].next) {
        strl__node *parent = walk->level.items[i].node;
        for (uint32_t k = 0; k < parent->record->child_count; k++) {
            strl__node *child;
            outlook found = find_child(c, parent, parent->record->first_child + k, urgency * RECORDS_FIRST, to, &child);
            *worst = found > *worst ? found : *worst;
            if (child && !add_node(&walk->children, child))
                return no_memory(c->err);
        }
    }
    return STRL_OK;
}

/* ---- groups */

static strl_status gather_groups(strl_walk *walk, strl_error *err)
{
    strl__groups *groups = &walk->groups;
    size_t size = 16;
    while (size < 2 * walk->level.count)
        size *= 2;
    if (!strl__grow(&groups->table, &groups->table_capacity, size, sizeof *groups->table) ||
        !strl__grow(&groups->items, &groups->capacity, walk->level.count, sizeof *groups->items))
        return no_memory(err);
    memset(groups->table, 0, size * sizeof *groups->table);
    groups->count = 0;
    for (uint32_t i = 0; i < walk->level.count; i++) {
        uint32_t id = walk->level.items[i].node->record->group;
        size_t slot = (size_t)strl__mix64(id) & (size - 1);
        while (groups->table[slot] && groups->items[groups->table[slot] - 1].id != id)
            slot = (slot + 1) & (size - 1);
        if (!groups->table[slot]) {
            groups->items[groups->count++] = (strl__group){id, i, i, 1};
            groups->table[slot] = (uint32_t)groups->count;
            continue;
        }
        strl__group *group = &groups->items[groups->table[slot] - 1];
        walk->level.items[group->last].next = i;
        group->last = i;
        group->members++;
    }
    return STRL_OK;
}

static bool is_complete(const strl_walk *walk, const strl__group *group)
{
    uint32_t size = walk->level.items[group->first].node->record->group_size;
    for (uint32_t i = group->first; i != STRL_NONE; i = walk->level.items[i].next) {
        const strl_node *record = walk->level.items[i].node->record;
        if (record->child_count == 0 || record->group_size != size)
            return false;
    }
    return group->members == size;
}

static strl_status add_active(context *c, strl__node *node)
{
    strl__front *front = &c->walk->front;
    if (!strl__grow(&front->items, &front->capacity, front->count + 1, sizeof *front->items))
        return no_memory(c->err);
    strl__active *active = &front->items[front->count++];
    *active = (strl__active){.node = node, .placement = c->index};
    active->box = strl__world_box(c->tree, c->placement, node->record->box_min, node->record->box_max);
    active->sight = strl_view_sight(c->cut->view, &active->box);
    return STRL_OK;
}

/* One level below the front is worth having (5.5.1): a split then does not wait. */
static strl_status prefetch_children(context *c, const strl__group *group, double px)
{
    strl_walk *walk = c->walk;
    outlook worst;
    double urgency = PREFETCH_SHARE * px / c->cut->allowed_px;
    bool waits = c->cut->waits; /* no frame waits for what it does not want */
    strl_status status = find_children(c, group, urgency, &walk->prefetch, &worst);
    c->cut->waits = waits;
    for (size_t i = 0; status == STRL_OK && worst == HERE && i < walk->children.count; i++) {
        strl__node *child = walk->children.items[i];
        if (child->residency == STRL__PENDING)
            child->request->touched_frame = walk->frame;
        else if (child->residency == STRL__RESIDENT ? !add_node(&walk->ahead, child)
                                                    : !add_candidate(&walk->prefetch, child, STRL_NONE, urgency))
            status = no_memory(c->err);
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

/* The group is not split: those of its members that are active are the front. `missing` of the
 * wanted nodes are not there. */
static strl_status stay(context *c, const strl__group *group, uint32_t missing)
{
    strl_walk *walk = c->walk;
    c->cut->missing += missing;
    if (c->cut->kind != STRL__CUT_FRONT)
        return STRL_OK;
    for (uint32_t i = group->first; i != STRL_NONE; i = walk->level.items[i].next) {
        const strl__visit *visit = &walk->level.items[i];
        strl_status status = visit->active ? add_active(c, visit->node) : STRL_OK;
        if (status != STRL_OK)
            return status;
    }
    return STRL_OK;
}

/* Bytes of the group's children that this traversal has not counted yet. */
static uint64_t new_bytes(const strl_walk *walk)
{
    uint64_t bytes = 0;
    for (size_t i = 0; i < walk->children.count; i++)
        if (walk->children.items[i]->counted_pass != walk->pass)
            bytes += strl_node_decoded_bytes(walk->children.items[i]->record);
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
static bool want_child(context *c, strl__node *child, double px)
{
    strl_walk *walk = c->walk;
    bool front = c->cut->kind == STRL__CUT_FRONT;
    if (c->cut->kind == STRL__CUT_PROBE)
        return true;
    if (front && !add_node(&walk->wanted, child))
        return false;
    if (child->residency == STRL__RESIDENT)
        return front || add_node(&walk->ahead, child);
    c->cut->waits = true;
    if (child->residency == STRL__PENDING) {
        child->request->touched_frame = walk->frame;
        return true;
    }
    return front ? add_candidate(&walk->missing, child, STRL_NONE, px)
                 : add_candidate(&walk->prefetch, child, STRL_NONE, PREFETCH_SHARE * px / c->cut->allowed_px);
}

static strl_status note_split(context *c, const strl__group *group)
{
    strl__splits *split = &c->walk->split;
    if (c->cut->kind != STRL__CUT_FRONT)
        return STRL_OK;
    if (!strl__grow(&split->items, &split->capacity, split->count + group->members, sizeof *split->items))
        return no_memory(c->err);
    for (uint32_t i = group->first; i != STRL_NONE; i = c->walk->level.items[i].next) {
        strl__node *node = c->walk->level.items[i].node;
        bool by_group = group->members > 1 && !asks_itself(c, node->record);
        split->items[split->count++] = (strl__split){node, by_group};
    }
    return STRL_OK;
}

/* The group is to split, and its children's records are in walk->children. */
static strl_status descend(context *c, const strl__group *group, double px)
{
    strl_walk *walk = c->walk;
    bool ready = is_ready(walk, group);
    for (size_t i = 0; i < walk->children.count; i++) {
        strl__node *child = walk->children.items[i];
        child->counted_pass = walk->pass;
        if (!want_child(c, child, px) || !add_visit(&walk->below, child, ready))
            return no_memory(c->err);
    }
    return ready ? note_split(c, group) : stay(c, group, 0);
}

static strl_status keep(context *c, const strl__group *group, bool complete, double px)
{
    bool ahead = complete && px > 0 && c->cut->kind == STRL__CUT_FRONT;
    strl_status status = ahead ? prefetch_children(c, group, px) : STRL_OK;
    return status == STRL_OK ? stay(c, group, count_inactive(c->walk, group)) : status;
}

static strl_status visit_group(context *c, const strl__group *group)
{
    strl_walk *walk = c->walk;
    strl__cut *cut = c->cut;
    bool complete = is_complete(walk, group), front = cut->kind == STRL__CUT_FRONT;
    double px = group_px(c, walk->level.items[group->first].node->record);
    if (!complete || !(px > cut->allowed_px))
        return keep(c, group, complete, px);
    outlook worst;
    strl_status status =
        find_children(c, group, front ? px : PREFETCH_SHARE * px, front ? &walk->missing : &walk->prefetch, &worst);
    if (status != STRL_OK)
        return status;
    cut->records_missing |= worst == RECORDS_ABSENT;
    if (worst != HERE)
        return stay(c, group, group->members);
    uint64_t bytes = new_bytes(walk);
    if (cut->bytes > cut->capacity_bytes || bytes > cut->capacity_bytes - cut->bytes) {
        cut->overflow = !cut->stop_at_capacity;
        return stay(c, group, count_inactive(walk, group));
    }
    cut->bytes += bytes;
    return descend(c, group, px);
}

/* ---- traversal */

static strl_status visit_levels(context *c)
{
    strl_walk *walk = c->walk;
    while (walk->level.count > 0 && !c->cut->overflow) {
        strl_status status = gather_groups(walk, c->err);
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

static strl_status visit_placement(context *c)
{
    strl_walk *walk = c->walk;
    strl__node *root = walk->trees[c->placement->tree].root;
    root->treelet->touched_frame = walk->frame;
    walk->level.count = 0;
    if (c->cut->kind == STRL__CUT_FRONT && !add_node(&walk->wanted, root))
        return no_memory(c->err);
    if (!add_visit(&walk->level, root, true))
        return no_memory(c->err);
    return visit_levels(c);
}

strl_status strl__cut_run(strl_walk *walk, strl__cut *cut, strl_error *err)
{
    walk->pass++;
    cut->bytes = walk->root_bytes;
    if (cut->kind == STRL__CUT_FRONT) {
        walk->wanted.count = walk->split.count = walk->ahead.count = 0;
        walk->missing.count = walk->prefetch.count = walk->front.count = 0;
    }
    strl_status status = STRL_OK;
    for (uint32_t i = 0; status == STRL_OK && i < walk->placement_count && !cut->overflow; i++) {
        const strl__placement *placement = &walk->placements[i];
        context c = {walk, cut, i, placement, walk->trees[placement->tree].tree, err};
        status = visit_placement(&c);
    }
    return status;
}

void strl__cut_commit(strl_walk *walk)
{
    strl_walk_stats *stats = &walk->stats;
    /* Order of age: what may be wanted soon, then what is wanted, is the youngest. */
    for (size_t i = 0; i < walk->ahead.count; i++)
        strl__node_touch(walk, walk->ahead.items[i]);
    for (size_t i = 0; i < walk->wanted.count; i++) {
        walk->wanted.items[i]->wanted_frame = walk->frame;
        strl__node_touch(walk, walk->wanted.items[i]);
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
