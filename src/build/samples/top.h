/* The top of a sample tree: the cells above the pieces. */
#ifndef STRL_BUILD_SAMPLES_TOP_H
#define STRL_BUILD_SAMPLES_TOP_H

#include "build/samples/chunk.h"

/* The bricks above the pieces, the root first; where a piece's bricks come, a place with its number. */
strl_status strl_top_make(const strl_sample_stage *stage, strl_brick_set *set, strl_error *err);

#endif
