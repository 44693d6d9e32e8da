#include "shared/naming.h"

#include <string.h>

#include "base/fail.h"
#include "shared/location.h"

strl_status strl_name_file(const char *path, strl_status status, strl_error *err)
{
    if (status == STRL_OK || strl_location_is_remote(path) || strstr(err->message, path))
        return status;
    return strl__fail_context(err, status, "%s", path);
}
