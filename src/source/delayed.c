/* A source that answers late, and wrongly when asked to: the network without a network. Due times count from submit,
 * so a caller that polls rarely sees the latency it asked for and no more. */
#include <inttypes.h>

#include "base/fail.h"
#include "base/memory.h"
#include "platform/thread.h"
#include "source/source.h"

typedef struct delayed_read {
    struct delayed_read *next;
    uint64_t token; /* the caller's; the inner source knows this read by its address */
    uint64_t due_ns;
    uint64_t offset;
    size_t size;
    bool answered; /* by the inner source; result is valid */
    bool cancelled;
    strl_source_result result;
} delayed_read;

typedef struct delayed_source {
    strl_source base;
    strl_source *inner; /* owned */
    uint64_t delay_ns;
    unsigned fail_every;
    uint64_t answers;
    delayed_read *reads; /* owned, all without an answer to the caller, in order of submission */
    delayed_read **end;
} delayed_source;

static strl_status delayed_submit(strl_source *source, uint64_t token, uint64_t offset, size_t size, float urgency,
                                  strl_error *err)
{
    delayed_source *self = (delayed_source *)source;
    delayed_read *read = strl__alloc_zero(1, sizeof *read);
    if (!read)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to queue a read");
    strl_status status = strl_source_submit(self->inner, (uint64_t)(uintptr_t)read, offset, size, urgency, err);
    if (status != STRL_OK) {
        strl__free(read);
        return status;
    }
    read->token = token;
    read->due_ns = strl_clock_ns() + self->delay_ns;
    read->offset = offset;
    read->size = size;
    *self->end = read;
    self->end = &read->next;
    return STRL_OK;
}

static void collect_inner_answers(delayed_source *self)
{
    strl_source_result result;
    while (strl_source_poll(self->inner, &result)) {
        delayed_read *read = (delayed_read *)(uintptr_t)result.token;
        read->answered = true;
        read->result = result;
        read->result.token = read->token;
    }
}

static void become_failure(strl_source_result *result, strl_status status, const char *why, const delayed_read *read)
{
    strl__free(result->data);
    result->data = NULL;
    result->size = 0;
    result->status =
        strl__fail(&result->error, status, "read of %zu bytes at byte %" PRIu64 " %s", read->size, read->offset, why);
}

static bool delayed_poll(strl_source *source, strl_source_result *result)
{
    delayed_source *self = (delayed_source *)source;
    collect_inner_answers(self);
    uint64_t now_ns = strl_clock_ns();
    delayed_read **at = &self->reads;
    while (*at && !((*at)->answered && (*at)->due_ns <= now_ns))
        at = &(*at)->next;
    delayed_read *read = *at;
    if (!read)
        return false;
    *at = read->next;
    if (!read->next)
        self->end = at;
    if (read->cancelled)
        become_failure(&read->result, STRL_ERR_CANCELLED, "was cancelled", read);
    else if (self->fail_every && ++self->answers % self->fail_every == 0)
        become_failure(&read->result, STRL_ERR_NETWORK, "failed, as this delayed source was told to", read);
    *result = read->result;
    strl__free(read);
    return true;
}

static void delayed_cancel(strl_source *source, uint64_t token)
{
    delayed_source *self = (delayed_source *)source;
    for (delayed_read *read = self->reads; read; read = read->next) {
        if (read->token != token)
            continue;
        read->cancelled = true;
        read->due_ns = 0; /* giving up needs no round trip */
        if (!read->answered)
            strl_source_cancel(self->inner, (uint64_t)(uintptr_t)read);
    }
}

static strl_status delayed_read_now(strl_source *source, uint64_t offset, void *data, size_t size, strl_error *err)
{
    return strl_source_read(((delayed_source *)source)->inner, offset, data, size, err);
}

static uint64_t delayed_room(strl_source *source)
{
    return strl_source_room(((delayed_source *)source)->inner);
}

static bool delayed_network_stats(const strl_source *source, strl_network_stats *stats)
{
    return strl_source_get_network_stats(((const delayed_source *)source)->inner, stats);
}

static void delayed_doubt(strl_source *source, uint64_t offset, size_t size)
{
    strl_source_doubt(((delayed_source *)source)->inner, offset, size);
}

static void delayed_close(strl_source *source)
{
    delayed_source *self = (delayed_source *)source;
    strl_source_close(self->inner);
    while (self->reads) {
        delayed_read *next = self->reads->next;
        strl__free(self->reads->result.data);
        strl__free(self->reads);
        self->reads = next;
    }
    strl__free(self);
}

strl_status strl_source_open_delayed(strl_source *inner, uint64_t delay_ns, unsigned fail_every, strl_source **source,
                                     strl_error *err)
{
    static const strl_source_class klass = {
        .kind = "delayed",
        .submit = delayed_submit,
        .poll = delayed_poll,
        .cancel = delayed_cancel,
        .read = delayed_read_now,
        .close = delayed_close,
        .room = delayed_room,
        .get_network_stats = delayed_network_stats,
        .doubt = delayed_doubt,
    };
    *source = NULL;
    delayed_source *self = strl__alloc_zero(1, sizeof *self);
    if (!self)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to delay a source");
    self->base = (strl_source){&klass, inner->bytes, inner->name};
    self->inner = inner;
    self->delay_ns = delay_ns;
    self->fail_every = fail_every;
    self->end = &self->reads;
    *source = &self->base;
    return STRL_OK;
}
