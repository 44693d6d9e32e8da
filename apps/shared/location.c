#include "shared/location.h"

#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/fail.h"
#include "container/layout.h"
#include "platform/file.h"
#include "source/source.h"

bool strl_location_is_remote(const char *name)
{
    return strstr(name, "://") != NULL;
}

/* As curl has it. The library reads no environment, nor does libcurl for this. */
static const char *certificates(void)
{
    static const char *const variables[] = {"CURL_CA_BUNDLE", "SSL_CERT_FILE"};
    for (size_t i = 0; i < sizeof variables / sizeof *variables; i++) {
        const char *path = getenv(variables[i]);
        if (path && *path)
            return path;
    }
    return NULL;
}

strl_status strl_location_open_source(const strl_location *location, unsigned threads, strl_source **source,
                                      strl_error *err)
{
    const char *name = location->name;
    const strl_http_desc desc = {
        .cache = location->cache, .cache_bytes = location->cache_bytes, .certificates = certificates()};
    *source = NULL;
    if (!strl_location_is_remote(name))
        return strl_source_open_file(name, threads, source, err);
    char shown[201];
    if (strncasecmp(name, "http://", 7) != 0 && strncasecmp(name, "https://", 8) != 0)
        return strl__fail(err, STRL_ERR_UNSUPPORTED, "%s: models are read from files, http:// and https:// alone",
                          strl__address_shown(name, shown, sizeof shown));
    return strl_source_open_http(name, &desc, source, err);
}

const char *strl_location_shown(const char *name, char *shown, size_t size)
{
    return strl_location_is_remote(name) ? strl__address_shown(name, shown, size) : name;
}

strl_status strl_location_open_container(const strl_location *location, strl_container **container, strl_error *err)
{
    strl_source *source;
    *container = NULL;
    strl_status status = strl_location_open_source(location, 0, &source, err);
    return status == STRL_OK ? strl_container_open(source, container, err) : status;
}

strl_status strl_location_is_container(const strl_location *location, bool *answer, strl_error *err)
{
    strl_file *file = NULL;
    char magic[8];
    size_t got = 0;
    *answer = strl_location_is_remote(location->name);
    if (*answer)
        return STRL_OK;
    strl_status status = strl_file_open(location->name, &file, err);
    if (status == STRL_OK)
        status = strl_file_read_some(file, 0, magic, sizeof magic, &got, err);
    *answer = status == STRL_OK && got == sizeof magic && memcmp(magic, STRL__MAGIC, sizeof magic) == 0;
    strl_file_close(file, NULL);
    return status;
}
