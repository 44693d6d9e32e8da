#include "shared/naming.h"

#include <stdbool.h>
#include <string.h>

#include "base/fail.h"
#include "shared/location.h"

static bool ends_name(char c)
{
    return c == 0 || strchr(" ,:;\"'()", c);
}

/* As a word of its own: a short path such as "a" is in many words. */
static bool names(const char *sentence, const char *path)
{
    size_t bytes = strlen(path);
    for (const char *at = strstr(sentence, path); at && bytes; at = strstr(at + 1, path))
        if ((at == sentence || ends_name(at[-1])) && ends_name(at[bytes]))
            return true;
    return false;
}

strl_status strl_name_file(const char *path, strl_status status, strl_error *err)
{
    if (status == STRL_OK || !err || strl_location_is_remote(path) || names(err->message, path))
        return status;
    return strl__fail_context(err, status, "%s", path);
}
