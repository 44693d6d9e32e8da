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
#include "build/simplify_run.h"
#include "geometry/record.h"

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
            run_begin(&r, kind, (uint64_t)rung + 3, (strl_simplify_rung)rung);
            if (rung & 1)
                run_keep_some(&r, 9);
            run_simplify(&r);
            run_measure(&r);
            run_end(&r);
        }
}

/* Level upon level: what is left of one mesh is the start of the next, and what it claims is about the first. */
static void claims_hold_over_several_meshes(void **state)
{
    (void)state;
    for (const mesh_kind *kind = mesh_kinds; kind->name; kind++) {
        run r;
        strl_error err = {0};
        run_begin(&r, kind, 14, STRL_SIMPLIFY_SEAMS);
        uint32_t first_count = r.mesh.triangle_count;
        double(*first)[3][3] = run_corners_of_mesh(&r.mesh);
        surface start;
        surface_create(&start, first_count, (const double(*)[3][3])first);
        for (uint32_t level = 1; level <= 4; level++) {
            strl_mesh left;
            for (uint32_t p = 0; p < r.mesh.point_count; p++) /* other points are locked at each level */
                r.mesh.flags[p] = strl__mix64(p + level) % 5 == 0 ? STRL_POINT_KEPT : 0;
            r.desc.target_triangles = r.mesh.triangle_count / 2;
            r.desc.last_rung = level == 4 ? STRL_SIMPLIFY_CLUSTERING : STRL_SIMPLIFY_SEAMS;
            run_simplify(&r);
            run_check_order(&r);
            if (strl_mesh_after(&r.mesh, &r.result, NULL, &r.arena, &left, &err) != STRL_OK)
                fail_msg("%s", err.message);
            float before = r.result.geometric;
            r.mesh = left;
            double(*corner)[3][3] = run_corners_of_mesh(&left);
            run_compare(&r, level, &start, (const double(*)[3][3])corner, left.triangle_count, (double)before);
            free(corner);
        }
        surface_destroy(&start);
        free(first);
        run_end(&r);
    }
}

static void an_error_at_the_start_is_added_to(void **state)
{
    (void)state;
    for (const mesh_kind *kind = mesh_kinds; kind->name; kind++) {
        run r;
        run_begin(&r, kind, 1, STRL_SIMPLIFY_SEAMS);
        mesh_begin_with_error(&r.mesh, 30);
        run_simplify(&r);
        assert_true(r.result.collapse_count > 0);
        double(*corner)[3][3] = run_corners_of_mesh(&r.mesh);
        surface start;
        surface_create(&start, r.mesh.triangle_count, (const double(*)[3][3])corner);
        for (uint32_t i = 0; i < r.result.collapse_count; i++)
            assert_true(r.result.collapses[i].geometric >= 30);
        for (uint32_t i = 1; i <= RUN_STATES; i++)
            run_compare_with_start(&r, r.result.collapse_count * i / RUN_STATES, &start, 30);
        surface_destroy(&start);
        free(corner);
        run_end(&r);
    }
}

static void errors_and_counts_go_one_way_and_kept_points_stay(void **state)
{
    (void)state;
    for (const mesh_kind *kind = mesh_kinds; kind->name; kind++)
        for (int rung = STRL_SIMPLIFY_TOPOLOGY; rung <= STRL_SIMPLIFY_CLUSTERING; rung++) {
            run r;
            run_begin(&r, kind, 21, (strl_simplify_rung)rung);
            run_keep_some(&r, 4);
            run_simplify(&r);
            assert_true(r.result.collapse_count > 0);
            assert_true((int)r.result.rung <= rung);
            run_check_order(&r);
            run_check_wedges(&r);
            run_end(&r);
        }
}

static void seams_have_parents_of_their_own_palette(void **state)
{
    (void)state;
    for (int other_palette = 0; other_palette < 2; other_palette++)
        for (int rung = STRL_SIMPLIFY_TOPOLOGY; rung <= STRL_SIMPLIFY_CLUSTERING; rung++)
            for (int sphere = 0; sphere < 2; sphere++) {
                run r;
                run_begin(&r, &mesh_kinds[sphere ? 3 : 0], 2, (strl_simplify_rung)rung);
                uint32_t points = r.mesh.point_count;
                mesh_add_seam(&r.mesh, other_palette, 8, &r.arena);
                assert_true(r.mesh.wedge_count > points + 5);
                run_simplify(&r);
                run_check_order(&r);
                run_check_wedges(&r);
                run_measure(&r);
                run_end(&r);
            }
}

/* The new surface and the start lie in one box, so no claim needs to pass its diagonal; and what is claimed there is
 * true. */
static void no_claim_passes_the_diagonal_that_is_given(void **state)
{
    (void)state;
    unsigned stopped = 0;
    for (const mesh_kind *kind = mesh_kinds; kind->name; kind++) {
        run r;
        run_begin(&r, kind, 9, STRL_SIMPLIFY_CLUSTERING);
        double squared = 0;
        for (int k = 0; k < 3; k++) {
            double least = r.mesh.position[0][k], most = least;
            for (uint32_t p = 1; p < r.mesh.point_count; p++) {
                least = fmin(least, r.mesh.position[p][k]);
                most = fmax(most, r.mesh.position[p][k]);
            }
            squared += (most - least) * (most - least);
        }
        r.mesh.most_error = nextafterf((float)sqrt(squared), INFINITY);
        run_simplify(&r);
        assert_true(r.result.geometric <= r.mesh.most_error * 1.00001f &&
                    r.result.appearance <= r.mesh.most_error * 1.00001f);
        stopped += r.result.geometric >= r.mesh.most_error || r.result.appearance >= r.mesh.most_error;
        run_check_order(&r);
        run_measure(&r);
        run_end(&r);
    }
    assert_true(stopped > 0); /* some would have claimed more */
}

static void the_limits_that_are_asked_for_hold(void **state)
{
    (void)state;
    for (const mesh_kind *kind = mesh_kinds; kind->name; kind++) {
        run r;
        run_begin(&r, kind, 6, STRL_SIMPLIFY_CLUSTERING);
        r.desc.target_triangles = r.mesh.triangle_count / 2;
        run_simplify(&r);
        assert_true(r.result.triangles_left <= r.desc.target_triangles);
        /* and no farther than that, but for what costs nothing */
        if (r.result.collapse_count > 1 && r.result.geometric > 0)
            assert_true(r.result.collapses[r.result.collapse_count - 2].triangles_left > r.desc.target_triangles);
        run_end(&r);
        run_begin(&r, kind, 6, STRL_SIMPLIFY_CLUSTERING);
        r.desc.error_limit = 25;
        run_simplify(&r);
        assert_true(r.result.geometric <= 25 && r.result.appearance <= 25);
        run_end(&r);
    }
}

/* ---- appearance ---- */
/* How far into the wrong side of the disc's edge a state has taken white or black, beyond what the start's own
 * triangles blur. */
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
            const strl_wedge *wedge = &r->result.wedge[run_resolve(r, r->mesh.triangle[t][c], state)];
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
        run_begin(&r, &disc, 3, (strl_simplify_rung)rung);
        r.desc.target_triangles = 40;
        run_simplify(&r);
        assert_true(r.result.triangles_left < r.mesh.triangle_count / 8);
        for (uint32_t i = 1; i <= RUN_STATES; i++) {
            uint32_t s = r.result.collapse_count * i / RUN_STATES;
            const strl_collapse *last = &r.result.collapses[s - 1];
            double claim = fmax((double)last->appearance, (double)last->geometric), moved = edge_moved(&r, s);
            if (moved > claim)
                fail_msg("rung %d, after %u of %u collapses (%u triangles): the edge moved by %g, the "
                         "appearance error is %g",
                         rung, s, r.result.collapse_count, last->triangles_left, moved, claim);
        }
        run_end(&r);
    }
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
            run r = {.desc = run_desc(STRL_SIMPLIFY_CLUSTERING)};
            strl_error err = {0};
            strl_pm pm;
            strl_arena_init(&r.arena, 0);
            mesh_make_boxes(&r.mesh, boxes, 1, &r.arena);
            r.desc.target_triangles = r.mesh.triangle_count / 3;
            strl__alloc_fail_after(n);
            strl_status status = simplify_and_record(&r, &pm, &err);
            strl__alloc_fail_after(0);
            run_end(&r);
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
        run r = {.desc = run_desc(STRL_SIMPLIFY_CLUSTERING)};
        strl_error err = {0};
        strl_pm pm;
        strl_arena_init(&r.arena, 0);
        mesh_make_boxes(&r.mesh, 500, 1, &r.arena);
        r.desc.target_triangles = r.mesh.triangle_count / 3;
        r.arena.limit_bytes = limit;
        strl_status status = simplify_and_record(&r, &pm, &err);
        run_end(&r);
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
        cmocka_unit_test(no_claim_passes_the_diagonal_that_is_given),
        cmocka_unit_test(the_limits_that_are_asked_for_hold),
        cmocka_unit_test(the_edge_of_a_disc_moves_no_farther_than_claimed),
        cmocka_unit_test(each_failed_allocation_is_one_clean_failure),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
