/* What the visitor asks for, by key or by the panels. */
#ifndef STRL_VIEWER_ACTION_H
#define STRL_VIEWER_ACTION_H

#include <stdint.h>

typedef enum strl_action {
    STRL_ACTION_ORBIT,
    STRL_ACTION_FLY,
    STRL_ACTION_WALK,
    STRL_ACTION_ORTHOGRAPHIC, /* and back */
    STRL_ACTION_HOME,
    STRL_ACTION_RESET,
    STRL_ACTION_LOOK, /* at the selection */
    STRL_ACTION_NO_COLOURS,
    STRL_ACTION_CLUSTER_COLOURS,
    STRL_ACTION_LEVEL_COLOURS,
    STRL_ACTION_ERROR_COLOURS,
    STRL_ACTION_WIREFRAME,
    STRL_ACTION_FLAT,
    STRL_ACTION_FREEZE,
    STRL_ACTION_COARSER,
    STRL_ACTION_FINER,
    STRL_ACTION_BUDGETS, /* as the controls have them from now on */
    STRL_ACTION_SCREENSHOT,
    STRL_ACTION_FORGET_PICKS,
    STRL_ACTION_PARTS,  /* shows and hides the list */
    STRL_ACTION_SELECT, /* index: a node of the part tree, or STRL_ACTION_FOUND */
    STRL_ACTION_OPEN_NODE,
    STRL_ACTION_HIDE, /* index: a node, STRL_ACTION_SELECTION = what is selected */
    STRL_ACTION_SHOW,
    STRL_ACTION_ISOLATE,
    STRL_ACTION_SHOW_ALL,
    STRL_ACTION_SECTION,      /* on and off */
    STRL_ACTION_SECTION_AXIS, /* index: 0 to 2 */
    STRL_ACTION_SECTION_NORMAL,
    STRL_ACTION_SECTION_POINTS,
    STRL_ACTION_SECTION_FLIP,
    STRL_ACTION_SECTION_FORTH,
    STRL_ACTION_SECTION_BACK,
    STRL_ACTION_BOOKMARK, /* named as the controls say */
    STRL_ACTION_NEXT_BOOKMARK,
    STRL_ACTION_GO_BOOKMARK, /* index */
    STRL_ACTION_DROP_BOOKMARK,
    STRL_ACTION_RECORD, /* begins and ends */
    STRL_ACTION_REPLAY,
    STRL_ACTION_CANCEL_BUILD,
    STRL_ACTION_BUILD_AGAIN,
    STRL_ACTION_HELP,
    STRL_ACTION_QUIT
} strl_action;

#define STRL_ACTION_SELECTION UINT32_MAX
#define STRL_ACTION_FOUND (UINT32_MAX - 1) /* all that the search has found */
#define STRL_MOST_REQUESTS 32u

typedef struct strl_request {
    strl_action action;
    uint32_t index; /* where the action has one */
} strl_request;

/* Of one frame, in order; what does not fit is lost. */
typedef struct strl_requests {
    strl_request items[STRL_MOST_REQUESTS];
    uint32_t count;
} strl_requests;

static inline void strl_requests_add(strl_requests *requests, strl_action action, uint32_t index)
{
    if (requests->count >= STRL_MOST_REQUESTS)
        return;
    requests->items[requests->count].action = action;
    requests->items[requests->count].index = index;
    requests->count++;
}

#endif
