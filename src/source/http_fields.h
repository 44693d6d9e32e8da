/* What a server's answer says of itself, read line by line: status, range, validators, encoding (RFC 9110). Pure
 * functions on bytes that are hostile until checked; nothing here knows of sockets. */
#ifndef STRL_SOURCE_HTTP_FIELDS_H
#define STRL_SOURCE_HTTP_FIELDS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define STRL__HTTP_HEADER_BYTES ((size_t)64 << 10) /* of one answer, redirects apart: a longer one is refused */

/* Which content it is: what the next requests are conditional on. */
typedef struct strl__http_identity {
    uint64_t total;    /* bytes of the whole */
    char etag[200];    /* strong, with its quotes; "" = none */
    char modified[64]; /* Last-Modified as it was sent; "" = none */
} strl__http_identity;

typedef struct strl__http_fields {
    unsigned status;  /* 0 before the first line */
    size_t bytes;     /* of header so far */
    bool range_known; /* Content-Range is there, and is "bytes first-last/total" */
    uint64_t first, last;
    strl__http_identity identity; /* its total also of "bytes * /total" (without the space); 0 = not known */
    char encoding[32];            /* of the content; "" = as it is */
} strl__http_fields;

/* One line as it comes, with or without its end. A status line begins the next answer: all before it is forgotten. */
void strl__http_fields_line(strl__http_fields *fields, const char *line, size_t size);

/* "bytes 0-4095/1234". False where it is anything else. */
bool strl__http_parse_range(const char *text, size_t size, strl__http_fields *fields);
/* A strong entity tag, copied with its quotes. False where it is weak, broken or too long: then tag is "". */
bool strl__http_parse_etag(const char *text, size_t size, char *tag, size_t tag_size);

#endif
