/* Addresses: which are taken, and how they are shown. */
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
    for (const char *at = text; *at; at++)
        if ((unsigned char)*at < 0x20 || *at == 0x7f)
            return strl__fail(err, STRL_ERR_ARGUMENT, "the address has a control character in it");
    if (strncasecmp(text, "http://", 7) != 0 && strncasecmp(text, "https://", 8) != 0)
        return strl__fail(err, STRL_ERR_ARGUMENT, "%.200s is not an address: expected http:// or https://", text);
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
    *url = *shown = NULL;
    *secure = strncasecmp(text, "https://", 8) == 0;
    strl_status status = check_text(text, err);
    if (status != STRL_OK)
        return status;
    CURLU *parsed = curl_url();
    if (!parsed)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for an address");
    if (curl_url_set(parsed, CURLUPART_URL, text, CURLU_URLENCODE) != CURLUE_OK)
        status = strl__fail(err, STRL_ERR_ARGUMENT, "%.200s is not an address: expected http://HOST/PATH", text);
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
