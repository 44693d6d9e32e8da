/* From what the system says (errno, struct stat) to what Stroll says. For platform/posix only. */
#ifndef STRL_PLATFORM_POSIX_FACTS_H
#define STRL_PLATFORM_POSIX_FACTS_H

#include <sys/stat.h>

#include "platform/file.h"
#include "stroll/error.h"

/* "cannot VERB PATH: REASON". Of a path too long for the sentence the end is shown, so that the reason always fits. */
strl_status strl__fail_system(strl_error *err, int code, const char *verb, const char *path);

/* The part of path that a sentence shows; borrowed from it. */
const char *strl__path_shown(const char *path);

void strl__file_info_fill(strl_file_info *info, const struct stat *facts);

#endif
