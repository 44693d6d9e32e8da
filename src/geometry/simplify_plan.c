/* Choosing where a point would go and what that would cost. */
#include "geometry/simplify_plan.h"

#include <math.h>

#define RIM_WEIGHT 2.f
#define SPOKE_WEIGHT 0.45f /* of a normal's change along a spoke: a dent in the shading as long as the spoke */

/* The second target in quadric order is planned too where its quadric is not so many times worse. */
#define SECOND_CHOICE 1.5

void strl__quadric_add(quadric *to, const quadric *other)
{
    to->xx += other->xx, to->xy += other->xy, to->xz += other->xz, to->yy += other->yy, to->yz += other->yz;
    to->zz += other->zz, to->x += other->x, to->y += other->y, to->z += other->z, to->c += other->c;
}

void strl__quadric_add_plane(quadric *q, const double n[3], const double on[3], double weight)
{
    double d = -(n[0] * on[0] + n[1] * on[1] + n[2] * on[2]);
    quadric plane = {n[0] * n[0] * weight, n[0] * n[1] * weight, n[0] * n[2] * weight, n[1] * n[1] * weight,
                     n[1] * n[2] * weight, n[2] * n[2] * weight, n[0] * d * weight,    n[1] * d * weight,
                     n[2] * d * weight,    d * d * weight};
    strl__quadric_add(q, &plane);
}

static void cross_of(const double o[3], const double a[3], const double b[3], double out[3])
{
    double ax = a[0] - o[0], ay = a[1] - o[1], az = a[2] - o[2];
    double bx = b[0] - o[0], by = b[1] - o[1], bz = b[2] - o[2];
    out[0] = ay * bz - az * by;
    out[1] = az * bx - ax * bz;
    out[2] = ax * by - ay * bx;
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* From twice the area's vector before to that after: by more than about 75 degrees, or to a line. */
static inline bool turns(const double before[3], const double after[3])
{
    double along = dot(before, after);
    return !(along > 0) | (along * along < 0.0625 * dot(before, before) * dot(after, after));
}

static bool fan_keeps_orientation(const strl_fan *fan, uint32_t v_at, uint32_t first, uint32_t end)
{
    double v[3] = {fan->x[0][v_at], fan->x[1][v_at], fan->x[2][v_at]};
    unsigned turned = 0;
    for (uint32_t i = v_at + first; i < v_at + end; i++) {
        double before[3] = {fan->cross[0][i], fan->cross[1][i], fan->cross[2][i]}, edge[3], after[3];
        for (unsigned k = 0; k < 3; k++)
            edge[k] = fan->x[k][i] - fan->x[k][i + 1];
        after[0] = before[0] + v[1] * edge[2] - v[2] * edge[1];
        after[1] = before[1] + v[2] * edge[0] - v[0] * edge[2];
        after[2] = before[2] + v[0] * edge[1] - v[1] * edge[0];
        turned |= turns(before, after);
    }
    return !turned;
}

/* No triangle that stays may turn over. */
static bool keeps_orientation(const simplifier *s, const strl_star *star, uint32_t to)
{
    if (star->manifold) {
        uint32_t n = star->fan.n, v_at = strl__neighbour_at(s, star, to);
        if (star->closed)
            return fan_keeps_orientation(&star->fan, v_at, 1, n - 1);
        return v_at == 0 || v_at == n - 1 ? fan_keeps_orientation(&star->fan, v_at, 1, n - 1) : false;
    }
    for (uint32_t i = 0; i < star->count; i++) {
        if (star->next[i] == to || star->previous[i] == to)
            continue;
        const double *a = s->sites[star->next[i]].position, *b = s->sites[star->previous[i]].position;
        double before[3], after[3];
        cross_of(s->sites[star->point].position, a, b, before);
        cross_of(s->sites[to].position, a, b, after);
        if (turns(before, after))
            return false;
    }
    return true;
}

/* The link condition: u and v share exactly the neighbours that the triangles of their edge name. The star's stamps
 * must be in force. */
static bool link_is_disk(const simplifier *s, const strl_star *star, uint32_t to)
{
    uint64_t seen[2] = {0, 0}; /* of 2 * STAR_MAX neighbours */
    for (uint32_t corner = s->sites[to].head, next; corner != NO_INDEX; corner = next) {
        const face *f = &s->faces[corner >> 2];
        unsigned c = corner & 3;
        next = f->next[c];
        if (f->gone)
            continue;
        for (unsigned k = 1; k < 3; k++) {
            uint32_t at = strl__neighbour_at(s, star, f->point[(c + k) % 3]);
            if (at != NO_INDEX)
                seen[at / 64] |= UINT64_C(1) << at % 64;
        }
    }
    return (unsigned)__builtin_popcountll(seen[0]) + (unsigned)__builtin_popcountll(seen[1]) ==
           strl__star_uses(s, star, to);
}

bool strl__leaves_surface_at(const simplifier *s, const strl_star *star, uint32_t to)
{
    if (strl__star_uses(s, star, to) < star->count)
        return true;
    for (uint32_t corner = s->sites[to].head, next; corner != NO_INDEX; corner = next) {
        const face *f = &s->faces[corner >> 2];
        next = f->next[corner & 3];
        if (!f->gone && f->point[0] != star->point && f->point[1] != star->point && f->point[2] != star->point)
            return true;
    }
    return false;
}

/* Every wedge of u needs a wedge of v to fall onto; on the first rung, each its own. */
static bool wedges_can_follow(const simplifier *s, const strl_star *u_star, uint32_t to)
{
    uint32_t targets[STAR_MAX];
    const site *u = &s->sites[u_star->point], *v = &s->sites[to];
    if (u->only_wedge != NO_INDEX && v->only_wedge != NO_INDEX && u->palette == v->palette)
        return true;
    for (uint32_t i = 0; i < u_star->wedge_count; i++) {
        wedge_fate fate;
        uint32_t target = strl__wedge_target(s, u_star, to, u_star->wedge[i], &fate);
        if (target == NO_INDEX || (fate != WEDGE_EXACT && s->rung < STRL_SIMPLIFY_SEAMS))
            return false;
        for (uint32_t k = 0; k < i && s->rung < STRL_SIMPLIFY_SEAMS; k++)
            if (targets[k] == target)
                return false; /* two wedges would become one: the seam ends here */
        targets[i] = target;
    }
    return true;
}

bool strl__may_collapse(const simplifier *s, const strl_star *star, uint32_t to)
{
    unsigned uses = strl__star_uses(s, star, to);
    const site *u = &s->sites[star->point], *v = &s->sites[to];
    if (strl__crowds(s, star, to))
        return false;
    if ((v->flags & STRL_POINT_OUTSIDE) && (u->holders & ~v->holders))
        return false; /* a node that outsiders do not know would come to share this point with them */
    if (star->on_boundary && !(uses & 1))
        return false; /* the rim collapses along itself only: an open edge then always ends at rim points of the input
                       */
    if (s->rung < STRL_SIMPLIFY_SEAMS && !star->manifold)
        return false;
    return wedges_can_follow(s, star, to) && keeps_orientation(s, star, to) && strl__leaves_surface_at(s, star, to) &&
           (s->rung >= STRL_SIMPLIFY_SEAMS || link_is_disk(s, star, to));
}

/* What one wedge of u looks like and what the new patch shows in its place. */
static float wedge_change(const simplifier *s, uint32_t wedge, const float *normal, const float *colour)
{
    float dn = 0, dc = 0;
    for (unsigned k = 0; k < 3; k++)
        dn += (s->normal[wedge][k] - normal[k]) * (s->normal[wedge][k] - normal[k]);
    for (unsigned k = 0; k < 3 && s->has_colours; k++)
        dc = strl__larger(dc, fabsf(s->colour[wedge][k] - colour[k]));
    return s->desc->normal_weight * sqrtf(dn) + s->desc->colour_weight * dc;
}

/* How far the attributes of u's wedges are from what the new patch shows in their place. */
static float attribute_change(const simplifier *s, const strl_star *star, uint32_t to, const collapse_effect *effect)
{
    float worst = 0, mixed_normal[3] = {0}, mixed_colour[3] = {0};
    uint32_t own = NO_INDEX;
    wedge_fate fate;
    if (effect->image != NO_INDEX) {
        const uint32_t *corner = s->corner[star->triangle[effect->image]];
        unsigned c = star->corner[effect->image];
        own = corner[c];
        uint32_t corners[3] = {strl__wedge_target(s, star, to, own, &fate), corner[(c + 1) % 3], corner[(c + 2) % 3]};
        corners[0] = fate == WEDGE_CARRIED ? own : corners[0];
        if (corners[0] == NO_INDEX)
            own = NO_INDEX;
        for (unsigned k = 0; k < 3 && own != NO_INDEX; k++)
            for (unsigned i = 0; i < 3; i++) {
                mixed_normal[i] += (float)effect->weights[k] * s->normal[corners[k]][i];
                mixed_colour[i] += (float)effect->weights[k] * s->colour[corners[k]][i];
            }
        float length = sqrtf(mixed_normal[0] * mixed_normal[0] + mixed_normal[1] * mixed_normal[1] +
                             mixed_normal[2] * mixed_normal[2]);
        for (unsigned i = 0; i < 3 && length > 0; i++)
            mixed_normal[i] /= length;
    }
    for (uint32_t i = 0; i < star->wedge_count; i++) {
        uint32_t wedge = star->wedge[i];
        if (wedge == own) {
            worst = strl__larger(worst, wedge_change(s, wedge, mixed_normal, mixed_colour));
            continue;
        }
        uint32_t target = strl__wedge_target(s, star, to, wedge, &fate);
        if (target == NO_INDEX)
            return s->desc->normal_weight + s->desc->colour_weight;
        if (fate == WEDGE_CARRIED)
            continue;
        worst = strl__larger(worst, wedge_change(s, wedge, s->normal[target], s->colour[target]));
    }
    return worst;
}

void strl__plan_collapse(const simplifier *s, const strl_star *star, uint32_t to, collapse_plan *plan,
                         collapse_effect *effect)
{
    strl__collapse_effect(s, star, to, effect);
    float deviation = effect->all.of[REACH_DEVIATION], change = attribute_change(s, star, to, effect);
    const double *u = s->sites[star->point].position, *v = s->sites[to].position;
    double longest = 0;
    for (unsigned i = 0; i < 3; i++)
        longest += (u[i] - v[i]) * (u[i] - v[i]);
    change = strl__larger(change, s->desc->colour_weight * effect->spoke_colour);
    plan->to = to;
    plan->geometric = strl_mesh_error(s->mesh, effect->longest) * STRL_ROUND_UP;
    plan->deviation = sqrtf(deviation * deviation + change * change);
    float way = strl__larger((float)sqrt(longest), effect->spoke_colour > 0 ? effect->spoke_reach : 0);
    plan->shift = strl__larger(effect->all.of[REACH_SHIFT], way * fminf(1, plan->deviation));
    plan->shift = strl__larger(plan->shift, SPOKE_WEIGHT * effect->spoke_reach * fminf(1, effect->spoke_normal));
    if (star->on_boundary) /* two rims that meet in the image can both draw back: each may have half */
        plan->shift = strl__larger(plan->shift, RIM_WEIGHT * effect->longest);
    if (s->mesh->most_error > 0 && plan->shift > s->mesh->most_error)
        plan->shift = s->mesh->most_error;
    plan->key = strl__larger(plan->geometric, plan->shift);
}

static void list_costs(const simplifier *s, const strl_star *star, double *cost)
{
    const quadric *q = &s->quadrics[star->point];
    const double *u = s->sites[star->point].position;
    for (uint32_t i = 0; i < star->neighbour_count; i++) {
        const site *v = &s->sites[star->neighbour[i]];
        double length = 0;
        for (unsigned k = 0; k < 3; k++)
            length += (u[k] - v->position[k]) * (u[k] - v->position[k]);
        /* flat regions: the nearest */
        cost[i] = strl__quadric_at(q, v->position) + v->own_cost + 1e-4 * length * length;
    }
}

/* On the first rung a manifold fan's wedges follow along one edge, which has two sides. */
static bool can_stay_manifold(const strl_star *star)
{
    return star->manifold && star->wedge_count <= 2;
}

bool strl__plan_best(simplifier *s, uint32_t point, collapse_plan *plan)
{
    const strl_star *star = &s->star;
    double cost[2 * STAR_MAX], first_cost = 0;
    unsigned found = 0;
    if (!strl__star_gather(s, point, &s->star) || star->count == 0)
        return false;
    if (s->rung < STRL_SIMPLIFY_SEAMS && !can_stay_manifold(star))
        return false;
    list_costs(s, star, cost);
    for (uint32_t tried = 0; tried < star->neighbour_count && found < 2; tried++) {
        uint32_t least = 0;
        for (uint32_t i = 1; i < star->neighbour_count; i++)
            least = cost[i] < cost[least] ? i : least;
        if (found && cost[least] > SECOND_CHOICE * first_cost)
            break;
        if (found == 0)
            first_cost = cost[least];
        cost[least] = INFINITY;
        uint32_t to = star->neighbour[least];
        if (!strl__may_collapse(s, star, to))
            continue;
        collapse_plan other;
        collapse_effect *effect = found ? &s->other_effect : &s->effect;
        strl__plan_collapse(s, star, to, &other, effect);
        if (found++ == 0)
            *plan = other;
        else if (other.key < plan->key) {
            *plan = other;
            s->effect = s->other_effect;
        }
    }
    return found > 0;
}
