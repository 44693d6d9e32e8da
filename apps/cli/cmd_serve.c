/* stroll serve: a folder of containers over HTTP, until a signal ends it. */
#include <errno.h>
#include <inttypes.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "interrupt.h"
#include "options.h"
#include "platform/socket.h"
#include "platform/thread.h"
#include "serve/serve.h"

#define PORT 8080
#define RATE 1000
#define LOOK_NS 50000000
#define GRACE_NS 1000000000

static const char notes[] =
    "DIR and the folders below it are listed at http://HOST:PORT/ (?format=json for programs). What is served is files whose\n"
    "names end in .stroll: whole, by byte ranges, and by nodes:\n"
    "\n"
    "  /NAME.stroll?nodes=TREE:ID,ID,...              these nodes\n"
    "  /NAME.stroll?subtrees=TREE:ID/DEPTH,...        these and so many levels below each\n"
    "  /metrics                                       counters, as Prometheus reads them\n"
    "\n"
    "There is no TLS and no password: whoever reaches the address can read DIR, and pages of any site can with --origin \"*\".\n"
    "INT, TERM, HUP or QUIT ends it, with exit status 0.";

/* Lines of several threads go to one stream, each whole. */
typedef struct journal {
    FILE *file; /* NULL = nobody wants to know */
    atomic_bool failed;
} journal;

static void put_complaint(void *context, const char *sentence)
{
    (void)context;
    fprintf(stderr, "stroll: %s\n", sentence);
}

/* Once: a disk that is full is so for each line. */
static void complain_of_log(journal *self, int code)
{
    if (!atomic_exchange(&self->failed, true) && self->file != stderr)
        fprintf(stderr, "stroll: warning: lines of the access log are lost: %s\n", strerror(code));
}

static void put_line(void *context, const char *line)
{
    journal *self = context;
    if (self->file && fprintf(self->file, "%s\n", line) < 0)
        complain_of_log(self, errno);
}

static strl_status open_journal(const char *path, bool quiet, journal *self, strl_error *err)
{
    *self = (journal){.file = quiet ? NULL : stderr};
    if (!path)
        return STRL_OK;
    self->file = fopen(path, "ae");
    if (!self->file)
        return strl__fail(err, STRL_ERR_IO, "cannot open %.300s: %s", path, strerror(errno));
    setvbuf(self->file, NULL, _IOLBF, 0);
    return STRL_OK;
}

static void close_journal(journal *self)
{
    if (self->file && self->file != stderr && fclose(self->file) != 0)
        complain_of_log(self, errno);
}

/* A server that runs out of files fails here and there later on. */
static strl_status allow_files(const strl_server_desc *desc, strl_error *err)
{
    uint64_t wanted = strl_server_files(desc), allowed = strl_process_allow_files(wanted);
    if (allowed >= wanted)
        return STRL_OK;
    return strl__fail(err, STRL_ERR_LIMIT,
                      "%" PRIu32 " connections need %" PRIu64 " open files, but the system allows this process %" PRIu64
                      ": raise that (ulimit -n) or lower --connections",
                      desc->connections, wanted, allowed);
}

static void announce(const strl_server_desc *desc, const strl_server *server, bool quiet)
{
    char place[320];
    if (quiet)
        return;
    strl_host_text(desc->host, strl_server_port(server), place, sizeof place);
    printf("serving %s at http://%s/\n", desc->folder, place);
    fflush(stdout);
    if (!strl_host_is_loopback(desc->host))
        fprintf(stderr, "stroll: warning: whoever reaches %s can read %s; there is no password and no TLS\n", place,
                desc->folder);
}

static strl_status serve(const strl_server_desc *desc, bool quiet, strl_error *err)
{
    strl_server *server;
    strl_cli_catch_interrupts();
    signal(SIGPIPE, SIG_IGN); /* who reads the log may go, the server stays */
    strl_status status = allow_files(desc, err);
    if (status == STRL_OK)
        status = strl_server_open(desc, &server, err);
    if (status != STRL_OK)
        return status;
    announce(desc, server, quiet);
    while (!strl_cli_interrupted())
        strl_sleep_ns(LOOK_NS);
    strl_server_close(server, GRACE_NS);
    return STRL_OK;
}

/* The values as the command line has them. */
typedef struct settings {
    uint64_t port, connections, per_address, threads, request_bytes, answer_bytes, bandwidth;
    double rate, timeout_s;
    const char *host, *origin, *log;
} settings;

static int parse(strl_cli_args *args, settings *set, strl_cli_list *folders)
{
    const strl_cli_option options[] = {
        {.name = "port",
         .letter = 'p',
         .kind = STRL_CLI_COUNT,
         .value = &set->port,
         .help = "where to listen; 0 = a free one (8080)",
         .least = 0,
         .most = 65535},
        {.name = "host",
         .kind = STRL_CLI_STRING,
         .value = &set->host,
         .argument = "ADDRESS",
         .help = "the address to listen at; 0.0.0.0 = every one (127.0.0.1)"},
        {.name = "connections",
         .kind = STRL_CLI_COUNT,
         .value = &set->connections,
         .help = "at once; others are told so (256)",
         .least = 1,
         .most = 65536},
        {.name = "per-address",
         .kind = STRL_CLI_COUNT,
         .value = &set->per_address,
         .help = "connections of one address at once (as many as --connections)",
         .least = 1,
         .most = 65536},
        {.name = "rate",
         .kind = STRL_CLI_REAL,
         .value = &set->rate,
         .argument = "N",
         .help = "requests of one address a second, twice as many at once; 0 = no limit (1000)",
         .least = 0,
         .most = 1e9},
        {.name = "bandwidth",
         .kind = STRL_CLI_BYTES,
         .value = &set->bandwidth,
         .help = "bytes a second of all answers together (no limit)",
         .least = 1024,
         .most = 0x1p50},
        {.name = "timeout",
         .kind = STRL_CLI_REAL,
         .value = &set->timeout_s,
         .argument = "SECONDS",
         .help = "a connection ends without a whole request, 64 KiB of an answer or a turn of a query for so long (30)",
         .least = 0.05,
         .most = 86400},
        {.name = "request-bytes",
         .kind = STRL_CLI_BYTES,
         .value = &set->request_bytes,
         .help = "of a request's line and head, roughly (32K)",
         .least = 4096,
         .most = 1 << 20},
        {.name = "answer-bytes",
         .kind = STRL_CLI_BYTES,
         .value = &set->answer_bytes,
         .help = "of the answer to a query for nodes, more is cut (32M)",
         .least = 4096,
         .most = 1 << 30},
        {.name = "threads",
         .kind = STRL_CLI_COUNT,
         .value = &set->threads,
         .help = "that answer (by the processors, 2 to 8)",
         .least = 2,
         .most = 8},
        {.name = "origin",
         .kind = STRL_CLI_STRING,
         .value = &set->origin,
         .argument = "ORIGIN",
         .help = "whose pages may read, such as https://example.org; \"\" = nobody's (*)"},
        {.name = "access-log",
         .kind = STRL_CLI_STRING,
         .value = &set->log,
         .argument = "FILE",
         .help = "a line a request is added to it (standard error)"},
    };
    const strl_cli_usage usage = {.positional = "DIR",
                                  .least = 1,
                                  .most = 1,
                                  .notes = notes,
                                  .options = options,
                                  .option_count = STRL_CLI_COUNT_OF(options)};
    int stop = strl_cli_parse(args, &usage, folders);
    if (stop < 0 && strpbrk(set->origin, "\r\n"))
        return strl_cli_usage_error(args, "--origin is one line");
    return stop;
}

static int run(strl_cli_args *args)
{
    settings set = {.port = PORT,
                    .connections = STRL_SERVE_CONNECTIONS,
                    .rate = RATE,
                    .timeout_s = 30,
                    .host = "127.0.0.1",
                    .origin = "*"};
    strl_cli_list folders;
    journal log;
    strl_error err = {0};
    int stop = parse(args, &set, &folders);
    if (stop >= 0)
        return stop;
    strl_status status = open_journal(set.log, args->quiet, &log, &err);
    const strl_server_desc desc = {
        .folder = folders.items[0],
        .host = set.host,
        .port = (uint16_t)set.port,
        .connections = (uint32_t)set.connections,
        .connections_per_address = (uint32_t)set.per_address,
        .threads = (uint32_t)set.threads,
        .request_bytes = (uint32_t)set.request_bytes,
        .answer_bytes = set.answer_bytes,
        .bandwidth = set.bandwidth,
        .rate = set.rate,
        .timeout_ns = (uint64_t)(set.timeout_s * 1e9),
        .origin = set.origin,
        .log = put_line,
        .complain = put_complaint,
        .context = &log,
    };
    if (status == STRL_OK) {
        status = serve(&desc, args->quiet, &err);
        close_journal(&log);
    }
    return status == STRL_OK ? 0 : strl_cli_fail(&err);
}

STRL_CLI_COMMAND(serve, "serve a folder of containers over HTTP", run);
