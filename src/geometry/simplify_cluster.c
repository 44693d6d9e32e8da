/* The last two rungs of the ladder: points that share a cell of a grid merge, the grid growing until the target is met.
 * Points of different components merge first of all (rung DISJOINT); points of one component only where CLUSTERING is
 * allowed. The error of such a merge is the full way that the point goes, so the claim stays a bound. */
#include <math.h>

#include "base/hash.h"
#include "geometry/simplify_plan.h"

/* Cells of the grid, of the error that merging may make: from their corners to their middles it is less far, and what
 * drifted before counts too. */
#define CELL_SHARE 0.75

typedef struct cell_slot {
    int64_t cell[3];
    uint32_t point; /* the cell's representative; NO_INDEX = free slot */
} cell_slot;

typedef struct clustering {
    simplifier *s;
    double origin[3];    /* of the grid: the least corner, so that a cell can hold everything */
    uint32_t *component; /* per point: union-find */
    cell_slot *slots;
    uint32_t mask;
} clustering;

static uint32_t find_root(uint32_t *component, uint32_t p)
{
    while (component[p] != p) {
        component[p] = component[component[p]];
        p = component[p];
    }
    return p;
}

static void unite(uint32_t *component, uint32_t a, uint32_t b)
{
    a = find_root(component, a), b = find_root(component, b);
    if (a < b)
        component[b] = a;
    else
        component[a] = b;
}

static int64_t cell_of(const clustering *c, const double p[3], unsigned axis, double size)
{
    return (int64_t)floor((p[axis] - c->origin[axis]) / size);
}

static cell_slot *find_cell(clustering *c, const double p[3], double size)
{
    int64_t cell[3];
    uint64_t hash = 0;
    for (unsigned k = 0; k < 3; k++) {
        cell[k] = cell_of(c, p, k, size);
        hash = strl__mix64(hash ^ (uint64_t)cell[k]);
    }
    uint32_t at = (uint32_t)hash & c->mask;
    while (c->slots[at].point != NO_INDEX &&
           (c->slots[at].cell[0] != cell[0] || c->slots[at].cell[1] != cell[1] || c->slots[at].cell[2] != cell[2]))
        at = (at + 1) & c->mask;
    for (int k = 0; k < 3; k++)
        c->slots[at].cell[k] = cell[k];
    return &c->slots[at];
}

static bool prepare(clustering *c, simplifier *s, strl_arena *arena)
{
    uint32_t points = s->mesh->point_count, size = 16;
    while (size < 2 * points)
        size *= 2;
    c->s = s;
    c->mask = size - 1;
    c->component = strl_arena_alloc(arena, points, sizeof *c->component);
    c->slots = strl_arena_alloc(arena, size, sizeof *c->slots);
    if (!c->component || !c->slots)
        return false;
    for (unsigned k = 0; k < 3; k++)
        c->origin[k] = INFINITY;
    for (uint32_t p = 0; p < points; p++) {
        c->component[p] = p;
        for (unsigned k = 0; k < 3; k++)
            c->origin[k] = fmin(c->origin[k], s->sites[p].position[k]);
    }
    double shortest = INFINITY;
    for (uint32_t t = 0; t < s->mesh->triangle_count; t++) {
        const uint32_t *point = s->faces[t].point;
        for (unsigned k = 0; k < 3 && !s->faces[t].gone; k++) {
            unite(c->component, point[0], point[k]);
            shortest =
                fmin(shortest, strl__distance2(s->sites[point[k]].position, s->sites[point[(k + 1) % 3]].position));
        }
    }
    s->shortest_edge = (float)sqrt(shortest);
    return true;
}

/* A point whose triangles have all vanished is no place to go to: it has no wedge left. */
static bool is_on_surface(const simplifier *s, uint32_t point)
{
    return s->sites[point].degree > 0;
}

/* Whether the point stays where it is, whatever its cell would like. */
static bool is_fixed(const simplifier *s, uint32_t point)
{
    return (s->mesh->flags[point] & STRL_POINT_KEPT) || s->sites[point].degree > STAR_MAX;
}

static double squared_from_centre(const clustering *c, const cell_slot *slot, const double p[3], double size)
{
    double sum = 0;
    for (unsigned k = 0; k < 3; k++) {
        double d = p[k] - c->origin[k] - ((double)slot->cell[k] + 0.5) * size;
        sum += d * d;
    }
    return sum;
}

/* Points that cannot move represent their cells; elsewhere the one nearest to the middle, to which ways are short. */
static void choose_representatives(clustering *c, double size)
{
    const simplifier *s = c->s;
    for (uint32_t i = 0; i <= c->mask; i++)
        c->slots[i].point = NO_INDEX;
    for (uint32_t p = 0; p < s->mesh->point_count; p++) {
        if (!is_on_surface(s, p))
            continue;
        cell_slot *slot = find_cell(c, s->sites[p].position, size);
        if (slot->point == NO_INDEX) {
            slot->point = p;
            continue;
        }
        bool fixed = is_fixed(s, p), other_fixed = is_fixed(s, slot->point);
        if (fixed != other_fixed ? fixed
                                 : squared_from_centre(c, slot, s->sites[p].position, size) <
                                       squared_from_centre(c, slot, s->sites[slot->point].position, size))
            slot->point = p;
    }
}

/* Whether some triangle of the star becomes the double of one at `to`, with which it may go (duplicates.c). The star's
 * stamps must be in force. */
static bool makes_double(const simplifier *s, const strl_star *star, uint32_t to)
{
    uint32_t scanned = 0;
    for (uint32_t corner = s->sites[to].head, next; corner != NO_INDEX && scanned < SCAN_MAX;
         corner = next, scanned++) {
        const face *f = &s->faces[corner >> 2];
        unsigned c = corner & 3;
        next = f->next[c];
        uint32_t a = f->point[(c + 1) % 3], b = f->point[(c + 2) % 3];
        if (f->gone || s->sites[a].stamp <= star->stamp || s->sites[b].stamp <= star->stamp)
            continue;
        for (uint32_t i = 0; i < star->count; i++)
            if ((star->next[i] == a && star->previous[i] == b) || (star->next[i] == b && star->previous[i] == a))
                return true;
    }
    return false;
}

/* Whether a triangle of the star has another corner in the star's cell: it will vanish when that one comes too. Merging
 * points of triangles that reach further costs error and takes nothing away. */
static bool can_take_away(const clustering *c, const strl_star *star, const cell_slot *slot, double size)
{
    for (uint32_t i = 0; i < star->neighbour_count; i++) {
        const double *p = c->s->sites[star->neighbour[i]].position;
        bool inside = true;
        for (unsigned k = 0; k < 3; k++)
            inside = inside && cell_of(c, p, k, size) == slot->cell[k];
        if (inside)
            return true;
    }
    return false;
}

/* A merge that takes no triangle away must not gather so many that the point cannot move any more: where all points are
 * such hubs, nothing goes on. */
static bool makes_hub(const simplifier *s, const strl_star *star, uint32_t to)
{
    return s->sites[to].degree + star->count > STAR_MAX && strl__star_uses(s, star, to) == 0;
}

static void forget_around(simplifier *s, const strl_star *star, uint32_t to)
{
    for (uint32_t i = 0; i < star->neighbour_count; i++)
        strl__forget_known(s, star->neighbour[i]);
    strl__forget_known(s, to);
}

static void merge_cells(clustering *c, double size, float limit, bool disjoint_only, strl_simplified *result)
{
    simplifier *s = c->s;
    choose_representatives(c, size);
    for (uint32_t p = 0; p < s->mesh->point_count && s->triangles_left > s->desc->target_triangles; p++) {
        const strl_star *star = &s->star;
        collapse_plan plan;
        cell_slot *slot = find_cell(c, s->sites[p].position, size);
        uint32_t to = slot->point;
        if ((s->mesh->flags[p] & STRL_POINT_KEPT) || to == p || to == NO_INDEX || !is_on_surface(s, p) ||
            !is_on_surface(s, to))
            continue;
        bool same = find_root(c->component, p) == find_root(c->component, to);
        if ((same && disjoint_only) || !strl__star_gather(s, p, &s->star) || star->count == 0)
            continue;
        if (!can_take_away(c, star, slot, size) && !makes_double(s, star, to))
            continue;
        s->rung = same ? STRL_SIMPLIFY_CLUSTERING : STRL_SIMPLIFY_DISJOINT;
        if (strl__crowds(s, star, to) || makes_hub(s, star, to)) {
            slot->point = p; /* the others may still come here */
            continue;
        }
        if (!strl__leaves_surface_at(s, star, to))
            continue;
        strl__plan_collapse(s, star, to, &plan, &s->effect);
        if (plan.key > limit)
            continue;
        strl__apply_collapse(s, star, &plan, &s->effect, result);
        forget_around(s, star, to);
        unite(c->component, p, to);
    }
}

bool strl__simplify_clustering(simplifier *s, float limit, strl_arena *arena, strl_simplified *result)
{
    clustering c;
    strl_arena_mark mark = strl_arena_get_mark(arena);
    double size = limit * CELL_SHARE;
    if (!prepare(&c, s, arena))
        return false;
    merge_cells(&c, size, limit, true, result);
    if (s->desc->last_rung >= STRL_SIMPLIFY_CLUSTERING)
        merge_cells(&c, size, limit, false, result);
    strl_arena_rewind(arena, mark);
    return true;
}
