/* A file on a web server as a source: see source/http.h for its threads. */
#include "source/http.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"

#define DEFAULT_CACHE_BYTES ((uint64_t)1 << 30)
#define DEFAULT_CONNECTIONS 6u
#define DEFAULT_ATTEMPTS 4u
#define DEFAULT_CONNECT_MS 10000u
#define DEFAULT_STALL_MS 15000u
#define DEFAULT_BACKOFF_MS 250u
/* A blocking read brings as much: of a container's end all that a first image needs but the root's mesh. */
#define AHEAD_BYTES ((uint64_t)48 << 10)
#define MOST_AHEAD_BYTES ((uint64_t)2 << 20) /* where one blocking read follows the other */
#define AHEAD_GAP AHEAD_BYTES                /* between two that follow each other */
#define BACKWARD_GAP ((uint64_t)4 << 10)

/* ---- blocking reads */

/* Mutex held. The bytes from `offset` on that are in memory, and how many; NULL = none. */
static const uint8_t *find_known(const strl__http *http, uint64_t offset, size_t *bytes)
{
    if (offset < http->head_bytes) {
        *bytes = http->head_bytes - (size_t)offset;
        return http->head + offset;
    }
    for (unsigned i = 0; i < STRL__HTTP_AHEAD; i++) {
        const strl__http_ahead *ahead = &http->ahead[i];
        if (!ahead->data || offset < ahead->begin || offset >= ahead->end)
            continue;
        *bytes = (size_t)(ahead->end - offset);
        return ahead->data + (offset - ahead->begin);
    }
    return NULL;
}

/* Mutex held. Whether all of a range is in memory already; copies it where data is not NULL. What came along with
 * another read is new to the cache. */
static bool copy_known(strl__http *http, uint64_t offset, size_t size, uint8_t *data)
{
    size_t count = 0;
    for (size_t done = 0; done < size; done += count) {
        const uint8_t *known = find_known(http, offset + done, &count);
        if (!known)
            return false;
        count = count < size - done ? count : size - done;
        if (data)
            memcpy(data + done, known, count);
    }
    if (data && size > 0 && offset + size > http->head_bytes)
        strl__http_keep(http, offset, data, size);
    return true;
}

/* Mutex held. The last read that this one goes on from, forward or backward; NULL = none. */
static const strl__http_ahead *find_near(const strl__http *http, const strl__http_read *read, bool *is_backward)
{
    for (unsigned i = 1; i <= STRL__HTTP_AHEAD; i++) {
        const strl__http_ahead *ahead = &http->ahead[(http->ahead_next + STRL__HTTP_AHEAD - i) % STRL__HTTP_AHEAD];
        bool is_used = ahead->end > ahead->begin;
        *is_backward = false;
        if (is_used && read->begin >= ahead->begin && read->begin <= ahead->end + AHEAD_GAP && read->end > ahead->end)
            return ahead;
        *is_backward = true;
        if (is_used && read->end <= ahead->end && read->end + BACKWARD_GAP >= ahead->begin &&
            read->begin < ahead->begin)
            return ahead;
    }
    return NULL;
}

/* Mutex held. What to fetch for a blocking read: more than it asks for, because the next one asks for what is near. */
static void look_ahead(strl__http *http, strl__http_read *read)
{
    uint64_t total = http->base.bytes;
    bool is_backward;
    const strl__http_ahead *near = find_near(http, read, &is_backward);
    if (!near)
        http->ahead_window = AHEAD_BYTES;
    else if (http->ahead_window < MOST_AHEAD_BYTES)
        http->ahead_window *= 2;
    uint64_t window = http->ahead_window;
    if (read->size >= window)
        return;
    if (near && is_backward)
        read->begin = read->end > window ? read->end - window : 0;
    else
        read->end = total - read->begin > window ? read->begin + window : total;
    if (near && !is_backward && read->begin > near->end)
        read->begin = near->end; /* of many trees the records lie behind the pages */
    if (read->end == total && read->end - read->begin < window)
        read->begin = total > window ? total - window : 0;
}

/* Mutex held. Makes room for that many bytes. */
static void forget_oldest_ahead(strl__http *http, uint64_t bytes)
{
    for (unsigned i = 0; i < STRL__HTTP_AHEAD; i++)
        bytes += http->ahead[i].data ? http->ahead[i].end - http->ahead[i].begin : 0;
    for (unsigned i = 0; i < STRL__HTTP_AHEAD && bytes > STRL__HTTP_AHEAD_BYTES; i++) {
        strl__http_ahead *oldest = &http->ahead[(http->ahead_next + i) % STRL__HTTP_AHEAD];
        bytes -= oldest->data ? oldest->end - oldest->begin : 0;
        strl__free(oldest->data);
        oldest->data = NULL;
    }
}

/* Mutex held. Takes the read's bytes over. */
static void keep_ahead(strl__http *http, strl__http_read *read)
{
    strl__http_ahead *ahead = &http->ahead[http->ahead_next];
    http->ahead_next = (http->ahead_next + 1) % STRL__HTTP_AHEAD;
    strl__free(ahead->data);
    *ahead = (strl__http_ahead){read->begin, read->end, NULL};
    if (read->end - read->begin > read->size) {
        forget_oldest_ahead(http, read->end - read->begin);
        ahead->data = read->result.data;
        read->result.data = NULL;
    }
}

static void wake(strl__http *http, const strl__http_read *read)
{
    if (read->state == STRL__HTTP_NEW)
        strl_condition_signal(&http->disk_work);
    else
        curl_multi_wakeup(http->multi);
}

static strl__http_read read_of(uint64_t offset, size_t size)
{
    return (strl__http_read){.offset = offset, .size = size, .begin = offset, .end = offset + size};
}

/* Mutex held. Submits a read that end_read waits for; *read is NULL on failure. */
static strl_status begin_read(strl__http *http, strl__http_read like, strl__http_read **read, strl_error *err)
{
    like.urgency = INFINITY;
    like.waited = true;
    strl_status status = strl__http_read_add(http, &like, read, err);
    if (status == STRL_OK)
        wake(http, *read);
    return status;
}

/* Mutex held. Waits, and frees the read; data may be NULL. The result's error is copied to err. */
static strl_status end_read(strl__http *http, strl__http_read *read, void *data, bool keeps_ahead, strl_error *err)
{
    while (read->state != STRL__HTTP_DONE)
        strl_condition_wait(&http->answered, &http->mutex);
    strl_status status = read->result.status;
    if (status == STRL_OK && data)
        memcpy(data, read->result.data + (read->offset - read->begin), read->size);
    if (status == STRL_OK && keeps_ahead)
        keep_ahead(http, read);
    if (status != STRL_OK && err)
        *err = read->result.error;
    strl__free(read->result.data);
    strl__free(read);
    return status;
}

static strl_status fail_changed(const strl__http *http, strl_error *err)
{
    if (err)
        *err = http->changed;
    return http->changed.status;
}

static strl_status http_read(strl_source *source, uint64_t offset, void *data, size_t size, strl_error *err)
{
    strl__http *http = (strl__http *)source;
    strl__http_read like = read_of(offset, size), *read;
    strl_status status = STRL_OK;
    strl_mutex_lock(&http->mutex);
    if (http->changed.status != STRL_OK) {
        status = fail_changed(http, err);
    } else if (!copy_known(http, offset, size, data)) {
        look_ahead(http, &like);
        status = begin_read(http, like, &read, err);
        if (status == STRL_OK)
            status = end_read(http, read, data, true, err);
    }
    strl_mutex_unlock(&http->mutex);
    return status;
}

/* The network thread sees all of them at once: what is near to each other shares a request. */
static strl_status http_read_many(strl_source *source, const strl_source_span *spans, size_t count, strl_error *err)
{
    strl__http *http = (strl__http *)source;
    strl_status status = STRL_OK;
    strl__http_read **reads = strl__alloc_zero(count ? count : 1, sizeof *reads);
    if (!reads)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu reads", count);
    strl_mutex_lock(&http->mutex);
    if (http->changed.status != STRL_OK)
        status = fail_changed(http, err);
    for (size_t i = 0; status == STRL_OK && i < count; i++)
        if (!copy_known(http, spans[i].offset, spans[i].size, spans[i].data))
            status = begin_read(http, read_of(spans[i].offset, spans[i].size), &reads[i], err);
    for (size_t i = 0; i < count; i++) { /* whatever has failed: they are on their way */
        if (!reads[i])
            continue;
        strl_status own = end_read(http, reads[i], spans[i].data, false, status == STRL_OK ? err : NULL);
        status = status == STRL_OK ? own : status;
    }
    strl_mutex_unlock(&http->mutex);
    strl__free(reads);
    return status;
}

/* ---- reads that are polled for */

/* Mutex held. Whether the read could be answered without a request. */
static bool answer_known(strl__http *http, strl__http_read *read)
{
    strl_error error = http->changed;
    if (error.status == STRL_OK && !copy_known(http, read->offset, read->size, NULL))
        return false;
    if (error.status == STRL_OK && !(read->result.data = strl__alloc(read->size, 1)))
        strl__fail(&error, STRL_ERR_MEMORY, "no memory for a read of %zu bytes", read->size);
    if (error.status != STRL_OK) {
        strl__http_read_fail(http, read, &error);
        return true;
    }
    copy_known(http, read->offset, read->size, read->result.data);
    strl__http_read_finish(http, read);
    return true;
}

static strl_status http_submit(strl_source *source, uint64_t token, uint64_t offset, size_t size, float urgency,
                               strl_error *err)
{
    strl__http *http = (strl__http *)source;
    strl__http_read like = read_of(offset, size);
    like.urgency = urgency;
    like.result.token = token;
    strl__http_read *read;
    strl_mutex_lock(&http->mutex);
    strl_status status = strl__http_read_add(http, &like, &read, err);
    if (status == STRL_OK && !answer_known(http, read))
        wake(http, read);
    strl_mutex_unlock(&http->mutex);
    return status;
}

static bool http_poll(strl_source *source, strl_source_result *result)
{
    strl__http *http = (strl__http *)source;
    strl_mutex_lock(&http->mutex);
    strl__http_read *read = http->first_done;
    if (read)
        http->first_done = read->next;
    strl_mutex_unlock(&http->mutex);
    if (!read)
        return false;
    *result = read->result;
    strl__free(read);
    return true;
}

static void http_cancel(strl_source *source, uint64_t token)
{
    strl__http *http = (strl__http *)source;
    strl_error error;
    bool any = false;
    strl__fail(&error, STRL_ERR_CANCELLED, "cancelled");
    strl_mutex_lock(&http->mutex);
    for (size_t i = http->read_count; i-- > 0;) {
        strl__http_read *read = http->reads[i];
        if (read->waited || read->result.token != token)
            continue;
        strl__http_read_fail(http, read, &error);
        any = true;
    }
    if (any)
        curl_multi_wakeup(http->multi); /* a transfer may have lost the last read that wanted it */
    strl_mutex_unlock(&http->mutex);
}

/* ---- what only a remote source has */

static uint64_t http_room(strl_source *source)
{
    strl__http *http = (strl__http *)source;
    strl_mutex_lock(&http->mutex);
    uint64_t room = strl__pace_room(&http->pace, strl__http_bytes_wanted(http));
    strl_mutex_unlock(&http->mutex);
    return room;
}

static bool http_network_stats(const strl_source *source, strl_network_stats *stats)
{
    strl__http *http = (strl__http *)(uintptr_t)source;
    strl_mutex_lock(&http->mutex);
    *stats = http->stats;
    stats->latency_ns = (uint64_t)(http->pace.latency_s * 1e9);
    stats->bytes_per_second = http->pace.bytes_per_s;
    strl_mutex_unlock(&http->mutex);
    return true;
}

static void http_doubt(strl_source *source, uint64_t offset, size_t size)
{
    strl__http *http = (strl__http *)source;
    strl_mutex_lock(&http->mutex);
    for (unsigned i = 0; i < STRL__HTTP_AHEAD; i++) {
        strl__http_ahead *ahead = &http->ahead[i];
        if (offset >= ahead->end || offset + size <= ahead->begin)
            continue;
        strl__free(ahead->data);
        ahead->data = NULL;
    }
    strl__http_forget(http, offset, size);
    if (offset < http->head_bytes)
        http->head_bytes = 0; /* what comes in its place tells which model it is */
    strl_mutex_unlock(&http->mutex);
}

/* ---- life */

static void free_reads(strl__http *http)
{
    for (size_t i = 0; i < http->read_count; i++) {
        strl__free(http->reads[i]->result.data);
        strl__free(http->reads[i]);
    }
    while (http->first_done) {
        strl__http_read *next = http->first_done->next;
        strl__free(http->first_done->result.data);
        strl__free(http->first_done);
        http->first_done = next;
    }
    strl__free(http->reads);
}

static void http_close(strl_source *source)
{
    strl__http *http = (strl__http *)source;
    strl_mutex_lock(&http->mutex);
    http->disk_closing = true;
    strl_condition_signal(&http->disk_work);
    strl_mutex_unlock(&http->mutex);
    strl_thread_join(http->disk);
    strl_mutex_lock(&http->mutex);
    http->network_closing = true;
    if (http->multi)
        curl_multi_wakeup(http->multi);
    strl_mutex_unlock(&http->mutex);
    strl_thread_join(http->network);
    for (uint32_t i = 0; i <= http->desc.connections; i++)
        curl_easy_cleanup(http->transfers[i].easy);
    if (http->multi)
        curl_multi_cleanup(http->multi);
    curl_slist_free_all(http->headers);
    strl__cache_close(http->cache);
    strl__http_disk_deinit(http);
    free_reads(http);
    for (unsigned i = 0; i < STRL__HTTP_AHEAD; i++)
        strl__free(http->ahead[i].data);
    strl__free(http->target);
    strl__free(http->url);
    strl__free(http->shown);
    strl__free(http->certificates);
    strl_condition_deinit(&http->answered);
    strl_condition_deinit(&http->disk_work);
    strl_mutex_deinit(&http->mutex);
    strl__free(http);
}

static uint32_t or_default(uint32_t value, uint32_t otherwise)
{
    return value ? value : otherwise;
}

static void apply_desc(strl__http *http, const strl_http_desc *desc)
{
    const strl_http_desc defaults = {0};
    const strl_http_desc *asked = desc ? desc : &defaults;
    strl_http_desc *own = &http->desc;
    own->cache_bytes = asked->cache_bytes ? asked->cache_bytes : DEFAULT_CACHE_BYTES;
    own->connections = or_default(asked->connections, DEFAULT_CONNECTIONS);
    if (own->connections > STRL__HTTP_MOST_CONNECTIONS)
        own->connections = STRL__HTTP_MOST_CONNECTIONS;
    own->attempts = or_default(asked->attempts, DEFAULT_ATTEMPTS);
    own->connect_ms = or_default(asked->connect_ms, DEFAULT_CONNECT_MS);
    own->stall_ms = or_default(asked->stall_ms, DEFAULT_STALL_MS);
    own->backoff_ms = or_default(asked->backoff_ms, DEFAULT_BACKOFF_MS);
    if (asked->cache) /* one that cannot be used is done without */
        strl__cache_open(asked->cache, own->cache_bytes, &http->cache, NULL);
}

/* libcurl wants this once a process, before any other call; where it was done already it counts. It is never
 * undone: other code of the process may use libcurl too. */
static strl_once curl_once = STRL_ONCE_INIT;
static CURLcode curl_ready = CURLE_FAILED_INIT;

static void init_curl(void)
{
    curl_ready = curl_global_init(CURL_GLOBAL_DEFAULT);
}

static strl_status make_handles(strl__http *http, strl_error *err)
{
    http->multi = curl_ready == CURLE_OK ? curl_multi_init() : NULL;
    bool good = http->multi != NULL;
    for (uint32_t i = 0; good && i <= http->desc.connections; i++) {
        http->transfers[i].http = http;
        http->transfers[i].easy = curl_easy_init();
        good = http->transfers[i].easy != NULL;
    }
    http->headers = good ? curl_slist_append(NULL, "Accept-Encoding: identity") : NULL;
    if (!http->headers)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for connections");
    curl_multi_setopt(http->multi, CURLMOPT_MAX_HOST_CONNECTIONS, (long)http->desc.connections + 1);
    curl_multi_setopt(http->multi, CURLMOPT_MAXCONNECTS, (long)http->desc.connections + 1);
    return STRL_OK;
}

static strl_status open_address(strl__http *http, strl_error *err)
{
    strl__http_read *read;
    strl_mutex_lock(&http->mutex);
    strl_status status = begin_read(http, read_of(0, STRL__HTTP_HEAD_BYTES), &read, err);
    if (status == STRL_OK)
        status = end_read(http, read, NULL, false, err);
    strl_mutex_unlock(&http->mutex);
    return status;
}

strl_status strl_source_open_http(const char *url, const strl_http_desc *desc, strl_source **source, strl_error *err)
{
    static const strl_source_class klass = {
        .kind = "http",
        .submit = http_submit,
        .poll = http_poll,
        .cancel = http_cancel,
        .read = http_read,
        .read_many = http_read_many,
        .close = http_close,
        .room = http_room,
        .get_network_stats = http_network_stats,
        .doubt = http_doubt,
    };
    *source = NULL;
    strl__http *http = strl__alloc_zero(1, sizeof *http);
    if (!http)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to open an address");
    strl_mutex_init(&http->mutex);
    strl_condition_init(&http->answered);
    strl_condition_init(&http->disk_work);
    http->kept_end = &http->kept;
    strl_once_run(&curl_once, init_curl);
    strl_status status = strl__http_url(url, &http->url, &http->shown, &http->secure, err);
    if (status == STRL_OK) {
        apply_desc(http, desc);
        status = make_handles(http, err);
    }
    if (status == STRL_OK && desc && desc->certificates && !(http->certificates = strl__strdup(desc->certificates)))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory to open an address");
    if (status == STRL_OK)
        status = strl_thread_start(&http->network, strl__http_network_run, http, err);
    if (status == STRL_OK)
        status = open_address(http, err);
    if (status == STRL_OK && http->cache)
        status = strl_thread_start(&http->disk, strl__http_disk_run, http, err);
    if (status != STRL_OK) {
        http_close(&http->base);
        return status;
    }
    http->base = (strl_source){.klass = &klass, .bytes = http->base.bytes, .name = http->shown};
    *source = &http->base;
    return STRL_OK;
}
