#include "support/folder.h"

#include <stdio.h>
#include <stdlib.h>

#include "platform/file.h"

char strl_test_folder[64];

int strl_test_folder_make(void **state)
{
    (void)state;
    snprintf(strl_test_folder, sizeof strl_test_folder, "/tmp/strl-test-XXXXXX");
    return mkdtemp(strl_test_folder) ? 0 : -1;
}

int strl_test_folder_remove(void **state)
{
    (void)state;
    return strl_path_remove_directory(strl_test_folder, NULL) == STRL_OK && !strl_path_exists(strl_test_folder) ? 0
                                                                                                                : -1;
}

const char *strl_test_path(const char *name)
{
    static char paths[8][512];
    static unsigned turn;
    char *path = paths[turn++ % 8];
    snprintf(path, sizeof paths[0], "%s/%s", strl_test_folder, name);
    return path;
}
