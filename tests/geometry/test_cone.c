/* Cones of normals hold what they were made of, also when joined, and are hardly wider than need be. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <cmocka.h>

#include "base/hash.h"
#include "geometry/cone.h"

#define MOST 64u
#define ROUNDS 4000u

static double uniform(uint64_t *state)
{
    return (double)(strl__mix64(++*state) >> 11) * 0x1p-53;
}

/* Within `spread` (0 to 2) of the axis, more or less; unit. */
static void any_direction(uint64_t *state, const double axis[3], double spread, double out[3])
{
    double length = 0;
    for (int k = 0; k < 3; k++) {
        out[k] = axis[k] + spread * (2 * uniform(state) - 1);
        length += out[k] * out[k];
    }
    for (int k = 0; k < 3; k++)
        out[k] /= sqrt(length);
}

/* The format's words, in wider numbers than the cone's own code has. */
static bool holds(const strl_cone *cone, const double d[3])
{
    long double along = 0, square = 0, axis = 0;
    for (int k = 0; k < 3; k++) {
        along += (long double)d[k] * cone->axis[k];
        square += (long double)d[k] * d[k];
        axis += (long double)cone->axis[k] * cone->axis[k];
    }
    return cone->cosine == 0 || along >= cone->cosine / 65535.0L * sqrtl(square) * sqrtl(axis);
}

static double half_angle(const strl_cone *cone)
{
    return acos(cone->cosine / 65535.0);
}

static void assert_sound(const strl_cone *cone)
{
    bool has_axis = cone->axis[0] || cone->axis[1] || cone->axis[2];
    assert_true(has_axis == (cone->cosine > 0));
}

static void a_cone_holds_what_it_is_made_of(void **state)
{
    (void)state;
    uint64_t random = 1;
    unsigned cones = 0;
    for (unsigned round = 0; round < ROUNDS; round++) {
        double normal[MOST][3], axis[3], spread = pow(uniform(&random), 3) * 2, widest = 0;
        size_t count = 1 + (size_t)(uniform(&random) * (MOST - 1));
        any_direction(&random, (double[3]){0, 0, 0}, 1, axis);
        for (size_t i = 0; i < count; i++)
            any_direction(&random, axis, spread, normal[i]);
        strl_cone cone = strl_cone_around((const double(*)[3])normal, count);
        assert_sound(&cone);
        for (size_t i = 0; i < count; i++)
            assert_true(holds(&cone, normal[i]));
        for (size_t i = 0; i < count; i++)
            for (size_t j = 0; j < i; j++) {
                double cosine = 0;
                for (int k = 0; k < 3; k++)
                    cosine += normal[i][k] * normal[j][k];
                widest = fmax(widest, acos(fmin(fmax(cosine, -1), 1)));
            }
        /* Jung's theorem: there is one no larger than the circle through three directions as far apart. */
        double least = asin(fmin(1, 2 / sqrt(3) * sin(fmin(widest, M_PI) / 2)));
        if (cone.cosine > 0) {
            if (!(half_angle(&cone) <= 0.01 + 1.1 * least))
                fail_msg("%zu normals up to %g apart have a cone of %g, %g is possible", count, widest,
                         half_angle(&cone), least);
            cones++;
        } else {
            assert_true(widest > M_PI / 2);
        }
    }
    assert_true(cones > ROUNDS / 2);
}

static void joined_cones_hold_both(void **state)
{
    (void)state;
    uint64_t random = 2;
    unsigned cones = 0, nested = 0;
    for (unsigned round = 0; round < ROUNDS; round++) {
        strl_cone part[2], both;
        double axis[3], inside[2][8][3], apart = uniform(&random);
        any_direction(&random, (double[3]){0, 0, 0}, 1, axis);
        for (int p = 0; p < 2; p++) {
            double own[3], spread = pow(uniform(&random), 3);
            any_direction(&random, axis, apart, own);
            for (int i = 0; i < 8; i++)
                any_direction(&random, own, spread, inside[p][i]);
            part[p] = strl_cone_around((const double(*)[3])inside[p], 8);
        }
        both = strl_cone_join(&part[0], &part[1]);
        assert_sound(&both);
        for (int p = 0; p < 2; p++)
            for (int i = 0; i < 8; i++)
                assert_true(holds(&both, inside[p][i]));
        if (part[0].cosine == 0 || part[1].cosine == 0)
            assert_int_equal(both.cosine, 0);
        if (both.cosine == 0)
            continue;
        cones++;
        nested += both.cosine == part[0].cosine || both.cosine == part[1].cosine;
        /* Any direction of either, not only those it was made of. */
        for (int p = 0; p < 2; p++) {
            double of[3] = {part[p].axis[0], part[p].axis[1], part[p].axis[2]},
                   length = sqrt(of[0] * of[0] + of[1] * of[1] + of[2] * of[2]);
            for (int k = 0; k < 3; k++)
                of[k] /= length;
            for (int i = 0; i < 64; i++) {
                double d[3];
                any_direction(&random, of, tan(half_angle(&part[p])), d);
                assert_true(!holds(&part[p], d) || holds(&both, d));
            }
        }
    }
    assert_true(cones > ROUNDS / 2 && nested > ROUNDS / 100);
}

static void none_and_empty_are_what_they_say(void **state)
{
    (void)state;
    const double up[1][3] = {{0, 0, 1}}, both[2][3] = {{0, 0, 1}, {0, 0, -1}}, right[2][3] = {{1, 0, 0}, {0, 1, 0}};
    strl_cone none = strl_cone_around(both, 2), empty = strl_cone_around(up, 0), one = strl_cone_around(up, 1);
    strl_cone wide = strl_cone_around(right, 2);
    assert_int_equal(none.cosine, 0);
    assert_true(strl_cone_is_empty(&empty) && !strl_cone_is_empty(&none) && !strl_cone_is_empty(&one));
    assert_true(one.cosine >= 65534 && one.axis[2] == 32767 && one.axis[0] == 0);
    assert_true(fabs(half_angle(&wide) - M_PI / 4) < 1e-4);
    strl_cone joined = strl_cone_join(&empty, &one);
    assert_memory_equal(&joined, &one, sizeof one);
    joined = strl_cone_join(&one, &empty);
    assert_memory_equal(&joined, &one, sizeof one);
    joined = strl_cone_join(&empty, &empty);
    assert_true(strl_cone_is_empty(&joined));
    joined = strl_cone_join(&one, &none);
    assert_int_equal(joined.cosine, 0);
    joined = strl_cone_join(&one, &one);
    assert_true(joined.cosine >= 65533);
    strl_cone turned = one;
    turned.axis[2] = -32767;
    joined = strl_cone_join(&one, &turned);
    assert_int_equal(joined.cosine, 0);
}

/* Of faces so thin that plain products would not even tell the side. */
static void normals_of_thin_faces_are_right(void **state)
{
    (void)state;
    uint64_t random = 3;
    for (unsigned round = 0; round < ROUNDS; round++) {
        double edge[3], next[3], normal[3];
        __extension__ typedef __int128 wide;
        wide exact[3];
        long double length = 0;
        bool has_area = false;
        for (int k = 0; k < 3; k++) {
            edge[k] = floor((uniform(&random) - 0.5) * 0x1p32);
            next[k] = edge[k] + floor((uniform(&random) - 0.5) * 4);
        }
        for (int k = 0; k < 3; k++) {
            int a = (k + 1) % 3, b = (k + 2) % 3;
            exact[k] = (wide)edge[a] * (wide)next[b] - (wide)edge[b] * (wide)next[a];
            length += (long double)exact[k] * (long double)exact[k];
            has_area = has_area || exact[k] != 0;
        }
        assert_true(strl_cone_normal(edge, next, normal) == has_area);
        for (int k = 0; k < 3 && has_area; k++)
            assert_true(fabsl(normal[k] - (long double)exact[k] / sqrtl(length)) < 1e-14L);
    }
    double normal[3];
    assert_false(strl_cone_normal((double[3]){3, 6, 9}, (double[3]){1, 2, 3}, normal));
    assert_false(strl_cone_normal((double[3]){0, 0, 0}, (double[3]){1, 2, 3}, normal));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_cone_holds_what_it_is_made_of),
        cmocka_unit_test(joined_cones_hold_both),
        cmocka_unit_test(none_and_empty_are_what_they_say),
        cmocka_unit_test(normals_of_thin_faces_are_right),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
