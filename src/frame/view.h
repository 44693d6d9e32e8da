/* Camera arithmetic in double precision: view basis, frustum, and the pixel error of a box (shared/design: "Error"). */
#ifndef STRL_FRAME_VIEW_H
#define STRL_FRAME_VIEW_H

#include <stdbool.h>
#include <stdint.h>

#include "stroll/frame.h"

typedef struct strl_view {
    double eye[3];
    double right[3], up[3], forward[3]; /* orthonormal */
    double tan_x, tan_y;   /* half extents of the image at distance 1; perspective */
    double half_width, half_height; /* world units; orthographic */
    double focal_px;       /* height / (2 tan_y); orthographic: pixels per world unit */
    double corner;         /* largest |p| / z in the image: sqrt(1 + tan_x^2 + tan_y^2) */
    bool orthographic;
} strl_view;

/* An axis-aligned box in world units. */
typedef struct strl_box {
    double min[3], max[3];
} strl_box;

/* False where the camera is degenerate (not finite, eye = target, up parallel to the view, empty image). */
bool strl_view_init(strl_view *view, const strl_camera *camera);
/* Conservative: false only where the box is certainly outside the image (or wholly behind the eye). */
bool strl_view_sees(const strl_view *view, const strl_box *box);
/* The largest displacement in pixels, anywhere in the image, that a length `error` (world units) can cause at a point of the box that lies in front of
 * the eye: an upper bound of error * focal * |p| / (z (z - error)). Infinity where z - error can reach 0 within the image;
 * 0 where the box cannot be in the image. */
double strl_view_error_px(const strl_view *view, const strl_box *box, double error);
/* The least and largest distance along the view direction over the box. */
void strl_view_depth_range(const strl_view *view, const strl_box *box, double *least, double *largest);

#endif
