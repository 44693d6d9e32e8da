/* The target of a request: what file it names. Nothing is cleaned up: what no client of good faith sends is refused. */
#include <string.h>
#include <strings.h>

#include "container/names.h"
#include "serve/parse.h"

#define REFUSED(code, text) ((strl__refusal){code, text})
#define FINE ((strl__refusal){0, NULL})

/* The next character, percent-encoded or not; *encoded tells which. -1 = a percent sign without two digits. */
static int next_character(const char **at, bool *encoded)
{
    const char *text = *at;
    *encoded = text[0] == '%';
    if (!*encoded) {
        *at = text + 1;
        return (unsigned char)text[0];
    }
    int high = strl__hex_digit(text[1]), low = high < 0 ? -1 : strl__hex_digit(text[2]);
    *at = text + 3;
    return low < 0 ? -1 : high << 4 | low;
}

static strl__refusal decode_path(const char *raw, strl__target *target)
{
    size_t length = 0;
    while (*raw) {
        bool encoded;
        int c = next_character(&raw, &encoded);
        if (c < 0)
            return REFUSED(400, "the path has a percent sign that no two hexadecimal digits follow");
        if (c < 0x20 || c == 0x7f)
            return REFUSED(400, "the path has a control character");
        if (c == '\\' || (c == '/' && encoded))
            return REFUSED(400, "the path has a backslash or an encoded slash");
        if (length == STRL__PATH_BYTES)
            return REFUSED(414, "the path is longer than 1024 bytes");
        target->path[length++] = (char)c;
    }
    target->path[length] = 0;
    if (!strl__utf8_is_name((const uint8_t *)target->path, length))
        return REFUSED(400, "the path is not UTF-8");
    return FINE;
}

static strl__refusal check_component(const char *name, size_t length, strl__target *target)
{
    if (length == 0)
        return REFUSED(400, "the path has an empty name in it");
    if (name[0] == '.' && (length == 1 || (length == 2 && name[1] == '.')))
        return REFUSED(400, "the path has \".\" or \"..\" in it");
    if (length > STRL__COMPONENT_BYTES)
        return REFUSED(414, "a name in the path is longer than 255 bytes");
    target->is_hidden |= name[0] == '.';
    return FINE;
}

/* Takes a slash at the end off and notes it. */
static strl__refusal check_components(strl__target *target)
{
    size_t length = strlen(target->path);
    target->is_folder = length == 0 || target->path[length - 1] == '/';
    if (length == 0)
        return FINE;
    if (target->is_folder)
        target->path[length - 1] = 0;
    strl__refusal refusal = FINE;
    for (const char *name = target->path; name && refusal.status == 0;) {
        size_t bytes = strcspn(name, "/");
        refusal = check_component(name, bytes, target);
        name = name[bytes] ? name + bytes + 1 : NULL;
    }
    return refusal;
}

/* The path of "http://host:port/path"; NULL where the target is no absolute form. A missing path is the root. */
static const char *skip_authority(const char *raw)
{
    size_t scheme = strncasecmp(raw, "http://", 7) == 0 ? 7 : strncasecmp(raw, "https://", 8) == 0 ? 8 : 0;
    if (scheme == 0)
        return NULL;
    size_t authority = strcspn(raw + scheme, "/");
    if (authority == 0)
        return NULL;
    return raw[scheme + authority] ? raw + scheme + authority : "/";
}

strl__refusal strl__parse_target(char *raw, strl__target *target)
{
    *target = (strl__target){0};
    if (strcmp(raw, "*") == 0) {
        target->is_server = true;
        return FINE;
    }
    if (strchr(raw, '#'))
        return REFUSED(400, "the target has a fragment");
    char *query = strchr(raw, '?');
    if (query) {
        *query = 0;
        target->query = query + 1;
    }
    const char *path = raw[0] == '/' ? raw : skip_authority(raw);
    if (!path)
        return REFUSED(400, "the target is no path");
    strl__refusal refusal = decode_path(path + 1, target);
    return refusal.status ? refusal : check_components(target);
}
