/* The last few points that the visitor picked, newest last, and what they say together. */
#ifndef STRL_VIEWER_PICKS_H
#define STRL_VIEWER_PICKS_H

#include "viewer/pick.h"

#ifdef __cplusplus
extern "C" {
#endif

#define STRL_MOST_PICKS 3u

typedef struct strl_picked {
    strl_pick pick;
    char part[1024];    /* its whole path */
    char material[256]; /* its name; "" = it has none */
} strl_picked;

typedef struct strl_picks {
    strl_picked items[STRL_MOST_PICKS];
    uint32_t count;
} strl_picks;

/* The oldest makes room. */
void strl_picks_add(strl_picks *picks, const strl_picked *picked);
/* NULL while there is none. */
const strl_picked *strl_picks_newest(const strl_picks *picks);
/* From the last but one to the last. Returns the distance; -1 and zeros while there are not two. */
double strl_picks_distance(const strl_picks *picks, double difference[3]);

#ifdef __cplusplus
}
#endif
#endif
