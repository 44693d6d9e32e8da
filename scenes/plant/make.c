/* See plant.h: rehearsing, writing and naming; parts that many items have. */
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "scenes/plant/plant.h"

const strl__material strl__plant_materials[STRL__PLANT_MATERIALS] = {
    {"STEEL", {142, 147, 152}, {0.27050, 0.29177, 0.31399}, 1, 0.6, 0.5},
    {"GALVANISED", {176, 181, 184}, {0.43415, 0.46208, 0.47932}, 1, 0.7, 0.45},
    {"INSULATION", {208, 210, 212}, {0.63076, 0.64448, 0.65837}, 1, 0.5, 0.4},
    {"CONCRETE", {152, 148, 140}, {0.31399, 0.29614, 0.26225}, 1, 0, 0.9},
    {"SAFETY-YELLOW", {240, 190, 20}, {0.87137, 0.51492, 0.00700}, 1, 0, 0.6},
    {"GLASS", {150, 200, 215}, {0.30499, 0.57758, 0.67954}, 0.35, 0, 0.1},
    {"PIPE-WATER", {45, 120, 75}, {0.02624, 0.18782, 0.07036}, 1, 0, 0.5},
    {"PIPE-STEAM", {196, 90, 70}, {0.55201, 0.10224, 0.06125}, 1, 0, 0.5},
    {"PIPE-GAS", {205, 165, 60}, {0.61050, 0.37626, 0.04519}, 1, 0, 0.5},
    {"PIPE-AIR", {110, 165, 205}, {0.15593, 0.37626, 0.61050}, 1, 0, 0.5},
    {"PIPE-OIL", {112, 78, 50}, {0.16203, 0.07619, 0.03190}, 1, 0, 0.5},
    {"PIPE-ACID", {128, 92, 150}, {0.21586, 0.10702, 0.30499}, 1, 0, 0.5},
    {"PIPE-FIRE", {190, 32, 30}, {0.51492, 0.01444, 0.01298}, 1, 0, 0.5},
    {"TANK-WHITE", {226, 226, 220}, {0.76052, 0.76052, 0.71569}, 1, 0, 0.5},
    {"MACHINE-BLUE", {42, 84, 140}, {0.02315, 0.08866, 0.26225}, 1, 0.1, 0.5},
    {"PRIMER", {138, 74, 58}, {0.25415, 0.06848, 0.04231}, 1, 0, 0.7},
    {"CABLE", {36, 36, 40}, {0.01764, 0.01764, 0.02122}, 1, 0, 0.8},
    {"FRAME-GREY", {104, 116, 112}, {0.13843, 0.17465, 0.16203}, 1, 0.1, 0.6},
};

/* ---- items ---- */

static void report(strl__plant *plant)
{
    uint64_t wanted = plant->run->desc->triangles;
    plant->status = strl__scene_report(plant->run, "building", plant->made, wanted, plant->err);
}

bool strl__plant_try(strl__plant *plant, strl__plant_item item, const void *what, uint64_t keep)
{
    if (plant->status != STRL_OK)
        return false;
    strl__plant_state before = plant->state;
    plant->counts = true;
    plant->counted = 0;
    item(plant, what);
    plant->counts = false;
    bool fits = plant->counted > 0 && keep <= plant->left && plant->counted <= plant->left - keep;
    if (!fits)
        before.random = strl__mix64(before.random + 1); /* the next try is another one */
    plant->state = before;
    if (!fits || plant->status != STRL_OK)
        return false;
    item(plant, what);
    plant->left -= plant->counted;
    plant->made += plant->counted;
    if (plant->status == STRL_OK)
        report(plant);
    return plant->status == STRL_OK;
}

double strl__plant_random(strl__plant *plant)
{
    plant->state.random += 0x9e3779b97f4a7c15u;
    return (double)(strl__mix64(plant->state.random) >> 11) * 0x1p-53;
}

double strl__plant_between(strl__plant *plant, double low, double high)
{
    return low + (high - low) * strl__plant_random(plant);
}

int strl__plant_choice(strl__plant *plant, int count)
{
    return (int)(strl__plant_random(plant) * count);
}

bool strl__plant_chance(strl__plant *plant, double share)
{
    return strl__plant_random(plant) < share;
}

/* ---- groups and parts ---- */

void strl__plant_open_named(strl__plant *plant, const char *name, const strl__affine *place)
{
    plant->group = *place;
    plant->state.part_number = 0;
    if (plant->status == STRL_OK && !plant->counts)
        plant->status = plant->run->parts->open_group(plant->run->parts, name, place, plant->err);
}

void strl__plant_open(strl__plant *plant, const char *kind, const strl__affine *place)
{
    char name[STRL__PART_NAME_BYTES];
    snprintf(name, sizeof name, "%s-%04u", kind, ++plant->state.item_numbers[kind[0] - 'A']);
    strl__plant_open_named(plant, name, place);
}

void strl__plant_close(strl__plant *plant)
{
    if (plant->status == STRL_OK && !plant->counts)
        plant->status = plant->run->parts->close_group(plant->run->parts, plant->err);
}

strl__part_mesh *strl__plant_mesh(strl__plant *plant)
{
    strl__part_mesh_clear(&plant->mesh);
    return &plant->mesh;
}

static strl_status check_part(const strl__plant *plant, const char *name)
{
    uint32_t count = plant->mesh.triangle_count;
    if (plant->mesh.failed)
        return strl__fail(plant->err, STRL_ERR_MEMORY, "%s: no memory for a part", plant->run->desc->path);
    if (count < STRL__PLANT_PART_LEAST || count > STRL__PLANT_PART_MOST)
        return strl__fail(plant->err, STRL_ERR_INTERNAL, "part %s has %" PRIu32 " triangles, expected %d to %d", name,
                          count, STRL__PLANT_PART_LEAST, STRL__PLANT_PART_MOST);
    return STRL_OK;
}

void strl__plant_part(strl__plant *plant, const char *kind, strl__plant_material material, const strl__affine *place)
{
    char name[STRL__PART_NAME_BYTES];
    if (plant->status != STRL_OK)
        return;
    snprintf(name, sizeof name, "%s-%02u", kind, ++plant->state.part_number);
    plant->status = check_part(plant, name);
    if (plant->status != STRL_OK)
        return;
    plant->counted += plant->counts ? plant->mesh.triangle_count : 0;
    const strl__part part = {name, material, *place, &plant->mesh};
    if (!plant->counts)
        plant->status = plant->run->parts->put_part(plant->run->parts, &part, plant->err);
}

void strl__plant_add_nozzle(strl__plant *plant, const double position[3], const double direction[3], double radius)
{
    if (plant->state.nozzle_count == STRL__PLANT_NOZZLES)
        return;
    strl__nozzle *nozzle = &plant->state.nozzles[plant->state.nozzle_count++];
    strl__affine_point(&plant->group, position, nozzle->position);
    strl__affine_vector(&plant->group, direction, nozzle->direction);
    nozzle->radius = radius;
    nozzle->taken = false;
}

/* ---- parts that many items have ---- */

void strl__plant_box(strl__plant *plant, const char *kind, strl__plant_material material, const double low[3],
                     const double high[3])
{
    const strl__affine place = strl__affine_move(low[0], low[1], low[2]);
    const double zero[3] = {0}, size[3] = {high[0] - low[0], high[1] - low[1], high[2] - low[2]};
    strl__part_box(strl__plant_mesh(plant), zero, size);
    strl__plant_part(plant, kind, material, &place);
}

static strl__affine between(const double from[3], const double to[3], double *length)
{
    double way[3] = {to[0] - from[0], to[1] - from[1], to[2] - from[2]};
    *length = strl__normalise(way);
    return strl__affine_along(from, way);
}

void strl__plant_bar(strl__plant *plant, const char *kind, strl__plant_material material, const double from[3],
                     const double to[3], double radius, int sides)
{
    double length;
    const strl__affine place = between(from, to, &length);
    const double low[3] = {0}, high[3] = {0, 0, length};
    strl__part_bar(strl__plant_mesh(plant), low, high, radius, sides);
    strl__plant_part(plant, kind, material, &place);
}

void strl__plant_beam(strl__plant *plant, const char *kind, strl__plant_material material, const double from[3],
                      const double to[3], const strl__outline *outline)
{
    double length;
    const strl__affine place = between(from, to, &length);
    strl__part_prism(strl__plant_mesh(plant), outline, length);
    strl__plant_part(plant, kind, material, &place);
}

void strl__plant_bolts(strl__plant *plant, const strl__affine *place, double circle, int count, double radius,
                       double low, double high)
{
    strl__part_mesh *mesh = strl__plant_mesh(plant);
    for (int i = 0; i < count; i++) {
        double c, s;
        strl__circle_step(2 * i + 1, 2 * count, &c, &s);
        mesh->place = strl__affine_move(circle * c, circle * s, 0);
        strl__part_bolt(mesh, radius, low, high);
    }
    strl__plant_part(plant, "BOLTS", STRL__GALVANISED, place);
}

int strl__plant_sides(double radius)
{
    return radius < 0.03 ? 8 : radius < 0.06 ? 10 : radius < 0.09 ? 12 : radius < 0.16 ? 16 : radius < 0.25 ? 20 : 28;
}

double strl__plant_flange_thickness(double pipe_radius)
{
    return 0.018 + 0.14 * pipe_radius;
}

void strl__plant_flange(strl__plant *plant, const strl__affine *place, double pipe_radius, int count, bool bolts)
{
    double thick = strl__plant_flange_thickness(pipe_radius), outer = 1.45 * pipe_radius + 0.045;
    strl__part_mesh *mesh = strl__plant_mesh(plant);
    for (int i = 0; i < count; i++)
        strl__part_ring(mesh, pipe_radius * 0.9, outer, thick * i, thick * (i + 0.96),
                        strl__plant_sides(pipe_radius) + 2);
    strl__plant_part(plant, "FLANGE", STRL__STEEL, place);
    int around = pipe_radius < 0.045 ? 4 : pipe_radius < 0.13 ? 8 : pipe_radius < 0.22 ? 12 : 20;
    if (bolts)
        strl__plant_bolts(plant, place, (pipe_radius + outer) * 0.52, around, 0.006 + 0.03 * pipe_radius, -0.1 * thick,
                          thick * (count == 1 ? 2 : 2.1));
}

void strl__plant_ladder(strl__plant *plant, const strl__affine *place, double height)
{
    strl__part_mesh *mesh = strl__plant_mesh(plant);
    for (int side = 0; side < 2; side++) {
        const double low[3] = {0.48 * side, -0.03, 0}, high[3] = {0.48 * side + 0.02, 0.03, height + 1};
        strl__part_box(mesh, low, high);
    }
    for (double z = 0.3; z < height; z += 0.3) {
        const double from[3] = {0.01, 0, z}, to[3] = {0.49, 0, z};
        strl__part_bar(mesh, from, to, 0.012, 6);
    }
    strl__plant_part(plant, "LADDER", STRL__SAFETY_YELLOW, place);
    if (height < 3.5)
        return;
    mesh = strl__plant_mesh(plant);
    for (double z = 2.5; z < height + 1; z += 0.9) {
        mesh->place = strl__affine_move(0.25, -0.35, z);
        strl__part_ring(mesh, 0.34, 0.36, 0, 0.05, 10);
    }
    for (int i = 0; i < 5; i++) {
        double c, s;
        strl__circle(0.5 + 0.125 * i, &c, &s);
        mesh->place = strl__affine_move(0.25 + 0.35 * c, -0.35 + 0.35 * s, 0);
        const double low[3] = {-0.015, -0.015, 2.5}, high[3] = {0.015, 0.015, height + 1};
        strl__part_box(mesh, low, high);
    }
    strl__plant_part(plant, "CAGE", STRL__SAFETY_YELLOW, place);
}
