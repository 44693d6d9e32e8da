/* What is behind stroll/source.h: a walk polls a source and never waits; it cannot tell sources apart. A
 * source belongs to one thread (the walk's) and may use threads of its own behind this interface. */
#ifndef STRL_SOURCE_SOURCE_H
#define STRL_SOURCE_SOURCE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "stroll/source.h"

/* One finished read. */
typedef struct strl_source_result {
    uint64_t token;     /* the caller's, from submit */
    strl_status status; /* STRL_OK: data holds exactly the bytes asked for */
    uint8_t *data;      /* owned by the receiver (strl__free); NULL on failure */
    size_t size;
    strl_error error; /* where status is not STRL_OK */
} strl_source_result;

/* One of several ranges that are read together. */
typedef struct strl_source_span {
    uint64_t offset;
    size_t size;
    void *data;        /* the caller's, of `size` bytes */
    uint64_t checksum; /* that they should have, as strl__checksum */
} strl_source_span;

/* Implementations fill this in as the first member of their own struct. */
typedef struct strl_source_class {
    const char *kind; /* "file", "memory", "callback", "delayed", "http" */
    strl_status (*submit)(strl_source *source, uint64_t token, uint64_t offset, size_t size, float urgency,
                          strl_error *err);
    bool (*poll)(strl_source *source, strl_source_result *result);
    void (*cancel)(strl_source *source, uint64_t token);
    strl_status (*read)(strl_source *source, uint64_t offset, void *data, size_t size, strl_error *err);
    void (*close)(strl_source *source);
    /* NULL: one after the other. */
    strl_status (*read_many)(strl_source *source, const strl_source_span *spans, size_t count, strl_error *err);
    /* Where bytes come over a network; all NULL elsewhere. */
    uint64_t (*room)(strl_source *source);
    bool (*get_network_stats)(const strl_source *source, strl_network_stats *stats);
    void (*doubt)(strl_source *source, uint64_t offset, size_t size);
} strl_source_class;

struct strl_source {
    const strl_source_class *klass;
    uint64_t bytes;   /* size of the whole object */
    const char *name; /* of the file, for sentences; owned by the class; NULL = none */
};

/* Queues a read of [offset, offset + size); higher urgency is served first. The answer comes from strl_source_poll,
 * also for a cancelled or failed read (status CANCELLED, IO, ...): exactly one answer per accepted submit. A range
 * outside the source is not accepted (STRL_ERR_FORMAT). */
strl_status strl_source_submit(strl_source *source, uint64_t token, uint64_t offset, size_t size, float urgency,
                               strl_error *err);
/* Takes one finished read, if there is one. Never waits. */
bool strl_source_poll(strl_source *source, strl_source_result *result);
/* Reads of this token that have not begun are answered as CANCELLED; one under way is answered as it ends. */
void strl_source_cancel(strl_source *source, uint64_t token);
/* Reads and waits: for opening a container and for tools, never for a frame. */
strl_status strl_source_read(strl_source *source, uint64_t offset, void *data, size_t size, strl_error *err);
/* The same of bytes whose checksum is known. Over a network they are asked for again while they have another; after
 * some attempts it succeeds all the same, and who looks at them says what is wrong. */
strl_status strl_source_read_known(strl_source *source, const strl_source_span *span, strl_error *err);
/* The same of several of them, which a network brings in a few round trips. The failure is that of the first of them
 * that failed. */
strl_status strl_source_read_many(strl_source *source, const strl_source_span *spans, size_t count, strl_error *err);
/* Whether to read once more what was not what it should be, this having been attempt 1, 2, ...: counts it, and doubts
 * the bytes. Never of what is no network's. */
bool strl_source_ask_again(strl_source *source, unsigned *attempt, uint64_t offset, size_t size);
/* Whether reading the same range once more may give other bytes, as over a network. */
bool strl_source_may_differ(const strl_source *source);
/* How many bytes may be asked for now so that they come soon, and that what is more urgent a moment later does not have
 * to wait behind them: follows bandwidth and latency. UINT64_MAX where there is nothing to wait for. What is submitted
 * beyond it is served all the same. */
uint64_t strl_source_room(strl_source *source);
/* What this read gave was not what the reader's checksum expects: it must not come out of a cache again. */
void strl_source_doubt(strl_source *source, uint64_t offset, size_t size);
/* Puts the source's name before the sentence of a failure, unless there is none or it is there. Returns status. */
strl_status strl_source_fail(const strl_source *source, strl_status status, strl_error *err);

/* An address as sentences may show it, also one that is none: without a user and a password, without a query. Cut to
 * size, which is at least 1. Returns shown. */
const char *strl__address_shown(const char *address, char *shown, size_t size);

/* Wraps another source (owned from then on; still the caller's on failure) and holds each answer back until delay_ns
 * after its submit. strl_source_read is not delayed. fail_every: every n-th answer is a failure (0 = none). For tests
 * and for looking at latency by hand. */
strl_status strl_source_open_delayed(strl_source *inner, uint64_t delay_ns, unsigned fail_every, strl_source **source,
                                     strl_error *err);

#endif
