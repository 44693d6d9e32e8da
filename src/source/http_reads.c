/* The reads that a remote source has accepted, from submission to the answer. Their number is the walk's requests
 * in flight, a few hundred at most: searching is looking at each. All with the mutex held. */
#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"
#include "source/http.h"

strl_status strl__http_read_add(strl__http *http, const strl__http_read *like, strl__http_read **read, strl_error *err)
{
    *read = NULL;
    strl__http_read *made = strl__alloc(1, sizeof *made);
    if (!made || !strl__grow(&http->reads, &http->read_capacity, http->read_count + 1, sizeof *http->reads)) {
        strl__free(made);
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to queue a read");
    }
    *made = *like;
    made->serial = ++http->serials;
    made->state = http->cache && http->opened ? STRL__HTTP_NEW : STRL__HTTP_WAITING;
    if (isnan(made->urgency))
        made->urgency = 0; /* not a number has no place in an order */
    http->reads[http->read_count++] = made;
    *read = made;
    return STRL_OK;
}

static void take_out(strl__http *http, const strl__http_read *read)
{
    size_t i = 0;
    while (http->reads[i] != read)
        i++;
    http->reads[i] = http->reads[--http->read_count];
}

void strl__http_read_finish(strl__http *http, strl__http_read *read)
{
    strl_source_result *result = &read->result;
    take_out(http, read);
    read->state = STRL__HTTP_DONE;
    read->transfer = NULL;
    if (result->status != STRL_OK) {
        strl__free(result->data);
        result->data = NULL;
    }
    result->size = result->data ? read->size : 0;
    if (read->waited) {
        strl_condition_broadcast(&http->answered);
        return;
    }
    read->next = NULL;
    if (http->first_done)
        http->last_done->next = read;
    else
        http->first_done = read;
    http->last_done = read;
}

void strl__http_read_fail(strl__http *http, strl__http_read *read, const strl_error *error)
{
    read->result.error = *error;
    read->result.status = error->status;
    http->stats.failures += error->status != STRL_ERR_CANCELLED;
    strl__http_read_finish(http, read);
}

void strl__http_read_again(strl__http *http, strl__http_read *read, const strl_error *error, uint64_t now_ns)
{
    read->transfer = NULL;
    read->state = STRL__HTTP_WAITING;
    if (++read->attempts >= http->desc.attempts) {
        strl__http_read_fail(http, read, error);
        return;
    }
    uint64_t base_ns = (uint64_t)http->desc.backoff_ms * 1000000u;
    read->not_before_ns = now_ns + strl__backoff_ns(base_ns, read->attempts, strl__http_random(http));
}

void strl__http_read_fail_all(strl__http *http, const strl_error *error)
{
    while (http->read_count > 0)
        strl__http_read_fail(http, http->reads[http->read_count - 1], error);
}

strl__http_read *strl__http_read_find(strl__http *http, uint64_t serial)
{
    for (size_t i = 0; i < http->read_count; i++)
        if (http->reads[i]->serial == serial)
            return http->reads[i];
    return NULL;
}

strl__http_read *strl__http_read_most_urgent(strl__http *http, strl__http_state state, uint64_t now_ns)
{
    strl__http_read *best = NULL;
    for (size_t i = 0; i < http->read_count; i++) {
        strl__http_read *read = http->reads[i];
        if (read->state != state || read->not_before_ns > now_ns)
            continue;
        if (!best || read->urgency > best->urgency || (read->urgency == best->urgency && read->serial < best->serial))
            best = read;
    }
    return best;
}

uint64_t strl__http_bytes_wanted(const strl__http *http)
{
    uint64_t bytes = 0;
    for (size_t i = 0; i < http->read_count; i++) {
        const strl__http_read *read = http->reads[i];
        if (read->state == STRL__HTTP_WAITING || read->state == STRL__HTTP_FETCHING)
            bytes += read->end - read->begin - read->filled;
    }
    return bytes;
}

void strl__http_name_error(const strl__http *http, strl_error *error)
{
    if (!strstr(error->message, http->shown))
        strl__fail_context(error, error->status, "%s", http->shown);
}

uint64_t strl__http_random(strl__http *http)
{
    return strl__mix64(strl_clock_ns() ^ (uint64_t)(uintptr_t)http ^ ++http->serials << 40);
}
