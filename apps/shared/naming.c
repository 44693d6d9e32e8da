#include "shared/naming.h"

#include <string.h>

#include "base/fail.h"

strl_status strl_name_file(const char *path, strl_status status, strl_error *err)
{
    return status == STRL_OK || strstr(err->message, path) ? status : strl__fail_context(err, status, "%s", path);
}
