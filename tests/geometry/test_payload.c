/* The payload codec gives back every state of a progressive mesh, and takes nothing that breaks its invariants. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "geometry/payload.h"
#include "geometry/payload_streams.h"
#include "geometry/test_pm.h"

/* ---- comparing states ---- */
static uint64_t vertex_hash(const strl_pm *pm, uint32_t v)
{
    uint64_t hash = 1;
    for (unsigned k = 0; k < 3; k++)
        hash = strl__mix64(hash ^ (uint32_t)pm->position[v][k]) + k;
    hash = strl__mix64(hash ^ (uint64_t)pm->normal[v][0] << 16 ^ pm->normal[v][1]);
    hash = strl__mix64(hash ^ (pm->colour ? pm->colour[v] : 0xffffffffu));
    hash = strl__mix64(hash ^ (pm->texcoord ? pm->texcoord[v] : 0));
    return strl__mix64(hash ^ (pm->palette_index ? pm->palette_index[v] : 0u));
}

static uint32_t resolve(const strl_pm *pm, uint32_t corner, uint32_t state)
{
    while (corner >= pm->vertex_end[state])
        corner = pm->parent[corner];
    return corner;
}

/* The same for any order of triangles and any rotation of corners, but not for turned-over triangles. */
static uint64_t state_hash(const strl_pm *pm, const uint64_t *vertex, uint32_t state)
{
    uint64_t sum = 0;
    for (uint32_t t = 0; t < pm->triangle_end[state]; t++) {
        uint64_t c[3], best = UINT64_MAX;
        for (unsigned k = 0; k < 3; k++)
            c[k] = vertex[resolve(pm, pm->triangle[t][k], state)];
        for (unsigned k = 0; k < 3; k++) {
            uint64_t hash = strl__mix64(strl__mix64(strl__mix64(c[k]) + c[(k + 1) % 3]) + c[(k + 2) % 3]);
            best = hash < best ? hash : best;
        }
        sum += best;
    }
    return sum;
}

static uint64_t *vertex_hashes(const strl_pm *pm)
{
    uint64_t *hash = malloc(((size_t)pm->vertex_count + 1) * sizeof *hash);
    assert_non_null(hash);
    for (uint32_t v = 0; v < pm->vertex_count; v++)
        hash[v] = vertex_hash(pm, v);
    return hash;
}

static void assert_error_rounded_up(float original, float decoded)
{
    assert_true(decoded >= original);
    assert_true(decoded <= original * 1.05f || decoded <= 0x1p-64f);
    assert_true(original > 0 || decoded == 0);
}

static void assert_same_states(const strl_pm *a, const strl_pm *b)
{
    assert_int_equal(a->vertex_count, b->vertex_count);
    assert_int_equal(a->triangle_count, b->triangle_count);
    assert_int_equal(a->step_count, b->step_count);
    assert_int_equal(a->palette_count, b->palette_count);
    assert_memory_equal(a->palette, b->palette, a->palette_count * sizeof *a->palette);
    assert_int_equal(a->colour != NULL, b->colour != NULL);
    assert_int_equal(a->texcoord != NULL, b->texcoord != NULL);
    assert_int_equal(a->palette_index != NULL, b->palette_index != NULL);
    uint64_t *hash_a = vertex_hashes(a), *hash_b = vertex_hashes(b), unused = 0;
    for (uint32_t s = 0; s <= a->step_count; s++) {
        assert_int_equal(a->vertex_end[s], b->vertex_end[s]);
        assert_int_equal(a->triangle_end[s], b->triangle_end[s]);
        assert_error_rounded_up(a->geometric_error[s], b->geometric_error[s]);
        assert_error_rounded_up(a->appearance_error[s], b->appearance_error[s]);
        assert_true(state_hash(a, hash_a, s) == state_hash(b, hash_b, s));
    }
    for (uint32_t v = 0; v < a->vertex_count; v++)
        unused += strl__mix64(hash_a[v]) - strl__mix64(hash_b[v]); /* vertices of no triangle come back too */
    assert_true(unused == 0);
    free(hash_a);
    free(hash_b);
}

static void encode(const strl_pm *pm, strl_writer *writer)
{
    strl_arena scratch;
    strl_error err = {0};
    strl_arena_init(&scratch, 0);
    if (strl_payload_encode(pm, NULL, &scratch, writer, NULL, &err))
        fail_msg("%s", err.message);
    strl_arena_deinit(&scratch);
}

/* Returns the payload's size. */
static size_t assert_round_trip(const strl_pm *pm)
{
    strl_error err = {0};
    strl_writer writer = {0};
    strl_arena arena;
    strl_pm decoded;
    strl_payload_sizes sizes;
    strl_arena_init(&arena, 0);
    if (strl_pm_check(pm, &err))
        fail_msg("the test's own mesh is wrong: %s", err.message);
    encode(pm, &writer);
    assert_int_equal(strl_payload_peek(writer.data, writer.size, &sizes, &err), STRL_OK);
    assert_int_equal(sizes.vertex_count, pm->vertex_count);
    assert_int_equal(sizes.base_triangle_count, pm->triangle_end[0]);
    if (strl_payload_decode(writer.data, writer.size, NULL, &arena, &decoded, &err) || strl_pm_check(&decoded, &err))
        fail_msg("%s", err.message);
    assert_same_states(pm, &decoded);
    /* What came back is a fixed point but for the order of base vertices, so its size can differ only a little. */
    strl_writer again = {0};
    encode(&decoded, &again);
    strl_pm twice;
    assert_int_equal(strl_payload_decode(again.data, again.size, NULL, &arena, &twice, &err), STRL_OK);
    assert_same_states(&decoded, &twice);
    size_t size = writer.size;
    strl__free(again.data);
    strl__free(writer.data);
    strl_arena_deinit(&arena);
    return size;
}

/* ---- meshes ---- */
static struct test_mesh hills(strl_arena *arena)
{
    return test_mesh_hills(17, 14, 200, 0.4, 5, arena);
}

/* A torus of lattice positions; a sphere is one whose inner radius is nothing but the poles' rows, see below. */
static struct test_mesh torus(strl_arena *arena)
{
    struct test_mesh mesh = test_mesh_grid(20, 12, true, true, arena);
    for (uint32_t v = 0; v < mesh.vertex_count; v++) {
        double a = v % 20 * 6.283185307 / 20, b = v / 20 * 6.283185307 / 12, r = 5000 + 2000 * cos(b);
        mesh.position[v][0] = (int32_t)lrint(r * cos(a));
        mesh.position[v][1] = (int32_t)lrint(r * sin(a));
        mesh.position[v][2] = (int32_t)lrint(2000 * sin(b));
    }
    test_mesh_normals(&mesh);
    return mesh;
}

/* A closed sphere: an octahedron's rings between two poles. */
static struct test_mesh sphere(strl_arena *arena)
{
    enum { AROUND = 18, RINGS = 9 };
    struct test_mesh mesh = test_mesh_make(AROUND * RINGS + 2, 2 * AROUND * RINGS, arena);
    uint32_t t = 0, pole = AROUND * RINGS;
    for (uint32_t v = 0; v < AROUND * RINGS; v++) {
        double a = v % AROUND * 6.283185307 / AROUND, b = (v / AROUND + 1) * 3.14159265 / (RINGS + 1);
        mesh.position[v][0] = (int32_t)lrint(90000 * sin(b) * cos(a));
        mesh.position[v][1] = (int32_t)lrint(90000 * sin(b) * sin(a));
        mesh.position[v][2] = (int32_t)lrint(90000 * cos(b));
    }
    mesh.position[pole][2] = 90000;
    mesh.position[pole + 1][2] = -90000;
    for (uint32_t i = 0; i < AROUND; i++) {
        uint16_t j = (uint16_t)((i + 1) % AROUND), last = AROUND * (RINGS - 1);
        memcpy(mesh.triangle[t++], (uint16_t[3]){(uint16_t)pole, (uint16_t)i, j}, 6);
        memcpy(mesh.triangle[t++], (uint16_t[3]){(uint16_t)(pole + 1), (uint16_t)(last + j), (uint16_t)(last + i)}, 6);
        for (uint32_t r = 0; r + 1 < RINGS; r++) {
            uint16_t a = (uint16_t)(r * AROUND + i), b = (uint16_t)(r * AROUND + j);
            memcpy(mesh.triangle[t++], (uint16_t[3]){a, (uint16_t)(a + AROUND), b}, 6);
            memcpy(mesh.triangle[t++], (uint16_t[3]){b, (uint16_t)(a + AROUND), (uint16_t)(b + AROUND)}, 6);
        }
    }
    assert_int_equal(t, mesh.triangle_count);
    test_mesh_normals(&mesh);
    return mesh;
}

/* Hills cut along two lines that cross: vertices there exist two or four times, with colours and palette entries of
 * their own. */
static struct test_mesh seams(strl_arena *arena)
{
    struct test_mesh plain = hills(arena), mesh = test_mesh_make(plain.vertex_count * 4, plain.triangle_count, arena);
    uint32_t *number = malloc(plain.vertex_count * 4 * sizeof *number), count = 0;
    assert_non_null(number);
    memset(number, 0xff, plain.vertex_count * 4 * sizeof *number);
    mesh.colour = strl_arena_alloc(arena, mesh.vertex_count, 4);
    mesh.texcoord = strl_arena_alloc(arena, mesh.vertex_count, 4);
    mesh.palette_index = strl_arena_alloc(arena, mesh.vertex_count, 2);
    mesh.palette_count = 5;
    for (uint32_t t = 0; t < plain.triangle_count; t++) {
        uint32_t cell = t / 2, side = (cell % 16 >= 8) + 2 * (cell / 16 >= 7);
        for (unsigned k = 0; k < 3; k++) {
            uint32_t v = plain.triangle[t][k], *n = &number[4 * v + side];
            if (*n == UINT32_MAX) {
                *n = count++;
                memcpy(mesh.position[*n], plain.position[v], 12);
                mesh.normal[*n][0] = (uint16_t)(plain.normal[v][0] / 2 + 200 * side);
                mesh.normal[*n][1] = plain.normal[v][1];
                mesh.colour[*n] = 0xff000000u + 0x203040u * side + v;
                mesh.texcoord[*n] = v % 70 ? (v * 300 & 0xffff) | (0xffff - v) << 16 : v % 140 ? 0xffffffffu : 0;
                mesh.palette_index[*n] = (uint16_t)(side + (v % 50 == 0));
            }
            mesh.triangle[t][k] = (uint16_t)*n;
        }
    }
    mesh.vertex_count = count;
    free(number);
    return mesh;
}

/* Five sheets that meet in one line, each edge of which has five triangles, and two of them turned over. */
static struct test_mesh fins(strl_arena *arena)
{
    enum { LONG = 12, WIDE = 4, SHEETS = 5 };
    struct test_mesh mesh = test_mesh_make(LONG + SHEETS * LONG * WIDE, 2 * SHEETS * (LONG - 1) * WIDE, arena);
    uint32_t t = 0;
    for (uint32_t v = 0; v < mesh.vertex_count; v++) {
        uint32_t along = v % LONG, sheet = v < LONG ? 0 : (v / LONG - 1) / WIDE,
                 out = v < LONG ? 0 : (v / LONG - 1) % WIDE + 1;
        mesh.position[v][0] = (int32_t)(along * 1000);
        mesh.position[v][1] = (int32_t)lrint(out * 800 * cos(sheet * 1.2566));
        mesh.position[v][2] = (int32_t)lrint(out * 800 * sin(sheet * 1.2566));
    }
    for (uint32_t sheet = 0; sheet < SHEETS; sheet++)
        for (uint32_t out = 0; out < WIDE; out++)
            for (uint32_t i = 0; i + 1 < LONG; i++) {
                uint16_t a = (uint16_t)(i + (out ? LONG * (sheet * WIDE + out) : 0)),
                         b = (uint16_t)(i + LONG * (sheet * WIDE + out + 1));
                uint16_t c = (uint16_t)(a + 1), d = (uint16_t)(b + 1);
                bool turned = sheet > 2;
                memcpy(mesh.triangle[t++], (uint16_t[3]){a, turned ? c : b, turned ? b : c}, 6);
                memcpy(mesh.triangle[t++], (uint16_t[3]){c, turned ? d : b, turned ? b : d}, 6);
            }
    test_mesh_normals(&mesh);
    return mesh;
}

/* Triangles between random vertices, some of them twice, and vertices of no triangle. */
static struct test_mesh soup(strl_arena *arena)
{
    uint64_t random = 99;
    struct test_mesh mesh = test_mesh_make(150, 220, arena);
    for (uint32_t v = 0; v < mesh.vertex_count; v++)
        for (unsigned k = 0; k < 3; k++) {
            mesh.position[v][k] = (int32_t)(test_random(&random) >> (v % 9 ? 40 : 32));
            mesh.normal[v][k % 2] = (uint16_t)test_below(&random, 1024);
        }
    for (uint32_t t = 0; t < mesh.triangle_count; t++) {
        if (t % 7 == 6) {
            memcpy(mesh.triangle[t], mesh.triangle[t - 3], 6);
            continue;
        }
        do
            for (unsigned k = 0; k < 3; k++)
                mesh.triangle[t][k] = (uint16_t)test_below(&random, 140);
        while (mesh.triangle[t][0] == mesh.triangle[t][1] || mesh.triangle[t][1] == mesh.triangle[t][2] ||
               mesh.triangle[t][2] == mesh.triangle[t][0]);
    }
    return mesh;
}

/* Triangles with no vertex in common, many of them touching at equal positions. */
static struct test_mesh shards(strl_arena *arena)
{
    struct test_mesh grid = hills(arena), mesh = test_mesh_make(grid.triangle_count * 3, grid.triangle_count, arena);
    for (uint32_t c = 0; c < mesh.vertex_count; c++) {
        uint32_t v = grid.triangle[c / 3][c % 3];
        memcpy(mesh.position[c], grid.position[v], 12);
        mesh.position[c][2] += c / 3 % 2 ? 0 : 40;
        memcpy(mesh.normal[c], grid.normal[v], 4);
        mesh.triangle[c / 3][c % 3] = (uint16_t)c;
    }
    return mesh;
}

static const struct {
    const char *name;
    struct test_mesh (*make)(strl_arena *arena);
} meshes[] = {{"hills", hills}, {"torus", torus}, {"sphere", sphere}, {"seams", seams},
              {"fins", fins},   {"soup", soup},   {"shards", shards}};
enum { MESHES = sizeof meshes / sizeof *meshes };

/* ---- tests ---- */
static void random_collapses_come_back_in_every_state(void **state)
{
    (void)state;
    for (unsigned m = 0; m < MESHES; m++)
        for (unsigned round = 0; round < 6; round++) {
            strl_arena arena;
            strl_pm pm;
            strl_arena_init(&arena, 0);
            struct test_mesh mesh = meshes[m].make(&arena);
            struct test_pm_desc desc = {.seed = 77 * m + round,
                                        .keep = round % 3 == 2 ? 1 : mesh.vertex_count / (round % 3 + 2),
                                        .virtual_percent = round >= 3 ? 20 : 0};
            test_pm_make(&mesh, &desc, &arena, &pm);
            assert_true(pm.step_count > 0);
            assert_round_trip(&pm);
            strl_arena_deinit(&arena);
        }
}

static void a_smooth_manifold_costs_few_bytes(void **state)
{
    (void)state;
    strl_arena arena;
    strl_pm pm;
    strl_arena_init(&arena, 0);
    struct test_mesh mesh = test_mesh_hills(60, 60, 1000, 0.3, 3, &arena);
    struct test_pm_desc desc = {.seed = 1, .keep = 1900, .keep_shape = true};
    test_pm_make(&mesh, &desc, &arena, &pm);
    assert_true(pm.step_count > 1500);
    size_t size = assert_round_trip(&pm);
    assert_true(size <= (size_t)pm.vertex_count * 9);
    strl_arena_deinit(&arena);
}

static void the_smallest_meshes_come_back(void **state)
{
    (void)state;
    int32_t position[4][3] = {{INT32_MIN, 0, 0}, {INT32_MAX, INT32_MIN, 5}, {0, INT32_MAX, INT32_MIN}, {1, 2, 3}};
    uint16_t normal[4][2] = {{0, 0}, {1023, 1023}, {0, 1023}, {512, 511}}, parent[4] = {0},
             triangle[1][3] = {{0, 1, 2}};
    uint32_t vertex_end[2] = {3, 4}, triangle_end[2] = {1, 1}, colour[4] = {1, 0xffffffffu, 0x80ff0001u, 3};
    float geometric[2] = {0x1p64f, 0}, appearance[2] = {0x1p-140f, 0};
    strl_palette_entry palette = {UINT32_MAX, 0, 0x80000000u};
    strl_pm pm = {.vertex_count = 3,
                  .triangle_count = 1,
                  .palette_count = 1,
                  .position = position,
                  .normal = normal,
                  .parent = parent,
                  .triangle = triangle,
                  .vertex_end = vertex_end,
                  .triangle_end = triangle_end,
                  .geometric_error = geometric,
                  .appearance_error = appearance,
                  .palette = &palette};
    assert_round_trip(&pm); /* one triangle, no step */
    pm.vertex_count = 4;
    pm.step_count = 1;
    assert_round_trip(&pm); /* a step with no triangle */
    pm.colour = colour;
    assert_round_trip(&pm);
    pm.texcoord = (uint32_t[4]){0xffff0000u, 0, 0xffffffffu, 0x80007fffu};
    assert_round_trip(&pm);
    pm.vertex_count = pm.triangle_count = pm.step_count = 0;
    vertex_end[0] = triangle_end[0] = 0;
    assert_round_trip(&pm); /* nothing at all */
}

static strl_status decode_and_check(const uint8_t *data, size_t size, const strl_payload_reference *reference)
{
    strl_arena arena;
    strl_pm pm;
    strl_error err = {0};
    strl_arena_init(&arena, (size_t)256 << 20);
    uint8_t *exact = malloc(size ? size : 1); /* so that a sanitizer sees a read past the end */
    assert_non_null(exact);
    memcpy(exact, data, size);
    strl_status status = strl_payload_decode(exact, size, reference, &arena, &pm, &err);
    if (!status && strl_pm_check(&pm, &err))
        fail_msg("accepted, but: %s", err.message);
    if (status)
        assert_true(status == STRL_ERR_FORMAT && err.message[0]);
    free(exact);
    strl_arena_deinit(&arena);
    return status;
}

/* A mesh that others are told by: its normals are its own or, where it has none, all the same. */
static strl_payload_reference reference_to(const struct test_mesh *mesh, strl_arena *arena)
{
    uint16_t(*normal)[2] = strl_arena_alloc(arena, mesh->vertex_count, sizeof *normal);
    assert_non_null(normal);
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        for (unsigned k = 0; k < 2; k++)
            normal[v][k] = mesh->normal ? mesh->normal[v][k] : 512;
    return (strl_payload_reference){.vertex_count = mesh->vertex_count,
                                    .triangle_count = mesh->triangle_count,
                                    .position = mesh->position,
                                    .normal = normal,
                                    .position_stride = sizeof *mesh->position,
                                    .normal_stride = sizeof *normal,
                                    .triangle = (const uint16_t(*)[3])mesh->triangle};
}

/* The base mesh of pm and, apart from it, one triangle more; without every seventh triangle; each third one rotated. */
static strl_payload_reference reference_for(const strl_pm *pm, int32_t shift, strl_arena *arena)
{
    struct test_mesh mesh = {.vertex_count = pm->vertex_end[0] + 3};
    mesh.position = strl_arena_alloc(arena, mesh.vertex_count, sizeof *mesh.position);
    mesh.triangle = strl_arena_alloc(arena, (size_t)pm->triangle_end[0] + 1, sizeof *mesh.triangle);
    mesh.normal = strl_arena_alloc_zero(arena, mesh.vertex_count, sizeof *mesh.normal);
    assert_true(mesh.position && mesh.triangle && mesh.normal);
    uint32_t last = pm->vertex_end[0];
    memcpy(mesh.normal, pm->normal, last * sizeof *mesh.normal);
    for (uint32_t v = 0; v < mesh.vertex_count; v++)
        for (int32_t k = 0; k < 3; k++)
            mesh.position[v][k] =
                (int32_t)((v < last ? (uint32_t)pm->position[v][k] : v * 7u + (uint32_t)k * v) - (uint32_t)shift);
    mesh.triangle[mesh.triangle_count][0] = (uint16_t)last;
    mesh.triangle[mesh.triangle_count][1] = (uint16_t)(last + 1);
    mesh.triangle[mesh.triangle_count++][2] = (uint16_t)(last + 2);
    for (uint32_t t = 0; t < pm->triangle_end[0]; t++) {
        if (t % 7 == 3)
            continue;
        for (uint32_t k = 0; k < 3; k++)
            mesh.triangle[mesh.triangle_count][k] = (uint16_t)resolve(pm, pm->triangle[t][(k + t % 3) % 3], 0);
        mesh.triangle_count++;
    }
    strl_payload_reference reference = reference_to(&mesh, arena);
    for (int k = 0; k < 3; k++)
        reference.offset[k] = shift;
    return reference;
}

static void assert_order(const strl_pm *pm, const strl_pm *decoded, const strl_payload_order *order)
{
    for (uint32_t v = 0; v < pm->vertex_count; v++)
        assert_memory_equal(decoded->position[v], pm->position[order->vertex[v]], sizeof *pm->position);
    for (uint32_t t = 0; t < pm->triangle_count; t++)
        for (uint32_t k = 0; k < 3; k++)
            assert_int_equal(order->vertex[decoded->triangle[t][k]],
                             pm->triangle[order->triangle[t] / 4][(order->triangle[t] % 4 + k) % 3]);
}

static void what_another_mesh_has_is_copied_from_it(void **state)
{
    (void)state;
    for (unsigned m = 0; m < MESHES; m++)
        for (unsigned round = 0; round < 2; round++) {
            strl_arena arena;
            strl_pm pm, decoded;
            strl_error err = {0};
            strl_writer alone = {0}, told = {0};
            strl_arena_init(&arena, 0);
            struct test_mesh mesh = meshes[m].make(&arena);
            struct test_pm_desc desc = {
                .seed = 5 * m + round, .keep = mesh.vertex_count / 2, .virtual_percent = round * 20};
            test_pm_make(&mesh, &desc, &arena, &pm);
            for (uint32_t v = 0; v < pm.vertex_count && round; v++) /* as few bits as they may have */
                for (unsigned k = 0; k < 2; k++)
                    pm.normal[v][k] = strl_oct_coarsen(pm.normal[v][k]);
            strl_payload_reference reference = reference_for(&pm, round ? INT32_MIN + 5 : 12345, &arena);
            strl_payload_order order = {strl_arena_alloc(&arena, pm.vertex_count, sizeof *order.vertex),
                                        strl_arena_alloc(&arena, pm.triangle_count, sizeof *order.triangle)};
            encode(&pm, &alone);
            assert_int_equal(strl_payload_encode(&pm, &reference, &arena, &told, &order, &err), STRL_OK);
            assert_true(m != 0 || told.size < alone.size * 3 / 4);
            if (strl_payload_decode(told.data, told.size, &reference, &arena, &decoded, &err) ||
                strl_pm_check(&decoded, &err))
                fail_msg("%s: %s", meshes[m].name, err.message);
            assert_same_states(&pm, &decoded);
            assert_order(&pm, &decoded, &order);
            assert_int_equal(decode_and_check(told.data, told.size, NULL), STRL_ERR_FORMAT);
            assert_int_equal(decode_and_check(alone.data, alone.size, &reference), STRL_ERR_FORMAT);
            for (size_t bit = m; bit < told.size * 8; bit += 61) {
                told.data[bit / 8] ^= (uint8_t)(1u << bit % 8);
                decode_and_check(told.data, told.size, &reference);
                told.data[bit / 8] ^= (uint8_t)(1u << bit % 8);
            }
            strl__free(alone.data);
            strl__free(told.data);
            strl_arena_deinit(&arena);
        }
}

/* All sixteen steps of an octave, both ends of the scale, and nothing between that falls below its claim. */
static void errors_round_up_by_less_than_a_twentieth(void **state)
{
    (void)state;
    float before = 0;
    for (uint32_t code = 1; code <= STRL__ERROR_CODE_MAX; code++) {
        float error = strl__error_of_code(code);
        assert_true(error > before && strl__code_of_error(error) == code);
        if (before > 0) {
            assert_true(error <= before * 1.045f);
            assert_int_equal(strl__code_of_error(nextafterf(before, 1e30f)), code);
        }
        before = error;
    }
    assert_true(before == STRL_PM_MAX_ERROR);
    assert_int_equal(strl__code_of_error(0), 0);
    assert_true(strl__error_of_code(1) == 0x1p-64f);
}

static void every_value_has_its_symbol(void **state)
{
    (void)state;
    for (unsigned bit = 0; bit < 32; bit++)
        for (int64_t offset = -40; offset <= 40; offset++) {
            uint32_t value = (uint32_t)(((int64_t)1 << bit) + offset);
            unsigned symbol = strl__symbol_of(value);
            assert_true(symbol < STRL__SYMBOLS);
            assert_true(value >= strl__symbol_base(symbol));
            assert_true(value - strl__symbol_base(symbol) < (uint64_t)1 << strl__symbol_raw_bits(symbol));
            assert_int_equal(strl__unzigzag(strl__zigzag(value)), value);
        }
}

static void make_payload(unsigned mesh_index, uint32_t keep, strl_writer *writer)
{
    strl_arena arena;
    strl_pm pm;
    strl_arena_init(&arena, 0);
    struct test_mesh mesh = meshes[mesh_index].make(&arena);
    struct test_pm_desc desc = {.seed = mesh_index, .keep = keep, .virtual_percent = 5};
    test_pm_make(&mesh, &desc, &arena, &pm);
    encode(&pm, writer);
    strl_arena_deinit(&arena);
}

static void a_payload_cut_short_or_too_long_is_refused(void **state)
{
    (void)state;
    for (unsigned m = 0; m < MESHES; m += 3) {
        strl_writer writer = {0};
        make_payload(m, 40, &writer);
        for (size_t size = 0; size < writer.size; size++)
            assert_int_equal(decode_and_check(writer.data, size, NULL), STRL_ERR_FORMAT);
        size_t whole = writer.size;
        assert_int_equal(decode_and_check(writer.data, whole, NULL), STRL_OK);
        for (unsigned extra = 1; extra < 5; extra++) {
            strl_writer_u8(&writer, 0);
            assert_int_equal(decode_and_check(writer.data, whole + extra, NULL), STRL_ERR_FORMAT);
        }
        strl__free(writer.data);
    }
}

static void flipped_bits_are_refused_or_give_a_sound_mesh(void **state)
{
    (void)state;
    uint64_t random = 4711;
    unsigned refused = 0;
    for (unsigned m = 0; m < MESHES; m++) {
        strl_writer writer = {0};
        make_payload(m, 60, &writer);
        for (size_t bit = 0; bit < writer.size * 8; bit += 1 + test_below(&random, 12)) {
            writer.data[bit / 8] ^= (uint8_t)(1u << bit % 8);
            refused += decode_and_check(writer.data, writer.size, NULL) != STRL_OK;
            writer.data[bit / 8] ^= (uint8_t)(1u << bit % 8);
        }
        assert_int_equal(decode_and_check(writer.data, writer.size, NULL), STRL_OK);
        strl__free(writer.data);
    }
    assert_true(refused > 100);
}

/* Payloads whose every stream is sound but says something random: past the entropy coder, into the mesh rules. */
static void random_streams_are_refused_or_give_a_sound_mesh(void **state)
{
    (void)state;
    uint64_t random = 12;
    strl_arena arena;
    strl_arena_init(&arena, 0);
    struct test_mesh other = test_mesh_hills(4, 4, 100, 0.3, 3, &arena);
    strl_payload_reference reference = reference_to(&other, &arena);
    for (unsigned round = 0; round < 6000; round++) {
        struct strl__streams_out out = {0};
        strl_writer writer = {0};
        uint32_t vertices = 4 + test_below(&random, 30), base = 3 + test_below(&random, vertices - 3);
        uint32_t triangles = 1 + test_below(&random, 30), base_triangles = test_below(&random, triangles + 1);
        const uint32_t bytes[3] = {1, round % 2 ? 4 : 0, round % 4 < 2 ? 10 : 8};
        const uint32_t words[4] = {vertices, base, vertices - base, 1};
        for (unsigned i = 0; i < 3; i++)
            strl_writer_u8(&writer, (uint8_t)bytes[i]);
        for (unsigned i = 0; i < 4; i++)
            strl_writer_u16(&writer, (uint16_t)words[i]);
        strl_writer_u32(&writer, triangles);
        strl_writer_u32(&writer, base_triangles);
        for (unsigned id = 0; id < STRL__STREAM_COUNT; id++)
            for (unsigned i = 0; i < 100; i++)
                strl__push(&out, id,
                           test_below(&random, 1 + test_below(&random, id < 6                      ? 6
                                                                       : id >= STRL__STREAM_SELECT ? 3
                                                                                                   : 12)));
        strl_error err = {0};
        assert_int_equal(
            strl__streams_write(&out, strl__stream_count(false), 0, vertices + triangles + 1, &writer, &err), STRL_OK);
        decode_and_check(writer.data, writer.size, round % 2 ? &reference : NULL);
        strl__streams_deinit(&out);
        strl__free(writer.data);
    }
    strl_arena_deinit(&arena);
}

static void without_memory_both_directions_fail_cleanly(void **state)
{
    (void)state;
    strl_arena arena;
    strl_pm pm;
    strl_writer sound = {0};
    strl_arena_init(&arena, 0);
    struct test_mesh mesh = seams(&arena);
    test_pm_make(&mesh, &(struct test_pm_desc){.keep = 60}, &arena, &pm);
    encode(&pm, &sound);
    for (unsigned direction = 0; direction < 2; direction++) {
        strl_status status = STRL_ERR_MEMORY;
        for (uint64_t n = 1; status; n++) {
            strl_arena scratch;
            strl_writer writer = {0};
            strl_error err = {0};
            strl_pm decoded;
            strl_arena_init(&scratch, 0);
            strl__alloc_fail_after(n);
            status = direction ? strl_payload_encode(&pm, NULL, &scratch, &writer, NULL, &err)
                               : strl_payload_decode(sound.data, sound.size, NULL, &scratch, &decoded, &err);
            strl__alloc_fail_after(0);
            assert_true(status == STRL_OK || status == STRL_ERR_MEMORY);
            assert_true(n > 1 || status == STRL_ERR_MEMORY);
            strl__free(writer.data);
            strl_arena_deinit(&scratch);
        }
    }
    strl__free(sound.data);
    strl_arena_deinit(&arena);
}

/* The checker sees each kind of damage that a builder's mistake could do. */
static void the_checker_finds_what_is_broken(void **state)
{
    (void)state;
    strl_arena arena;
    strl_pm pm;
    strl_error err = {0};
    strl_arena_init(&arena, 0);
    struct test_mesh mesh = seams(&arena);
    test_pm_make(&mesh, &(struct test_pm_desc){.keep = 60, .seed = 3}, &arena, &pm);
    assert_int_equal(strl_pm_check(&pm, &err), STRL_OK);
    uint32_t last = pm.vertex_count - 1, steps = pm.step_count;
#define BREAK(place, wrong)                                                                                            \
    do {                                                                                                               \
        __typeof__(place) kept = place;                                                                                \
        place = wrong;                                                                                                 \
        assert_int_not_equal(strl_pm_check(&pm, &err), STRL_OK);                                                       \
        assert_true(err.message[0]);                                                                                   \
        place = kept;                                                                                                  \
    } while (0)
    BREAK(pm.vertex_count, 65536);
    BREAK(pm.palette_count, 0);
    BREAK(pm.vertex_end[1], pm.vertex_end[0]);
    BREAK(pm.vertex_end[steps], last);
    BREAK(pm.triangle_end[steps], 0);
    BREAK(pm.geometric_error[0], -1.f);
    BREAK(pm.geometric_error[steps], 1e9f);
    BREAK(pm.appearance_error[0], 1e30f);
    BREAK(pm.appearance_error[1], nanf(""));
    BREAK(pm.normal[4][1], 1024);
    BREAK(pm.palette_index[last], (uint16_t)pm.palette_count);
    BREAK(pm.parent[last], (uint16_t)last);
    BREAK(pm.parent[0], 1);
    BREAK(pm.triangle[0][2], pm.triangle[0][1]);
    BREAK(pm.triangle[0][0], (uint16_t)pm.vertex_count);
    strl_writer writer = {0};
    pm.normal[0][0] = 5000;
    strl_arena scratch;
    strl_arena_init(&scratch, 0);
    assert_int_not_equal(strl_payload_encode(&pm, NULL, &scratch, &writer, NULL, &err), STRL_OK);
    assert_int_equal(writer.size, 0);
    strl_arena_deinit(&scratch);
    strl__free(writer.data);
    strl_arena_deinit(&arena);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(random_collapses_come_back_in_every_state),
        cmocka_unit_test(a_smooth_manifold_costs_few_bytes),
        cmocka_unit_test(the_smallest_meshes_come_back),
        cmocka_unit_test(what_another_mesh_has_is_copied_from_it),
        cmocka_unit_test(errors_round_up_by_less_than_a_twentieth),
        cmocka_unit_test(every_value_has_its_symbol),
        cmocka_unit_test(a_payload_cut_short_or_too_long_is_refused),
        cmocka_unit_test(flipped_bits_are_refused_or_give_a_sound_mesh),
        cmocka_unit_test(random_streams_are_refused_or_give_a_sound_mesh),
        cmocka_unit_test(without_memory_both_directions_fail_cleanly),
        cmocka_unit_test(the_checker_finds_what_is_broken),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
