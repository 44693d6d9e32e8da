#include "geometry/simplify.h"

#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "geometry/simplify_plan.h"

#define ESTIMATE_SHARE 0.5f /* of what is likely: too little costs time, too much spoils the order */
#define FREE_DIVISOR 8      /* collapses that add no error go on below the target, down to this part of it */
#define LADDER_RATIO 4.f    /* the first rung gives up where its next collapse costs so many times its middle one */
#define SMALL_SHARE 5e-4    /* of a piece's diagonal: errors below are never out of proportion */
/* of a piece's diagonal: errors above are out of proportion where not even half of what is wanted is done */
#define LARGE_SHARE 0.01
#define LEAST_ERROR 1.f  /* lattice units: below, all errors count as equal */
#define MEAN_COSINE 0.7f /* normals that are further apart belong to two faces: no mean says what either looks like */

static candidate candidate_of(uint32_t point, float key)
{
    uint32_t bits;
    key = key > 0 ? key : 0; /* not -0 */
    memcpy(&bits, &key, sizeof bits);
    return (candidate)bits << 32 | point;
}

static float key_of(candidate c)
{
    uint32_t bits = (uint32_t)(c >> 32);
    float key;
    memcpy(&key, &bits, sizeof key);
    return key;
}

static void heap_push(simplifier *s, uint32_t point, float key)
{
    candidate c = candidate_of(point, key), *heap = s->heap;
    uint32_t at = s->heap_count++;
    s->sites[point].in_heap = true;
    for (uint32_t parent; at > 0 && c < heap[parent = (at - 1) / HEAP_WAYS]; at = parent)
        heap[at] = heap[parent];
    heap[at] = c;
}

static uint32_t heap_pop(simplifier *s)
{
    candidate *heap = s->heap, c = heap[--s->heap_count];
    uint32_t at = 0, first = (uint32_t)heap[0];
    s->sites[first].in_heap = false;
    heap[s->heap_count] = NO_CANDIDATE;
    for (uint32_t child; (child = HEAP_WAYS * at + 1) < s->heap_count;) {
        candidate least = heap[child];
        uint32_t best = child;
        for (uint32_t other = child + 1; other < child + HEAP_WAYS; other++) {
            best = heap[other] < least ? other : best;
            least = heap[other] < least ? heap[other] : least;
        }
        if (c < least)
            break;
        heap[at] = least;
        at = best;
    }
    if (s->heap_count)
        heap[at] = c;
    return first;
}

static float cosine(const float a[4], const float b[4])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* One more wedge at v that looks like this one of u. */
static uint32_t carry_wedge(simplifier *s, uint32_t wedge, uint32_t to, strl_simplified *result)
{
    uint32_t added = s->wedge_count++;
    s->wedge[added] = s->wedge[wedge];
    s->wedge[added].point = to;
    memcpy(s->normal[added], s->normal[wedge], sizeof *s->normal);
    memcpy(s->colour[added], s->colour[wedge], sizeof *s->colour);
    memset(s->normal_sum[added], 0, sizeof *s->normal_sum);
    s->sites[to].only_wedge = NO_INDEX;
    result->wedge_parent[added] = added;
    return added;
}

/* Where every wedge of u goes. */
static void map_wedges(simplifier *s, const strl_star *star, uint32_t to, strl_simplified *result)
{
    for (uint32_t i = 0; i < star->wedge_count; i++) {
        uint32_t wedge = star->wedge[i];
        wedge_fate fate;
        uint32_t target = strl__wedge_target(s, star, to, wedge, &fate);
        if (fate == WEDGE_CARRIED)
            target = carry_wedge(s, wedge, to, result);
        result->wedge_parent[wedge] = target;
        bool counts = fate != WEDGE_LIKE || cosine(s->normal[target], s->normal[wedge]) > MEAN_COSINE;
        for (int k = 0; k < 3 && counts; k++)
            s->normal_sum[target][k] += s->normal_sum[wedge][k];
    }
}

void strl__apply_collapse(simplifier *s, const strl_star *star, const collapse_plan *plan,
                          const collapse_effect *effect, strl_simplified *result)
{
    uint32_t u = star->point, v = plan->to;
    s->moves += strl__moves_of(s, star, v);
    map_wedges(s, star, v, result);
    for (uint32_t i = 0; i < star->count; i++) {
        uint32_t t = star->triangle[i], *corner = &s->corner[t][star->corner[i]];
        face *f = &s->faces[t];
        if (star->next[i] == v || star->previous[i] == v) {
            f->gone = true;
            s->sites[star->next[i]].degree--;
            s->sites[star->previous[i]].degree--;
            result->removed_at[t] = result->collapse_count;
            s->triangles_left--;
            continue;
        }
        *corner = result->wedge_parent[*corner];
        f->point[star->corner[i]] = v;
        strl__append_corner(s, v, 4 * t + star->corner[i]);
    }
    strl__take_effect(s, star, plan, effect);
    s->sites[u].head = s->sites[u].tail = NO_INDEX;
    s->sites[u].degree = 0;
    strl__quadric_add(&s->quadrics[v], &s->quadrics[u]);
    s->sites[v].own_cost = strl__quadric_at(&s->quadrics[v], s->sites[v].position);
    s->sites[v].holders |= s->sites[u].holders;
    float own = strl__larger(plan->geometric, strl_mesh_error(s->mesh, effect->longest));
    result->geometric = strl__larger(result->geometric, own);
    result->appearance = strl__larger(result->appearance, plan->shift);
    result->collapses[result->collapse_count++] =
        (strl_collapse){u, v, s->triangles_left, result->geometric, result->appearance, own};
    if (s->rung > result->rung)
        result->rung = s->rung;
}

/* The patch round v looks different now: its points are planned again when they come up. */
static void mark_stale(simplifier *s, uint32_t point, float key)
{
    site *p = &s->sites[point];
    if (p->flags & STRL_POINT_KEPT)
        return;
    p->state = STATE_STALE;
    strl__forget_known(s, point);
    if (!p->in_heap)
        heap_push(s, point, key);
}

/* What a collapse of the point will cost at least, roughly, without a plan: its triangles have drifted so far already,
 * and the nearest of its neighbours is so far off their planes. Most points of a mesh are never planned for this. */
static float estimate_key(const simplifier *s, uint32_t point)
{
    const quadric *q = &s->quadrics[point];
    double off_planes = INFINITY;
    float shift = 0, drift = 0;
    for (uint32_t corner = s->sites[point].head, next; corner != NO_INDEX; corner = next) {
        const face *f = &s->faces[corner >> 2];
        unsigned c = corner & 3;
        next = f->next[c];
        if (f->gone)
            continue;
        double off = strl__quadric_at(q, s->sites[f->point[c == 2 ? 0 : c + 1]].position);
        off_planes = off < off_planes ? off : off_planes;
        shift = strl__larger(shift, f->reach.of[REACH_SHIFT]);
        drift = strl__larger(drift, strl__drift_squared(&f->reach));
    }
    drift = sqrtf(drift);
    double weight = q->xx + q->yy + q->zz; /* of unit normals */
    if (weight > 0 && off_planes < INFINITY)
        drift += ESTIMATE_SHARE * (float)sqrt(off_planes / weight);
    return strl__larger(shift, strl_mesh_error(s->mesh, drift));
}

static unsigned known_index(const simplifier *s)
{
    return s->rung >= STRL_SIMPLIFY_SEAMS;
}

/* Remembers what a plan cost, if one was found. */
static void note_known(simplifier *s, uint32_t point, bool found)
{
    float *known = s->known[point], key = found ? s->plan[point].key : INFINITY;
    unsigned index = known_index(s);
    known[index] = key;
    if (index > 0) /* where more is allowed, it costs no less */
        known[0] = strl__larger(known[0], key);
}

static void push_all(simplifier *s)
{
    for (uint32_t p = 0; p < s->mesh->point_count; p++) {
        site *own = &s->sites[p];
        if ((own->flags & STRL_POINT_KEPT) || own->head == NO_INDEX || own->in_heap)
            continue;
        float known = s->known[p][known_index(s)];
        if (known == INFINITY)
            continue;
        own->state = STATE_ESTIMATED;
        heap_push(s, p, known > 0 ? known : estimate_key(s, p));
    }
}

static float smaller(float a, float b)
{
    return a < b ? a : b;
}

/* Whether a collapse of this key is still asked for. */
static bool wants_more(const simplifier *s, float key)
{
    const strl_simplify_desc *desc = s->desc;
    if (key <= s->free_key) /* costs nothing that is not claimed already: flat places */
        return s->triangles_left > desc->target_triangles / FREE_DIVISOR;
    if (desc->even_error > 0 && key <= desc->even_error)
        return s->triangles_left > desc->least_triangles;
    if (desc->even_error > 0 && s->triangles_left <= desc->most_triangles)
        return false;
    return s->triangles_left > desc->target_triangles;
}

static double diagonal_of(const strl_mesh *mesh)
{
    double squared = 0;
    for (int k = 0; k < 3; k++) {
        int64_t least = INT32_MAX, most = INT32_MIN;
        for (uint32_t p = 0; p < mesh->point_count; p++) {
            least = mesh->position[p][k] < least ? mesh->position[p][k] : least;
            most = mesh->position[p][k] > most ? mesh->position[p][k] : most;
        }
        squared += most > least ? (double)(most - least) * (double)(most - least) : 0;
    }
    return sqrt(squared);
}

/* Plans the point anew. True where the plan is to be carried out at once: then it is in s->plan[point], s->star and
 * s->effect. */
static bool plan_again(simplifier *s, uint32_t point)
{
    collapse_plan *plan = &s->plan[point];
    s->sites[point].state = STATE_PLANNED;
    bool found = strl__plan_best(s, point, plan);
    note_known(s, point, found);
    if (!found)
        return false;
    if (candidate_of(point, plan->key) < s->heap[0])
        return true;
    heap_push(s, point, plan->key);
    return false;
}

/* Brings star and effect of a plan back. False where it cannot be carried out any more, because the other side has
 * changed since. */
static bool recall_plan(simplifier *s, uint32_t point)
{
    collapse_plan again;
    if (!strl__star_gather(s, point, &s->star) || s->star.count == 0 ||
        !strl__may_collapse(s, &s->star, s->plan[point].to))
        return false;
    strl__plan_collapse(s, &s->star, s->plan[point].to, &again, &s->effect);
    again.key = s->plan[point].key; /* what was compared */
    s->plan[point] = again;
    return true;
}

/* Takes the best candidate and makes sure that its plan holds; NO_INDEX where it had to be put back. */
static uint32_t next_point(simplifier *s)
{
    uint32_t point = heap_pop(s);
    site *own = &s->sites[point];
    if (own->state == STATE_PLANNED && recall_plan(s, point))
        return point;
    if (own->state != STATE_ESTIMATED) {
        float estimate = estimate_key(s, point);
        if (s->heap[0] < candidate_of(point, estimate)) { /* others are likely to be better: no plan yet */
            own->state = STATE_ESTIMATED;
            heap_push(s, point, estimate);
            return NO_INDEX;
        }
    }
    return plan_again(s, point) ? point : NO_INDEX;
}

/* What the first rung may cost: a few times what the first half of its collapses did, and while they are not done, an
 * error that is no longer small for such a piece or such a start. */
static float first_rung_limit(const simplifier *s, float start)
{
    float large = strl__larger(LADDER_RATIO * start, (float)(LARGE_SHARE * s->diagonal));
    return smaller(s->desc->error_limit, strl__larger(large, s->desc->even_error));
}

/* Collapses on the present rung up to `limit`; with `adaptive`, stops where keys leave those of the first half of what
 * is wanted far behind: then the next rungs do the same for less. Returns the largest key. */
static float run_rung(simplifier *s, float limit, bool adaptive, strl_simplified *result)
{
    uint32_t all = s->mesh->triangle_count, target = s->desc->target_triangles;
    uint32_t half = all - (all > target ? all - target : 0) / 2;
    float reached = 0;
    push_all(s);
    while (s->heap_count && key_of(s->heap[0]) <= limit && wants_more(s, key_of(s->heap[0]))) {
        uint32_t point = next_point(s);
        if (point == NO_INDEX)
            continue;
        float key = s->plan[point].key;
        if (key > limit || !wants_more(s, key)) {
            s->least_left = smaller(s->least_left, key);
            break;
        }
        strl__apply_collapse(s, &s->star, &s->plan[point], &s->effect, result);
        reached = strl__larger(reached, key);
        if (adaptive && s->triangles_left <= half) {
            float middle = strl__larger(strl__larger(reached, LEAST_ERROR), (float)(SMALL_SHARE * s->diagonal));
            limit = smaller(s->desc->error_limit, LADDER_RATIO * middle);
            adaptive = false;
        }
        for (uint32_t i = 0; i < s->star.neighbour_count; i++)
            mark_stale(s, s->star.neighbour[i], key);
    }
    if (s->heap_count)
        s->least_left = smaller(s->least_left, key_of(s->heap[0]));
    while (s->heap_count) {
        candidate *last = &s->heap[--s->heap_count];
        s->sites[(uint32_t)*last].in_heap = false;
        *last = NO_CANDIDATE;
    }
    return reached;
}

/* The next limit: at least twice as much, and no more rounds in which nothing can happen. A point joins another of its
 * cell only where an edge lies in one cell, or nearly so. */
static float next_limit(const simplifier *s, float limit, float most, bool changed)
{
    float least = smaller(s->least_left, s->shortest_edge);
    limit *= 2;
    while (!changed && limit < most && limit < least)
        limit *= 2;
    return smaller(limit, most);
}

/* Where no plan was allowed: that hangs on points two edges away, too. */
static void retry_failures(simplifier *s)
{
    for (uint32_t p = 0; p < s->mesh->point_count; p++)
        for (unsigned i = 0; i < 2; i++)
            s->known[p][i] = s->known[p][i] == INFINITY ? 0 : s->known[p][i];
}

/* All rungs up to one error, then all again up to twice that, until the target is met. False without memory. */
static bool climb_ladder(simplifier *s, float start, strl_arena *arena, strl_simplified *result)
{
    /* nothing is further away */
    float limit = start, most = smaller(s->desc->error_limit, 2 * strl__larger(start, (float)s->diagonal));
    bool changed = true;
    while (s->triangles_left > s->desc->target_triangles && s->triangles_left > s->desc->soft_triangles &&
           limit < most) {
        uint32_t before = result->collapse_count;
        limit = next_limit(s, limit, most, changed);
        if (changed)
            retry_failures(s);
        s->least_left = INFINITY;
        for (int rung = STRL_SIMPLIFY_TOPOLOGY; rung <= STRL_SIMPLIFY_SEAMS; rung++) {
            s->rung = (strl_simplify_rung)rung;
            if (rung <= (int)s->desc->last_rung && s->triangles_left > s->desc->target_triangles)
                run_rung(s, limit, false, result);
        }
        if (s->desc->last_rung >= STRL_SIMPLIFY_DISJOINT && s->triangles_left > s->desc->target_triangles &&
            !strl__simplify_clustering(s, limit, arena, result))
            return false;
        changed = result->collapse_count > before;
    }
    return true;
}

static strl_status simplify(simplifier *s, strl_arena *work, strl_arena *arena, strl_simplified *result,
                            strl_error *err)
{
    const strl_simplify_desc *desc = s->desc;
    if (!strl__simplify_load(s, work, arena, result))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to simplify %u triangles", s->mesh->triangle_count);
    s->free_key = strl__larger(result->geometric, result->appearance) * (1 + 1e-5f); /* claims are rounded up */
    s->diagonal = diagonal_of(s->mesh);
    float reached = strl__larger(result->geometric, LEAST_ERROR);
    if (s->triangles_left > desc->target_triangles / FREE_DIVISOR)
        reached = strl__larger(reached, run_rung(s, first_rung_limit(s, reached), true, result));
    if (desc->even_error > 0 && desc->last_rung >= STRL_SIMPLIFY_SEAMS && s->triangles_left > desc->least_triangles) {
        s->rung = STRL_SIMPLIFY_SEAMS; /* for the error that the node ends at anyway */
        reached = strl__larger(reached, run_rung(s, smaller(desc->even_error, desc->error_limit), false, result));
        s->rung = STRL_SIMPLIFY_TOPOLOGY;
    }
    uint32_t enough = desc->even_error > 0 ? desc->most_triangles : desc->target_triangles;
    if (s->triangles_left > enough && !climb_ladder(s, reached, work, result))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to simplify %u triangles", s->mesh->triangle_count);
    strl__simplify_store(s, result);
    return STRL_OK;
}

strl_status strl_simplify(const strl_mesh *mesh, const strl_simplify_desc *desc, strl_arena *arena,
                          strl_simplified *result, strl_error *err)
{
    simplifier *s = strl__alloc_zero(1, sizeof *s);
    strl_arena work = {0}; /* several times what the result takes */
    *result = (strl_simplified){0};
    if (!s)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to simplify %u triangles", mesh->triangle_count);
    s->mesh = mesh;
    s->desc = desc;
    strl_status status = simplify(s, &work, arena, result, err);
    strl_arena_deinit(&work);
    strl__free(s);
    return status;
}
