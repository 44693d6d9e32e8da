/* The server's life: limits, threads, log; the exchanges are in exchange.c. */
#include "serve/server.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "serve/text.h"

#define SURPLUS_CONNECTIONS 32u /* that are told there is no room; more wait in the system's queue */
#define OTHER_FILES 64u
#define MOST_THREADS 8u
#define TICK_NS ((uint64_t)20000000)
#define IDLE_MODEL_NS ((uint64_t)60000000000)

/* ---- what is said ---- */

void strl__server_log(strl_server *server, const char *line)
{
    if (server->log)
        server->log(server->context, line);
}

/* The library's remarks are on what clients did; they quote them, so they are escaped and go to the log alone. */
static void take_remark(void *cls, const char *format, va_list values) __attribute__((format(printf, 2, 0)));
static void take_remark(void *cls, const char *format, va_list values)
{
    char remark[400], escaped[800], time[STRL__DATE_BYTES], line[900];
    vsnprintf(remark, sizeof remark, format, values);
    remark[strcspn(remark, "\n")] = 0;
    strl__log_text(remark, escaped, sizeof escaped);
    strl__format_time(strl_clock_wall_ns(), time);
    snprintf(line, sizeof line, "%s - remark: %s", time, escaped);
    strl__server_log(cls, line);
}

/* The library has one such function for the process: it is set once, and tells all servers. */
static strl_once running_once = STRL_ONCE_INIT;
static strl_mutex running_mutex;
static strl_server *running; /* under the mutex */

static void panic(void *cls, const char *file, unsigned line, const char *reason)
{
    (void)cls, (void)file, (void)line;
    char sentence[300];
    snprintf(sentence, sizeof sentence, "the HTTP library found a fault of its own and gives up: %.200s",
             reason ? reason : "it does not say which");
    sentence[strcspn(sentence, "\n")] = 0;
    strl_mutex_lock(&running_mutex);
    for (strl_server *server = running; server; server = server->next_running)
        strl__site_complain(&server->site, sentence);
    abort();
}

static void init_running(void)
{
    strl_mutex_init(&running_mutex);
    MHD_set_panic_func(panic, NULL);
}

static void add_running(strl_server *server)
{
    strl_once_run(&running_once, init_running);
    strl_mutex_lock(&running_mutex);
    server->next_running = running;
    running = server;
    strl_mutex_unlock(&running_mutex);
}

static void remove_running(const strl_server *server)
{
    strl_mutex_lock(&running_mutex);
    strl_server **at = &running;
    while (*at != server)
        at = &(*at)->next_running;
    *at = server->next_running;
    strl_mutex_unlock(&running_mutex);
}

/* ---- connections ---- */

static void notice_connection(void *cls, struct MHD_Connection *connection, void **context,
                              enum MHD_ConnectionNotificationCode what)
{
    strl_server *server = cls;
    if (what == MHD_CONNECTION_NOTIFY_CLOSED) {
        strl__exchange_drop(*context);
        strl__connections_remove(&server->site.connections, *context);
        *context = NULL;
        return;
    }
    const union MHD_ConnectionInfo *address = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CLIENT_ADDRESS);
    const union MHD_ConnectionInfo *socket = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
    *context = socket ? strl__connections_add(&server->site.connections, connection, socket->connect_fd,
                                              address ? address->client_addr : NULL)
                      : NULL;
    atomic_fetch_add(&server->site.metrics.connections, 1);
}

static void resume(void *handle)
{
    MHD_resume_connection(handle);
}

/* Looks after what no request drives: connections without progress, connections that wait for bandwidth or for their
 * turn to query, idle models. */
static void tend(void *context)
{
    strl_server *server = context;
    strl__metrics *metrics = &server->site.metrics;
    uint64_t tick_ns = server->timeout_ns / 8 < TICK_NS ? server->timeout_ns / 8 + 1 : TICK_NS,
             models_ns = strl_clock_ns();
    while (!atomic_load(&server->stopping)) {
        strl_sleep_ns(tick_ns);
        strl__connections_resume(&server->site.connections, false, resume);
        uint32_t idle, ended = strl__connections_end_idle(&server->site.connections, server->timeout_ns, &idle);
        atomic_fetch_add(&metrics->rejected[STRL__REJECTED_TIMEOUT], ended - idle);
        atomic_fetch_add(&metrics->rejected[STRL__REJECTED_IDLE], idle);
        if (strl_clock_ns() - models_ns < IDLE_MODEL_NS / 4)
            continue;
        models_ns = strl_clock_ns();
        strl__models_forget(&server->site.models, IDLE_MODEL_NS);
    }
}

/* ---- opening ---- */

static uint32_t connections_of(const strl_server_desc *desc)
{
    return desc->connections ? desc->connections : STRL_SERVE_CONNECTIONS;
}

static uint32_t capacity_of(const strl_server_desc *desc)
{
    return connections_of(desc) + SURPLUS_CONNECTIONS;
}

static unsigned threads_of(const strl_server_desc *desc)
{
    unsigned threads = desc->threads ? desc->threads : strl_cpu_count();
    return threads < 2 ? 2 : threads > MOST_THREADS ? MOST_THREADS : threads;
}

uint64_t strl_server_files(const strl_server_desc *desc)
{
    return 2 * (uint64_t)capacity_of(desc) + STRL__OPEN_MODELS + OTHER_FILES;
}

static size_t keep_as_it_is(void *cls, struct MHD_Connection *connection, char *text)
{
    (void)cls, (void)connection;
    return strlen(text);
}

static strl_status start_daemon(strl_server *server, const strl_server_desc *desc, strl_error *err)
{
    size_t request_bytes = desc->request_bytes ? desc->request_bytes : STRL_SERVE_REQUEST_BYTES;
    server->daemon = MHD_start_daemon(
        MHD_USE_EPOLL_INTERNAL_THREAD | MHD_USE_ERROR_LOG | MHD_USE_ITC | MHD_ALLOW_SUSPEND_RESUME, 0, NULL, NULL,
        strl__exchange_answer, server, MHD_OPTION_EXTERNAL_LOGGER, take_remark,
        server, /* first, so that it hears of the others */
        MHD_OPTION_LISTEN_SOCKET, server->listener, MHD_OPTION_THREAD_POOL_SIZE, threads_of(desc),
        MHD_OPTION_CONNECTION_LIMIT, (unsigned)capacity_of(desc), MHD_OPTION_CONNECTION_MEMORY_LIMIT, request_bytes,
        MHD_OPTION_STRICT_FOR_CLIENT, 1, MHD_OPTION_UNESCAPE_CALLBACK, keep_as_it_is, server,
        MHD_OPTION_URI_LOG_CALLBACK, strl__exchange_begin, server, MHD_OPTION_NOTIFY_COMPLETED, strl__exchange_end,
        server, MHD_OPTION_NOTIFY_CONNECTION, notice_connection, server, MHD_OPTION_END);
    if (!server->daemon)
        return strl__fail(err, STRL_ERR_NETWORK, "cannot start the HTTP server of port %u", server->port);
    return STRL_OK;
}

static strl_status prepare(strl_server *server, const strl_server_desc *desc, strl_error *err)
{
    uint32_t most = connections_of(desc);
    uint32_t per_address = desc->connections_per_address ? desc->connections_per_address : most;
    server->origin = strl__strdup(desc->origin ? desc->origin : "*");
    bool room = strl__connections_init(&server->site.connections, most, per_address, capacity_of(desc));
    if (!server->origin || !room)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %u connections", most);
    return strl_folder_open(desc->folder, &server->site.folder, err);
}

static void adopt(strl_server *server, const strl_server_desc *desc)
{
    server->listener = -1;
    server->timeout_ns = desc->timeout_ns ? desc->timeout_ns : STRL_SERVE_TIMEOUT_NS;
    server->site.answer_bytes = desc->answer_bytes ? desc->answer_bytes : STRL_SERVE_ANSWER_BYTES;
    server->log = desc->log;
    server->context = desc->context;
    server->site.complain = desc->complain;
    server->site.context = desc->context;
    server->site.held_most = desc->held_bytes ? desc->held_bytes : STRL_SERVE_HELD_BYTES;
    server->site.most_queries = threads_of(desc) - 1; /* one thread is left for what does not take long */
    strl__models_init(&server->site.models);
    strl__rates_init(&server->rates, desc->rate);
    strl__flow_init(&server->flow, desc->bandwidth);
}

strl_status strl_server_open(const strl_server_desc *desc, strl_server **server, strl_error *err)
{
    *server = NULL;
    strl_server *made = strl__alloc_zero(1, sizeof *made);
    if (!made)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a server");
    adopt(made, desc);
    add_running(made);
    strl_status status = prepare(made, desc, err);
    if (status == STRL_OK)
        status =
            strl_socket_listen(desc->host ? desc->host : "127.0.0.1", desc->port, &made->listener, &made->port, err);
    if (status == STRL_OK)
        status = start_daemon(made, desc, err);
    if (status == STRL_OK)
        status = strl_thread_start(&made->tender, tend, made, err);
    if (status == STRL_OK)
        *server = made;
    else
        strl_server_close(made, 0);
    return status;
}

uint16_t strl_server_port(const strl_server *server)
{
    return server->port;
}

/* ---- closing ---- */

static void let_answers_end(strl_server *server, uint64_t grace_ns)
{
    uint64_t start_ns = strl_clock_ns();
    while (atomic_load(&server->under_way) > 0 && strl_clock_ns() - start_ns < grace_ns)
        strl_sleep_ns(5000000);
}

static void stop_daemon(strl_server *server, uint64_t grace_ns)
{
    int listener = MHD_quiesce_daemon(server->daemon);
    if (listener >= 0)
        strl_socket_end(listener); /* ours again, but the library's threads may still know its number */
    let_answers_end(server, grace_ns);
    atomic_store(&server->stopping, true);
    strl_thread_join(server->tender);
    strl__connections_resume(&server->site.connections, true, resume); /* the library cannot end what is suspended */
    MHD_stop_daemon(server->daemon);
    strl_socket_close(listener);
}

void strl_server_close(strl_server *server, uint64_t grace_ns)
{
    if (!server)
        return;
    if (server->daemon)
        stop_daemon(server, grace_ns);
    else
        strl_socket_close(server->listener);
    remove_running(server);
    strl_folder_close(server->site.folder);
    strl__connections_deinit(&server->site.connections);
    strl__models_deinit(&server->site.models);
    strl__rates_deinit(&server->rates);
    strl__flow_deinit(&server->flow);
    strl__free(server->origin);
    strl__free(server);
}
