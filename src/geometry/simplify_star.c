#include "geometry/simplify_star.h"

#include <math.h>
#include <string.h>

/* Larger than any difference of attributes. */
#define OTHER_PALETTE 1e6f

/* Attributes that differ by more are not merged where no triangle says that they go on into each other: a normal by 44
 * degrees, or a third of black to white. */
#define UNLIKE 0.3f

/* Then a wedge goes with its triangles where they reach so many times the way that it goes: what falls onto a wedge
 * that looks otherwise shows as far as they reach. Where they are as small as the way, the error covers that, and each
 * wedge costs bytes. */
#define CARRY_REACH 4.0

/* Stamps for `count` neighbours, and one more; all begin anew where numbers end. */
static uint32_t take_stamps(simplifier *s, uint32_t count)
{
    if (s->tick > UINT32_MAX - count - 1) {
        for (uint32_t p = 0; p < s->mesh->point_count; p++)
            s->sites[p].stamp = 0;
        s->tick = 0;
    }
    uint32_t first = s->tick;
    s->tick += count + 1;
    return first;
}

static void count_use(simplifier *s, strl_star *star, uint32_t point)
{
    uint32_t *stamp = &s->sites[point].stamp;
    if (*stamp <= star->stamp) {
        star->neighbour[star->neighbour_count] = point;
        star->uses[star->neighbour_count++] = 0;
        *stamp = star->stamp + star->neighbour_count;
    }
    star->uses[*stamp - star->stamp - 1]++;
}

/* Counts the triangles at each neighbour; an odd count makes the edge a boundary edge. */
static void count_uses(simplifier *s, strl_star *star)
{
    star->neighbour_count = 0;
    star->stamp = take_stamps(s, 2 * STAR_MAX);
    for (uint32_t i = 0; i < star->count; i++) {
        count_use(s, star, star->next[i]);
        count_use(s, star, star->previous[i]);
    }
    star->on_boundary = false;
    for (uint32_t i = 0; i < star->neighbour_count; i++)
        star->on_boundary |= star->uses[i] & 1;
}

static uint32_t find_point(const uint32_t *points, uint32_t count, uint32_t point)
{
    uint32_t i = 0;
    while (i < count && points[i] != point)
        i++;
    return i;
}

/* Chains the triangles into one fan, if they are one: order[i + 1] follows order[i] counter-clockwise. */
static bool order_fan(strl_star *star, uint8_t *order)
{
    uint32_t count = star->count, done = 1, at = find_point(star->next, count, star->previous[0]);
    order[0] = 0;
    for (; at != 0 && at < count && done < count; at = find_point(star->next, count, star->previous[at]))
        order[done++] = (uint8_t)at;
    star->closed = at == 0;
    if (star->closed)
        return done == count && count >= 3;
    if (at < count)
        return false; /* it goes round, but not back to the first */
    uint8_t before[STAR_MAX];
    uint32_t more = 0;
    for (at = 0; (at = find_point(star->previous, count, star->next[at])) < count && done + more < count;)
        before[more++] = (uint8_t)at;
    if (at < count || done + more < count)
        return false;
    memmove(order + more, order, done);
    for (uint32_t i = 0; i < more; i++)
        order[more - 1 - i] = before[i];
    return true;
}

/* Lists the ring's points as neighbours, in fan order. False where one comes twice: then it is no fan. */
static bool list_ring(simplifier *s, strl_star *star, const uint8_t *order)
{
    uint32_t n = star->closed ? star->count : star->count + 1;
    star->stamp = take_stamps(s, n);
    star->neighbour_count = n;
    star->on_boundary = !star->closed;
    for (uint32_t i = 0; i < n; i++) {
        uint32_t p = i < star->count ? star->next[order[i]] : star->previous[order[i - 1]];
        if (s->sites[p].stamp > star->stamp)
            return false;
        s->sites[p].stamp = star->stamp + 1 + i;
        star->neighbour[i] = p;
        star->uses[i] = 2;
    }
    if (!star->closed)
        star->uses[0] = star->uses[n - 1] = 1;
    return true;
}

/* Axes with the last one along the normal of the ring's polygon. */
static bool find_axes(strl_fan *fan)
{
    double n[3] = {0, 0, 0};
    uint32_t last = fan->n - 1; /* an open ring is closed by a straight edge */
    double closing[3] = {fan->x[1][last] * fan->x[2][0] - fan->x[2][last] * fan->x[1][0],
                         fan->x[2][last] * fan->x[0][0] - fan->x[0][last] * fan->x[2][0],
                         fan->x[0][last] * fan->x[1][0] - fan->x[1][last] * fan->x[0][0]};
    for (unsigned k = 0; k < 3; k++) {
        for (uint32_t i = 0; i < last; i++)
            n[k] += fan->cross[k][i];
        n[k] += closing[k];
    }
    double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    if (!(length > 0))
        return false;
    double *w = fan->axis[2], *p = fan->axis[0], *q = fan->axis[1];
    for (unsigned k = 0; k < 3; k++)
        w[k] = n[k] / length;
    unsigned least = fabs(n[0]) < fabs(n[1]) ? (fabs(n[0]) < fabs(n[2]) ? 0 : 2) : (fabs(n[1]) < fabs(n[2]) ? 1 : 2);
    unsigned next = (least + 1) % 3, third = (least + 2) % 3; /* p = w times the axis that is furthest from it */
    double scale = 1 / sqrt(w[next] * w[next] + w[third] * w[third]);
    p[least] = 0;
    p[next] = w[third] * scale;
    p[third] = -w[next] * scale;
    q[0] = w[1] * p[2] - w[2] * p[1];
    q[1] = w[2] * p[0] - w[0] * p[2];
    q[2] = w[0] * p[1] - w[1] * p[0];
    return true;
}

/* Stores a ring's second round. */
static inline void repeat(double *values, uint32_t n)
{
    if (n <= LANES) {
        double ring[LANES];
        memcpy(ring, values, sizeof ring);
        memcpy(values + n, ring, sizeof ring);
    } else
        memcpy(values + n, values, n * sizeof *values);
}

static void flatten(const simplifier *s, strl_star *star, const uint8_t *order)
{
    strl_fan *fan = &star->fan;
    uint32_t n = fan->n = star->neighbour_count, lanes = strl__lanes(n);
    const double *u = s->sites[star->point].position;
    for (uint32_t i = 0; i < n; i++) {
        const double *p = s->sites[star->neighbour[i]].position;
        fan->triangle[i] = fan->triangle[n + i] = i < star->count ? order[i] : 0;
        for (unsigned k = 0; k < 3; k++)
            fan->x[k][i] = p[k] - u[k];
    }
    for (unsigned k = 0; k < 3; k++)
        repeat(fan->x[k], n);
    for (uint32_t i = 0; i < lanes; i++) {
        fan->cross[0][i] = fan->x[1][i] * fan->x[2][i + 1] - fan->x[2][i] * fan->x[1][i + 1];
        fan->cross[1][i] = fan->x[2][i] * fan->x[0][i + 1] - fan->x[0][i] * fan->x[2][i + 1];
        fan->cross[2][i] = fan->x[0][i] * fan->x[1][i + 1] - fan->x[1][i] * fan->x[0][i + 1];
    }
    for (unsigned k = 0; k < 3; k++)
        repeat(fan->cross[k], n);
    fan->has_axes = find_axes(fan);
    for (unsigned k = 0; k < 3 && fan->has_axes; k++) {
        for (uint32_t i = 0; i < lanes; i++)
            fan->flat[k][i] =
                fan->x[0][i] * fan->axis[k][0] + fan->x[1][i] * fan->axis[k][1] + fan->x[2][i] * fan->axis[k][2];
        repeat(fan->flat[k], n);
    }
}

static void list_wedges(const simplifier *s, strl_star *star)
{
    uint32_t only = s->sites[star->point].only_wedge, count = 0;
    for (uint32_t i = 0; i < star->count && only == NO_INDEX; i++) {
        uint32_t wedge = s->corner[star->triangle[i]][star->corner[i]];
        star->wedge[count] = wedge;
        count += find_point(star->wedge, count, wedge) == count;
    }
    if (only != NO_INDEX && star->count > 0)
        star->wedge[count++] = only;
    star->wedge_count = count;
}

bool strl__star_gather(simplifier *s, uint32_t point, strl_star *star)
{
    site *own = &s->sites[point];
    uint32_t before = NO_INDEX, count = 0;
    star->point = point;
    for (uint32_t corner = own->head, next; corner != NO_INDEX; corner = next) {
        const face *f = &s->faces[corner >> 2];
        unsigned c = corner & 3;
        next = f->next[c];
        if (f->gone) {
            if (before == NO_INDEX)
                own->head = next;
            else
                s->faces[before >> 2].next[before & 3] = next;
            if (next == NO_INDEX)
                own->tail = before;
            continue;
        }
        before = corner;
        if (count == STAR_MAX)
            return false;
        star->triangle[count] = corner >> 2;
        star->corner[count] = (uint8_t)c;
        star->next[count] = f->point[c == 2 ? 0 : c + 1];
        star->previous[count++] = f->point[c == 0 ? 2 : c - 1];
    }
    star->count = count;
    list_wedges(s, star);
    uint8_t order[STAR_MAX];
    star->manifold = count > 0 && order_fan(star, order) && list_ring(s, star, order);
    if (star->manifold)
        flatten(s, star, order);
    else
        count_uses(s, star);
    return true;
}

static float attribute_difference(const simplifier *s, uint32_t a, uint32_t b)
{
    float normal = 0, colour = 0;
    for (int i = 0; i < 3; i++) {
        float dn = s->normal[a][i] - s->normal[b][i], dc = s->colour[a][i] - s->colour[b][i];
        normal += dn * dn;
        colour += dc * dc;
    }
    return s->desc->normal_weight * sqrtf(normal) + s->desc->colour_weight * sqrtf(colour);
}

/* The wedge of v in a triangle that has this wedge of u and the edge; NO_INDEX = none. */
static uint32_t wedge_beside(const simplifier *s, const strl_star *u_star, uint32_t to, uint32_t wedge)
{
    for (uint32_t i = 0; i < u_star->count; i++) {
        const uint32_t *corner = s->corner[u_star->triangle[i]];
        unsigned c = u_star->corner[i];
        if (corner[c] != wedge)
            continue;
        for (unsigned k = 1; k < 3; k++) {
            uint32_t other = corner[(c + k) % 3];
            if (s->wedge[other].point == to && s->wedge[other].palette == s->wedge[wedge].palette)
                return other;
        }
    }
    return NO_INDEX;
}

/* How far from v the triangles that stay with this wedge of u reach, where their corner comes to lie. */
static double squared_reach(const simplifier *s, const strl_star *u_star, uint32_t to, uint32_t wedge)
{
    double most = 0;
    const double *v = s->sites[to].position;
    for (uint32_t i = 0; i < u_star->count; i++) {
        if (s->corner[u_star->triangle[i]][u_star->corner[i]] != wedge || u_star->next[i] == to ||
            u_star->previous[i] == to)
            continue;
        double next = strl__distance2(s->sites[u_star->next[i]].position, v);
        double previous = strl__distance2(s->sites[u_star->previous[i]].position, v);
        most = fmax(most, fmax(next, previous));
    }
    return most;
}

/* Whether the wedge shall go with its point although its like is not at v. */
static bool is_carried(const simplifier *s, const strl_star *u_star, uint32_t to, uint32_t wedge)
{
    double way = strl__distance2(s->sites[u_star->point].position, s->sites[to].position);
    return s->wedge_count + u_star->wedge_count <= s->wedge_room &&
           squared_reach(s, u_star, to, wedge) > CARRY_REACH * CARRY_REACH * way;
}

uint32_t strl__wedge_target(const simplifier *s, const strl_star *u_star, uint32_t to, uint32_t wedge, wedge_fate *fate)
{
    const site *u = &s->sites[u_star->point], *v = &s->sites[to];
    *fate = WEDGE_EXACT;
    if (u->only_wedge != NO_INDEX && v->only_wedge != NO_INDEX && u->palette == v->palette &&
        strl__star_uses(s, u_star, to))
        return v->only_wedge;
    uint32_t best = wedge_beside(s, u_star, to, wedge);
    if (best != NO_INDEX)
        return best;
    float least = INFINITY;
    uint32_t scanned = 0;
    for (uint32_t corner = s->sites[to].head, next; corner != NO_INDEX && scanned < SCAN_MAX; corner = next) {
        uint32_t other = s->corner[corner >> 2][corner & 3];
        next = s->faces[corner >> 2].next[corner & 3];
        if (s->faces[corner >> 2].gone)
            continue;
        scanned++;
        float difference = attribute_difference(s, wedge, other);
        if (s->wedge[other].palette != s->wedge[wedge].palette) {
            if (s->rung < STRL_SIMPLIFY_DISJOINT)
                continue;
            difference += OTHER_PALETTE; /* only where v has none of its own part */
        }
        if (difference < least || (difference == least && other < best)) {
            least = difference;
            best = other;
        }
    }
    *fate = best != NO_INDEX && least > UNLIKE && is_carried(s, u_star, to, wedge) ? WEDGE_CARRIED : WEDGE_LIKE;
    return best;
}
