#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "base/hash.h"
#include "readers/polygon.h"

/* Twice the signed area of the triangles, or of the outline, seen along z. */
static double triangle_area(const double (*points)[3], const uint32_t *t)
{
    const double *a = points[t[0]], *b = points[t[1]], *c = points[t[2]];
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

static double outline_area(const double (*points)[3], uint32_t count)
{
    double area = 0;
    for (uint32_t i = 1; i + 1 < count; i++)
        area += triangle_area(points, (uint32_t[]){0, i, i + 1});
    return area;
}

/* Integer coordinates keep the sums exact. No triangle is turned round and together they have the
 * outline's area: then they cover a simple polygon without overlap. */
static void assert_covers(const double (*points)[3], uint32_t count)
{
    strl__polygon polygon = {0};
    assert_true(strl__polygon_triangulate(&polygon, points[0], sizeof points[0], count));
    double area = 0, sign = outline_area(points, count) < 0 ? -1 : 1;
    uint32_t *uses = calloc(count, sizeof *uses);
    for (uint32_t i = 0; i < count - 2; i++) {
        const uint32_t *triangle = polygon.triangles + 3 * i;
        for (unsigned k = 0; k < 3; k++) {
            assert_in_range(triangle[k], 0, count - 1);
            uses[triangle[k]]++;
        }
        double part = triangle_area(points, triangle);
        if (part * sign < 0)
            fail_msg("triangle %u of %u is turned round", i, count);
        area += part;
    }
    assert_true(area == outline_area(points, count));
    for (uint32_t i = 0; i < count; i++)
        assert_true(uses[i] > 0);
    free(uses);
    strl__polygon_deinit(&polygon);
}

/* In all rotations and both directions. */
static void assert_covers_any_way(const double (*points)[3], uint32_t count)
{
    double(*turned)[3] = malloc(count * sizeof *turned);
    for (uint32_t first = 0; first < count; first++)
        for (unsigned reversed = 0; reversed < 2; reversed++) {
            for (uint32_t i = 0; i < count; i++)
                memcpy(turned[reversed ? count - 1 - i : i], points[(first + i) % count], sizeof *turned);
            assert_covers((const double(*)[3])turned, count);
        }
    free(turned);
}

static void convex_and_concave_polygons_are_covered_once(void **state)
{
    (void)state;
    static const double square[4][3] = {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}};
    static const double arrow[4][3] = {{0, 0, 0}, {4, 4, 0}, {8, 0, 0}, {4, 9, 1}};
    static const double l_shape[6][3] = {{0, 0, 0}, {4, 0, 0}, {4, 1, 0}, {1, 1, 0}, {1, 4, 0}, {0, 4, 0}};
    static const double star[8][3] = {{0, 9, 0},  {1, 1, 0},   {9, 0, 0},  {1, -1, 0},
                                      {0, -9, 0}, {-1, -1, 0}, {-9, 0, 0}, {-1, 1, 0}};
    static const double collinear[7][3] = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {4, 0, 0}, {4, 4, 0}, {2, 4, 0}, {0, 4, 0}};
    assert_covers_any_way(square, 4);
    assert_covers_any_way(arrow, 4);
    assert_covers_any_way(l_shape, 6);
    assert_covers_any_way(star, 8);
    assert_covers_any_way(collinear, 7);
}

/* A square with a square hole, joined to the outline by a bridge that is passed twice. */
static void a_hole_behind_a_bridge_stays_open(void **state)
{
    (void)state;
    static const double keyhole[10][3] = {{0, 0, 0}, {9, 0, 0}, {9, 9, 0}, {0, 9, 0}, {0, 0, 0},
                                          {3, 3, 0}, {3, 6, 0}, {6, 6, 0}, {6, 3, 0}, {3, 3, 0}};
    assert_true(outline_area(keyhole, 10) == 2 * (81 - 9));
    assert_covers_any_way(keyhole, 10);
}

static void combs_and_spirals_of_many_corners_are_covered(void **state)
{
    (void)state;
    enum { TEETH = 400 };
    double(*comb)[3] = calloc(2 * TEETH + 2, sizeof *comb);
    for (unsigned i = 0; i < 2 * TEETH; i++) {
        comb[i][0] = i;
        comb[i][1] = i % 2 ? 1000 : 1 + i % 7;
    }
    comb[2 * TEETH][0] = 2 * TEETH;
    comb[2 * TEETH][1] = -5;
    comb[2 * TEETH + 1][0] = -1;
    comb[2 * TEETH + 1][1] = -5;
    assert_covers((const double(*)[3])comb, 2 * TEETH + 2);
    free(comb);
    /* A square spiral, out along one wall and back along the other. */
    enum { ARMS = 60 };
    double(*spiral)[3] = calloc(2 * ARMS, sizeof *spiral);
    for (unsigned arm = 0; arm < ARMS; arm++) {
        double reach = 4 * (arm / 4 + 1);
        const double x[4] = {reach, reach, -reach, -reach}, y[4] = {-reach + 4, reach, reach, -reach};
        for (unsigned wall = 0; wall < 2; wall++) {
            double *point = spiral[wall ? 2 * ARMS - 1 - arm : arm];
            double inset = wall ? 1 : 0;
            point[0] = x[arm % 4] + (x[arm % 4] > 0 ? -inset : inset);
            point[1] = y[arm % 4] + (arm % 4 == 0 || arm % 4 == 3 ? inset : -inset);
        }
    }
    assert_covers((const double(*)[3])spiral, 2 * ARMS);
    free(spiral);
}

/* Random star-shaped outlines in random planes: the triangles' vector areas add up to the
 * outline's. */
static void tilted_polygons_keep_their_orientation(void **state)
{
    (void)state;
    uint64_t seed = 7;
    for (unsigned round = 0; round < 300; round++) {
        static const int sine[12] = {0, 50, 87, 100, 87, 50, 0, -50, -87, -100, -87, -50};
        double points[12][3], u[3], v[3];
        for (unsigned axis = 0; axis < 3; axis++) {
            u[axis] = (double)(int)(strl__mix64(++seed) % 21) - 10;
            v[axis] = (double)(int)(strl__mix64(++seed) % 21) - 10;
        }
        double normal[3] = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
        if (normal[0] == 0 && normal[1] == 0 && normal[2] == 0)
            continue;
        for (unsigned i = 0; i < 12; i++) {
            double radius = 1 + (double)(strl__mix64(++seed) % 9);
            for (unsigned axis = 0; axis < 3; axis++)
                points[i][axis] = 100 + radius * (sine[(i + 3) % 12] * u[axis] + sine[i] * v[axis]);
        }
        strl__polygon polygon = {0};
        assert_true(strl__polygon_triangulate(&polygon, points[0], sizeof points[0], 12));
        for (unsigned i = 0; i < 10; i++) {
            const double *a = points[polygon.triangles[3 * i]], *b = points[polygon.triangles[3 * i + 1]],
                         *c = points[polygon.triangles[3 * i + 2]];
            double along = 0;
            for (unsigned axis = 0; axis < 3; axis++) {
                unsigned p = (axis + 1) % 3, q = (axis + 2) % 3;
                along += normal[axis] * ((b[p] - a[p]) * (c[q] - a[q]) - (b[q] - a[q]) * (c[p] - a[p]));
            }
            assert_true(along >= 0);
        }
        strl__polygon_deinit(&polygon);
    }
}

static void any_corners_at_all_give_all_triangles_in_bounded_time(void **state)
{
    (void)state;
    const uint32_t count = STRL__POLYGON_CORNERS_MAX;
    double(*points)[3] = calloc(count, sizeof *points);
    strl__polygon polygon = {0};
    for (unsigned kind = 0; kind < 4; kind++) { /* equal, collinear, random, huge */
        for (uint32_t i = 0; i < count; i++)
            for (unsigned axis = 0; axis < 3; axis++)
                points[i][axis] = kind == 0   ? 3
                                  : kind == 1 ? i * (axis + 1.0)
                                  : kind == 2 ? (double)(strl__mix64(3 * i + axis) % 1000)
                                              : (i % 2 ? 1e308 : -1e308) / (1 + axis * i);
        assert_true(strl__polygon_triangulate(&polygon, points[0], sizeof *points, count));
        for (uint32_t i = 0; i < 3 * (count - 2); i++)
            assert_true(polygon.triangles[i] < count);
    }
    strl__polygon_deinit(&polygon);
    free(points);
}

static void orientation_is_exact(void **state)
{
    (void)state;
    /* Shewchuk's example: near the line y = x, plain arithmetic answers at random. */
    const double b[2] = {12, 12}, c[2] = {24, 24}, step = 1.0 / ((uint64_t)1 << 53);
    for (int y = 0; y < 64; y++)
        for (int x = 0; x < 64; x++) {
            const double a[2] = {0.5 + x * step, 0.5 + y * step};
            double found = strl__orientation(a, b, c);
            int expected = a[0] == a[1] ? 0 : a[0] < a[1] ? -1 : 1;
            /* (b - a) x (c - a) has the sign of (c - b) x (a - b): left of the line where y > x */
            assert_true(expected == 0 ? found == 0 : -expected * found > 0);
        }
    assert_true(strl__orientation((double[]){0, 0}, (double[]){1, 0}, (double[]){0, 1}) > 0);
    assert_true(strl__orientation((double[]){0, 0}, (double[]){0, 1}, (double[]){1, 0}) < 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(convex_and_concave_polygons_are_covered_once),
        cmocka_unit_test(a_hole_behind_a_bridge_stays_open),
        cmocka_unit_test(combs_and_spirals_of_many_corners_are_covered),
        cmocka_unit_test(tilted_polygons_keep_their_orientation),
        cmocka_unit_test(any_corners_at_all_give_all_triangles_in_bounded_time),
        cmocka_unit_test(orientation_is_exact),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
