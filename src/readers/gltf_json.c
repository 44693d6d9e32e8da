#include "readers/gltf_json.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "readers/names.h"

#define MEMBER_BYTES_MAX 64u /* longer names are none of ours */
#define DEPTH_MAX 256u

typedef struct splitter {
    strl__input *input;
    const char *path;
    const strl__json_sink *sink;
    char *text; /* owned; of the element under way */
    size_t length, capacity;
    bool muted;        /* what is read is not kept */
    uint64_t begun_at; /* of the element under way, in the file */
    strl_error *err;
    strl_status status; /* the first failure; what is read after it means nothing */
} splitter;

/* The next byte, or -1 at the end and after a failure. */
static int peek(splitter *s)
{
    if (s->status)
        return -1;
    if (s->input->at < s->input->end || strl__input_want(s->input, 1))
        return (unsigned char)*s->input->at;
    s->status = strl__input_status(s->input, s->err);
    return -1;
}

static void fail_expected(splitter *s, const char *expected)
{
    int found = peek(s);
    char shown[16] = "the end";
    if (found >= 0x20 && found < 0x7f)
        snprintf(shown, sizeof shown, "'%c'", found);
    else if (found >= 0)
        snprintf(shown, sizeof shown, "byte 0x%02x", (unsigned)found);
    if (!s->status)
        s->status = strl__fail(s->err, STRL_ERR_FORMAT, "%s, byte %" PRIu64 ": expected %s of its JSON, found %s",
                               s->path, strl__input_offset(s->input), expected, shown);
}

static void keep(splitter *s, char byte)
{
    if (s->muted || s->status)
        return;
    if (s->length >= s->sink->most_bytes)
        s->length++; /* so that a sentence can tell how long it is */
    else if (!strl__grow(&s->text, &s->capacity, s->length + 1, 1))
        s->status = strl__fail(s->err, STRL_ERR_MEMORY, "%s: no memory for %zu bytes of JSON", s->path, s->length);
    else
        s->text[s->length++] = byte;
}

/* Keeps the byte that peek has shown. */
static void take(splitter *s)
{
    keep(s, *s->input->at);
    s->input->at++;
}

static void keep_text(splitter *s, const char *text)
{
    for (; *text; text++)
        keep(s, *text);
}

static bool is_space(int c)
{
    return c == ' ' || c == '\t' || c == '\n' || c == '\r';
}

/* The next byte that is no space. */
static int peek_token(splitter *s)
{
    int c = peek(s);
    if (!is_space(c))
        return c;
    for (; is_space(c); c = peek(s))
        s->input->at++;
    keep(s, ' '); /* or two numbers would become one */
    return c;
}

static bool ends_with(const splitter *s, size_t from, const char *text)
{
    size_t length = strlen(text);
    return !s->muted && s->length <= s->sink->most_bytes && s->length >= from && s->length - from == length &&
           memcmp(s->text + from, text, length) == 0;
}

/* From quote to quote; escapes stay as they are. */
static void take_string(splitter *s)
{
    const bool muted = s->muted;
    const size_t from = s->length;
    const uint64_t begin = strl__input_offset(s->input) + 1;
    bool is_data = false;
    take(s);
    for (int c = peek(s); c != '"'; c = peek(s)) {
        if (c < 0) {
            fail_expected(s, "the end of a string");
            break;
        }
        if (!is_data && ends_with(s, from, "\"data:"))
            is_data = s->muted = true;
        take(s);
        if (c == '\\' && peek(s) >= 0)
            take(s);
    }
    if (s->status)
        return;
    s->muted = muted;
    if (is_data) {
        char place[48];
        snprintf(place, sizeof place, "@%" PRIu64 "+%" PRIu64, begin, strl__input_offset(s->input) - begin);
        keep_text(s, place);
    }
    take(s);
}

static void take_value(splitter *s);

/* "extras": VALUE becomes "extras": null. */
static void take_string_or_extras(splitter *s)
{
    const size_t from = s->length;
    take_string(s);
    if (!ends_with(s, from, "\"extras\"") || peek_token(s) != ':')
        return;
    take(s);
    keep_text(s, "null");
    s->muted = true;
    take_value(s);
    s->muted = false;
}

static void take_scalar(splitter *s)
{
    /* strchr would find the text's own end in a zero */
    for (int c = peek(s); c == 0 || (c > 0 && !is_space(c) && !strchr("[]{},:\"", c)); c = peek(s))
        take(s);
}

static void take_value(splitter *s)
{
    unsigned depth = 0;
    do {
        int c = peek_token(s);
        if (c < 0 || (depth == 0 && strchr("]},:", c) && c)) {
            fail_expected(s, "a value");
            return;
        }
        if (c == '"') {
            take_string_or_extras(s);
        } else if (c == '{' || c == '[') {
            take(s);
            if (++depth > DEPTH_MAX)
                s->status = strl__fail(s->err, STRL_ERR_LIMIT,
                                       "%s, byte %" PRIu64 ": its JSON nests more than the %u levels that are read",
                                       s->path, strl__input_offset(s->input), DEPTH_MAX);
        } else if (c == '}' || c == ']') {
            take(s);
            depth--;
        } else if (c == ',' || c == ':') {
            take(s);
        } else {
            take_scalar(s);
        }
    } while (depth > 0 && !s->status);
}

/* jansson refuses text that is not UTF-8; one odd name is no reason to refuse a model. */
static void make_utf8(splitter *s)
{
    for (size_t i = 0; i < s->length;) {
        size_t sequence = strl__utf8_sequence((unsigned char *)s->text + i, s->length - i);
        if (sequence == 0)
            s->text[i] = '?';
        i += sequence ? sequence : 1;
    }
}

static void give(splitter *s, const char *member, uint64_t index)
{
    json_error_t wrong;
    if (s->status)
        return;
    if (s->length > s->sink->most_bytes) {
        s->status = s->sink->refuse(s->sink->context, s->begun_at, s->length, s->err);
        return;
    }
    make_utf8(s);
    json_t *value = json_loadb(s->text, s->length, JSON_DECODE_ANY | JSON_ALLOW_NUL, &wrong);
    if (!value) {
        for (char *c = wrong.text; *c; c++)
            *c = *c < 0x20 || *c == 0x7f ? ' ' : *c;
        s->status = strl__fail(s->err, STRL_ERR_FORMAT, "%s, byte %" PRIu64 ": expected JSON in its %s, found: %s",
                               s->path, s->begun_at, member, wrong.text);
        return;
    }
    s->status = s->sink->take(s->sink->context, member, index, value, s->err);
    json_decref(value);
}

static void begin_element(splitter *s)
{
    peek_token(s);
    s->length = 0;
    s->begun_at = strl__input_offset(s->input);
}

static void split_list(splitter *s, const char *member)
{
    take(s);
    if (peek_token(s) == ']') {
        take(s);
        return;
    }
    for (uint64_t index = 0; !s->status; index++) {
        begin_element(s);
        take_value(s);
        give(s, member, index);
        int c = peek_token(s);
        if (c != ',' && c != ']')
            fail_expected(s, "a comma or the end of a list");
        if (s->status)
            return;
        s->length = 0; /* or the comma would count for the budget */
        take(s);
        if (c == ']')
            return;
    }
}

static void split_member(splitter *s)
{
    char member[MEMBER_BYTES_MAX];
    begin_element(s);
    if (peek_token(s) != '"')
        fail_expected(s, "a name");
    else
        take_string(s);
    size_t length = s->length >= 2 ? s->length - 2 : 0;
    if (length >= sizeof member)
        length = 0;
    if (length)
        memcpy(member, s->text + 1, length);
    member[length] = 0;
    if (!s->status && peek_token(s) != ':')
        fail_expected(s, "a colon");
    if (s->status)
        return;
    take(s);
    s->muted = !s->sink->wants(s->sink->context, member);
    begin_element(s);
    if (!s->muted && peek_token(s) == '[') {
        split_list(s, member);
    } else {
        take_value(s);
        if (!s->muted)
            give(s, member, STRL__JSON_WHOLE);
    }
    s->muted = false;
}

static void split_all(splitter *s)
{
    if (peek_token(s) != '{') {
        fail_expected(s, "the '{'");
        return;
    }
    take(s);
    while (!s->status && peek_token(s) != '}') {
        split_member(s);
        s->length = 0;
        int c = peek_token(s);
        if (c == ',')
            take(s);
        else if (c != '}')
            fail_expected(s, "a comma or the last '}'");
        if (c == ',' && peek_token(s) == '}')
            fail_expected(s, "a name");
    }
    if (s->status)
        return;
    s->length = 0;
    take(s);
    s->muted = true;
    while (peek_token(s) == 0)
        s->input->at++; /* some pad with zeros */
    if (peek(s) >= 0)
        fail_expected(s, "the end");
}

strl_status strl__json_split(strl__input *input, const char *path, const strl__json_sink *sink, strl_error *err)
{
    splitter s = {.input = input, .path = path, .sink = sink, .err = err};
    split_all(&s);
    strl__free(s.text);
    return s.status;
}
