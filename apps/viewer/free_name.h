/* Names for what the viewer saves: numbered, never one that is there already. */
#ifndef STRL_VIEWER_FREE_NAME_H
#define STRL_VIEWER_FREE_NAME_H

#include <stddef.h>

#include "stroll/error.h"

/* The first of folder/BEFORE00000AFTER, 00001, ... that is free; makes the folder. */
strl_status strl_free_name(const char *folder, const char *before, const char *after, char *path, size_t path_size,
                           strl_error *err);

#endif
