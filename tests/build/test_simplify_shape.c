/* What kind of mesh every state is: closed where the start was, whole, a progressive mesh, down to its target. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "build/simplify_run.h"
#include "geometry/record.h"

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
    uint32_t count = run_points_of_state(r, 0, triangle);
    mark_rim(count, (const uint32_t(*)[3])triangle, points, rim);
    for (uint32_t s = 0; s <= r->result.collapse_count; s += step) {
        count = run_points_of_state(r, s, triangle);
        uint32_t most = mark_rim(count, (const uint32_t(*)[3])triangle, points, rim + points);
        for (uint32_t p = 0; p < points; p++) {
            if (r->kind->closed && rim[points + p])
                fail_msg("%s, rung %d: after %u collapses an edge at point %u is open", r->kind->name,
                         (int)r->desc.last_rung, s, p);
            if (rim_moves_along_itself && rim[points + p] && !rim[p])
                fail_msg("%s, rung %d: after %u collapses an open edge ends at point %u, which was no rim point",
                         r->kind->name, (int)r->desc.last_rung, s, p);
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
            run_begin(&r, kind, 33, (strl_simplify_rung)rung);
            run_simplify(&r);
            check_rim(&r, r.result.collapse_count / 24 + 1, r.result.rung < STRL_SIMPLIFY_CLUSTERING);
            run_end(&r);
        }
}

/* Vertices less edges plus faces, which no collapse of the first rung may change. */
static int64_t euler_number(const run *r, uint32_t state)
{
    uint32_t(*triangle)[3] = malloc(r->mesh.triangle_count * sizeof *triangle);
    uint8_t *used = calloc(r->mesh.point_count, 1);
    assert_non_null(triangle);
    assert_non_null(used);
    uint32_t count = run_points_of_state(r, state, triangle), edge_count = 0;
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
        run_begin(&r, kind, 12, STRL_SIMPLIFY_TOPOLOGY);
        run_simplify(&r);
        assert_true(r.result.rung == STRL_SIMPLIFY_TOPOLOGY);
        assert_true(r.result.triangles_left < r.mesh.triangle_count);
        int64_t euler = euler_number(&r, 0);
        for (uint32_t i = 1; i <= RUN_STATES; i++)
            assert_int_equal(euler_number(&r, r.result.collapse_count * i / RUN_STATES), euler);
        run_end(&r);
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
    if (strl_pm_record(&r->mesh, &r->result, palette, 2, &r->arena, &pm, &err) != STRL_OK ||
        strl_pm_check(&pm, &err) != STRL_OK ||
        strl_mesh_after(&r->mesh, &r->result, NULL, &r->arena, &base, &err) != STRL_OK)
        fail_msg("%s, rung %d: %s", r->kind->name, (int)r->desc.last_rung, err.message);
    assert_int_equal(pm.step_count, r->result.collapse_count);
    assert_int_equal(pm.triangle_count, r->mesh.triangle_count);
    assert_int_equal(base.triangle_count, r->result.triangles_left);
    int32_t(*of_pm)[3][3] = malloc(pm.triangle_count * sizeof *of_pm),
    (*of_mesh)[3][3] = malloc(pm.triangle_count * sizeof *of_mesh);
    uint32_t(*points)[3] = malloc(pm.triangle_count * sizeof *points);
    assert_non_null(of_pm);
    assert_non_null(of_mesh);
    assert_non_null(points);
    for (uint32_t i = 0; i <= 6;
         i++) { /* state s of the progressive mesh is what is left after step_count - s collapses */
        uint32_t state = pm.step_count * i / 6, count = run_points_of_state(r, pm.step_count - state, points);
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

/* ---- targets ---- */
static void a_flat_square_needs_few_triangles(void **state)
{
    (void)state;
    run r;
    run_begin(&r, &mesh_kinds[2], 1, STRL_SIMPLIFY_TOPOLOGY);
    r.desc.error_limit = 0.01f;
    run_simplify(&r);
    uint32_t inner = 0;
    for (uint32_t p = 0; p < r.mesh.point_count; p++) { /* the jittered rim has some hundred points that count */
        int32_t x = (int32_t)(p % 21), y = (int32_t)(p / 21);
        inner += x && y && x != 20 && y != 20 && r.removed_by[p] == RUN_NEVER;
    }
    assert_true(inner <= 4);
    run_end(&r);
}

static void a_thousand_boxes_meet_their_target(void **state)
{
    (void)state;
    const mesh_kind boxes = {.name = "thousand boxes", .closed = true, .manifold = true};
    const uint32_t targets[] = {6000, 1500, 300, 40};
    for (unsigned i = 0; i < 4; i++) {
        run r = {.kind = &boxes, .desc = run_desc(STRL_SIMPLIFY_CLUSTERING)};
        strl_arena_init(&r.arena, 0);
        mesh_make_boxes(&r.mesh, 1000, 5, &r.arena);
        r.desc.target_triangles = targets[i];
        run_simplify(&r);
        assert_true(r.result.triangles_left <= targets[i]);
        assert_true(r.result.triangles_left > 0);
        assert_true(isfinite(r.result.geometric));
        run_check_order(&r);
        run_check_wedges(&r);
        check_rim(&r, r.result.collapse_count / 3 + 1, false);
        if (i == 2)
            run_measure(&r);
        run_end(&r);
    }
}

/* Cells so large that points merge onto others whose triangles are all gone by then. */
static void few_boxes_meet_small_targets(void **state)
{
    (void)state;
    const mesh_kind boxes = {.name = "few boxes", .closed = true, .manifold = true};
    for (uint64_t seed = 0; seed < 40; seed++) {
        run r = {.kind = &boxes, .desc = run_desc(STRL_SIMPLIFY_CLUSTERING)};
        strl_arena_init(&r.arena, 0);
        mesh_make_boxes(&r.mesh, 100 + (uint32_t)seed, seed, &r.arena);
        r.desc.target_triangles = 4 + (uint32_t)seed;
        if (seed & 1)
            run_keep_some(&r, seed);
        run_simplify(&r);
        run_check_order(&r);
        run_check_wedges(&r);
        check_rim(&r, r.result.collapse_count / 3 + 1, false);
        if (seed % 8 == 0)
            run_measure(&r);
        check_recorded(&r);
        run_end(&r);
    }
}

static void the_same_mesh_gives_the_same_collapses(void **state)
{
    (void)state;
    for (const mesh_kind *kind = mesh_kinds; kind->name; kind++) {
        run a, b;
        run_begin(&a, kind, 17, STRL_SIMPLIFY_CLUSTERING);
        run_begin(&b, kind, 17, STRL_SIMPLIFY_CLUSTERING);
        /* what lay in the arena before must not matter */
        void *dirt = strl_arena_alloc(&b.arena, 1 << 20, 1);
        assert_non_null(dirt);
        memset(dirt, 0xa5, 1 << 20);
        run_simplify(&a);
        run_simplify(&b);
        assert_int_equal(a.result.collapse_count, b.result.collapse_count);
        for (uint32_t i = 0; i < a.result.collapse_count; i++)
            assert_memory_equal(&a.result.collapses[i], &b.result.collapses[i], sizeof(strl_collapse));
        assert_memory_equal(a.result.wedge_parent, b.result.wedge_parent, a.mesh.wedge_count * sizeof(uint32_t));
        assert_memory_equal(a.result.removed_at, b.result.removed_at, a.mesh.triangle_count * sizeof(uint32_t));
        run_end(&a);
        run_end(&b);
    }
}

static void the_record_is_a_progressive_mesh_of_the_same_states(void **state)
{
    (void)state;
    for (const mesh_kind *kind = mesh_kinds; kind->name; kind++)
        for (int rung = STRL_SIMPLIFY_TOPOLOGY; rung <= STRL_SIMPLIFY_CLUSTERING; rung++) {
            run r;
            run_begin(&r, kind, 40, (strl_simplify_rung)rung);
            if (kind == mesh_kinds || kind->closed)
                mesh_add_seam(&r.mesh, rung & 1, 3, &r.arena);
            run_keep_some(&r, 8);
            run_simplify(&r);
            check_recorded(&r);
            run_end(&r);
        }
}

static void a_mesh_too_large_for_a_node_is_refused(void **state)
{
    (void)state;
    run r = {.desc = run_desc(STRL_SIMPLIFY_TOPOLOGY)};
    strl_arena_init(&r.arena, 0);
    mesh_make_boxes(&r.mesh, 8192, 5, &r.arena); /* 65,536 vertices */
    r.desc.target_triangles = r.mesh.triangle_count;
    strl_error err = {0};
    strl_pm pm;
    const strl_palette_entry palette = {0};
    run_simplify(&r);
    assert_int_equal(r.result.collapse_count, 0);
    assert_int_equal(strl_pm_record(&r.mesh, &r.result, &palette, 1, &r.arena, &pm, &err), STRL_ERR_LIMIT);
    assert_non_null(strstr(err.message, "65536"));
    run_end(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(closed_meshes_stay_closed_and_open_edges_end_at_the_rim),
        cmocka_unit_test(the_first_rung_keeps_the_topology),
        cmocka_unit_test(a_flat_square_needs_few_triangles),
        cmocka_unit_test(a_thousand_boxes_meet_their_target),
        cmocka_unit_test(few_boxes_meet_small_targets),
        cmocka_unit_test(the_same_mesh_gives_the_same_collapses),
        cmocka_unit_test(the_record_is_a_progressive_mesh_of_the_same_states),
        cmocka_unit_test(a_mesh_too_large_for_a_node_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
