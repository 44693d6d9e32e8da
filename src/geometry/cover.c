#include "geometry/cover.h"

#include <math.h>
#include <string.h>

/* Fragments that wait for the facets still to come; what does not fit is not cut any further. */
#define WAITING_MAX 40u
/* A fragment that no prism holds is halved so often at most. */
#define HALVINGS 6u
/* Corners of what may still be cut: should rounding make it not quite convex, each second edge crosses the cut. */
#define CUT_MAX (STRL_FRAGMENT_MAX * 2 / 3)
/* Of the triangle's size: what sticks out of a prism by no more is not cut off. */
#define SLIVER 1e-9

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void subtract(const double a[3], const double b[3], double out[3])
{
    for (unsigned k = 0; k < 3; k++)
        out[k] = a[k] - b[k];
}

static void cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

void strl_facet_set(strl_facet *facet, const double a[3], const double b[3], const double c[3])
{
    for (unsigned k = 0; k < 3; k++) {
        facet->corner[0][k] = a[k], facet->corner[1][k] = b[k], facet->corner[2][k] = c[k];
        double least = a[k] < b[k] ? a[k] : b[k], most = a[k] < b[k] ? b[k] : a[k];
        facet->least[k] = c[k] < least ? c[k] : least;
        facet->most[k] = c[k] > most ? c[k] : most;
    }
}

static double segment_distance2(const double p[3], const double a[3], const double b[3])
{
    double ab[3], ap[3], rest[3];
    subtract(b, a, ab);
    subtract(p, a, ap);
    double length2 = dot(ab, ab), along = length2 > 0 ? dot(ap, ab) / length2 : 0;
    along = along < 0 ? 0 : along > 1 ? 1 : along;
    for (unsigned k = 0; k < 3; k++)
        rest[k] = ap[k] - along * ab[k];
    return dot(rest, rest);
}

/* Inside of all three edges the plane counts, else the nearest edge that the point is outside of. */
double strl_facet_distance2(const strl_facet *facet, const double p[3])
{
    double ab[3], ac[3], n[3], ap[3], best = INFINITY;
    subtract(facet->corner[1], facet->corner[0], ab);
    subtract(facet->corner[2], facet->corner[0], ac);
    cross(ab, ac, n);
    double size2 = dot(n, n);
    subtract(p, facet->corner[0], ap);
    double acp = 0, abp = 0, side[3];
    cross(ab, ap, side);
    abp = dot(side, n);
    cross(ap, ac, side);
    acp = dot(side, n);
    if (size2 > 0 && abp >= 0 && acp >= 0 && abp + acp <= size2) {
        double height = dot(ap, n);
        return height * height / size2;
    }
    bool flat = !(size2 > 0);
    if (flat || abp <= 0)
        best = segment_distance2(p, facet->corner[0], facet->corner[1]);
    if (flat || acp <= 0)
        best = fmin(best, segment_distance2(p, facet->corner[0], facet->corner[2]));
    if (flat || abp + acp >= size2)
        best = fmin(best, segment_distance2(p, facet->corner[1], facet->corner[2]));
    return best;
}

typedef struct work {
    const strl_cover *cover;
    const strl_facet *triangle;
    double normal[3]; /* unit */
    double sliver;    /* length */
    double bound;
    strl_fragment waiting[WAITING_MAX];
    uint32_t waiting_count;
} work;

/* The side planes of the prism over a facet: inside is where inward . (x - corner) is not below `least`. */
typedef struct prism {
    const strl_facet *facet;
    double inward[3][3];
    double least[3]; /* what counts as inside: minus the sliver, in the measure of each plane */
} prism;

static double fragment_distance(const strl_fragment *fragment, const strl_facet *facet)
{
    double most = 0;
    for (uint32_t i = 0; i < fragment->count; i++) {
        double squared = strl_facet_distance2(facet, fragment->corner[i]);
        most = squared > most ? squared : most;
    }
    return sqrt(most) + facet->claim;
}

static void give(work *w, uint32_t to, const strl_fragment *fragment, double bound)
{
    w->bound = bound > w->bound ? bound : w->bound;
    if (w->cover->take)
        w->cover->take(w->cover->context, to, fragment);
}

/* Cuts where side changes its sign: what is not below zero into `in`, the rest into `out`. */
static void cut(const strl_fragment *fragment, const double *side, strl_fragment *in, strl_fragment *out)
{
    uint32_t n = fragment->count;
    in->count = out->count = 0;
    for (uint32_t i = 0; i < n; i++) {
        uint32_t j = i + 1 == n ? 0 : i + 1;
        strl_fragment *own = side[i] >= 0 ? in : out;
        memcpy(own->corner[own->count++], fragment->corner[i], sizeof fragment->corner[i]);
        if ((side[i] >= 0) == (side[j] >= 0))
            continue;
        double along = side[i] / (side[i] - side[j]), at[3];
        for (unsigned k = 0; k < 3; k++)
            at[k] = fragment->corner[i][k] + along * (fragment->corner[j][k] - fragment->corner[i][k]);
        memcpy(in->corner[in->count++], at, sizeof at);
        memcpy(out->corner[out->count++], at, sizeof at);
    }
}

static bool make_prism(const work *w, const strl_facet *facet, prism *p)
{
    double ab[3], ac[3], n[3];
    subtract(facet->corner[1], facet->corner[0], ab);
    subtract(facet->corner[2], facet->corner[0], ac);
    cross(ab, ac, n);
    double facing = dot(n, w->normal), sign = facing < 0 ? -1 : 1;
    p->facet = facet;
    if (fabs(facing) <= w->sliver * w->sliver)
        return false;
    for (unsigned e = 0; e < 3; e++) {
        double edge[3];
        subtract(facet->corner[e == 2 ? 0 : e + 1], facet->corner[e], edge);
        cross(w->normal, edge, p->inward[e]);
        for (unsigned k = 0; k < 3; k++)
            p->inward[e][k] *= sign;
        p->least[e] = -w->sliver * sqrt(dot(p->inward[e], p->inward[e]));
    }
    return true;
}

/* How many of the corners are inside of an edge, and how many are outside by more than a sliver. */
static void classify(const prism *p, unsigned e, const strl_fragment *fragment, double *side, bool *none_in, bool *none_out)
{
    *none_in = *none_out = true;
    for (uint32_t i = 0; i < fragment->count; i++) {
        double from[3];
        subtract(fragment->corner[i], p->facet->corner[e], from);
        side[i] = dot(p->inward[e], from);
        *none_in &= side[i] <= -p->least[e];
        *none_out &= side[i] >= p->least[e];
    }
}

/* The part within the prism, into *inside; what is cut off goes to the end of the waiting ones. False where nothing is within, or
 * no room is left: then nothing was cut. */
static bool cut_by_prism(work *w, const prism *p, const strl_fragment *fragment, strl_fragment *inside)
{
    double side[STRL_FRAGMENT_MAX];
    bool none_in, crosses[3];
    for (unsigned e = 0; e < 3; e++) {
        classify(p, e, fragment, side, &none_in, &crosses[e]);
        if (none_in)
            return false;
    }
    *inside = *fragment;
    uint32_t waiting = w->waiting_count;
    for (unsigned e = 0; e < 3; e++) {
        bool none_out = crosses[e];
        if (none_out)
            continue;
        classify(p, e, inside, side, &none_in, &none_out);
        if (none_out)
            continue;
        if (none_in || inside->count > CUT_MAX || w->waiting_count == WAITING_MAX) {
            w->waiting_count = waiting;
            return false;
        }
        strl_fragment in;
        cut(inside, side, &in, &w->waiting[w->waiting_count++]);
        *inside = in;
    }
    return true;
}

static bool is_near(const work *w, const strl_facet *facet)
{
    double near = w->cover->near;
    for (unsigned k = 0; k < 3; k++)
        if (facet->least[k] > w->triangle->most[k] + near || facet->most[k] < w->triangle->least[k] - near)
            return false;
    return true;
}

static void cut_along(work *w, uint32_t to)
{
    prism p;
    const strl_facet *facet = &w->cover->by[to];
    if (!is_near(w, facet) || !make_prism(w, facet, &p))
        return;
    for (uint32_t i = w->waiting_count; i-- > 0;) {
        strl_fragment inside;
        if (!cut_by_prism(w, &p, &w->waiting[i], &inside))
            continue;
        w->waiting[i] = w->waiting[--w->waiting_count];
        give(w, to, &inside, fragment_distance(&inside, facet));
    }
}

static uint32_t nearest_of(const work *w, const strl_fragment *fragment)
{
    double middle[3] = {0}, least = INFINITY;
    uint32_t best = 0;
    for (uint32_t i = 0; i < fragment->count; i++)
        for (unsigned k = 0; k < 3; k++)
            middle[k] += fragment->corner[i][k] / fragment->count;
    for (uint32_t i = 0; i < w->cover->count; i++) {
        double distance = sqrt(strl_facet_distance2(&w->cover->by[i], middle)) + w->cover->by[i].claim;
        if (distance < least) {
            least = distance;
            best = i;
        }
    }
    return best;
}

/* Sides of the plane in the middle between the two corners that are farthest apart. */
static bool halve(const strl_fragment *fragment, double *side)
{
    double longest = 0, along[3] = {0}, way[3];
    uint32_t from = 0;
    for (uint32_t i = 0; i < fragment->count; i++)
        for (uint32_t j = i + 1; j < fragment->count; j++) {
            subtract(fragment->corner[j], fragment->corner[i], way);
            if (dot(way, way) > longest) {
                longest = dot(way, way);
                memcpy(along, way, sizeof along);
                from = i;
            }
        }
    if (!(longest > 0) || fragment->count > CUT_MAX)
        return false;
    for (uint32_t i = 0; i < fragment->count; i++) {
        subtract(fragment->corner[i], fragment->corner[from], way);
        side[i] = dot(way, along) - longest / 2;
    }
    return true;
}

static void give_to_nearest(work *w, const strl_fragment *fragment, unsigned halvings)
{
    uint32_t to = nearest_of(w, fragment);
    double bound = fragment_distance(fragment, &w->cover->by[to]), side[STRL_FRAGMENT_MAX];
    if (bound <= w->cover->enough || bound <= w->bound || halvings == 0 || !halve(fragment, side)) {
        give(w, to, fragment, bound);
        return;
    }
    strl_fragment halves[2];
    cut(fragment, side, &halves[0], &halves[1]);
    give_to_nearest(w, &halves[0], halvings - 1);
    give_to_nearest(w, &halves[1], halvings - 1);
}

double strl_cover_bound(const strl_facet *triangle, const strl_cover *cover)
{
    work w;
    double ab[3], ac[3], size = 0;
    if (cover->count == 0)
        return INFINITY;
    w.cover = cover;
    w.triangle = triangle;
    w.bound = 0;
    w.waiting_count = 1;
    w.waiting[0].count = 3;
    memcpy(w.waiting[0].corner, triangle->corner, sizeof triangle->corner);
    for (unsigned k = 0; k < 3; k++)
        size = fmax(size, triangle->most[k] - triangle->least[k]);
    w.sliver = SLIVER * size;
    subtract(triangle->corner[1], triangle->corner[0], ab);
    subtract(triangle->corner[2], triangle->corner[0], ac);
    cross(ab, ac, w.normal);
    double length = sqrt(dot(w.normal, w.normal));
    for (unsigned k = 0; k < 3; k++)
        w.normal[k] /= length;
    for (uint32_t i = 0; i < cover->count && w.waiting_count && length > 0; i++)
        cut_along(&w, i);
    for (uint32_t i = 0; i < w.waiting_count; i++)
        give_to_nearest(&w, &w.waiting[i], HALVINGS);
    return w.bound;
}
