#include "viewer/picks.h"

#include <math.h>
#include <string.h>

void strl_picks_add(strl_picks *picks, const strl_picked *picked)
{
    if (picks->count == STRL_MOST_PICKS) {
        picks->count--;
        memmove(&picks->items[0], &picks->items[1], picks->count * sizeof *picks->items);
    }
    picks->items[picks->count++] = *picked;
}

const strl_picked *strl_picks_newest(const strl_picks *picks)
{
    return picks->count > 0 ? &picks->items[picks->count - 1] : NULL;
}

double strl_picks_distance(const strl_picks *picks, double difference[3])
{
    double square = 0;
    memset(difference, 0, 3 * sizeof *difference);
    if (picks->count < 2)
        return -1;
    const double *a = picks->items[picks->count - 2].pick.point, *b = picks->items[picks->count - 1].pick.point;
    for (int i = 0; i < 3; i++) {
        difference[i] = b[i] - a[i];
        square += difference[i] * difference[i];
    }
    return sqrt(square);
}
