/* A gang: one call that wants help from a pool's threads until it returns. Lives on its caller's stack. The caller
 * works too and withdraws offers nobody took, so a gang never waits for a busy pool and calls may nest. */
#ifndef STRL_JOBS_GANG_H
#define STRL_JOBS_GANG_H

#include <stdbool.h>

#include "jobs/pool.h"

typedef struct strl__gang {
    void (*run)(struct strl__gang *gang, unsigned worker); /* returns when there is nothing left to help with */
    struct strl__gang *next;                               /* the rest is guarded by the pool's mutex */
    unsigned wanted;                                       /* helpers that have not come yet */
    unsigned active;                                       /* helpers at work */
} strl__gang;

/* Offers gang->run to at most `helpers` threads of the pool. */
void strl__gang_enlist(strl_pool *pool, strl__gang *gang, unsigned helpers);
/* No further helper comes; waits for those at work. */
void strl__gang_dismiss(strl_pool *pool, strl__gang *gang);

static inline bool strl__cancelled(strl_cancel *cancel)
{
    return cancel && atomic_load(&cancel->requested);
}

#endif
