/* Where the visitor is and looks. One state for both ways to move: orbit turns it about the pivot, which lies
 * `distance` ahead, fly about the eye. Drags are in pixels, y downward. Pure arithmetic: no window. */
#ifndef STRL_VIEWER_NAVIGATOR_H
#define STRL_VIEWER_NAVIGATOR_H

#include <stdbool.h>
#include <stdint.h>

#include "stroll/frame.h"

typedef enum strl_navigator_mode { STRL_NAVIGATOR_ORBIT, STRL_NAVIGATOR_FLY } strl_navigator_mode;

typedef struct strl_navigator {
    double centre[3], radius; /* of the model's bounding sphere */
    unsigned up_axis;
    strl_navigator_mode mode;
    double eye[3];
    double yaw, pitch; /* of the view direction, radians; pitch is above the horizon */
    double distance;   /* to the pivot */
    double speed;      /* of flying, world units a second */
    double fov_y_deg;
    uint32_t view_height; /* pixels: what drags are measured in */
} strl_navigator;

/* bounds: min xyz, max xyz, world. Starts at home, orbiting. */
void strl_navigator_init(strl_navigator *navigator, const double bounds[6], unsigned up_axis);
/* Looks at the whole model from outside; keeps mode and speed. */
void strl_navigator_home(strl_navigator *navigator);
void strl_navigator_set_mode(strl_navigator *navigator, strl_navigator_mode mode);

/* What the mouse does in the mode. */
void strl_navigator_drag_left(strl_navigator *navigator, double dx, double dy);
void strl_navigator_drag_right(strl_navigator *navigator, double dx, double dy);
void strl_navigator_wheel(strl_navigator *navigator, double ticks);
/* Held keys: right, up, forward, each -1 to 1. Only while flying. */
void strl_navigator_move(strl_navigator *navigator, const double way[3], bool fast, double seconds);

strl_camera strl_navigator_camera(const strl_navigator *navigator, uint32_t width, uint32_t height);

#endif
