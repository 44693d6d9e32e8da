/* Progressive meshes for tests and benchmarks of the payload codec: a mesh and half-edge collapses on it, random ones
 * or ones that keep the shape. Not a simplifier for users: no quadrics, no limits. */
#ifndef STRL_TESTS_GEOMETRY_TEST_PM_H
#define STRL_TESTS_GEOMETRY_TEST_PM_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "base/hash.h"
#include "base/memory.h"
#include "geometry/octahedral.h"
#include "geometry/progressive.h"

/* Render vertices; those at one position are wedges of one topological vertex. Arrays are the arena's. */
struct test_mesh {
    uint32_t vertex_count, triangle_count;
    int32_t (*position)[3];
    uint16_t (*normal)[2];
    uint32_t *colour;        /* or NULL */
    uint32_t *texcoord;      /* or NULL */
    uint16_t *palette_index; /* or NULL */
    uint16_t (*triangle)[3];
    uint32_t palette_count;
};

struct test_pm_desc {
    uint64_t seed;
    uint32_t keep;            /* topological vertices to keep; at most nine tenths are */
    bool keep_shape;          /* collapse where it changes least, not on the rim; else anywhere */
    unsigned virtual_percent; /* collapses onto any vertex, not a neighbour */
};

static inline uint64_t test_random(uint64_t *state)
{
    return strl__mix64(*state += 0x9e3779b97f4a7c15u);
}

static inline uint32_t test_below(uint64_t *state, uint32_t bound)
{
    return (uint32_t)((test_random(state) >> 32) * bound >> 32);
}

struct test_collapse {
    uint32_t group, target;
    float error;
    uint32_t first_removed, removed_count; /* in removed */
};

struct test_simplifier {
    const struct test_mesh *mesh;
    uint32_t group_count, alive;
    uint32_t *group;       /* [vertices], topological vertex */
    uint32_t *group_first; /* [vertices], representative vertex of a group */
    uint32_t *wedge_next;  /* [vertices], next wedge of the group */
    uint32_t *corner_head; /* [groups], list of corners 3 t + k */
    uint32_t *corner_next; /* [corners] */
    uint32_t (*corner)[3]; /* current render vertices */
    bool *dead_triangle, *dead_group, *touched, *rim;
    uint32_t *removed, removed_count;
    uint32_t *parent; /* [vertices] */
    struct test_collapse *collapse;
    uint32_t collapse_count;
    uint64_t random;
};

static const int32_t (*test_sort_position)[3];

static inline int test_compare_position(const void *a, const void *b)
{
    const int32_t *p = test_sort_position[*(const uint32_t *)a], *q = test_sort_position[*(const uint32_t *)b];
    for (unsigned k = 0; k < 3; k++)
        if (p[k] != q[k])
            return p[k] < q[k] ? -1 : 1;
    return *(const uint32_t *)a < *(const uint32_t *)b ? -1 : 1;
}

static inline void test_group_vertices(struct test_simplifier *s, strl_arena *arena)
{
    uint32_t count = s->mesh->vertex_count, *order = strl_arena_alloc(arena, count, sizeof *order);
    for (uint32_t v = 0; v < count; v++)
        order[v] = v;
    test_sort_position = (const int32_t(*)[3])s->mesh->position;
    qsort(order, count, sizeof *order, test_compare_position);
    for (uint32_t i = 0; i < count; i++) {
        uint32_t v = order[i];
        bool same = i && !memcmp(s->mesh->position[order[i - 1]], s->mesh->position[v], 12);
        if (!same)
            s->group_first[s->group_count++] = v;
        s->group[v] = s->group_count - 1;
        s->wedge_next[v] = UINT32_MAX;
        if (same)
            s->wedge_next[order[i - 1]] = v;
    }
    s->alive = s->group_count;
}

static inline void test_add_corner(struct test_simplifier *s, uint32_t corner)
{
    uint32_t group = s->group[s->corner[corner / 3][corner % 3]];
    s->corner_next[corner] = s->corner_head[group];
    s->corner_head[group] = corner;
}

static inline void test_find_rim(struct test_simplifier *s)
{
    for (uint32_t c = 0; c < s->mesh->triangle_count * 3; c++) {
        uint32_t a = s->group[s->corner[c / 3][c % 3]], b = s->group[s->corner[c / 3][(c % 3 + 1) % 3]];
        unsigned faces = 0;
        for (uint32_t d = s->corner_head[a]; d != UINT32_MAX; d = s->corner_next[d])
            for (unsigned k = 1; k < 3; k++)
                faces += s->group[s->corner[d / 3][(d % 3 + k) % 3]] == b;
        if (faces == 1)
            s->rim[a] = s->rim[b] = true;
    }
}

static inline struct test_simplifier test_simplifier_make(const struct test_mesh *mesh, strl_arena *arena)
{
    struct test_simplifier s = {.mesh = mesh};
    uint32_t v = mesh->vertex_count, t = mesh->triangle_count;
    s.group = strl_arena_alloc(arena, v, 4);
    s.group_first = strl_arena_alloc(arena, v, 4);
    s.wedge_next = strl_arena_alloc(arena, v, 4);
    s.corner_head = strl_arena_alloc(arena, v, 4);
    s.corner_next = strl_arena_alloc(arena, (size_t)t * 3, 4);
    s.corner = strl_arena_alloc(arena, t, sizeof *s.corner);
    s.dead_triangle = strl_arena_alloc_zero(arena, t, 1);
    s.dead_group = strl_arena_alloc_zero(arena, v, 1);
    s.touched = strl_arena_alloc_zero(arena, v, 1);
    s.rim = strl_arena_alloc_zero(arena, v, 1);
    s.removed = strl_arena_alloc(arena, t, 4);
    s.parent = strl_arena_alloc_zero(arena, v, 4);
    s.collapse = strl_arena_alloc(arena, v, sizeof *s.collapse);
    test_group_vertices(&s, arena);
    memset(s.corner_head, 0xff, (size_t)v * 4);
    for (uint32_t c = 0; c < t * 3; c++) {
        s.corner[c / 3][c % 3] = mesh->triangle[c / 3][c % 3];
        test_add_corner(&s, c);
    }
    return s;
}

static inline bool test_corner_at(const struct test_simplifier *s, uint32_t corner, uint32_t group)
{
    return !s->dead_triangle[corner / 3] && s->group[s->corner[corner / 3][corner % 3]] == group;
}

/* Which of a triangle's corners lies at a group, or 3. */
static inline unsigned test_corner_of(const struct test_simplifier *s, uint32_t t, uint32_t group)
{
    for (unsigned k = 0; k < 3; k++)
        if (s->group[s->corner[t][k]] == group)
            return k;
    return 3;
}

static inline void test_normal(const int32_t p[3], const int32_t q[3], const int32_t r[3], double n[3])
{
    double a[3], b[3];
    for (unsigned k = 0; k < 3; k++) {
        a[k] = (double)q[k] - p[k];
        b[k] = (double)r[k] - p[k];
    }
    for (unsigned k = 0; k < 3; k++)
        n[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
}

/* What collapsing group v onto u costs: the largest distance of u from the planes of v's triangles and a little of the
 * length; infinite where a triangle turns over or the link condition fails. */
static inline double test_cost(const struct test_simplifier *s, uint32_t v, uint32_t u)
{
    const int32_t(*position)[3] = (const int32_t(*)[3])s->mesh->position;
    const int32_t *pv = position[s->group_first[v]], *pu = position[s->group_first[u]];
    double cost = 0, length = 0;
    for (unsigned k = 0; k < 3; k++)
        length += ((double)pu[k] - pv[k]) * ((double)pu[k] - pv[k]);
    for (uint32_t c = s->corner_head[v]; c != UINT32_MAX; c = s->corner_next[c]) {
        if (!test_corner_at(s, c, v))
            continue;
        const int32_t *q = position[s->corner[c / 3][(c % 3 + 1) % 3]],
                      *r = position[s->corner[c / 3][(c % 3 + 2) % 3]];
        double before[3], after[3], dot = 0, offset = 0, size = 0, size_after = 0;
        test_normal(pv, q, r, before);
        test_normal(pu, q, r, after);
        for (unsigned k = 0; k < 3; k++) {
            dot += before[k] * after[k];
            size += before[k] * before[k];
            size_after += after[k] * after[k];
            offset += before[k] * ((double)pu[k] - pv[k]);
        }
        if (test_corner_of(s, c / 3, u) == 3 && dot <= 0.2 * sqrt(size * size_after))
            return INFINITY;
        cost = fmax(cost, fabs(offset) / sqrt(size + 1e-9));
    }
    return cost * cost + 1e-3 * length;
}

static inline void test_collapse(struct test_simplifier *s, uint32_t v, uint32_t u, float error)
{
    struct test_collapse *collapse = &s->collapse[s->collapse_count++];
    *collapse = (struct test_collapse){v, u, error, s->removed_count, 0};
    for (uint32_t w = s->group_first[v]; w != UINT32_MAX; w = s->wedge_next[w])
        s->parent[w] = s->group_first[u];
    for (uint32_t c = s->corner_head[v]; c != UINT32_MAX; c = s->corner_next[c]) {
        unsigned k;
        if (test_corner_at(s, c, v) && (k = test_corner_of(s, c / 3, u)) < 3) {
            s->parent[s->corner[c / 3][c % 3]] = s->corner[c / 3][k];
            s->dead_triangle[c / 3] = true;
            s->removed[s->removed_count++] = c / 3;
            collapse->removed_count++;
        }
    }
    for (uint32_t c = s->corner_head[v], next; c != UINT32_MAX; c = next) {
        next = s->corner_next[c];
        if (!test_corner_at(s, c, v))
            continue;
        s->corner[c / 3][c % 3] = s->parent[s->corner[c / 3][c % 3]];
        test_add_corner(s, c);
    }
    s->dead_group[v] = true;
    s->alive--;
}

struct test_candidate {
    double cost;
    uint32_t v, u;
};

static inline int test_compare_cost(const void *a, const void *b)
{
    const struct test_candidate *p = a, *q = b;
    return p->cost < q->cost ? -1 : p->cost > q->cost ? 1 : p->v < q->v ? -1 : 1;
}

/* One pass of independent collapses, cheapest first; false where nothing could be done. */
static inline bool test_shape_pass(struct test_simplifier *s, uint32_t keep, struct test_candidate *candidate)
{
    uint32_t count = 0, done = 0;
    for (uint32_t v = 0; v < s->group_count; v++) {
        struct test_candidate best = {INFINITY, v, 0};
        s->touched[v] = false;
        if (s->dead_group[v] || s->rim[v])
            continue;
        for (uint32_t c = s->corner_head[v]; c != UINT32_MAX; c = s->corner_next[c]) {
            if (!test_corner_at(s, c, v))
                continue;
            uint32_t u = s->group[s->corner[c / 3][(c % 3 + 1) % 3]];
            double cost = test_cost(s, v, u);
            if (cost < best.cost)
                best = (struct test_candidate){cost, v, u};
        }
        if (best.cost < INFINITY)
            candidate[count++] = best;
    }
    qsort(candidate, count, sizeof *candidate, test_compare_cost);
    for (uint32_t i = 0; i < count / 3 + 1 && i < count && s->alive > keep; i++) {
        uint32_t v = candidate[i].v;
        if (s->touched[v])
            continue;
        for (uint32_t c = s->corner_head[v]; c != UINT32_MAX; c = s->corner_next[c])
            for (unsigned k = 0; k < 3 && test_corner_at(s, c, v); k++)
                s->touched[s->group[s->corner[c / 3][k]]] = true;
        test_collapse(s, v, candidate[i].u, (float)sqrt(candidate[i].cost));
        done++;
    }
    return done;
}

static inline void test_random_collapses(struct test_simplifier *s, const struct test_pm_desc *desc)
{
    float error = 0;
    for (uint32_t tries = 0; s->alive > desc->keep && tries < 200 * s->group_count; tries++) {
        uint32_t v = test_below(&s->random, s->group_count), u = test_below(&s->random, s->group_count), corners = 0;
        if (s->dead_group[v])
            continue;
        if (test_below(&s->random, 100) >= desc->virtual_percent) {
            u = v;
            for (uint32_t c = s->corner_head[v]; c != UINT32_MAX; c = s->corner_next[c])
                if (test_corner_at(s, c, v) && test_below(&s->random, ++corners) == 0)
                    u = s->group[s->corner[c / 3][(c % 3 + 1 + test_below(&s->random, 2)) % 3]];
        }
        if (u == v || s->dead_group[u])
            continue;
        if (s->collapse_count > s->group_count / 10)
            error += 0.01f * (float)test_below(&s->random, 100);
        test_collapse(s, v, u, error);
    }
}

static inline void test_fill_attributes(const struct test_mesh *mesh, const uint32_t *old_vertex, strl_pm *pm,
                                        strl_arena *arena)
{
    pm->position = strl_arena_alloc(arena, pm->vertex_count, 12);
    pm->normal = strl_arena_alloc(arena, pm->vertex_count, 4);
    pm->colour = mesh->colour ? strl_arena_alloc(arena, pm->vertex_count, 4) : NULL;
    pm->texcoord = mesh->texcoord ? strl_arena_alloc(arena, pm->vertex_count, 4) : NULL;
    pm->palette_index = mesh->palette_index ? strl_arena_alloc(arena, pm->vertex_count, 2) : NULL;
    for (uint32_t v = 0; v < pm->vertex_count; v++) {
        memcpy(pm->position[v], mesh->position[old_vertex[v]], 12);
        memcpy(pm->normal[v], mesh->normal[old_vertex[v]], 4);
        if (pm->texcoord)
            pm->texcoord[v] = mesh->texcoord[old_vertex[v]];
        if (pm->colour)
            pm->colour[v] = mesh->colour[old_vertex[v]];
        if (pm->palette_index)
            pm->palette_index[v] = mesh->palette_index[old_vertex[v]];
    }
    pm->palette_count = mesh->palette_count ? mesh->palette_count : 1;
    pm->palette = strl_arena_alloc(arena, pm->palette_count, sizeof *pm->palette);
    for (uint32_t i = 0; i < pm->palette_count; i++)
        pm->palette[i] = (strl_palette_entry){i / 2, i % 3 ? i : 0xffffffffu, 0xff204060u + 77 * i};
}

/* The recorded collapses, backward, as a progressive mesh. */
static inline void test_record(const struct test_simplifier *s, strl_pm *pm, strl_arena *arena)
{
    const struct test_mesh *mesh = s->mesh;
    uint32_t steps = s->collapse_count, vertex = 0, triangle = 0;
    *pm = (strl_pm){.vertex_count = mesh->vertex_count, .triangle_count = mesh->triangle_count, .step_count = steps};
    pm->parent = strl_arena_alloc_zero(arena, pm->vertex_count, 2);
    pm->triangle = strl_arena_alloc(arena, pm->triangle_count, 6);
    pm->vertex_end = strl_arena_alloc(arena, steps + 1, 4);
    pm->triangle_end = strl_arena_alloc(arena, steps + 1, 4);
    pm->geometric_error = strl_arena_alloc(arena, steps + 1, 4);
    pm->appearance_error = strl_arena_alloc(arena, steps + 1, 4);
    uint32_t *number = strl_arena_alloc(arena, pm->vertex_count, 4),
             *old_vertex = strl_arena_alloc(arena, pm->vertex_count, 4);
    uint32_t *old_triangle = strl_arena_alloc(arena, pm->triangle_count, 4);
    for (uint32_t v = 0; v < pm->vertex_count; v++)
        if (!s->dead_group[s->group[v]])
            old_vertex[number[v] = vertex++] = v;
    for (uint32_t t = 0; t < pm->triangle_count; t++)
        if (!s->dead_triangle[t])
            old_triangle[triangle++] = t;
    for (uint32_t i = 0; i <= steps; i++) {
        if (i) {
            const struct test_collapse *collapse = &s->collapse[steps - i];
            for (uint32_t w = s->group_first[collapse->group]; w != UINT32_MAX; w = s->wedge_next[w]) {
                pm->parent[vertex] = (uint16_t)number[s->parent[w]];
                old_vertex[number[w] = vertex++] = w;
            }
            for (uint32_t r = 0; r < collapse->removed_count; r++)
                old_triangle[triangle++] = s->removed[collapse->first_removed + r];
        }
        pm->vertex_end[i] = vertex;
        pm->triangle_end[i] = triangle;
    }
    float largest = 0; /* errors only grow with collapses */
    pm->geometric_error[steps] = pm->appearance_error[steps] = 0;
    for (uint32_t c = 0; c < steps; c++) {
        largest = fmaxf(largest, s->collapse[c].error);
        pm->geometric_error[steps - c - 1] = largest;
        pm->appearance_error[steps - c - 1] = largest * 0.5f;
    }
    for (uint32_t t = 0; t < pm->triangle_count; t++)
        for (unsigned k = 0; k < 3; k++)
            pm->triangle[t][k] = (uint16_t)number[mesh->triangle[old_triangle[t]][k]];
    test_fill_attributes(mesh, old_vertex, pm, arena);
}

static inline void test_pm_make(const struct test_mesh *mesh, const struct test_pm_desc *desc, strl_arena *arena,
                                strl_pm *pm)
{
    struct test_simplifier s = test_simplifier_make(mesh, arena);
    struct test_pm_desc plan = *desc;
    if (plan.keep > s.group_count - s.group_count / 10)
        plan.keep = s.group_count - s.group_count / 10;
    s.random = plan.seed;
    if (plan.keep_shape) {
        test_find_rim(&s);
        struct test_candidate *candidate = strl_arena_alloc(arena, s.group_count, sizeof *candidate);
        while (s.alive > plan.keep && test_shape_pass(&s, plan.keep, candidate))
            ;
    } else {
        test_random_collapses(&s, &plan);
    }
    test_record(&s, pm, arena);
}

/* ---- meshes ---- */
static inline struct test_mesh test_mesh_make(uint32_t vertices, uint32_t triangles, strl_arena *arena)
{
    struct test_mesh mesh = {.vertex_count = vertices, .triangle_count = triangles};
    mesh.position = strl_arena_alloc_zero(arena, vertices, 12);
    mesh.normal = strl_arena_alloc_zero(arena, vertices, 4);
    mesh.triangle = strl_arena_alloc_zero(arena, triangles, 6);
    return mesh;
}

static inline void test_mesh_normals(struct test_mesh *mesh)
{
    float(*sum)[3] = calloc(mesh->vertex_count ? mesh->vertex_count : 1, sizeof *sum);
    for (uint32_t t = 0; sum && t < mesh->triangle_count; t++) {
        const uint16_t *c = mesh->triangle[t];
        double n[3];
        test_normal(mesh->position[c[0]], mesh->position[c[1]], mesh->position[c[2]], n);
        for (unsigned i = 0; i < 9; i++)
            sum[c[i / 3]][i % 3] += (float)n[i % 3];
    }
    for (uint32_t v = 0; sum && v < mesh->vertex_count; v++)
        strl_oct_encode(sum[v], mesh->normal[v]);
    free(sum);
}

/* A grid of columns x rows vertices; closed round where wrapped (the last column or row joins the first). */
static inline struct test_mesh test_mesh_grid(uint32_t columns, uint32_t rows, bool wrap_x, bool wrap_y,
                                              strl_arena *arena)
{
    uint32_t across = columns - !wrap_x, down = rows - !wrap_y, t = 0;
    struct test_mesh mesh = test_mesh_make(columns * rows, 2 * across * down, arena);
    for (uint32_t y = 0; y < down; y++)
        for (uint32_t x = 0; x < across; x++) {
            uint32_t right = (x + 1) % columns, below = (y + 1) % rows;
            uint16_t a = (uint16_t)(y * columns + x), b = (uint16_t)(y * columns + right);
            uint16_t c = (uint16_t)(below * columns + x), d = (uint16_t)(below * columns + right);
            memcpy(mesh.triangle[t++], (uint16_t[3]){a, b, d}, 6);
            memcpy(mesh.triangle[t++], (uint16_t[3]){a, d, c}, 6);
        }
    return mesh;
}

/* Hills on a grid with `spacing` lattice units between vertices, and as much noise as `rough` (0..1) of the spacing. */
static inline struct test_mesh test_mesh_hills(uint32_t columns, uint32_t rows, double spacing, double rough,
                                               uint64_t seed, strl_arena *arena)
{
    struct test_mesh mesh = test_mesh_grid(columns, rows, false, false, arena);
    for (uint32_t v = 0; v < mesh.vertex_count; v++) {
        double x = v % columns, y = v / columns, noise[3];
        for (unsigned k = 0; k < 3; k++)
            noise[k] = rough * ((double)test_below(&seed, 1u << 20) / (1u << 20) - 0.5);
        mesh.position[v][0] = (int32_t)lrint(spacing * (x + noise[0]));
        mesh.position[v][1] = (int32_t)lrint(spacing * (y + noise[1]));
        mesh.position[v][2] =
            (int32_t)lrint(spacing * (6 * sin(x * 0.13) * cos(y * 0.11) + 1.5 * sin(x * 0.7 + y * 0.4) + noise[2]));
    }
    test_mesh_normals(&mesh);
    return mesh;
}

#endif
