#include "remote.h"

#include "base/fail.h"
#include "platform/file.h"
#include "shared/folder.h"
#include "user_folder.h"

strl_status strl_cli_check_files(const char *command, const char *const *names, size_t count, strl_error *err)
{
    for (size_t i = 0; i < count; i++)
        if (strl_location_is_remote(names[i]))
            return strl__fail(err, STRL_ERR_ARGUMENT, "%s reads files, not addresses: save what is there as one first",
                              command);
    return STRL_OK;
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
        strl_folder_make(remote->folder, NULL);
        location->cache = remote->folder;
    }
    return STRL_OK;
}
