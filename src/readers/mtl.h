/* Colours from MTL files. */
#ifndef STRL_READERS_MTL_H
#define STRL_READERS_MTL_H

#include <stdbool.h>

#include "readers/names.h"

/* Adds the materials of the file at path to `materials`, later definitions over earlier ones. A
 * file that is missing or cannot be read is passed over, because models often travel without it; so
 * is a statement that makes no sense. Fails only without memory or where the names pass their
 * limit. *found tells whether there was a file. */
strl_status strl__mtl_read(const char *path, strl__names *materials, bool *found, strl_error *err);

#endif
