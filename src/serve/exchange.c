/* Between the HTTP library and what is answered. Every callback comes from the one thread that has the connection. */
#include "serve/exchange.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "base/memory.h"
#include "serve/text.h"

#define CHUNK_BYTES ((size_t)64 << 10)
#define SMALL_BYTES ((uint64_t)4 << 10) /* of memory of an answer */
#define SHOWN_BYTES ((size_t)1024)      /* of a target in the log */

static strl__connection *connection_of(struct MHD_Connection *connection)
{
    const union MHD_ConnectionInfo *info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_SOCKET_CONTEXT);
    return info ? info->socket_context : NULL;
}

/* ---- the log ---- */

static void put_target(strl_writer *out, const char *target)
{
    char shown[SHOWN_BYTES + 4];
    size_t length = strlen(target);
    if (length > SHOWN_BYTES) {
        memcpy(shown, target, SHOWN_BYTES);
        memcpy(shown + SHOWN_BYTES, "...", 4);
        target = shown;
    }
    strl__put_log(out, target);
}

static void log_exchange(const strl__exchange *exchange, uint64_t duration_ns)
{
    char time[STRL__DATE_BYTES], peer[STRL_PEER_TEXT];
    strl_writer out = {0};
    strl__format_time(strl_clock_wall_ns(), time);
    strl_peer_text(&exchange->connection->peer, peer);
    strl__put_format(&out, "%s %s ", time, peer);
    strl__put_log(&out, exchange->method);
    strl__put(&out, " ");
    put_target(&out, exchange->shown ? exchange->shown : "");
    strl__put_format(&out, " %u %" PRIu64 " %.3f", exchange->status, exchange->sent_bytes, (double)duration_ns * 1e-6);
    strl_writer_u8(&out, 0);
    if (!out.failed)
        strl__server_log(exchange->server, (const char *)out.data);
    strl__free(out.data);
}

/* ---- beginning and end ---- */

static void end(strl__exchange *self, unsigned library_status, bool aborted)
{
    strl__metrics *metrics = &self->server->site.metrics;
    uint64_t duration_ns = strl_clock_ns() - self->start_ns;
    bool answered = self->status != 0;
    if (!answered) {
        self->status = library_status;
        atomic_fetch_add(&metrics->rejected[STRL__REJECTED_PROTOCOL], 1);
    }
    if (self->status)
        strl__metrics_count_request(metrics, self->status, duration_ns);
    if (answered && aborted)
        atomic_fetch_add(&metrics->aborted, 1);
    self->connection->exchange = NULL;
    atomic_store(&self->connection->is_between, true);
    strl__connection_progress(self->connection);
    log_exchange(self, duration_ns);
    atomic_fetch_sub(&self->server->under_way, 1);
    strl__pending_destroy(self->request.pending);
    strl__free(self->shown);
    strl__free(self->target);
    strl__free(self);
}

void strl__exchange_drop(strl__connection *connection)
{
    if (connection && connection->exchange)
        end(connection->exchange, 0, true);
}

void *strl__exchange_begin(void *cls, const char *target, struct MHD_Connection *handle)
{
    strl__connection *connection = connection_of(handle);
    if (!connection)
        return NULL;
    strl__exchange_drop(connection);
    strl__exchange *made = strl__alloc_zero(1, sizeof *made);
    if (!made)
        return NULL;
    made->server = cls;
    made->connection = connection;
    connection->exchange = made;
    atomic_store(&connection->is_between, false);
    made->start_ns = strl_clock_ns();
    made->shown = strl__strdup(target ? target : "");
    made->target = strl__strdup(target ? target : "");
    atomic_fetch_add(&made->server->under_way, 1);
    return made;
}

/* ---- the body ---- */

/* What the library holds while it sends. It outlives the exchange, but is not asked for bytes then. */
typedef struct carrier {
    strl__exchange *exchange;
    strl__site *site;
    uint64_t held_bytes;
    strl__body *body; /* owned */
    struct MHD_Connection *handle;
} carrier;

static void release_carrier(void *cls)
{
    carrier *self = cls;
    strl__body_destroy(self->body);
    atomic_fetch_sub(&self->site->held_bytes, self->held_bytes);
    strl__free(self);
}

/* Small ones are bounded by the connections. */
static uint64_t held_bytes_of(const strl__body *body)
{
    uint64_t bytes = strl__body_memory(body);
    return bytes > SMALL_BYTES ? bytes : 0;
}

/* The library asks again once the connection is resumed. */
static void wait_a_while(strl__exchange *exchange, struct MHD_Connection *handle)
{
    MHD_suspend_connection(handle);
    if (!strl__connections_pause(&exchange->server->site.connections, exchange->connection))
        MHD_resume_connection(handle);
}

/* goes_on: a turn was had, and the library asks again as soon as it has looked after the other connections of its
 * thread. */
static void put_off(strl__exchange *exchange, struct MHD_Connection *handle, bool goes_on)
{
    if (!goes_on) {
        wait_a_while(exchange, handle);
        return;
    }
    strl__connection_progress(exchange->connection);
    MHD_suspend_connection(handle);
    MHD_resume_connection(handle);
}

static ssize_t read_chunk(void *cls, uint64_t at, char *data, size_t size)
{
    carrier *self = cls;
    strl_server *server = self->exchange->server;
    strl_error err = {0};
    size_t got = 0;
    if (at != self->body->done || size == 0)
        return MHD_CONTENT_READER_END_WITH_ERROR;
    size_t allowed = atomic_load(&server->stopping) ? size : strl__flow_take(&server->flow, size, strl_clock_ns());
    if (allowed == 0) {
        wait_a_while(self->exchange, self->handle);
        return 0;
    }
    if (strl__body_read(self->body, data, allowed, &got, &err) != STRL_OK) {
        strl__site_complain(&server->site, err.message);
        return MHD_CONTENT_READER_END_WITH_ERROR;
    }
    strl__connection_progress(self->exchange->connection);
    self->exchange->sent_bytes += got;
    atomic_fetch_add(&server->site.metrics.bytes, got);
    return got > 0 ? (ssize_t)got : MHD_CONTENT_READER_END_WITH_ERROR;
}

/* ---- the answer ---- */

static void put_line(struct MHD_Response *response, const char *name, const char *value)
{
    if (value && *value)
        MHD_add_response_header(response, name, value);
}

static void put_origin(struct MHD_Response *response, const strl_server *server, bool preflight)
{
    if (!*server->origin)
        return;
    put_line(response, "Access-Control-Allow-Origin", server->origin);
    put_line(response, "Access-Control-Expose-Headers",
             "Accept-Ranges, Content-Length, Content-Range, ETag, Last-Modified, Retry-After");
    if (!preflight)
        return;
    put_line(response, "Access-Control-Allow-Methods", "GET, HEAD, OPTIONS");
    put_line(response, "Access-Control-Allow-Headers",
             "Range, If-Range, If-Match, If-None-Match, If-Modified-Since, If-Unmodified-Since");
    put_line(response, "Access-Control-Max-Age", "86400");
}

static void put_lines(struct MHD_Response *response, const strl_server *server, const strl__answer *answer)
{
    char seconds[16];
    snprintf(seconds, sizeof seconds, "%u", answer->retry_s);
    put_line(response, "Content-Type", answer->type);
    put_line(response, "ETag", answer->etag);
    put_line(response, "Last-Modified", answer->modified);
    put_line(response, "Content-Range", answer->range);
    put_line(response, "Location", answer->location);
    put_line(response, "Accept-Ranges", answer->takes_ranges ? "bytes" : "");
    put_line(response, "Cache-Control", answer->etag[0] ? "no-cache" : "no-store");
    put_line(response, "Retry-After", answer->retry_s ? seconds : "");
    put_line(response, "Allow", answer->status == 405 || answer->status == 204 ? "GET, HEAD, OPTIONS" : "");
    put_line(response, "X-Content-Type-Options", "nosniff");
    put_line(response, "Content-Security-Policy",
             answer->is_page ? "default-src 'none'; style-src 'unsafe-inline'" : "");
    put_line(response, "Connection", answer->close ? "close" : "");
    put_origin(response, server, answer->status == 204);
}

/* Takes the body over. */
static struct MHD_Response *make_response(strl__exchange *exchange, struct MHD_Connection *connection, strl__body *body)
{
    static char nothing[1] = "";
    uint64_t bytes = body ? strl__body_bytes(body) : 0;
    if (bytes == 0) {
        strl__body_destroy(body);
        return MHD_create_response_from_buffer(0, nothing, MHD_RESPMEM_PERSISTENT);
    }
    carrier *made = strl__alloc(1, sizeof *made);
    if (!made) {
        strl__body_destroy(body);
        return NULL;
    }
    *made = (carrier){exchange, &exchange->server->site, held_bytes_of(body), body, connection};
    atomic_fetch_add(&made->site->held_bytes, made->held_bytes);
    size_t block = bytes < CHUNK_BYTES ? (size_t)bytes : CHUNK_BYTES;
    struct MHD_Response *response = MHD_create_response_from_callback(bytes, block, read_chunk, made, release_carrier);
    if (!response)
        release_carrier(made);
    return response;
}

/* An answer that nobody takes holds its memory until its time is over, and one after the other may be asked for. */
static void refuse_memory(strl__site *site, strl__answer *answer)
{
    uint64_t bytes = answer->body ? held_bytes_of(answer->body) : 0;
    if (bytes == 0 || bytes + atomic_load(&site->held_bytes) <= site->held_most)
        return;
    strl__body_destroy(answer->body);
    *answer = (strl__answer){.retry_s = 1, .close = answer->close};
    atomic_fetch_add(&site->metrics.rejected[STRL__REJECTED_MEMORY], 1);
    strl__answer_sentence(answer, 503, "answers that are on their way hold too much memory");
}

enum MHD_Result strl__exchange_send(strl__exchange *exchange, struct MHD_Connection *connection, strl__answer *answer)
{
    refuse_memory(&exchange->server->site, answer);
    struct MHD_Response *response = make_response(exchange, connection, answer->body);
    answer->body = NULL;
    if (!response)
        return MHD_NO;
    put_lines(response, exchange->server, answer);
    enum MHD_Result result = MHD_queue_response(connection, answer->status, response);
    MHD_destroy_response(response); /* the library keeps its own hold of it */
    if (result == MHD_YES)
        exchange->status = answer->status;
    return result;
}

static void turn_away(strl__exchange *exchange, strl__rejection reason, unsigned status, unsigned retry_s,
                      strl__answer *answer)
{
    static const char *const sentences[] = {"too many connections are open",
                                            "too many connections of your address are open",
                                            "too many requests of your address"};
    atomic_fetch_add(&exchange->server->site.metrics.rejected[reason], 1);
    *answer = (strl__answer){.retry_s = retry_s, .close = reason != STRL__REJECTED_RATE};
    strl__answer_sentence(answer, status, "%s", sentences[reason]);
}

/* Whether a limit stands against the request; then the answer says so. */
static bool is_over_limits(strl__exchange *exchange, strl__answer *answer)
{
    const strl__connection *connection = exchange->connection;
    if (connection->surplus == STRL__SURPLUS_CONNECTIONS) {
        turn_away(exchange, STRL__REJECTED_CONNECTIONS, 503, 1, answer);
        return true;
    }
    if (connection->surplus == STRL__SURPLUS_ADDRESS) {
        turn_away(exchange, STRL__REJECTED_ADDRESS, 429, 1, answer);
        return true;
    }
    unsigned wait_s = strl__rates_take(&exchange->server->rates, &connection->peer, strl_clock_ns());
    if (wait_s > 0)
        turn_away(exchange, STRL__REJECTED_RATE, 429, wait_s, answer);
    return wait_s > 0;
}

static void take_head(strl__exchange *exchange, struct MHD_Connection *connection, const char *method)
{
    snprintf(exchange->method, sizeof exchange->method, "%s", method);
    exchange->request.method = exchange->method;
    exchange->request.target = exchange->target;
    exchange->head_read = true;
    strl__connection_progress(exchange->connection);
    strl__exchange_read_head(exchange, connection);
}

enum MHD_Result strl__exchange_answer(void *cls, struct MHD_Connection *connection, const char *url, const char *method,
                                      const char *version, const char *data, size_t *data_bytes, void **exchange)
{
    (void)cls, (void)url, (void)version, (void)data, (void)data_bytes;
    strl__exchange *self = *exchange;
    if (!self || !self->target || !self->shown)
        return MHD_NO; /* without memory or a place the connection ends */
    if (!self->head_read) {
        take_head(self, connection, method);
        /* The library ends a connection whose answer comes before its request is whole. That is what a request with a
         * body deserves, of which nothing is ever taken in; others are asked for again. */
        if (!self->request.has_body)
            return MHD_YES;
    }
    strl__answer answer;
    if (self->is_admitted || !is_over_limits(self, &answer)) {
        self->is_admitted = true;
        strcpy(self->target, self->shown); /* an earlier try has taken it apart */
        strl__answer_request(&self->server->site, &self->request, &answer);
        strl__rates_charge(&self->server->rates, &self->connection->peer, answer.work, strl_clock_ns());
        if (answer.is_later) {
            put_off(self, connection, answer.goes_on);
            return MHD_YES;
        }
    }
    answer.close |= self->request.has_body;
    return strl__exchange_send(self, connection, &answer);
}

/* Of an answer of the library's own; 0 = the connection ended without one. */
static unsigned status_of(struct MHD_Connection *connection)
{
    const union MHD_ConnectionInfo *info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_HTTP_STATUS);
    return info ? info->http_status : 0;
}

void strl__exchange_end(void *cls, struct MHD_Connection *connection, void **exchange,
                        enum MHD_RequestTerminationCode reason)
{
    (void)cls;
    strl__exchange *self = *exchange;
    *exchange = NULL;
    if (self)
        end(self, status_of(connection), reason != MHD_REQUEST_TERMINATED_COMPLETED_OK);
}
