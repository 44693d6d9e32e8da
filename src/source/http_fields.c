#include "source/http_fields.h"

#include <string.h>
#include <strings.h>

#define MOST_DIGITS 19u /* of a number that fits 64 bits for certain */

typedef struct text {
    const char *at, *end;
} text;

static bool take(text *in, char character)
{
    if (in->at == in->end || *in->at != character)
        return false;
    in->at++;
    return true;
}

static bool take_number(text *in, uint64_t *value)
{
    const char *begin = in->at;
    *value = 0;
    while (in->at < in->end && *in->at >= '0' && *in->at <= '9' && in->at - begin < (ptrdiff_t)MOST_DIGITS)
        *value = *value * 10 + (uint64_t)(*in->at++ - '0');
    bool more = in->at < in->end && *in->at >= '0' && *in->at <= '9';
    return in->at > begin && !more;
}

static bool is_blank(char character)
{
    return character == ' ' || character == '\t' || character == '\r' || character == '\n';
}

static text trimmed(const char *begin, size_t size)
{
    text in = {begin, begin + size};
    while (in.at < in.end && is_blank(*in.at))
        in.at++;
    while (in.at < in.end && is_blank(in.end[-1]))
        in.end--;
    return in;
}

bool strl__http_parse_range(const char *bytes, size_t size, strl__http_fields *fields)
{
    text in = trimmed(bytes, size);
    fields->range_known = false;
    fields->first = fields->last = fields->identity.total = 0;
    if (in.end - in.at < 6 || strncasecmp(in.at, "bytes", 5) != 0)
        return false;
    in.at += 5;
    while (take(&in, ' '))
        ;
    bool unsatisfied = take(&in, '*');
    if (!unsatisfied && !(take_number(&in, &fields->first) && take(&in, '-') && take_number(&in, &fields->last)))
        return false;
    uint64_t total;
    if (!take(&in, '/') || !take_number(&in, &total) || in.at != in.end)
        return false;
    bool sound = unsatisfied || (fields->first <= fields->last && fields->last < total);
    fields->range_known = sound && !unsatisfied;
    fields->identity.total = sound ? total : 0;
    return fields->range_known;
}

/* A character that may stand between the quotes, and in a request's header. */
static bool is_etag_character(char character)
{
    unsigned char byte = (unsigned char)character;
    return byte > 0x20 && byte != '"' && byte != 0x7f;
}

bool strl__http_parse_etag(const char *bytes, size_t size, char *tag, size_t tag_size)
{
    text in = trimmed(bytes, size);
    size_t length = (size_t)(in.end - in.at);
    tag[0] = 0;
    if (length < 2 || length >= tag_size || in.at[0] != '"' || in.end[-1] != '"')
        return false;
    for (const char *at = in.at + 1; at < in.end - 1; at++)
        if (!is_etag_character(*at))
            return false;
    memcpy(tag, in.at, length);
    tag[length] = 0;
    return true;
}

/* A date, or a coding: printable, cut nowhere. "" where it is not. */
static void copy_plain(text in, char *to, size_t size)
{
    size_t length = (size_t)(in.end - in.at);
    to[0] = 0;
    if (length >= size)
        return;
    for (size_t i = 0; i < length; i++)
        if ((unsigned char)in.at[i] < 0x20 || (unsigned char)in.at[i] >= 0x7f)
            return;
    memcpy(to, in.at, length);
    to[length] = 0;
}

/* "HTTP/1.1 206 Partial Content", "HTTP/2 206". */
static unsigned parse_status(text in)
{
    uint64_t status;
    while (in.at < in.end && *in.at != ' ')
        in.at++;
    while (take(&in, ' '))
        ;
    return take_number(&in, &status) && status >= 100 && status <= 999 ? (unsigned)status : 0;
}

static bool is_named(const char *line, size_t size, const char *name)
{
    return size == strlen(name) && strncasecmp(line, name, size) == 0;
}

static void take_field(strl__http_fields *fields, const char *line, size_t name_size, text value)
{
    size_t size = (size_t)(value.end - value.at);
    if (is_named(line, name_size, "content-range"))
        strl__http_parse_range(value.at, size, fields);
    else if (is_named(line, name_size, "etag"))
        strl__http_parse_etag(value.at, size, fields->identity.etag, sizeof fields->identity.etag);
    else if (is_named(line, name_size, "last-modified"))
        copy_plain(value, fields->identity.modified, sizeof fields->identity.modified);
    else if (is_named(line, name_size, "content-encoding")) {
        copy_plain(value, fields->encoding, sizeof fields->encoding);
        if (strcasecmp(fields->encoding, "identity") == 0)
            fields->encoding[0] = 0;
        else if (!fields->encoding[0] && size > 0)
            strcpy(fields->encoding, "something unknown");
    }
}

void strl__http_fields_line(strl__http_fields *fields, const char *line, size_t size)
{
    if (size >= 5 && memcmp(line, "HTTP/", 5) == 0) {
        *fields = (strl__http_fields){.status = parse_status(trimmed(line, size)), .bytes = size};
        return;
    }
    fields->bytes = size > SIZE_MAX - fields->bytes ? SIZE_MAX : fields->bytes + size;
    const char *colon = memchr(line, ':', size);
    if (colon)
        take_field(fields, line, (size_t)(colon - line), trimmed(colon + 1, size - (size_t)(colon + 1 - line)));
}
