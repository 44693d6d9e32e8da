/* How much to ask for at a time, and when again: what a link has shown of its bandwidth and latency. Pure arithmetic on
 * times that the caller gives. */
#ifndef STRL_SOURCE_HTTP_PACE_H
#define STRL_SOURCE_HTTP_PACE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Zero-initialise: nothing known. */
typedef struct strl__pace {
    double bytes_per_s; /* smoothed; 0 = not known */
    double latency_s;   /* about the least of late; 0 = not known */
    unsigned receiving; /* transfers whose bytes are coming: only then does the clock of a sample run */
    uint64_t since_ns;  /* when it was last read */
    uint64_t sample_ns, sample_bytes;
    double hit_share; /* of late look-ups in the cache */
} strl__pace;

/* A transfer's first bytes have come; its last ones, or it was given up. */
void strl__pace_begin(strl__pace *pace, uint64_t now_ns);
void strl__pace_end(strl__pace *pace, uint64_t now_ns);
/* Bytes that came after a transfer's first. */
void strl__pace_add_bytes(strl__pace *pace, uint64_t now_ns, size_t bytes);
/* From a request to the first byte of its answer. */
void strl__pace_add_latency(strl__pace *pace, uint64_t latency_ns);
void strl__pace_add_lookup(strl__pace *pace, bool hit);

/* Bytes to have on their way: enough that the link does not run dry while a request travels, and so few that what
 * is more urgent waits behind them for about 150 ms. */
uint64_t strl__pace_window(const strl__pace *pace);
/* Bytes that may be asked for beyond the `waiting` ones; more where the cache is likely to have them. */
uint64_t strl__pace_room(const strl__pace *pace, uint64_t waiting);
/* Bytes between two reads that cost no more than a request of their own, `connections` at a time. */
uint64_t strl__pace_gap(const strl__pace *pace, unsigned connections);

/* How long to wait after the `failures`-th failure in a row (1, 2, ...): base, doubled with each, 16 times that at
 * most; `random` takes up to half of it off, so that many clients do not come back at once. */
uint64_t strl__backoff_ns(uint64_t base_ns, unsigned failures, uint64_t random);

/* A read that waits: what may go into one request with others. */
typedef struct strl__span {
    uint64_t begin, end;
} strl__span;

/* The range of one request: `seed` and of the other spans those that lie at most `gap` bytes off what is taken
 * already, as long as the whole is at most `most` bytes (the seed is taken whatever its size). */
strl__span strl__span_grow(strl__span seed, const strl__span *others, size_t count, uint64_t gap, uint64_t most);

#endif
