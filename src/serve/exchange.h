/* One request and its answer on their way through the library. Internal. */
#ifndef STRL_SERVE_EXCHANGE_H
#define STRL_SERVE_EXCHANGE_H

#include "serve/server.h"

typedef struct strl__exchange {
    strl_server *server;          /* borrowed */
    strl__connection *connection; /* borrowed */
    uint64_t start_ns;
    char *shown, *target; /* owned; as it came, and what parsing writes to */
    char method[24];
    bool head_read, is_admitted;
    strl__request request;
    unsigned host_lines, length_lines, encoding_lines;
    unsigned status;     /* of the answer; 0 = none */
    uint64_t sent_bytes; /* of its body */
} strl__exchange;

/* Gathers what the server looks at from the request's head, and what is wrong with it. */
void strl__exchange_read_head(strl__exchange *exchange, struct MHD_Connection *connection);
/* Hands the answer to the library. Takes its body over. */
enum MHD_Result strl__exchange_send(strl__exchange *exchange, struct MHD_Connection *connection, strl__answer *answer);

#endif
