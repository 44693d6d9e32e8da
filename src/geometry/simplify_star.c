#include "geometry/simplify_star.h"

#include <math.h>

/* Larger than any difference of attributes. */
#define OTHER_PALETTE 1e6f

/* Counts the triangles at each neighbour; an odd count makes the edge a boundary edge. */
static void count_uses(simplifier *s, strl_star *star)
{
    star->neighbour_count = 0;
    uint32_t base = s->tick; /* stamp[p] = base + 1 + index of p among the neighbours */
    for (uint32_t i = 0; i < star->count; i++)
        for (int side = 0; side < 2; side++) {
            uint32_t p = side ? star->previous[i] : star->next[i];
            if (s->stamp[p] <= base) {
                star->neighbour[star->neighbour_count] = p;
                star->uses[star->neighbour_count++] = 0;
                s->stamp[p] = base + star->neighbour_count;
            }
            star->uses[s->stamp[p] - base - 1]++;
        }
    s->tick = base + star->neighbour_count + 1;
    star->on_boundary = false;
    for (uint32_t i = 0; i < star->neighbour_count; i++)
        star->on_boundary |= star->uses[i] & 1;
}

/* Chains the triangles into one fan, if they are one. Stamps still name the neighbours (count_uses). */
static void order_fan(const simplifier *s, strl_star *star)
{
    uint8_t by_next[2 * STAR_MAX]; /* triangle whose `next` is the neighbour; STAR_MAX = none */
    uint32_t base = s->tick - star->neighbour_count - 1, start = 0, open_ends = 0;
    star->manifold = false;
    star->closed = false;
    for (uint32_t i = 0; i < star->neighbour_count; i++) {
        if (star->uses[i] > 2)
            return;
        by_next[i] = STAR_MAX;
    }
    for (uint32_t i = 0; i < star->count; i++) {
        uint8_t *slot = &by_next[s->stamp[star->next[i]] - base - 1];
        if (*slot != STAR_MAX)
            return; /* two triangles leave the same neighbour: not oriented alike */
        *slot = (uint8_t)i;
    }
    uint8_t follower[STAR_MAX];
    bool followed[STAR_MAX] = {false};
    for (uint32_t i = 0; i < star->count; i++) {
        follower[i] = by_next[s->stamp[star->previous[i]] - base - 1];
        if (follower[i] != STAR_MAX)
            followed[follower[i]] = true;
    }
    for (uint32_t i = 0; i < star->count; i++)
        if (!followed[i]) {
            start = i;
            open_ends++;
        }
    if (open_ends > 1)
        return;
    uint32_t at = start, done = 0;
    do {
        star->order[done++] = (uint8_t)at;
        at = follower[at];
    } while (at != STAR_MAX && at != start && done < star->count);
    if (done != star->count)
        return;
    star->closed = at == start;
    star->manifold = star->closed ? star->count >= 3 : true;
}

bool strl__star_gather(simplifier *s, uint32_t point, strl_star *star)
{
    star->point = point;
    star->count = 0;
    uint32_t before = NO_INDEX;
    for (uint32_t corner = s->head[point], next; corner != NO_INDEX; corner = next) {
        next = s->corner_next[corner];
        if (s->dead[corner / 3]) {
            if (before == NO_INDEX)
                s->head[point] = next;
            else
                s->corner_next[before] = next;
            if (next == NO_INDEX)
                s->tail[point] = before;
            continue;
        }
        before = corner;
        if (star->count == STAR_MAX)
            return false;
        unsigned c = corner % 3;
        star->triangle[star->count] = corner / 3;
        star->corner[star->count] = (uint8_t)c;
        star->next[star->count] = strl__corner_point(s, corner / 3, c == 2 ? 0 : c + 1);
        star->previous[star->count] = strl__corner_point(s, corner / 3, c == 0 ? 2 : c - 1);
        star->count++;
    }
    count_uses(s, star);
    order_fan(s, star);
    return true;
}

unsigned strl__star_uses(const strl_star *star, uint32_t point)
{
    for (uint32_t i = 0; i < star->neighbour_count; i++)
        if (star->neighbour[i] == point)
            return star->uses[i];
    return 0;
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

uint32_t strl__wedge_target(const simplifier *s, const strl_star *u_star, uint32_t to, uint32_t wedge, bool *exact)
{
    uint32_t only = s->only_wedge[to];
    if (only != NO_INDEX && s->only_wedge[u_star->point] != NO_INDEX &&
        s->mesh->wedge[only].palette == s->mesh->wedge[wedge].palette && strl__star_uses(u_star, to)) {
        *exact = true;
        return only;
    }
    for (uint32_t i = 0; i < u_star->count; i++) {
        const uint32_t *corner = s->corner[u_star->triangle[i]];
        unsigned c = u_star->corner[i];
        if (corner[c] != wedge)
            continue;
        for (unsigned k = 1; k < 3; k++) {
            uint32_t other = corner[(c + k) % 3];
            if (s->mesh->wedge[other].point == to && s->mesh->wedge[other].palette == s->mesh->wedge[wedge].palette) {
                *exact = true;
                return other;
            }
        }
    }
    *exact = false;
    uint32_t best = NO_INDEX;
    float least = INFINITY;
    for (uint32_t corner = s->head[to]; corner != NO_INDEX; corner = s->corner_next[corner]) {
        uint32_t other = s->corner[corner / 3][corner % 3];
        if (s->dead[corner / 3])
            continue;
        float difference = attribute_difference(s, wedge, other);
        if (s->mesh->wedge[other].palette != s->mesh->wedge[wedge].palette) {
            if (s->rung < STRL_SIMPLIFY_DISJOINT)
                continue;
            difference += OTHER_PALETTE; /* only where v has none of its own part */
        }
        if (difference < least || (difference == least && other < best)) {
            least = difference;
            best = other;
        }
    }
    return best;
}
