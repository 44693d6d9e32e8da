#include "source/http_pace.h"

#define QUEUE_S 0.15 /* of bytes ahead of what is more urgent */
/* of bytes that a walk has asked for: what is on its way, and as much to choose from */
#define ROOM_S 0.3
#define UNKNOWN_WINDOW 262144.0 /* before the first measurement */
#define LEAST_WINDOW 65536.0
#define LEAST_ROOM 262144.0
#define MOST_WINDOW 67108864.0
#define LATENCY_OF_A_NETWORK 0.01
#define LEAST_GAP 4096.0 /* less than a header and its answer weigh; pages of a container lie some bytes apart */
#define MOST_GAP 262144.0
/* at the latency of a network worth a request on any but a slow link, as the first bytes will tell */
#define UNKNOWN_GAP 49152.0
#define SAMPLE_NS 50000000u /* of bytes coming make a measurement, or so many bytes: */
#define SAMPLE_BYTES 1048576u
#define SMOOTHING 0.3
#define LATENCY_FORGETTING 0.05 /* how fast a smaller latency is forgotten */
#define LOOKUP_SMOOTHING 0.05
#define LEAST_MISS_SHARE 0.0625

static void run_clock(strl__pace *pace, uint64_t now_ns)
{
    if (pace->receiving > 0 && now_ns > pace->since_ns)
        pace->sample_ns += now_ns - pace->since_ns;
    pace->since_ns = now_ns;
}

void strl__pace_begin(strl__pace *pace, uint64_t now_ns)
{
    run_clock(pace, now_ns);
    pace->receiving++;
}

void strl__pace_end(strl__pace *pace, uint64_t now_ns)
{
    run_clock(pace, now_ns);
    if (pace->receiving > 0)
        pace->receiving--;
}

void strl__pace_add_bytes(strl__pace *pace, uint64_t now_ns, size_t bytes)
{
    run_clock(pace, now_ns);
    pace->sample_bytes += bytes;
    bool whole = pace->sample_ns >= SAMPLE_NS || pace->sample_bytes >= SAMPLE_BYTES; /* less is what a buffer held */
    if (!whole || pace->sample_ns == 0 || pace->sample_bytes == 0)
        return;
    double found = (double)pace->sample_bytes * 1e9 / (double)pace->sample_ns;
    pace->bytes_per_s = pace->bytes_per_s > 0 ? pace->bytes_per_s + SMOOTHING * (found - pace->bytes_per_s) : found;
    pace->sample_ns = pace->sample_bytes = 0;
}

void strl__pace_add_latency(strl__pace *pace, uint64_t latency_ns)
{
    double found = (double)latency_ns * 1e-9;
    if (pace->latency_s == 0 || found < pace->latency_s)
        pace->latency_s = found;
    else /* much of it may be bytes that came before; a link that has really become slower is believed in time */
        pace->latency_s += LATENCY_FORGETTING * (found - pace->latency_s);
}

void strl__pace_add_lookup(strl__pace *pace, bool hit)
{
    pace->hit_share += LOOKUP_SMOOTHING * ((hit ? 1 : 0) - pace->hit_share);
}

static double clamp(double value, double least, double most)
{
    return value < least ? least : value > most ? most : value;
}

static double bytes_of(const strl__pace *pace, double queue_s)
{
    return pace->bytes_per_s * (pace->latency_s + queue_s);
}

uint64_t strl__pace_window(const strl__pace *pace)
{
    if (pace->bytes_per_s == 0)
        return (uint64_t)UNKNOWN_WINDOW;
    return (uint64_t)clamp(bytes_of(pace, QUEUE_S), LEAST_WINDOW, MOST_WINDOW);
}

uint64_t strl__pace_room(const strl__pace *pace, uint64_t waiting)
{
    double all = pace->bytes_per_s == 0 ? 2 * UNKNOWN_WINDOW : clamp(bytes_of(pace, ROOM_S), LEAST_ROOM, MOST_WINDOW);
    if ((double)waiting >= all)
        return 0;
    return (uint64_t)((all - (double)waiting) / clamp(1 - pace->hit_share, LEAST_MISS_SHARE, 1));
}

uint64_t strl__pace_gap(const strl__pace *pace, unsigned connections)
{
    if (pace->bytes_per_s == 0)
        return pace->latency_s > LATENCY_OF_A_NETWORK ? (uint64_t)UNKNOWN_GAP : (uint64_t)LEAST_GAP;
    return (uint64_t)clamp(bytes_of(pace, 0) / (connections > 0 ? connections : 1), LEAST_GAP, MOST_GAP);
}

uint64_t strl__backoff_ns(uint64_t base_ns, unsigned failures, uint64_t random)
{
    unsigned doublings = failures == 0 ? 0 : failures - 1 < 4 ? failures - 1 : 4;
    uint64_t wait_ns = base_ns << doublings, half = wait_ns / 2;
    return wait_ns - (half > 0 ? random % (half + 1) : 0);
}

strl__span strl__span_grow(strl__span seed, const strl__span *others, size_t count, uint64_t gap, uint64_t most)
{
    strl__span all = seed;
    for (bool grew = true; grew;) {
        grew = false;
        for (size_t i = 0; i < count; i++) {
            strl__span with = {others[i].begin < all.begin ? others[i].begin : all.begin,
                               others[i].end > all.end ? others[i].end : all.end};
            uint64_t off = others[i].begin > all.end   ? others[i].begin - all.end
                           : others[i].end < all.begin ? all.begin - others[i].end
                                                       : 0;
            bool is_new = with.begin != all.begin || with.end != all.end;
            if (!is_new || off > gap || with.end - with.begin > most)
                continue;
            all = with;
            grew = true;
        }
    }
    return all;
}
