/* Camera arithmetic in double precision: view basis, frustum, and the pixel error of a box
 * (docs/architecture.md, "The pixel error is conservative"). */
#ifndef STRL_FRAME_VIEW_H
#define STRL_FRAME_VIEW_H

#include <stdbool.h>
#include <stdint.h>

#include "stroll/frame.h"

typedef struct strl_view {
    double eye[3];
    double right[3], up[3], forward[3]; /* orthonormal */
    double tan_x, tan_y;                /* half extents of the image at distance 1; perspective */
    double half_width, half_height;     /* world units; orthographic */
    double focal_px;                    /* height / (2 tan_y); orthographic: pixels per world unit */
    double corner;                      /* largest |p| / z in the image: sqrt(1 + tan_x^2 + tan_y^2) */
    bool orthographic;
} strl_view;

/* An axis-aligned box in world units. */
typedef struct strl_box {
    double min[3], max[3];
} strl_box;

/* False where the camera is degenerate (not finite, eye = target, up parallel to the view, empty image). */
bool strl_view_init(strl_view *view, const strl_camera *camera);
/* Why it is: half a sentence, such as "up is zero"; NULL where strl_view_init succeeds. */
const char *strl_view_fault(const strl_camera *camera);
/* Conservative: false only where the box is certainly outside the image (or wholly behind the eye). */
bool strl_view_sees(const strl_view *view, const strl_box *box);
/* The largest displacement in pixels, anywhere in the image, that a length `error` (world units) can cause at a point
 * of the box that lies in front of the eye: an upper bound of error * focal * |p| / (z (z - error)). Infinity where z -
 * error can reach 0 within the image; 0 where the box cannot be in the image. */
double strl_view_error_px(const strl_view *view, const strl_box *box, double error);
/* What the image shows of a box, as far as pixel errors depend on it: measured once, it projects many errors. */
typedef struct strl_sight {
    bool seen;  /* as strl_view_sees */
    bool empty; /* the box cannot be in the image, though seen may be true: every error is 0 pixels */
    bool orthographic;
    double focal_px;
    double nearest; /* least distance along the view direction of what is shown; perspective */
    double slope;   /* largest |p| / z of what is shown; perspective */
} strl_sight;

strl_sight strl_view_sight(const strl_view *view, const strl_box *box);
/* strl_view_error_px(view, box, error) is strl_sight_error_px(strl_view_sight(view, box), error). Never decreases with
 * error. */
double strl_sight_error_px(const strl_sight *sight, double error);
/* The largest error that is no more than px > 0 pixels; INFINITY where all are. */
double strl_sight_error_of(const strl_sight *sight, double px);
/* From the eye to a point, or as long as the view's direction where all rays are parallel. */
void strl_view_ray(const strl_view *view, const double point[3], double ray[3]);
/* The least and largest distance along the view direction over the box. */
void strl_view_depth_range(const strl_view *view, const strl_box *box, double *least, double *largest);

#endif
