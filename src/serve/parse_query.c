/* The queries of the sample tree's paper, 6.3: nodes=TREE:ID,ID,... and subtrees=TREE:ID/DEPTH,... */
#include <string.h>

#include "serve/parse.h"

#define REFUSED(code, text) ((strl__refusal){code, text})
#define FINE ((strl__refusal){0, NULL})

/* In place; a form's "+" is a space. False where it is malformed or has a control character. */
static bool decode(char *text)
{
    char *out = text;
    while (*text) {
        int c = (unsigned char)*text++;
        if (c == '%') {
            int high = strl__hex_digit(text[0]), low = high < 0 ? -1 : strl__hex_digit(text[1]);
            if (low < 0)
                return false;
            c = high << 4 | low;
            text += 2;
        } else if (c == '+') {
            c = ' ';
        }
        if (c < 0x20 || c == 0x7f)
            return false;
        *out++ = (char)c;
    }
    *out = 0;
    return true;
}

/* Digits alone; false where there are none or the number is above most. */
static bool take_number(const char **at, uint64_t most, uint64_t *number)
{
    const char *text = *at;
    *number = 0;
    for (; *text >= '0' && *text <= '9'; text++) {
        unsigned digit = (unsigned)(*text - '0');
        if (*number > (most - digit) / 10)
            return false;
        *number = *number * 10 + digit;
    }
    bool some = text != *at;
    *at = text;
    return some;
}

static bool take_item(const char **at, bool depths, strl__query_item *item)
{
    uint64_t node, depth = 0;
    if (!take_number(at, UINT32_MAX - 1, &node))
        return false;
    if (depths) {
        if (*(*at)++ != '/' || !take_number(at, UINT16_MAX, &depth))
            return false;
    }
    *item = (strl__query_item){(uint32_t)node, (uint32_t)depth};
    return true;
}

static strl__refusal take_items(const char *value, strl__query_kind kind, strl__query *query)
{
    uint64_t tree;
    if (query->kind != STRL__QUERY_NONE)
        return REFUSED(400, "the query asks twice for nodes");
    if (!take_number(&value, UINT32_MAX - 1, &tree) || *value++ != ':')
        return REFUSED(400, "the query names no tree: expected nodes=TREE:ID,ID,... or subtrees=TREE:ID/DEPTH,...");
    query->kind = kind;
    query->tree = (uint32_t)tree;
    for (;; value++) {
        strl__query_item item;
        if (!take_item(&value, kind == STRL__QUERY_SUBTREES, &item))
            return REFUSED(400,
                           "the query has a node that is not well-formed: expected numbers below 2^32 - 1, and with "
                           "subtrees a depth below 65536 behind a slash");
        if (query->count > 0 && item.node <= query->items[query->count - 1].node)
            return REFUSED(400, "the nodes of the query are not in increasing order");
        if (query->count == STRL__QUERY_ITEMS)
            return REFUSED(400, "the query asks for more than 4096 nodes or subtrees");
        query->items[query->count++] = item;
        if (*value != ',')
            break;
    }
    return *value ? REFUSED(400, "the query has something behind its last node") : FINE;
}

static strl__refusal take_format(const char *value, strl__query *query)
{
    if (strcmp(value, "json") == 0)
        query->format = STRL__FORMAT_JSON;
    else if (strcmp(value, "html") == 0)
        query->format = STRL__FORMAT_HTML;
    else
        return REFUSED(400, "the format is neither json nor html");
    return FINE;
}

static strl__refusal take_most(const char *value, strl__query *query)
{
    if (!take_number(&value, INT64_MAX, &query->most_bytes) || *value || query->most_bytes == 0)
        return REFUSED(400, "the most of bytes is not a number above 0");
    return FINE;
}

static strl__refusal take_parameter(char *text, strl__query *query)
{
    char *value = strchr(text, '=');
    if (value)
        *value++ = 0;
    else
        value = text + strlen(text);
    if (!decode(text) || !decode(value))
        return REFUSED(400, "the query is not well-formed");
    if (strcmp(text, "nodes") == 0)
        return take_items(value, STRL__QUERY_NODES, query);
    if (strcmp(text, "subtrees") == 0)
        return take_items(value, STRL__QUERY_SUBTREES, query);
    if (strcmp(text, "format") == 0)
        return take_format(value, query);
    if (strcmp(text, "most") == 0)
        return take_most(value, query);
    return REFUSED(400, "the query has a parameter that is none of nodes, subtrees, most and format");
}

strl__refusal strl__parse_query(char *text, strl__query *query)
{
    query->kind = STRL__QUERY_NONE;
    query->format = STRL__FORMAT_ANY;
    query->tree = query->count = 0;
    query->most_bytes = 0;
    strl__refusal refusal = FINE;
    while (text && *text && refusal.status == 0) {
        char *end = strchr(text, '&');
        if (end)
            *end++ = 0;
        if (*text)
            refusal = take_parameter(text, query);
        text = end;
    }
    return refusal;
}
