/* Limits in time: requests of an address a second, bytes of all answers a second. Token buckets; the time is given, so
 * that tests need no clock. Thread-safe. Internal. */
#ifndef STRL_SERVE_LIMITS_H
#define STRL_SERVE_LIMITS_H

#include <stddef.h>
#include <stdint.h>

#include "platform/socket.h"
#include "platform/thread.h"

#define STRL__RATE_WAYS 8u
#define STRL__RATE_SETS 512u

typedef struct strl__rate_slot {
    uint8_t address[16]; /* of IPv6 the first 8 bytes: who has one address has 2^64 of them */
    bool is_v6;
    uint64_t last_ns; /* 0 = empty */
    double tokens;
} strl__rate_slot;

/* Of bounded size: an address that was not heard of for longest in its set is forgotten, which forgives it. */
typedef struct strl__rates {
    strl_mutex mutex;
    double per_second; /* 0 = no limit */
    strl__rate_slot slots[STRL__RATE_SETS][STRL__RATE_WAYS];
} strl__rates;

void strl__rates_init(strl__rates *rates, double per_second);
void strl__rates_deinit(strl__rates *rates);
/* 0 = the request may go on, else the whole seconds to wait. A full bucket holds two seconds' worth, at least 1. */
unsigned strl__rates_take(strl__rates *rates, const strl_peer *peer, uint64_t now_ns);

/* What a request, or a turn of it, cost beyond one: it is paid back before the next one. Debts are two seconds' worth
 * at most. */
void strl__rates_charge(strl__rates *rates, const strl_peer *peer, double requests, uint64_t now_ns);

typedef struct strl__flow {
    strl_mutex mutex;
    double per_second; /* bytes; 0 = no limit */
    double tokens;
    uint64_t last_ns;
} strl__flow;

void strl__flow_init(strl__flow *flow, uint64_t bytes_per_second);
void strl__flow_deinit(strl__flow *flow);
/* How many of `want` bytes may go out now; 0 = none yet. */
size_t strl__flow_take(strl__flow *flow, size_t want, uint64_t now_ns);

#endif
