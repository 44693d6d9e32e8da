#include "serve/metrics.h"

#include <inttypes.h>

#include "serve/text.h"

static const struct {
    uint64_t ns;
    const char *text;
} bounds[STRL__SECONDS_BUCKETS] = {
    {1000000, "0.001"}, {5000000, "0.005"}, {10000000, "0.01"}, {50000000, "0.05"},  {100000000, "0.1"},
    {500000000, "0.5"}, {1000000000, "1"},  {5000000000, "5"},  {30000000000, "30"}, {120000000000, "120"},
};

static const char *const reasons[STRL__REJECTIONS] = {"connections", "address",  "rate",  "timeout",
                                                      "idle",        "protocol", "memory"};

void strl__metrics_count_request(strl__metrics *metrics, unsigned status, uint64_t duration_ns)
{
    if (status >= STRL__LEAST_STATUS && status < STRL__LEAST_STATUS + STRL__STATUSES)
        atomic_fetch_add(&metrics->requests[status - STRL__LEAST_STATUS], 1);
    unsigned bucket = 0;
    while (bucket < STRL__SECONDS_BUCKETS && duration_ns > bounds[bucket].ns)
        bucket++;
    atomic_fetch_add(&metrics->seconds[bucket], 1);
    atomic_fetch_add(&metrics->duration_ns, duration_ns);
}

static void put_head(strl_writer *out, const char *name, const char *type, const char *help)
{
    strl__put_format(out, "# HELP stroll_serve_%s %s\n# TYPE stroll_serve_%s %s\n", name, help, name, type);
}

static void put_one(strl_writer *out, const char *name, const char *type, const char *help, uint64_t value)
{
    put_head(out, name, type, help);
    strl__put_format(out, "stroll_serve_%s %" PRIu64 "\n", name, value);
}

static void put_requests(strl__metrics *metrics, strl_writer *out)
{
    put_head(out, "requests_total", "counter", "Requests that were answered, by HTTP status.");
    for (unsigned i = 0; i < STRL__STATUSES; i++) {
        uint64_t count = atomic_load(&metrics->requests[i]);
        if (count)
            strl__put_format(out, "stroll_serve_requests_total{code=\"%u\"} %" PRIu64 "\n", i + STRL__LEAST_STATUS,
                             count);
    }
}

static void put_seconds(strl__metrics *metrics, strl_writer *out)
{
    uint64_t below = 0;
    put_head(out, "request_seconds", "histogram", "From the request's line to the end of its answer.");
    for (unsigned i = 0; i < STRL__SECONDS_BUCKETS; i++) {
        below += atomic_load(&metrics->seconds[i]);
        strl__put_format(out, "stroll_serve_request_seconds_bucket{le=\"%s\"} %" PRIu64 "\n", bounds[i].text, below);
    }
    below += atomic_load(&metrics->seconds[STRL__SECONDS_BUCKETS]);
    strl__put_format(out,
                     "stroll_serve_request_seconds_bucket{le=\"+Inf\"} %" PRIu64
                     "\nstroll_serve_request_seconds_sum %.9g\nstroll_serve_request_seconds_count %" PRIu64 "\n",
                     below, (double)atomic_load(&metrics->duration_ns) * 1e-9, below);
}

static void put_rejected(strl__metrics *metrics, strl_writer *out)
{
    put_head(out, "rejected_total", "counter", "Requests and connections that a limit turned away.");
    for (unsigned i = 0; i < STRL__REJECTIONS; i++)
        strl__put_format(out, "stroll_serve_rejected_total{reason=\"%s\"} %" PRIu64 "\n", reasons[i],
                         atomic_load(&metrics->rejected[i]));
}

void strl__metrics_write(strl__metrics *metrics, const strl__gauges *gauges, strl_writer *out)
{
    put_requests(metrics, out);
    put_one(out, "bytes_total", "counter", "Bytes of bodies that were sent.", atomic_load(&metrics->bytes));
    put_one(out, "connections_total", "counter", "Connections that were accepted.", atomic_load(&metrics->connections));
    put_one(out, "connections", "gauge", "Connections that are open.", gauges->open_connections);
    put_one(out, "containers", "gauge", "Containers that are open for queries.", gauges->open_containers);
    put_one(out, "aborted_total", "counter", "Answers that did not end as announced.", atomic_load(&metrics->aborted));
    put_one(out, "query_nodes_total", "counter", "Nodes that queries were answered with.",
            atomic_load(&metrics->query_nodes));
    put_one(out, "query_turns_total", "counter", "Turns of a thread that queries took.",
            atomic_load(&metrics->query_turns));
    put_one(out, "queries_cut_total", "counter", "Query answers that were cut.", atomic_load(&metrics->queries_cut));
    put_rejected(metrics, out);
    put_seconds(metrics, out);
}
