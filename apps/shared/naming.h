/* Which file a sentence is about. */
#ifndef STRL_APPS_NAMING_H
#define STRL_APPS_NAMING_H

#include "stroll/error.h"

/* What reads ranges knows offsets, not names: puts the path before a sentence that lacks it. Sentences
 * about an address name it already, without what may be secret in it. Returns status; err may be
 * NULL. */
strl_status strl_name_file(const char *path, strl_status status, strl_error *err);

#endif
