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

/* The folder that holds path, owned by the caller; NULL without memory. */
char *strl__path_parent(const char *path);

/* A file that nobody else has, with the rights of `mode`: the eight characters of `path` from random_at on are replaced
 * until there is nothing of that name. Its sentences name `shown`. */
strl_status strl__file_create_unique(char *path, size_t random_at, mode_t mode, const char *shown, strl_file **file,
                                     strl_error *err);
/* strl_file_create_nameless; its sentences name `shown`. */
strl_status strl__file_create_nameless(const char *folder, const char *shown, strl_file **file, strl_error *err);
/* strl_lock_acquire; *held: it failed because another process has the lock. */
strl_status strl__lock_acquire(const char *path, strl_lock **lock, bool *held, strl_error *err);
int strl__file_descriptor(const strl_file *file); /* borrowed */
/* A file object of a descriptor of a regular file of so many bytes. Takes the descriptor over: closed on failure. */
strl_status strl__file_adopt(int descriptor, uint64_t bytes, const char *path, strl_file **file, strl_error *err);

void strl__file_info_fill(strl_file_info *info, const struct stat *facts);

#endif
