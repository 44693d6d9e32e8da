/* The invariants of a draw item. */
#ifndef STRL_RENDER_CHECK_H
#define STRL_RENDER_CHECK_H

#include "stroll/error.h"
#include "stroll/frame.h"

/* Counts and ranges: constant time, what keeps a backend inside the item's arrays. Every backend calls it. */
strl_status strl__check_item_counts(const strl_draw_item *item, strl_error *err);
/* Every index, vertex and number: linear time, for the null renderer. */
strl_status strl__check_item_contents(const strl_draw_item *item, strl_error *err);

#endif
