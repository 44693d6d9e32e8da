/* Folders of the user: settings, cache. */
#ifndef STRL_APPS_FOLDER_H
#define STRL_APPS_FOLDER_H

#include "stroll/error.h"

/* With the folder above it, which is the system's and may be missing for a user who is new. Existing is not an error.
 */
strl_status strl_folder_make(const char *folder, strl_error *err);
/* The folder in which a file of this path is to be; the current one is there. */
strl_status strl_folder_make_for(const char *path, strl_error *err);

#endif
