/* The head of a request: the few lines that matter, and lines that no client of good faith sends. */
#include <string.h>
#include <strings.h>

#include "serve/exchange.h"

static void refuse(strl__exchange *exchange, const char *sentence)
{
    if (exchange->request.refusal.status == 0)
        exchange->request.refusal = (strl__refusal){400, sentence};
}

/* A line of which there may be one alone. */
static void take_single(strl__exchange *exchange, const char **place, const char *value)
{
    if (*place)
        refuse(exchange, "a line of the request's head is there twice");
    *place = value;
}

static void take_list(strl__exchange *exchange, const char *lines[STRL__SAME_HEADERS], const char *value)
{
    unsigned count = 0;
    while (count < STRL__SAME_HEADERS && lines[count])
        count++;
    if (count == STRL__SAME_HEADERS)
        refuse(exchange, "a condition of the request has more than four lines");
    else
        lines[count] = value;
}

static void take_framing(strl__exchange *exchange, const char *name, const char *value)
{
    if (strcasecmp(name, "Host") == 0) {
        exchange->host_lines++;
    } else if (strcasecmp(name, "Content-Length") == 0) {
        exchange->length_lines++;
        exchange->request.has_body |= strcmp(value, "0") != 0;
    } else if (strcasecmp(name, "Transfer-Encoding") == 0) {
        exchange->encoding_lines++;
        exchange->request.has_body = true;
    }
}

static enum MHD_Result take_line(void *cls, enum MHD_ValueKind kind, const char *name, const char *value)
{
    (void)kind;
    strl__exchange *exchange = cls;
    strl__conditions *conditions = &exchange->request.conditions;
    const struct {
        const char *name, **place;
    } singles[] = {
        {"Range", &conditions->range},
        {"If-Range", &conditions->if_range},
        {"If-Modified-Since", &conditions->modified_since},
        {"If-Unmodified-Since", &conditions->unmodified_since},
    };
    value = value ? value : "";
    if (!strl__is_token(name))
        refuse(exchange, "a line of the request's head has a name that is none");
    for (size_t i = 0; i < sizeof singles / sizeof *singles; i++)
        if (strcasecmp(name, singles[i].name) == 0)
            take_single(exchange, singles[i].place, value);
    if (strcasecmp(name, "If-Match") == 0)
        take_list(exchange, conditions->match, value);
    else if (strcasecmp(name, "If-None-Match") == 0)
        take_list(exchange, conditions->none_match, value);
    else if (strcasecmp(name, "Accept") == 0)
        exchange->request.accept = value;
    else
        take_framing(exchange, name, value);
    return MHD_YES;
}

void strl__exchange_read_head(strl__exchange *exchange, struct MHD_Connection *connection)
{
    MHD_get_connection_values(connection, MHD_HEADER_KIND, take_line, exchange);
    if (exchange->host_lines > 1)
        refuse(exchange, "the request names two hosts");
    /* Two readers of such a head could disagree about where the next request begins. */
    if (exchange->length_lines > 1 || exchange->encoding_lines > 1 ||
        (exchange->length_lines && exchange->encoding_lines))
        refuse(exchange, "the request says twice how long its body is");
}
