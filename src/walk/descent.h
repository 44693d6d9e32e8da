/* Going down a tree level by level, group by group: what the traversals of front.c and closure.c share. */
#ifndef STRL_WALK_DESCENT_H
#define STRL_WALK_DESCENT_H

#include "walk/facing.h"

typedef struct strl__descent {
    strl_walk *walk;
    strl__cut *cut;
    uint32_t index; /* of the placement */
    const strl__placement *placement;
    const strl_tree *tree;
    strl__facing facing;
    uint32_t turned_away; /* children that the last strl__find_children left out */
    strl_error *err;
} strl__descent;

/* What keeps a group's children away, the worst last. */
typedef enum strl__outlook { STRL__HERE, STRL__RECORDS_ABSENT, STRL__BACKING_OFF } strl__outlook;

strl_status strl__no_memory(strl_error *err);
/* An upper bound of what any group at or below this member's may ask for, in pixels. */
double strl__group_px(const strl__descent *c, const strl_node *record);
/* Whether even the node's finest state is too coarse. */
bool strl__asks_itself(const strl__descent *c, const strl_node *record);

/* False without memory. */
bool strl__add_visit(strl__visits *visits, strl__node *node, bool active);
bool strl__add_node(strl__nodes *nodes, strl__node *node);
bool strl__add_candidate(strl__candidates *candidates, strl__node *node, uint32_t treelet, double urgency);
/* Cells need not be opened that are so much smaller than what is allowed to be seen, so that the first steps nearer
 * find what they want: a whole level more, or as much as costs little. */
#define STRL__RESERVE 0.5
#define STRL__LEAST_RESERVE 0.84
double strl__reserve(const strl_walk *walk);
/* What the node's closed_size is for the view; 0 of one that is not opened partly. */
float strl__closed_size_of(const strl__descent *c, const strl__node *child, double reserve);
/* The same for a sight of it. */
float strl__closed_size(const strl_walk *walk, const strl_tree *tree, const strl_sight *sight, double length_scale,
                        double allowed_px, double reserve);
void strl__note_size(const strl__descent *c, strl__node *child); /* sets it, for what is asked for */
/* A candidate, and how much of it is to be opened. */
bool strl__ask_for_child(const strl__descent *c, strl__node *child, strl__candidates *candidates, double urgency);
bool strl__add_run(strl__candidates *candidates, strl__run *run, double px);

/* The groups of walk->level into walk->groups, their members chained. */
strl_status strl__gather_groups(strl_walk *walk, strl_error *err);
/* All members are at this level, and none is a leaf. */
bool strl__is_complete(const strl_walk *walk, const strl__group *group);
/* Collects the children of all members whose records are here in walk->children, but those of which nothing can be
 * seen; absent records become candidates in `to`. *worst: the worst outlook of any. */
strl_status strl__find_children(strl__descent *c, const strl__group *group, double urgency, strl__candidates *to,
                                strl__outlook *worst);

/* closure.c: the groups of a placement that must split for its view, found by their bounds from the root down. */
strl_status strl__find_demands(strl__descent *c, strl__node *root);
/* What the last strl__find_demands said of a group. */
bool strl__is_asked_for(const strl_walk *walk, uint32_t group);

#endif
