/* Where the visitor is and looks. One state for all ways to move: orbit turns it about the pivot, which lies
 * `distance` ahead, fly and walk about the eye. Drags are in pixels, y downward. Pure arithmetic: no window. */
#ifndef STRL_VIEWER_NAVIGATOR_H
#define STRL_VIEWER_NAVIGATOR_H

#include <stdbool.h>
#include <stdint.h>

#include "stroll/frame.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum strl_navigator_mode { STRL_NAVIGATOR_ORBIT, STRL_NAVIGATOR_FLY, STRL_NAVIGATOR_WALK } strl_navigator_mode;

/* A place and a direction. */
typedef struct strl_pose {
    double eye[3];
    double yaw, pitch; /* of the view direction, radians; pitch is above the horizon */
    double distance;   /* to the pivot */
} strl_pose;

typedef struct strl_navigator {
    double centre[3], radius; /* of the model's bounding sphere */
    unsigned up_axis;
    strl_navigator_mode mode;
    double eye[3];
    double yaw, pitch; /* as in a pose */
    double distance;
    double speed; /* of flying, world units a second */
    double walk_speed;
    double eye_height; /* of a walker above what lies below, world units */
    double fov_y_deg;
    bool orthographic;    /* as high as a perspective image is at the pivot */
    uint32_t view_height; /* pixels: what drags are measured in */
    strl_pose from, to;   /* of a transition */
    double gone, going;   /* seconds since it began, in all; going 0 = there is none */
} strl_navigator;

/* bounds: min xyz, max xyz, world. unit_metres: how long a world unit is; 0 = unknown. Starts at home, orbiting. */
void strl_navigator_init(strl_navigator *navigator, const double bounds[6], unsigned up_axis, double unit_metres);
void strl_navigator_set_mode(strl_navigator *navigator, strl_navigator_mode mode);
/* Of the mode, for people: what the wheel sets. */
double strl_navigator_speed(const strl_navigator *navigator);

strl_pose strl_navigator_pose(const strl_navigator *navigator);
/* The whole model from outside. */
strl_pose strl_navigator_home(const strl_navigator *navigator);
/* All of a box, seen in the present direction. */
strl_pose strl_navigator_pose_on(const strl_navigator *navigator, const double bounds[6]);
/* At the eye, towards the target. */
strl_pose strl_navigator_pose_at(const strl_navigator *navigator, const double eye[3], const double target[3]);
/* Goes there smoothly; 0 seconds: is there at once. What the visitor does meanwhile ends it on the way. */
void strl_navigator_go(strl_navigator *navigator, const strl_pose *pose, double seconds);
/* Time passes. True while a transition goes on. */
bool strl_navigator_step(strl_navigator *navigator, double seconds);

/* What the mouse does in the mode. */
void strl_navigator_drag_left(strl_navigator *navigator, double dx, double dy);
void strl_navigator_drag_right(strl_navigator *navigator, double dx, double dy);
void strl_navigator_wheel(strl_navigator *navigator, double ticks);
/* Held keys: right, up, forward, each -1 to 1. Not while orbiting; a walker stays level. */
void strl_navigator_move(strl_navigator *navigator, const double way[3], bool fast, double seconds);
/* A walker's eye comes to rest eye_height above `ground`, a coordinate on the up axis. True while it still moves. */
bool strl_navigator_stand(strl_navigator *navigator, double ground, double seconds);

strl_camera strl_navigator_camera(const strl_navigator *navigator, uint32_t width, uint32_t height);

#ifdef __cplusplus
}
#endif
#endif
