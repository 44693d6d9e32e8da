/* Progressive meshes come back from scratch as they went there; damaged bytes give a failure or a mesh that keeps every
 * invariant. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "build/clusters/pm_spill.h"
#include "geometry/test_pm.h"

#define SIDE 14u /* cells of the grid */

static void set_vertex(struct test_mesh *mesh, uint32_t v, uint32_t x, uint32_t y, bool coloured)
{
    uint64_t random = v + 1;
    mesh->position[v][0] = (int32_t)(x * 1000) - 5000;
    mesh->position[v][1] = (int32_t)(y * 1000) - 5000;
    mesh->position[v][2] = (int32_t)(x * y % 7) * 300;
    mesh->normal[v][0] = (uint16_t)test_below(&random, 1024);
    mesh->normal[v][1] = (uint16_t)(500 + x);
    if (coloured) {
        mesh->texcoord[v] = x << 4 | (65535 - y) << 16;
        mesh->colour[v] = 0xff000000u | test_below(&random, 3) * 0x3355u;
        mesh->palette_index[v] = (uint16_t)(x > SIDE / 2);
    }
}

/* A grid whose faces share their vertices, or have their own. */
static struct test_mesh grid(bool coloured, bool apart, strl_arena *arena)
{
    uint32_t triangles = 2 * SIDE * SIDE, vertices = apart ? 3 * triangles : (SIDE + 1) * (SIDE + 1);
    struct test_mesh mesh = test_mesh_make(vertices, triangles, arena);
    mesh.palette_count = coloured ? 3 : 1;
    mesh.colour = coloured ? strl_arena_alloc(arena, vertices, sizeof *mesh.colour) : NULL;
    mesh.texcoord = coloured ? strl_arena_alloc(arena, vertices, sizeof *mesh.texcoord) : NULL;
    mesh.palette_index = coloured ? strl_arena_alloc(arena, vertices, sizeof *mesh.palette_index) : NULL;
    for (uint32_t t = 0; t < triangles; t++) {
        static const uint32_t corner[2][3][2] = {{{0, 0}, {1, 0}, {1, 1}}, {{0, 0}, {1, 1}, {0, 1}}};
        for (uint32_t k = 0; k < 3; k++) {
            uint32_t x = t / 2 % SIDE + corner[t & 1][k][0], y = t / 2 / SIDE + corner[t & 1][k][1];
            uint32_t v = apart ? 3 * t + k : y * (SIDE + 1) + x;
            set_vertex(&mesh, v, apart ? 2 * x + k : x, apart ? 2 * y + (t & 1) : y, coloured);
            mesh.triangle[t][k] = (uint16_t)v;
        }
    }
    return mesh;
}

static strl_pm make(bool coloured, bool apart, strl_arena *arena)
{
    struct test_mesh mesh = grid(coloured, apart, arena);
    struct test_pm_desc desc = {.seed = 5, .keep = 40};
    strl_pm pm;
    strl_error err = {0};
    test_pm_make(&mesh, &desc, arena, &pm);
    if (strl_pm_check(&pm, &err))
        fail_msg("the test's own mesh is wrong: %s", err.message);
    assert_true(pm.step_count > 20);
    return pm;
}

#define assert_same(a, b, member, count)                                                                               \
    do {                                                                                                               \
        assert_int_equal((a)->member != NULL, (b)->member != NULL);                                                    \
        if ((a)->member)                                                                                               \
            assert_memory_equal((a)->member, (b)->member, (count) * sizeof *(a)->member);                              \
    } while (0)

static void assert_same_mesh(const strl_pm *a, const strl_pm *b)
{
    assert_int_equal(a->vertex_count, b->vertex_count);
    assert_int_equal(a->triangle_count, b->triangle_count);
    assert_int_equal(a->step_count, b->step_count);
    assert_int_equal(a->palette_count, b->palette_count);
    assert_same(a, b, position, a->vertex_count);
    assert_same(a, b, normal, a->vertex_count);
    assert_same(a, b, colour, a->vertex_count);
    assert_same(a, b, texcoord, a->vertex_count);
    assert_same(a, b, palette_index, a->vertex_count);
    assert_same(a, b, parent, a->vertex_count);
    assert_same(a, b, triangle, a->triangle_count);
    assert_same(a, b, vertex_end, a->step_count + 1);
    assert_same(a, b, triangle_end, a->step_count + 1);
    assert_same(a, b, geometric_error, a->step_count + 1);
    assert_same(a, b, appearance_error, a->step_count + 1);
    assert_same(a, b, palette, a->palette_count);
}

static strl_writer written(const strl_pm *pm, strl_arena *arena)
{
    strl_writer writer = {0};
    strl_error err = {0};
    if (strl_pm_spill_write(pm, arena, &writer, &err))
        fail_msg("%s", err.message);
    return writer;
}

static void a_mesh_comes_back_as_it_was(void **state)
{
    (void)state;
    for (unsigned coloured = 0; coloured < 2; coloured++) {
        strl_arena arena = {0};
        strl_pm pm = make(coloured, false, &arena), back;
        strl_writer bytes = written(&pm, &arena);
        strl_error err = {0};
        assert_true(strl_pm_spill_keeps_order(&pm));
        if (strl_pm_spill_read(bytes.data, bytes.size, &arena, &back, &err))
            fail_msg("%s", err.message);
        assert_same_mesh(&pm, &back);
        strl__free(bytes.data);
        strl_arena_deinit(&arena);
    }
}

/* In another order: what is compared here does not hang on it. */
static void faces_apart_come_back_in_another_order(void **state)
{
    (void)state;
    strl_arena arena = {0};
    strl_pm pm = make(true, true, &arena), back;
    strl_writer bytes = written(&pm, &arena);
    strl_error err = {0};
    int64_t sum = 0;
    assert_false(strl_pm_spill_keeps_order(&pm));
    if (strl_pm_spill_read(bytes.data, bytes.size, &arena, &back, &err))
        fail_msg("%s", err.message);
    assert_int_equal(back.vertex_count, pm.vertex_count);
    assert_same(&pm, &back, vertex_end, pm.step_count + 1);
    assert_same(&pm, &back, triangle_end, pm.step_count + 1);
    for (uint32_t v = 0; v < pm.vertex_count; v++)
        for (unsigned k = 0; k < 3; k++)
            sum += (int64_t)(k + 1) * (pm.position[v][k] - back.position[v][k]);
    assert_int_equal(sum, 0);
    strl__free(bytes.data);
    strl_arena_deinit(&arena);
}

/* In blocks of their own size, so that a reader past the end shows under the sanitizers. */
static bool is_taken(const uint8_t *data, size_t size)
{
    strl_arena arena = {0};
    strl_pm pm;
    strl_error err = {0};
    uint8_t *copy = malloc(size ? size : 1);
    assert_non_null(copy);
    memcpy(copy, data, size);
    bool taken = strl_pm_spill_read(copy, size, &arena, &pm, &err) == STRL_OK;
    if (taken)
        assert_int_equal(strl_pm_check(&pm, &err), STRL_OK);
    else
        assert_true(err.message[0] != 0);
    free(copy);
    strl_arena_deinit(&arena);
    return taken;
}

static void what_is_cut_off_is_refused(void **state)
{
    (void)state;
    strl_arena arena = {0};
    strl_pm pm = make(true, false, &arena);
    strl_writer bytes = written(&pm, &arena);
    for (size_t size = 0; size < bytes.size; size++)
        assert_false(is_taken(bytes.data, size));
    strl__free(bytes.data);
    strl_arena_deinit(&arena);
}

static void damage_gives_a_failure_or_a_good_mesh(void **state)
{
    (void)state;
    strl_arena arena = {0};
    strl_pm pm = make(true, false, &arena);
    strl_writer bytes = written(&pm, &arena);
    unsigned refused = 0;
    for (size_t i = 0; i < bytes.size * 8; i += 3) {
        uint8_t *byte = (uint8_t *)bytes.data + i / 8, bit = (uint8_t)(1u << i % 8);
        *byte ^= bit;
        refused += !is_taken(bytes.data, bytes.size);
        *byte ^= bit;
    }
    assert_true(refused > bytes.size);
    strl__free(bytes.data);
    strl_arena_deinit(&arena);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_mesh_comes_back_as_it_was),
        cmocka_unit_test(faces_apart_come_back_in_another_order),
        cmocka_unit_test(what_is_cut_off_is_refused),
        cmocka_unit_test(damage_gives_a_failure_or_a_good_mesh),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
