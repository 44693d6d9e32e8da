/* Choosing where a point would go and what that would cost. */
#include "geometry/simplify_plan.h"

#include <math.h>

#define RIM_WEIGHT 2.f
#define SPOKE_WEIGHT 0.45f /* of a normal's change along a spoke: a dent in the shading as long as the spoke */

/* The second target in quadric order is planned too where its quadric is not so many times worse. */
#define SECOND_CHOICE 1.5

double strl__quadric_at(const quadric *q, const double p[3])
{
    double value = q->xx * p[0] * p[0] + q->yy * p[1] * p[1] + q->zz * p[2] * p[2] +
                   2 * (q->xy * p[0] * p[1] + q->xz * p[0] * p[2] + q->yz * p[1] * p[2]) +
                   2 * (q->x * p[0] + q->y * p[1] + q->z * p[2]) + q->c;
    return value > 0 ? value : 0;
}

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

/* No triangle that stays may turn by more than about 75 degrees or become a line. */
static bool keeps_orientation(const simplifier *s, const strl_star *star, uint32_t to)
{
    for (uint32_t i = 0; i < star->count; i++) {
        if (star->next[i] == to || star->previous[i] == to)
            continue;
        const double *a = s->position[star->next[i]], *b = s->position[star->previous[i]];
        double before[3], after[3];
        cross_of(s->position[star->point], a, b, before);
        cross_of(s->position[to], a, b, after);
        double along = dot(before, after);
        if (!(along > 0) || along * along < 0.0625 * dot(before, before) * dot(after, after))
            return false;
    }
    return true;
}

/* The link condition: u and v share exactly the neighbours that the triangles of their edge name. */
static bool link_is_disk(simplifier *s, const strl_star *star, uint32_t to)
{
    uint32_t base = s->tick;
    for (uint32_t i = 0; i < star->neighbour_count; i++)
        s->stamp[star->neighbour[i]] = base + 1;
    unsigned common = 0;
    for (uint32_t corner = s->head[to]; corner != NO_INDEX; corner = s->corner_next[corner]) {
        if (s->dead[corner / 3])
            continue;
        for (unsigned k = 1; k < 3; k++) {
            uint32_t p = strl__corner_point(s, corner / 3, (corner % 3 + k) % 3);
            if (s->stamp[p] == base + 1) {
                s->stamp[p] = base + 2;
                common++;
            }
        }
    }
    s->tick = base + 2;
    return common == strl__star_uses(star, to);
}

bool strl__leaves_surface_at(const simplifier *s, const strl_star *star, uint32_t to)
{
    for (uint32_t i = 0; i < star->count; i++)
        if (star->next[i] != to && star->previous[i] != to)
            return true;
    for (uint32_t corner = s->head[to]; corner != NO_INDEX; corner = s->corner_next[corner]) {
        if (s->dead[corner / 3])
            continue;
        bool has_u = false;
        for (unsigned c = 0; c < 3; c++)
            has_u |= strl__corner_point(s, corner / 3, c) == star->point;
        if (!has_u)
            return true;
    }
    return false;
}

/* Every wedge of u needs a wedge of v to fall onto; on the first rung, each its own. */
static bool wedges_can_follow(simplifier *s, const strl_star *u_star, uint32_t to)
{
    uint32_t seen[STAR_MAX], targets[STAR_MAX], count = 0;
    uint32_t only = s->only_wedge[u_star->point];
    if (only != NO_INDEX && s->only_wedge[to] != NO_INDEX &&
        s->mesh->wedge[only].palette == s->mesh->wedge[s->only_wedge[to]].palette)
        return true;
    for (uint32_t i = 0; i < u_star->count; i++) {
        uint32_t wedge = s->corner[u_star->triangle[i]][u_star->corner[i]];
        bool known = false, exact;
        for (uint32_t k = 0; k < count; k++)
            known |= seen[k] == wedge;
        if (known)
            continue;
        uint32_t target = strl__wedge_target(s, u_star, to, wedge, &exact);
        if (target == NO_INDEX || (!exact && s->rung < STRL_SIMPLIFY_SEAMS))
            return false;
        for (uint32_t k = 0; k < count && s->rung < STRL_SIMPLIFY_SEAMS; k++)
            if (targets[k] == target)
                return false; /* two wedges would become one: the seam ends here */
        seen[count] = wedge;
        targets[count++] = target;
    }
    return true;
}

bool strl__may_collapse(simplifier *s, const strl_star *star, uint32_t to)
{
    unsigned uses = strl__star_uses(star, to);
    if (strl__crowds(s, star, to))
        return false;
    if (s->holders && (s->mesh->flags[to] & STRL_POINT_OUTSIDE) && (s->holders[star->point] & ~s->holders[to]))
        return false; /* a node that outsiders do not know would come to share this point with them */
    if (star->on_boundary && !(uses & 1))
        return false; /* the rim collapses along itself only: an open edge then always ends at rim points of the input */
    if (s->rung < STRL_SIMPLIFY_SEAMS && !star->manifold)
        return false;
    return wedges_can_follow(s, star, to) && keeps_orientation(s, star, to) && strl__leaves_surface_at(s, star, to) &&
           (s->rung >= STRL_SIMPLIFY_SEAMS || link_is_disk(s, star, to));
}

/* How far the attributes of u's wedges are from what the new patch shows in their place. */
static float attribute_change(const simplifier *s, const strl_star *star, uint32_t to, uint32_t image, const double weights[3])
{
    float worst = 0, mixed_normal[3] = {0}, mixed_colour[3] = {0};
    uint32_t own = NO_INDEX;
    if (image != NO_INDEX) {
        const uint32_t *corner = s->corner[star->triangle[image]];
        unsigned c = star->corner[image];
        bool exact;
        own = corner[c];
        uint32_t v_wedge = strl__wedge_target(s, star, to, own, &exact);
        uint32_t corners[3] = {v_wedge, corner[(c + 1) % 3], corner[(c + 2) % 3]};
        if (v_wedge == NO_INDEX)
            own = NO_INDEX;
        else
            for (int k = 0; k < 3; k++)
                for (int i = 0; i < 3; i++) {
                    mixed_normal[i] += (float)weights[k] * s->normal[corners[k]][i];
                    mixed_colour[i] += (float)weights[k] * s->colour[corners[k]][i];
                }
        float length = sqrtf(mixed_normal[0] * mixed_normal[0] + mixed_normal[1] * mixed_normal[1] +
                             mixed_normal[2] * mixed_normal[2]);
        for (int i = 0; i < 3 && length > 0; i++)
            mixed_normal[i] /= length;
    }
    uint32_t wedges = s->only_wedge[star->point] != NO_INDEX ? 1 : star->count;
    for (uint32_t i = 0; i < wedges; i++) {
        uint32_t wedge = s->corner[star->triangle[i]][star->corner[i]];
        const float *normal = mixed_normal, *colour = mixed_colour;
        if (wedge != own) {
            bool exact;
            uint32_t target = strl__wedge_target(s, star, to, wedge, &exact);
            if (target == NO_INDEX)
                return s->desc->normal_weight + s->desc->colour_weight;
            normal = s->normal[target], colour = s->colour[target];
        }
        float dn = 0, dc = 0;
        for (int k = 0; k < 3; k++) {
            dn += (s->normal[wedge][k] - normal[k]) * (s->normal[wedge][k] - normal[k]);
            dc = strl__larger(dc, fabsf(s->colour[wedge][k] - colour[k]));
        }
        worst = strl__larger(worst, s->desc->normal_weight * sqrtf(dn) + s->desc->colour_weight * dc);
    }
    return worst;
}

void strl__plan_collapse(simplifier *s, const strl_star *star, uint32_t to, collapse_plan *plan)
{
    collapse_drift drift;
    strl__collapse_drift(s, star, to, &drift);
    float deviation = 0, shift = 0;
    double longest = 0;
    for (uint32_t i = 0; i < star->count; i++) {
        uint32_t t = star->triangle[i];
        deviation = strl__larger(deviation, s->deviation[t]);
        shift = strl__larger(shift, s->shift[t]);
    }
    const double *u = s->position[star->point], *v = s->position[to];
    for (int i = 0; i < 3; i++)
        longest += (u[i] - v[i]) * (u[i] - v[i]);
    float change = attribute_change(s, star, to, drift.image, drift.weights);
    spoke_change spokes;
    strl__spoke_change(s, star, to, &spokes);
    change = strl__larger(change, s->desc->colour_weight * spokes.colour);
    plan->to = to;
    plan->geometric = nextafterf(drift.longest + s->mesh->start_error, INFINITY);
    plan->deviation = sqrtf(deviation * deviation + change * change);
    float way = strl__larger((float)sqrt(longest), spokes.colour > 0 ? spokes.reach : 0);
    plan->shift = strl__larger(shift, way * fminf(1, plan->deviation));
    plan->shift = strl__larger(plan->shift, SPOKE_WEIGHT * spokes.reach * fminf(1, spokes.normal));
    if (star->on_boundary) /* two rims that meet in the image can both draw back: each may have half */
        plan->shift = strl__larger(plan->shift, RIM_WEIGHT * drift.longest);
    plan->key = strl__larger(plan->geometric, plan->shift);
}

bool strl__plan_best(simplifier *s, uint32_t point, collapse_plan *plan)
{
    strl_star star;
    if (!strl__star_gather(s, point, &star) || star.count == 0)
        return false;
    double cost[2 * STAR_MAX];
    uint8_t order[2 * STAR_MAX];
    for (uint32_t i = 0; i < star.neighbour_count; i++) {
        const double *u = s->position[point], *v = s->position[star.neighbour[i]];
        double length = 0;
        for (int k = 0; k < 3; k++)
            length += (u[k] - v[k]) * (u[k] - v[k]);
        cost[i] = strl__quadric_at(&s->quadrics[point], v) + s->own_cost[star.neighbour[i]] +
                  1e-4 * length * length; /* flat regions: the nearest */
        uint32_t at = i;
        for (; at > 0 && cost[order[at - 1]] > cost[i]; at--)
            order[at] = order[at - 1];
        order[at] = (uint8_t)i;
    }
    unsigned found = 0;
    double least = 0;
    for (uint32_t i = 0; i < star.neighbour_count && found < 2; i++) {
        if (found && cost[order[i]] > SECOND_CHOICE * least)
            break;
        uint32_t to = star.neighbour[order[i]];
        if (!strl__may_collapse(s, &star, to))
            continue;
        collapse_plan other;
        strl__plan_collapse(s, &star, to, &other);
        if (found++ == 0 || other.key < plan->key)
            *plan = other;
        if (found == 1)
            least = cost[order[i]];
    }
    return found > 0;
}
