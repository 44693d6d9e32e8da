#include "viewer/free_name.h"

#include <inttypes.h>
#include <stdio.h>

#include "base/fail.h"
#include "platform/file.h"

#define MOST_NAMES 100000u

strl_status strl_free_name(const char *folder, const char *before, const char *after, char *path, size_t path_size,
                           strl_error *err)
{
    strl_status status = strl_path_make_directory(folder, err);
    if (status != STRL_OK)
        return status;
    for (uint32_t i = 0; i < MOST_NAMES; i++) {
        int bytes = snprintf(path, path_size, "%s/%s%05" PRIu32 "%s", folder, before, i, after);
        if (bytes < 0 || (size_t)bytes >= path_size)
            return strl__fail(err, STRL_ERR_LIMIT, "the path of the folder %.200s is too long", folder);
        if (!strl_path_exists(path))
            return STRL_OK;
    }
    return strl__fail(err, STRL_ERR_LIMIT, "%s holds %u files of the name %s...%s already", folder, MOST_NAMES, before,
                      after);
}
