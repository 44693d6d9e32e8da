/* Certificates are bounds, whatever the mesh, the state and the older surface; and they are tight where they can be. */
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
#include "geometry/certify.h"
#include "geometry/near.h"

#define MANY 40u

/* ---- one triangle against others ---- */

static void random_facet(uint64_t *random, uint32_t size, strl_facet *facet)
{
    double corner[3][3], at[3];
    for (int k = 0; k < 3; k++)
        at[k] = mesh_below(random, 400);
    for (int i = 0; i < 9; i++)
        corner[i / 3][i % 3] = at[i % 3] + mesh_below(random, size);
    unsigned kind = mesh_below(random, 12);
    if (kind == 0) /* a line, a point */
        memcpy(corner[2], corner[1], sizeof corner[2]);
    if (kind == 1)
        memcpy(corner[1], corner[0], sizeof corner[1]), memcpy(corner[2], corner[0], sizeof corner[2]);
    strl_facet_set(facet, corner[0], corner[1], corner[2]);
    facet->claim = mesh_below(random, 3) ? 0 : mesh_below(random, 20);
}

static double distance_of_point(const strl_facet *facet, uint32_t count, const double p[3])
{
    double least = INFINITY;
    for (uint32_t i = 0; i < count; i++)
        least = fmin(least, surface_distance_slow(1, (const double(*)[3][3]) & facet[i].corner, p) + facet[i].claim);
    return least;
}

/* The largest distance over a grid of points of the triangle. */
static double sampled_distance(const strl_facet *triangle, const strl_facet *by, uint32_t count)
{
    double most = 0;
    for (int i = 0; i <= 10; i++)
        for (int j = 0; i + j <= 10; j++) {
            double p[3];
            for (int k = 0; k < 3; k++)
                p[k] = triangle->corner[0][k] + i / 10. * (triangle->corner[1][k] - triangle->corner[0][k]) +
                       j / 10. * (triangle->corner[2][k] - triangle->corner[0][k]);
            most = fmax(most, distance_of_point(by, count, p));
        }
    return most;
}

static void no_point_of_a_triangle_is_farther_than_the_bound(void **state)
{
    (void)state;
    uint64_t random = 31;
    strl_facet triangle, by[MANY];
    for (int round = 0; round < 400; round++) {
        uint32_t count = 1 + mesh_below(&random, MANY);
        random_facet(&random, 200, &triangle);
        for (uint32_t i = 0; i < count; i++)
            random_facet(&random, 1 + mesh_below(&random, 200), &by[i]);
        double along[3] = {mesh_below(&random, 9) - 4., mesh_below(&random, 9) - 4., mesh_below(&random, 9) - 4.};
        double true_least = sampled_distance(&triangle, by, count);
        strl_cover cover = {
            .by = by, .count = count, .along = round & 1 ? along : NULL, .enough = round % 3 ? 0 : 2 * true_least};
        double bound = strl_cover_bound(&triangle, &cover);
        if (bound < true_least - 1e-9)
            fail_msg("round %d: the bound is %g, a point is %g away", round, bound, true_least);
    }
    assert_true(isinf(strl_cover_bound(&triangle, &(strl_cover){.by = by, .count = 0})));
}

static void a_triangle_over_a_plane_in_pieces_is_measured_to_a_twentieth(void **state)
{
    (void)state;
    strl_facet by[32], triangle;
    uint32_t count = 0;
    for (int x = 0; x < 4; x++)
        for (int y = 0; y < 4; y++) { /* a roof over y = 2, of 32 triangles */
            double z[2] = {fabs(y - 2.), fabs(y - 1.)};
            const double p[4][3] = {{x, y, z[0]}, {x + 1, y, z[0]}, {x + 1, y + 1, z[1]}, {x, y + 1, z[1]}};
            strl_facet_set(&by[count++], p[0], p[1], p[2]);
            strl_facet_set(&by[count++], p[0], p[2], p[3]);
        }
    for (uint32_t i = 0; i < count; i++)
        by[i].claim = 0;
    const double flat[3][3] = {{0.5, 0.2, 0.3}, {3.5, 0.2, 0.3}, {2, 3.8, 0.3}};
    strl_facet_set(&triangle, flat[0], flat[1], flat[2]);
    double most = sampled_distance(&triangle, by, count),
           bound = strl_cover_bound(&triangle, &(strl_cover){.by = by, .count = count});
    assert_true(bound >= most - 1e-12 && bound <= most * 1.06 + 1e-9);
}

static void the_tree_finds_what_a_look_at_every_facet_finds(void **state)
{
    (void)state;
    uint64_t random = 8;
    strl_facet facet[300];
    uint32_t order[300], leaf[300], found[300];
    strl_near_node nodes[599];
    for (int i = 0; i < 300; i++)
        random_facet(&random, 60, &facet[i]), facet[i].claim = 0;
    strl_near tree = {facet, order, leaf, nodes};
    strl_near_build(&tree, 300);
    for (int round = 0; round < 200; round++) {
        double p[3], distance;
        for (int k = 0; k < 3; k++)
            p[k] = (double)mesh_below(&random, 800) - 200;
        strl_near_find(&tree, p, mesh_below(&random, 300), &distance);
        assert_true(fabs(distance - distance_of_point(facet, 300, p)) < 1e-9);
        uint32_t moved = mesh_below(&random, 300), reach = mesh_below(&random, 50), meets = 0;
        random_facet(&random, 90, &facet[moved]);
        facet[moved].claim = 0;
        strl_near_update(&tree, moved);
        for (int i = 0; i < 300; i++) {
            bool does = true;
            for (int k = 0; k < 3; k++)
                does = does && facet[i].least[k] <= facet[0].most[k] + reach &&
                       facet[i].most[k] >= facet[0].least[k] - reach;
            meets += does;
        }
        assert_int_equal(strl_near_list(&tree, &facet[0], reach, found, 300), meets);
    }
}

/* ---- meshes ---- */

static strl_piece *pieces_of(const strl_mesh *mesh, float claim)
{
    strl_piece *piece = malloc(mesh->triangle_count * sizeof *piece);
    assert_non_null(piece);
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        for (int c = 0; c < 3; c++)
            memcpy(piece[t].corner[c], mesh->position[mesh->wedge[mesh->triangle[t][c]].point],
                   sizeof piece[t].corner[c]);
        piece[t].claim = claim;
    }
    return piece;
}

static strl_certificate certify(run *r, const strl_piece *piece, uint32_t count)
{
    strl_certificate certificate;
    strl_error err = {0};
    if (strl_certify(&r->mesh, &r->result, &(strl_older){.piece = piece, .own = count, .count = count}, &r->arena,
                     &certificate, &err) != STRL_OK)
        fail_msg("%s", err.message);
    for (uint32_t i = 1; i <= r->result.collapse_count; i++)
        assert_true(certificate.down[i] >= certificate.down[i - 1] && certificate.up[i] >= certificate.up[i - 1]);
    return certificate;
}

/* Both ways at some states, by points. Returns the largest distance at the end. */
static double measure(const run *r, const strl_certificate *certificate, double spare)
{
    double(*start_corner)[3][3] = run_corners_of_mesh(&r->mesh), last = 0;
    double(*corner)[3][3] = malloc(r->mesh.triangle_count * sizeof *corner);
    uint32_t(*triangle)[3] = malloc(r->mesh.triangle_count * sizeof *triangle);
    surface start, now;
    assert_non_null(corner);
    assert_non_null(triangle);
    surface_create(&start, r->mesh.triangle_count, (const double(*)[3][3])start_corner);
    for (uint32_t i = 0; i <= RUN_STATES; i++) {
        uint32_t s = r->result.collapse_count * i / RUN_STATES, count = run_points_of_state(r, s, triangle);
        for (uint32_t j = 0; j < 9 * count; j++)
            corner[j / 9][j / 3 % 3][j % 3] = r->mesh.position[triangle[j / 9][j / 3 % 3]][j % 3];
        surface_create(&now, count, (const double(*)[3][3])corner);
        double up = surface_reach(&start, count, (const double(*)[3][3])corner, 8, s);
        double down = surface_reach(&now, start.count, (const double(*)[3][3])start.corner, 8, s + 1);
        surface_destroy(&now);
        last = fmax(up, down);
        if (up + spare > (double)certificate->up[s] || down + spare > (double)certificate->down[s])
            fail_msg("%s, rung %d, state %u: certified %g up and %g down, measured %g and %g", r->kind->name,
                     (int)r->desc.last_rung, s, certificate->up[s], certificate->down[s], up, down);
    }
    surface_destroy(&start);
    free(start_corner);
    free(corner);
    free(triangle);
    return last;
}

static void no_state_is_farther_than_its_certificate(void **state)
{
    (void)state;
    for (const mesh_kind *kind = mesh_kinds; kind->name; kind++)
        for (int rung = STRL_SIMPLIFY_TOPOLOGY; rung <= STRL_SIMPLIFY_CLUSTERING; rung++) {
            run r;
            float claim = rung == STRL_SIMPLIFY_SEAMS ? 30 : 0;
            run_begin(&r, kind, (uint64_t)rung + 40, (strl_simplify_rung)rung);
            if (rung & 1)
                run_keep_some(&r, 5);
            r.mesh.start_error = claim;
            run_simplify(&r);
            strl_piece *piece = pieces_of(&r.mesh, claim);
            strl_certificate certificate = certify(&r, piece, r.mesh.triangle_count);
            measure(&r, &certificate, claim);
            free(piece);
            run_end(&r);
        }
}

static void certificates_are_tight_on_hills(void **state)
{
    (void)state;
    run r;
    run_begin(&r, &mesh_kinds[0], 2, STRL_SIMPLIFY_TOPOLOGY);
    r.desc.target_triangles = r.mesh.triangle_count / 8;
    run_simplify(&r);
    strl_piece *piece = pieces_of(&r.mesh, 0);
    strl_certificate certificate = certify(&r, piece, r.mesh.triangle_count);
    double measured = measure(&r, &certificate, 0);
    uint32_t end = r.result.collapse_count;
    double certified = fmax((double)certificate.down[end], (double)certificate.up[end]);
    assert_true(end > 0 && measured > 0);
    if (certified > 1.5 * measured)
        fail_msg("certified %g, measured %g", certified, measured);
    for (uint32_t t = 0; t < r.result.triangles_left; t++)
        assert_true(fmaxf(certificate.triangle_down[t], certificate.triangle_up[t]) <= certified * (1 + 1e-6));
    free(piece);
    run_end(&r);
}

/* Lines, points, corners as far away as they go, none at all, the same one a hundred times: bounds, and an end. */
static void strange_pieces_are_borne(void **state)
{
    (void)state;
    run r;
    run_begin(&r, &mesh_kinds[0], 6, STRL_SIMPLIFY_CLUSTERING);
    run_simplify(&r);
    uint32_t end = r.result.collapse_count;
    strl_piece piece[100] = {0};
    for (int i = 0; i < 9; i++)
        piece[1].corner[i / 3][i % 3] = i % 2 ? INT32_MAX : INT32_MIN;
    memcpy(piece[2].corner[1], &(int32_t[3]){1000000000, 0, 0}, sizeof piece[2].corner[1]);
    strl_certificate certificate = certify(&r, piece, 3);
    assert_true(certificate.down[end] > 2e9f && !isnan(certificate.up[end]));
    for (int i = 0; i < 100; i++)
        piece[i] = (strl_piece){{{0, 0, 5}, {40, 0, 5}, {0, 40, 5}}, 1};
    certificate = certify(&r, piece, 100);
    assert_true(certificate.down[0] >= 1 && !isnan(certificate.down[end]));
    run_end(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_point_of_a_triangle_is_farther_than_the_bound),
        cmocka_unit_test(a_triangle_over_a_plane_in_pieces_is_measured_to_a_twentieth),
        cmocka_unit_test(the_tree_finds_what_a_look_at_every_facet_finds),
        cmocka_unit_test(no_state_is_farther_than_its_certificate),
        cmocka_unit_test(certificates_are_tight_on_hills),
        cmocka_unit_test(strange_pieces_are_borne),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
