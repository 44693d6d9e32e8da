#include "support/fault_server.h"

#include <arpa/inet.h>
#include <errno.h>
#include <inttypes.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/socket.h>
#include <unistd.h>
#include <cmocka.h>

#include "platform/thread.h"

/* Plain malloc and plain threads here: the tests' hook for failing allocations is for the client. */

#define MOST_CONNECTIONS 256u
#define REQUEST_BYTES 8192u
#define CHUNK_BYTES 16384u

typedef struct connection {
    fault_server *server;
    pthread_t thread;
    int socket;
    bool ended; /* under the server's mutex: its thread is done but for returning */
} connection;

struct fault_server {
    fault_script script;
    void *context;
    uint16_t port;
    int listener;
    pthread_t acceptor;
    bool listens;
    strl_mutex mutex; /* guards the rest */
    fault_content content;
    bool ending;
    connection connections[MOST_CONNECTIONS];
    unsigned connection_count, asked_count, aborted;
    fault_asked asked[FAULT_MOST_ASKED];
};

typedef struct fault_request {
    char path[64];
    fault_asked asked;
    bool has_range;
    char condition[256]; /* of If-Match or If-Unmodified-Since */
} fault_request;

/* ---- reading */

/* Up to the empty line. False at the end of the connection. */
static bool read_request(int socket, char *text)
{
    size_t size = 0;
    while (size < REQUEST_BYTES - 1) {
        ssize_t got = recv(socket, text + size, 1, 0);
        if (got <= 0)
            return false;
        size++;
        text[size] = 0;
        if (size >= 4 && strcmp(text + size - 4, "\r\n\r\n") == 0)
            return true;
    }
    return false;
}

static const char *find_field(const char *text, const char *name)
{
    size_t length = strlen(name);
    for (const char *line = strstr(text, "\r\n"); line; line = strstr(line + 2, "\r\n"))
        if (strncasecmp(line + 2, name, length) == 0 && line[2 + length] == ':')
            return line + 2 + length + 1 + strspn(line + 2 + length + 1, " ");
    return NULL;
}

static void parse_request(const char *text, fault_request *request)
{
    memset(request, 0, sizeof *request);
    sscanf(text, "GET %63s", request->path);
    const char *range = find_field(text, "range");
    request->has_range =
        range && sscanf(range, "bytes=%" SCNu64 "-%" SCNu64, &request->asked.first, &request->asked.last) == 2;
    const char *condition = find_field(text, "if-match");
    condition = condition ? condition : find_field(text, "if-unmodified-since");
    if (condition)
        sscanf(condition, "%255[^\r\n]", request->condition);
    request->asked.conditional = condition != NULL;
    request->asked.named = find_field(text, "authorization") != NULL;
}

/* ---- answering */

static bool send_all(int socket, const void *data, size_t size)
{
    const char *at = data;
    while (size > 0) {
        ssize_t sent = send(socket, at, size, MSG_NOSIGNAL);
        if (sent <= 0)
            return false;
        at += sent;
        size -= (size_t)sent;
    }
    return true;
}

static bool send_text(int socket, const char *format, ...) __attribute__((format(printf, 2, 3)));
static bool send_text(int socket, const char *format, ...)
{
    char text[2048];
    va_list args;
    va_start(args, format);
    int size = vsnprintf(text, sizeof text, format, args);
    va_end(args);
    return send_all(socket, text, (size_t)size);
}

/* Until the client goes, or the server ends. */
static void wait_for_end(int socket)
{
    char byte;
    while (recv(socket, &byte, 1, 0) > 0)
        ;
}

static void note_abort(fault_server *server)
{
    strl_mutex_lock(&server->mutex);
    server->aborted += !server->ending;
    strl_mutex_unlock(&server->mutex);
}

/* False where the connection is over. */
static bool send_body(fault_server *server, int socket, const fault_rule *rule, const uint8_t *data, uint64_t size)
{
    uint64_t end = (rule->cut || rule->stall) && rule->after < size ? rule->after : size;
    uint8_t chunk[CHUNK_BYTES];
    for (uint64_t at = 0; at < end;) {
        size_t step = end - at < sizeof chunk ? (size_t)(end - at) : sizeof chunk;
        for (size_t i = 0; i < step; i++)
            chunk[i] = data[at + i] ^ (rule->wrong_bytes ? 0x55 : 0);
        if (!send_all(socket, chunk, step)) {
            note_abort(server);
            return false;
        }
        at += step;
    }
    if (rule->stall) {
        wait_for_end(socket);
        note_abort(server);
    }
    return !rule->cut && !rule->stall;
}

static bool send_endless(fault_server *server, int socket)
{
    for (unsigned i = 0; send_text(socket, "X-Filler-%u: %0512u\r\n", i, i); i++)
        ;
    note_abort(server);
    return false;
}

static bool condition_holds(const fault_content *content, const fault_request *request)
{
    if (!request->asked.conditional || content->ignore_conditions)
        return true;
    const char *now = content->etag ? content->etag : content->modified ? content->modified : "";
    return strcmp(request->condition, now) == 0;
}

static bool send_fields(int socket, const fault_content *content, const fault_rule *rule)
{
    return (!content->etag || send_text(socket, "ETag: %s\r\n", content->etag)) &&
           (!content->modified || send_text(socket, "Last-Modified: %s\r\n", content->modified)) &&
           (!rule->field || send_text(socket, "%s\r\n", rule->field));
}

static bool send_range(fault_server *server, int socket, const fault_content *content, const fault_rule *rule,
                       const fault_request *request)
{
    uint64_t first = request->asked.first + (uint64_t)(int64_t)rule->shift;
    uint64_t last = request->asked.last < content->size ? request->asked.last : content->size - 1;
    last += (uint64_t)(int64_t)(rule->shift + rule->longer);
    if (rule->longer) /* the header is what was asked for, the body goes on */
        last = last < content->size ? last : content->size - 1;
    uint64_t said = last - (uint64_t)(int64_t)rule->longer;
    bool sent = send_text(socket, "HTTP/1.1 206 Partial Content\r\n") && send_fields(socket, content, rule);
    if (sent && rule->endless_header)
        return send_endless(server, socket);
    if (sent && !rule->no_range_field)
        sent = send_text(socket, "Content-Range: bytes %" PRIu64 "-%" PRIu64 "/%zu\r\n", first, said, content->size);
    if (!sent || !send_text(socket, "Content-Length: %" PRIu64 "\r\n\r\n", last + 1 - first)) {
        note_abort(server);
        return false;
    }
    return send_body(server, socket, rule, content->data + first, last + 1 - first);
}

static bool send_status(int socket, unsigned status, const char *field)
{
    return send_text(socket, "HTTP/1.1 %u Told So\r\n%s%sContent-Length: 5\r\n\r\ntold\n", status, field ? field : "",
                     field ? "\r\n" : "");
}

static bool answer_model(fault_server *server, int socket, fault_request *request)
{
    strl_mutex_lock(&server->mutex);
    unsigned number = server->asked_count++;
    server->asked[number % FAULT_MOST_ASKED] = request->asked;
    const fault_content content = server->content;
    const fault_rule rule = server->script ? server->script(server->context, number, &request->asked) : (fault_rule){0};
    strl_mutex_unlock(&server->mutex);
    if (rule.delay_ms) {
        struct pollfd wait = {.fd = socket, .events = POLLRDHUP};
        poll(&wait, 1, (int)rule.delay_ms); /* a client that goes, or the server's end, ends it */
    }
    if (rule.late_excess && !send_text(socket, "bytes behind the end of an answer\n"))
        return false;
    if (rule.status)
        return send_status(socket, rule.status, rule.field);
    if (!condition_holds(&content, request))
        return send_status(socket, 412, NULL);
    if (rule.whole || !request->has_range)
        return send_text(socket, "HTTP/1.1 200 OK\r\nContent-Length: %zu\r\n\r\n", content.size) &&
               send_body(server, socket, &rule, content.data, content.size);
    if (request->asked.first >= content.size)
        return send_text(socket, "HTTP/1.1 416 No\r\nContent-Range: bytes */%zu\r\nContent-Length: 0\r\n\r\n",
                         content.size);
    return send_range(server, socket, &content, &rule, request);
}

static bool answer(fault_server *server, int socket, fault_request *request)
{
    request->asked.redirected = strcmp(request->path, "/redirect") == 0;
    if (strcmp(request->path, "/model") == 0)
        return answer_model(server, socket, request);
    if (request->asked.redirected)
        return send_status(socket, 302, "Location: /model");
    if (strcmp(request->path, "/moved") == 0)
        return send_text(socket,
                         "HTTP/1.1 302 Told So\r\nLocation: http://127.0.0.1:%u/model\r\nContent-Length: 0\r\n\r\n",
                         (unsigned)server->port);
    if (strcmp(request->path, "/loop") == 0)
        return send_status(socket, 302, "Location: /loop");
    if (strcmp(request->path, "/elsewhere") == 0)
        return send_status(socket, 302, "Location: ftp://127.0.0.1/model");
    return send_status(socket, 404, NULL);
}

/* ---- connections */

static void *serve(void *context)
{
    connection *own = context;
    char text[REQUEST_BYTES];
    fault_request request;
    while (read_request(own->socket, text)) {
        parse_request(text, &request);
        if (!answer(own->server, own->socket, &request))
            break;
    }
    shutdown(own->socket, SHUT_RDWR); /* closed with the slot: its number may not be used anew before */
    strl_mutex_lock(&own->server->mutex);
    own->ended = true;
    strl_mutex_unlock(&own->server->mutex);
    return NULL;
}

/* Mutex held: a slot that was never used, or whose connection has ended. NULL: none. */
static connection *free_slot(fault_server *server)
{
    for (unsigned i = 0; i < server->connection_count; i++) {
        connection *old = &server->connections[i];
        if (!old->ended)
            continue;
        pthread_join(old->thread, NULL);
        close(old->socket);
        return old;
    }
    return server->connection_count < MOST_CONNECTIONS ? &server->connections[server->connection_count++] : NULL;
}

static void *accept_all(void *context)
{
    fault_server *server = context;
    for (;;) {
        int socket = accept(server->listener, NULL, NULL), one = 1;
        if (socket < 0 && errno == EINTR)
            continue;
        if (socket < 0)
            return NULL;
        setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
        strl_mutex_lock(&server->mutex);
        connection *made = server->ending ? NULL : free_slot(server);
        if (made) {
            *made = (connection){.server = server, .socket = socket};
            assert_int_equal(pthread_create(&made->thread, NULL, serve, made), 0);
        }
        strl_mutex_unlock(&server->mutex);
        if (!made)
            close(socket);
    }
}

void fault_server_restart(fault_server *server)
{
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons(server->port)};
    socklen_t size = sizeof address;
    int one = 1;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    server->ending = false;
    server->listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    assert_true(server->listener >= 0);
    setsockopt(server->listener, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    assert_int_equal(bind(server->listener, (struct sockaddr *)&address, sizeof address), 0);
    assert_int_equal(listen(server->listener, 128), 0);
    assert_int_equal(getsockname(server->listener, (struct sockaddr *)&address, &size), 0);
    server->port = ntohs(address.sin_port);
    assert_int_equal(pthread_create(&server->acceptor, NULL, accept_all, server), 0);
    server->listens = true;
}

fault_server *fault_server_create(const fault_content *content, fault_script script, void *context)
{
    fault_server *server = calloc(1, sizeof *server);
    assert_non_null(server);
    strl_mutex_init(&server->mutex);
    server->content = *content;
    server->script = script;
    server->context = context;
    fault_server_restart(server);
    return server;
}

void fault_server_kill(fault_server *server)
{
    if (!server->listens)
        return;
    strl_mutex_lock(&server->mutex);
    server->ending = true;
    for (unsigned i = 0; i < server->connection_count; i++)
        shutdown(server->connections[i].socket, SHUT_RDWR);
    strl_mutex_unlock(&server->mutex);
    shutdown(server->listener, SHUT_RDWR); /* accept comes back */
    pthread_join(server->acceptor, NULL);
    close(server->listener);
    for (unsigned i = 0; i < server->connection_count; i++) {
        pthread_join(server->connections[i].thread, NULL);
        close(server->connections[i].socket);
    }
    server->connection_count = 0;
    server->listens = false;
}

void fault_server_destroy(fault_server *server)
{
    if (!server)
        return;
    fault_server_kill(server);
    strl_mutex_deinit(&server->mutex);
    free(server);
}

/* ---- asking it */

const char *fault_server_url(const fault_server *server, const char *path)
{
    static char urls[4][128];
    static unsigned turn;
    char *url = urls[turn++ % 4];
    snprintf(url, sizeof urls[0], "http://127.0.0.1:%u%s", (unsigned)server->port, path);
    return url;
}

void fault_server_set_content(fault_server *server, const fault_content *content)
{
    strl_mutex_lock(&server->mutex);
    server->content = *content;
    strl_mutex_unlock(&server->mutex);
}

unsigned fault_server_asked(fault_server *server, fault_asked *asked, unsigned most)
{
    strl_mutex_lock(&server->mutex);
    unsigned count = server->asked_count, first = count > most ? count - most : 0;
    for (unsigned i = first; asked && i < count; i++)
        asked[i - first] = server->asked[i % FAULT_MOST_ASKED];
    strl_mutex_unlock(&server->mutex);
    return count;
}

unsigned fault_server_aborted(fault_server *server)
{
    strl_mutex_lock(&server->mutex);
    unsigned aborted = server->aborted;
    strl_mutex_unlock(&server->mutex);
    return aborted;
}
