/* One request and its answer: bytes as they come go to the reads that want them; what ends otherwise than it
 * should sends them back to wait, or fails them. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "source/http.h"
#include "stroll/version.h"

#define MOST_DISCARDED 65536u /* bytes of a useless answer are read on for the sake of the connection, so many */
#define MOST_RETRY_AFTER_S 30 /* a server that wants more time than that has failed */
#define STALL_BYTES 1024u
#define BUFFER_BYTES 65536L
#define OVERTAKEN_NS 1000000000u /* of silence, while a later request is answered; twice that at the next attempt */
#define MOST_DOUBLINGS 8u
#define MOST_OUTAGE_WAITS 3u /* then one request a second is all that looks whether the server is back */

/* ---- what comes */

/* Mutex held. Of the first answer: now it is known what is open. */
static void learn_identity(strl__http_transfer *transfer)
{
    strl__http *http = transfer->http;
    http->identity = transfer->fields.identity;
    http->base.bytes = http->identity.total;
    if (transfer->end > http->identity.total)
        transfer->end = http->identity.total;
    for (size_t i = 0; i < http->read_count; i++) {
        strl__http_read *read = http->reads[i];
        read->end = transfer->end;
        read->size = (size_t)(transfer->end - read->begin);
    }
}

/* Mutex held. Once a transfer, when its header is complete. */
static void judge(strl__http_transfer *transfer)
{
    strl__http *http = transfer->http;
    strl__http_asked asked = {.first = transfer->begin,
                              .last = transfer->end - 1,
                              .opening = transfer->opening,
                              .redirected = transfer->redirected,
                              .identity = http->identity};
    transfer->judged = true;
    transfer->verdict = strl__http_judge(&asked, &transfer->fields, &transfer->error);
    if (transfer->verdict == STRL__HTTP_GOOD && transfer->opening)
        learn_identity(transfer);
}

/* Mutex held. A read from the first byte on has come. */
static void learn_head(strl__http *http, const strl__http_read *read)
{
    size_t bytes = (size_t)(read->end - read->begin);
    http->head_bytes = bytes < STRL__HTTP_HEAD_BYTES ? bytes : STRL__HTTP_HEAD_BYTES;
    memcpy(http->head, read->result.data, http->head_bytes);
    strl__cache_model(http->head, http->head_bytes, http->identity.total, http->model);
}

/* Mutex held. */
static void deliver(strl__http_transfer *transfer, strl__http_read *read)
{
    strl__http *http = transfer->http;
    read->result.status = STRL_OK;
    if (transfer->opening) {
        learn_head(http, read);
        http->opened = true;
    } else {
        bool alone = read->begin <= transfer->begin && read->end >= transfer->end;
        http->stats.reads++;
        http->stats.merged_reads += !alone;
        if (http->head_bytes == 0 && read->begin == 0)
            learn_head(http, read); /* it was doubted */
        strl__http_keep(http, read->offset, read->result.data + (read->offset - read->begin), read->size);
    }
    strl__http_read_finish(http, read);
}

/* Mutex held. Bytes come in order, so that what a read still wants never lies before them. */
static void spread(strl__http_transfer *transfer, const uint8_t *data, size_t size)
{
    strl__http *http = transfer->http;
    uint64_t at = transfer->begin + transfer->received;
    for (size_t i = http->read_count; i-- > 0;) {
        strl__http_read *read = http->reads[i];
        uint64_t wanted = read->begin + read->filled;
        if (read->transfer != transfer || wanted >= at + size)
            continue;
        uint64_t skip = wanted - at, count = size - skip, left = read->end - wanted;
        if (count > left)
            count = left;
        memcpy(read->result.data + read->filled, data + skip, (size_t)count);
        read->filled += count;
        if (read->begin + read->filled == read->end)
            deliver(transfer, read);
    }
    transfer->received += size;
}

/* A stall is counted from the last bytes that came, not from when somebody looked. */
static void note_progress(strl__http_transfer *transfer, uint64_t now_ns)
{
    uint64_t come = transfer->received + transfer->discarded;
    if (come - transfer->watched_bytes < STALL_BYTES)
        return;
    transfer->watched_ns = now_ns;
    transfer->watched_bytes = come;
}

/* Mutex held. */
static bool take_body(strl__http_transfer *transfer, const uint8_t *data, size_t size)
{
    strl__http *http = transfer->http;
    uint64_t now_ns = strl_clock_ns(), asked = transfer->end - transfer->begin;
    if (!transfer->judged)
        judge(transfer);
    if (transfer->verdict != STRL__HTTP_GOOD) {
        transfer->discarded += size;
        note_progress(transfer, now_ns);
        return transfer->discarded <= MOST_DISCARDED;
    }
    if (size > asked - transfer->received) {
        transfer->verdict = STRL__HTTP_AGAIN;
        strl__fail(&transfer->error, STRL_ERR_NETWORK, "the answer is longer than the %" PRIu64 " bytes asked for",
                   asked);
        return false;
    }
    if (transfer->receiving)
        strl__pace_add_bytes(&http->pace, now_ns, size);
    else
        strl__pace_begin(&http->pace, now_ns);
    transfer->receiving = true;
    http->heard_ns = transfer->looking ? http->heard_ns : now_ns;
    http->stats.bytes += size;
    spread(transfer, data, size);
    note_progress(transfer, now_ns);
    return true;
}

static size_t on_body(char *data, size_t one, size_t size, void *context)
{
    strl__http_transfer *transfer = context;
    (void)one;
    strl_mutex_lock(&transfer->http->mutex);
    bool goes_on = take_body(transfer, (const uint8_t *)data, size);
    strl_mutex_unlock(&transfer->http->mutex);
    return goes_on ? size : 0;
}

static size_t on_header(char *line, size_t one, size_t size, void *context)
{
    strl__http_transfer *transfer = context;
    (void)one;
    strl__http_fields_line(&transfer->fields, line, size);
    if (transfer->fields.bytes <= STRL__HTTP_HEADER_BYTES)
        return size;
    transfer->verdict = STRL__HTTP_REFUSED;
    strl__fail(&transfer->error, STRL_ERR_NETWORK, "the header of the answer is longer than %zu bytes",
               STRL__HTTP_HEADER_BYTES);
    return 0;
}

/* ---- asking */

static bool set_address(strl__http_transfer *transfer)
{
    strl__http *http = transfer->http;
    CURL *easy = transfer->easy;
    transfer->redirected = http->target != NULL;
    CURLcode code = curl_easy_setopt(easy, CURLOPT_URL, http->target ? http->target : http->url);
#if LIBCURL_VERSION_NUM >= 0x075500
    const char *allowed = http->secure ? "https" : "http,https"; /* what began securely stays so */
    curl_easy_setopt(easy, CURLOPT_PROTOCOLS_STR, "http,https");
    curl_easy_setopt(easy, CURLOPT_REDIR_PROTOCOLS_STR, allowed);
#else
    curl_easy_setopt(easy, CURLOPT_PROTOCOLS, (long)(CURLPROTO_HTTP | CURLPROTO_HTTPS));
    curl_easy_setopt(easy, CURLOPT_REDIR_PROTOCOLS,
                     (long)(http->secure ? CURLPROTO_HTTPS : CURLPROTO_HTTP | CURLPROTO_HTTPS));
#endif
    curl_easy_setopt(easy, CURLOPT_FOLLOWLOCATION, 1L);
    curl_easy_setopt(easy, CURLOPT_MAXREDIRS, (long)STRL__HTTP_MOST_REDIRECTS);
    curl_easy_setopt(easy, CURLOPT_HTTP_VERSION, (long)CURL_HTTP_VERSION_2TLS);
    curl_easy_setopt(easy, CURLOPT_PIPEWAIT, http->secure ? 1L : 0L);
    if (http->certificates) { /* in place of the system's, which libcurl may have as a file and as a folder */
        curl_easy_setopt(easy, CURLOPT_CAINFO, http->certificates);
        curl_easy_setopt(easy, CURLOPT_CAPATH, NULL);
    }
    curl_easy_setopt(easy, CURLOPT_CONNECTTIMEOUT_MS, (long)http->desc.connect_ms);
    curl_easy_setopt(easy, CURLOPT_NOSIGNAL, 1L);
    return code == CURLE_OK;
}

/* A connection may be lost without a word, and one of HTTP/2 outlives the requests that were given up on it. */
static void set_connection(strl__http_transfer *transfer)
{
    const strl__http *http = transfer->http;
    curl_easy_setopt(transfer->easy, CURLOPT_FRESH_CONNECT, transfer->looking ? 1L : 0L);
#if LIBCURL_VERSION_NUM >= 0x075000
    if (http->renewed_ns)
        curl_easy_setopt(transfer->easy, CURLOPT_MAXLIFETIME_CONN,
                         (long)((transfer->begun_ns - http->renewed_ns) / 1000000000u + 1));
#endif
}

static bool set_request(strl__http_transfer *transfer)
{
    CURL *easy = transfer->easy;
    char range[48];
    snprintf(range, sizeof range, "%" PRIu64 "-%" PRIu64, transfer->begin, transfer->end - 1);
    CURLcode code = curl_easy_setopt(easy, CURLOPT_RANGE, range);
    if (code == CURLE_OK)
        code = curl_easy_setopt(easy, CURLOPT_USERAGENT, "stroll/" STRL_VERSION);
    curl_easy_setopt(easy, CURLOPT_HTTPHEADER, transfer->http->headers);
    curl_easy_setopt(easy, CURLOPT_SUPPRESS_CONNECT_HEADERS, 1L);
    curl_easy_setopt(easy, CURLOPT_BUFFERSIZE, BUFFER_BYTES);
    curl_easy_setopt(easy, CURLOPT_WRITEFUNCTION, on_body);
    curl_easy_setopt(easy, CURLOPT_WRITEDATA, transfer);
    curl_easy_setopt(easy, CURLOPT_HEADERFUNCTION, on_header);
    curl_easy_setopt(easy, CURLOPT_HEADERDATA, transfer);
    curl_easy_setopt(easy, CURLOPT_ERRORBUFFER, transfer->reason);
    curl_easy_setopt(easy, CURLOPT_PRIVATE, transfer);
    return code == CURLE_OK;
}

bool strl__http_transfer_start(strl__http_transfer *transfer)
{
    transfer->received = transfer->discarded = transfer->watched_bytes = 0;
    transfer->judged = transfer->receiving = transfer->overtaken = false;
    transfer->verdict = STRL__HTTP_GOOD;
    transfer->error = (strl_error){0};
    transfer->fields = (strl__http_fields){0};
    transfer->reason[0] = 0;
    transfer->watched_ns = transfer->begun_ns = strl_clock_ns();
    curl_easy_reset(transfer->easy);
    set_connection(transfer);
    return set_address(transfer) && set_request(transfer) &&
           curl_multi_add_handle(transfer->http->multi, transfer->easy) == CURLM_OK;
}

/* ---- stalls */

static uint64_t stall_ns(const strl__http_transfer *transfer)
{
    return (uint64_t)transfer->http->desc.stall_ms * 1000000u;
}

/* Mutex held. How long it may be silent while a later request is answered: the last attempt has all the time there is,
 * since a server may be slow with these bytes alone. */
static uint64_t patience_ns(const strl__http_transfer *transfer)
{
    const strl__http *http = transfer->http;
    uint64_t patience = (uint64_t)(4e9 * http->pace.latency_s);
    uint32_t failed = 0;
    for (size_t i = 0; i < http->read_count; i++)
        if (http->reads[i]->transfer == transfer && http->reads[i]->attempts > failed)
            failed = http->reads[i]->attempts;
    if (failed + 1 >= http->desc.attempts)
        return stall_ns(transfer);
    patience = patience > OVERTAKEN_NS ? patience : OVERTAKEN_NS;
    patience <<= failed < MOST_DOUBLINGS ? failed : MOST_DOUBLINGS;
    return patience < stall_ns(transfer) ? patience : stall_ns(transfer);
}

uint64_t strl__http_transfer_deadline(const strl__http_transfer *transfer)
{
    bool overtaken = transfer->http->answered_ns > transfer->watched_ns;
    return transfer->watched_ns + (overtaken ? patience_ns(transfer) : stall_ns(transfer));
}

bool strl__http_transfer_stalled(strl__http_transfer *transfer, uint64_t now_ns)
{
    strl__http *http = transfer->http;
    uint64_t come = transfer->received + transfer->discarded, stalled_ns = transfer->watched_ns + stall_ns(transfer);
    strl_mutex_lock(&http->mutex);
    bool ends = now_ns >= strl__http_transfer_deadline(transfer);
    strl_mutex_unlock(&http->mutex);
    if (!ends)
        return false;
    transfer->verdict = STRL__HTTP_AGAIN;
    transfer->overtaken = now_ns < stalled_ns;
    if (transfer->overtaken) {
        http->renewed_ns = http->answered_ns;
        strl__fail(&transfer->error, STRL_ERR_NETWORK, "the answer stalled: a later request was answered before it");
    } else {
        strl__fail(&transfer->error, STRL_ERR_NETWORK,
                   "the server stalled: %" PRIu64 " bytes came in %" PRIu32 " ms, expected %u at least",
                   come - transfer->watched_bytes, http->desc.stall_ms, STALL_BYTES);
    }
    return true;
}

/* ---- the end */

static const struct {
    CURLcode code;
    strl__http_verdict verdict;
    const char *what;
} failures[] = {
    {CURLE_COULDNT_RESOLVE_HOST, STRL__HTTP_AGAIN, "there is no server of this name"},
    {CURLE_COULDNT_RESOLVE_PROXY, STRL__HTTP_AGAIN, "there is no proxy of this name"},
    {CURLE_COULDNT_CONNECT, STRL__HTTP_AGAIN, "the server cannot be reached"},
    {CURLE_OPERATION_TIMEDOUT, STRL__HTTP_AGAIN, "the server does not answer in time"},
    {CURLE_TOO_MANY_REDIRECTS, STRL__HTTP_REFUSED, "the address is redirected too often"},
    {CURLE_UNSUPPORTED_PROTOCOL, STRL__HTTP_REFUSED, "the address is redirected to where Stroll does not follow"},
    {CURLE_URL_MALFORMAT, STRL__HTTP_REFUSED, "the address is redirected to what is none"},
    {CURLE_PEER_FAILED_VERIFICATION, STRL__HTTP_REFUSED, "the server does not prove who it is"},
    {CURLE_SSL_CACERT_BADFILE, STRL__HTTP_REFUSED, "there are no certificates to check the server by"},
    {CURLE_SSL_CONNECT_ERROR, STRL__HTTP_AGAIN, "there is no secure connection"},
};

/* Such as the end of an answer that was longer than it said, on a connection that is used again. After a redirect the
 * code is of where that leads to. */
static bool is_no_answer(const strl__http_transfer *transfer, CURLcode code)
{
    return code == CURLE_UNSUPPORTED_PROTOCOL && transfer->fields.status / 100 != 3;
}

/* What libcurl's code means, where nothing of ours has said it already. */
static void explain(strl__http_transfer *transfer, CURLcode code)
{
    const char *reason = transfer->reason[0] ? transfer->reason : curl_easy_strerror(code);
    if (transfer->error.message[0])
        return;
    transfer->verdict = STRL__HTTP_AGAIN;
    if (is_no_answer(transfer, code)) {
        strl__fail(&transfer->error, STRL_ERR_NETWORK, "the server sends more than it says, or what is no answer: %s",
                   reason);
        return;
    }
    for (size_t i = 0; i < sizeof failures / sizeof *failures; i++)
        if (failures[i].code == code) {
            transfer->verdict = failures[i].verdict;
            strl__fail(&transfer->error, STRL_ERR_NETWORK, "%s: %s", failures[i].what, reason);
            return;
        }
    if (code == CURLE_OK || code == CURLE_PARTIAL_FILE || transfer->received > 0)
        strl__fail(&transfer->error, STRL_ERR_NETWORK, "the answer ended after %" PRIu64 " of %" PRIu64 " bytes",
                   transfer->received, transfer->end - transfer->begin);
    else
        strl__fail(&transfer->error, STRL_ERR_NETWORK, "the request failed: %s", reason);
}

/* Mutex held. */
static void succeed(strl__http_transfer *transfer)
{
    strl__http *http = transfer->http;
    curl_off_t sent = 0, began = 0;
    char *effective = NULL;
    long redirects = 0;
    if (http->outages > 0)
        http->not_before_ns = 0; /* it is over */
    http->outages = http->refusals = 0;
    if (transfer->begun_ns > http->answered_ns)
        http->answered_ns = transfer->begun_ns;
    if (curl_easy_getinfo(transfer->easy, CURLINFO_PRETRANSFER_TIME_T, &sent) == CURLE_OK &&
        curl_easy_getinfo(transfer->easy, CURLINFO_STARTTRANSFER_TIME_T, &began) == CURLE_OK && began > sent)
        strl__pace_add_latency(&http->pace, (uint64_t)(began - sent) * 1000u);
    curl_easy_getinfo(transfer->easy, CURLINFO_REDIRECT_COUNT, &redirects);
    curl_easy_getinfo(transfer->easy, CURLINFO_EFFECTIVE_URL, &effective);
    if (redirects == 0 || !effective)
        return;
    strl__free(http->target); /* where it led to: the next requests need no redirect */
    http->target = strl__http_url_target(http->url, effective);
}

/* Mutex held. The server itself was not reached: that is a failed attempt of everything that waits. Requests that fail
 * together are of one outage, which is one attempt: what they bring back does not pay for each of the others. */
static void note_outage(strl__http_transfer *transfer, uint64_t now_ns)
{
    strl__http *http = transfer->http;
    uint64_t base_ns = (uint64_t)http->desc.backoff_ms * 1000000u;
    if (now_ns < http->not_before_ns)
        return;
    http->outages++;
    unsigned waits = http->outages < MOST_OUTAGE_WAITS ? http->outages : MOST_OUTAGE_WAITS;
    http->not_before_ns = now_ns + strl__backoff_ns(base_ns, waits, strl__http_random(http));
    for (size_t i = http->read_count; i-- > 0;)
        if (http->reads[i]->state == STRL__HTTP_WAITING)
            strl__http_read_again(http, http->reads[i], &transfer->error, now_ns);
}

/* Mutex held. A server that is asked too much is asked for nothing else either. Answers to requests that were under way
 * together are one refusal. */
static void slow_down(strl__http *http, uint64_t now_ns)
{
    uint64_t base_ns = (uint64_t)http->desc.backoff_ms * 1000000u;
    if (now_ns < http->not_before_ns)
        return;
    http->refusals++;
    http->not_before_ns = now_ns + strl__backoff_ns(base_ns, http->refusals, strl__http_random(http));
}

/* Mutex held. A server that says when to come back is obeyed, within reason. */
static void obey_retry_after(strl__http_transfer *transfer, uint64_t now_ns)
{
    strl__http *http = transfer->http;
    curl_off_t seconds = 0;
    unsigned status = transfer->fields.status;
    if (curl_easy_getinfo(transfer->easy, CURLINFO_RETRY_AFTER, &seconds) != CURLE_OK || seconds <= 0) {
        if (status == 429 || status == 503)
            slow_down(http, now_ns);
        return;
    }
    if (seconds <= MOST_RETRY_AFTER_S) {
        http->not_before_ns = now_ns + (uint64_t)seconds * 1000000000u;
        return;
    }
    transfer->verdict = STRL__HTTP_REFUSED;
    strl__fail(&transfer->error, STRL_ERR_NETWORK, "the server asks to be left alone for %lld seconds (%u)",
               (long long)seconds, status);
}

/* Mutex held. Nothing binds two attempts at opening to one file, so that what has come of one is not continued. */
static void begin_anew(strl__http_read *read)
{
    read->filled = 0;
    read->end = read->begin + STRL__HTTP_HEAD_BYTES;
    read->size = STRL__HTTP_HEAD_BYTES;
}

/* Mutex held. */
static void send_back(strl__http_transfer *transfer, uint64_t now_ns)
{
    strl__http *http = transfer->http;
    bool again = transfer->verdict == STRL__HTTP_AGAIN || transfer->verdict == STRL__HTTP_MOVED, retried = false;
    for (size_t i = http->read_count; i-- > 0;) {
        strl__http_read *read = http->reads[i];
        if (read->transfer != transfer)
            continue;
        if (transfer->opening)
            begin_anew(read);
        if (again)
            strl__http_read_again(http, read, &transfer->error, now_ns);
        else
            strl__http_read_fail(http, read, &transfer->error);
        retried |= read->state == STRL__HTTP_WAITING;
    }
    http->stats.retries += retried;
}

/* Mutex held. */
static void fail(strl__http_transfer *transfer, CURLcode code)
{
    strl__http *http = transfer->http;
    uint64_t now_ns = strl_clock_ns();
    bool reached = transfer->fields.status != 0 || is_no_answer(transfer, code);
    explain(transfer, code);
    strl__http_name_error(http, &transfer->error);
    if (transfer->verdict == STRL__HTTP_CHANGED) {
        http->changed = transfer->error;
        strl__http_read_fail_all(http, &http->changed);
        return;
    }
    if (transfer->verdict == STRL__HTTP_MOVED || (!reached && transfer->redirected)) {
        strl__free(http->target); /* the address itself may lead elsewhere now */
        http->target = NULL;
    }
    if (transfer->opening && (code == CURLE_COULDNT_CONNECT || code == CURLE_COULDNT_RESOLVE_HOST))
        transfer->verdict = STRL__HTTP_REFUSED; /* a wrong address is told at once */
    if (transfer->verdict == STRL__HTTP_AGAIN && reached)
        obey_retry_after(transfer, now_ns);
    strl__http_name_error(http, &transfer->error);
    if (reached)
        http->outages = 0;
    else if (!transfer->looking && !transfer->overtaken)
        note_outage(transfer, now_ns);
    send_back(transfer, now_ns);
}

void strl__http_transfer_end(strl__http_transfer *transfer, CURLcode code)
{
    strl__http *http = transfer->http;
    strl_mutex_lock(&http->mutex);
    if (transfer->receiving)
        strl__pace_end(&http->pace, strl_clock_ns());
    transfer->receiving = false;
    if (code == CURLE_OK && !transfer->judged && !transfer->error.message[0])
        judge(transfer); /* an answer without a body */
    bool whole = transfer->judged && transfer->verdict == STRL__HTTP_GOOD &&
                 transfer->received == transfer->end - transfer->begin;
    if (whole)
        succeed(transfer);
    else
        fail(transfer, code);
    transfer->active = false;
    strl_mutex_unlock(&http->mutex);
}
