/* What the simplifier claims of every state is true: measured against the mesh it began with. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "base/hash.h"
#include "build/meshes.h"
#include "build/surface_distance.h"
#include "geometry/record.h"
#include "geometry/simplify.h"

#ifdef __SANITIZE_ADDRESS__
#define STATES 5u
#else
#define STATES 16u
#endif
#define NEVER UINT32_MAX

/* One mesh, simplified. */
typedef struct run {
    const mesh_kind *kind;
    strl_arena arena;
    strl_mesh mesh;
    strl_simplify_desc desc;
    strl_simplified result;
    uint32_t *removed_by; /* per point: the collapse that took it away, or NEVER */
} run;

static strl_simplify_desc everything(strl_simplify_rung last)
{
    return (strl_simplify_desc){.target_triangles = 4, .error_limit = INFINITY, .last_rung = last, .normal_weight = 0.25f,
                                .colour_weight = 1};
}

static void index_collapses(run *r)
{
    r->removed_by = strl_arena_alloc(&r->arena, r->mesh.point_count, sizeof *r->removed_by);
    assert_non_null(r->removed_by);
    memset(r->removed_by, 0xff, r->mesh.point_count * sizeof *r->removed_by);
    for (uint32_t i = 0; i < r->result.collapse_count; i++) {
        const strl_collapse *collapse = &r->result.collapses[i];
        assert_true(collapse->from < r->mesh.point_count && collapse->to < r->mesh.point_count);
        assert_int_equal(r->removed_by[collapse->from], NEVER);
        r->removed_by[collapse->from] = i;
    }
}

static void simplify(run *r)
{
    strl_error err = {0};
    if (strl_simplify(&r->mesh, &r->desc, &r->arena, &r->result, &err) != STRL_OK)
        fail_msg("%s: %s", r->kind ? r->kind->name : "mesh", err.message);
    index_collapses(r);
}

static void begin(run *r, const mesh_kind *kind, uint64_t seed, strl_simplify_rung last)
{
    *r = (run){.kind = kind, .desc = everything(last)};
    strl_arena_init(&r->arena, 0);
    kind->make(&r->mesh, seed, &r->arena);
}

static void end(run *r)
{
    strl_arena_deinit(&r->arena);
}

/* Every eighth point or so must stay. */
static void keep_some(run *r, uint64_t seed)
{
    for (uint32_t p = 0; p < r->mesh.point_count; p++)
        if (mesh_below(&seed, 8) == 0)
            r->mesh.flags[p] |= STRL_POINT_KEPT;
}

static uint32_t resolve(const run *r, uint32_t wedge, uint32_t state)
{
    while (r->removed_by[r->mesh.wedge[wedge].point] < state) {
        assert_int_not_equal(r->result.wedge_parent[wedge], wedge);
        wedge = r->result.wedge_parent[wedge];
    }
    return wedge;
}

/* The triangles that are left after `state` collapses, as points. */
static uint32_t points_of_state(const run *r, uint32_t state, uint32_t (*triangle)[3])
{
    uint32_t count = 0;
    for (uint32_t t = 0; t < r->mesh.triangle_count; t++) {
        if (r->result.removed_at[t] < state)
            continue;
        for (int c = 0; c < 3; c++)
            triangle[count][c] = r->mesh.wedge[resolve(r, r->mesh.triangle[t][c], state)].point;
        count++;
    }
    return count;
}

static void corners_of(const strl_mesh *mesh, uint32_t count, const uint32_t (*triangle)[3], double (*corner)[3][3])
{
    for (uint32_t t = 0; t < count; t++)
        for (int c = 0; c < 3; c++)
            for (int k = 0; k < 3; k++)
                corner[t][c][k] = mesh->position[triangle[t][c]][k];
}

/* ---- the bound ---- */
static double (*corners_of_mesh(const strl_mesh *mesh))[3][3]
{
    double(*corner)[3][3] = malloc(mesh->triangle_count * sizeof *corner);
    assert_non_null(corner);
    for (uint32_t i = 0; i < 9 * mesh->triangle_count; i++)
        corner[i / 9][i / 3 % 3][i % 3] = mesh->position[mesh->wedge[mesh->triangle[i / 9][i / 3 % 3]].point][i % 3];
    return corner;
}

/* Both ways: the new surface from the start, and the start from the new surface. */
static void compare(const run *r, uint32_t seed, const surface *start, const double (*corner)[3][3], uint32_t count, double claim)
{
    surface now;
    assert_true(count > 0);
    surface_create(&now, count, corner);
    double limit = claim * (1 + 1e-5) + 1e-6;
    double away = surface_reach(start, count, corner, 6, seed);
    double lost = surface_reach(&now, start->count, (const double(*)[3][3])start->corner, 6, seed + 77);
    if (away > limit || lost > limit)
        fail_msg("%s, rung %d, state %u: the claim is %g, but the new surface reaches %g from the old and the old %g from the new",
                 r->kind->name, (int)r->desc.last_rung, seed, claim, away, lost);
    surface_destroy(&now);
}

/* spare: so much of the claim belongs to the error of the start */
static void compare_with_start(const run *r, uint32_t state, const surface *start, double spare)
{
    uint32_t(*triangle)[3] = malloc(r->mesh.triangle_count * sizeof *triangle);
    double(*corner)[3][3] = malloc(r->mesh.triangle_count * sizeof *corner);
    assert_non_null(triangle);
    assert_non_null(corner);
    uint32_t count = points_of_state(r, state, triangle);
    corners_of(&r->mesh, count, (const uint32_t(*)[3])triangle, corner);
    compare(r, state, start, (const double(*)[3][3])corner, count,
            state ? (double)r->result.collapses[state - 1].geometric - spare : 0);
    free(triangle);
    free(corner);
}

static void measure(const run *r)
{
    double(*corner)[3][3] = corners_of_mesh(&r->mesh);
    surface start;
    surface_create(&start, r->mesh.triangle_count, (const double(*)[3][3])corner);
    for (uint32_t i = 1; i <= STATES; i++)
        compare_with_start(r, r->result.collapse_count * i / STATES, &start, 0);
    surface_destroy(&start);
    free(corner);
}

static void the_search_tree_finds_what_a_look_at_every_triangle_finds(void **state)
{
    (void)state;
    uint64_t random = 5;
    double corner[60][3][3];
    for (int i = 0; i < 60 * 9; i++)
        ((double *)corner)[i] = mesh_below(&random, 1000);
    memcpy(corner[7][1], corner[7][0], sizeof corner[7][0]); /* a line */
    memcpy(corner[8][1], corner[8][0], sizeof corner[8][0]);
    memcpy(corner[8][2], corner[8][0], sizeof corner[8][0]); /* a point */
    surface tree;
    surface_create(&tree, 60, (const double(*)[3][3])corner);
    for (int i = 0; i < 500; i++) {
        double p[3];
        for (int k = 0; k < 3; k++)
            p[k] = (double)mesh_below(&random, 2000) - 500;
        double slow = surface_distance_slow(60, (const double(*)[3][3])corner, p);
        assert_true(fabs(surface_distance(&tree, p) - slow) < 1e-9);
    }
    surface_destroy(&tree);
    const double unit[1][3][3] = {{{0, 0, 0}, {4, 0, 0}, {0, 4, 0}}};
    assert_true(surface_distance_slow(1, unit, (const double[3]){1, 1, -3}) == 3);
    assert_true(surface_distance_slow(1, unit, (const double[3]){-3, -4, 0}) == 5);
    assert_true(fabs(surface_distance_slow(1, unit, (const double[3]){4, 4, 0}) - sqrt(8)) < 1e-12);
}

static void no_state_is_farther_from_the_start_than_it_claims(void **state)
{
    (void)state;
    for (const mesh_kind *kind = mesh_kinds; kind->name; kind++)
        for (int rung = STRL_SIMPLIFY_TOPOLOGY; rung <= STRL_SIMPLIFY_CLUSTERING; rung++) {
            run r;
            begin(&r, kind, (uint64_t)rung + 3, (strl_simplify_rung)rung);
            if (rung & 1)
                keep_some(&r, 9);
            simplify(&r);
            measure(&r);
            end(&r);
        }
}

/* ---- counts and order ---- */
static void check_order(const run *r)
{
    float geometric = 0, appearance = 0;
    uint32_t triangles = r->mesh.triangle_count;
    uint32_t *removed = calloc(r->result.collapse_count + 1, sizeof *removed);
    assert_non_null(removed);
    for (uint32_t t = 0; t < r->mesh.triangle_count; t++)
        if (r->result.removed_at[t] != NEVER) {
            assert_true(r->result.removed_at[t] < r->result.collapse_count);
            removed[r->result.removed_at[t]]++;
        }
    for (uint32_t i = 0; i < r->result.collapse_count; i++) {
        const strl_collapse *collapse = &r->result.collapses[i];
        assert_true(collapse->geometric >= geometric && collapse->appearance >= appearance);
        geometric = collapse->geometric, appearance = collapse->appearance;
        triangles -= removed[i];
        assert_int_equal(collapse->triangles_left, triangles);
        assert_true(r->removed_by[collapse->to] > i); /* the target is still there */
        assert_false(r->mesh.flags[collapse->from] & STRL_POINT_KEPT);
    }
    assert_int_equal(r->result.triangles_left, triangles);
    assert_true(r->result.geometric == geometric && r->result.appearance == appearance);
    free(removed);
}

static void check_wedges(const run *r)
{
    for (uint32_t w = 0; w < r->mesh.wedge_count; w++) {
        uint32_t parent = r->result.wedge_parent[w], at = r->removed_by[r->mesh.wedge[w].point];
        assert_true(parent < r->mesh.wedge_count);
        if (parent == w)
            continue;
        assert_int_not_equal(at, NEVER);
        assert_int_equal(r->mesh.wedge[parent].point, r->result.collapses[at].to);
        if (r->result.rung < STRL_SIMPLIFY_DISJOINT)
            assert_int_equal(r->mesh.wedge[parent].palette, r->mesh.wedge[w].palette);
    }
    for (uint32_t t = 0; t < r->mesh.triangle_count; t++)
        for (int c = 0; c < 3 && r->result.removed_at[t] == NEVER; c++)
            assert_int_equal(r->result.corner[t][c], resolve(r, r->mesh.triangle[t][c], r->result.collapse_count));
}

/* Level upon level: what is left of one mesh is the start of the next, and what it claims is about the first. */
static void claims_hold_over_several_meshes(void **state)
{
    (void)state;
    for (const mesh_kind *kind = mesh_kinds; kind->name; kind++) {
        run r;
        strl_error err = {0};
        begin(&r, kind, 14, STRL_SIMPLIFY_SEAMS);
        uint32_t first_count = r.mesh.triangle_count;
        double(*first)[3][3] = corners_of_mesh(&r.mesh);
        surface start;
        surface_create(&start, first_count, (const double(*)[3][3])first);
        for (uint32_t level = 1; level <= 4; level++) {
            strl_mesh left;
            for (uint32_t p = 0; p < r.mesh.point_count; p++) /* other points are locked at each level */
                r.mesh.flags[p] = strl__mix64(p + level) % 5 == 0 ? STRL_POINT_KEPT : 0;
            r.desc.target_triangles = r.mesh.triangle_count / 2;
            r.desc.last_rung = level == 4 ? STRL_SIMPLIFY_CLUSTERING : STRL_SIMPLIFY_SEAMS;
            simplify(&r);
            check_order(&r);
            if (strl_mesh_after(&r.mesh, &r.result, NULL, &r.arena, &left, &err) != STRL_OK)
                fail_msg("%s", err.message);
            float before = r.result.geometric;
            r.mesh = left;
            double(*corner)[3][3] = corners_of_mesh(&left);
            compare(&r, level, &start, (const double(*)[3][3])corner, left.triangle_count, (double)before);
            free(corner);
        }
        surface_destroy(&start);
        free(first);
        end(&r);
    }
}

static void an_error_at_the_start_is_added_to(void **state)
{
    (void)state;
    for (const mesh_kind *kind = mesh_kinds; kind->name; kind++) {
        run r;
        begin(&r, kind, 1, STRL_SIMPLIFY_SEAMS);
        mesh_begin_with_error(&r.mesh, 30);
        simplify(&r);
        assert_true(r.result.collapse_count > 0);
        double(*corner)[3][3] = corners_of_mesh(&r.mesh);
        surface start;
        surface_create(&start, r.mesh.triangle_count, (const double(*)[3][3])corner);
        for (uint32_t i = 0; i < r.result.collapse_count; i++)
            assert_true(r.result.collapses[i].geometric >= 30);
        for (uint32_t i = 1; i <= STATES; i++)
            compare_with_start(&r, r.result.collapse_count * i / STATES, &start, 30);
        surface_destroy(&start);
        free(corner);
        end(&r);
    }
}

static void errors_and_counts_go_one_way_and_kept_points_stay(void **state)
{
    (void)state;
    for (const mesh_kind *kind = mesh_kinds; kind->name; kind++)
        for (int rung = STRL_SIMPLIFY_TOPOLOGY; rung <= STRL_SIMPLIFY_CLUSTERING; rung++) {
            run r;
            begin(&r, kind, 21, (strl_simplify_rung)rung);
            keep_some(&r, 4);
            simplify(&r);
            assert_true(r.result.collapse_count > 0);
            assert_true((int)r.result.rung <= rung);
            check_order(&r);
            check_wedges(&r);
            end(&r);
        }
}

static void seams_have_parents_of_their_own_palette(void **state)
{
    (void)state;
    for (int other_palette = 0; other_palette < 2; other_palette++)
        for (int rung = STRL_SIMPLIFY_TOPOLOGY; rung <= STRL_SIMPLIFY_CLUSTERING; rung++)
            for (int sphere = 0; sphere < 2; sphere++) {
                run r;
                begin(&r, &mesh_kinds[sphere ? 3 : 0], 2, (strl_simplify_rung)rung);
                uint32_t points = r.mesh.point_count;
                mesh_add_seam(&r.mesh, other_palette, 8, &r.arena);
                assert_true(r.mesh.wedge_count > points + 5);
                simplify(&r);
                check_order(&r);
                check_wedges(&r);
                measure(&r);
                end(&r);
            }
}

static void the_limits_that_are_asked_for_hold(void **state)
{
    (void)state;
    for (const mesh_kind *kind = mesh_kinds; kind->name; kind++) {
        run r;
        begin(&r, kind, 6, STRL_SIMPLIFY_CLUSTERING);
        r.desc.target_triangles = r.mesh.triangle_count / 2;
        simplify(&r);
        assert_true(r.result.triangles_left <= r.desc.target_triangles);
        if (r.result.collapse_count > 1) /* and no farther than that */
            assert_true(r.result.collapses[r.result.collapse_count - 2].triangles_left > r.desc.target_triangles);
        end(&r);
        begin(&r, kind, 6, STRL_SIMPLIFY_CLUSTERING);
        r.desc.error_limit = 25;
        simplify(&r);
        assert_true(r.result.geometric <= 25 && r.result.appearance <= 25);
        end(&r);
    }
}

/* ---- topology ---- */
typedef struct edge {
    uint32_t a, b; /* points, a < b */
} edge;

static int compare_edges(const void *x, const void *y)
{
    const edge *p = x, *q = y;
    if (p->a != q->a)
        return p->a < q->a ? -1 : 1;
    return p->b < q->b ? -1 : p->b > q->b;
}

static uint32_t list_edges(uint32_t count, const uint32_t (*triangle)[3], edge *edges)
{
    for (uint32_t i = 0; i < 3 * count; i++) {
        uint32_t a = triangle[i / 3][i % 3], b = triangle[i / 3][(i + 1) % 3];
        assert_int_not_equal(a, b);
        edges[i] = (edge){a < b ? a : b, a < b ? b : a};
    }
    qsort(edges, 3 * (size_t)count, sizeof *edges, compare_edges);
    return 3 * count;
}

/* Marks the ends of edges of odd use; returns the largest use of any edge. */
static uint32_t mark_rim(uint32_t count, const uint32_t (*triangle)[3], uint32_t points, uint8_t *rim)
{
    edge *edges = malloc(3 * (size_t)count * sizeof *edges + 1);
    assert_non_null(edges);
    uint32_t total = list_edges(count, triangle, edges), most = 0;
    memset(rim, 0, points);
    for (uint32_t i = 0, next; i < total; i = next) {
        for (next = i + 1; next < total && !compare_edges(&edges[i], &edges[next]);)
            next++;
        most = next - i > most ? next - i : most;
        if ((next - i) & 1)
            rim[edges[i].a] = rim[edges[i].b] = 1;
    }
    free(edges);
    return most;
}

static void check_rim(const run *r, uint32_t step, bool rim_moves_along_itself)
{
    uint32_t(*triangle)[3] = malloc(r->mesh.triangle_count * sizeof *triangle), points = r->mesh.point_count;
    uint8_t *rim = malloc(2 * (size_t)points);
    assert_non_null(triangle);
    assert_non_null(rim);
    uint32_t count = points_of_state(r, 0, triangle);
    mark_rim(count, (const uint32_t(*)[3])triangle, points, rim);
    for (uint32_t s = 0; s <= r->result.collapse_count; s += step) {
        count = points_of_state(r, s, triangle);
        uint32_t most = mark_rim(count, (const uint32_t(*)[3])triangle, points, rim + points);
        for (uint32_t p = 0; p < points; p++) {
            if (r->kind->closed && rim[points + p])
                fail_msg("%s, rung %d: after %u collapses an edge at point %u is open", r->kind->name, (int)r->desc.last_rung, s, p);
            if (rim_moves_along_itself && rim[points + p] && !rim[p])
                fail_msg("%s, rung %d: after %u collapses an open edge ends at point %u, which was no rim point", r->kind->name,
                         (int)r->desc.last_rung, s, p);
        }
        if (r->kind->manifold && r->desc.last_rung == STRL_SIMPLIFY_TOPOLOGY)
            assert_true(most <= 2);
    }
    free(triangle);
    free(rim);
}

static void closed_meshes_stay_closed_and_open_edges_end_at_the_rim(void **state)
{
    (void)state;
    for (const mesh_kind *kind = mesh_kinds; kind->name; kind++)
        for (int rung = STRL_SIMPLIFY_TOPOLOGY; rung <= STRL_SIMPLIFY_CLUSTERING; rung++) {
            run r;
            begin(&r, kind, 33, (strl_simplify_rung)rung);
            simplify(&r);
            check_rim(&r, r.result.collapse_count / 24 + 1, r.result.rung < STRL_SIMPLIFY_CLUSTERING);
            end(&r);
        }
}

/* Vertices less edges plus faces, which no collapse of the first rung may change. */
static int64_t euler_number(const run *r, uint32_t state)
{
    uint32_t(*triangle)[3] = malloc(r->mesh.triangle_count * sizeof *triangle);
    uint8_t *used = calloc(r->mesh.point_count, 1);
    assert_non_null(triangle);
    assert_non_null(used);
    uint32_t count = points_of_state(r, state, triangle), edge_count = 0;
    int64_t points = 0;
    edge *edges = malloc(3 * (size_t)count * sizeof *edges + 1);
    assert_non_null(edges);
    uint32_t total = list_edges(count, (const uint32_t(*)[3])triangle, edges);
    for (uint32_t i = 0; i < total; i++) {
        edge_count += i == 0 || compare_edges(&edges[i - 1], &edges[i]) != 0;
        used[edges[i].a] = used[edges[i].b] = 1;
    }
    for (uint32_t p = 0; p < r->mesh.point_count; p++)
        points += used[p];
    free(edges);
    free(triangle);
    free(used);
    return points - (int64_t)edge_count + count;
}

static void the_first_rung_keeps_the_topology(void **state)
{
    (void)state;
    for (const mesh_kind *kind = mesh_kinds; kind->name; kind++) {
        if (!kind->manifold)
            continue;
        run r;
        begin(&r, kind, 12, STRL_SIMPLIFY_TOPOLOGY);
        simplify(&r);
        assert_true(r.result.rung == STRL_SIMPLIFY_TOPOLOGY);
        assert_true(r.result.triangles_left < r.mesh.triangle_count);
        int64_t euler = euler_number(&r, 0);
        for (uint32_t i = 1; i <= STATES; i++)
            assert_int_equal(euler_number(&r, r.result.collapse_count * i / STATES), euler);
        end(&r);
    }
}

/* ---- what is made of the collapses ---- */
static int compare_faces(const void *a, const void *b)
{
    return memcmp(a, b, 9 * sizeof(int32_t));
}

/* Sorted triangles as positions, the least corner first. */
static int32_t (*faces_of(uint32_t count, const int32_t (*from)[3][3]))[9]
{
    int32_t(*faces)[9] = malloc(count * sizeof *faces + 1);
    assert_non_null(faces);
    for (uint32_t t = 0; t < count; t++) {
        unsigned least = 0;
        for (unsigned c = 1; c < 3; c++)
            if (memcmp(from[t][c], from[t][least], sizeof from[t][c]) < 0)
                least = c;
        for (unsigned c = 0; c < 3; c++)
            memcpy(faces[t] + 3 * c, from[t][(least + c) % 3], 3 * sizeof(int32_t));
    }
    qsort(faces, count, sizeof *faces, compare_faces);
    return faces;
}

static void assert_same_faces(uint32_t count, const int32_t (*a)[3][3], const int32_t (*b)[3][3])
{
    int32_t(*first)[9] = faces_of(count, a), (*second)[9] = faces_of(count, b);
    assert_memory_equal(first, second, count * sizeof *first);
    free(first);
    free(second);
}

static void check_recorded(run *r)
{
    const strl_palette_entry palette[2] = {{.part = 3, .rgba = 0xff00ff00u}, {.part = 4, .rgba = 0xffffffffu}};
    strl_error err = {0};
    strl_pm pm;
    strl_mesh base;
    if (strl_pm_record(&r->mesh, &r->result, palette, 2, &r->arena, &pm, &err) != STRL_OK || strl_pm_check(&pm, &err) != STRL_OK ||
        strl_mesh_after(&r->mesh, &r->result, NULL, &r->arena, &base, &err) != STRL_OK)
        fail_msg("%s, rung %d: %s", r->kind->name, (int)r->desc.last_rung, err.message);
    assert_int_equal(pm.step_count, r->result.collapse_count);
    assert_int_equal(pm.triangle_count, r->mesh.triangle_count);
    assert_int_equal(base.triangle_count, r->result.triangles_left);
    int32_t(*of_pm)[3][3] = malloc(pm.triangle_count * sizeof *of_pm), (*of_mesh)[3][3] = malloc(pm.triangle_count * sizeof *of_mesh);
    uint32_t(*points)[3] = malloc(pm.triangle_count * sizeof *points);
    assert_non_null(of_pm);
    assert_non_null(of_mesh);
    assert_non_null(points);
    for (uint32_t i = 0; i <= 6; i++) { /* state s of the progressive mesh is what is left after step_count - s collapses */
        uint32_t state = pm.step_count * i / 6, count = points_of_state(r, pm.step_count - state, points);
        assert_int_equal(pm.triangle_end[state], count);
        for (uint32_t t = 0; t < count; t++)
            for (int c = 0; c < 3; c++) {
                uint32_t v = pm.triangle[t][c];
                while (v >= pm.vertex_end[state])
                    v = pm.parent[v];
                memcpy(of_pm[t][c], pm.position[v], sizeof pm.position[v]);
                memcpy(of_mesh[t][c], r->mesh.position[points[t][c]], sizeof of_mesh[t][c]);
            }
        assert_same_faces(count, (const int32_t(*)[3][3])of_pm, (const int32_t(*)[3][3])of_mesh);
        if (i == 0) {
            for (uint32_t t = 0; t < count; t++)
                for (int c = 0; c < 3; c++)
                    memcpy(of_mesh[t][c], base.position[base.wedge[base.triangle[t][c]].point], sizeof of_mesh[t][c]);
            assert_same_faces(count, (const int32_t(*)[3][3])of_pm, (const int32_t(*)[3][3])of_mesh);
        }
    }
    free(of_pm);
    free(of_mesh);
    free(points);
}

/* ---- appearance ---- */
/* How far into the wrong side of the disc's edge a state has taken white or black, beyond what the start's own triangles blur. */
static double edge_moved(const run *r, uint32_t state)
{
    const double blur = 30; /* no triangle of the start is longer than this */
    double moved = 0;
    uint64_t random = 2;
    for (uint32_t t = 0; t < r->mesh.triangle_count; t++) {
        if (r->result.removed_at[t] < state)
            continue;
        double p[3][2], shade[3];
        for (int c = 0; c < 3; c++) {
            const strl_wedge *wedge = &r->mesh.wedge[resolve(r, r->mesh.triangle[t][c], state)];
            p[c][0] = r->mesh.position[wedge->point][0], p[c][1] = r->mesh.position[wedge->point][1];
            shade[c] = wedge->colour == 0xffffffffu;
        }
        for (int i = 0; i < 12; i++) {
            double a = mesh_below(&random, 1001) * 1e-3, b = (1 - a) * mesh_below(&random, 1001) * 1e-3, c = 1 - a - b;
            double radius = hypot(a * p[0][0] + b * p[1][0] + c * p[2][0], a * p[0][1] + b * p[1][1] + c * p[2][1]);
            bool white = a * shade[0] + b * shade[1] + c * shade[2] > 0.5;
            moved = fmax(moved, (white ? radius - 400 : 400 - radius) - blur);
        }
    }
    return moved;
}

static void the_edge_of_a_disc_moves_no_farther_than_claimed(void **state)
{
    (void)state;
    const mesh_kind disc = {.name = "disc", .make = mesh_make_disc, .manifold = true};
    for (int rung = STRL_SIMPLIFY_TOPOLOGY; rung <= STRL_SIMPLIFY_CLUSTERING; rung++) {
        run r;
        begin(&r, &disc, 3, (strl_simplify_rung)rung);
        r.desc.target_triangles = 40;
        simplify(&r);
        assert_true(r.result.triangles_left < r.mesh.triangle_count / 8);
        for (uint32_t i = 1; i <= STATES; i++) {
            uint32_t s = r.result.collapse_count * i / STATES;
            const strl_collapse *last = &r.result.collapses[s - 1];
            double claim = fmax((double)last->appearance, (double)last->geometric), moved = edge_moved(&r, s);
            if (moved > claim)
                fail_msg("rung %d, after %u of %u collapses (%u triangles): the edge moved by %g, the appearance error is %g", rung, s,
                         r.result.collapse_count, last->triangles_left, moved, claim);
        }
        end(&r);
    }
}

/* ---- targets ---- */
static void a_flat_square_needs_few_triangles(void **state)
{
    (void)state;
    run r;
    begin(&r, &mesh_kinds[2], 1, STRL_SIMPLIFY_TOPOLOGY);
    r.desc.error_limit = 0.01f;
    simplify(&r);
    uint32_t inner = 0;
    for (uint32_t p = 0; p < r.mesh.point_count; p++) { /* the jittered rim has some hundred points that count */
        int32_t x = (int32_t)(p % 21), y = (int32_t)(p / 21);
        inner += x && y && x != 20 && y != 20 && r.removed_by[p] == NEVER;
    }
    assert_true(inner <= 4);
    end(&r);
}

static void a_thousand_boxes_meet_their_target(void **state)
{
    (void)state;
    const mesh_kind boxes = {.name = "thousand boxes", .closed = true, .manifold = true};
    const uint32_t targets[] = {6000, 1500, 300, 40};
    for (unsigned i = 0; i < 4; i++) {
        run r = {.kind = &boxes, .desc = everything(STRL_SIMPLIFY_CLUSTERING)};
        strl_arena_init(&r.arena, 0);
        mesh_make_boxes(&r.mesh, 1000, 5, &r.arena);
        r.desc.target_triangles = targets[i];
        simplify(&r);
        assert_true(r.result.triangles_left <= targets[i]);
        assert_true(r.result.triangles_left > 0);
        assert_true(isfinite(r.result.geometric));
        check_order(&r);
        check_wedges(&r);
        check_rim(&r, r.result.collapse_count / 3 + 1, false);
        if (i == 2)
            measure(&r);
        end(&r);
    }
}

/* Cells so large that points merge onto others whose triangles are all gone by then. */
static void few_boxes_meet_small_targets(void **state)
{
    (void)state;
    const mesh_kind boxes = {.name = "few boxes", .closed = true, .manifold = true};
    for (uint64_t seed = 0; seed < 40; seed++) {
        run r = {.kind = &boxes, .desc = everything(STRL_SIMPLIFY_CLUSTERING)};
        strl_arena_init(&r.arena, 0);
        mesh_make_boxes(&r.mesh, 100 + (uint32_t)seed, seed, &r.arena);
        r.desc.target_triangles = 4 + (uint32_t)seed;
        if (seed & 1)
            keep_some(&r, seed);
        simplify(&r);
        check_order(&r);
        check_wedges(&r);
        check_rim(&r, r.result.collapse_count / 3 + 1, false);
        if (seed % 8 == 0)
            measure(&r);
        check_recorded(&r);
        end(&r);
    }
}

static void the_same_mesh_gives_the_same_collapses(void **state)
{
    (void)state;
    for (const mesh_kind *kind = mesh_kinds; kind->name; kind++) {
        run a, b;
        begin(&a, kind, 17, STRL_SIMPLIFY_CLUSTERING);
        begin(&b, kind, 17, STRL_SIMPLIFY_CLUSTERING);
        /* what lay in the arena before must not matter */
        void *dirt = strl_arena_alloc(&b.arena, 1 << 20, 1);
        assert_non_null(dirt);
        memset(dirt, 0xa5, 1 << 20);
        simplify(&a);
        simplify(&b);
        assert_int_equal(a.result.collapse_count, b.result.collapse_count);
        for (uint32_t i = 0; i < a.result.collapse_count; i++)
            assert_memory_equal(&a.result.collapses[i], &b.result.collapses[i], sizeof(strl_collapse));
        assert_memory_equal(a.result.wedge_parent, b.result.wedge_parent, a.mesh.wedge_count * sizeof(uint32_t));
        assert_memory_equal(a.result.removed_at, b.result.removed_at, a.mesh.triangle_count * sizeof(uint32_t));
        end(&a);
        end(&b);
    }
}

static void the_record_is_a_progressive_mesh_of_the_same_states(void **state)
{
    (void)state;
    for (const mesh_kind *kind = mesh_kinds; kind->name; kind++)
        for (int rung = STRL_SIMPLIFY_TOPOLOGY; rung <= STRL_SIMPLIFY_CLUSTERING; rung++) {
            run r;
            begin(&r, kind, 40, (strl_simplify_rung)rung);
            if (kind == mesh_kinds || kind->closed)
                mesh_add_seam(&r.mesh, rung & 1, 3, &r.arena);
            keep_some(&r, 8);
            simplify(&r);
            check_recorded(&r);
            end(&r);
        }
}

static void a_mesh_too_large_for_a_node_is_refused(void **state)
{
    (void)state;
    run r = {.desc = everything(STRL_SIMPLIFY_TOPOLOGY)};
    strl_arena_init(&r.arena, 0);
    mesh_make_boxes(&r.mesh, 8192, 5, &r.arena); /* 65,536 vertices */
    r.desc.target_triangles = r.mesh.triangle_count;
    strl_error err = {0};
    strl_pm pm;
    const strl_palette_entry palette = {0};
    simplify(&r);
    assert_int_equal(r.result.collapse_count, 0);
    assert_int_equal(strl_pm_record(&r.mesh, &r.result, &palette, 1, &r.arena, &pm, &err), STRL_ERR_LIMIT);
    assert_non_null(strstr(err.message, "65536"));
    end(&r);
}

/* ---- no memory ---- */
static strl_status simplify_and_record(run *r, strl_pm *pm, strl_error *err)
{
    const strl_palette_entry palette = {0};
    strl_mesh base;
    strl_status status = strl_simplify(&r->mesh, &r->desc, &r->arena, &r->result, err);
    if (!status)
        status = strl_pm_record(&r->mesh, &r->result, &palette, 1, &r->arena, pm, err);
    return status ? status : strl_mesh_after(&r->mesh, &r->result, NULL, &r->arena, &base, err);
}

static void each_failed_allocation_is_one_clean_failure(void **state)
{
    (void)state;
    for (uint32_t boxes = 400; boxes <= 4000; boxes *= 10) {
        uint64_t failures = 0;
        for (uint64_t n = 1;; n++) {
            run r = {.desc = everything(STRL_SIMPLIFY_CLUSTERING)};
            strl_error err = {0};
            strl_pm pm;
            strl_arena_init(&r.arena, 0);
            mesh_make_boxes(&r.mesh, boxes, 1, &r.arena);
            r.desc.target_triangles = r.mesh.triangle_count / 3;
            strl__alloc_fail_after(n);
            strl_status status = simplify_and_record(&r, &pm, &err);
            strl__alloc_fail_after(0);
            end(&r);
            if (!status)
                break;
            failures++;
            assert_int_equal(status, STRL_ERR_MEMORY);
            assert_int_equal(err.status, STRL_ERR_MEMORY);
            assert_true(strlen(err.message) > 0);
            assert_true(n < 1000);
        }
        assert_true(failures >= (boxes == 400 ? 4 : 16));
    }
    for (size_t limit = 1 << 20;; limit += 64 << 10) { /* an arena's limit cuts at other places than its blocks do */
        run r = {.desc = everything(STRL_SIMPLIFY_CLUSTERING)};
        strl_error err = {0};
        strl_pm pm;
        strl_arena_init(&r.arena, 0);
        mesh_make_boxes(&r.mesh, 500, 1, &r.arena);
        r.desc.target_triangles = r.mesh.triangle_count / 3;
        r.arena.limit_bytes = limit;
        strl_status status = simplify_and_record(&r, &pm, &err);
        end(&r);
        if (!status)
            break;
        assert_int_equal(status, STRL_ERR_MEMORY);
        assert_true(limit < (size_t)64 << 20);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_search_tree_finds_what_a_look_at_every_triangle_finds),
        cmocka_unit_test(no_state_is_farther_from_the_start_than_it_claims),
        cmocka_unit_test(claims_hold_over_several_meshes),
        cmocka_unit_test(an_error_at_the_start_is_added_to),
        cmocka_unit_test(errors_and_counts_go_one_way_and_kept_points_stay),
        cmocka_unit_test(seams_have_parents_of_their_own_palette),
        cmocka_unit_test(the_limits_that_are_asked_for_hold),
        cmocka_unit_test(closed_meshes_stay_closed_and_open_edges_end_at_the_rim),
        cmocka_unit_test(the_first_rung_keeps_the_topology),
        cmocka_unit_test(the_edge_of_a_disc_moves_no_farther_than_claimed),
        cmocka_unit_test(a_flat_square_needs_few_triangles),
        cmocka_unit_test(a_thousand_boxes_meet_their_target),
        cmocka_unit_test(few_boxes_meet_small_targets),
        cmocka_unit_test(the_same_mesh_gives_the_same_collapses),
        cmocka_unit_test(the_record_is_a_progressive_mesh_of_the_same_states),
        cmocka_unit_test(a_mesh_too_large_for_a_node_is_refused),
        cmocka_unit_test(each_failed_allocation_is_one_clean_failure),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
