/* A scratch folder: made for one run, held by a lock, removed with the files that the run put there, or left for a
 * later run to go on with. A folder that is there already is taken over only where an earlier run of this program left
 * it, which its lock file and the names of its files tell, or where nothing is in it; any other is refused as it is. */
#ifndef STRL_PLATFORM_SCRATCH_H
#define STRL_PLATFORM_SCRATCH_H

#include <stdbool.h>

#include "stroll/error.h"

typedef struct strl_scratch strl_scratch;

typedef struct strl_scratch_desc {
    const char *path;         /* the folder */
    const char *parent;       /* made where it is missing, and then removed again; NULL = nothing to make */
    const char *const *names; /* patterns of fnmatch for the files the run makes in it; ends in NULL; borrowed */
    bool keep;                /* what an earlier run left stays, until sweep */
} strl_scratch_desc;

strl_status strl_scratch_create(const strl_scratch_desc *desc, strl_scratch **scratch, strl_error *err);
const char *strl_scratch_path(const strl_scratch *scratch);
/* Removes the run's files for which `needed` says no; NULL = all. */
strl_status strl_scratch_sweep(strl_scratch *scratch, bool (*needed)(void *context, const char *name), void *context,
                               strl_error *err);
/* Instead of destroy: the folder stays with all that is in it, without its lock. */
void strl_scratch_leave(strl_scratch *scratch);
/* Removes the run's files by their names, then the folder, unless something else was put there meanwhile. NULL is
 * legal. */
void strl_scratch_destroy(strl_scratch *scratch);

#endif
