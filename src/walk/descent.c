#include "walk/descent.h"

#include <math.h>
#include <string.h>

#include "base/hash.h"

/* Urgencies: records come before the nodes that they describe. */
#define RECORDS_FIRST 4.0
#define MOST_URGENT 1e30

strl_status strl__no_memory(strl_error *err)
{
    return strl__fail(err, STRL_ERR_MEMORY, "no memory to refine the front");
}

/* ---- projected errors */

strl_box strl__world_box(const strl_tree *tree, const strl__placement *placement, const int64_t min[3],
                         const int64_t max[3])
{
    strl_box box;
    strl_placed_box(tree, placement->transform, min, max, box.min, box.max);
    return box;
}

double strl__group_px(const strl__descent *c, const strl_node *record)
{
    strl_box box = strl__world_box(c->tree, c->placement, record->group_box_min, record->group_box_max);
    double error = fmaxf(record->group_geometric, record->group_appearance);
    return strl_view_error_px(c->cut->view, &box, error * c->placement->length_scale) /
           strl__splat_ratio(c->walk, c->tree);
}

bool strl__asks_itself(const strl__descent *c, const strl_node *record)
{
    strl_box box = strl__world_box(c->tree, c->placement, record->box_min, record->box_max);
    double error = fmaxf(record->geometric_min, record->appearance_min);
    return strl_view_error_px(c->cut->view, &box, error * c->placement->length_scale) /
               strl__splat_ratio(c->walk, c->tree) >
           c->cut->allowed_px;
}

/* ---- lists */

bool strl__add_visit(strl__visits *visits, strl__node *node, bool active)
{
    if (!strl__grow(&visits->items, &visits->capacity, visits->count + 1, sizeof *visits->items))
        return false;
    visits->items[visits->count++] = (strl__visit){node, STRL_NONE, STRL_NONE, active};
    return true;
}

bool strl__add_node(strl__nodes *nodes, strl__node *node)
{
    if (!strl__grow(&nodes->items, &nodes->capacity, nodes->count + 1, sizeof *nodes->items))
        return false;
    nodes->items[nodes->count++] = node;
    return true;
}

bool strl__add_candidate(strl__candidates *candidates, strl__node *node, uint32_t treelet, double urgency)
{
    if (!strl__grow(&candidates->items, &candidates->capacity, candidates->count + 1, sizeof *candidates->items))
        return false;
    candidates->items[candidates->count++] = (strl__candidate){(float)fmin(urgency, MOST_URGENT), treelet, node, NULL};
    return true;
}

double strl__reserve(const strl_walk *walk)
{
    return walk->is_tight ? STRL__LEAST_RESERVE : STRL__RESERVE;
}

float strl__closed_size(const strl_walk *walk, const strl_tree *tree, const strl_sight *sight, double length_scale,
                        double allowed_px, double reserve)
{
    return (float)(strl_sight_error_of(sight, allowed_px * strl__splat_ratio(walk, tree)) / length_scale * reserve);
}

/* The same of a box beside the image: as it is seen by who turns round. */
static double size_beside(const strl_view *view, const strl_box *box, double px)
{
    double square = 0;
    for (int k = 0; k < 3; k++) {
        double way = fmax(0, fmax(box->min[k] - view->eye[k], view->eye[k] - box->max[k]));
        square += way * way;
    }
    return view->orthographic ? px / view->focal_px
                              : px * sqrt(square) / (view->focal_px * view->corner * view->corner);
}

float strl__closed_size_of(const strl__descent *c, const strl__node *child, double reserve)
{
    if (!strl__opens_partly(c->walk, child))
        return 0;
    const strl_box box = strl__world_box(c->tree, c->placement, child->record->box_min, child->record->box_max);
    const strl_sight sight = strl_view_sight(c->cut->view, &box);
    const double px = c->cut->allowed_px * strl__splat_ratio(c->walk, c->tree);
    return sight.empty
               ? (float)(size_beside(c->cut->view, &box, px) / c->placement->length_scale * reserve)
               : strl__closed_size(c->walk, c->tree, &sight, c->placement->length_scale, c->cut->allowed_px, reserve);
}

void strl__note_size(const strl__descent *c, strl__node *child)
{
    child->closed_size = strl__closed_size_of(c, child, strl__reserve(c->walk));
}

bool strl__ask_for_child(const strl__descent *c, strl__node *child, strl__candidates *candidates, double urgency)
{
    strl__note_size(c, child);
    return strl__add_candidate(candidates, child, STRL_NONE, urgency);
}

bool strl__add_run(strl__candidates *candidates, strl__run *run, double px)
{
    if (!strl__add_candidate(candidates, NULL, STRL_NONE, px * RECORDS_FIRST))
        return false;
    candidates->items[candidates->count - 1].run = run;
    return true;
}

/* ---- children */

static uint32_t id_of(const strl__node *node)
{
    return node->treelet->data.first_node + (uint32_t)(node - node->treelet->nodes);
}

/* True where a file's records contradict each other: the child is another node's. */
static bool is_foreign(const strl__node *parent, const strl__node *child)
{
    return child->record->parent != id_of(parent) || child->record->level + 1 != parent->record->level;
}

static void note_foreign(strl_walk *walk, const strl__node *parent, strl__node *child)
{
    if (strl__is_waiting(walk, &child->retry))
        return;
    strl_error error = {0};
    strl__fail(&error, STRL_ERR_FORMAT, "tree %u: node %u is not the child of node %u that it is said to be",
               parent->treelet->tree, id_of(child), id_of(parent));
    strl__back_off(walk, &child->retry, false);
    strl__note_fault(walk, &error);
}

/* Pages are the unit of reading: of one that is read now, what may be seen after the next step need not be read again.
 */
static void leave_out(strl__descent *c, strl__node *child)
{
    bool may_come = c->cut->kind == STRL__CUT_FRONT && child->residency == STRL__ABSENT &&
                    !strl__is_waiting(c->walk, &child->retry);
    c->turned_away++;
    if (may_come) /* without memory it does not */
        strl__ask_for_child(c, child, &c->walk->along, 0);
}

/* The records of one child, or a candidate for the treelet that has them. Another node's child is
 * withheld: a node is then met at most once in a descent, whatever a file says. */
static strl__outlook find_child(strl__descent *c, strl__node *parent, uint32_t id, double urgency, strl__candidates *to,
                                strl__node **child)
{
    strl_walk *walk = c->walk;
    *child = strl__node_find(walk, parent->treelet->tree, id);
    if (*child && is_foreign(parent, *child)) {
        note_foreign(walk, parent, *child);
        *child = NULL;
        return STRL__BACKING_OFF;
    }
    /* The place for occlusion too: what is known to be hidden is left out here in the same way, of trees that add
     * alone, because of one that replaces a group needs all its children. */
    if (*child && strl__faces_away(&c->facing, (*child)->record)) {
        leave_out(c, *child);
        *child = NULL;
        return STRL__HERE;
    }
    if (*child) {
        bool waiting = (*child)->residency == STRL__ABSENT && strl__is_waiting(walk, &(*child)->retry);
        if (waiting && !strl__is_given_up(walk, &(*child)->retry))
            c->cut->waits = true;
        return waiting ? STRL__BACKING_OFF : STRL__HERE;
    }
    const strl__treelet *treelet = strl__treelets_find(&walk->treelets, parent->treelet->tree, id / STRL_TREELET_NODES);
    if (treelet && treelet->residency == STRL__ABSENT && strl__is_waiting(walk, &treelet->retry)) {
        c->cut->waits |= !strl__is_given_up(walk, &treelet->retry);
        return STRL__BACKING_OFF;
    }
    c->cut->waits = true;
    /* without memory it is asked for in a later frame */
    strl__add_candidate(to, parent, id / STRL_TREELET_NODES, urgency);
    return STRL__RECORDS_ABSENT;
}

strl_status strl__find_children(strl__descent *c, const strl__group *group, double urgency, strl__candidates *to,
                                strl__outlook *worst)
{
    strl_walk *walk = c->walk;
    walk->children.count = 0;
    c->turned_away = 0;
    *worst = STRL__HERE;
    for (uint32_t i = group->first; i != STRL_NONE; i = walk->level.items[i].next) {
        strl__node *parent = walk->level.items[i].node;
        for (uint32_t k = 0; k < parent->record->child_count; k++) {
            strl__node *child;
            uint32_t id = parent->record->first_child + k;
            strl__outlook found = find_child(c, parent, id, urgency * RECORDS_FIRST, to, &child);
            *worst = found > *worst ? found : *worst;
            if (child && !strl__add_node(&walk->children, child))
                return strl__no_memory(c->err);
        }
    }
    return STRL_OK;
}

/* ---- groups */

strl_status strl__gather_groups(strl_walk *walk, strl_error *err)
{
    strl__groups *groups = &walk->groups;
    size_t size = 16;
    while (size < 2 * walk->level.count)
        size *= 2;
    if (!strl__grow(&groups->table, &groups->table_capacity, size, sizeof *groups->table) ||
        !strl__grow(&groups->items, &groups->capacity, walk->level.count, sizeof *groups->items))
        return strl__no_memory(err);
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

bool strl__is_complete(const strl_walk *walk, const strl__group *group)
{
    uint32_t size = walk->level.items[group->first].node->record->group_size;
    for (uint32_t i = group->first; i != STRL_NONE; i = walk->level.items[i].next) {
        const strl_node *record = walk->level.items[i].node->record;
        if (record->child_count == 0 || record->group_size != size)
            return false;
    }
    return group->members == size;
}
