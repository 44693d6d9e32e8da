/* What the server counts, and how Prometheus reads it. Thread-safe. Internal. */
#ifndef STRL_SERVE_METRICS_H
#define STRL_SERVE_METRICS_H

#include <stdatomic.h>
#include <stdint.h>

#include "base/cursor.h"

#define STRL__LEAST_STATUS 100u
#define STRL__STATUSES 500u
#define STRL__SECONDS_BUCKETS 10u

typedef enum strl__rejection {
    STRL__REJECTED_CONNECTIONS, /* too many at once */
    STRL__REJECTED_ADDRESS,     /* too many of one address */
    STRL__REJECTED_RATE,
    STRL__REJECTED_TIMEOUT,  /* a connection that was ended in the middle of something */
    STRL__REJECTED_IDLE,     /* and one between two requests */
    STRL__REJECTED_PROTOCOL, /* no HTTP that the library takes */
    STRL__REJECTED_MEMORY,   /* answers that nobody reads hold too much of it */
    STRL__REJECTIONS
} strl__rejection;

typedef struct strl__metrics {
    _Atomic uint64_t requests[STRL__STATUSES];           /* by status - 100 */
    _Atomic uint64_t seconds[STRL__SECONDS_BUCKETS + 1]; /* the last one: longer than all bounds */
    _Atomic uint64_t duration_ns, bytes, connections, rejected[STRL__REJECTIONS];
    _Atomic uint64_t query_nodes, query_turns, queries_cut, aborted;
} strl__metrics;

void strl__metrics_count_request(strl__metrics *metrics, unsigned status, uint64_t duration_ns);
/* What is not counted but looked up. */
typedef struct strl__gauges {
    uint64_t open_connections, open_containers;
} strl__gauges;
void strl__metrics_write(strl__metrics *metrics, const strl__gauges *gauges, strl_writer *out);

#endif
