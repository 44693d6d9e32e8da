/* The outline of what one camera sees, as lines in another one's picture. */
#ifndef STRL_VIEWER_FRUSTUM_H
#define STRL_VIEWER_FRUSTUM_H

#include <stdint.h>

#include "stroll/frame.h"

#define STRL_FRUSTUM_LINES 12u

/* The pyramid of `seen` up to distance `far`, in pixels of `by`: x y x y. Returns how many lines lie before `by`'s
 * eye. */
uint32_t strl_frustum_lines(const strl_camera *seen, double far, const strl_camera *by,
                            float lines[STRL_FRUSTUM_LINES][4]);

#endif
