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
    s->tick = base + star->neighbour_count;
    star->on_boundary = false;
    for (uint32_t i = 0; i < star->neighbour_count; i++)
        star->on_boundary |= star->uses[i] & 1;
}

/* Chains the triangles into one fan, if they are one. */
static void order_fan(strl_star *star)
{
    star->manifold = false;
    star->closed = false;
    uint32_t start = 0, open_ends = 0;
    for (uint32_t i = 0; i < star->count; i++) {
        bool follows = false;
        for (uint32_t k = 0; k < star->count; k++)
            follows |= star->previous[k] == star->next[i];
        if (!follows) {
            start = i;
            open_ends++;
        }
    }
    if (open_ends > 1)
        return;
    for (uint32_t i = 0; i < star->neighbour_count; i++)
        if (star->uses[i] > 2)
            return;
    uint32_t at = start, done = 0;
    for (;;) {
        star->order[done++] = (uint8_t)at;
        if (done == star->count)
            break;
        uint32_t next = NO_INDEX;
        for (uint32_t k = 0; k < star->count; k++)
            if (star->next[k] == star->previous[at])
                next = k;
        if (next == NO_INDEX || next == start)
            return;
        at = next;
    }
    star->closed = star->previous[at] == star->next[start];
    star->manifold = star->closed ? star->count >= 3 : open_ends == 1;
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
    order_fan(star);
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

uint32_t strl__wedge_target(const simplifier *s, const strl_star *u_star, const strl_star *v_star, uint32_t to, uint32_t wedge,
                            bool *exact)
{
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
    for (uint32_t i = 0; v_star && i < v_star->count; i++) {
        uint32_t other = s->corner[v_star->triangle[i]][v_star->corner[i]];
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
