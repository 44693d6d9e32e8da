/* Files that are no mesh, or a mesh that nothing here reads, but are taken for one: what a sentence can call them. */
#ifndef STRL_READERS_STRANGER_H
#define STRL_READERS_STRANGER_H

#include "readers/input.h"

/* What the file is and what to do instead, "a ZIP archive: unpack it and name the model in it", by its first bytes, which are in
 * the input, or by the ending of its name. NULL where neither tells. Static. */
const char *strl__stranger_describe(const strl__input *input, const char *path);

#endif
