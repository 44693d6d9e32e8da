/* Progressive meshes in scratch, from the level that makes them to the last stage, which encodes them: packed quickly,
 * not small. */
#ifndef STRL_BUILD_CLUSTERS_PM_SPILL_H
#define STRL_BUILD_CLUSTERS_PM_SPILL_H

#include <stdbool.h>
#include <stddef.h>

#include "base/cursor.h"
#include "base/memory.h"
#include "geometry/progressive.h"
#include "stroll/error.h"

/* Appends to writer. pm: satisfies the invariants of progressive.h. scratch: for temporaries. What hardly shares
 * vertices is encoded after all, because it packs badly: then base vertices and triangles come back in another order.
 */
strl_status strl_pm_spill_write(const strl_pm *pm, strl_arena *scratch, strl_writer *writer, strl_error *err);
/* Whether it comes back as it is, in the same order. */
bool strl_pm_spill_keeps_order(const strl_pm *pm);
/* Arrays come from arena. Bytes that are not those of such a mesh fail with STRL_ERR_INTERNAL or STRL_ERR_FORMAT. */
strl_status strl_pm_spill_read(const void *data, size_t size, strl_arena *arena, strl_pm *pm, strl_error *err);

#endif
