#include "build/meshes.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <cmocka.h>

#include "base/hash.h"

uint64_t mesh_random(uint64_t *state)
{
    return strl__mix64(*state += 0x9e3779b97f4a7c15u);
}

uint32_t mesh_below(uint64_t *state, uint32_t bound)
{
    return (uint32_t)((mesh_random(state) >> 32) * bound >> 32);
}

static void allocate(strl_mesh *mesh, uint32_t points, uint32_t triangles, strl_arena *arena)
{
    *mesh = (strl_mesh){0};
    assert_true(strl_mesh_create(mesh, points, points, triangles, arena));
    for (uint32_t p = 0; p < points; p++)
        mesh->wedge[p] = (strl_wedge){.point = p, .normal = {512, 512}, .colour = 0xffffffffu};
    for (uint32_t t = 0; t < triangles; t++) {
        mesh->drift[t] = (strl_drift){0};
        mesh->deviation[t] = mesh->shift[t] = 0;
    }
}

void mesh_begin_with_error(strl_mesh *mesh, float error)
{
    mesh->start_error = error;
}

static void set_triangle(strl_mesh *mesh, uint32_t t, uint32_t a, uint32_t b, uint32_t c)
{
    mesh->triangle[t][0] = a, mesh->triangle[t][1] = b, mesh->triangle[t][2] = c;
}

/* A square grid of `side` cells from point `first` and triangle `face` on, diagonals at random. */
static void set_grid(strl_mesh *mesh, uint32_t first, uint32_t face, uint32_t side, uint64_t *random)
{
    for (uint32_t y = 0; y < side; y++)
        for (uint32_t x = 0; x < side; x++, face += 2) {
            uint32_t a = first + y * (side + 1) + x, b = a + 1, c = a + side + 1, d = c + 1;
            if (mesh_random(random) & 1) {
                set_triangle(mesh, face, a, b, d);
                set_triangle(mesh, face + 1, a, d, c);
            } else {
                set_triangle(mesh, face, a, b, c);
                set_triangle(mesh, face + 1, b, d, c);
            }
        }
}

static void make_field(strl_mesh *mesh, uint32_t side, int32_t spacing, int32_t rough, int32_t jitter, double swell,
                       uint64_t seed, strl_arena *arena)
{
    uint64_t random = seed;
    allocate(mesh, (side + 1) * (side + 1), 2 * side * side, arena);
    for (uint32_t p = 0; p < mesh->point_count; p++) {
        int32_t x = (int32_t)(p % (side + 1)) - (int32_t)side / 2, y = (int32_t)(p / (side + 1)) - (int32_t)side / 2;
        double height = swell * sin(x * 0.5 + (double)(seed % 7)) * cos(y * 0.37);
        mesh->position[p][0] = x * spacing + (x && jitter ? (int32_t)mesh_below(&random, (uint32_t)jitter) : 0);
        mesh->position[p][1] = y * spacing + (jitter ? (int32_t)mesh_below(&random, (uint32_t)jitter) : 0);
        mesh->position[p][2] = (int32_t)height + (rough ? (int32_t)mesh_below(&random, (uint32_t)rough) : 0);
    }
    set_grid(mesh, 0, 0, side, &random);
}

void mesh_make_hills(strl_mesh *mesh, uint64_t seed, strl_arena *arena)
{
    make_field(mesh, 20, 100, 8, 40, 220, seed, arena);
}

static void make_noise(strl_mesh *mesh, uint64_t seed, strl_arena *arena)
{
    make_field(mesh, 16, 60, 200, 55, 0, seed, arena);
}

static void make_flat(strl_mesh *mesh, uint64_t seed, strl_arena *arena)
{
    make_field(mesh, 20, 64, 0, 30, 0, seed, arena);
}

void mesh_make_disc(strl_mesh *mesh, uint64_t seed, strl_arena *arena)
{
    make_field(mesh, 60, 20, 0, 8, 0, seed, arena);
    for (uint32_t p = 0; p < mesh->point_count; p++) {
        const int32_t *at = mesh->position[p];
        mesh->wedge[p].colour = at[0] * at[0] + at[1] * at[1] < 400 * 400 ? 0xffffffffu : 0xff000000u;
    }
}

/* Rings round an axis between two poles; each point a little off. */
static void make_ball(strl_mesh *mesh, int32_t radius, uint32_t rough, uint64_t seed, strl_arena *arena)
{
    enum { RINGS = 16, SECTORS = 24 };
    uint64_t random = seed;
    uint32_t face = 0, south = RINGS * SECTORS, north = south + 1;
    allocate(mesh, RINGS * SECTORS + 2, 2 * RINGS * SECTORS, arena);
    for (uint32_t p = 0; p < south; p++) {
        double polar = 3.14159265358979 * (p / SECTORS + 1) / (RINGS + 1),
               round = 6.28318530717959 * (p % SECTORS) / SECTORS;
        double r = radius + (double)mesh_below(&random, rough + 1);
        mesh->position[p][0] = (int32_t)lrint(r * sin(polar) * cos(round));
        mesh->position[p][1] = (int32_t)lrint(r * sin(polar) * sin(round));
        mesh->position[p][2] = (int32_t)lrint(-r * cos(polar));
    }
    const int32_t poles[2][3] = {{0, 0, -radius}, {0, 0, radius}};
    memcpy(mesh->position[south], poles, sizeof poles);
    for (uint32_t s = 0; s < SECTORS; s++) {
        uint32_t next = (s + 1) % SECTORS;
        set_triangle(mesh, face++, south, next, s);
        set_triangle(mesh, face++, north, (RINGS - 1) * SECTORS + s, (RINGS - 1) * SECTORS + next);
        for (uint32_t r = 0; r + 1 < RINGS; r++) {
            uint32_t a = r * SECTORS + s, b = r * SECTORS + next;
            set_triangle(mesh, face++, a, b, b + SECTORS);
            set_triangle(mesh, face++, a, b + SECTORS, a + SECTORS);
        }
    }
    assert_int_equal(face, mesh->triangle_count);
}

void mesh_make_sphere(strl_mesh *mesh, uint64_t seed, strl_arena *arena)
{
    make_ball(mesh, 1000, 0, seed, arena);
}

static void make_potato(strl_mesh *mesh, uint64_t seed, strl_arena *arena)
{
    make_ball(mesh, 700, 120, seed, arena);
}

/* Three sheets that meet in one edge line, which is shared: no manifold. */
static void make_fins(strl_mesh *mesh, uint64_t seed, strl_arena *arena)
{
    enum { SIDE = 10, SHEETS = 3, SPINE = SIDE + 1 };
    uint64_t random = seed;
    uint32_t face = 0;
    allocate(mesh, SPINE + SHEETS * SIDE * SPINE, 2 * SHEETS * SIDE * SIDE, arena);
    for (uint32_t p = 0; p < mesh->point_count; p++) {
        uint32_t sheet = p < SPINE ? 0 : (p - SPINE) / (SIDE * SPINE),
                 in = p < SPINE ? p : (p - SPINE) % (SIDE * SPINE);
        double out = p < SPINE ? 0 : 100. * (in / SPINE + 1), turn = 2.1 * sheet;
        mesh->position[p][0] = (int32_t)(out * cos(turn)) + (int32_t)mesh_below(&random, 20);
        mesh->position[p][1] = (int32_t)(out * sin(turn)) + (int32_t)mesh_below(&random, 20);
        mesh->position[p][2] = (int32_t)(in % SPINE) * 100 + (int32_t)mesh_below(&random, 20);
    }
    for (uint32_t sheet = 0; sheet < SHEETS; sheet++)
        for (uint32_t row = 0; row < SIDE; row++)
            for (uint32_t x = 0; x < SIDE; x++) {
                uint32_t upper = SPINE + (sheet * SIDE + row) * SPINE + x, lower = row ? upper - SPINE : x;
                set_triangle(mesh, face++, lower, lower + 1, upper + 1);
                set_triangle(mesh, face++, lower, upper + 1, upper);
            }
}

/* Triangles between any three of some points near each other: edges of one to many triangles, turned either way. */
static void make_soup(strl_mesh *mesh, uint64_t seed, strl_arena *arena)
{
    enum { POINTS = 220, TRIANGLES = 420 };
    uint64_t random = seed;
    allocate(mesh, POINTS, TRIANGLES, arena);
    for (uint32_t p = 0; p < POINTS; p++) {
        int32_t base = (int32_t)(p * 37); /* all different */
        for (int k = 0; k < 3; k++)
            mesh->position[p][k] = (int32_t)mesh_below(&random, 600) + (k == 0 ? base : 0);
    }
    for (uint32_t t = 0; t < TRIANGLES; t++) {
        uint32_t a = mesh_below(&random, POINTS - 12), b = a + 1 + mesh_below(&random, 5),
                 c = a + 6 + mesh_below(&random, 5);
        set_triangle(mesh, t, a, t & 1 ? b : c, t & 1 ? c : b);
    }
}

void mesh_make_boxes(strl_mesh *mesh, uint32_t boxes, uint64_t seed, strl_arena *arena)
{
    static const uint8_t corner[12][3] = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                                          {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
    uint64_t random = seed;
    allocate(mesh, 8 * boxes, 12 * boxes, arena);
    for (uint32_t b = 0; b < boxes; b++) {
        int32_t at[3] = {(int32_t)(b % 10) * 400, (int32_t)(b / 10 % 10) * 400, (int32_t)(b / 100) * 400}, size[3];
        for (int k = 0; k < 3; k++) {
            at[k] += (int32_t)mesh_below(&random, 150);
            size[k] = 20 + (int32_t)mesh_below(&random, 200);
        }
        for (uint32_t c = 0; c < 8; c++)
            for (int k = 0; k < 3; k++)
                mesh->position[8 * b + c][k] = at[k] + (c >> k & 1 ? size[k] : 0);
        for (uint32_t t = 0; t < 12; t++)
            set_triangle(mesh, 12 * b + t, 8 * b + corner[t][0], 8 * b + corner[t][1], 8 * b + corner[t][2]);
    }
}

static void make_some_boxes(strl_mesh *mesh, uint64_t seed, strl_arena *arena)
{
    mesh_make_boxes(mesh, 40, seed, arena);
}

void mesh_add_seam(strl_mesh *mesh, bool other_palette, uint64_t seed, strl_arena *arena)
{
    uint32_t points = mesh->point_count;
    uint64_t random = seed;
    strl_wedge *wedge = strl_arena_alloc(arena, (size_t)points * 2, sizeof *wedge);
    uint32_t *beyond = strl_arena_alloc(arena, points, sizeof *beyond);
    assert_non_null(wedge);
    assert_non_null(beyond);
    memcpy(wedge, mesh->wedge, points * sizeof *wedge);
    for (uint32_t p = 0; p < points; p++) {
        beyond[p] = p;
        wedge[p].colour = (uint32_t)mesh_random(&random) | 0xff000000u;
        if (mesh->position[p][0] == 0) {
            beyond[p] = mesh->wedge_count;
            wedge[mesh->wedge_count++] = wedge[p];
            wedge[beyond[p]].colour = ~wedge[p].colour | 0xff000000u;
        }
        if (mesh->position[p][0] >= 0)
            wedge[beyond[p]].palette = other_palette;
    }
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        int64_t sum = 0;
        for (int c = 0; c < 3; c++)
            sum += mesh->position[mesh->triangle[t][c]][0];
        for (int c = 0; c < 3 && sum > 0; c++)
            mesh->triangle[t][c] = beyond[mesh->triangle[t][c]];
    }
    mesh->wedge = wedge;
}

const mesh_kind mesh_kinds[] = {
    {"hills", mesh_make_hills, false, true},  {"noise", make_noise, false, true},     {"flat", make_flat, false, true},
    {"sphere", mesh_make_sphere, true, true}, {"potato", make_potato, true, true},    {"fins", make_fins, false, false},
    {"soup", make_soup, false, false},        {"boxes", make_some_boxes, true, true}, {NULL, NULL, false, false},
};
