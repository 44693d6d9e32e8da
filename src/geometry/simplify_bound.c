/* The bound of one collapse (geometry/simplify.h says why it is one). All in double: lattice offsets of a node are
 * below 2^31, so products of two are exact to a relative 2^-52. */
#include <math.h>
#include <string.h>

#include "geometry/simplify_star.h"

static double cross2(double as, double at, double bs, double bt)
{
    return as * bt - at * bs;
}

/* The fan as the collapse u -> v sees it, flat: point 0 is v and the origin, the others follow counter-clockwise.
 * Triangle m lies between the points m and m + 1 (the last one between the last point and v); an old one has its apex
 * in u, a new one in v. */
typedef struct view {
    const simplifier *s;
    const strl_star *star;
    uint32_t n;                                               /* points */
    uint32_t v_at;                                            /* in the fan */
    uint32_t first, end;                                      /* old triangles that there are */
    double s_of[RING_ROOM], t_of[RING_ROOM], h_of[RING_ROOM]; /* two coordinates across the normal, one along it */
    double us, ut, uh;                                        /* u, or its nearest point on the new boundary edge */
    double moved[3];                                          /* from u to that point; 0 for a closed fan */
    double side[RING_ROOM]; /* of u seen along the new spoke to each point: > 0 = at its left */
    uint32_t image;         /* the new triangle that holds u */
    /* per new triangle: how far the new surface lies above the old one; the patches agree on the rim */
    double least[RING_ROOM], most[RING_ROOM];
} view;

/* u slides to the new boundary edge first. */
static void slide_to_edge(view *w)
{
    const strl_fan *fan = &w->star->fan;
    uint32_t a = w->v_at == 0 ? w->n - 1 : 0, v = w->v_at;
    double d[3], along = 0, length2 = 0;
    for (unsigned k = 0; k < 3; k++) {
        d[k] = fan->x[k][a] - fan->x[k][v];
        along -= fan->x[k][v] * d[k];
        length2 += d[k] * d[k];
    }
    along = along / length2;
    along = along < 0 ? 0 : along > 1 ? 1 : along;
    for (unsigned k = 0; k < 3; k++)
        w->moved[k] = fan->x[k][v] + along * d[k];
    double flat[3];
    for (unsigned k = 0; k < 3; k++)
        flat[k] = w->moved[0] * fan->axis[k][0] + w->moved[1] * fan->axis[k][1] + w->moved[2] * fan->axis[k][2] -
                  fan->flat[k][v];
    w->us = flat[0], w->ut = flat[1], w->uh = flat[2];
}

/* False where v is no neighbour along which the fan can close. */
static bool look(const simplifier *s, const strl_star *star, uint32_t to, view *w)
{
    const strl_fan *fan = &star->fan;
    bool is_flat = star->manifold && fan->has_axes;
    uint32_t n = is_flat ? fan->n : 0, v = is_flat ? strl__neighbour_at(s, star, to) : NO_INDEX;
    w->s = s, w->star = star, w->n = n, w->v_at = v;
    w->first = star->closed || v == 0 ? 0 : 1;
    w->end = star->closed || v != 0 ? n : n - 1;
    w->us = w->ut = w->uh = 0;
    if (v == NO_INDEX || (!star->closed && v != 0 && v != n - 1))
        return false;
    for (uint32_t i = 0, lanes = strl__lanes(n + 1); i < lanes; i++) { /* point n is v again */
        w->s_of[i] = fan->flat[0][v + i] - fan->flat[0][v];
        w->t_of[i] = fan->flat[1][v + i] - fan->flat[1][v];
        w->h_of[i] = fan->flat[2][v + i] - fan->flat[2][v];
    }
    w->us = -fan->flat[0][v], w->ut = -fan->flat[1][v], w->uh = -fan->flat[2][v];
    for (unsigned k = 0; k < 3; k++)
        w->moved[k] = 0;
    if (!star->closed)
        slide_to_edge(w);
    for (uint32_t i = 0, lanes = strl__lanes(n); i < lanes; i++) {
        w->side[i] = cross2(w->s_of[i], w->t_of[i], w->us, w->ut);
        w->least[i] = w->most[i] = 0;
    }
    return true;
}

/* Both fans must be unfolded over the polygon: every triangle turns the same way, and the ring goes round u once. */
static bool is_height_field(const view *w)
{
    double above_u[RING_ROOM], old_area[RING_ROOM], new_area[RING_ROOM];
    unsigned crossings = 0, folded = 0;
    for (uint32_t m = 0, lanes = strl__lanes(w->n); m < lanes; m++) {
        double as = w->s_of[m] - w->us, at = w->t_of[m] - w->ut, bs = w->s_of[m + 1] - w->us,
               bt = w->t_of[m + 1] - w->ut;
        above_u[m] = at;
        old_area[m] = cross2(as, at, bs, bt);
        new_area[m] = cross2(w->s_of[m], w->t_of[m], w->s_of[m + 1], w->t_of[m + 1]);
    }
    above_u[w->n] = above_u[0];
    for (uint32_t m = w->first; m < w->end; m++) {
        folded |= w->star->closed ? old_area[m] <= 0 : old_area[m] < 0;
        crossings += above_u[m] < 0 && above_u[m + 1] >= 0;
    }
    for (uint32_t m = 1; m + 1 < w->n; m++)
        folded |= new_area[m] <= 0;
    return !folded && (!w->star->closed || crossings == 1);
}

/* The new spokes turn counter-clockwise round v, so the last one with u at its left begins the new triangle that holds
 * u. */
static void find_image(view *w)
{
    w->image = 1;
    for (uint32_t m = 1; m + 1 < w->n; m++)
        w->image = w->side[m] >= 0 ? m : w->image;
}

static void note_gap(view *w, uint32_t triangle, double gap)
{
    w->least[triangle] = gap < w->least[triangle] ? gap : w->least[triangle];
    w->most[triangle] = gap > w->most[triangle] ? gap : w->most[triangle];
}

/* Notes the gap at u, in the new triangle (v, a, b) that holds it, with its weights there. */
static void note_gap_at_u(view *w, double weights[3])
{
    uint32_t a = w->image, b = a + 1;
    double area = cross2(w->s_of[a], w->t_of[a], w->s_of[b], w->t_of[b]);
    weights[1] = cross2(w->us, w->ut, w->s_of[b], w->t_of[b]) / area;
    weights[2] = cross2(w->s_of[a], w->t_of[a], w->us, w->ut) / area;
    weights[0] = 1 - weights[1] - weights[2];
    note_gap(w, a, weights[1] * w->h_of[a] + weights[2] * w->h_of[b] - w->uh);
}

/* Attributes where the spokes u-x and v-y cross: those of the first less those of the second. */
static inline void spoke_difference(const float u[4], const float x[4], float along, const float v[4], const float y[4],
                                    float on_new, float difference[4])
{
    for (unsigned k = 0; k < 4; k++)
        difference[k] = u[k] + along * (x[k] - u[k]) - (v[k] + on_new * (y[k] - v[k]));
}

/* What is looked at along spokes. */
typedef struct watch {
    bool colours, normals;
    uint32_t own, target;         /* wedges of u and v */
    uint32_t wedge[2 * RING_MAX]; /* of the ring's points, in fan order */
    float normal_squared;
} watch;

static void watch_crossing(const view *w, watch *seen, uint32_t old, uint32_t new, double along, double on_new,
                           collapse_effect *effect)
{
    const simplifier *s = w->s;
    uint32_t x = seen->wedge[w->v_at + old], y = seen->wedge[w->v_at + new];
    float d[4];
    if (seen->normals) {
        spoke_difference(s->normal[seen->own], s->normal[x], (float)along, s->normal[seen->target], s->normal[y],
                         (float)on_new, d);
        seen->normal_squared = strl__larger(seen->normal_squared, d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    }
    if (seen->colours) {
        spoke_difference(s->colour[seen->own], s->colour[x], (float)along, s->colour[seen->target], s->colour[y],
                         (float)on_new, d);
        for (unsigned k = 0; k < 3; k++)
            effect->spoke_colour = strl__larger(effect->spoke_colour, fabsf(d[k]));
    }
}

/* Where old spokes u-x cross new ones v-y: the gaps, for the triangles on both sides of the new spoke, and the
 * attributes. The spoke v-y divides the ring in two; the old spokes that cross it are those to the part in which u is
 * not. */
static void note_crossings(view *w, watch *seen, collapse_effect *effect)
{
    for (uint32_t j = 2; j + 2 <= w->n; j++) {
        double ds = w->s_of[j], dt = w->t_of[j], side_u = w->side[j], inverse = 1 / (ds * ds + dt * dt);
        uint32_t begin = side_u >= 0 ? 1 : j + 1, end = side_u >= 0 ? j : w->n;
        for (uint32_t i = begin; i < end; i++) {
            double side_x = cross2(ds, dt, w->s_of[i], w->t_of[i]), span = side_u - side_x;
            double along = span != 0 ? side_u / span : 0; /* on the old spoke, from u */
            double at_s = w->us + along * (w->s_of[i] - w->us), at_t = w->ut + along * (w->t_of[i] - w->ut);
            double on_new = (at_s * ds + at_t * dt) * inverse;
            double gap = on_new * w->h_of[j] - (w->uh + along * (w->h_of[i] - w->uh));
            note_gap(w, j, gap);
            note_gap(w, j - 1, gap);
            if (seen->normals || seen->colours)
                watch_crossing(w, seen, i, j, along, on_new, effect);
        }
    }
}

/* The box of a move by t * way, t in [0, 1]. */
static void box_of_way(const double way[3], float box[6])
{
    for (unsigned k = 0; k < 3; k++) {
        box[k] = (float)(way[k] < 0 ? -way[k] : 0);
        box[3 + k] = (float)(way[k] > 0 ? way[k] : 0);
    }
}

static void add_box(float to[6], const float box[6])
{
    for (unsigned k = 0; k < 6; k++)
        to[k] = (to[k] + box[k]) * STRL_ROUND_UP;
}

/* What a gap of one below and above adds to a drift: the normal's positive and negative parts, of which one of each two
 * is 0. */
static void list_gap_reaches(const double normal[3], float below[8], float above[8])
{
    for (unsigned k = 0; k < 3; k++) {
        float n = (float)normal[k] * (1 + 1e-6f), up = n > 0 ? n : 0, down = n > 0 ? 0 : -n;
        below[k] = above[3 + k] = up;
        below[3 + k] = above[k] = down;
    }
    below[6] = below[7] = above[6] = above[7] = 0;
}

/* A new triangle overlaps the old triangles between v and itself on its side of u; the one that holds u may overlap
 * all. (An old triangle whose base lies beyond a new spoke has its apex, u, on this side of it, or both on the other.)
 */
static void drift_by_height(const view *w, collapse_effect *effect)
{
    const strl_star *star = w->star;
    const uint8_t *triangle = &star->fan.triangle[w->v_at];
    const face *faces = w->s->faces;
    float moved[6], below[8], above[8], longest = 0;
    reach sum = {{0}};
    list_gap_reaches(star->fan.axis[2], below, above);
    box_of_way(w->moved, moved);
    for (uint32_t m = w->first; m < w->image; m++) {
        strl__unite(&sum, &faces[star->triangle[triangle[m]]].reach);
        effect->of[triangle[m]] = sum;
    }
    sum = (reach){{0}};
    for (uint32_t m = w->end - 1; m > w->image; m--) {
        strl__unite(&sum, &faces[star->triangle[triangle[m]]].reach);
        effect->of[triangle[m]] = sum;
    }
    effect->of[triangle[w->image]] = effect->all;
    for (uint32_t m = 1; m + 1 < w->n; m++) {
        reach *own = &effect->of[triangle[m]];
        float lower = (float)-w->least[m], higher = (float)w->most[m]; /* neither is negative */
        if (!star->closed)
            add_box(own->of, moved);
        for (unsigned k = 0; k < 8; k++)
            own->of[k] = (own->of[k] + (lower * below[k] + higher * above[k])) * STRL_ROUND_UP;
        longest = strl__larger(longest, strl__drift_squared(own));
    }
    effect->longest = sqrtf(longest) * (1 + 1e-6f); /* whatever the rounding, a bound */
}

/* The wedge of each point of the ring, as the star's triangles use it. */
static void list_ring_wedges(const simplifier *s, const strl_star *star, uint32_t *wedge)
{
    const strl_fan *fan = &star->fan;
    for (uint32_t i = 0; i < fan->n; i++) {
        wedge[i] = s->sites[star->neighbour[i]].only_wedge;
        if (wedge[i] == NO_INDEX) {
            bool begins = i < star->count;
            uint32_t t = fan->triangle[begins ? i : i - 1];
            wedge[i] = s->corner[star->triangle[t]][(star->corner[t] + (begins ? 1u : 2u)) % 3];
        }
        wedge[fan->n + i] = wedge[i];
    }
}

/* Whether colours differ anywhere in the star from those of one wedge of u. */
static bool colours_vary(const simplifier *s, const strl_star *star, uint32_t own)
{
    for (uint32_t i = 0; i < star->count; i++)
        for (unsigned c = 0; c < 3; c++) {
            uint32_t w = s->corner[star->triangle[i]][c];
            for (unsigned k = 0; k < 3; k++)
                if (s->colour[w][k] != s->colour[own][k])
                    return true;
        }
    return false;
}

static float farthest(const simplifier *s, const strl_star *star, uint32_t to)
{
    double most = 0;
    for (uint32_t i = 0; i < star->neighbour_count; i++) {
        double squared = strl__distance2(s->sites[star->neighbour[i]].position, s->sites[to].position);
        most = squared > most ? squared : most;
    }
    return (float)sqrt(most);
}

/* Chooses what to look at along spokes. Without a view of the fan, colours that differ count as wholly different. */
static void begin_watch(const simplifier *s, const strl_star *star, uint32_t to, bool has_view, watch *seen,
                        collapse_effect *effect)
{
    wedge_fate fate;
    seen->own = s->corner[star->triangle[0]][star->corner[0]];
    seen->normals = s->sites[star->point].only_wedge != NO_INDEX; /* along a crease each side has its own */
    seen->colours = s->has_colours && colours_vary(s, star, seen->own);
    seen->normal_squared = 0;
    if (!seen->colours && !seen->normals)
        return;
    effect->spoke_reach = farthest(s, star, to);
    seen->target = strl__wedge_target(s, star, to, seen->own, &fate);
    seen->target = fate == WEDGE_CARRIED ? seen->own : seen->target;
    if (!has_view || seen->target == NO_INDEX) {
        effect->spoke_colour = seen->colours ? 1 : 0;
        seen->normals = seen->colours = false;
        return;
    }
    list_ring_wedges(s, star, seen->wedge);
}

/* A triangle at v that is not in the star, with the edge to x if there is one. */
static uint32_t triangle_beside(const simplifier *s, const strl_star *star, uint32_t to, uint32_t x, bool *has_edge)
{
    uint32_t any = NO_INDEX;
    *has_edge = false;
    for (uint32_t corner = s->sites[to].head, next; corner != NO_INDEX; corner = next) {
        const face *f = &s->faces[corner >> 2];
        next = f->next[corner & 3];
        if (f->gone)
            continue;
        bool has_u = false, has_x = false;
        for (unsigned c = 0; c < 3; c++) {
            has_u |= f->point[c] == star->point;
            has_x |= f->point[c] == x;
        }
        if (has_u)
            continue;
        any = corner >> 2;
        if (has_x) {
            *has_edge = true;
            return any;
        }
    }
    return any;
}

/* The triangle of the star that stays and keeps the edge to x; NO_INDEX = none. */
static uint32_t keeper_of(const strl_star *star, uint32_t to, uint32_t x)
{
    for (uint32_t k = 0; k < star->count; k++)
        if (star->next[k] != to && star->previous[k] != to && (star->next[k] == x || star->previous[k] == x))
            return k;
    return NO_INDEX;
}

/* What a triangle has drifted when its corner c has gone that way too. */
static void pulled_drift(const simplifier *s, uint32_t triangle, unsigned c, const float way[6], float drift[6])
{
    const face *f = &s->faces[triangle];
    memcpy(drift, f->reach.of, 6 * sizeof *drift);
    if (!f->is_pulled) {
        add_box(drift, way);
        return;
    }
    const pull *p = &s->pulls[triangle];
    float most[6];
    memcpy(most, p->corner[c], sizeof most);
    add_box(most, way);
    for (unsigned k = 0; k < 6; k++)
        most[k] = strl__larger(most[k], strl__larger(p->corner[(c + 1) % 3][k], p->corner[(c + 2) % 3][k]));
    memcpy(drift, p->before, sizeof p->before);
    add_box(drift, most);
}

static float longest_straight(const simplifier *s, const strl_star *star, uint32_t to, const collapse_effect *effect)
{
    float longest = 0;
    for (uint32_t i = 0; i < star->count; i++)
        if (star->next[i] != to && star->previous[i] != to)
            longest = strl__larger(longest, strl__drift_squared(&effect->of[i]));
    for (uint32_t i = 0; i < effect->receivers; i++) {
        reach both = effect->orphan;
        strl__unite(&both, &s->faces[effect->receiver[i]].reach);
        longest = strl__larger(longest, strl__drift_squared(&both));
    }
    return sqrtf(longest) * (1 + 1e-6f); /* whatever the rounding, a bound */
}

/* Every point of the star goes towards v by a share of the way from u. A vanishing triangle (u, v, x) falls onto the
 * edge v-x. Where no triangle of the star keeps that edge, another one at v takes its drift over; where none keeps the
 * edge at all, its points are still within |v - x| of v, which the caller knows to stay. */
static void drift_straight(const simplifier *s, const strl_star *star, uint32_t to, collapse_effect *effect)
{
    double way[3];
    for (unsigned k = 0; k < 3; k++)
        way[k] = s->sites[to].position[k] - s->sites[star->point].position[k];
    box_of_way(way, effect->way);
    effect->straight = true;
    effect->orphan = (reach){{0}};
    for (uint32_t i = 0; i < star->count; i++) {
        effect->is_mixed[i] = false;
        effect->of[i] = s->faces[star->triangle[i]].reach;
        pulled_drift(s, star->triangle[i], star->corner[i], effect->way, effect->of[i].of);
    }
    for (uint32_t i = 0; i < star->count; i++) {
        if (star->next[i] != to && star->previous[i] != to)
            continue;
        uint32_t x = star->next[i] == to ? star->previous[i] : star->next[i], keeper = keeper_of(star, to, x);
        if (keeper != NO_INDEX) {
            strl__unite(&effect->of[keeper], &effect->of[i]);
            effect->is_mixed[keeper] = true;
            continue;
        }
        bool has_edge;
        uint32_t receiver = triangle_beside(s, star, to, x, &has_edge);
        if (receiver != NO_INDEX)
            effect->receiver[effect->receivers++] = receiver;
        reach lost = effect->of[i];
        double edge = has_edge ? 0 : sqrt(strl__distance2(s->sites[to].position, s->sites[x].position));
        for (unsigned k = 0; k < 6; k++)
            lost.of[k] = (lost.of[k] + (float)edge) * STRL_ROUND_UP;
        strl__unite(&effect->orphan, &lost);
        if (receiver == NO_INDEX) /* a triangle of the star stays, see strl__leaves_surface_at */
            for (uint32_t k = 0; k < star->count; k++) {
                strl__unite(&effect->of[k], &lost);
                effect->is_mixed[k] = true;
            }
    }
    effect->longest = longest_straight(s, star, to, effect);
}

void strl__collapse_effect(const simplifier *s, const strl_star *star, uint32_t to, collapse_effect *effect)
{
    view w;
    watch seen;
    bool has_view = look(s, star, to, &w);
    effect->image = NO_INDEX;
    effect->weights[0] = 1, effect->weights[1] = effect->weights[2] = 0;
    effect->receivers = 0;
    effect->straight = false;
    effect->spoke_colour = effect->spoke_normal = effect->spoke_reach = 0;
    effect->all = (reach){{0}};
    for (uint32_t i = 0; i < star->count; i++)
        strl__unite(&effect->all, &s->faces[star->triangle[i]].reach);
    begin_watch(s, star, to, has_view, &seen, effect);
    if (has_view) {
        note_crossings(&w, &seen, effect);
        effect->spoke_normal = sqrtf(seen.normal_squared);
    }
    if (has_view && w.n >= 3 && is_height_field(&w)) {
        find_image(&w);
        note_gap_at_u(&w, effect->weights);
        drift_by_height(&w, effect);
        effect->image = star->fan.triangle[w.v_at + w.image];
    } else
        drift_straight(s, star, to, effect);
}

/* The pull of a triangle, begun where it has none. */
static pull *pull_of(simplifier *s, uint32_t triangle)
{
    face *f = &s->faces[triangle];
    pull *p = &s->pulls[triangle];
    if (!f->is_pulled) {
        memset(p, 0, sizeof *p);
        memcpy(p->before, f->reach.of, sizeof p->before);
        f->is_pulled = true;
    }
    return p;
}

/* What another triangle has drifted counts for all of this one. */
static void hold_too(simplifier *s, uint32_t triangle, const reach *other)
{
    face *f = &s->faces[triangle];
    strl__unite(&f->reach, other);
    f->is_pulled = false;
}

void strl__take_effect(simplifier *s, const strl_star *star, const collapse_plan *plan, const collapse_effect *effect)
{
    for (uint32_t i = 0; i < star->count; i++) {
        uint32_t t = star->triangle[i];
        face *f = &s->faces[t];
        if (f->gone)
            continue;
        if (effect->straight && !effect->is_mixed[i])
            add_box(pull_of(s, t)->corner[star->corner[i]], effect->way);
        else
            f->is_pulled = false;
        f->reach = effect->of[i];
        f->reach.of[REACH_DEVIATION] = plan->deviation;
        f->reach.of[REACH_SHIFT] = plan->shift;
    }
    for (uint32_t i = 0; i < effect->receivers; i++)
        hold_too(s, effect->receiver[i], &effect->orphan);
}
