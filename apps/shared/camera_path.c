#include "shared/camera_path.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"
#include "frame/view.h"

#define DEFAULT_FOV_DEG 60.0
#define PROBE_SIDE 256u
#define FLY_STOPS 6
#define DEGREE (M_PI / 180)

/* ---- shared */

void strl_path_sphere(const double bounds[6], double centre[3], double *radius)
{
    double square = 0;
    for (int i = 0; i < 3; i++) {
        double half = (bounds[3 + i] - bounds[i]) / 2;
        centre[i] = bounds[i] + half;
        square += half * half;
    }
    *radius = square > 0 ? sqrt(square) : 1;
}

static strl_status allocate(strl_camera_path *path, size_t frames, strl_error *err)
{
    *path = (strl_camera_path){DEFAULT_FOV_DEG, frames, strl__alloc_zero(frames, sizeof *path->frames)};
    return path->frames ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "no memory for a path of %zu frames", frames);
}

void strl_path_deinit(strl_camera_path *path)
{
    strl__free(path->frames);
    *path = (strl_camera_path){0};
}

strl_camera strl_path_camera(const strl_camera_path *path, size_t frame, const uint32_t size[2])
{
    const strl_path_frame *at = &path->frames[frame];
    strl_camera camera = {.fov_y_deg = path->fov_y_deg, .width = size[0], .height = size[1]};
    memcpy(camera.eye, at->eye, sizeof camera.eye);
    memcpy(camera.target, at->target, sizeof camera.target);
    memcpy(camera.up, at->up, sizeof camera.up);
    return camera;
}

const char *strl_path_fault(const strl_camera_path *path, size_t frame)
{
    strl_camera camera = strl_path_camera(path, frame, (const uint32_t[2]){1, 1});
    if (camera.fov_y_deg == 0) /* which is an orthographic camera elsewhere */
        camera.fov_y_deg = -1;
    return strl_view_fault(&camera);
}

/* Uniform in [0, 1), the n-th number of a seed. */
static double random_at(uint64_t seed, uint64_t n)
{
    return (double)(strl__mix64(strl__mix64(seed + 0x9e3779b97f4a7c15u) + n) >> 11) * 0x1p-53;
}

/* The unit direction at an azimuth and elevation (radians) round the up axis. */
static void direction(unsigned up_axis, double azimuth, double elevation, double out[3])
{
    out[(up_axis + 1) % 3] = cos(elevation) * cos(azimuth);
    out[(up_axis + 2) % 3] = cos(elevation) * sin(azimuth);
    out[up_axis] = sin(elevation);
}

/* ---- orbit */

static void orbit_frame(const strl_path_site *site, double azimuth, strl_path_frame *frame)
{
    double centre[3], radius, way[3];
    strl_path_sphere(site->bounds, centre, &radius);
    direction(site->up_axis, azimuth, 20 * DEGREE, way);
    for (int i = 0; i < 3; i++) {
        frame->eye[i] = centre[i] + 2 * radius * way[i];
        frame->target[i] = centre[i];
        frame->up[i] = i == (int)site->up_axis;
    }
}

strl_status strl_path_orbit(const strl_path_site *site, size_t frames, strl_camera_path *path, strl_error *err)
{
    strl_status status = allocate(path, frames, err);
    for (size_t f = 0; status == STRL_OK && f < frames; f++)
        orbit_frame(site, 2 * M_PI * (double)f / (double)frames, &path->frames[f]);
    return status;
}

/* ---- what lies where */

/* An orthographic look at the model, PROBE_SIDE pixels each way. */
typedef struct probe {
    strl_view view;
    float *depth; /* owned */
} probe;

static strl_status probe_init(probe *look, const strl_path_site *site, const double from[3], const double up[3],
                              strl_error *err)
{
    double centre[3], radius;
    strl_path_sphere(site->bounds, centre, &radius);
    strl_camera camera = {.ortho_height = 2.02 * radius, .width = PROBE_SIDE, .height = PROBE_SIDE};
    for (int i = 0; i < 3; i++) {
        camera.eye[i] = centre[i] + 2 * radius * from[i];
        camera.target[i] = centre[i];
        camera.up[i] = up[i];
    }
    *look = (probe){.depth = strl__alloc(PROBE_SIDE * PROBE_SIDE, sizeof *look->depth)};
    if (!look->depth)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to look for the model's surface");
    if (!strl_view_init(&look->view, &camera))
        return strl__fail(err, STRL_ERR_ARGUMENT, "the model's bounds are too large or too small for a camera path");
    return site->probe(site->context, &camera, look->depth, err);
}

static void probe_deinit(probe *look)
{
    strl__free(look->depth);
}

/* The surface point behind pixel (x, y); false where there is none. */
static bool probe_point(const probe *look, int x, int y, double point[3])
{
    if (x < 0 || y < 0 || x >= (int)PROBE_SIDE || y >= (int)PROBE_SIDE)
        return false;
    double depth = look->depth[y * (int)PROBE_SIDE + x];
    if (!isfinite(depth))
        return false;
    double right = ((x + 0.5) / PROBE_SIDE * 2 - 1) * look->view.half_width;
    double up = (1 - (y + 0.5) / PROBE_SIDE * 2) * look->view.half_height;
    for (int i = 0; i < 3; i++)
        point[i] =
            look->view.eye[i] + right * look->view.right[i] + up * look->view.up[i] + depth * look->view.forward[i];
    return true;
}

/* The same at the covered pixel nearest to (x, y), ring by ring. */
static bool probe_nearest(const probe *look, int x, int y, double point[3])
{
    for (int ring = 0; ring < (int)PROBE_SIDE; ring++)
        for (int dy = -ring; dy <= ring; dy++)
            for (int dx = -ring; dx <= ring; dx += dy == -ring || dy == ring || ring == 0 ? 1 : 2 * ring)
                if (probe_point(look, x + dx, y + dy, point))
                    return true;
    return false;
}

/* ---- walk */

/* Where the ground track is at a phase of [0, 1), as shares of the half extents. */
static void track(uint64_t seed, double phase, double *a, double *b)
{
    double angle = 2 * M_PI * phase;
    double radius = 0.5 + 0.18 * sin(2 * angle + 2 * M_PI * random_at(seed, 0)) +
                    0.1 * sin(3 * angle + 2 * M_PI * random_at(seed, 1));
    double start = 2 * M_PI * random_at(seed, 2);
    *a = radius * cos(angle + start);
    *b = radius * sin(angle + start);
}

/* A point of the track with the highest ground of the nine pixels round it: a walker does not sink into a slope. */
static bool track_point(const strl_path_site *site, const probe *above, uint64_t seed, double phase, double point[3])
{
    unsigned up = site->up_axis, axis_a = (up + 1) % 3, axis_b = (up + 2) % 3;
    double a, b, ground[3], highest = -INFINITY, offset[3] = {0};
    track(seed, phase, &a, &b);
    point[axis_a] = site->bounds[axis_a] + (1 + a) / 2 * (site->bounds[3 + axis_a] - site->bounds[axis_a]);
    point[axis_b] = site->bounds[axis_b] + (1 + b) / 2 * (site->bounds[3 + axis_b] - site->bounds[axis_b]);
    offset[axis_a] = point[axis_a] - above->view.eye[axis_a];
    offset[axis_b] = point[axis_b] - above->view.eye[axis_b];
    double right = 0, top = 0;
    for (int i = 0; i < 3; i++)
        right += offset[i] * above->view.right[i], top += offset[i] * above->view.up[i];
    int x = (int)floor((right / above->view.half_width + 1) / 2 * PROBE_SIDE);
    int y = (int)floor((1 - top / above->view.half_height) / 2 * PROBE_SIDE);
    for (int k = 0; k < 9; k++)
        if (probe_point(above, x + k % 3 - 1, y + k / 3 - 1, ground))
            highest = fmax(highest, ground[up]);
    if (highest == -INFINITY && probe_nearest(above, x, y, ground))
        highest = ground[up];
    point[up] = highest + site->eye_height;
    return highest > -INFINITY;
}

strl_status strl_path_walk(const strl_path_site *site, size_t frames, uint64_t seed, strl_camera_path *path,
                           strl_error *err)
{
    double down[3] = {0}, side[3] = {0};
    down[site->up_axis] = 1;
    side[(site->up_axis + 1) % 3] = 1;
    probe above;
    strl_status status = allocate(path, frames, err);
    if (status != STRL_OK)
        return status;
    status = probe_init(&above, site, down, side, err);
    for (size_t f = 0; status == STRL_OK && f < frames; f++) {
        strl_path_frame *frame = &path->frames[f];
        double phase = (double)f / (double)frames;
        if (!track_point(site, &above, seed, phase, frame->eye) ||
            !track_point(site, &above, seed, phase + 0.03, frame->target))
            status = strl__fail(err, STRL_ERR_ARGUMENT, "the model has no surface to walk on");
        frame->up[site->up_axis] = 1;
    }
    probe_deinit(&above);
    if (status != STRL_OK)
        strl_path_deinit(path);
    return status;
}

/* ---- flythrough */

/* Eyes and targets that the flight passes, with the knots of a centripetal Catmull-Rom curve. */
typedef struct stops {
    double eye[FLY_STOPS + 2][3], target[FLY_STOPS + 2][3], knot[FLY_STOPS + 2];
} stops;

static strl_status find_stop(const strl_path_site *site, uint64_t seed, int stop, double radius, double surface[3],
                             double eye[3], strl_error *err)
{
    double way[3], up[3] = {0};
    double azimuth = 2 * M_PI * (random_at(seed, 10) + (stop + 0.5 * random_at(seed, 20 + (uint64_t)stop)) / FLY_STOPS);
    direction(site->up_axis, azimuth, (15 + 45 * random_at(seed, 40 + (uint64_t)stop)) * DEGREE, way);
    up[site->up_axis] = 1;
    probe look;
    strl_status status = probe_init(&look, site, way, up, err);
    int x = (int)(PROBE_SIDE * (0.3 + 0.4 * random_at(seed, 60 + (uint64_t)stop)));
    int y = (int)(PROBE_SIDE * (0.3 + 0.4 * random_at(seed, 80 + (uint64_t)stop)));
    if (status == STRL_OK && !probe_nearest(&look, x, y, surface))
        status = strl__fail(err, STRL_ERR_ARGUMENT, "the model has no surface to fly along");
    probe_deinit(&look);
    for (int i = 0; status == STRL_OK && i < 3; i++)
        eye[i] = surface[i] + 0.15 * radius * way[i];
    return status;
}

static strl_status find_stops(const strl_path_site *site, uint64_t seed, stops *all, strl_error *err)
{
    double centre[3], radius, surface[FLY_STOPS][3], way[3];
    strl_path_sphere(site->bounds, centre, &radius);
    strl_status status = STRL_OK;
    for (int s = 0; status == STRL_OK && s < FLY_STOPS; s++)
        status = find_stop(site, seed, s, radius, surface[s], all->eye[s + 1], err);
    for (int end = 0; end < 2; end++) {
        int stop = end ? FLY_STOPS + 1 : 0;
        direction(site->up_axis, 2 * M_PI * (random_at(seed, 10) + (end ? 1.05 : -0.05)), 25 * DEGREE, way);
        for (int i = 0; i < 3; i++) {
            all->eye[stop][i] = centre[i] + 3 * radius * way[i];
            all->target[stop][i] = centre[i];
        }
    }
    /* Between this stop's surface and the next one's: the view goes along the surface, not straight at it. */
    for (int s = 0; s < FLY_STOPS; s++)
        for (int i = 0; i < 3; i++)
            all->target[s + 1][i] = 0.4 * surface[s][i] + 0.6 * (s + 1 < FLY_STOPS ? surface[s + 1][i] : centre[i]);
    for (int s = 1; s < FLY_STOPS + 2; s++) {
        double square = 0;
        for (int i = 0; i < 3; i++)
            square += (all->eye[s][i] - all->eye[s - 1][i]) * (all->eye[s][i] - all->eye[s - 1][i]);
        all->knot[s] = all->knot[s - 1] + fmax(sqrt(sqrt(square)), 1e-3 * sqrt(radius));
    }
    return status;
}

/* Cubic Hermite between stops s and s + 1 with Catmull-Rom tangents over uneven knots. */
static double curve(double (*points)[3], const double *knot, int s, double t, int axis)
{
    int last = FLY_STOPS + 1, before = s > 0 ? s - 1 : 0, after = s + 2 <= last ? s + 2 : last;
    double span = knot[s + 1] - knot[s], u = (t - knot[s]) / span;
    double slope0 = (points[s + 1][axis] - points[before][axis]) / (knot[s + 1] - knot[before]);
    double slope1 = (points[after][axis] - points[s][axis]) / (knot[after] - knot[s]);
    double u2 = u * u, u3 = u2 * u;
    return (2 * u3 - 3 * u2 + 1) * points[s][axis] + (u3 - 2 * u2 + u) * span * slope0 +
           (3 * u2 - 2 * u3) * points[s + 1][axis] + (u3 - u2) * span * slope1;
}

/* An up vector that is not along the view. */
static void set_up(strl_path_frame *frame, unsigned up_axis)
{
    double along = frame->target[up_axis] - frame->eye[up_axis], square = 0;
    for (int i = 0; i < 3; i++)
        square += (frame->target[i] - frame->eye[i]) * (frame->target[i] - frame->eye[i]);
    bool steep = along * along > 0.999 * square;
    for (unsigned i = 0; i < 3; i++)
        frame->up[i] = i == (steep ? (up_axis + 1) % 3 : up_axis);
}

strl_status strl_path_flythrough(const strl_path_site *site, size_t frames, uint64_t seed, strl_camera_path *path,
                                 strl_error *err)
{
    stops all = {0};
    strl_status status = find_stops(site, seed, &all, err);
    if (status == STRL_OK)
        status = allocate(path, frames, err);
    for (size_t f = 0; status == STRL_OK && f < frames; f++) {
        double t = all.knot[FLY_STOPS + 1] * (frames > 1 ? (double)f / (double)(frames - 1) : 0.5);
        int s = 0;
        while (s < FLY_STOPS && t > all.knot[s + 1])
            s++;
        for (int i = 0; i < 3; i++) {
            path->frames[f].eye[i] = curve(all.eye, all.knot, s, t, i);
            path->frames[f].target[i] = curve(all.target, all.knot, s, t, i);
        }
        set_up(&path->frames[f], site->up_axis);
    }
    return status;
}

/* ---- one camera */

strl_status strl_path_parse(const strl_path_site *site, const char *spec, strl_camera_path *path, strl_error *err)
{
    strl_status status = strl_path_orbit(site, 1, path, err);
    if (status != STRL_OK)
        return status;
    strl_path_frame *frame = path->frames;
    const struct {
        const char *word;
        double *values;
        int count;
    } known[] = {
        {"eye", frame->eye, 3}, {"target", frame->target, 3}, {"up", frame->up, 3}, {"fov", &path->fov_y_deg, 1}};
    const char *at = spec + strspn(spec, " ,\t");
    while (status == STRL_OK && *at) {
        size_t length = strcspn(at, " ,\t"), k = 0;
        while (k < 4 && (strlen(known[k].word) != length || strncmp(known[k].word, at, length) != 0))
            k++;
        if (k == 4) {
            status = strl__fail(err, STRL_ERR_ARGUMENT, "camera: expected eye, target, up or fov, found \"%.40s\"", at);
            continue;
        }
        at += length;
        for (int i = 0; status == STRL_OK && i < known[k].count; i++) {
            char *end;
            known[k].values[i] = strtod(at += strspn(at, " ,\t"), &end);
            if (end == at || (*end && !strchr(" ,\t", *end)) || !isfinite(known[k].values[i]))
                status = strl__fail(err, STRL_ERR_ARGUMENT, "camera: expected a number after \"%s\", found \"%.40s\"",
                                    known[k].word, at);
            at = end;
        }
        at += strspn(at, " ,\t");
    }
    const char *fault = status == STRL_OK ? strl_path_fault(path, 0) : NULL;
    if (fault)
        status = strl__fail(err, STRL_ERR_ARGUMENT, "camera: %s", fault);
    if (status != STRL_OK)
        strl_path_deinit(path);
    return status;
}
