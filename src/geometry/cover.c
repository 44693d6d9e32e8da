#include "geometry/cover.h"

#include <math.h>
#include <string.h>

/* Fragments that wait for the facets still to come; what does not fit is not cut any further. */
#define WAITING_MAX 32u
/* A triangle near more facets than this is halved first, so often at most, and while that leaves at most such a share
 * of them. */
#define PROGRESS 0.75
#define CROWD 16u
#define HALVINGS 9u
/* Fragments of so many times the limit are tried as they are. */
#define SMALL 3
/* Facets that are looked at before anything is cut. */
#define LIKELY 6u
/* So many fragments are cut again for being too far from what is nearest to their middles. */
#define CUTS_MAX 200u
/* No bound is improved below what it must be by so much. */
#define GAP 0.05
/* Corners of what may still be cut: should rounding make it not quite convex, each second edge crosses the cut. */
#define CUT_MAX (STRL_FRAGMENT_MAX * 2 / 3)
/* Squared sine: thinner triangles count as their edges, because doubles cannot tell where their insides are. */
#define FLAT 0x1p-32
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

void strl_facet_normal(const strl_facet *facet, double normal[3])
{
    double ab[3], ac[3];
    subtract(facet->corner[1], facet->corner[0], ab);
    subtract(facet->corner[2], facet->corner[0], ac);
    cross(ab, ac, normal);
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
    bool flat = size2 <= FLAT * dot(ab, ab) * dot(ac, ac);
    if (!flat && abp >= 0 && acp >= 0 && abp + acp <= size2) {
        double height = dot(ap, n);
        return height * height / size2;
    }
    if (flat || abp <= 0)
        best = segment_distance2(p, facet->corner[0], facet->corner[1]);
    if (flat || acp <= 0)
        best = fmin(best, segment_distance2(p, facet->corner[0], facet->corner[2]));
    if (flat || abp + acp >= size2)
        best = fmin(best, segment_distance2(p, facet->corner[1], facet->corner[2]));
    return best;
}

void strl_facet_middle(const strl_facet *facet, double middle[3])
{
    for (unsigned k = 0; k < 3; k++)
        middle[k] = (facet->corner[0][k] + facet->corner[1][k] + facet->corner[2][k]) / 3;
}

bool strl_facet_is_near(const strl_facet *facet, const strl_facet *other, double reach, double *distance)
{
    double most = 0;
    for (unsigned c = 0; c < 3 && most <= reach * reach; c++)
        most = fmax(most, strl_facet_distance2(facet, other->corner[c]));
    if (!(reach >= 0 && most <= reach * reach))
        return false;
    *distance = sqrt(most);
    return true;
}

typedef struct work {
    const strl_cover *cover;
    double along[3];
    double bound;
    double limit;  /* a bound so large is good enough */
    unsigned cuts; /* that settle may still make */
    strl_fragment waiting[WAITING_MAX];
    uint32_t waiting_count;
    uint32_t order[STRL_COVER_MAX]; /* of the facets: those that matter now come first */
} work;

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

void strl_prism_set(strl_prism *prism, const strl_facet *facet, const double along[3])
{
    double normal[3], size = 0;
    strl_facet_normal(facet, normal);
    double facing = dot(normal, along), sign = facing < 0 ? -1 : 1;
    prism->is_flat = facing * facing <= FLAT * dot(normal, normal) * dot(along, along);
    for (unsigned k = 0; k < 3; k++)
        size = fmax(size, facet->most[k] - facet->least[k]);
    for (unsigned e = 0; e < 3; e++) {
        double edge[3];
        subtract(facet->corner[e == 2 ? 0 : e + 1], facet->corner[e], edge);
        cross(along, edge, prism->inward[e]);
        for (unsigned k = 0; k < 3; k++)
            prism->inward[e][k] *= sign;
        prism->offset[e] = dot(prism->inward[e], facet->corner[e]);
        prism->slack[e] = SLIVER * size * sqrt(dot(prism->inward[e], prism->inward[e]));
    }
}

/* The prism over a facet; NULL where it has no inside. */
static const strl_prism *prism_of(const work *w, uint32_t facet, strl_prism *own)
{
    const strl_prism *prism = w->cover->prisms ? &w->cover->prisms[facet] : own;
    if (!w->cover->prisms)
        strl_prism_set(own, &w->cover->by[facet], w->along);
    return prism->is_flat ? NULL : prism;
}

/* Where the corners are to one side of a prism, and whether none is inside, or none outside, by more than the slack. */
static void classify(const strl_prism *p, unsigned e, const strl_fragment *fragment, double *side, bool *none_in,
                     bool *none_out)
{
    double least = INFINITY, most = -INFINITY;
    for (uint32_t i = 0; i < fragment->count; i++) {
        side[i] = dot(p->inward[e], fragment->corner[i]) - p->offset[e];
        least = side[i] < least ? side[i] : least;
        most = side[i] > most ? side[i] : most;
    }
    *none_in = most <= p->slack[e];
    *none_out = least >= -p->slack[e];
}

/* The part within the prism, into *inside; what is cut off goes to the end of the waiting ones. False where nothing is
 * within, or no room is left: then nothing was cut. */
static bool cut_by_prism(work *w, const strl_prism *p, const strl_fragment *fragment, strl_fragment *inside)
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

static void cut_along(work *w, uint32_t to)
{
    strl_prism own;
    const strl_facet *facet = &w->cover->by[to];
    const strl_prism *prism = prism_of(w, to, &own);
    if (!prism)
        return;
    for (uint32_t i = w->waiting_count; i-- > 0;) {
        strl_fragment inside;
        uint32_t waiting = w->waiting_count;
        if (!cut_by_prism(w, prism, &w->waiting[i], &inside))
            continue;
        double bound = fragment_distance(&inside, facet);
        if (bound > w->limit) { /* another sheet, or a fold: something nearer may hold it */
            w->waiting_count = waiting;
            continue;
        }
        w->waiting[i] = w->waiting[--w->waiting_count];
        give(w, to, &inside, bound);
    }
}

static void middle_of(const strl_fragment *fragment, double middle[3])
{
    middle[0] = middle[1] = middle[2] = 0;
    for (uint32_t i = 0; i < fragment->count; i++)
        for (unsigned k = 0; k < 3; k++)
            middle[k] += fragment->corner[i][k] / fragment->count;
}

/* The facet nearest to a point, of the first `count`. */
static uint32_t nearest_of(const work *w, const double p[3], uint32_t count, double *nearest)
{
    uint32_t best = w->order[0];
    *nearest = INFINITY;
    for (uint32_t i = 0; i < count; i++) {
        const strl_facet *facet = &w->cover->by[w->order[i]];
        double distance = sqrt(strl_facet_distance2(facet, p)) + facet->claim;
        if (distance < *nearest) {
            *nearest = distance;
            best = w->order[i];
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

/* One fragment by what is nearest to its middle: given away where that is near enough, else cut along that prism, else
 * halved. The middle's own distance cannot be bettered, so nothing much less is aimed at. */
static void settle(work *w, uint32_t near)
{
    strl_fragment fragment = w->waiting[--w->waiting_count], inside;
    double nearest, side[STRL_FRAGMENT_MAX], middle[3];
    middle_of(&fragment, middle);
    uint32_t to = nearest_of(w, middle, near, &nearest);
    if (nearest > w->limit && near < w->cover->count)
        to = nearest_of(w, middle, w->cover->count, &nearest);
    const strl_facet *facet = &w->cover->by[to];
    double bound = fragment_distance(&fragment, facet);
    strl_prism own;
    w->limit = fmax(w->limit, nearest * (1 + GAP));
    if (bound <= w->limit || w->cuts == 0 || w->waiting_count + 5 > WAITING_MAX) {
        give(w, to, &fragment, bound);
        return;
    }
    w->cuts--;
    uint32_t waiting = w->waiting_count;
    const strl_prism *prism = prism_of(w, to, &own);
    if (prism && cut_by_prism(w, prism, &fragment, &inside) && w->waiting_count > waiting) {
        w->waiting[w->waiting_count++] = inside;
        return;
    }
    if (!halve(&fragment, side)) {
        give(w, to, &fragment, bound);
        return;
    }
    cut(&fragment, side, &w->waiting[waiting], &w->waiting[waiting + 1]);
    w->waiting_count = waiting + 2;
}

/* Moves the facets whose boxes are within the limit of the fragment's to the front of the first `count`; how many they
 * are. */
static uint32_t find_near(work *w, const strl_fragment *fragment, uint32_t count)
{
    double least[3] = {INFINITY, INFINITY, INFINITY}, most[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (uint32_t i = 0; i < fragment->count; i++)
        for (unsigned k = 0; k < 3; k++) {
            least[k] = fragment->corner[i][k] < least[k] ? fragment->corner[i][k] : least[k];
            most[k] = fragment->corner[i][k] > most[k] ? fragment->corner[i][k] : most[k];
        }
    uint32_t near = 0;
    for (uint32_t i = 0; i < count; i++) {
        uint32_t at = w->order[i];
        const strl_facet *f = &w->cover->by[at];
        double reach = w->limit - f->claim;
        bool meets = true;
        for (unsigned k = 0; k < 3; k++)
            meets &= f->least[k] <= most[k] + reach && f->most[k] >= least[k] - reach;
        if (!meets)
            continue;
        w->order[i] = w->order[near];
        w->order[near++] = at;
    }
    return near;
}

/* Whether one facet is near enough to all corners, and so to all of the fragment. */
static bool is_within(const strl_fragment *fragment, const strl_facet *facet, double limit, double *bound)
{
    double reach = limit - facet->claim, most = 0;
    if (reach < 0)
        return false;
    for (uint32_t i = 0; i < fragment->count && most <= reach * reach; i++)
        most = fmax(most, strl_facet_distance2(facet, fragment->corner[i]));
    *bound = sqrt(most) + facet->claim;
    return most <= reach * reach;
}

/* Whether any facet will do for a small fragment as it is. */
static bool is_given_at_once(work *w, const strl_fragment *fragment, uint32_t near)
{
    double bound, size2 = 0, way[3];
    for (uint32_t i = 1; i < fragment->count; i++) {
        subtract(fragment->corner[i], fragment->corner[0], way);
        size2 = fmax(size2, dot(way, way));
    }
    if (size2 > SMALL * SMALL * w->limit * w->limit)
        return false;
    for (uint32_t i = 0; i < near; i++)
        if (is_within(fragment, &w->cover->by[w->order[i]], w->limit, &bound)) {
            give(w, w->order[i], fragment, bound);
            return true;
        }
    return false;
}

static void place(work *w, const strl_fragment *fragment, uint32_t count, unsigned halvings)
{
    double side[STRL_FRAGMENT_MAX];
    uint32_t near = find_near(w, fragment, count);
    if (is_given_at_once(w, fragment, near))
        return;
    bool helps = halvings == HALVINGS || near <= count * PROGRESS;
    if (near > CROWD && halvings > 0 && helps && halve(fragment, side)) {
        strl_fragment halves[2];
        cut(fragment, side, &halves[0], &halves[1]);
        place(w, &halves[0], near, halvings - 1);
        place(w, &halves[1], near, halvings - 1);
        return;
    }
    w->waiting[0] = *fragment;
    w->waiting_count = 1;
    for (uint32_t i = 0; i < near && w->waiting_count; i++)
        cut_along(w, w->order[i]);
    while (w->waiting_count)
        settle(w, near);
}

/* The first few facets are likely. */
static bool is_settled_at_once(work *w, const strl_fragment *whole)
{
    const strl_cover *cover = w->cover;
    double bound;
    for (uint32_t i = 0; i < cover->count && i < LIKELY; i++) {
        uint32_t at = cover->pick ? cover->pick[i] : i;
        if (is_within(whole, &cover->by[at], cover->enough, &bound)) {
            give(w, at, whole, bound);
            return true;
        }
    }
    return false;
}

double strl_cover_bound(const strl_facet *triangle, const strl_cover *cover)
{
    work w;
    strl_fragment whole;
    whole.count = 3;
    if (cover->count == 0)
        return INFINITY;
    memcpy(whole.corner, triangle->corner, sizeof triangle->corner);
    w.cover = cover;
    w.bound = 0;
    w.limit = cover->enough;
    w.cuts = CUTS_MAX;
    if (is_settled_at_once(&w, &whole))
        return w.bound;
    for (uint32_t i = 0; i < cover->count; i++)
        w.order[i] = cover->pick ? cover->pick[i] : i;
    if (cover->along)
        memcpy(w.along, cover->along, sizeof w.along);
    else
        strl_facet_normal(triangle, w.along);
    place(&w, &whole, cover->count, HALVINGS);
    return w.bound;
}
