/* An HTTP server of a folder of containers: byte ranges, listings, node queries, metrics. docs/serve.md says what it
 * answers. It is for a desk or a lab; it speaks no TLS and knows no users. */
#ifndef STRL_SERVE_SERVE_H
#define STRL_SERVE_SERVE_H

#include <stdint.h>

#include "stroll/error.h"

#define STRL_SERVE_CONNECTIONS 256u
#define STRL_SERVE_REQUEST_BYTES (32u << 10)
#define STRL_SERVE_ANSWER_BYTES ((uint64_t)32 << 20)
#define STRL_SERVE_HELD_BYTES ((uint64_t)64 << 20)
#define STRL_SERVE_TIMEOUT_NS ((uint64_t)30000000000)

typedef struct strl_server strl_server;

/* Zero-initialise: every 0 but the port's takes its default. Texts are copied. */
typedef struct strl_server_desc {
    const char *folder;
    const char *host;                 /* NULL = 127.0.0.1 */
    uint16_t port;                    /* 0 = a free one */
    uint32_t connections;             /* at once; 0 = 256 */
    uint32_t connections_per_address; /* 0 = as many as connections */
    uint32_t threads;                 /* 0 = by the processors, 2 to 8 */
    uint32_t request_bytes;           /* of a request's head, roughly; 0 = 32 KiB */
    uint64_t answer_bytes;            /* most of bytes of a query's answer; 0 = 32 MiB */
    uint64_t held_bytes;              /* of memory of answers under way, 503 beyond it; 0 = 64 MiB */
    uint64_t bandwidth;               /* bytes a second of all answers together; 0 = no limit */
    double rate;                      /* requests a second of one address; 0 = no limit */
    uint64_t timeout_ns;              /* without progress, then a connection is ended; 0 = 30 s */
    /* whose pages may read: Access-Control-Allow-Origin; NULL = "*", "" = nobody's */
    const char *origin;
    /* One line of the access log, without its end. NULL = none. Called by several threads at once, as is complain. */
    void (*log)(void *context, const char *line);
    /* A sentence about what is wrong with the server itself. NULL = none. */
    void (*complain)(void *context, const char *sentence);
    void *context;
} strl_server_desc;

/* Files that the process must be allowed to have open for this desc. */
uint64_t strl_server_files(const strl_server_desc *desc);
/* Listens and answers, by threads of its own, until it is closed. Fails with STRL_ERR_IO where there is no such folder,
 * with STRL_ERR_NETWORK where it cannot listen. */
strl_status strl_server_open(const strl_server_desc *desc, strl_server **server, strl_error *err);
uint16_t strl_server_port(const strl_server *server);
/* Accepts no more, lets answers under way end for at most grace_ns, then ends all. NULL is legal. */
void strl_server_close(strl_server *server, uint64_t grace_ns);

#endif
