/* Where every part is, whatever is drawn: the finest level of a container, read once by a thread of its own. A part of
 * a few triangles is in no coarse level, so that a draw list cannot tell. What a placement is as a whole has the box of
 * the tree that it places. Takes 48 bytes a part, meanwhile 4 more and 56 for each part in each tree that has it, and
 * as long as decoding the whole model does. */
#ifndef STRL_VIEWER_PART_INDEX_H
#define STRL_VIEWER_PART_INDEX_H

#include <stdbool.h>
#include <stdint.h>

#include "shared/location.h"
#include "stroll/error.h"

typedef struct strl_part_index strl_part_index;

strl_status strl_part_index_create(const strl_location *location, uint32_t part_count, strl_part_index **index,
                                   strl_error *err);
void strl_part_index_destroy(strl_part_index *index); /* cancels and waits; NULL is legal */

/* True once it has ended, well or not. share: of the work done, 0 to 1. */
bool strl_part_index_is_done(const strl_part_index *index, double *share);
/* How it has ended; once it is done. */
strl_status strl_part_index_status(const strl_part_index *index, strl_error *err);
/* Widens bounds (min xyz, max xyz, world) to hold the part. False where it has no triangle. Once it is done. */
bool strl_part_index_widen(const strl_part_index *index, uint32_t part, double bounds[6]);

#endif
