/* Distance of a point from a triangle: the closest point by Voronoi regions (Ericson 2005, 5.1.5), in doubles. */
#include <math.h>

#include "verify/surface.h"

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static double segment_distance2(const double p[3], const double a[3], const double b[3])
{
    double ab[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]}, ap[3] = {p[0] - a[0], p[1] - a[1], p[2] - a[2]};
    double length2 = dot(ab, ab), t = length2 > 0 ? dot(ap, ab) / length2 : 0;
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    double d[3] = {ap[0] - t * ab[0], ap[1] - t * ab[1], ap[2] - t * ab[2]};
    return dot(d, d);
}

/* A triangle without area is its edges. */
static double edges_distance2(const double p[3], const double a[3], const double b[3], const double c[3])
{
    return fmin(fmin(segment_distance2(p, a, b), segment_distance2(p, b, c)), segment_distance2(p, c, a));
}

double strl__v_triangle_distance2(const double p[3], const double a[3], const double b[3], const double c[3])
{
    double ab[3], ac[3], ap[3], d[3];
    for (unsigned k = 0; k < 3; k++) {
        ab[k] = b[k] - a[k];
        ac[k] = c[k] - a[k];
        ap[k] = p[k] - a[k];
    }
    double d1 = dot(ab, ap), d2 = dot(ac, ap);
    if (d1 <= 0 && d2 <= 0)
        return dot(ap, ap);
    double bp[3] = {p[0] - b[0], p[1] - b[1], p[2] - b[2]}, d3 = dot(ab, bp), d4 = dot(ac, bp);
    if (d3 >= 0 && d4 <= d3)
        return dot(bp, bp);
    double cp[3] = {p[0] - c[0], p[1] - c[1], p[2] - c[2]}, d5 = dot(ab, cp), d6 = dot(ac, cp);
    if (d6 >= 0 && d5 <= d6)
        return dot(cp, cp);
    double va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2, sum = va + vb + vc;
    if (va <= 0 || vb <= 0 || vc <= 0 || !(sum > 0))
        return edges_distance2(p, a, b, c);
    double v = vb / sum, w = vc / sum;
    for (unsigned k = 0; k < 3; k++)
        d[k] = ap[k] - v * ab[k] - w * ac[k];
    return dot(d, d);
}
