/* Ranges and preconditions: RFC 9110, 13 and 14. */
#include <string.h>
#include <strings.h>

#include "serve/parse.h"

static const char *skip_blanks(const char *text)
{
    return text + strspn(text, " \t");
}

/* Digits; a number beyond 64 bits is the largest. False where there is no digit. */
static bool take_digits(const char **at, uint64_t *number)
{
    const char *text = *at;
    *number = 0;
    for (; *text >= '0' && *text <= '9'; text++) {
        unsigned digit = (unsigned)(*text - '0');
        *number = *number > (UINT64_MAX - digit) / 10 ? UINT64_MAX : *number * 10 + digit;
    }
    bool some = text != *at;
    *at = text;
    return some;
}

static strl__range cut(uint64_t first, uint64_t last, uint64_t file_bytes)
{
    if (first >= file_bytes)
        return (strl__range){.kind = STRL__RANGE_NOTHING};
    if (last >= file_bytes)
        last = file_bytes - 1;
    return (strl__range){STRL__RANGE_PART, first, last - first + 1};
}

/* "a-b", "a-" or "-n"; false where it is none of these. */
static bool take_one(const char **at, uint64_t file_bytes, strl__range *range)
{
    uint64_t first, last;
    if (**at == '-') {
        uint64_t suffix;
        ++*at;
        if (!take_digits(at, &suffix))
            return false;
        *range = suffix == 0 ? (strl__range){.kind = STRL__RANGE_NOTHING}
                             : cut(suffix < file_bytes ? file_bytes - suffix : 0, UINT64_MAX, file_bytes);
        return true;
    }
    if (!take_digits(at, &first) || *(*at)++ != '-')
        return false;
    if (!take_digits(at, &last))
        last = UINT64_MAX;
    if (last < first)
        return false;
    *range = cut(first, last, file_bytes);
    return true;
}

strl__range strl__parse_range(const char *value, uint64_t file_bytes)
{
    const strl__range whole = {.kind = STRL__RANGE_WHOLE}, nothing = {.kind = STRL__RANGE_NOTHING};
    strl__range found = nothing;
    unsigned count = 0, satisfiable = 0;
    if (!value || strncasecmp(value, "bytes", 5) != 0)
        return whole;
    value = skip_blanks(value + 5);
    if (*value++ != '=')
        return whole; /* another unit that begins alike */
    for (;;) {
        strl__range one;
        value = skip_blanks(value);
        if (!take_one(&value, file_bytes, &one))
            return nothing;
        count++;
        if (one.kind == STRL__RANGE_PART) {
            satisfiable++;
            found = one;
        }
        value = skip_blanks(value);
        if (*value != ',')
            break;
        value++;
    }
    if (*value || satisfiable == 0)
        return nothing;
    return count == 1 ? found : whole;
}

bool strl__etag_is_listed(const char *list, const char *etag, bool weak)
{
    list = skip_blanks(list);
    if (list[0] == '*' && *skip_blanks(list + 1) == 0)
        return true;
    size_t length = strlen(etag);
    while (*list) {
        bool is_weak = list[0] == 'W' && list[1] == '/';
        list += is_weak ? 2 : 0;
        const char *end = list[0] == '"' ? strchr(list + 1, '"') : NULL;
        if (!end)
            return false;
        if ((weak || !is_weak) && (size_t)(end + 1 - list) == length && memcmp(list, etag, length) == 0)
            return true;
        list = skip_blanks(end + 1);
        if (*list && *list != ',')
            return false;
        list += strspn(list, ", \t");
    }
    return false;
}

static bool any_listed(const char *const lines[STRL__SAME_HEADERS], const char *etag, bool weak)
{
    for (unsigned i = 0; i < STRL__SAME_HEADERS && lines[i]; i++)
        if (strl__etag_is_listed(lines[i], etag, weak))
            return true;
    return false;
}

/* 200 where nothing stands against the request. */
static unsigned check_preconditions(const strl__conditions *conditions, const strl__validators *validators)
{
    int64_t date;
    if (conditions->match[0]) {
        if (!any_listed(conditions->match, validators->etag, false))
            return 412;
    } else if (conditions->unmodified_since && strl__parse_date(conditions->unmodified_since, &date) &&
               validators->modified_s > date) {
        return 412;
    }
    if (conditions->none_match[0]) {
        if (any_listed(conditions->none_match, validators->etag, true))
            return 304;
    } else if (conditions->modified_since && strl__parse_date(conditions->modified_since, &date) &&
               validators->modified_s <= date) {
        return 304;
    }
    return 200;
}

/* Whether the part that is asked for is of the file that we have. */
static bool range_applies(const char *if_range, const strl__validators *validators)
{
    int64_t date;
    if (!if_range)
        return true;
    if_range = skip_blanks(if_range);
    if (if_range[0] == '"') {
        size_t length = strlen(validators->etag);
        return strncmp(if_range, validators->etag, length) == 0 && *skip_blanks(if_range + length) == 0;
    }
    return validators->date_is_strong && strl__parse_date(if_range, &date) && validators->modified_s == date;
}

unsigned strl__decide(const strl__conditions *conditions, const strl__validators *validators, bool ranges,
                      strl__range *range)
{
    *range = (strl__range){.kind = STRL__RANGE_WHOLE};
    unsigned code = check_preconditions(conditions, validators);
    if (code != 200 || !ranges || !conditions->range || !range_applies(conditions->if_range, validators))
        return code;
    *range = strl__parse_range(conditions->range, validators->bytes);
    return range->kind == STRL__RANGE_PART ? 206 : range->kind == STRL__RANGE_NOTHING ? 416 : 200;
}

/* Whether a media range of the list is `type` and not refused by q=0. */
static bool accepts(const char *accept, const char *type)
{
    size_t length = strlen(type);
    for (const char *at = accept; *at;) {
        at += strspn(at, ", \t");
        size_t bytes = strcspn(at, ",");
        const char *quality = memchr(at, ';', bytes);
        if (bytes >= length && strncasecmp(at, type, length) == 0 && (bytes == length || strchr(" \t;", at[length]))) {
            const char *zero = quality ? strstr(quality, "q=0") : NULL;
            if (!zero || zero >= at + bytes)
                return true;
            char digit = zero[3 + strspn(zero + 3, ".0")];
            return digit >= '1' && digit <= '9';
        }
        at += bytes;
    }
    return false;
}

bool strl__prefers_json(const char *accept)
{
    return accept && accepts(accept, "application/json") && !accepts(accept, "text/html");
}

bool strl__is_token(const char *name)
{
    static const char marks[] = "!#$%&'*+-.^_`|~";
    if (!*name)
        return false;
    for (; *name; name++)
        if (!((*name >= '0' && *name <= '9') || ((*name | 32) >= 'a' && (*name | 32) <= 'z') || strchr(marks, *name)))
            return false;
    return true;
}
