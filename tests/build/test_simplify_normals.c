/* The normals that the mesh after a simplification has: means over what fell onto each wedge. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "build/simplify_run.h"
#include "geometry/octahedral.h"
#include "geometry/record.h"

#define PI 3.14159265358979323846
/* No direction is farther from its code's. Half a step d = 1 / 1023 in both coordinates moves a point of the
 * octahedron by (d, d, -2d), and its faces come as near to the middle as sqrt(1 / 3): sqrt(6) d sqrt(3). */
#define CODE_ANGLE 0.00415

/* ---- directions ---- */
/* Off `axis` by an angle uniform in 0 .. most, to any side. */
static void set_tilted(strl_wedge *wedge, const double axis[3], double most, uint64_t *random)
{
    double tilt = most * mesh_below(random, 1000001) * 1e-6, turn = 2 * PI * mesh_below(random, 1000000) * 1e-6;
    double least = fabs(axis[0]) < 0.5 ? 1 : 0; /* which of x and y is not nearly the axis */
    double side[3] = {least - axis[0] * (least ? axis[0] : axis[1]), 1 - least - axis[1] * (least ? axis[0] : axis[1]),
                      -axis[2] * (least ? axis[0] : axis[1])};
    double length = sqrt(side[0] * side[0] + side[1] * side[1] + side[2] * side[2]);
    double other[3];
    for (int k = 0; k < 3; k++)
        side[k] /= length;
    for (int k = 0; k < 3; k++)
        other[k] = axis[(k + 1) % 3] * side[(k + 2) % 3] - axis[(k + 2) % 3] * side[(k + 1) % 3];
    float normal[3];
    for (int k = 0; k < 3; k++)
        normal[k] = (float)(cos(tilt) * axis[k] + sin(tilt) * (cos(turn) * side[k] + sin(turn) * other[k]));
    strl_oct_encode(normal, wedge->normal);
}

/* In radians; precise for small angles, too. */
static double angle_between(const double a[3], const double b[3])
{
    double cross[3], dot = 0;
    for (int k = 0; k < 3; k++) {
        cross[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
        dot += a[k] * b[k];
    }
    return atan2(sqrt(cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]), dot);
}

/* Fails the test where the code is none of a unit vector. */
static void decode(const uint16_t code[2], double normal[3])
{
    float decoded[3];
    double length = 0;
    assert_true(code[0] <= STRL_OCT_MAX && code[1] <= STRL_OCT_MAX);
    strl_oct_decode(code, decoded);
    for (int k = 0; k < 3; k++) {
        normal[k] = (double)decoded[k];
        length += normal[k] * normal[k];
    }
    assert_true(fabs(length - 1) < 1e-5);
}

static double angle_of_code(const uint16_t code[2], const double axis[3])
{
    double normal[3];
    decode(code, normal);
    return angle_between(normal, axis);
}

static bool is_on_border(const uint16_t code[2])
{
    return code[0] == 0 || code[0] == STRL_OCT_MAX || code[1] == 0 || code[1] == STRL_OCT_MAX;
}

/* Bit for bit; but the border of the square is folded onto itself, so directions there have two codes. */
static bool is_same_normal(const uint16_t a[2], const uint16_t b[2])
{
    double normal[3];
    decode(b, normal);
    return !memcmp(a, b, 2 * sizeof *a) || (is_on_border(a) && is_on_border(b) && angle_of_code(a, normal) < 1e-6);
}

/* ---- meshes ---- */
static const double UP[3] = {0, 0, 1};

/* A flat square of 7200 triangles, white, whose normals are off +z by up to `most`. */
static void begin_plane(run *r, double most, strl_simplify_rung last)
{
    static const mesh_kind plane = {.name = "plane", .make = mesh_make_disc, .manifold = true};
    uint64_t random = 17;
    run_begin(r, &plane, 3, last);
    for (uint32_t w = 0; w < r->mesh.wedge_count; w++) {
        r->mesh.wedge[w].colour = 0xffffffffu;
        set_tilted(&r->mesh.wedge[w], UP, most, &random);
    }
    r->desc.target_triangles = r->mesh.triangle_count / 10;
}

/* True for points that no edge of odd use ends at. */
static bool *list_inner_points(const strl_mesh *mesh, strl_arena *arena)
{
    bool *inner = strl_arena_alloc(arena, mesh->point_count, sizeof *inner);
    uint64_t *balance = strl_arena_alloc_zero(arena, mesh->point_count, sizeof *balance);
    assert_true(inner && balance);
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        for (int c = 0; c < 3; c++) {
            uint64_t next = mesh->wedge[mesh->triangle[t][(c + 1) % 3]].point;
            uint64_t previous = mesh->wedge[mesh->triangle[t][(c + 2) % 3]].point;
            balance[mesh->wedge[mesh->triangle[t][c]].point] += mesh_random(&next) - mesh_random(&previous);
        }
    for (uint32_t p = 0; p < mesh->point_count; p++)
        inner[p] = balance[p] == 0;
    return inner;
}

/* ---- what fell onto a wedge, counted by following every wedge of the start ---- */
typedef struct fallen {
    uint32_t count;
    double sum[3]; /* of the normals, each by twice the area round its wedge */
} fallen;

static double double_area(const strl_mesh *mesh, uint32_t t)
{
    double e[2][3], n[3];
    for (int c = 0; c < 2; c++)
        for (int k = 0; k < 3; k++)
            e[c][k] = (double)mesh->position[mesh->wedge[mesh->triangle[t][c + 1]].point][k] -
                      mesh->position[mesh->wedge[mesh->triangle[t][0]].point][k];
    for (int k = 0; k < 3; k++)
        n[k] = e[0][(k + 1) % 3] * e[1][(k + 2) % 3] - e[0][(k + 2) % 3] * e[1][(k + 1) % 3];
    return sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
}

static fallen *list_fallen(run *r)
{
    fallen *list = strl_arena_alloc_zero(&r->arena, r->mesh.wedge_count, sizeof *list);
    double *area = strl_arena_alloc_zero(&r->arena, r->mesh.wedge_count, sizeof *area);
    assert_true(list && area);
    for (uint32_t t = 0; t < r->mesh.triangle_count; t++)
        for (int c = 0; c < 3; c++)
            area[r->mesh.triangle[t][c]] += double_area(&r->mesh, t);
    for (uint32_t w = 0; w < r->mesh.wedge_count; w++) {
        fallen *to = &list[run_resolve(r, w, r->result.collapse_count)];
        double normal[3];
        decode(r->mesh.wedge[w].normal, normal);
        to->count++;
        for (int k = 0; k < 3; k++)
            to->sum[k] += area[w] * normal[k];
    }
    return list;
}

/* The mesh after, and for each of its wedges the one of the start that it was. */
static uint32_t *take_mesh_after(run *r, strl_mesh *after)
{
    strl_error err = {0};
    uint32_t *map = strl_arena_alloc(&r->arena, r->mesh.point_count, sizeof *map);
    assert_non_null(map);
    if (strl_mesh_after(&r->mesh, &r->result, map, &r->arena, after, &err) != STRL_OK)
        fail_msg("%s", err.message);
    uint32_t *origin = strl_arena_alloc(&r->arena, after->wedge_count, sizeof *origin), left = 0, to = 0;
    assert_non_null(origin);
    memset(origin, 0xff, after->wedge_count * sizeof *origin);
    for (uint32_t t = 0; t < r->mesh.triangle_count; t++) {
        if (r->result.removed_at[t] != RUN_NEVER)
            continue;
        for (int c = 0; c < 3; c++) {
            uint32_t before = run_resolve(r, r->mesh.triangle[t][c], r->result.collapse_count);
            assert_int_equal(after->wedge[after->triangle[to][c]].point, map[r->mesh.wedge[before].point]);
            origin[after->triangle[to][c]] = before;
        }
        to++;
    }
    for (uint32_t w = 0; w < after->wedge_count; w++)
        left += origin[w] != UINT32_MAX;
    assert_int_equal(to, after->triangle_count);
    assert_true(left > 0);
    return origin;
}

/* ---- tests ---- */
static void noise_about_a_plane_s_normal_is_averaged_away(void **state)
{
    (void)state;
    run r;
    strl_mesh after;
    double before = 0, now = 0, expected = 0;
    uint32_t counted_before = 0, counted = 0;
    begin_plane(&r, 0.4, STRL_SIMPLIFY_SEAMS);
    run_simplify(&r);
    assert_in_range(r.result.triangles_left, 1, r.mesh.triangle_count / 10);
    uint32_t *origin = take_mesh_after(&r, &after);
    fallen *list = list_fallen(&r);
    bool *inner_before = list_inner_points(&r.mesh, &r.arena), *inner = list_inner_points(&after, &r.arena);
    for (uint32_t w = 0; w < r.mesh.wedge_count; w++)
        if (inner_before[r.mesh.wedge[w].point]) {
            before += angle_of_code(r.mesh.wedge[w].normal, UP);
            counted_before++;
        }
    before /= counted_before;
    assert_true(before > 0.19 && before < 0.21); /* uniform in 0 .. 0.4 */
    for (uint32_t w = 0; w < after.wedge_count; w++)
        if (origin[w] != UINT32_MAX && inner[after.wedge[w].point]) {
            now += angle_of_code(after.wedge[w].normal, UP);
            expected += before / sqrt(list[origin[w]].count);
            counted++;
        }
    assert_true(counted > 150);
    now /= counted, expected /= counted;
    /* Independent tilts of n wedges leave 1 / sqrt(n) of one; areas are uneven, and the points that are left were not
     * chosen blindly: a quarter more. */
    assert_true(expected < 0.5 * before);
    if (now > 1.25 * expected || now > 0.5 * before)
        fail_msg("%u normals are off by %g on average, %g before; %g were to be expected", counted, now, before,
                 expected);
    run_end(&r);
}

/* opposite: share of the normals, in percent, that point down */
static void check_means(double most, uint32_t opposite, strl_simplify_rung last, uint32_t least_kept)
{
    run r;
    strl_mesh after;
    uint64_t random = 23;
    uint32_t means = 0, kept = 0;
    const double down[3] = {0, 0, -1};
    begin_plane(&r, most, last);
    for (uint32_t w = 0; w < r.mesh.wedge_count; w++)
        if (mesh_below(&random, 100) < opposite)
            set_tilted(&r.mesh.wedge[w], down, most, &random);
    run_simplify(&r);
    uint32_t *origin = take_mesh_after(&r, &after);
    fallen *list = list_fallen(&r);
    for (uint32_t w = 0; w < after.wedge_count; w++) {
        if (origin[w] == UINT32_MAX)
            continue;
        const fallen *all = &list[origin[w]];
        double own[3], slope = angle_of_code(r.mesh.wedge[origin[w]].normal, all->sum);
        decode(r.mesh.wedge[origin[w]].normal, own);
        if (all->count == 1 || slope > PI / 2 + 0.01) {
            kept += all->count > 1;
            assert_true(is_same_normal(after.wedge[w].normal, r.mesh.wedge[origin[w]].normal));
        } else if (slope < PI / 2 - 0.01) {
            means++;
            if (angle_of_code(after.wedge[w].normal, all->sum) > CODE_ANGLE)
                fail_msg("a normal is %g off the mean of %u", angle_of_code(after.wedge[w].normal, all->sum),
                         all->count);
        }
    }
    assert_true(means > 150 && kept >= least_kept);
    run_end(&r);
}

static void a_normal_is_the_mean_by_area_of_all_that_fell_onto_its_wedge(void **state)
{
    (void)state;
    check_means(0.4, 0, STRL_SIMPLIFY_TOPOLOGY, 0);
    check_means(1.2, 0, STRL_SIMPLIFY_SEAMS, 0);
}

static void a_mean_that_points_the_other_way_is_not_taken(void **state)
{
    (void)state;
    check_means(0.4, 40, STRL_SIMPLIFY_SEAMS, 20);
}

static void points_known_outside_keep_their_normals_bit_for_bit(void **state)
{
    (void)state;
    run r;
    strl_mesh after;
    uint32_t outside = 0, moved = 0;
    begin_plane(&r, 0.4, STRL_SIMPLIFY_SEAMS);
    for (uint32_t p = 0; p < r.mesh.point_count; p += 3)
        r.mesh.flags[p] |= p % 9 ? STRL_POINT_OUTSIDE : STRL_POINT_OUTSIDE | (p % 27 ? 0 : STRL_POINT_KEPT);
    run_simplify(&r);
    uint32_t *origin = take_mesh_after(&r, &after);
    fallen *list = list_fallen(&r);
    for (uint32_t w = 0; w < after.wedge_count; w++) {
        if (origin[w] == UINT32_MAX)
            continue;
        const uint16_t *own = r.mesh.wedge[origin[w]].normal, *now = after.wedge[w].normal;
        bool same = !memcmp(own, now, sizeof after.wedge[w].normal);
        if (r.mesh.flags[r.mesh.wedge[origin[w]].point] & STRL_POINT_OUTSIDE) {
            outside += list[origin[w]].count > 1 && angle_of_code(own, list[origin[w]].sum) > 2 * CODE_ANGLE;
            assert_true(same);
        } else {
            moved += !same;
        }
    }
    assert_true(outside > 50 && moved > 50); /* there were means that were not taken, and others that were */
    run_end(&r);
}

/* A roof with its ridge along y: rises on both sides of x = 0, each point of which has a wedge for either side. */
static void begin_crease(run *r, const double side_normal[2][3], double most, strl_simplify_rung last)
{
    uint64_t random = 29;
    begin_plane(r, 0, last);
    mesh_add_seam(&r->mesh, false, 8, &r->arena);
    for (uint32_t p = 0; p < r->mesh.point_count; p++)
        r->mesh.position[p][2] = -abs(r->mesh.position[p][0]);
    for (uint32_t t = 0; t < r->mesh.triangle_count; t++) {
        double x = 0;
        for (int c = 0; c < 3; c++)
            x += r->mesh.position[r->mesh.wedge[r->mesh.triangle[t][c]].point][0];
        for (int c = 0; c < 3; c++) {
            strl_wedge *wedge = &r->mesh.wedge[r->mesh.triangle[t][c]];
            wedge->colour = 0xffffffffu;
            set_tilted(wedge, side_normal[x > 0], most, &random);
        }
    }
}

static void a_crease_keeps_both_directions(void **state)
{
    (void)state;
    const double half = sqrt(0.5), most = 0.05, side_normal[2][3] = {{-half, 0, half}, {half, 0, half}};
    for (int rung = STRL_SIMPLIFY_TOPOLOGY; rung <= STRL_SIMPLIFY_SEAMS; rung++) {
        run r;
        strl_mesh after;
        uint32_t of_ridge[2] = {0, 0}, fell[2] = {0, 0};
        begin_crease(&r, side_normal, most, (strl_simplify_rung)rung);
        run_simplify(&r);
        assert_in_range(r.result.triangles_left, 1, r.mesh.triangle_count / 10);
        uint32_t *origin = take_mesh_after(&r, &after);
        fallen *list = list_fallen(&r);
        for (uint32_t t = 0; t < after.triangle_count; t++) {
            double x = 0;
            for (int c = 0; c < 3; c++)
                x += after.position[after.wedge[after.triangle[t][c]].point][0];
            for (int c = 0; c < 3; c++) { /* a mean of directions in a cone lies in the cone */
                uint32_t w = after.triangle[t][c];
                double off = angle_of_code(after.wedge[w].normal, side_normal[x > 0]);
                bool on_ridge = after.position[after.wedge[w].point][0] == 0;
                if (off > most + 2 * CODE_ANGLE)
                    fail_msg("rung %d: a normal %s the ridge is %g off its side's", rung, on_ridge ? "of" : "beside",
                             off);
                of_ridge[x > 0] += on_ridge;
                fell[x > 0] += on_ridge && list[origin[w]].count > 1;
            }
        }
        for (int side = 0; side < 2; side++)
            assert_true(of_ridge[side] > 0 && fell[side] > 0);
        run_end(&r);
    }
}

static void where_nothing_collapses_nothing_changes(void **state)
{
    (void)state;
    for (int all_kept = 0; all_kept < 2; all_kept++) {
        run r;
        strl_mesh after;
        uint64_t random = 31;
        begin_plane(&r, PI, STRL_SIMPLIFY_CLUSTERING); /* to all sides */
        for (uint32_t p = 0; p < r.mesh.point_count; p++)
            r.mesh.flags[p] = all_kept ? STRL_POINT_KEPT : 0;
        if (!all_kept) { /* no two of one plane: none collapses for nothing */
            r.desc.error_limit = 0;
            for (uint32_t p = 0; p < r.mesh.point_count; p++)
                r.mesh.position[p][2] = (int32_t)mesh_below(&random, 200);
        }
        run_simplify(&r);
        assert_int_equal(r.result.collapse_count, 0);
        for (uint32_t w = 0; w < r.mesh.wedge_count; w++)
            assert_true(is_same_normal(r.result.normal[w], r.mesh.wedge[w].normal));
        take_mesh_after(&r, &after);
        assert_int_equal(after.wedge_count, r.mesh.wedge_count);
        assert_int_equal(after.triangle_count, r.mesh.triangle_count);
        for (uint32_t w = 0; w < after.wedge_count; w++)
            assert_true(is_same_normal(after.wedge[w].normal, r.mesh.wedge[w].normal));
        run_end(&r);
    }
}

/* ---- a plate ---- */
#define PLATE_CELLS 24
#define PLATE_CELL 100 /* lattice units */
#define PLATE_THICKNESS 8

static uint32_t plate_point(int x, int y, int z)
{
    return (uint32_t)((z * (PLATE_CELLS + 1) + y) * (PLATE_CELLS + 1) + x);
}

/* Two triangles, flat: each of the six directions has wedges of its own. */
static void add_plate_quad(strl_mesh *mesh, int direction, uint32_t a, uint32_t b, uint32_t c, uint32_t d)
{
    const uint32_t corner[6] = {a, b, c, a, c, d};
    const float normal[3] = {(float)((direction == 1) - (direction == 0)), (float)((direction == 3) - (direction == 2)),
                             (float)((direction == 5) - (direction == 4))};
    for (int i = 0; i < 6; i++) {
        uint32_t w = 0;
        while (w < mesh->wedge_count &&
               (mesh->wedge[w].point != corner[i] || mesh->wedge[w].palette != (uint32_t)direction))
            w++;
        if (w == mesh->wedge_count) {
            mesh->wedge[w] = (strl_wedge){.point = corner[i], .colour = 0xffffffffu, .palette = (uint32_t)direction};
            strl_oct_encode(normal, mesh->wedge[mesh->wedge_count++].normal);
        }
        mesh->triangle[mesh->triangle_count + (uint32_t)i / 3][i % 3] = w;
    }
    mesh->triangle_count += 2;
}

/* A slab with sharp rims, thin beside its length: two faces of a grid, and a strip round them. */
static void make_plate(strl_mesh *mesh, uint64_t seed, strl_arena *arena)
{
    const int n = PLATE_CELLS;
    uint32_t points = 2 * (PLATE_CELLS + 1) * (PLATE_CELLS + 1),
             triangles = 4 * PLATE_CELLS * PLATE_CELLS + 8 * PLATE_CELLS;
    (void)seed;
    assert_true(strl_mesh_create(mesh, points, 3 * triangles, triangles, arena));
    mesh->wedge_count = mesh->triangle_count = 0;
    for (int z = 0; z < 2; z++)
        for (int y = 0; y <= n; y++)
            for (int x = 0; x <= n; x++) {
                int32_t *at = mesh->position[plate_point(x, y, z)];
                at[0] = x * PLATE_CELL, at[1] = y * PLATE_CELL, at[2] = z * PLATE_THICKNESS;
            }
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) {
            add_plate_quad(mesh, 5, plate_point(i, j, 1), plate_point(i + 1, j, 1), plate_point(i + 1, j + 1, 1),
                           plate_point(i, j + 1, 1));
            add_plate_quad(mesh, 4, plate_point(i, j, 0), plate_point(i, j + 1, 0), plate_point(i + 1, j + 1, 0),
                           plate_point(i + 1, j, 0));
        }
        add_plate_quad(mesh, 2, plate_point(i, 0, 0), plate_point(i + 1, 0, 0), plate_point(i + 1, 0, 1),
                       plate_point(i, 0, 1));
        add_plate_quad(mesh, 3, plate_point(i, n, 0), plate_point(i, n, 1), plate_point(i + 1, n, 1),
                       plate_point(i + 1, n, 0));
        add_plate_quad(mesh, 0, plate_point(0, i, 0), plate_point(0, i, 1), plate_point(0, i + 1, 1),
                       plate_point(0, i + 1, 0));
        add_plate_quad(mesh, 1, plate_point(n, i, 0), plate_point(n, i + 1, 0), plate_point(n, i + 1, 1),
                       plate_point(n, i, 1));
    }
    for (uint32_t w = 0; w < mesh->wedge_count; w++)
        mesh->wedge[w].palette = 0;
    memset(mesh->drift, 0, triangles * sizeof *mesh->drift);
    memset(mesh->deviation, 0, triangles * sizeof *mesh->deviation);
    memset(mesh->shift, 0, triangles * sizeof *mesh->shift);
    mesh->start_error = mesh->most_error = 0;
    mesh->holders = NULL;
}

/* Triangles of a state that are wider than the plate is thick are shaded as they lie. Returns how many there are. */
static uint32_t check_faces(const run *r, uint32_t state)
{
    uint32_t wide = 0;
    for (uint32_t t = 0; t < r->mesh.triangle_count; t++) {
        double e[2][3], n[3];
        uint32_t wedge[3];
        if (r->result.removed_at[t] < state)
            continue;
        for (int c = 0; c < 3; c++)
            wedge[c] = run_resolve(r, r->mesh.triangle[t][c], state);
        for (int c = 0; c < 2; c++)
            for (int k = 0; k < 3; k++)
                e[c][k] = (double)r->mesh.position[r->result.wedge[wedge[c + 1]].point][k] -
                          r->mesh.position[r->result.wedge[wedge[0]].point][k];
        for (int k = 0; k < 3; k++)
            n[k] = e[0][(k + 1) % 3] * e[1][(k + 2) % 3] - e[0][(k + 2) % 3] * e[1][(k + 1) % 3];
        if (fabs(n[2]) < 0.5 * PLATE_CELL * PLATE_CELL) /* the strips; they are as thin as the plate */
            continue;
        for (int c = 0; c < 3; c++)
            assert_true(angle_of_code(r->result.wedge[wedge[c]].normal, n) < PI / 4);
        wide++;
    }
    return wide;
}

static void a_plate_that_gets_thin_is_shaded_as_it_lies(void **state)
{
    static const mesh_kind plate = {.name = "plate", .make = make_plate, .closed = true, .manifold = true};
    (void)state;
    for (int last = STRL_SIMPLIFY_SEAMS; last <= STRL_SIMPLIFY_CLUSTERING; last++) {
        run r;
        run_begin(&r, &plate, 1, (strl_simplify_rung)last);
        r.desc.error_limit = 3 * PLATE_THICKNESS;
        run_simplify(&r);
        run_check_order(&r);
        run_check_wedges(&r);
        assert_true(r.result.triangles_left < 12);              /* not even a box is left: the strips have gone, */
        assert_true(r.result.wedge_count > r.mesh.wedge_count); /* and what they joined did not become one */
        for (uint32_t i = 0; i <= 64; i++)
            assert_true(check_faces(&r, (uint32_t)((uint64_t)r.result.collapse_count * i / 64)) >= 4);
        run_end(&r);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(noise_about_a_plane_s_normal_is_averaged_away),
        cmocka_unit_test(a_normal_is_the_mean_by_area_of_all_that_fell_onto_its_wedge),
        cmocka_unit_test(a_mean_that_points_the_other_way_is_not_taken),
        cmocka_unit_test(points_known_outside_keep_their_normals_bit_for_bit),
        cmocka_unit_test(a_crease_keeps_both_directions),
        cmocka_unit_test(a_plate_that_gets_thin_is_shaded_as_it_lies),
        cmocka_unit_test(where_nothing_collapses_nothing_changes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
