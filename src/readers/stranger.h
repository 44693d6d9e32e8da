/* Files that are no mesh, or a mesh that nothing here reads, but are taken for one: what a sentence can call them. */
#ifndef STRL_READERS_STRANGER_H
#define STRL_READERS_STRANGER_H

#include <stdbool.h>
#include <stddef.h>

#include "readers/input.h"

/* What the file is and what to do instead, "a ZIP archive: unpack it and name the model in it", by its first bytes,
 * which are in the input, or by the ending of its name. NULL where neither tells. Static. */
const char *strl__stranger_describe(const strl__input *input, const char *path);

/* What stands in place of a file in a repository of large ones that were not fetched. */
bool strl__stranger_is_pointer(const void *start, size_t bytes);
#define STRL__POINTER_BYTES 64u /* of a file's start that tell; it has more */
#define STRL__POINTER_ADVICE "fetch what it stands for by git lfs pull"

#endif
