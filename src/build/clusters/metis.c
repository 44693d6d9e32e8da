/* The one file that knows METIS. It calls rand and srand and raises signals, so calls are serialised and seeded. */
#include <metis.h>

#include "build/clusters/partition.h"
#include "platform/thread.h"

static strl_mutex metis_lock = PTHREAD_MUTEX_INITIALIZER; /* guards METIS' own global state */

bool strl__metis_bisect(int32_t count, int32_t *first, int32_t *neighbour, int32_t *vertex_weight, int32_t *edge_weight,
                        int32_t *side)
{
    idx_t options[METIS_NOPTIONS], constraints = 1, parts = 2, cut = 0;
    _Static_assert(sizeof(idx_t) == sizeof(int32_t), "METIS must be built with 32-bit indices");
    strl_mutex_lock(&metis_lock);
    METIS_SetDefaultOptions(options);
    options[METIS_OPTION_SEED] = 1;
    options[METIS_OPTION_UFACTOR] = 10;
    int result = METIS_PartGraphRecursive(&count, &constraints, first, neighbour, vertex_weight, NULL, edge_weight,
                                          &parts, NULL, NULL, options, &cut, side);
    strl_mutex_unlock(&metis_lock);
    return result == METIS_OK;
}
