/* The reads a source has accepted and not yet answered: waiting ones by urgency, then age, and finished ones in the
 * order they finished. A request holds the place of its own answer, so that once accepted it can always
 * be answered. */
#ifndef STRL_SOURCE_QUEUE_H
#define STRL_SOURCE_QUEUE_H

#include "platform/thread.h"
#include "source/source.h"

typedef struct strl__read_request {
    uint64_t token;
    uint64_t offset;
    size_t size;
    float urgency;
} strl__read_request;

typedef struct strl__read {
    struct strl__read *next; /* in the finished list */
    strl__read_request request;
    uint64_t age; /* smaller = submitted earlier */
    strl_source_result result;
} strl__read;

typedef struct strl__read_queue {
    strl_mutex mutex;     /* guards all below; callers of reserve and push hold it themselves */
    strl__read **waiting; /* binary heap, the most urgent first; owned */
    size_t waiting_count;
    size_t waiting_capacity;
    uint64_t pushed;
    strl__read *first_done;
    strl__read *last_done;
} strl__read_queue;

void strl__read_queue_init(strl__read_queue *queue);
void strl__read_queue_deinit(strl__read_queue *queue); /* drops what is waiting or unanswered */

/* The mutex is the caller's to hold here, so that it can tie the push to a wake-up of its own that may fail. */
strl_status strl__read_queue_reserve(strl__read_queue *queue, const strl__read_request *request, strl__read **read,
                                     strl_error *err);
void strl__read_queue_push(strl__read_queue *queue, strl__read *read); /* after reserve; cannot fail */

/* The most urgent waiting read, now the caller's until it is done; NULL when none waits. */
strl__read *strl__read_queue_take(strl__read_queue *queue);
void strl__read_queue_done(strl__read_queue *queue, strl__read *read);
/* Answers the waiting reads of this token as cancelled. One that was taken is answered as it ends. */
void strl__read_queue_cancel(strl__read_queue *queue, uint64_t token);
/* Drops the waiting reads, unanswered. */
void strl__read_queue_clear(strl__read_queue *queue);
bool strl__read_queue_answer(strl__read_queue *queue, strl_source_result *result);

/* Where a queued read's bytes come from: strl_source_class.read; called on whichever thread serves. */
typedef strl_status (*strl__fetch_fn)(strl_source *source, uint64_t offset, void *data, size_t size, strl_error *err);
/* Serves the most urgent waiting read; false when none waits. */
bool strl__read_queue_serve(strl__read_queue *queue, strl_source *source, strl__fetch_fn fetch);

#endif
