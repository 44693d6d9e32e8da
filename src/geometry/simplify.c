#include "geometry/simplify.h"

#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "geometry/octahedral.h"
#include "geometry/simplify_plan.h"

/* Stands for "more than one wedge" while wedges are counted. */
#define SEVERAL (UINT32_MAX - 1)

#define ESTIMATE_SHARE 0.8f /* of what is likely: too little costs time, too much spoils the order */
#define FREE_DIVISOR 8   /* collapses that add no error go on below the target, down to this part of it */
#define LADDER_RATIO 4.f /* the first rung gives up where its next collapse costs so many times its middle one */
#define SMALL_SHARE 5e-4 /* of a piece's diagonal: errors below are never out of proportion */
#define LEAST_ERROR 1.f  /* lattice units: below, all errors count as equal */

static void heap_place(simplifier *s, uint32_t at, candidate c)
{
    s->heap[at] = c;
    s->heap_at[c.point] = at;
}

/* Ties are broken by index, so that the order does not depend on the heap's history. */
static bool before(candidate a, candidate b)
{
    return a.key < b.key || (a.key == b.key && a.point < b.point);
}

static void heap_up(simplifier *s, uint32_t at)
{
    candidate c = s->heap[at];
    while (at > 0 && before(c, s->heap[(at - 1) / 2])) {
        heap_place(s, at, s->heap[(at - 1) / 2]);
        at = (at - 1) / 2;
    }
    heap_place(s, at, c);
}

static void heap_down(simplifier *s, uint32_t at)
{
    candidate c = s->heap[at];
    for (;;) {
        uint32_t child = 2 * at + 1;
        if (child >= s->heap_count)
            break;
        if (child + 1 < s->heap_count && before(s->heap[child + 1], s->heap[child]))
            child++;
        if (!before(s->heap[child], c))
            break;
        heap_place(s, at, s->heap[child]);
        at = child;
    }
    heap_place(s, at, c);
}

static void heap_push(simplifier *s, uint32_t point, float key)
{
    s->heap[s->heap_count] = (candidate){key, point};
    heap_up(s, s->heap_count++);
}

static candidate heap_pop(simplifier *s)
{
    candidate first = s->heap[0];
    s->heap_at[first.point] = NO_INDEX;
    if (--s->heap_count > 0) {
        heap_place(s, 0, s->heap[s->heap_count]);
        heap_down(s, 0);
    }
    return first;
}

/* Face planes weighted by area, and for every edge of odd use a plane across it, so that rims keep their shape. */
static void add_triangle_quadrics(simplifier *s, uint32_t t)
{
    uint32_t point[3];
    double e[3][3], n[3];
    for (unsigned c = 0; c < 3; c++)
        point[c] = strl__corner_point(s, t, c);
    for (unsigned c = 0; c < 3; c++)
        for (int k = 0; k < 3; k++)
            e[c][k] = s->position[point[(c + 1) % 3]][k] - s->position[point[c]][k];
    n[0] = e[0][1] * e[1][2] - e[0][2] * e[1][1];
    n[1] = e[0][2] * e[1][0] - e[0][0] * e[1][2];
    n[2] = e[0][0] * e[1][1] - e[0][1] * e[1][0];
    double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    if (!(length > 0))
        return;
    for (int k = 0; k < 3; k++)
        n[k] /= length;
    for (unsigned c = 0; c < 3; c++)
        strl__quadric_add_plane(&s->quadrics[point[c]], n, s->position[point[c]], length * 0.5);
    for (unsigned c = 0; c < 3; c++)
        for (int k = 0; k < 3; k++)
            s->normal_sum[s->corner[t][c]][k] += (float)length * s->normal[s->corner[t][c]][k];
}

/* True where every neighbour comes as often before the point as after it: then no edge of the point is of odd use. */
static bool is_inside(const simplifier *s, uint32_t point)
{
    uint64_t balance = 0;
    for (uint32_t corner = s->head[point]; corner != NO_INDEX; corner = s->corner_next[corner]) {
        const uint32_t *p = s->point[corner / 3];
        unsigned c = corner % 3;
        balance += strl__mix64(p[c == 2 ? 0 : c + 1]) - strl__mix64(p[c == 0 ? 2 : c - 1]);
    }
    return balance == 0;
}

static void add_rim_quadrics(simplifier *s, uint32_t point)
{
    strl_star star;
    if ((s->mesh->flags[point] & STRL_POINT_KEPT) || is_inside(s, point) || !strl__star_gather(s, point, &star) || !star.on_boundary)
        return;
    for (uint32_t i = 0; i < star.count; i++)
        for (int side = 0; side < 2; side++) {
            uint32_t other = side ? star.previous[i] : star.next[i], third = side ? star.next[i] : star.previous[i];
            if (!(strl__star_uses(&star, other) & 1))
                continue;
            const double *u = s->position[point], *v = s->position[other], *w = s->position[third];
            double edge[3], to_third[3], along = 0, length2 = 0, across2 = 0;
            for (int k = 0; k < 3; k++) {
                edge[k] = v[k] - u[k];
                to_third[k] = w[k] - u[k];
                length2 += edge[k] * edge[k];
                along += edge[k] * to_third[k];
            }
            for (int k = 0; k < 3; k++) {
                to_third[k] -= edge[k] * along / length2;
                across2 += to_third[k] * to_third[k];
            }
            if (!(across2 > 0))
                continue;
            for (int k = 0; k < 3; k++)
                to_third[k] /= sqrt(across2);
            strl__quadric_add_plane(&s->quadrics[point], to_third, u, length2);
        }
}

static bool allocate(simplifier *s, const strl_mesh *mesh, strl_arena *arena)
{
    uint32_t points = mesh->point_count, triangles = mesh->triangle_count;
    s->position = strl_arena_alloc(arena, points, sizeof *s->position);
    s->normal = strl_arena_alloc(arena, mesh->wedge_count, sizeof *s->normal);
    s->colour = strl_arena_alloc(arena, mesh->wedge_count, sizeof *s->colour);
    s->normal_sum = strl_arena_alloc_zero(arena, mesh->wedge_count, sizeof *s->normal_sum);
    s->quadrics = strl_arena_alloc_zero(arena, points, sizeof *s->quadrics);
    s->point = strl_arena_alloc(arena, triangles, sizeof *s->point);
    s->corner_next = strl_arena_alloc(arena, (size_t)triangles * 3, sizeof *s->corner_next);
    s->head = strl_arena_alloc(arena, points, sizeof *s->head);
    s->tail = strl_arena_alloc(arena, points, sizeof *s->tail);
    s->degree = strl_arena_alloc_zero(arena, points, sizeof *s->degree);
    s->dead = strl_arena_alloc_zero(arena, triangles, sizeof *s->dead);
    s->stamp = strl_arena_alloc_zero(arena, points, sizeof *s->stamp);
    s->heap = strl_arena_alloc(arena, points, sizeof *s->heap);
    s->heap_at = strl_arena_alloc(arena, points, sizeof *s->heap_at);
    s->plan = strl_arena_alloc(arena, points, sizeof *s->plan);
    s->own_cost = strl_arena_alloc(arena, points, sizeof *s->own_cost);
    s->only_wedge = strl_arena_alloc(arena, points, sizeof *s->only_wedge);
    s->stale = strl_arena_alloc_zero(arena, points, sizeof *s->stale);
    s->holders = mesh->holders ? strl_arena_alloc(arena, points, 1) : NULL;
    if (mesh->holders && s->holders)
        memcpy(s->holders, mesh->holders, points);
    return (s->holders || !mesh->holders) && s->position && s->point && s->normal && s->normal_sum && s->colour && s->quadrics && s->corner_next && s->head && s->tail && s->degree && s->dead &&
           s->stamp && s->heap && s->heap_at && s->plan && s->own_cost && s->only_wedge && s->stale;
}

static bool allocate_result(simplifier *s, strl_simplified *result, strl_arena *arena)
{
    const strl_mesh *mesh = s->mesh;
    uint32_t triangles = mesh->triangle_count;
    result->collapses = strl_arena_alloc(arena, mesh->point_count, sizeof *result->collapses);
    result->wedge_parent = strl_arena_alloc(arena, mesh->wedge_count, sizeof *result->wedge_parent);
    result->normal = strl_arena_alloc(arena, mesh->wedge_count, sizeof *result->normal);
    result->removed_at = strl_arena_alloc(arena, triangles, sizeof *result->removed_at);
    result->corner = s->corner = strl_arena_alloc(arena, triangles, sizeof *s->corner);
    result->drift = s->drift = strl_arena_alloc(arena, triangles, sizeof *s->drift);
    result->deviation = s->deviation = strl_arena_alloc(arena, triangles, sizeof *s->deviation);
    result->shift = s->shift = strl_arena_alloc(arena, triangles, sizeof *s->shift);
    return result->collapses && result->wedge_parent && result->normal && result->removed_at && s->corner && s->drift && s->deviation &&
           s->shift;
}

static void append_corner(simplifier *s, uint32_t point, uint32_t corner)
{
    s->corner_next[corner] = NO_INDEX;
    if (s->head[point] == NO_INDEX)
        s->head[point] = corner;
    else
        s->corner_next[s->tail[point]] = corner;
    s->tail[point] = corner;
    s->degree[point]++;
}

static void load(simplifier *s, strl_simplified *result)
{
    const strl_mesh *mesh = s->mesh;
    for (uint32_t p = 0; p < mesh->point_count; p++) {
        for (int k = 0; k < 3; k++)
            s->position[p][k] = mesh->position[p][k];
        s->head[p] = s->tail[p] = s->heap_at[p] = s->only_wedge[p] = NO_INDEX;
    }
    for (uint32_t w = 0; w < mesh->wedge_count; w++) {
        uint32_t *only = &s->only_wedge[mesh->wedge[w].point];
        *only = *only == NO_INDEX ? w : SEVERAL;
        strl_oct_decode(mesh->wedge[w].normal, s->normal[w]);
        for (int k = 0; k < 3; k++)
            s->colour[w][k] = (float)(mesh->wedge[w].colour >> (8 * k) & 255) / 255.f;
        result->wedge_parent[w] = w;
    }
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        for (unsigned c = 0; c < 3; c++) {
            s->corner[t][c] = mesh->triangle[t][c];
            s->point[t][c] = mesh->wedge[mesh->triangle[t][c]].point;
            append_corner(s, s->point[t][c], 3 * t + c);
        }
        s->drift[t] = mesh->drift[t];
        s->deviation[t] = mesh->deviation[t];
        s->shift[t] = mesh->shift[t];
        result->removed_at[t] = UINT32_MAX;
        result->geometric = strl__larger(result->geometric, strl_drift_length(&mesh->drift[t]) + mesh->start_error);
        result->appearance = strl__larger(result->appearance, mesh->shift[t]);
    }
    s->triangles_left = mesh->triangle_count;
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        add_triangle_quadrics(s, t);
    for (uint32_t p = 0; p < mesh->point_count; p++) {
        add_rim_quadrics(s, p);
        s->own_cost[p] = strl__quadric_at(&s->quadrics[p], s->position[p]);
        if (s->only_wedge[p] == SEVERAL)
            s->only_wedge[p] = NO_INDEX;
    }
}

/* Where every wedge of u goes. At most STAR_MAX of them. */
static void map_wedges(simplifier *s, const strl_star *star, uint32_t to, strl_simplified *result)
{
    for (uint32_t i = 0; i < star->count; i++) {
        uint32_t wedge = s->corner[star->triangle[i]][star->corner[i]];
        bool exact;
        if (result->wedge_parent[wedge] != wedge)
            continue;
        uint32_t target = strl__wedge_target(s, star, to, wedge, &exact);
        result->wedge_parent[wedge] = target;
        for (int k = 0; k < 3; k++)
            s->normal_sum[target][k] += s->normal_sum[wedge][k];
    }
}

void strl__apply_collapse(simplifier *s, const strl_star *star, const collapse_plan *plan, strl_simplified *result)
{
    uint32_t u = star->point, v = plan->to;
    collapse_drift drift;
    strl__collapse_drift(s, star, v, &drift);
    s->moves += strl__moves_of(s, star, v);
    map_wedges(s, star, v, result);
    for (uint32_t i = 0; i < star->count; i++) {
        uint32_t t = star->triangle[i];
        if (star->next[i] == v || star->previous[i] == v) {
            s->dead[t] = true;
            s->degree[star->next[i]]--;
            s->degree[star->previous[i]]--;
            result->removed_at[t] = result->collapse_count;
            s->triangles_left--;
            continue;
        }
        s->corner[t][star->corner[i]] = result->wedge_parent[s->corner[t][star->corner[i]]];
        s->point[t][star->corner[i]] = v;
        append_corner(s, v, 3 * t + star->corner[i]);
        s->drift[t] = drift.of[i];
        s->deviation[t] = plan->deviation;
        s->shift[t] = plan->shift;
    }
    s->head[u] = s->tail[u] = NO_INDEX;
    s->degree[u] = 0;
    strl__receive_orphans(s, &drift);
    strl__quadric_add(&s->quadrics[v], &s->quadrics[u]);
    s->own_cost[v] = strl__quadric_at(&s->quadrics[v], s->position[v]);
    if (s->holders)
        s->holders[v] |= s->holders[u];
    result->geometric = strl__larger(result->geometric, strl__larger(plan->geometric, drift.longest + s->mesh->start_error));
    result->appearance = strl__larger(result->appearance, plan->shift);
    result->collapses[result->collapse_count++] =
        (strl_collapse){u, v, s->triangles_left, result->geometric, result->appearance};
    if (s->rung > result->rung)
        result->rung = s->rung;
}

/* The patch round v looks different now: its points are planned again when they come up. */
static void mark_stale(simplifier *s, uint32_t point, float key)
{
    if (s->mesh->flags[point] & STRL_POINT_KEPT)
        return;
    s->stale[point] = true;
    if (s->heap_at[point] == NO_INDEX)
        heap_push(s, point, key);
}

static void plan_and_push(simplifier *s, uint32_t point)
{
    collapse_plan plan;
    s->stale[point] = false;
    if (!strl__plan_best(s, point, &plan))
        return;
    s->plan[point] = plan;
    heap_push(s, point, plan.key);
}

/* What a collapse of the point will cost at least, roughly, without a plan: its triangles have drifted so far already, and the
 * nearest of its neighbours is so far off their planes. Most points of a mesh are never planned for this. */
static float estimate_key(const simplifier *s, uint32_t point)
{
    double off_planes = INFINITY;
    float shift = 0, drift = 0;
    for (uint32_t corner = s->head[point]; corner != NO_INDEX; corner = s->corner_next[corner]) {
        uint32_t t = corner / 3, c = corner % 3;
        if (s->dead[t])
            continue;
        double off = strl__quadric_at(&s->quadrics[point], s->position[s->point[t][c == 2 ? 0 : c + 1]]);
        off_planes = off < off_planes ? off : off_planes;
        shift = strl__larger(shift, s->shift[t]);
        drift = strl__larger(drift, strl_drift_length(&s->drift[t]));
    }
    double weight = s->quadrics[point].xx + s->quadrics[point].yy + s->quadrics[point].zz; /* of unit normals */
    if (weight > 0 && off_planes < INFINITY)
        drift += ESTIMATE_SHARE * (float)sqrt(off_planes / weight);
    return strl__larger(shift, s->mesh->start_error + drift);
}

static void push_all(simplifier *s)
{
    for (uint32_t p = 0; p < s->mesh->point_count; p++) {
        if ((s->mesh->flags[p] & STRL_POINT_KEPT) || s->head[p] == NO_INDEX || s->heap_at[p] != NO_INDEX)
            continue;
        s->stale[p] = true;
        heap_push(s, p, estimate_key(s, p));
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

/* An error that is small for a piece of this size, whatever its triangles are like. */
static float least_middle(const simplifier *s)
{
    double diagonal2 = 0;
    for (int k = 0; k < 3; k++) {
        double least = INFINITY, most = -INFINITY;
        for (uint32_t p = 0; p < s->mesh->point_count; p++) {
            least = s->position[p][k] < least ? s->position[p][k] : least;
            most = s->position[p][k] > most ? s->position[p][k] : most;
        }
        diagonal2 += most > least ? (most - least) * (most - least) : 0;
    }
    return strl__larger(LEAST_ERROR, (float)(sqrt(diagonal2) * SMALL_SHARE));
}

/* Collapses on the present rung up to `limit`. *middle: the key at which the first half of what is wanted was done (0 until
 * then); with `adaptive`, stops where keys leave it far behind: then the next rungs do the same for less. */
static float run_rung(simplifier *s, float limit, bool adaptive, float *middle, strl_simplified *result)
{
    uint32_t half = s->mesh->triangle_count - (s->mesh->triangle_count - s->desc->target_triangles) / 2;
    float reached = 0;
    push_all(s);
    while (s->heap_count && wants_more(s, s->heap[0].key)) {
        if (s->heap[0].key > limit || (adaptive && *middle > 0 && s->heap[0].key > LADDER_RATIO * *middle))
            break;
        uint32_t point = heap_pop(s).point;
        if (s->stale[point]) {
            plan_and_push(s, point);
            continue;
        }
        strl_star star;
        collapse_plan plan = s->plan[point];
        if (!strl__star_gather(s, point, &star) || star.count == 0)
            continue;
        if (!strl__may_collapse(s, &star, plan.to)) { /* the other side has changed since */
            plan_and_push(s, point);
            continue;
        }
        strl__apply_collapse(s, &star, &plan, result);
        reached = strl__larger(reached, plan.key);
        if (*middle == 0 && s->triangles_left <= half)
            *middle = strl__larger(reached, least_middle(s));
        for (uint32_t i = 0; i < star.neighbour_count; i++)
            mark_stale(s, star.neighbour[i], plan.key);
    }
    while (s->heap_count)
        s->heap_at[s->heap[--s->heap_count].point] = NO_INDEX;
    return reached;
}

/* All rungs up to one error, then all again up to twice that, until the target is met. */
static bool climb_ladder(simplifier *s, float start, strl_arena *arena, strl_simplified *result)
{
    float limit = start, middle = start;
    for (int round = 0; round < 64 && s->triangles_left > s->desc->target_triangles; round++) {
        if (s->triangles_left <= s->desc->soft_triangles || limit > s->desc->error_limit)
            break;
        limit = smaller(limit * 2, s->desc->error_limit);
        for (int rung = STRL_SIMPLIFY_TOPOLOGY; rung <= STRL_SIMPLIFY_SEAMS; rung++) {
            s->rung = (strl_simplify_rung)rung;
            if (rung <= (int)s->desc->last_rung && s->triangles_left > s->desc->target_triangles)
                run_rung(s, limit, false, &middle, result);
        }
        if (s->desc->last_rung >= STRL_SIMPLIFY_DISJOINT && s->triangles_left > s->desc->target_triangles &&
            !strl__simplify_clustering(s, limit, arena, result))
            return false;
        if (limit == s->desc->error_limit)
            break;
    }
    return true;
}

/* A vertex of the mesh after stands for a region; with its own normal alone it would show the noise of one place. */
static void mean_normals(const simplifier *s, strl_simplified *result)
{
    for (uint32_t w = 0; w < s->mesh->wedge_count; w++) {
        const strl_wedge *wedge = &s->mesh->wedge[w];
        const float *sum = s->normal_sum[w], *own = s->normal[w];
        bool others_look = s->mesh->flags[wedge->point] & STRL_POINT_OUTSIDE;
        if (!others_look && sum[0] * own[0] + sum[1] * own[1] + sum[2] * own[2] > 0)
            strl_oct_encode(sum, result->normal[w]);
        else
            memcpy(result->normal[w], wedge->normal, sizeof wedge->normal);
    }
}

strl_status strl_simplify(const strl_mesh *mesh, const strl_simplify_desc *desc, strl_arena *arena,
                          strl_simplified *result, strl_error *err)
{
    simplifier s = {.mesh = mesh, .desc = desc};
    *result = (strl_simplified){0};
    if (!allocate_result(&s, result, arena) || !allocate(&s, mesh, arena))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to simplify %u triangles", mesh->triangle_count);
    load(&s, result);
    s.free_key = strl__larger(result->geometric, result->appearance) * (1 + 1e-5f); /* claims are rounded up */
    float middle = 0, reached = strl__larger(result->geometric, LEAST_ERROR);
    if (s.triangles_left > desc->target_triangles / FREE_DIVISOR)
        reached = strl__larger(reached, run_rung(&s, desc->error_limit, true, &middle, result));
    if (desc->even_error > 0 && desc->last_rung >= STRL_SIMPLIFY_SEAMS && s.triangles_left > desc->least_triangles) {
        s.rung = STRL_SIMPLIFY_SEAMS; /* for the error that the node ends at anyway */
        reached = strl__larger(reached, run_rung(&s, smaller(desc->even_error, desc->error_limit), false, &middle, result));
        s.rung = STRL_SIMPLIFY_TOPOLOGY;
    }
    uint32_t enough = desc->even_error > 0 ? desc->most_triangles : desc->target_triangles;
    if (s.triangles_left > enough && !climb_ladder(&s, reached, arena, result))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to simplify %u triangles", mesh->triangle_count);
    result->triangles_left = s.triangles_left;
    mean_normals(&s, result);
    return STRL_OK;
}
