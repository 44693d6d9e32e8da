/* Where a user's own files go, after the XDG specification. The program looks at the environment; the library
 * never does. */
#ifndef STRL_CLI_USER_FOLDER_H
#define STRL_CLI_USER_FOLDER_H

#include <stddef.h>

/* FOLDER/stroll/NAME in the folder that the variable names, else in its default below the home folder; "" where
 * there is none. name "": the folder stroll itself. */
void strl_cli_user_path(char *path, size_t size, const char *variable, const char *below_home, const char *name);
/* $XDG_CACHE_HOME/stroll, else ~/.cache/stroll. */
void strl_cli_cache_folder(char *path, size_t size);

#endif
