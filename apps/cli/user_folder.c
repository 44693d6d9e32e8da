#include "user_folder.h"

#include <stdio.h>
#include <stdlib.h>

void strl_cli_user_path(char *path, size_t size, const char *variable, const char *below_home, const char *name)
{
    const char *folder = getenv(variable), *home = getenv("HOME");
    int bytes = 0;
    if (folder && folder[0] == '/') /* others are to be ignored, says the XDG specification */
        bytes = snprintf(path, size, "%s/stroll%s", folder, name);
    else if (home && home[0])
        bytes = snprintf(path, size, "%s/%s/stroll%s", home, below_home, name);
    if (bytes <= 0 || (size_t)bytes >= size)
        path[0] = 0;
}

void strl_cli_cache_folder(char *path, size_t size)
{
    strl_cli_user_path(path, size, "XDG_CACHE_HOME", ".cache", "");
}
