/* The server and one exchange of it: what server.c and exchange.c share. Internal. */
#ifndef STRL_SERVE_SERVER_H
#define STRL_SERVE_SERVER_H

#include <microhttpd.h>

#include "serve/answer.h"
#include "serve/serve.h"

struct strl_server {
    strl__site site;
    strl__rates rates;
    strl__flow flow;
    struct MHD_Daemon *daemon;
    int listener;
    uint16_t port;
    char *origin; /* owned; "" = nobody's */
    uint64_t timeout_ns;
    void (*log)(void *context, const char *line);
    void *context;
    strl_thread *tender;
    atomic_bool stopping;
    _Atomic uint32_t under_way; /* requests whose answers have not ended */
    strl_server *next_running;  /* for the library's panic */
};

void strl__server_log(strl_server *server, const char *line);

/* Callbacks of the library; cls is the server. */
void *strl__exchange_begin(void *cls, const char *target, struct MHD_Connection *connection);
enum MHD_Result strl__exchange_answer(void *cls, struct MHD_Connection *connection, const char *url, const char *method,
                                      const char *version, const char *data, size_t *data_bytes, void **exchange);
void strl__exchange_end(void *cls, struct MHD_Connection *connection, void **exchange,
                        enum MHD_RequestTerminationCode reason);
/* Ends what the library began on the connection and did not end: with requests that it refuses in the middle of their
 * first line, libmicrohttpd 0.9.75 forgets that. On the connection's thread; NULL is legal. */
void strl__exchange_drop(strl__connection *connection);

#endif
