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
#define LEAST_LOOK 1e-5
#define WALKER_METRES 1.7
#define WALKER_RADII 0.02
/* Eye heights a second: a brisk walk. */
#define WALK_SPEED 1.2
/* Of a walker's way to the ground, seconds until a third is left. */
#define FALL_SECONDS 0.12
/* What is looked at leaves this much room round it. */
#define LOOK_MARGIN 1.15

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

strl_pose strl_navigator_pose(const strl_navigator *n)
{
    strl_pose pose = {.yaw = n->yaw, .pitch = n->pitch, .distance = n->distance};
    memcpy(pose.eye, n->eye, sizeof pose.eye);
    return pose;
}

static void set_pose(strl_navigator *n, const strl_pose *pose)
{
    memcpy(n->eye, pose->eye, sizeof n->eye);
    n->yaw = pose->yaw, n->pitch = pose->pitch, n->distance = pose->distance;
}

/* Looks at the pivot from the direction that yaw and pitch tell. */
static strl_pose pose_round(const strl_navigator *n, const double pivot[3], double yaw, double pitch, double distance)
{
    strl_navigator there = {.up_axis = n->up_axis, .yaw = yaw, .pitch = pitch, .distance = distance};
    memcpy(there.eye, pivot, sizeof there.eye);
    shift(there.eye, axes_of(&there).forward, -distance);
    return strl_navigator_pose(&there);
}

strl_pose strl_navigator_home(const strl_navigator *n)
{
    /* From the positive side of the first horizontal axis, as the orbit of `stroll render` starts. */
    return pose_round(n, n->centre, M_PI, HOME_PITCH, HOME_DISTANCE * n->radius);
}

strl_pose strl_navigator_pose_on(const strl_navigator *n, const double bounds[6])
{
    double centre[3], square = 0;
    for (int i = 0; i < 3; i++) {
        double half = (bounds[3 + i] - bounds[i]) / 2;
        centre[i] = bounds[i] + half;
        square += half * half;
    }
    double distance = LOOK_MARGIN * sqrt(square) / sin(n->fov_y_deg * DEGREE / 2);
    return pose_round(n, centre, n->yaw, n->pitch, fmax(distance, LEAST_LOOK * n->radius));
}

strl_pose strl_navigator_pose_at(const strl_navigator *n, const double eye[3], const double target[3])
{
    unsigned u = n->up_axis, a = (u + 1) % 3, b = (u + 2) % 3;
    double way[3];
    strl_pose pose = {.distance = n->distance};
    for (int i = 0; i < 3; i++) {
        pose.eye[i] = eye[i];
        way[i] = target[i] - eye[i];
    }
    pose.yaw = atan2(way[b], way[a]);
    pose.pitch = clamp(atan2(way[u], hypot(way[a], way[b])), -MOST_PITCH, MOST_PITCH);
    return pose;
}

void strl_navigator_go(strl_navigator *n, const strl_pose *pose, double seconds)
{
    n->from = strl_navigator_pose(n);
    n->to = *pose;
    n->gone = 0;
    n->going = seconds;
    if (!(seconds > 0))
        set_pose(n, pose);
}

/* The pivot goes straight, the distance by equal factors, and the direction turns the short way: an orbit stays one. */
static void pose_between(const strl_navigator *n, double share, strl_pose *out)
{
    strl_navigator ends[2] = {*n, *n};
    double pivot[3];
    set_pose(&ends[0], &n->from);
    set_pose(&ends[1], &n->to);
    for (int e = 0; e < 2; e++)
        shift(ends[e].eye, axes_of(&ends[e]).forward, ends[e].distance);
    for (int i = 0; i < 3; i++)
        pivot[i] = ends[0].eye[i] + share * (ends[1].eye[i] - ends[0].eye[i]);
    *out = pose_round(n, pivot, n->from.yaw + share * remainder(n->to.yaw - n->from.yaw, 2 * M_PI),
                      n->from.pitch + share * (n->to.pitch - n->from.pitch),
                      n->from.distance * pow(n->to.distance / n->from.distance, share));
}

bool strl_navigator_step(strl_navigator *n, double seconds)
{
    if (!(n->going > 0))
        return false;
    n->gone += seconds;
    if (n->gone >= n->going) {
        n->going = 0;
        set_pose(n, &n->to);
        return false;
    }
    strl_pose now;
    double t = n->gone / n->going;
    pose_between(n, t * t * (3 - 2 * t), &now);
    set_pose(n, &now);
    return true;
}

void strl_navigator_init(strl_navigator *n, const double bounds[6], unsigned up_axis, double unit_metres)
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
    n->eye_height = unit_metres > 0 ? WALKER_METRES / unit_metres : WALKER_RADII * n->radius;
    n->walk_speed = WALK_SPEED * n->eye_height;
    strl_pose home = strl_navigator_home(n);
    set_pose(n, &home);
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
    if (dx == 0 && dy == 0)
        return;
    n->going = 0;
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
    if (n->mode != STRL_NAVIGATOR_ORBIT) {
        turn(n, dx, dy);
        return;
    }
    if (dx == 0 && dy == 0)
        return;
    n->going = 0;
    axes view = axes_of(n);
    double per_pixel = 2 * tan(n->fov_y_deg * DEGREE / 2) * n->distance / n->view_height;
    shift(n->eye, view.right, -dx * per_pixel);
    shift(n->eye, view.up, dy * per_pixel);
    keep_near(n);
}

void strl_navigator_wheel(strl_navigator *n, double ticks)
{
    if (ticks == 0)
        return;
    if (n->mode != STRL_NAVIGATOR_ORBIT) {
        double *speed = n->mode == STRL_NAVIGATOR_FLY ? &n->speed : &n->walk_speed;
        *speed = clamp(*speed * pow(SPEED_PER_TICK, ticks), LEAST_DISTANCE * n->radius, MOST_DISTANCE * n->radius);
        return;
    }
    n->going = 0;
    double distance =
        clamp(n->distance * pow(ZOOM_PER_TICK, ticks), LEAST_DISTANCE * n->radius, MOST_DISTANCE * n->radius);
    shift(n->eye, axes_of(n).forward, n->distance - distance);
    n->distance = distance;
}

double strl_navigator_speed(const strl_navigator *n)
{
    return n->mode == STRL_NAVIGATOR_WALK ? n->walk_speed : n->speed;
}

void strl_navigator_move(strl_navigator *n, const double way[3], bool fast, double seconds)
{
    if (n->mode == STRL_NAVIGATOR_ORBIT || (way[0] == 0 && way[1] == 0 && way[2] == 0))
        return;
    n->going = 0;
    bool walks = n->mode == STRL_NAVIGATOR_WALK;
    strl_navigator level = *n;
    level.pitch = walks ? 0 : n->pitch;
    axes view = axes_of(&level);
    double length = strl_navigator_speed(n) * (fast ? FAST_FACTOR : 1) * seconds;
    shift(n->eye, view.right, way[0] * length);
    shift(n->eye, view.up, walks ? 0 : way[1] * length);
    shift(n->eye, view.forward, way[2] * length);
    keep_near(n);
}

bool strl_navigator_stand(strl_navigator *n, double ground, double seconds)
{
    double *height = &n->eye[n->up_axis], left = ground + n->eye_height - *height;
    bool near = fabs(left) < 1e-3 * n->eye_height;
    *height += near ? left : left * (1 - exp(-seconds / FALL_SECONDS));
    return !near;
}

/* Nothing of the model lies behind an orthographic camera's eye: it stands back, which does not change its image. */
static void stand_back(const strl_navigator *n, const double forward[3], strl_camera *camera)
{
    double ahead = 0;
    for (int i = 0; i < 3; i++)
        ahead += forward[i] * (n->centre[i] - n->eye[i]);
    double back = fmax(0, 1.01 * n->radius - ahead);
    shift(camera->eye, forward, -back);
    camera->fov_y_deg = 0;
    camera->ortho_height = 2 * tan(n->fov_y_deg * DEGREE / 2) * n->distance;
}

strl_camera strl_navigator_camera(const strl_navigator *n, uint32_t width, uint32_t height)
{
    strl_camera camera = {.fov_y_deg = n->fov_y_deg, .width = width, .height = height};
    memcpy(camera.eye, n->eye, sizeof camera.eye);
    axes view = axes_of(n);
    if (n->orthographic)
        stand_back(n, view.forward, &camera);
    memcpy(camera.target, camera.eye, sizeof camera.target);
    /* A target at the pivot's distance can vanish in the digits of a far-off eye. */
    shift(camera.target, view.forward, fmax(n->distance, n->radius));
    camera.up[n->up_axis] = 1;
    return camera;
}
