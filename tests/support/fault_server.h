/* A small web server of one file on 127.0.0.1 that does what a test tells it, well or badly. It answers byte
 * ranges, keeps connections open, knows If-Match and If-Unmodified-Since, and remembers what it was asked for.
 *
 *     /model      the file                     /redirect   302 to /model
 *     /loop       302 to itself                /elsewhere  302 to an address that is not http
 *     /moved      302 to /model, by its whole address
 *     all else    404 */
#ifndef STRL_TESTS_SUPPORT_FAULT_SERVER_H
#define STRL_TESTS_SUPPORT_FAULT_SERVER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define FAULT_MOST_ASKED 4096u

typedef struct fault_server fault_server;

/* What to do with one request. Zero: as it should be. */
typedef struct fault_rule {
    unsigned status; /* instead of 206, without the file */
    bool whole;      /* 200 and all of the file, as a server does that knows no ranges */
    bool cut, stall; /* after `after` bytes of the body: the connection is closed; nothing comes any more */
    uint64_t after;
    unsigned delay_ms;   /* before the answer */
    int shift;           /* of the range that is said and sent */
    int longer;          /* bytes behind the range that is asked for */
    bool late_excess;    /* before the answer comes more of the answer before it than that had said */
    bool wrong_bytes;    /* every byte is another */
    bool no_range_field; /* Content-Range is left out */
    bool endless_header;
    const char *field; /* a further line of the header, without its end; NULL = none */
} fault_rule;

/* One request for /model. */
typedef struct fault_asked {
    uint64_t first, last;
    bool conditional; /* If-Match or If-Unmodified-Since */
    bool redirected;  /* what was asked for is /redirect */
    bool named;       /* a user and a password came along */
} fault_asked;

/* Called for each request of /model, by any thread, one at a time. number: 0, 1, 2, ... since the server was made. */
typedef fault_rule (*fault_script)(void *context, unsigned number, const fault_asked *asked);

/* What is served; borrowed. */
typedef struct fault_content {
    const uint8_t *data;
    size_t size;
    const char *etag;       /* with its quotes; NULL = none */
    const char *modified;   /* NULL = none */
    bool ignore_conditions; /* answers 206 whatever If-Match says */
} fault_content;

/* Listens from then on, on a port that was free. Fails the running test where it cannot. */
fault_server *fault_server_create(const fault_content *content, fault_script script, void *context);
void fault_server_destroy(fault_server *server); /* NULL is legal */
/* http://127.0.0.1:PORT and path; good until the 4th call after. */
const char *fault_server_url(const fault_server *server, const char *path);
void fault_server_set_content(fault_server *server, const fault_content *content);
/* All connections end, nobody listens. */
void fault_server_kill(fault_server *server);
/* On the same port. */
void fault_server_restart(fault_server *server);

/* How many requests there were for /model; copies the last `most` at most, the oldest first, if asked is not NULL. */
unsigned fault_server_asked(fault_server *server, fault_asked *asked, unsigned most);
/* Connections that the client closed in the middle of an answer. */
unsigned fault_server_aborted(fault_server *server);

#endif
