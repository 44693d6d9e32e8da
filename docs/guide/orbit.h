/* The camera of the guide's examples: round the model, a little from above. */
#ifndef ORBIT_H
#define ORBIT_H

#include <math.h>
#include <string.h>

#include <stroll/stroll.h>

/* begin: orbit */
static strl_camera orbit(strl_walk *walk, double turn, uint32_t width, uint32_t height)
{
    strl_camera camera = {.fov_y_deg = 60, .width = width, .height = height};
    unsigned up = strl_container_get_info(strl_walk_container(walk))->up_axis; /* 0 x, 1 y, 2 z */
    double bounds[6], squared = 0;
    strl_walk_bounds(walk, bounds);
    for (int i = 0; i < 3; i++) {
        camera.target[i] = (bounds[i] + bounds[i + 3]) / 2;
        squared += (bounds[i + 3] - bounds[i]) * (bounds[i + 3] - bounds[i]);
    }
    /* a model can be empty: a drawing of lines has no triangle */
    double radius = squared > 0 ? sqrt(squared) / 2 : 1;
    memcpy(camera.eye, camera.target, sizeof camera.eye);
    camera.eye[(up + 1) % 3] += 1.6 * radius * cos(turn);
    camera.eye[(up + 2) % 3] += 1.6 * radius * sin(turn);
    camera.eye[up] += 0.7 * radius;
    camera.up[up] = 1;
    return camera;
}
/* end: orbit */

#endif
