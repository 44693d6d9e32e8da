#include "serve/limits.h"

#include <math.h>
#include <string.h>

#include "base/hash.h"

#define LEAST_SEND 4096.0 /* fewer bytes than this are not worth a packet */

void strl__rates_init(strl__rates *rates, double per_second)
{
    memset(rates, 0, sizeof *rates);
    strl_mutex_init(&rates->mutex);
    rates->per_second = per_second;
}

void strl__rates_deinit(strl__rates *rates)
{
    strl_mutex_deinit(&rates->mutex);
}

static strl__rate_slot key_of(const strl_peer *peer)
{
    strl__rate_slot key = {.is_v6 = peer->is_v6};
    memcpy(key.address, peer->address, peer->is_v6 ? 8 : 4);
    return key;
}

/* The address's slot, else the one of its set that was not used for longest, emptied for it. */
static strl__rate_slot *find(strl__rates *rates, const strl__rate_slot *key, double full, uint64_t now_ns)
{
    uint64_t number;
    memcpy(&number, key->address, sizeof number);
    strl__rate_slot *set = rates->slots[strl__mix64(number + key->is_v6) % STRL__RATE_SETS], *oldest = set;
    for (unsigned i = 0; i < STRL__RATE_WAYS; i++) {
        if (set[i].last_ns && set[i].is_v6 == key->is_v6 &&
            memcmp(set[i].address, key->address, sizeof key->address) == 0)
            return &set[i];
        if (set[i].last_ns < oldest->last_ns)
            oldest = &set[i];
    }
    *oldest = *key;
    oldest->tokens = full;
    oldest->last_ns = now_ns;
    return oldest;
}

static double refilled(double tokens, double full, double per_second, uint64_t since_ns)
{
    return fmin(full, tokens + per_second * (double)since_ns * 1e-9);
}

static double full_of(const strl__rates *rates)
{
    return fmax(1, 2 * rates->per_second);
}

unsigned strl__rates_take(strl__rates *rates, const strl_peer *peer, uint64_t now_ns)
{
    if (rates->per_second <= 0)
        return 0;
    double full = full_of(rates);
    now_ns += now_ns == 0;
    const strl__rate_slot key = key_of(peer);
    unsigned wait_s = 0;
    strl_mutex_lock(&rates->mutex);
    strl__rate_slot *slot = find(rates, &key, full, now_ns);
    uint64_t since_ns = now_ns > slot->last_ns ? now_ns - slot->last_ns : 0;
    slot->tokens = refilled(slot->tokens, full, rates->per_second, since_ns);
    slot->last_ns += since_ns;
    if (slot->tokens >= 1)
        slot->tokens -= 1;
    else
        wait_s = (unsigned)fmin(3600, ceil((1 - slot->tokens) / rates->per_second));
    strl_mutex_unlock(&rates->mutex);
    return wait_s;
}

void strl__rates_charge(strl__rates *rates, const strl_peer *peer, double requests, uint64_t now_ns)
{
    if (rates->per_second <= 0 || requests <= 0)
        return;
    double full = full_of(rates);
    const strl__rate_slot key = key_of(peer);
    strl_mutex_lock(&rates->mutex);
    strl__rate_slot *slot = find(rates, &key, full, now_ns + (now_ns == 0));
    slot->tokens = fmax(-full, slot->tokens - requests);
    strl_mutex_unlock(&rates->mutex);
}

void strl__flow_init(strl__flow *flow, uint64_t bytes_per_second)
{
    *flow = (strl__flow){.per_second = (double)bytes_per_second};
    strl_mutex_init(&flow->mutex);
}

void strl__flow_deinit(strl__flow *flow)
{
    strl_mutex_deinit(&flow->mutex);
}

size_t strl__flow_take(strl__flow *flow, size_t want, uint64_t now_ns)
{
    if (flow->per_second <= 0)
        return want;
    /* A quarter of a second's worth may be saved up, so that a pause between two requests is not a burst afterwards. */
    double full = fmax(LEAST_SEND, flow->per_second / 4);
    strl_mutex_lock(&flow->mutex);
    if (flow->last_ns == 0)
        flow->tokens = full;
    else if (now_ns > flow->last_ns)
        flow->tokens = refilled(flow->tokens, full, flow->per_second, now_ns - flow->last_ns);
    if (flow->last_ns < now_ns)
        flow->last_ns = now_ns;
    size_t taken = 0;
    if (flow->tokens >= fmin(LEAST_SEND, (double)want)) {
        taken = (double)want <= flow->tokens ? want : (size_t)flow->tokens;
        flow->tokens -= (double)taken;
    }
    strl_mutex_unlock(&flow->mutex);
    return taken;
}
