#include "viewer/navigator.h"

#include <math.h>
#include <string.h>

#define DEGREE (M_PI / 180)
#define FOV_Y_DEG 60.0
#define HOME_PITCH (-20 * DEGREE)
/* At the pole yaw and roll are one, and the view has no up. */
#define MOST_PITCH (89.5 * DEGREE)
#define ZOOM_PER_TICK 0.88
#define SPEED_PER_TICK 1.25
#define FAST_FACTOR 4.0
/* In radii. Below the least distance doubles of a far-off model run out of digits. */
#define LEAST_DISTANCE 1e-6
#define MOST_DISTANCE 1e3
#define HOME_DISTANCE 2.0
#define HOME_SPEED 0.25
#define LEAST_PIVOT 0.05

typedef struct axes {
    double right[3], up[3], forward[3];
} axes;

static double clamp(double value, double least, double most)
{
    return fmin(fmax(value, least), most);
}

static axes axes_of(const strl_navigator *n)
{
    unsigned u = n->up_axis, a = (u + 1) % 3, b = (u + 2) % 3; /* a, b, u is right-handed */
    double cy = cos(n->yaw), sy = sin(n->yaw), cp = cos(n->pitch), sp = sin(n->pitch);
    axes out = {{0}, {0}, {0}};
    out.forward[a] = cp * cy, out.forward[b] = cp * sy, out.forward[u] = sp;
    out.right[a] = sy, out.right[b] = -cy;
    out.up[a] = -sp * cy, out.up[b] = -sp * sy, out.up[u] = cp;
    return out;
}

static void shift(double point[3], const double way[3], double length)
{
    for (int i = 0; i < 3; i++)
        point[i] += way[i] * length;
}

void strl_navigator_home(strl_navigator *n)
{
    n->yaw = M_PI; /* from the positive side of the first horizontal axis, as the orbit of `stroll render` starts */
    n->pitch = HOME_PITCH;
    n->distance = HOME_DISTANCE * n->radius;
    memcpy(n->eye, n->centre, sizeof n->eye);
    shift(n->eye, axes_of(n).forward, -n->distance);
}

void strl_navigator_init(strl_navigator *n, const double bounds[6], unsigned up_axis)
{
    *n = (strl_navigator){.up_axis = up_axis % 3, .fov_y_deg = FOV_Y_DEG, .view_height = 1};
    double sum = 0, most = 0;
    for (int i = 0; i < 3; i++) {
        double half = (bounds[3 + i] - bounds[i]) / 2;
        n->centre[i] = bounds[i] + half;
        most = fmax(most, fabs(n->centre[i]));
        sum += half * half;
    }
    /* A model of one point still needs a place to look from. */
    n->radius = fmax(sqrt(sum), fmax(most * 1e-9, 1e-30));
    n->speed = HOME_SPEED * n->radius;
    strl_navigator_home(n);
}

/* The pivot of a new orbit is what lies ahead at the model's depth, so that turning does not throw the model out of
 * sight. */
void strl_navigator_set_mode(strl_navigator *n, strl_navigator_mode mode)
{
    if (mode == STRL_NAVIGATOR_ORBIT && n->mode != mode) {
        axes view = axes_of(n);
        double ahead = 0;
        for (int i = 0; i < 3; i++)
            ahead += view.forward[i] * (n->centre[i] - n->eye[i]);
        n->distance = clamp(ahead, LEAST_PIVOT * n->radius, MOST_DISTANCE * n->radius);
    }
    n->mode = mode;
}

/* Turns the view direction; the pivot stays where it is while orbiting, the eye while flying. */
static void turn(strl_navigator *n, double dx, double dy)
{
    bool orbit = n->mode == STRL_NAVIGATOR_ORBIT;
    double per_pixel = (orbit ? M_PI : n->fov_y_deg * DEGREE) / n->view_height;
    double pivot[3];
    memcpy(pivot, n->eye, sizeof pivot);
    shift(pivot, axes_of(n).forward, n->distance);
    n->yaw = remainder(n->yaw - dx * per_pixel, 2 * M_PI);
    n->pitch = clamp(n->pitch - dy * per_pixel, -MOST_PITCH, MOST_PITCH);
    if (!orbit)
        return;
    memcpy(n->eye, pivot, sizeof n->eye);
    shift(n->eye, axes_of(n).forward, -n->distance);
}

void strl_navigator_drag_left(strl_navigator *n, double dx, double dy)
{
    turn(n, dx, dy);
}

/* No farther away than a zoom can go: beyond, pixel errors and depths lose their meaning. */
static void keep_near(strl_navigator *n)
{
    double away[3], sum = 0, most = 2 * MOST_DISTANCE * n->radius;
    for (int i = 0; i < 3; i++) {
        away[i] = n->eye[i] - n->centre[i];
        sum += away[i] * away[i];
    }
    if (!(sum > most * most))
        return;
    memcpy(n->eye, n->centre, sizeof n->eye);
    shift(n->eye, away, most / sqrt(sum));
}

void strl_navigator_drag_right(strl_navigator *n, double dx, double dy)
{
    if (n->mode == STRL_NAVIGATOR_FLY) {
        turn(n, dx, dy);
        return;
    }
    axes view = axes_of(n);
    double per_pixel = 2 * tan(n->fov_y_deg * DEGREE / 2) * n->distance / n->view_height;
    shift(n->eye, view.right, -dx * per_pixel);
    shift(n->eye, view.up, dy * per_pixel);
    keep_near(n);
}

void strl_navigator_wheel(strl_navigator *n, double ticks)
{
    if (n->mode == STRL_NAVIGATOR_FLY) {
        n->speed = clamp(n->speed * pow(SPEED_PER_TICK, ticks), LEAST_DISTANCE * n->radius, MOST_DISTANCE * n->radius);
        return;
    }
    double distance =
        clamp(n->distance * pow(ZOOM_PER_TICK, ticks), LEAST_DISTANCE * n->radius, MOST_DISTANCE * n->radius);
    shift(n->eye, axes_of(n).forward, n->distance - distance);
    n->distance = distance;
}

void strl_navigator_move(strl_navigator *n, const double way[3], bool fast, double seconds)
{
    if (n->mode != STRL_NAVIGATOR_FLY)
        return;
    axes view = axes_of(n);
    double length = n->speed * (fast ? FAST_FACTOR : 1) * seconds;
    shift(n->eye, view.right, way[0] * length);
    shift(n->eye, view.up, way[1] * length);
    shift(n->eye, view.forward, way[2] * length);
    keep_near(n);
}

strl_camera strl_navigator_camera(const strl_navigator *n, uint32_t width, uint32_t height)
{
    strl_camera camera = {.fov_y_deg = n->fov_y_deg, .width = width, .height = height};
    memcpy(camera.eye, n->eye, sizeof camera.eye);
    memcpy(camera.target, n->eye, sizeof camera.target);
    /* A target at the pivot's distance can vanish in the digits of a far-off eye. */
    shift(camera.target, axes_of(n).forward, fmax(n->distance, n->radius));
    camera.up[n->up_axis] = 1;
    return camera;
}
