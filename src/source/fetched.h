/* What sources share whose class can read and wait: queued reads are served by that, on threads of the
 * source's own or inside poll. Each accepted read puts one job into the pool; a job serves whichever
 * waiting read is the most urgent when it starts. */
#ifndef STRL_SOURCE_FETCHED_H
#define STRL_SOURCE_FETCHED_H

#include "jobs/pool.h"
#include "source/queue.h"

/* The first member of such a source. */
typedef struct strl__fetched {
    strl_source base;
    strl_pool *pool; /* owned; NULL: reads happen inside poll, one a call */
    strl__read_queue queue;
} strl__fetched;

/* base is set by the class, before the first submit. deinit follows in any case. */
strl_status strl__fetched_init(strl__fetched *self, unsigned threads, strl_error *err);
void strl__fetched_deinit(strl__fetched *self); /* waits for reads under way */

/* For the class. */
strl_status strl__fetched_submit(strl_source *source, uint64_t token, uint64_t offset, size_t size, float urgency,
                                 strl_error *err);
bool strl__fetched_poll(strl_source *source, strl_source_result *result);
void strl__fetched_cancel(strl_source *source, uint64_t token);

#endif
