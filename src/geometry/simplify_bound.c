/* The bound of one collapse (geometry/simplify.h says why it is one). All in double: lattice offsets of a node are below 2^31,
 * so products of two are exact to a relative 2^-52. */
#include <math.h>

#include "geometry/simplify_star.h"

/* A point of the patch, relative to v: two coordinates across the normal, one along it. */
typedef struct flat {
    double s, t, h;
} flat;

static double cross2(double as, double at, double bs, double bt)
{
    return as * bt - at * bs;
}

static double distance(const double a[3], const double b[3])
{
    double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return sqrt(x * x + y * y + z * z);
}

/* The closed polygon round u: x[0..count), where count = triangles for a closed fan, triangles + 1 for an open one. */
typedef struct polygon {
    uint32_t count;
    uint32_t v_at;               /* index of v in the polygon */
    flat x[STAR_MAX + 1];
    flat u;                      /* u, or its nearest point on the new boundary edge */
    double moved[3];             /* from u to that point; 0 for a closed fan */
    double normal[3];            /* unit */
} polygon;

static bool frame_of(const simplifier *s, const uint32_t *ring, uint32_t count, const double *v,
                     double axis[3][3])
{
    double n[3] = {0, 0, 0};
    for (uint32_t i = 0; i < count; i++) {
        const double *a = s->position[ring[i]], *b = s->position[ring[i + 1 == count ? 0 : i + 1]];
        double ax = a[0] - v[0], ay = a[1] - v[1], az = a[2] - v[2];
        double bx = b[0] - v[0], by = b[1] - v[1], bz = b[2] - v[2];
        n[0] += ay * bz - az * by;
        n[1] += az * bx - ax * bz;
        n[2] += ax * by - ay * bx;
    }
    double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    if (!(length > 0))
        return false;
    for (int i = 0; i < 3; i++)
        axis[2][i] = n[i] / length;
    int least = fabs(n[0]) < fabs(n[1]) ? (fabs(n[0]) < fabs(n[2]) ? 0 : 2) : (fabs(n[1]) < fabs(n[2]) ? 1 : 2);
    double e[3] = {0, 0, 0};
    e[least] = 1;
    const double *w = axis[2];
    double p[3] = {w[1] * e[2] - w[2] * e[1], w[2] * e[0] - w[0] * e[2], w[0] * e[1] - w[1] * e[0]};
    double scale = 1 / sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
    for (int i = 0; i < 3; i++)
        axis[0][i] = p[i] * scale;
    axis[1][0] = w[1] * axis[0][2] - w[2] * axis[0][1];
    axis[1][1] = w[2] * axis[0][0] - w[0] * axis[0][2];
    axis[1][2] = w[0] * axis[0][1] - w[1] * axis[0][0];
    return true;
}

static flat flatten(const double p[3], const double v[3], double axis[3][3])
{
    double d[3] = {p[0] - v[0], p[1] - v[1], p[2] - v[2]};
    return (flat){d[0] * axis[0][0] + d[1] * axis[0][1] + d[2] * axis[0][2],
                  d[0] * axis[1][0] + d[1] * axis[1][1] + d[2] * axis[1][2],
                  d[0] * axis[2][0] + d[1] * axis[2][1] + d[2] * axis[2][2]};
}

static bool build_patch(const simplifier *s, const strl_star *star, uint32_t to, polygon *patch)
{
    uint32_t ring[STAR_MAX + 1];
    uint32_t count = star->count;
    for (uint32_t i = 0; i < star->count; i++)
        ring[i] = star->next[star->order[i]];
    if (!star->closed)
        ring[count++] = star->previous[star->order[star->count - 1]];
    patch->count = count;
    patch->v_at = NO_INDEX;
    for (uint32_t i = 0; i < count; i++)
        if (ring[i] == to)
            patch->v_at = i;
    if (patch->v_at == NO_INDEX || (!star->closed && patch->v_at != 0 && patch->v_at != count - 1))
        return false;
    const double *v = s->position[to], *u = s->position[star->point];
    double axis[3][3], on_edge[3] = {u[0], u[1], u[2]};
    if (!frame_of(s, ring, count, v, axis))
        return false;
    for (int i = 0; i < 3; i++) {
        patch->moved[i] = 0;
        patch->normal[i] = axis[2][i];
    }
    if (!star->closed) { /* u slides to the new boundary edge first */
        const double *a = s->position[ring[patch->v_at == 0 ? count - 1 : 0]];
        double d[3] = {a[0] - v[0], a[1] - v[1], a[2] - v[2]};
        double along = ((u[0] - v[0]) * d[0] + (u[1] - v[1]) * d[1] + (u[2] - v[2]) * d[2]) /
                       (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        along = along < 0 ? 0 : along > 1 ? 1 : along;
        for (int i = 0; i < 3; i++) {
            on_edge[i] = v[i] + along * d[i];
            patch->moved[i] = on_edge[i] - u[i];
        }
    }
    for (uint32_t i = 0; i < count; i++)
        patch->x[i] = flatten(s->position[ring[i]], v, axis);
    patch->u = flatten(on_edge, v, axis);
    return true;
}

/* Both fans must be unfolded over the polygon: every triangle turns the same way, and the ring goes round u once. */
static bool is_height_field(const polygon *patch, bool closed)
{
    uint32_t last = closed ? patch->count : patch->count - 1;
    unsigned crossings = 0;
    for (uint32_t i = 0; i < last; i++) {
        const flat *a = &patch->x[i], *b = &patch->x[i + 1 == patch->count ? 0 : i + 1];
        double as = a->s - patch->u.s, at = a->t - patch->u.t, bs = b->s - patch->u.s, bt = b->t - patch->u.t;
        double old_area = cross2(as, at, bs, bt);
        bool touches_v = i == patch->v_at || (i + 1 == patch->count ? 0 : i + 1) == patch->v_at;
        if (closed ? old_area <= 0 : old_area < 0)
            return false;
        if (!touches_v && cross2(a->s, a->t, b->s, b->t) <= 0)
            return false;
        crossings += at < 0 && bt >= 0;
    }
    return !closed || crossings == 1;
}

/* How far the new surface lies above the old one, per new triangle (by fan index); 0 is always among the values, because the
 * patches agree on the rim. */
typedef struct gap_range {
    double least[STAR_MAX], most[STAR_MAX];
} gap_range;

static void note_gap(gap_range *gaps, uint32_t triangle, double gap)
{
    if (gap < gaps->least[triangle])
        gaps->least[triangle] = gap;
    if (gap > gaps->most[triangle])
        gaps->most[triangle] = gap;
}

/* On which side of each spoke v-x[j] u lies: > 0 = counter-clockwise of it. The spokes turn counter-clockwise round v from
 * the one after v in the ring, so the last one with u at its left begins the new triangle that holds u. Returns that triangle's
 * fan index; NO_INDEX where there is no new triangle. */
static uint32_t find_image(const polygon *patch, bool closed, double side[STAR_MAX + 1])
{
    uint32_t n = patch->count, image = NO_INDEX, triangles = closed ? n : n - 1;
    for (uint32_t step = 1; step + 1 < n; step++) {
        uint32_t j = patch->v_at + step < n ? patch->v_at + step : patch->v_at + step - n;
        const flat *d = &patch->x[j];
        side[j] = cross2(d->s, d->t, patch->u.s, patch->u.t);
        if (j < triangles && (side[j] >= 0 || image == NO_INDEX))
            image = j;
    }
    return image;
}

/* Notes the gap at u, in the new triangle (v, a, b) that holds it, with its weights there. */
static void note_gap_at_u(const polygon *patch, uint32_t image, gap_range *gaps, double weights[3])
{
    const flat *a = &patch->x[image], *b = &patch->x[image + 1 == patch->count ? 0 : image + 1], *u = &patch->u;
    double area = cross2(a->s, a->t, b->s, b->t);
    weights[1] = cross2(u->s, u->t, b->s, b->t) / area;
    weights[2] = cross2(a->s, a->t, u->s, u->t) / area;
    weights[0] = 1 - weights[1] - weights[2];
    note_gap(gaps, image, weights[1] * a->h + weights[2] * b->h - u->h);
}

/* Notes the gaps where old spokes u-x[i] cross new ones v-x[j], for the triangles on both sides of the new spoke. The spoke v-x[j]
 * divides the ring in two; the old spokes that cross it are those to the part in which u is not. */
static void note_gaps_at_crossings(const polygon *patch, const double *side, gap_range *gaps)
{
    uint32_t n = patch->count, v = patch->v_at;
    for (uint32_t step = 2; step + 2 <= n; step++) {
        uint32_t j = v + step < n ? v + step : v + step - n, before = j == 0 ? n - 1 : j - 1;
        const flat *d = &patch->x[j];
        double side_u = side[j], inverse = 1 / (d->s * d->s + d->t * d->t);
        uint32_t begin = side_u >= 0 ? 1 : step + 1, end = side_u >= 0 ? step : n;
        for (uint32_t k = begin; k < end; k++) {
            const flat *x = &patch->x[v + k < n ? v + k : v + k - n];
            double side_x = cross2(d->s, d->t, x->s, x->t), span = side_u - side_x;
            double along = span != 0 ? side_u / span : 0; /* on the old spoke, from u */
            double s = patch->u.s + along * (x->s - patch->u.s), t = patch->u.t + along * (x->t - patch->u.t);
            double on_new = (s * d->s + t * d->t) * inverse;
            double gap = on_new * d->h - (patch->u.h + along * (x->h - patch->u.h));
            note_gap(gaps, j, gap);
            note_gap(gaps, before, gap);
        }
    }
}

/* A triangle at v that is not in the star, with the edge to x if there is one. */
static uint32_t triangle_beside(const simplifier *s, const strl_star *star, uint32_t to, uint32_t x, bool *has_edge)
{
    uint32_t any = NO_INDEX;
    *has_edge = false;
    for (uint32_t corner = s->head[to]; corner != NO_INDEX; corner = s->corner_next[corner]) {
        uint32_t triangle = corner / 3;
        if (s->dead[triangle])
            continue;
        bool has_u = false, has_x = false;
        for (unsigned c = 0; c < 3; c++) {
            has_u |= strl__corner_point(s, triangle, c) == star->point;
            has_x |= strl__corner_point(s, triangle, c) == x;
        }
        if (has_u)
            continue;
        any = triangle;
        if (has_x) {
            *has_edge = true;
            return triangle;
        }
    }
    return any;
}

/* A vanishing triangle (u, v, x) falls onto the edge v-x. Where no triangle of the star keeps that edge, another one at v takes
 * its drift over; where none keeps the edge at all, its points are still within |v - x| of v, which the caller knows to stay.
 * Returns the longest such edge. */
static double find_receivers(const simplifier *s, const strl_star *star, uint32_t to, collapse_drift *result)
{
    double most = 0;
    result->receivers = 0;
    for (uint32_t i = 0; i < star->count; i++) {
        if (star->next[i] != to && star->previous[i] != to)
            continue;
        uint32_t x = star->next[i] == to ? star->previous[i] : star->next[i];
        bool kept = false, has_edge;
        for (uint32_t k = 0; k < star->count && !kept; k++)
            kept = star->next[k] != to && star->previous[k] != to && (star->next[k] == x || star->previous[k] == x);
        if (kept)
            continue;
        uint32_t receiver = triangle_beside(s, star, to, x, &has_edge);
        if (receiver != NO_INDEX)
            result->receiver[result->receivers++] = receiver;
        if (!has_edge)
            most = fmax(most, distance(s->position[to], s->position[x]));
    }
    return most;
}

static void unite(strl_drift *drift, const strl_drift *other)
{
    for (int k = 0; k < 3; k++) {
        drift->least[k] = other->least[k] < drift->least[k] ? other->least[k] : drift->least[k];
        drift->most[k] = other->most[k] > drift->most[k] ? other->most[k] : drift->most[k];
    }
}

/* Adds a move by t * way, t in [0, 1]; `more` in every direction. */
static void add_way(strl_drift *drift, const double way[3], double more)
{
    for (int k = 0; k < 3; k++) {
        drift->least[k] += (float)((way[k] < 0 ? way[k] : 0) - more);
        drift->most[k] += (float)((way[k] > 0 ? way[k] : 0) + more);
    }
}

/* Every point of the star goes towards v by a share of the way from u. */
static strl_drift drift_straight(const simplifier *s, const strl_star *star, uint32_t to, double lost)
{
    strl_drift all = {0};
    double way[3];
    for (int k = 0; k < 3; k++)
        way[k] = s->position[to][k] - s->position[star->point][k];
    for (uint32_t i = 0; i < star->count; i++)
        unite(&all, &s->drift[star->triangle[i]]);
    add_way(&all, way, lost);
    return all;
}

/* A new triangle overlaps the old triangles between v and itself on its side of u; the one that holds u may overlap all.
 * (An old triangle whose base lies beyond a new spoke has its apex, u, on this side of it, or both on the other.) */
static void drift_by_height(const simplifier *s, const strl_star *star, const polygon *patch, const gap_range *gaps,
                            uint32_t fan_image, strl_drift *drift)
{
    uint32_t n = star->count, first = star->closed ? patch->v_at : 0;
    uint32_t at_image = (fan_image + n - first) % n;
    strl_drift all = {0};
    for (int side = 0; side < 2; side++) {
        strl_drift sum = {0};
        for (uint32_t m = 0; m < n; m++) {
            uint32_t from_v = side ? n - 1 - m : m, old = star->order[(first + from_v) % n];
            unite(&sum, &s->drift[star->triangle[old]]);
            if (from_v == at_image)
                break;
            drift[old] = sum;
        }
        unite(&all, &sum);
    }
    drift[star->order[fan_image]] = all;
    for (uint32_t i = 0; i < n; i++) {
        double low[3], high[3];
        for (int k = 0; k < 3; k++) {
            low[k] = gaps->least[i] * patch->normal[k];
            high[k] = gaps->most[i] * patch->normal[k];
        }
        strl_drift *own = &drift[star->order[i]];
        add_way(own, patch->moved, 0);
        add_way(own, low, 0);
        add_way(own, high, 0);
    }
}

/* The patch as a height field; false where it is none. */
static bool drift_over_plane(const simplifier *s, const strl_star *star, uint32_t to, collapse_drift *result)
{
    polygon patch;
    gap_range gaps;
    if (!star->manifold || !build_patch(s, star, to, &patch) || !is_height_field(&patch, star->closed))
        return false;
    uint32_t last = star->closed ? patch.count : patch.count - 1;
    for (uint32_t i = 0; i < last; i++)
        gaps.least[i] = gaps.most[i] = 0;
    double side[STAR_MAX + 1];
    uint32_t fan_image = find_image(&patch, star->closed, side);
    if (fan_image == NO_INDEX)
        return false;
    note_gap_at_u(&patch, fan_image, &gaps, result->weights);
    note_gaps_at_crossings(&patch, side, &gaps);
    drift_by_height(s, star, &patch, &gaps, fan_image, result->of);
    result->image = star->order[fan_image];
    return true;
}

static float length_squared(const strl_drift *drift)
{
    float sum = 0;
    for (int k = 0; k < 3; k++) {
        float far = -drift->least[k] > drift->most[k] ? -drift->least[k] : drift->most[k];
        sum += far * far;
    }
    return sum;
}

void strl__collapse_drift(const simplifier *s, const strl_star *star, uint32_t to, collapse_drift *result)
{
    result->image = NO_INDEX;
    result->weights[0] = 1, result->weights[1] = result->weights[2] = 0;
    result->receivers = 0;
    bool over_plane = drift_over_plane(s, star, to, result);
    if (!over_plane) {
        double lost = find_receivers(s, star, to, result);
        strl_drift all = drift_straight(s, star, to, lost);
        for (uint32_t i = 0; i < star->count; i++)
            result->of[i] = all;
        result->orphan = all;
    }
    float longest = 0;
    for (uint32_t i = 0; i < star->count; i++)
        if (star->next[i] != to && star->previous[i] != to)
            longest = strl__larger(longest, length_squared(&result->of[i]));
    for (uint32_t i = 0; i < result->receivers; i++) {
        strl_drift both = result->orphan;
        unite(&both, &s->drift[result->receiver[i]]);
        longest = strl__larger(longest, length_squared(&both));
    }
    result->longest = sqrtf(longest) * (1 + 1e-6f); /* whatever the rounding, a bound */
}

/* The wedge of each point of the ring, as the star's triangles use it. */
static void list_ring_wedges(const simplifier *s, const strl_star *star, uint32_t *wedge)
{
    for (uint32_t i = 0; i < star->count; i++) {
        uint32_t t = star->order[i];
        wedge[i] = s->corner[star->triangle[t]][(star->corner[t] + 1) % 3];
    }
    uint32_t last = star->order[star->count - 1];
    wedge[star->count] = s->corner[star->triangle[last]][(star->corner[last] + 2) % 3];
}

static float colour_gap(const simplifier *s, uint32_t u, uint32_t x, double along, uint32_t v, uint32_t y, double on_new)
{
    float most = 0;
    for (int k = 0; k < 3; k++) {
        float before = s->colour[u][k] + (float)along * (s->colour[x][k] - s->colour[u][k]);
        float after = s->colour[v][k] + (float)on_new * (s->colour[y][k] - s->colour[v][k]);
        most = strl__larger(most, fabsf(before - after));
    }
    return most;
}

static float normal_gap(const simplifier *s, uint32_t u, uint32_t x, double along, uint32_t v, uint32_t y, double on_new)
{
    float sum = 0;
    for (int k = 0; k < 3; k++) {
        float before = s->normal[u][k] + (float)along * (s->normal[x][k] - s->normal[u][k]);
        float after = s->normal[v][k] + (float)on_new * (s->normal[y][k] - s->normal[v][k]);
        sum += (before - after) * (before - after);
    }
    return sum; /* squared */
}

/* Whether normals or colours differ anywhere in the star from those of one wedge of u. */
static void find_variation(const simplifier *s, const strl_star *star, uint32_t own, bool *colours, bool *normals)
{
    *colours = *normals = false;
    for (uint32_t i = 0; i < star->count; i++)
        for (unsigned c = 0; c < 3; c++) {
            uint32_t w = s->corner[star->triangle[i]][c];
            for (int k = 0; k < 3; k++) {
                *colours |= s->colour[w][k] != s->colour[own][k];
                *normals |= s->normal[w][k] != s->normal[own][k];
            }
        }
}

void strl__spoke_change(const simplifier *s, const strl_star *star, uint32_t to, spoke_change *change)
{
    polygon patch;
    uint32_t wedge[STAR_MAX + 1], own = s->corner[star->triangle[0]][star->corner[0]];
    bool exact, colours, normals;
    *change = (spoke_change){0};
    find_variation(s, star, own, &colours, &normals);
    normals = normals && s->only_wedge[star->point] != NO_INDEX; /* along a crease each side has its own */
    if (!colours && !normals)
        return;
    for (uint32_t i = 0; i < star->neighbour_count; i++)
        change->reach = strl__larger(change->reach, (float)distance(s->position[to], s->position[star->neighbour[i]]));
    uint32_t target = strl__wedge_target(s, star, to, own, &exact);
    if (!star->manifold || !build_patch(s, star, to, &patch) || target == NO_INDEX) {
        change->colour = colours ? 1 : 0;
        return;
    }
    list_ring_wedges(s, star, wedge);
    uint32_t n = patch.count, v = patch.v_at;
    float normal2 = 0;
    for (uint32_t step = 2; step + 2 <= n; step++) {
        uint32_t j = v + step < n ? v + step : v + step - n;
        const flat *d = &patch.x[j];
        double side_u = cross2(d->s, d->t, patch.u.s, patch.u.t), inverse = 1 / (d->s * d->s + d->t * d->t);
        for (uint32_t k = side_u >= 0 ? 1 : step + 1; k < (side_u >= 0 ? step : n); k++) {
            uint32_t i = v + k < n ? v + k : v + k - n;
            double side_x = cross2(d->s, d->t, patch.x[i].s, patch.x[i].t), span = side_u - side_x;
            double along = span != 0 ? side_u / span : 0;
            double x = patch.u.s + along * (patch.x[i].s - patch.u.s), y = patch.u.t + along * (patch.x[i].t - patch.u.t);
            double on_new = (x * d->s + y * d->t) * inverse;
            if (colours)
                change->colour = strl__larger(change->colour, colour_gap(s, own, wedge[i], along, target, wedge[j], on_new));
            if (normals)
                normal2 = strl__larger(normal2, normal_gap(s, own, wedge[i], along, target, wedge[j], on_new));
        }
    }
    change->normal = sqrtf(normal2);
}

void strl__receive_orphans(simplifier *s, const collapse_drift *drift)
{
    for (uint32_t i = 0; i < drift->receivers; i++)
        unite(&s->drift[drift->receiver[i]], &drift->orphan);
}
