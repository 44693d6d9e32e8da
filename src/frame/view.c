/* Camera arithmetic. The image of a perspective camera is a pyramid with its apex in the eye and no far end; what of a
 * box can be seen is the convex polytope box /\ pyramid, and every bound here is taken over the vertices of that
 * polytope. */
#include "frame/view.h"

#include <math.h>
#include <string.h>

/* The pyramid is widened by this, so that rounding never loses a point of the image. */
#define WIDEN 1e-9
/* Factor on a pixel error that covers the rounding of its own arithmetic. */
#define ROUND_UP (1 + 1e-12)

/* fmin and fmax without their care for NaN, which costs a call: boxes and cameras are finite here. */
static double lesser(double a, double b)
{
    return a < b ? a : b;
}

static double greater(double a, double b)
{
    return a > b ? a : b;
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* False where the vector has no direction. Scales first: squares of tiny or huge coordinates leave the range of double.
 */
static bool normalise(double v[3])
{
    double largest = fmax(fabs(v[0]), fmax(fabs(v[1]), fabs(v[2])));
    if (!(largest > 0) || !isfinite(largest))
        return false;
    for (int i = 0; i < 3; i++)
        v[i] /= largest;
    double length = sqrt(dot(v, v));
    for (int i = 0; i < 3; i++)
        v[i] /= length;
    return true;
}

/* The two below return what is wrong, NULL = nothing. */
static const char *init_basis(strl_view *view, const strl_camera *camera)
{
    double up[3];
    for (int i = 0; i < 3; i++) {
        if (!isfinite(camera->eye[i]) || !isfinite(camera->target[i]) || !isfinite(camera->up[i]))
            return "a coordinate of eye, target or up is not finite";
        view->eye[i] = camera->eye[i];
        view->forward[i] = camera->target[i] - camera->eye[i];
        up[i] = camera->up[i];
    }
    if (!normalise(view->forward))
        return "eye and target are the same point, or farther apart than numbers reach";
    if (!normalise(up))
        return "up is zero";
    cross(view->forward, up, view->right);
    /* Below this angle between up and view the roll of the image is rounding noise. */
    if (dot(view->right, view->right) < 1e-20 || !normalise(view->right))
        return "up is along the line from eye to target";
    cross(view->right, view->forward, view->up);
    return NULL;
}

static const char *init_view(strl_view *view, const strl_camera *camera)
{
    memset(view, 0, sizeof *view);
    if (camera->width == 0 || camera->height == 0)
        return "the image has no pixels";
    const char *fault = init_basis(view, camera);
    if (fault)
        return fault;
    double aspect = (double)camera->width / camera->height;
    view->orthographic = camera->fov_y_deg == 0;
    if (view->orthographic) {
        if (!(camera->ortho_height > 0) || !isfinite(camera->ortho_height))
            return "the height of an orthographic image is not above 0";
        view->half_height = camera->ortho_height / 2;
        view->half_width = view->half_height * aspect;
        view->focal_px = camera->height / camera->ortho_height;
        view->corner = 1;
        return NULL;
    }
    if (!(camera->fov_y_deg > 0 && camera->fov_y_deg < 180))
        return "fov is not between 0 and 180 degrees";
    view->tan_y = tan(camera->fov_y_deg * (M_PI / 360));
    view->tan_x = view->tan_y * aspect;
    view->focal_px = camera->height / (2 * view->tan_y);
    view->corner = sqrt(1 + view->tan_x * view->tan_x + view->tan_y * view->tan_y);
    return NULL;
}

bool strl_view_init(strl_view *view, const strl_camera *camera)
{
    return !init_view(view, camera);
}

const char *strl_view_fault(const strl_camera *camera)
{
    strl_view view;
    return init_view(&view, camera);
}

/* The least and largest of dot(axis, p - eye) over the box. */
static void extent_along(const strl_view *view, const strl_box *box, const double axis[3], double *least,
                         double *largest)
{
    *least = *largest = 0;
    for (int i = 0; i < 3; i++) {
        double a = axis[i] * (box->min[i] - view->eye[i]), b = axis[i] * (box->max[i] - view->eye[i]);
        *least += lesser(a, b);
        *largest += greater(a, b);
    }
}

void strl_view_depth_range(const strl_view *view, const strl_box *box, double *least, double *largest)
{
    extent_along(view, box, view->forward, least, largest);
}

void strl_view_ray(const strl_view *view, const double point[3], double ray[3])
{
    for (int k = 0; k < 3; k++)
        ray[k] = view->orthographic ? view->forward[k] : point[k] - view->eye[k];
}

/* True where the box lies wholly beyond the plane side * axis = tangent * forward through the eye. */
static bool beyond_side(const strl_view *view, const strl_box *box, const double axis[3], double side, double tangent)
{
    double inward[3], least, largest;
    for (int i = 0; i < 3; i++)
        inward[i] = tangent * (1 + WIDEN) * view->forward[i] - side * axis[i];
    extent_along(view, box, inward, &least, &largest);
    return largest < 0;
}

bool strl_view_sees(const strl_view *view, const strl_box *box)
{
    double least, largest;
    extent_along(view, box, view->forward, &least, &largest);
    if (largest < 0)
        return false;
    if (!view->orthographic)
        return !beyond_side(view, box, view->right, 1, view->tan_x) &&
               !beyond_side(view, box, view->right, -1, view->tan_x) &&
               !beyond_side(view, box, view->up, 1, view->tan_y) && !beyond_side(view, box, view->up, -1, view->tan_y);
    extent_along(view, box, view->right, &least, &largest);
    double half_width = view->half_width * (1 + WIDEN), half_height = view->half_height * (1 + WIDEN);
    if (least > half_width || largest < -half_width)
        return false;
    extent_along(view, box, view->up, &least, &largest);
    return least <= half_height && largest >= -half_height;
}

/* What the vertices of box /\ pyramid seen so far say. Points are (x right, y up, z forward) from the eye. */
typedef struct seen {
    double least_z;       /* infinite while there is no vertex */
    double largest_slope; /* |p| / z squared, less one: x^2 + y^2 over z^2 */
} seen;

static void see(seen *all, const double p[3])
{
    all->least_z = lesser(all->least_z, p[2]);
    if (p[2] > 0)
        all->largest_slope = greater(all->largest_slope, (p[0] * p[0] + p[1] * p[1]) / (p[2] * p[2]));
}

/* Cuts the parameter range [*t0, *t1] to where a + t (b - a) >= 0. False where nothing is left. */
static bool cut(double a, double b, double *t0, double *t1)
{
    if (a < 0 && b < 0)
        return false;
    if (a < 0)
        *t0 = greater(*t0, a / (a - b));
    else if (b < 0)
        *t1 = lesser(*t1, a / (a - b));
    return *t0 <= *t1;
}

/* The part of segment pq inside the pyramid. The four sides alone imply z >= 0. */
static void see_segment(const strl_view *view, const double p[3], const double q[3], seen *all)
{
    double t0 = 0, t1 = 1, wide_x = view->tan_x * (1 + WIDEN), wide_y = view->tan_y * (1 + WIDEN);
    if (!cut(wide_x * p[2] - p[0], wide_x * q[2] - q[0], &t0, &t1) ||
        !cut(wide_x * p[2] + p[0], wide_x * q[2] + q[0], &t0, &t1) ||
        !cut(wide_y * p[2] - p[1], wide_y * q[2] - q[1], &t0, &t1) ||
        !cut(wide_y * p[2] + p[1], wide_y * q[2] + q[1], &t0, &t1))
        return;
    const double ends[2] = {t0, t1};
    for (int e = 0; e < 2; e++) {
        double at[3];
        for (int i = 0; i < 3; i++)
            at[i] = p[i] + ends[e] * (q[i] - p[i]);
        see(all, at);
    }
}

/* The part of a corner ray of the image inside the box: vertices where a pyramid edge pierces a face. */
static void see_corner_ray(const strl_view *view, const strl_box *box, double x, double y, seen *all)
{
    double t0 = 0, t1 = INFINITY;
    for (int i = 0; i < 3; i++) {
        double way = x * view->right[i] + y * view->up[i] + view->forward[i];
        double a = box->min[i] - view->eye[i], b = box->max[i] - view->eye[i];
        if (way == 0) {
            if (a > 0 || b < 0)
                return;
            continue;
        }
        t0 = greater(t0, lesser(a / way, b / way));
        t1 = lesser(t1, greater(a / way, b / way));
    }
    if (t0 > t1)
        return;
    see(all, (const double[3]){x * t0, y * t0, t0});
}

static void corners_in_view(const strl_view *view, const strl_box *box, double corner[8][3])
{
    for (int c = 0; c < 8; c++) {
        double from_eye[3];
        for (int i = 0; i < 3; i++)
            from_eye[i] = (c >> i & 1 ? box->max[i] : box->min[i]) - view->eye[i];
        corner[c][0] = dot(view->right, from_eye);
        corner[c][1] = dot(view->up, from_eye);
        corner[c][2] = dot(view->forward, from_eye);
    }
}

static bool inside(const strl_view *view, const double p[3])
{
    return fabs(p[0]) <= view->tan_x * p[2] && fabs(p[1]) <= view->tan_y * p[2];
}

static seen see_box(const strl_view *view, const strl_box *box)
{
    seen all = {INFINITY, 0};
    double corner[8][3];
    corners_in_view(view, box, corner);
    int within = 0;
    for (int c = 0; c < 8; c++)
        if (inside(view, corner[c])) {
            see(&all, corner[c]);
            within++;
        }
    if (within == 8)
        return all;
    for (int c = 0; c < 8; c++)
        for (int axis = 0; axis < 3; axis++)
            if (!(c >> axis & 1))
                see_segment(view, corner[c], corner[c | 1 << axis], &all);
    for (int ray = 0; ray < 4; ray++)
        see_corner_ray(view, box, ray & 1 ? view->tan_x : -view->tan_x, ray & 2 ? view->tan_y : -view->tan_y, &all);
    return all;
}

/* error focal |p| / (z (z - error)) is at most focal error x max(|p| / z) / (min z - error). |p| / z is convex in the
 * image plane, so its largest value over a polytope is at a vertex; min z is too. Both only shrink with the box: nested
 * boxes have ordered bounds. */
strl_sight strl_view_sight(const strl_view *view, const strl_box *box)
{
    strl_sight sight = {
        .seen = strl_view_sees(view, box), .orthographic = view->orthographic, .focal_px = view->focal_px};
    sight.empty = !sight.seen;
    if (!sight.seen || view->orthographic)
        return sight;
    seen all = see_box(view, box);
    sight.empty = all.least_z == INFINITY;
    sight.nearest = all.least_z;
    sight.slope = lesser(sqrt(1 + all.largest_slope), view->corner * (1 + WIDEN));
    return sight;
}

double strl_sight_error_px(const strl_sight *sight, double error)
{
    if (sight->empty)
        return 0;
    if (sight->orthographic)
        return error * sight->focal_px;
    if (!(sight->nearest - error > 0))
        return INFINITY;
    return error * sight->focal_px * sight->slope / (sight->nearest - error) * ROUND_UP;
}

double strl_sight_error_of(const strl_sight *sight, double px)
{
    if (sight->empty)
        return INFINITY;
    if (sight->orthographic)
        return px / sight->focal_px;
    return sight->nearest > 0 ? px * sight->nearest / (sight->focal_px * sight->slope * ROUND_UP + px) : 0;
}

double strl_view_error_px(const strl_view *view, const strl_box *box, double error)
{
    const strl_sight sight = strl_view_sight(view, box);
    return strl_sight_error_px(&sight, error);
}
