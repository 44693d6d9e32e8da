/* Progressive meshes in scratch, from the level that makes them to the last stage, which encodes them: packed quickly, not small.
 * They come back as they were, in the same order. */
#ifndef STRL_BUILD_CLUSTERS_PM_SPILL_H
#define STRL_BUILD_CLUSTERS_PM_SPILL_H

#include <stddef.h>

#include "base/cursor.h"
#include "base/memory.h"
#include "geometry/progressive.h"
#include "stroll/error.h"

/* Appends to writer; a lack of memory shows there. pm: satisfies the invariants of progressive.h. */
void strl_pm_spill_write(const strl_pm *pm, strl_writer *writer);
/* Arrays come from arena. Bytes that are not those of such a mesh fail with STRL_ERR_INTERNAL. */
strl_status strl_pm_spill_read(const void *data, size_t size, strl_arena *arena, strl_pm *pm, strl_error *err);

#endif
