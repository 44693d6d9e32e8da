/* Colours and images from MTL files. */
#ifndef STRL_READERS_MTL_H
#define STRL_READERS_MTL_H

#include "readers/names.h"
#include "readers/texture.h"

/* Adds the materials of the file at path to `materials`, and their images to `textures`, later
 * definitions over earlier ones. A file that is missing or cannot be read to its end is no failure,
 * because models often travel without it: `why` then says what is wrong, and has the status STRL_OK
 * otherwise. A statement that makes no sense is passed over. Fails only without memory or where the
 * names pass their limit. */
strl_status strl__mtl_read(const char *path, strl__names *materials, strl__textures *textures, strl_error *why,
                           strl_error *err);

#endif
