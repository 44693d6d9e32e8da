/* What lies under a pixel: a ray against the triangles of a draw list, on the CPU, so that it needs no renderer and
 * gives coordinates in double precision. */
#ifndef STRL_VIEWER_PICK_H
#define STRL_VIEWER_PICK_H

#include <stdbool.h>
#include <stdint.h>

#include "stroll/frame.h"
#include "stroll/render.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct strl_ray {
    double from[3], way[3]; /* world; way is a unit vector */
} strl_ray;

/* What a ray does not see. Zero = nothing is hidden. */
typedef struct strl_pick_filter {
    const uint8_t *part_styles; /* as in strl_draw_options */
    uint32_t part_count;
    double section[4]; /* as in strl_draw_options */
} strl_pick_filter;

typedef struct strl_pick {
    double point[3];         /* world */
    double normal[3];        /* of the triangle, unit, towards where the ray came from */
    double distance;         /* from the ray's start */
    double error;            /* the surface is no farther than this from the point, world units, roughly */
    uint32_t part, material; /* UINT32_MAX where the list has no labels */
    uint32_t placement, node;
} strl_pick;

/* Through the middle of pixel (x, y), y downward. False where the camera is degenerate. */
bool strl_ray_through(const strl_camera *camera, double x, double y, strl_ray *ray);

/* The first triangle that the ray meets, from before where the list culls backs, whether the list's camera saw it or
 * not. False where there is none. */
bool strl_pick_list(const strl_draw_list *list, const strl_ray *ray, const strl_pick_filter *filter, strl_pick *pick);

/* A box round all triangles in the list whose parts have the style, world: min xyz, max xyz. False where there is none:
 * small parts are not in a list that is coarse where they are. */
bool strl_pick_style_bounds(const strl_draw_list *list, const uint8_t *part_styles, uint32_t part_count,
                            strl_part_style style, double bounds[6]);

#ifdef __cplusplus
}
#endif
#endif
