/* Normals that are made for corners without one are the sums that normals.h tells of, taken here one by one. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "base/hash.h"
#include "build/ingest/normals.h"
#include "geometry/octahedral.h"

#define CREASE_COSINE 0.76604444f
#define MOST_FACES 1024u
#define MOST_TRIANGLES 3000u

static strl_soup_triangle mesh[MOST_TRIANGLES], filled[MOST_TRIANGLES];
static bool wanted[MOST_TRIANGLES];

static void face_normal(const strl_soup_triangle *triangle, float normal[3])
{
    double edge[2][3], n[3];
    for (int k = 0; k < 3; k++) {
        edge[0][k] = (double)triangle->corner[1].position[k] - triangle->corner[0].position[k];
        edge[1][k] = (double)triangle->corner[2].position[k] - triangle->corner[1].position[k];
    }
    for (int k = 0; k < 3; k++)
        n[k] = edge[0][(k + 1) % 3] * edge[1][(k + 2) % 3] - edge[0][(k + 2) % 3] * edge[1][(k + 1) % 3];
    double area = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int k = 0; k < 3; k++)
        normal[k] = area > 0 ? (float)(n[k] / area) : 0;
}

static float angle_at(const strl_soup_triangle *triangle, int c)
{
    double a[3], b[3], lengths[2] = {0}, dot = 0;
    for (int k = 0; k < 3; k++) {
        a[k] = (double)triangle->corner[(c + 1) % 3].position[k] - triangle->corner[c].position[k];
        b[k] = (double)triangle->corner[(c + 2) % 3].position[k] - triangle->corner[c].position[k];
        lengths[0] += a[k] * a[k];
        lengths[1] += b[k] * b[k];
        dot += a[k] * b[k];
    }
    return acosf((float)fmax(-1, fmin(1, dot / (sqrt(lengths[0]) * sqrt(lengths[1])))));
}

/* Looks at every corner of the mesh. */
static void expect_normal(uint32_t count, uint32_t t, int c, uint16_t normal[2])
{
    float axis[3], sum[3] = {0};
    uint32_t seen = 0;
    face_normal(&mesh[t], axis);
    for (uint32_t other = 0; other < 3 * count && seen < MOST_FACES; other++) {
        float n[3];
        if (memcmp(mesh[other / 3].corner[other % 3].position, mesh[t].corner[c].position,
                   sizeof mesh->corner->position))
            continue;
        seen++;
        face_normal(&mesh[other / 3], n);
        if (n[0] * axis[0] + n[1] * axis[1] + n[2] * axis[2] >= CREASE_COSINE)
            for (int k = 0; k < 3; k++)
                sum[k] += angle_at(&mesh[other / 3], (int)(other % 3)) * n[k];
    }
    strl_oct_encode(sum[0] != 0 || sum[1] != 0 || sum[2] != 0 ? sum : axis, normal);
}

static void assert_filled(uint32_t count, uint32_t stride)
{
    strl_arena scratch = {0};
    memcpy(filled, mesh, sizeof mesh);
    assert_true(strl__fill_normals(filled, wanted, count, &scratch));
    strl_arena_deinit(&scratch);
    for (uint32_t t = 0; t < count; t += stride)
        for (int c = 0; c < 3; c++) {
            uint16_t normal[2] = {mesh[t].corner[c].normal[0], mesh[t].corner[c].normal[1]};
            if (wanted[t] && normal[0] == STRL_NORMAL_MISSING)
                expect_normal(count, t, c, normal);
            assert_memory_equal(filled[t].corner[c].normal, normal, sizeof normal);
        }
}

/* Corners on a small lattice, so that many share a position and faces lie in one plane. */
static void make_mesh(uint32_t count, uint32_t side, uint32_t seed)
{
    memset(mesh, 0, sizeof mesh);
    for (uint32_t corner = 0; corner < 3 * count; corner++) {
        strl_soup_corner *at = &mesh[corner / 3].corner[corner % 3];
        uint64_t random = strl__mix64((uint64_t)seed << 32 | corner);
        for (int k = 0; k < 3; k++)
            at->position[k] = 1000 + (uint32_t)(random >> 8 * k & 255) % side;
        at->position[corner % 3] += side; /* no two of a triangle fall together */
        at->normal[0] = random >> 40 & 3 ? STRL_NORMAL_MISSING : 17;
        at->normal[1] = at->normal[0];
        wanted[corner / 3] = (strl__mix64(corner / 3) & 7) != 0;
    }
}

static void normals_are_means_of_the_faces_round_a_position(void **state)
{
    (void)state;
    for (uint32_t side = 1; side < 7; side++) {
        make_mesh(400, side, side);
        assert_filled(400, 1);
    }
    make_mesh(1, 5, 1);
    assert_filled(1, 1);
}

/* The first 1,024 faces have a say; equal ones are as many. */
static void round_a_position_faces_may_be_very_many(void **state)
{
    (void)state;
    make_mesh(MOST_TRIANGLES, 9, 3);
    for (uint32_t t = 0; t < MOST_TRIANGLES; t++)
        if (t % 5)
            memcpy(mesh[t].corner[0].position, mesh[0].corner[0].position, sizeof mesh->corner->position);
    for (uint32_t t = 100; t < MOST_TRIANGLES; t += 3)
        mesh[t] = mesh[100];
    assert_filled(MOST_TRIANGLES, 7);
}

static void without_memory_it_says_so(void **state)
{
    (void)state;
    make_mesh(400, 5, 2);
    for (uint64_t n = 1;; n++) {
        strl_arena scratch = {0};
        strl__alloc_fail_after(n);
        bool good = strl__fill_normals(mesh, wanted, 400, &scratch);
        strl__alloc_fail_after(0);
        strl_arena_deinit(&scratch);
        if (good)
            break;
        assert_true(n < 20);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(normals_are_means_of_the_faces_round_a_position),
        cmocka_unit_test(round_a_position_faces_may_be_very_many),
        cmocka_unit_test(without_memory_it_says_so),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
