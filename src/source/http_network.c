/* The network thread: takes waiting reads, the most urgent first and those near it along, into requests; keeps as many
 * under way as the pace of the link wants. */
#include <limits.h>
#include <stdio.h>

#include "base/fail.h"
#include "base/memory.h"
#include "source/http.h"

#define LEAST_REQUESTS 2u        /* under way whatever they weigh: while one answer comes the next is asked for */
#define MOST_CANDIDATES 256u     /* for sharing a request */
#define IDLE_NS 1000000000u      /* the longest sleep */
#define LOOK_NS 1000000000u      /* of silence, and between two looks whether the server answers again: */
#define LOOK_SHARE 4u            /* this part of the silence, */
#define MOST_LOOK_NS 4000000000u /* so much at most */

/* ---- which */

static bool may_go(const strl__http_read *read, uint64_t now_ns)
{
    return read->state == STRL__HTTP_WAITING && read->not_before_ns <= now_ns;
}

static strl__span span_of(const strl__http_read *read)
{
    return (strl__span){read->begin + read->filled, read->end};
}

/* Mutex held. */
static uint64_t bytes_under_way(const strl__http *http, unsigned *active)
{
    uint64_t bytes = 0;
    *active = 0;
    for (uint32_t i = 0; i < http->desc.connections; i++) {
        const strl__http_transfer *transfer = &http->transfers[i];
        if (!transfer->active)
            continue;
        ++*active;
        bytes += transfer->end - transfer->begin - transfer->received;
    }
    return bytes;
}

/* Mutex held. Whether one more request of this size may be sent now. */
static bool may_send(const strl__http *http, uint64_t bytes)
{
    unsigned active;
    uint64_t under_way = bytes_under_way(http, &active);
    if (http->outages > 0) /* one looks whether the server is back */
        return active == 0;
    return active < LEAST_REQUESTS ||
           (active < http->desc.connections && under_way + bytes <= strl__pace_window(&http->pace));
}

/* Mutex held. The range of the next request; false where there is none to send. */
static bool choose(strl__http *http, uint64_t now_ns, strl__span *span)
{
    strl__span others[MOST_CANDIDATES];
    size_t count = 0;
    strl__http_read *first =
        http->not_before_ns > now_ns ? NULL : strl__http_read_most_urgent(http, STRL__HTTP_WAITING, now_ns);
    if (!first)
        return false;
    *span = span_of(first);
    if (!may_send(http, span->end - span->begin))
        return false;
    for (size_t i = 0; i < http->read_count && count < MOST_CANDIDATES; i++)
        if (may_go(http->reads[i], now_ns))
            others[count++] = span_of(http->reads[i]);
    uint64_t most = strl__pace_window(&http->pace) / 2;
    if (most > STRL__HTTP_MOST_MERGED)
        most = STRL__HTTP_MOST_MERGED;
    *span = strl__span_grow(*span, others, count, strl__pace_gap(&http->pace, http->desc.connections), most);
    return true;
}

/* ---- starting */

/* Mutex held. Its buffer is there from now on. */
static bool attach(strl__http *http, strl__http_read *read, strl__http_transfer *transfer)
{
    strl_error error;
    if (!read->result.data)
        read->result.data = strl__alloc((size_t)(read->end - read->begin), 1);
    if (!read->result.data) {
        strl__fail(&error, STRL_ERR_MEMORY, "no memory for a read of %zu bytes", read->size);
        strl__http_read_fail(http, read, &error);
        return false;
    }
    read->state = STRL__HTTP_FETCHING;
    read->transfer = transfer;
    return true;
}

/* Mutex held. All that lies within the range. */
static bool attach_all(strl__http *http, strl__http_transfer *transfer, strl__span span, uint64_t now_ns)
{
    bool any = false;
    for (size_t i = http->read_count; i-- > 0;) {
        strl__http_read *read = http->reads[i];
        strl__span own = span_of(read);
        if (may_go(read, now_ns) && own.begin >= span.begin && own.end <= span.end)
            any |= attach(http, read, transfer);
    }
    return any;
}

static strl__http_transfer *free_transfer(strl__http *http)
{
    for (uint32_t i = 0; i < http->desc.connections; i++)
        if (!http->transfers[i].active)
            return &http->transfers[i];
    return NULL;
}

/* Chooses and attaches; the transfer is to be started without the mutex. */
static strl__http_transfer *prepare_one(strl__http *http)
{
    strl__span span;
    uint64_t now_ns = strl_clock_ns();
    strl__http_transfer *transfer = NULL;
    strl_mutex_lock(&http->mutex);
    while (!transfer && choose(http, now_ns, &span) && (transfer = free_transfer(http))) {
        transfer->begin = span.begin;
        transfer->end = span.end;
        transfer->received = 0;
        transfer->opening = !http->opened;
        transfer->active = attach_all(http, transfer, span, now_ns);
        http->stats.requests += transfer->active;
        if (!transfer->active)
            transfer = NULL; /* no memory for any of them: they are answered, the next may be smaller */
    }
    strl_mutex_unlock(&http->mutex);
    return transfer;
}

static bool add_header(struct curl_slist **list, const char *text)
{
    struct curl_slist *longer = curl_slist_append(*list, text);
    if (longer)
        *list = longer;
    return longer != NULL;
}

/* From the second request on: only of what was opened. The identity does not change any more. */
static void make_conditional(strl__http *http)
{
    char text[sizeof http->identity.etag + 64];
    if (http->headers_conditional || !http->opened)
        return;
    http->headers_conditional = true;
    text[0] = 0;
    if (http->identity.etag[0])
        snprintf(text, sizeof text, "If-Match: %s", http->identity.etag);
    else if (http->identity.modified[0])
        snprintf(text, sizeof text, "If-Unmodified-Since: %s", http->identity.modified);
    if (text[0])
        add_header(&http->headers, text); /* without memory the answers' own fields still tell */
}

static void start_all(strl__http *http)
{
    strl__http_transfer *transfer;
    while ((transfer = prepare_one(http))) {
        make_conditional(http);
        if (!strl__http_transfer_start(transfer))
            strl__http_transfer_end(transfer, CURLE_OUT_OF_MEMORY);
    }
}

/* ---- looking whether the server answers */

static void sooner(uint64_t *when_ns, uint64_t other_ns)
{
    if (other_ns < *when_ns)
        *when_ns = other_ns;
}

static strl__http_transfer *looker(strl__http *http)
{
    return &http->transfers[http->desc.connections];
}

/* Since when nothing has come of what is asked for; UINT64_MAX where nothing is. */
static uint64_t silent_since(const strl__http *http)
{
    uint64_t since_ns = UINT64_MAX;
    for (uint32_t i = 0; i < http->desc.connections; i++)
        if (http->transfers[i].active)
            sooner(&since_ns, http->transfers[i].begun_ns);
    return since_ns < http->heard_ns ? http->heard_ns : since_ns;
}

/* Mutex held. UINT64_MAX: never, as things are. */
static uint64_t next_look_ns(strl__http *http, uint64_t now_ns)
{
    uint64_t since_ns = silent_since(http), latency_ns = (uint64_t)(4e9 * http->pace.latency_s);
    if (since_ns == UINT64_MAX || !http->opened)
        return UINT64_MAX;
    uint64_t pause_ns = now_ns > since_ns ? (now_ns - since_ns) / LOOK_SHARE : 0;
    pause_ns = pause_ns < LOOK_NS ? LOOK_NS : pause_ns > MOST_LOOK_NS ? MOST_LOOK_NS : pause_ns;
    uint64_t when_ns = since_ns + (latency_ns > LOOK_NS ? latency_ns : LOOK_NS);
    if (when_ns < looker(http)->begun_ns + pause_ns)
        when_ns = looker(http)->begun_ns + pause_ns;
    return when_ns > http->not_before_ns ? when_ns : http->not_before_ns;
}

static void abandon(strl__http *http, strl__http_transfer *transfer)
{
    curl_multi_remove_handle(http->multi, transfer->easy);
    strl_mutex_lock(&http->mutex);
    if (transfer->receiving)
        strl__pace_end(&http->pace, strl_clock_ns());
    transfer->active = transfer->receiving = false;
    strl_mutex_unlock(&http->mutex);
}

static void look(strl__http *http)
{
    strl__http_transfer *transfer = looker(http);
    uint64_t now_ns = strl_clock_ns();
    strl_mutex_lock(&http->mutex);
    bool is_due = now_ns >= next_look_ns(http, now_ns);
    strl_mutex_unlock(&http->mutex);
    if (!is_due)
        return;
    if (transfer->active)
        abandon(http, transfer); /* that one was sent to a server that was silent */
    strl_mutex_lock(&http->mutex);
    transfer->looking = transfer->active = true;
    transfer->begin = 0;
    transfer->end = 1;
    http->stats.requests++;
    strl_mutex_unlock(&http->mutex);
    make_conditional(http);
    if (!strl__http_transfer_start(transfer))
        strl__http_transfer_end(transfer, CURLE_OUT_OF_MEMORY);
}

/* ---- ending */

/* Whether nobody wants the rest of it. */
static bool is_abandoned(strl__http *http, const strl__http_transfer *transfer)
{
    strl_mutex_lock(&http->mutex);
    size_t i = 0;
    while (i < http->read_count && http->reads[i]->transfer != transfer)
        i++;
    bool abandoned = i == http->read_count && transfer->received < transfer->end - transfer->begin;
    if (transfer->looking)
        abandoned = silent_since(http) == UINT64_MAX;
    strl_mutex_unlock(&http->mutex);
    return abandoned;
}

static void check_all(strl__http *http)
{
    uint64_t now_ns = strl_clock_ns();
    for (uint32_t i = 0; i <= http->desc.connections; i++) {
        strl__http_transfer *transfer = &http->transfers[i];
        if (!transfer->active)
            continue;
        if (is_abandoned(http, transfer)) {
            abandon(http, transfer);
        } else if (strl__http_transfer_stalled(transfer, now_ns)) {
            curl_multi_remove_handle(http->multi, transfer->easy);
            strl__http_transfer_end(transfer, CURLE_OPERATION_TIMEDOUT);
        }
    }
}

/* Returns whether any has ended. */
static bool end_finished(strl__http *http)
{
    int left;
    bool any = false;
    const CURLMsg *message;
    while ((message = curl_multi_info_read(http->multi, &left))) {
        if (message->msg != CURLMSG_DONE)
            continue;
        CURLcode code = message->data.result; /* the message goes with the handle */
        CURL *easy = message->easy_handle;
        char *transfer = NULL;
        curl_easy_getinfo(easy, CURLINFO_PRIVATE, &transfer);
        curl_multi_remove_handle(http->multi, easy);
        strl__http_transfer_end((strl__http_transfer *)(void *)transfer, code);
        any = true;
    }
    return any;
}

/* ---- the thread */

/* How long there is nothing to do, if nothing comes. */
static int sleep_ms(strl__http *http)
{
    uint64_t now_ns = strl_clock_ns(), when_ns = now_ns + IDLE_NS;
    strl_mutex_lock(&http->mutex);
    for (uint32_t i = 0; i <= http->desc.connections; i++)
        if (http->transfers[i].active)
            sooner(&when_ns, strl__http_transfer_deadline(&http->transfers[i]));
    sooner(&when_ns, next_look_ns(http, now_ns));
    for (size_t i = 0; i < http->read_count; i++) {
        const strl__http_read *read = http->reads[i];
        uint64_t due_ns = read->not_before_ns > http->not_before_ns ? read->not_before_ns : http->not_before_ns;
        if (read->state == STRL__HTTP_WAITING && due_ns > now_ns)
            sooner(&when_ns, due_ns);
    }
    strl_mutex_unlock(&http->mutex);
    return when_ns <= now_ns ? 0 : (int)((when_ns - now_ns + 999999u) / 1000000u);
}

static bool is_closing(strl__http *http)
{
    strl_mutex_lock(&http->mutex);
    bool closing = http->network_closing;
    strl_mutex_unlock(&http->mutex);
    return closing;
}

void strl__http_network_run(void *context)
{
    strl__http *http = context;
    while (!is_closing(http)) {
        int running;
        check_all(http);
        start_all(http);
        look(http);
        curl_multi_perform(http->multi, &running);
        if (!end_finished(http))
            curl_multi_poll(http->multi, NULL, 0, sleep_ms(http), NULL);
    }
    for (uint32_t i = 0; i <= http->desc.connections; i++)
        if (http->transfers[i].active)
            curl_multi_remove_handle(http->multi, http->transfers[i].easy);
}
