/* A folder whose files are opened by names that strangers send: whatever the name says and whatever links lie in the
 * folder, nothing outside of it is opened, also while somebody moves things about in it. Thread-safe. */
#ifndef STRL_PLATFORM_FOLDER_H
#define STRL_PLATFORM_FOLDER_H

#include <stdbool.h>

#include "platform/file.h"

typedef struct strl_folder strl_folder;

/* What became of a name. On all but STRL_FOUND the error is written. */
typedef enum strl_found {
    STRL_FOUND,
    STRL_FOUND_NOTHING, /* nothing of that name and kind, or a link that leads out of the folder */
    STRL_FOUND_BARRED,  /* we may not read it */
    STRL_FOUND_FAILED   /* the system failed */
} strl_found;

strl_status strl_folder_open(const char *path, strl_folder **folder, strl_error *err);
void strl_folder_close(strl_folder *folder); /* NULL is legal */

/* A regular file, to read. name: components between single slashes, none of them "." or "..". Links are followed as far
 * as they stay in the folder where the kernel can watch over that (Linux 5.6), else not at all. */
strl_found strl_folder_open_file(strl_folder *folder, const char *name, strl_file **file, strl_error *err);

/* Told of each entry of a folder but "." and "..", in no order; false ends the listing. */
typedef bool (*strl_folder_visit)(void *context, const char *name, bool is_folder);
/* name as above; "" = the folder itself. */
strl_found strl_folder_list(strl_folder *folder, const char *name, strl_folder_visit visit, void *context,
                            strl_error *err);

/* Whether a folder of this name can be opened; name is not "". */
bool strl_folder_has_folder(strl_folder *folder, const char *name);

/* Test hook, for this folder: as if the kernel could not watch over links. */
void strl_folder_follow_no_links(strl_folder *folder);

#endif
