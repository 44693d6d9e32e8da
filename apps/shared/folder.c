#include "shared/folder.h"

#include <string.h>

#include "base/fail.h"
#include "platform/file.h"

#define MOST_PATH 4096u

/* above: what comes before the last '/'; "" where there is none or nothing but the root. */
static strl_status cut(const char *path, char above[MOST_PATH], strl_error *err)
{
    const char *slash = strrchr(path, '/');
    size_t bytes = slash ? (size_t)(slash - path) : 0;
    above[0] = 0;
    if (bytes >= MOST_PATH)
        return strl__fail(err, STRL_ERR_LIMIT, "%.200s...: the path is too long", path);
    memcpy(above, path, bytes);
    above[bytes] = 0;
    return STRL_OK;
}

strl_status strl_folder_make(const char *folder, strl_error *err)
{
    char above[MOST_PATH];
    strl_status status = cut(folder, above, err);
    if (status == STRL_OK && above[0] && !strl_path_exists(above))
        status = strl_path_make_private_directory(above, err);
    return status == STRL_OK ? strl_path_make_private_directory(folder, err) : status;
}

strl_status strl_folder_make_for(const char *path, strl_error *err)
{
    char folder[MOST_PATH];
    strl_status status = cut(path, folder, err);
    return status == STRL_OK && folder[0] ? strl_folder_make(folder, err) : status;
}
