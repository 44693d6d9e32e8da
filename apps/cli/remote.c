#include "remote.h"

#include <string.h>

#include "platform/file.h"
#include "user_folder.h"

/* The folder above is the system's, and may be missing for a user who is new. */
static void make_above(const char *folder)
{
    char above[4096];
    const char *slash = strrchr(folder, '/');
    size_t length = slash ? (size_t)(slash - folder) : 0;
    if (length == 0 || length >= sizeof above)
        return;
    memcpy(above, folder, length);
    above[length] = 0;
    strl_path_make_private_directory(above, NULL);
}

strl_status strl_cli_locate(strl_cli_remote *remote, const char *name, strl_location *location, strl_error *err)
{
    *location = (strl_location){.name = name, .cache_bytes = remote->cache_bytes};
    if (remote->no_cache || !strl_location_is_remote(name))
        return STRL_OK;
    location->cache = remote->cache;
    if (remote->cache)
        return strl_path_make_private_directory(remote->cache, err);
    strl_cli_cache_folder(remote->folder, sizeof remote->folder);
    if (remote->folder[0]) {
        make_above(remote->folder);
        location->cache = remote->folder;
    }
    return STRL_OK;
}
