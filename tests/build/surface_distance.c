#include "build/surface_distance.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "base/hash.h"

#define LEAF_TRIANGLES 4u

static void subtract(const double a[3], const double b[3], double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = a[k] - b[k];
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

static double segment_distance2(const double p[3], const double a[3], const double b[3])
{
    double ab[3], ap[3], rest[3];
    subtract(b, a, ab);
    subtract(p, a, ap);
    double length2 = dot(ab, ab), along = length2 > 0 ? dot(ap, ab) / length2 : 0;
    along = along < 0 ? 0 : along > 1 ? 1 : along;
    for (int k = 0; k < 3; k++)
        rest[k] = ap[k] - along * ab[k];
    return dot(rest, rest);
}

/* The edges first, which are right for any triangle; then the plane, where p is above the inside. */
static double triangle_distance2(const double corner[3][3], const double p[3])
{
    double best = INFINITY, ab[3], ac[3], n[3], to_p[3], side[3];
    bool inside = true;
    for (int c = 0; c < 3; c++)
        best = fmin(best, segment_distance2(p, corner[c], corner[(c + 1) % 3]));
    subtract(corner[1], corner[0], ab);
    subtract(corner[2], corner[0], ac);
    cross(ab, ac, n);
    double area2 = dot(n, n);
    if (!(area2 > 0))
        return best;
    for (int c = 0; c < 3; c++) {
        double edge[3];
        subtract(corner[(c + 1) % 3], corner[c], edge);
        subtract(p, corner[c], to_p);
        cross(edge, to_p, side);
        inside &= dot(side, n) >= 0;
    }
    subtract(p, corner[0], to_p);
    double height = dot(to_p, n);
    return inside ? fmin(best, height * height / area2) : best;
}

double surface_distance_slow(uint32_t count, const double (*corner)[3][3], const double p[3])
{
    double best = INFINITY;
    for (uint32_t t = 0; t < count; t++)
        best = fmin(best, triangle_distance2(corner[t], p));
    return sqrt(best);
}

static int sort_axis;

static int compare_centres(const void *a, const void *b)
{
    const double(*x)[3] = a, (*y)[3] = b;
    double p = x[0][sort_axis] + x[1][sort_axis] + x[2][sort_axis];
    double q = y[0][sort_axis] + y[1][sort_axis] + y[2][sort_axis];
    return p < q ? -1 : p > q;
}

static void fit(surface_box *box, uint32_t count, const double (*corner)[3][3])
{
    for (int k = 0; k < 3; k++) {
        box->least[k] = INFINITY;
        box->most[k] = -INFINITY;
        for (uint32_t i = 0; i < 3 * count; i++) {
            box->least[k] = fmin(box->least[k], corner[i / 3][i % 3][k]);
            box->most[k] = fmax(box->most[k], corner[i / 3][i % 3][k]);
        }
    }
}

static void divide(surface *tree, uint32_t at, uint32_t level, uint32_t first, uint32_t count)
{
    surface_box *box = &tree->box[at];
    fit(box, count, (const double(*)[3][3])tree->corner + first);
    box->first = first;
    box->count = level == tree->levels ? count : 0;
    if (level == tree->levels)
        return;
    sort_axis = 0;
    for (int k = 1; k < 3; k++)
        if (box->most[k] - box->least[k] > box->most[sort_axis] - box->least[sort_axis])
            sort_axis = k;
    qsort(tree->corner + first, count, sizeof *tree->corner, compare_centres);
    divide(tree, 2 * at + 1, level + 1, first, count / 2);
    divide(tree, 2 * at + 2, level + 1, first + count / 2, count - count / 2);
}

void surface_create(surface *tree, uint32_t count, const double (*corner)[3][3])
{
    tree->count = count;
    tree->levels = 0;
    while (count >> tree->levels > LEAF_TRIANGLES)
        tree->levels++;
    tree->corner = malloc((count + 1) * sizeof *tree->corner);
    tree->box = calloc((size_t)2 << tree->levels, sizeof *tree->box);
    assert_non_null(tree->corner);
    assert_non_null(tree->box);
    memcpy(tree->corner, corner, count * sizeof *tree->corner);
    divide(tree, 0, 0, 0, count);
}

void surface_destroy(surface *tree)
{
    free(tree->corner);
    free(tree->box);
    tree->corner = NULL;
    tree->box = NULL;
}

static double box_distance2(const surface_box *box, const double p[3])
{
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        double off = fmax(0, fmax(box->least[k] - p[k], p[k] - box->most[k]));
        sum += off * off;
    }
    return sum;
}

static void search(const surface *tree, uint32_t at, uint32_t level, const double p[3], double *best)
{
    const surface_box *box = &tree->box[at];
    if (level == tree->levels) {
        for (uint32_t t = 0; t < box->count; t++)
            *best = fmin(*best, triangle_distance2((const double(*)[3])tree->corner[box->first + t], p));
        return;
    }
    double side[2] = {box_distance2(&tree->box[2 * at + 1], p), box_distance2(&tree->box[2 * at + 2], p)};
    int nearer = side[1] < side[0];
    for (int i = 0; i < 2; i++)
        if (side[nearer ^ i] < *best)
            search(tree, 2 * at + 1 + (uint32_t)(nearer ^ i), level + 1, p, best);
}

double surface_distance(const surface *tree, const double p[3])
{
    double best = INFINITY;
    search(tree, 0, 0, p, &best);
    return sqrt(best);
}

static double uniform(uint64_t *seed)
{
    *seed += 0x9e3779b97f4a7c15u;
    return (double)(strl__mix64(*seed) >> 11) * 0x1p-53;
}

double surface_reach(const surface *tree, uint32_t count, const double (*corner)[3][3], unsigned samples, uint64_t seed)
{
    double reach = 0;
    for (uint32_t t = 0; t < count; t++)
        for (unsigned i = 0; i < 6 + samples; i++) {
            double weight[3] = {0, 0, 0}, p[3];
            if (i < 3) {
                weight[i] = 1;
            } else if (i < 6) {
                weight[i - 3] = weight[(i - 2) % 3] = 0.5;
            } else {
                double root = sqrt(uniform(&seed)), along = uniform(&seed);
                weight[0] = 1 - root, weight[1] = root * (1 - along), weight[2] = root * along;
            }
            for (int k = 0; k < 3; k++)
                p[k] = weight[0] * corner[t][0][k] + weight[1] * corner[t][1][k] + weight[2] * corner[t][2][k];
            reach = fmax(reach, surface_distance(tree, p));
        }
    return reach;
}
