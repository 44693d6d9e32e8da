/* Setting a simplification up: what it keeps of points and triangles, and their quadrics. */
#include <math.h>
#include <string.h>

#include "base/hash.h"
#include "geometry/octahedral.h"
#include "geometry/simplify_plan.h"

/* Stands for "more than one wedge" while wedges are counted. */
#define SEVERAL (UINT32_MAX - 1)
#define CACHE_LINE 64u

/* Face planes weighted by area; normals weighted by area. */
static void add_triangle_quadrics(simplifier *s, uint32_t t)
{
    const uint32_t *point = s->faces[t].point;
    double e[2][3], n[3];
    for (unsigned c = 0; c < 2; c++)
        for (unsigned k = 0; k < 3; k++)
            e[c][k] = s->sites[point[c + 1]].position[k] - s->sites[point[c]].position[k];
    n[0] = e[0][1] * e[1][2] - e[0][2] * e[1][1];
    n[1] = e[0][2] * e[1][0] - e[0][0] * e[1][2];
    n[2] = e[0][0] * e[1][1] - e[0][1] * e[1][0];
    double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    if (!(length > 0))
        return;
    for (unsigned k = 0; k < 3; k++)
        n[k] /= length;
    quadric plane = {0};
    strl__quadric_add_plane(&plane, n, s->sites[point[0]].position, length * 0.5);
    for (unsigned c = 0; c < 3; c++) {
        uint32_t wedge = s->corner[t][c];
        strl__quadric_add(&s->quadrics[point[c]], &plane);
        for (unsigned k = 0; k < 3; k++)
            s->normal_sum[wedge][k] += (float)length * s->normal[wedge][k];
    }
}

/* True where every neighbour comes as often before the point as after it: then no edge of the point is of odd use. */
static bool is_inside(const simplifier *s, uint32_t point)
{
    uint64_t balance = 0;
    for (uint32_t corner = s->sites[point].head; corner != NO_INDEX; corner = s->faces[corner >> 2].next[corner & 3]) {
        const uint32_t *p = s->faces[corner >> 2].point;
        unsigned c = corner & 3;
        balance += strl__mix64(p[c == 2 ? 0 : c + 1]) - strl__mix64(p[c == 0 ? 2 : c - 1]);
    }
    return balance == 0;
}

/* For every edge of odd use a plane across its triangle, so that rims keep their shape. */
static void add_rim_quadrics(simplifier *s, uint32_t point)
{
    const strl_star *star = &s->star;
    if ((s->sites[point].flags & STRL_POINT_KEPT) || is_inside(s, point) || !strl__star_gather(s, point, &s->star) ||
        !star->on_boundary)
        return;
    for (uint32_t i = 0; i < star->count; i++)
        for (int side = 0; side < 2; side++) {
            uint32_t other = side ? star->previous[i] : star->next[i], third = side ? star->next[i] : star->previous[i];
            if (!(strl__star_uses(s, star, other) & 1))
                continue;
            const double *u = s->sites[point].position, *v = s->sites[other].position, *w = s->sites[third].position;
            double edge[3], to_third[3], along = 0, length2 = 0, across2 = 0;
            for (unsigned k = 0; k < 3; k++) {
                edge[k] = v[k] - u[k];
                to_third[k] = w[k] - u[k];
                length2 += edge[k] * edge[k];
                along += edge[k] * to_third[k];
            }
            for (unsigned k = 0; k < 3; k++) {
                to_third[k] -= edge[k] * along / length2;
                across2 += to_third[k] * to_third[k];
            }
            if (!(across2 > 0))
                continue;
            for (unsigned k = 0; k < 3; k++)
                to_third[k] /= sqrt(across2);
            strl__quadric_add_plane(&s->quadrics[point], to_third, u, length2);
        }
}

/* Structures of one cache line each, at the beginning of one. */
static void *allocate_lines(strl_arena *arena, size_t count)
{
    char *block = strl_arena_alloc(arena, count + 1, CACHE_LINE);
    return block ? block + (CACHE_LINE - (uintptr_t)block % CACHE_LINE) % CACHE_LINE : NULL;
}

/* A payload's vertices are bounded; where a mesh is beyond them already, it is no node yet. */
static uint32_t wedge_room(uint32_t count)
{
    uint32_t room = count + count / 2 + STAR_MAX;
    return count <= STRL_PM_MAX_VERTICES && room > STRL_PM_MAX_VERTICES ? STRL_PM_MAX_VERTICES : room;
}

static bool allocate(simplifier *s, strl_arena *arena)
{
    _Static_assert(sizeof(site) == CACHE_LINE && sizeof(face) == CACHE_LINE, "one cache line each");
    uint32_t points = s->mesh->point_count, wedges = s->wedge_room;
    s->sites = allocate_lines(arena, points);
    s->faces = allocate_lines(arena, s->mesh->triangle_count);
    s->pulls = strl_arena_alloc(arena, s->mesh->triangle_count, sizeof *s->pulls);
    s->quadrics = strl_arena_alloc_zero(arena, points, sizeof *s->quadrics);
    s->normal = strl_arena_alloc(arena, wedges, sizeof *s->normal);
    s->colour = strl_arena_alloc(arena, wedges, sizeof *s->colour);
    s->normal_sum = strl_arena_alloc_zero(arena, wedges, sizeof *s->normal_sum);
    s->heap = strl_arena_alloc(arena, points + HEAP_WAYS, sizeof *s->heap);
    s->plan = strl_arena_alloc_zero(arena, points, sizeof *s->plan);
    s->known = strl_arena_alloc_zero(arena, points, sizeof *s->known);
    return s->sites && s->faces && s->pulls && s->quadrics && s->normal && s->colour && s->normal_sum && s->heap &&
           s->plan && s->known;
}

static bool allocate_result(const simplifier *s, strl_simplified *result, strl_arena *arena)
{
    const strl_mesh *mesh = s->mesh;
    uint32_t triangles = mesh->triangle_count;
    result->collapses = strl_arena_alloc(arena, mesh->point_count, sizeof *result->collapses);
    result->wedge = strl_arena_alloc(arena, s->wedge_room, sizeof *result->wedge);
    result->wedge_parent = strl_arena_alloc(arena, s->wedge_room, sizeof *result->wedge_parent);
    result->normal = strl_arena_alloc(arena, s->wedge_room, sizeof *result->normal);
    result->removed_at = strl_arena_alloc(arena, triangles, sizeof *result->removed_at);
    result->corner = strl_arena_alloc(arena, triangles, sizeof *result->corner);
    result->drift = strl_arena_alloc(arena, triangles, sizeof *result->drift);
    result->deviation = strl_arena_alloc(arena, triangles, sizeof *result->deviation);
    result->shift = strl_arena_alloc(arena, triangles, sizeof *result->shift);
    return result->collapses && result->wedge && result->wedge_parent && result->normal && result->removed_at &&
           result->corner && result->drift && result->deviation && result->shift;
}

void strl__append_corner(simplifier *s, uint32_t point, uint32_t corner)
{
    site *p = &s->sites[point];
    s->faces[corner >> 2].next[corner & 3] = NO_INDEX;
    if (p->head == NO_INDEX)
        p->head = corner;
    else
        s->faces[p->tail >> 2].next[p->tail & 3] = corner;
    p->tail = corner;
    p->degree++;
}

static void load_points(simplifier *s)
{
    const strl_mesh *mesh = s->mesh;
    for (uint32_t p = 0; p < mesh->point_count; p++) {
        s->sites[p] = (site){.head = NO_INDEX,
                             .tail = NO_INDEX,
                             .only_wedge = NO_INDEX,
                             .flags = mesh->flags[p],
                             .holders = mesh->holders ? mesh->holders[p] : 0};
        for (unsigned k = 0; k < 3; k++)
            s->sites[p].position[k] = mesh->position[p][k];
    }
}

static void load_wedges(simplifier *s, strl_simplified *result)
{
    const strl_mesh *mesh = s->mesh;
    memcpy(s->wedge, mesh->wedge, mesh->wedge_count * sizeof *s->wedge);
    s->wedge_count = mesh->wedge_count;
    for (uint32_t w = 0; w < mesh->wedge_count; w++) {
        uint32_t *only = &s->sites[mesh->wedge[w].point].only_wedge;
        *only = *only == NO_INDEX ? w : SEVERAL;
        s->sites[mesh->wedge[w].point].palette = mesh->wedge[w].palette;
        strl_oct_decode(mesh->wedge[w].normal, s->normal[w]);
        s->normal[w][3] = 0;
        for (unsigned k = 0; k < 4; k++)
            s->colour[w][k] = k < 3 ? (float)(mesh->wedge[w].colour >> (8 * k) & 255) / 255.f : 0;
        s->has_colours |= ((mesh->wedge[w].colour ^ mesh->wedge[0].colour) & 0xffffff) != 0;
        result->wedge_parent[w] = w;
    }
    for (uint32_t p = 0; p < mesh->point_count; p++)
        if (s->sites[p].only_wedge == SEVERAL)
            s->sites[p].only_wedge = NO_INDEX;
}

static void load_triangle(simplifier *s, uint32_t t, strl_simplified *result)
{
    const strl_mesh *mesh = s->mesh;
    face *f = &s->faces[t];
    for (unsigned c = 0; c < 3; c++) {
        s->corner[t][c] = mesh->triangle[t][c];
        f->point[c] = mesh->wedge[mesh->triangle[t][c]].point;
        strl__append_corner(s, f->point[c], 4 * t + c);
    }
    f->gone = f->is_pulled = false;
    for (unsigned k = 0; k < 3; k++) {
        f->reach.of[k] = -mesh->drift[t].least[k];
        f->reach.of[3 + k] = mesh->drift[t].most[k];
    }
    f->reach.of[REACH_DEVIATION] = mesh->deviation[t];
    f->reach.of[REACH_SHIFT] = mesh->shift[t];
    result->removed_at[t] = UINT32_MAX;
    result->geometric = strl__larger(result->geometric, strl_mesh_error(mesh, strl_drift_length(&mesh->drift[t])));
    result->appearance = strl__larger(result->appearance, mesh->shift[t]);
}

bool strl__simplify_load(simplifier *s, strl_arena *work, strl_arena *arena, strl_simplified *result)
{
    s->wedge_room = wedge_room(s->mesh->wedge_count);
    if (!allocate_result(s, result, arena) || !allocate(s, work))
        return false;
    s->corner = result->corner;
    s->wedge = result->wedge;
    memset(s->heap, 0xff, (s->mesh->point_count + HEAP_WAYS) * sizeof *s->heap); /* NO_CANDIDATE */
    load_points(s);
    load_wedges(s, result);
    for (uint32_t t = 0; t < s->mesh->triangle_count; t++)
        load_triangle(s, t, result);
    s->triangles_left = s->mesh->triangle_count;
    for (uint32_t t = 0; t < s->mesh->triangle_count; t++)
        add_triangle_quadrics(s, t);
    for (uint32_t p = 0; p < s->mesh->point_count; p++) {
        add_rim_quadrics(s, p);
        s->sites[p].own_cost = strl__quadric_at(&s->quadrics[p], s->sites[p].position);
    }
    return true;
}

/* A vertex of the mesh after stands for a region; with its own normal alone it would show the noise of one place. */
static void mean_normals(const simplifier *s, strl_simplified *result)
{
    result->wedge_count = s->wedge_count;
    for (uint32_t w = 0; w < s->wedge_count; w++) {
        const strl_wedge *wedge = &s->wedge[w];
        const float *sum = s->normal_sum[w], *own = s->normal[w];
        bool others_look = s->mesh->flags[wedge->point] & STRL_POINT_OUTSIDE;
        if (!others_look && sum[0] * own[0] + sum[1] * own[1] + sum[2] * own[2] > 0)
            strl_oct_encode(sum, result->normal[w]);
        else
            memcpy(result->normal[w], wedge->normal, sizeof wedge->normal);
    }
}

void strl__simplify_store(const simplifier *s, strl_simplified *result)
{
    for (uint32_t t = 0; t < s->mesh->triangle_count; t++) {
        const reach *r = &s->faces[t].reach;
        for (unsigned k = 0; k < 3; k++) {
            result->drift[t].least[k] = -r->of[k];
            result->drift[t].most[k] = r->of[3 + k];
        }
        result->deviation[t] = r->of[REACH_DEVIATION];
        result->shift[t] = r->of[REACH_SHIFT];
    }
    result->triangles_left = s->triangles_left;
    mean_normals(s, result);
}
