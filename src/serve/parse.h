/* What strangers send, taken apart: targets, queries, ranges, conditions, dates (RFC 9110, 9112). Pure functions on
 * zero-terminated text of any content; thread-safe, no allocation. Internal. */
#ifndef STRL_SERVE_PARSE_H
#define STRL_SERVE_PARSE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define STRL__PATH_BYTES 1024u     /* of a target's path, decoded */
#define STRL__COMPONENT_BYTES 255u /* of one name in it */
#define STRL__QUERY_ITEMS 4096u    /* nodes or subtrees of one query */
#define STRL__DATE_BYTES 32u
#define STRL__ETAG_BYTES 80u
#define STRL__SAME_HEADERS 4u /* lines of If-Match or of If-None-Match */

/* A refusal: an HTTP status and a sentence. status 0 = none. */
typedef struct strl__refusal {
    unsigned status;
    const char *sentence; /* static */
} strl__refusal;

static inline int strl__hex_digit(char c) /* -1 = none */
{
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
}

/* ---- the target ---- */

typedef struct strl__target {
    char path[STRL__PATH_BYTES + 1]; /* decoded UTF-8, plain names between slashes; "" = the root */
    bool is_folder;                  /* the root, or it ended in a slash */
    bool is_hidden;                  /* some name begins with a dot */
    bool is_server;                  /* "*": the server itself */
    char *query;                     /* borrowed from the target; NULL = none */
} strl__target;

/* Origin form, absolute form or "*". Writes zeros into raw, which target->query points into. */
strl__refusal strl__parse_target(char *raw, strl__target *target);

/* ---- the query ---- */

typedef enum strl__query_kind { STRL__QUERY_NONE, STRL__QUERY_NODES, STRL__QUERY_SUBTREES } strl__query_kind;
typedef enum strl__listing_format { STRL__FORMAT_ANY, STRL__FORMAT_HTML, STRL__FORMAT_JSON } strl__listing_format;

typedef struct strl__query_item {
    uint32_t node, depth; /* depth 0: the node alone */
} strl__query_item;

typedef struct strl__query {
    strl__query_kind kind;
    strl__listing_format format;
    uint32_t tree;
    uint64_t most_bytes; /* of the answer; 0 = not said */
    uint32_t count;
    strl__query_item items[STRL__QUERY_ITEMS]; /* node ids strictly increasing */
} strl__query;

/* text: without the question mark, NULL = none; is decoded in place. */
strl__refusal strl__parse_query(char *text, strl__query *query);

/* ---- ranges and conditions ---- */

typedef enum strl__range_kind {
    STRL__RANGE_WHOLE,  /* no Range, another unit, or several ranges: the whole is sent */
    STRL__RANGE_PART,   /* one range, cut to the file */
    STRL__RANGE_NOTHING /* nothing of it is in the file, or it is none */
} strl__range_kind;

typedef struct strl__range {
    strl__range_kind kind;
    uint64_t first, bytes; /* of STRL__RANGE_PART */
} strl__range;

strl__range strl__parse_range(const char *value, uint64_t file_bytes);

/* Whether an If-Match or If-None-Match line names the tag (with its quotes). weak: W/ does not matter. */
bool strl__etag_is_listed(const char *list, const char *etag, bool weak);

/* Any of the three forms of RFC 9110, 5.6.7; false where it is none. */
bool strl__parse_date(const char *text, int64_t *unix_s);
/* IMF-fixdate; seconds outside of the years 1 to 9999 are taken as the nearest inside. */
void strl__format_date(int64_t unix_s, char text[STRL__DATE_BYTES]);
/* 2025-05-20T12:34:56.789Z, by the same calendar. */
void strl__format_time(uint64_t unix_ns, char text[STRL__DATE_BYTES]);

/* Header values as they came; NULL = not there. */
typedef struct strl__conditions {
    const char *match[STRL__SAME_HEADERS], *none_match[STRL__SAME_HEADERS];
    const char *unmodified_since, *modified_since, *range, *if_range;
} strl__conditions;

typedef struct strl__validators {
    const char *etag; /* with its quotes, strong */
    int64_t modified_s;
    bool date_is_strong; /* the file has not been changed for some seconds, so its date tells it from others */
    uint64_t bytes;
} strl__validators;

/* RFC 9110, 13.2.2. Returns 200, 206 with the part, 304, 412 or 416. ranges: whether the method knows ranges. */
unsigned strl__decide(const strl__conditions *conditions, const strl__validators *validators, bool ranges,
                      strl__range *range);

/* ---- fields ---- */

/* Whether an Accept line asks for JSON rather than for a page. */
bool strl__prefers_json(const char *accept);
/* Whether name is a token of RFC 9110, 5.6.2, as names of fields are. */
bool strl__is_token(const char *name);

#endif
