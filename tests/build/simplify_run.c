#include "build/simplify_run.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

strl_simplify_desc run_desc(strl_simplify_rung last)
{
    return (strl_simplify_desc){
        .target_triangles = 4, .error_limit = INFINITY, .last_rung = last, .normal_weight = 0.25f, .colour_weight = 1};
}

static void index_collapses(run *r)
{
    r->removed_by = strl_arena_alloc(&r->arena, r->mesh.point_count, sizeof *r->removed_by);
    assert_non_null(r->removed_by);
    memset(r->removed_by, 0xff, r->mesh.point_count * sizeof *r->removed_by);
    for (uint32_t i = 0; i < r->result.collapse_count; i++) {
        const strl_collapse *collapse = &r->result.collapses[i];
        assert_true(collapse->from < r->mesh.point_count && collapse->to < r->mesh.point_count);
        assert_int_equal(r->removed_by[collapse->from], RUN_NEVER);
        r->removed_by[collapse->from] = i;
    }
}

void run_simplify(run *r)
{
    strl_error err = {0};
    if (strl_simplify(&r->mesh, &r->desc, &r->arena, &r->result, &err) != STRL_OK)
        fail_msg("%s: %s", r->kind ? r->kind->name : "mesh", err.message);
    index_collapses(r);
}

void run_begin(run *r, const mesh_kind *kind, uint64_t seed, strl_simplify_rung last)
{
    *r = (run){.kind = kind, .desc = run_desc(last)};
    strl_arena_init(&r->arena, 0);
    kind->make(&r->mesh, seed, &r->arena);
}

void run_end(run *r)
{
    strl_arena_deinit(&r->arena);
}

void run_keep_some(run *r, uint64_t seed)
{
    for (uint32_t p = 0; p < r->mesh.point_count; p++)
        if (mesh_below(&seed, 8) == 0)
            r->mesh.flags[p] |= STRL_POINT_KEPT;
}

uint32_t run_resolve(const run *r, uint32_t wedge, uint32_t state)
{
    while (r->removed_by[r->result.wedge[wedge].point] < state) {
        assert_int_not_equal(r->result.wedge_parent[wedge], wedge);
        wedge = r->result.wedge_parent[wedge];
    }
    return wedge;
}

uint32_t run_points_of_state(const run *r, uint32_t state, uint32_t (*triangle)[3])
{
    uint32_t count = 0;
    for (uint32_t t = 0; t < r->mesh.triangle_count; t++) {
        if (r->result.removed_at[t] < state)
            continue;
        for (int c = 0; c < 3; c++)
            triangle[count][c] = r->result.wedge[run_resolve(r, r->mesh.triangle[t][c], state)].point;
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

double (*run_corners_of_mesh(const strl_mesh *mesh))[3][3]
{
    double(*corner)[3][3] = malloc(mesh->triangle_count * sizeof *corner);
    assert_non_null(corner);
    for (uint32_t i = 0; i < 9 * mesh->triangle_count; i++)
        corner[i / 9][i / 3 % 3][i % 3] = mesh->position[mesh->wedge[mesh->triangle[i / 9][i / 3 % 3]].point][i % 3];
    return corner;
}

void run_compare(const run *r, uint32_t seed, const surface *start, const double (*corner)[3][3], uint32_t count,
                 double claim)
{
    surface now;
    assert_true(count > 0);
    surface_create(&now, count, corner);
    double limit = claim * (1 + 1e-5) + 1e-6;
    double away = surface_reach(start, count, corner, 6, seed);
    double lost = surface_reach(&now, start->count, (const double(*)[3][3])start->corner, 6, seed + 77);
    if (away > limit || lost > limit)
        fail_msg("%s, rung %d, state %u: the claim is %g, but the new surface reaches %g from the old and "
                 "the old %g from the new",
                 r->kind->name, (int)r->desc.last_rung, seed, claim, away, lost);
    surface_destroy(&now);
}

void run_compare_with_start(const run *r, uint32_t state, const surface *start, double spare)
{
    uint32_t(*triangle)[3] = malloc(r->mesh.triangle_count * sizeof *triangle);
    double(*corner)[3][3] = malloc(r->mesh.triangle_count * sizeof *corner);
    assert_non_null(triangle);
    assert_non_null(corner);
    uint32_t count = run_points_of_state(r, state, triangle);
    corners_of(&r->mesh, count, (const uint32_t(*)[3])triangle, corner);
    run_compare(r, state, start, (const double(*)[3][3])corner, count,
                state ? (double)r->result.collapses[state - 1].geometric - spare : 0);
    free(triangle);
    free(corner);
}

void run_measure(const run *r)
{
    double(*corner)[3][3] = run_corners_of_mesh(&r->mesh);
    surface start;
    surface_create(&start, r->mesh.triangle_count, (const double(*)[3][3])corner);
    for (uint32_t i = 1; i <= RUN_STATES; i++)
        run_compare_with_start(r, r->result.collapse_count * i / RUN_STATES, &start, 0);
    surface_destroy(&start);
    free(corner);
}

void run_check_order(const run *r)
{
    float geometric = 0, appearance = 0;
    uint32_t triangles = r->mesh.triangle_count;
    uint32_t *removed = calloc(r->result.collapse_count + 1, sizeof *removed);
    assert_non_null(removed);
    for (uint32_t t = 0; t < r->mesh.triangle_count; t++)
        if (r->result.removed_at[t] != RUN_NEVER) {
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

void run_check_wedges(const run *r)
{
    for (uint32_t w = 0; w < r->result.wedge_count; w++) {
        uint32_t parent = r->result.wedge_parent[w], at = r->removed_by[r->result.wedge[w].point];
        assert_true(parent < r->result.wedge_count);
        if (parent == w)
            continue;
        assert_int_not_equal(at, RUN_NEVER);
        assert_int_equal(r->result.wedge[parent].point, r->result.collapses[at].to);
        if (r->result.rung < STRL_SIMPLIFY_DISJOINT)
            assert_int_equal(r->result.wedge[parent].palette, r->result.wedge[w].palette);
    }
    for (uint32_t t = 0; t < r->mesh.triangle_count; t++)
        for (int c = 0; c < 3 && r->result.removed_at[t] == RUN_NEVER; c++)
            assert_int_equal(r->result.corner[t][c], run_resolve(r, r->mesh.triangle[t][c], r->result.collapse_count));
}
