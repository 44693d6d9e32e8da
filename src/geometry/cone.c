#include "geometry/cone.h"

#include <math.h>
#include <string.h>

#define AXIS_MOST 32767.0
/* Far above what rounding does to cosines and angles of unit vectors, far below what a cone's two bytes tell apart. */
#define SLACK 1e-9
#define CENTRING 16 /* steps towards the direction that is farthest off (Badoiu and Clarkson 2003) */

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double a[3], const double b[3], double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
}

static bool normalise(double v[3])
{
    double length = sqrt(dot(v, v));
    for (int k = 0; k < 3; k++)
        v[k] /= length;
    return length > 0 && isfinite(length);
}

static strl_cone none(void)
{
    return (strl_cone){{0, 0, 0}, 0};
}

strl_cone strl_cone_empty(void)
{
    return (strl_cone){{0, 0, 0}, STRL_CONE_SCALE};
}

bool strl_cone_is_empty(const strl_cone *cone)
{
    return cone->cosine > 0 && !cone->axis[0] && !cone->axis[1] && !cone->axis[2];
}

/* a b - c d to within two units in the last place: of a face that is nearly a line plain products would leave noise
 * (Kahan). */
static double difference_of_products(double a, double b, double c, double d)
{
    double cd = c * d, lost = fma(-c, d, cd);
    return fma(a, b, -cd) + lost;
}

bool strl_cone_normal(const double edge[3], const double next[3], double normal[3])
{
    for (int k = 0; k < 3; k++)
        normal[k] = difference_of_products(edge[(k + 1) % 3], next[(k + 2) % 3], edge[(k + 2) % 3], next[(k + 1) % 3]);
    return normalise(normal);
}

static strl_cone with_axis(const double axis[3])
{
    strl_cone cone = {.cosine = 1};
    double largest = fmax(fabs(axis[0]), fmax(fabs(axis[1]), fabs(axis[2])));
    for (int k = 0; k < 3; k++)
        cone.axis[k] = (int16_t)lrint(axis[k] / largest * AXIS_MOST);
    return cone;
}

/* The axis as it is stored. */
static void get_axis(const strl_cone *cone, double axis[3])
{
    for (int k = 0; k < 3; k++)
        axis[k] = cone->axis[k];
    normalise(axis);
}

static strl_cone with_cosine(strl_cone cone, double cosine)
{
    double code = floor((cosine - SLACK) * STRL_CONE_SCALE);
    cone.cosine = code >= 1 ? (uint16_t)code : 0;
    return code >= 1 ? cone : none();
}

static size_t farthest(const double (*normal)[3], size_t count, const double axis[3], double *cosine)
{
    size_t at = 0;
    *cosine = 2;
    for (size_t i = 0; i < count; i++) {
        double to = dot(normal[i], axis);
        if (to < *cosine)
            *cosine = to, at = i;
    }
    return at;
}

/* From the middle of the box of all directions towards the one that is farthest off, by less and less. */
static bool find_axis(const double (*normal)[3], size_t count, double best[3])
{
    double low[3], high[3], centre[3], axis[3], cosine, most = 0;
    memcpy(low, normal[0], sizeof low);
    memcpy(high, normal[0], sizeof high);
    for (size_t i = 1; i < count; i++)
        for (int k = 0; k < 3; k++) {
            low[k] = fmin(low[k], normal[i][k]);
            high[k] = fmax(high[k], normal[i][k]);
        }
    for (int k = 0; k < 3; k++)
        centre[k] = (low[k] + high[k]) / 2;
    for (int step = 0; step < CENTRING; step++) {
        memcpy(axis, centre, sizeof axis);
        if (!normalise(axis))
            break;
        size_t far = farthest(normal, count, axis, &cosine);
        if (cosine > most) {
            most = cosine;
            memcpy(best, axis, sizeof axis);
        }
        for (int k = 0; k < 3; k++)
            centre[k] += (normal[far][k] - centre[k]) / (step + 3);
    }
    return most > 0;
}

strl_cone strl_cone_around(const double (*normal)[3], size_t count)
{
    double axis[3], cosine;
    if (count == 0)
        return strl_cone_empty();
    if (!find_axis(normal, count, axis))
        return none();
    strl_cone cone = with_axis(axis);
    get_axis(&cone, axis);
    farthest(normal, count, axis, &cosine);
    return with_cosine(cone, cosine);
}

/* Exact where it is small, which the arc cosine is not. */
static double angle_between(const double a[3], const double b[3])
{
    double across[3];
    cross(a, b, across);
    return atan2(sqrt(dot(across, across)), dot(a, b));
}

/* So far on the way from a to b, at an angle of `whole`, both of length 1. */
static void turn(const double a[3], const double b[3], double part, double whole, double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = a[k] * sin(whole - part) + b[k] * sin(part);
}

strl_cone strl_cone_join(const strl_cone *a, const strl_cone *b)
{
    double from[3], to[3], axis[3];
    if (!a->cosine || !b->cosine)
        return none();
    if (strl_cone_is_empty(a) || strl_cone_is_empty(b))
        return strl_cone_is_empty(a) ? *b : *a;
    get_axis(a, from);
    get_axis(b, to);
    double half_a = acos((double)a->cosine / STRL_CONE_SCALE), half_b = acos((double)b->cosine / STRL_CONE_SCALE);
    double apart = angle_between(from, to), half = (apart + half_a + half_b) / 2;
    if (apart + half_b + SLACK <= half_a)
        return *a;
    if (apart + half_a + SLACK <= half_b)
        return *b;
    if (half >= M_PI / 2)
        return none();
    turn(from, to, fmin(fmax(half - half_a, 0), apart), apart, axis);
    if (!normalise(axis)) /* they are one */
        memcpy(axis, from, sizeof axis);
    strl_cone cone = with_axis(axis);
    get_axis(&cone, axis);
    half = fmax(angle_between(axis, from) + half_a, angle_between(axis, to) + half_b);
    return half < M_PI / 2 ? with_cosine(cone, cos(half)) : none();
}
