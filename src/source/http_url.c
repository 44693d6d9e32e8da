/* Addresses: which are taken, where they lead to, and how they are shown. */
#include <string.h>
#include <strings.h>

#include <curl/curl.h>

#include "base/fail.h"
#include "base/memory.h"
#include "source/http.h"

#define MOST_URL_BYTES 8000u
#define SHOWN_BYTES 200u /* of an address, in a sentence */

static strl_status check_text(const char *text, strl_error *err)
{
    size_t length = strnlen(text, MOST_URL_BYTES + 1);
    if (length > MOST_URL_BYTES)
        return strl__fail(err, STRL_ERR_ARGUMENT, "the address has more than %u characters", MOST_URL_BYTES);
    char shown[SHOWN_BYTES + 1];
    for (const char *at = text; *at; at++)
        if ((unsigned char)*at < 0x20 || *at == 0x7f)
            return strl__fail(err, STRL_ERR_ARGUMENT, "the address has a control character in it");
    if (strncasecmp(text, "http://", 7) != 0 && strncasecmp(text, "https://", 8) != 0)
        return strl__fail(err, STRL_ERR_ARGUMENT, "%s is not an address: expected http:// or https://",
                          strl__address_shown(text, shown, sizeof shown));
    return STRL_OK;
}

static bool copy_part(CURLU *parsed, char **copy)
{
    char *text = NULL;
    *copy = curl_url_get(parsed, CURLUPART_URL, &text, 0) == CURLUE_OK ? strl__strdup(text) : NULL;
    curl_free(text);
    return *copy != NULL;
}

/* Passwords and signed queries are nobody's business who reads a log. */
static char *show(CURLU *parsed)
{
    char *shown = NULL;
    curl_url_set(parsed, CURLUPART_USER, NULL, 0);
    curl_url_set(parsed, CURLUPART_PASSWORD, NULL, 0);
    curl_url_set(parsed, CURLUPART_OPTIONS, NULL, 0);
    curl_url_set(parsed, CURLUPART_QUERY, NULL, 0);
    if (!copy_part(parsed, &shown))
        return NULL;
    size_t length = strlen(shown);
    if (length > SHOWN_BYTES) { /* the end says which file it is */
        memmove(shown, shown + length - SHOWN_BYTES, SHOWN_BYTES + 1);
        memcpy(shown, "...", 3);
    }
    return shown;
}

strl_status strl__http_url(const char *text, char **url, char **shown, bool *secure, strl_error *err)
{
    char plain[SHOWN_BYTES + 1];
    *url = *shown = NULL;
    *secure = strncasecmp(text, "https://", 8) == 0;
    strl_status status = check_text(text, err);
    if (status != STRL_OK)
        return status;
    CURLU *parsed = curl_url();
    if (!parsed)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for an address");
    if (curl_url_set(parsed, CURLUPART_URL, text, CURLU_URLENCODE) != CURLUE_OK)
        status = strl__fail(err, STRL_ERR_ARGUMENT, "%s is not an address: expected http://HOST/PATH",
                            strl__address_shown(text, plain, sizeof plain));
    if (status == STRL_OK) {
        curl_url_set(parsed, CURLUPART_FRAGMENT, NULL, 0);
        if (!copy_part(parsed, url) || !(*shown = show(parsed)))
            status = strl__fail(err, STRL_ERR_MEMORY, "no memory for an address");
    }
    if (status != STRL_OK) {
        strl__free(*url);
        *url = NULL;
    }
    curl_url_cleanup(parsed);
    return status;
}

/* ---- redirects */

static bool get_part(CURLU *parsed, CURLUPart part, char **text)
{
    *text = NULL;
    return curl_url_get(parsed, part, text, part == CURLUPART_PORT ? CURLU_DEFAULT_PORT : 0) == CURLUE_OK;
}

static bool is_same_part(CURLU *one, CURLU *other, CURLUPart part)
{
    char *left, *right;
    bool is_left = get_part(one, part, &left), is_right = get_part(other, part, &right);
    bool same = is_left && is_right && strcasecmp(left, right) == 0;
    curl_free(left);
    curl_free(right);
    return same;
}

/* False without memory. What is not there is not copied. */
static bool add_part(CURLU *from, CURLU *to, CURLUPart part)
{
    char *text, *own;
    if (get_part(to, part, &own) || !get_part(from, part, &text)) {
        curl_free(own);
        return true;
    }
    bool added = curl_url_set(to, part, text, 0) == CURLUE_OK;
    curl_free(text);
    return added;
}

char *strl__http_url_target(const char *url, const char *led_to)
{
    CURLU *from = curl_url(), *to = curl_url();
    char *target = NULL;
    bool good = from && to && curl_url_set(from, CURLUPART_URL, url, 0) == CURLUE_OK &&
                curl_url_set(to, CURLUPART_URL, led_to, 0) == CURLUE_OK;
    if (good && is_same_part(from, to, CURLUPART_SCHEME) && is_same_part(from, to, CURLUPART_HOST) &&
        is_same_part(from, to, CURLUPART_PORT))
        good = add_part(from, to, CURLUPART_USER) && add_part(from, to, CURLUPART_PASSWORD);
    if (good)
        copy_part(to, &target);
    curl_url_cleanup(from);
    curl_url_cleanup(to);
    return target;
}
