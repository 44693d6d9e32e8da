/* Scene `landscape`: hills with a forest of detailed trees and some houses among them, for what Klein et al. 2005 show:
 * detail that nobody can simplify, again and again. Ground is there once, in tiles; each kind of tree and house is made
 * once and has copies.
 *
 * The forest is a square of plots, each with a tree or a house; more triangles are more plots. */
#include "scenes/landscape/landscape.h"

#include <math.h>
#include <stdio.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"

#define PLOT 7.0 /* between trees */
#define GROUND_SHARE 0.06
#define HOUSE_SHARE 0.02 /* of plots */
enum { TILE = 64, COPIES_AT_ONCE = 4096 };

const strl__material strl__landscape_materials[STRL__LANDSCAPE_MATERIALS] = {
    {"GRASS", {120, 132, 70}, {0.18782, 0.23074, 0.06125}, 1, 0, 0.9},
    {"BARK", {104, 82, 62}, {0.13843, 0.08438, 0.04817}, 1, 0, 0.9},
    {"LEAF-OAK", {86, 120, 48}, {0.09306, 0.18782, 0.02956}, 1, 0, 0.8},
    {"LEAF-BEECH", {104, 142, 58}, {0.13843, 0.27050, 0.04231}, 1, 0, 0.8},
    {"LEAF-BIRCH", {142, 164, 74}, {0.27050, 0.37124, 0.06848}, 1, 0, 0.8},
    {"LEAF-MAPLE", {150, 96, 42}, {0.30499, 0.11697, 0.02315}, 1, 0, 0.8},
    {"LEAF-BUSH", {60, 96, 56}, {0.04519, 0.11697, 0.03955}, 1, 0, 0.8},
    {"WALL-WHITE", {226, 222, 210}, {0.76052, 0.73046, 0.64448}, 1, 0, 0.9},
    {"WALL-OCHRE", {205, 165, 100}, {0.61050, 0.37626, 0.12744}, 1, 0, 0.9},
    {"WALL-RED", {168, 84, 70}, {0.39157, 0.08866, 0.06125}, 1, 0, 0.9},
};

enum { KINDS = STRL__TREE_KINDS + STRL__HOUSE_KINDS };

typedef struct landscape {
    strl__scene_run *run;
    uint64_t seed;
    uint64_t side;                    /* plots along one */
    uint64_t plots;                   /* that are taken, row by row */
    uint32_t cells;                   /* of the ground, along a side */
    strl__part_mesh meshes[KINDS][2]; /* the second of trees: leaves */
    strl__part_mesh tile;
    strl__copy *copies; /* [COPIES_AT_ONCE] */
} landscape;

/* ---- ground */

static double lattice(uint64_t seed, int64_t x, int64_t y)
{
    return strl__landscape_random(seed ^
                                  strl__mix64((uint64_t)x * 0x9e3779b97f4a7c15u + (uint64_t)y * 0xd1342543de82ef95u));
}

static double noise(uint64_t seed, double x, double y)
{
    const double left = floor(x), low = floor(y), u = x - left, v = y - low;
    const double a = u * u * (3 - 2 * u), b = v * v * (3 - 2 * v);
    const int64_t i = (int64_t)left, k = (int64_t)low;
    const double below = lattice(seed, i, k) * (1 - a) + lattice(seed, i + 1, k) * a;
    const double above = lattice(seed, i, k + 1) * (1 - a) + lattice(seed, i + 1, k + 1) * a;
    return below * (1 - b) + above * b;
}

double strl__landscape_height(uint64_t seed, double x, double y)
{
    return 60 * noise(seed + 1, x / 400, y / 400) + 14 * noise(seed + 2, x / 90, y / 90) +
           2 * noise(seed + 3, x / 20, y / 20);
}

static void put_ground_vertex(landscape *scene, double x, double y, double step)
{
    const double position[3] = {x, y, strl__landscape_height(scene->seed, x, y)};
    double normal[3] = {
        strl__landscape_height(scene->seed, x - step, y) - strl__landscape_height(scene->seed, x + step, y),
        strl__landscape_height(scene->seed, x, y - step) - strl__landscape_height(scene->seed, x, y + step), 2 * step};
    strl__normalise(normal);
    strl__part_mesh_vertex(&scene->tile, position, normal);
}

static void make_tile(landscape *scene, uint32_t column, uint32_t row)
{
    const double step = PLOT * (double)scene->side / scene->cells;
    const uint32_t columns = scene->cells - column < TILE ? scene->cells - column : TILE;
    const uint32_t rows = scene->cells - row < TILE ? scene->cells - row : TILE;
    strl__part_mesh_clear(&scene->tile);
    scene->tile.place = strl__affine_identity();
    for (uint32_t y = 0; y <= rows; y++)
        for (uint32_t x = 0; x <= columns; x++)
            put_ground_vertex(scene, (column + x) * step, (row + y) * step, step);
    for (uint32_t y = 0; y < rows; y++)
        for (uint32_t x = 0; x < columns; x++) {
            const uint32_t a = y * (columns + 1) + x, b = a + columns + 1;
            strl__part_mesh_quad(&scene->tile, a, a + 1, b + 1, b);
        }
}

static strl_status put_ground(landscape *scene, strl_error *err)
{
    strl_status status = STRL_OK;
    for (uint32_t row = 0; row < scene->cells && status == STRL_OK; row += TILE)
        for (uint32_t column = 0; column < scene->cells && status == STRL_OK; column += TILE) {
            char name[STRL__PART_NAME_BYTES];
            snprintf(name, sizeof name, "GROUND-%u-%u", row / TILE, column / TILE);
            make_tile(scene, column, row);
            const strl__part part = {name, STRL__GRASS, strl__affine_identity(), &scene->tile};
            status = scene->tile.failed
                         ? strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for the ground", scene->run->desc->path)
                         : scene->run->parts->put_part(scene->run->parts, &part, err);
            if (status == STRL_OK)
                status = strl__scene_report(scene->run, "ground", row, scene->cells, err);
        }
    return status;
}

/* ---- forest */

static int kind_of(const landscape *scene, uint64_t plot)
{
    const uint64_t key = strl__mix64(scene->seed + 5) + plot * 0x9e3779b97f4a7c15u;
    const double choice = strl__landscape_random(key + 1);
    return strl__landscape_random(key) < HOUSE_SHARE ? STRL__TREE_KINDS + (int)(choice * STRL__HOUSE_KINDS)
                                                     : (int)(choice * STRL__TREE_KINDS);
}

static uint64_t triangles_of(const landscape *scene, int kind)
{
    return (uint64_t)scene->meshes[kind][0].triangle_count + scene->meshes[kind][1].triangle_count;
}

/* As many plots as the triangles suffice for. */
static void count_plots(landscape *scene)
{
    const uint64_t wanted = scene->run->desc->triangles;
    const double ground = GROUND_SHARE * (double)wanted;
    scene->cells = (uint32_t)lround(fmax(8, sqrt(ground / 2)));
    uint64_t used = 2 * (uint64_t)scene->cells * scene->cells;
    while (used + triangles_of(scene, kind_of(scene, scene->plots)) <= wanted)
        used += triangles_of(scene, kind_of(scene, scene->plots++));
    scene->side = (uint64_t)ceil(sqrt((double)scene->plots));
    scene->side = scene->side ? scene->side : 1;
}

static strl__copy copy_at(const landscape *scene, uint64_t plot)
{
    const uint64_t key = strl__mix64(scene->seed + 6) + plot * 0xd1342543de82ef95u;
    const bool is_house = kind_of(scene, plot) >= STRL__TREE_KINDS;
    double at[3] = {PLOT * ((double)(plot % scene->side) + 0.2 + 0.6 * strl__landscape_random(key)),
                    PLOT * ((double)(plot / scene->side) + 0.2 + 0.6 * strl__landscape_random(key + 1)), 0};
    at[2] = strl__landscape_height(scene->seed, at[0], at[1]) - 0.1;
    return strl__copy_upright(at, strl__landscape_random(key + 2),
                              is_house ? 1 : 0.7 + 0.6 * strl__landscape_random(key + 3));
}

static strl_status put_some(landscape *scene, int kind, uint32_t count, strl_error *err)
{
    static const char *const names[KINDS] = {"OAK",  "BEECH",       "BIRCH",       "MAPLE",
                                             "BUSH", "HOUSE-WHITE", "HOUSE-OCHRE", "HOUSE-RED"};
    strl__parts_writer *parts = scene->run->parts;
    const bool is_tree = kind < STRL__TREE_KINDS;
    const strl__affine plain = strl__affine_identity();
    const strl__part first = {names[kind], is_tree ? STRL__BARK : (unsigned)(STRL__WALL + kind - STRL__TREE_KINDS),
                              plain, &scene->meshes[kind][0]};
    const strl__part second = {names[kind], (unsigned)(STRL__LEAVES + kind), plain, &scene->meshes[kind][1]};
    strl_status status = count ? parts->put_copies(parts, &first, scene->copies, count, err) : STRL_OK;
    if (status == STRL_OK && count && is_tree)
        status = parts->put_copies(parts, &second, scene->copies, count, err);
    return status == STRL_OK ? strl__scene_report(scene->run, "forest", (uint64_t)kind, KINDS, err) : status;
}

static strl_status put_kind(landscape *scene, int kind, strl_error *err)
{
    strl_status status = STRL_OK;
    uint32_t count = 0;
    for (uint64_t plot = 0; plot < scene->plots && status == STRL_OK; plot++) {
        if (kind_of(scene, plot) != kind)
            continue;
        scene->copies[count++] = copy_at(scene, plot);
        if (count == COPIES_AT_ONCE) {
            status = put_some(scene, kind, count, err);
            count = 0;
        }
    }
    return status == STRL_OK ? put_some(scene, kind, count, err) : status;
}

static strl_status make_kinds(landscape *scene, strl_error *err)
{
    bool failed = false;
    for (int kind = 0; kind < STRL__TREE_KINDS; kind++)
        strl__landscape_tree(scene->seed, kind, &scene->meshes[kind][0], &scene->meshes[kind][1]);
    for (int kind = STRL__TREE_KINDS; kind < KINDS; kind++)
        strl__landscape_house(scene->seed, kind - STRL__TREE_KINDS, &scene->meshes[kind][0]);
    for (int kind = 0; kind < KINDS; kind++)
        failed = failed || scene->meshes[kind][0].failed || scene->meshes[kind][1].failed;
    return failed ? strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for a tree", scene->run->desc->path) : STRL_OK;
}

static strl_status put_all(landscape *scene, strl_error *err)
{
    /* glTF and OBJ have y up. */
    const strl__affine upright = {.axis = {{1, 0, 0}, {0, 0, -1}, {0, 1, 0}}};
    strl__parts_writer *parts = scene->run->parts;
    strl_status status = parts->open_group(parts, "LANDSCAPE", &upright, err);
    if (status == STRL_OK)
        status = put_ground(scene, err);
    for (int kind = 0; kind < KINDS && status == STRL_OK; kind++)
        status = put_kind(scene, kind, err);
    return status == STRL_OK ? parts->close_group(parts, err) : status;
}

strl_status strl__scene_landscape(strl__scene_run *run, strl_error *err)
{
    landscape *scene = strl__alloc_zero(1, sizeof *scene);
    if (!scene)
        return strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for a landscape", run->desc->path);
    scene->run = run;
    scene->seed = strl__mix64(run->desc->seed + 11);
    scene->copies = strl__alloc(COPIES_AT_ONCE, sizeof *scene->copies);
    strl_status status = scene->copies ? make_kinds(scene, err)
                                       : strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for copies", run->desc->path);
    if (status == STRL_OK) {
        count_plots(scene);
        status = put_all(scene, err);
    }
    for (int kind = 0; kind < KINDS; kind++)
        for (int i = 0; i < 2; i++)
            strl__part_mesh_deinit(&scene->meshes[kind][i]);
    strl__part_mesh_deinit(&scene->tile);
    strl__free(scene->copies);
    strl__free(scene);
    return status;
}
