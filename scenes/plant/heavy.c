/* The few large pieces: air coolers, a boiler of tube walls, a cooling tower, a stack. */
#include "scenes/plant/plant.h"

#include <math.h>

/* Tubes along x in staggered rows, `count` in a row. */
static void put_cooler_tubes(strl__plant *plant, double length, double deep, int rows, int count)
{
    const strl__affine place = strl__affine_move(0, 0, 3.2);
    strl__part_mesh *mesh = strl__plant_mesh(plant);
    for (int row = 0; row < rows; row++)
        for (int i = 0; i < count; i++) {
            double y = deep * (i + 0.25 + 0.5 * (row & 1)) / count, z = 0.08 + 0.07 * row;
            const double from[3] = {0.1, y, z}, to[3] = {length - 0.1, y, z};
            strl__part_bar(mesh, from, to, 0.024, 8);
        }
    for (int i = 0; i < 7; i++) {
        const double low[3] = {length * i / 7 + 0.3, 0, 0.01}, high[3] = {low[0] + 0.04, deep, 0.04};
        strl__part_box(mesh, low, high);
    }
    strl__plant_part(plant, "FIN-TUBES", STRL__GALVANISED, &place);
}

static void put_fan(strl__plant *plant, double x, double y, double radius)
{
    const strl__affine place = strl__affine_move(x, y, 2.3);
    strl__part_mesh *mesh = strl__plant_mesh(plant);
    strl__part_ring(mesh, radius, radius + 0.05, 0, 0.9, 36);
    strl__plant_part(plant, "FAN-RING", STRL__GALVANISED, &place);
    mesh = strl__plant_mesh(plant);
    strl__part_disc(mesh, 0.18, 0.3, 0.55, 16);
    for (int blade = 0; blade < 6; blade++) {
        const strl__affine turn = strl__affine_turn(blade / 6.0, 0, 0, 0.42);
        const strl__affine pitch = {.axis = {{1, 0, 0}, {0, 0.8, 0.6}, {0, -0.6, 0.8}}};
        const double low[3] = {0.1, -0.13, -0.01}, high[3] = {radius - 0.05, 0.13, 0.01};
        mesh->place = strl__affine_of(&turn, &pitch);
        strl__part_box(mesh, low, high);
    }
    strl__plant_part(plant, "FAN", STRL__MACHINE_BLUE, &place);
    strl__part_disc(strl__plant_mesh(plant), 0.22, -0.7, 0.1, 20);
    strl__plant_part(plant, "MOTOR", STRL__MACHINE_BLUE, &place);
}

void strl__plant_item_air_cooler(strl__plant *plant, const void *what)
{
    const strl__plant_spot *spot = what;
    const strl__outline leg = strl__outline_i(0.16, 0.16, 0.012, 0.008);
    double length = spot->wide - 0.8, deep = spot->deep - 0.8;
    const strl__affine place = strl__affine_move(spot->x + 0.4, spot->y + 0.4, spot->z);
    strl__plant_open(plant, "AIRCOOLER", &place);
    put_cooler_tubes(plant, length, deep, strl__plant_chance(plant, 0.5) ? 8 : 6, (int)(deep / 0.06));
    int fans = length > 8 ? 2 : 1;
    for (int i = 0; i < fans; i++)
        put_fan(plant, length * (i + 0.5) / fans, deep / 2, fmin(length / fans, deep) * 0.42);
    for (int i = 0; i < 4; i++) {
        double x = i & 1 ? length - 0.1 : 0.1, y = i & 2 ? deep - 0.1 : 0.1;
        const double low[3] = {x, y, 0}, high[3] = {x, y, 3.2};
        strl__plant_beam(plant, "LEG", STRL__FRAME_GREY, low, high, &leg);
    }
    for (int end = 0; end < 2; end++) {
        const double low[3] = {end ? length - 0.12 : -0.12, 0, 3.15},
                     high[3] = {end ? length + 0.12 : 0.12, deep, 3.75};
        const double from[3] = {low[0] + 0.12, 0, 3.0}, to[3] = {from[0], deep, 3.0};
        strl__plant_box(plant, "HEADER-BOX", STRL__STEEL, low, high);
        strl__plant_beam(plant, "SILL", STRL__FRAME_GREY, from, to, &leg);
    }
    const double out[3] = {length / 2, -0.02, 3.45}, front[3] = {0, -1, 0};
    for (int side = 0; side < 2; side++) {
        const double low[3] = {0, side ? deep - 0.02 : 0, 3.15}, high[3] = {length, side ? deep : 0.02, 3.75};
        strl__plant_box(plant, "SIDE", STRL__GALVANISED, low, high);
    }
    strl__plant_add_nozzle(plant, out, front, 0.084);
    strl__plant_close(plant);
}

/* ---- boiler ---- */

/* A wall of tubes along the group's x, standing on the slope of a hopper; each tube has a fin to its neighbour. */
static void put_tube_wall(strl__plant *plant, const strl__affine *place, double wide, double high, double slope)
{
    int count = (int)(wide / 0.08);
    strl__part_mesh *mesh = strl__plant_mesh(plant);
    for (int i = 0; i < count; i++) {
        double x = wide * (i + 0.5) / count;
        strl__sweep_ring rings[6];
        for (int k = 0; k < 6; k++) {
            double z = k == 0   ? 0.4
                       : k == 1 ? 2.8
                                : 3.2 + (high - 3.2) * (k - 2) / 3,
                   in = k == 0   ? slope
                        : k == 1 ? 0.1
                                 : 0;
            rings[k] = (strl__sweep_ring){{x, in, z}, {1, 0, 0}, {0, 1, 0}};
        }
        strl__part_sweep(mesh, rings, 6, 0.03, 10, false);
        const double low[3] = {x, -0.006, 3.2}, fin[3] = {x + wide / count, 0.006, high};
        strl__part_box(mesh, low, fin);
    }
    strl__plant_part(plant, "TUBE-WALL", STRL__STEEL, place);
    const double header_z[2] = {0.4, high};
    for (int i = 0; i < 2; i++) {
        const double from[3] = {0, i ? 0 : slope, header_z[i]}, to[3] = {wide, i ? 0 : slope, header_z[i]};
        const strl__affine here = *place;
        strl__part_bar(strl__plant_mesh(plant), from, to, 0.16, 20);
        strl__plant_part(plant, "COLLECTOR", STRL__STEEL, &here);
    }
}

/* Platens of serpentine tubes that hang from the roof. */
static void put_superheater(strl__plant *plant, double wide, double deep, double high)
{
    enum { LOOPS = 8, STEPS = 4 };
    const strl__affine here = strl__affine_identity();
    strl__part_mesh *mesh = strl__plant_mesh(plant);
    for (double y = 0.6; y < deep - 0.4; y += 0.22) {
        strl__sweep_ring rings[2 * LOOPS * (STEPS + 1)];
        int count = 0;
        for (int loop = 0; loop < 2 * LOOPS; loop++)
            for (int i = 0; i <= STEPS; i++) {
                double c, s, x = wide * 0.2 + 0.22 * loop + 0.11, z = loop & 1 ? high - 3.2 : high - 0.5;
                strl__circle(0.5 * i / STEPS, &c, &s);
                double down = loop & 1 ? -1 : 1;
                /* Over the top forwards, under the bottom forwards too. */
                rings[count++] =
                    (strl__sweep_ring){{x - 0.11 * c, y, z + down * 0.11 * s}, {-down * c, 0, s}, {0, -1, 0}};
            }
        strl__part_sweep(mesh, rings, count, 0.024, 8, false);
    }
    strl__plant_part(plant, "SUPERHEATER", STRL__PRIMER, &here);
}

static void put_steam_drum(strl__plant *plant, double wide, double deep, double high)
{
    const strl__affine place = {.axis = {{0, 1, 0}, {0, 0, 1}, {1, 0, 0}}, .origin = {0, deep * 0.3, high + 1.1}};
    strl__part_disc(strl__plant_mesh(plant), 0.75, 0, wide, 40);
    strl__plant_part(plant, "STEAM-DRUM", STRL__INSULATION, &place);
    for (int i = 0; i < 8; i++) {
        double x = wide * (i + 0.5) / 8;
        const double from[3] = {x, deep * 0.3, high + 0.5}, to[3] = {x, i & 1 ? 0 : deep, high};
        strl__plant_bar(plant, "RISER", STRL__INSULATION, from, to, 0.08, 12);
    }
    for (int i = 0; i < 2; i++) {
        const double from[3] = {i ? wide + 0.5 : -0.5, deep * 0.3, high + 1.1}, to[3] = {from[0], from[1], 0.5};
        const double side[3] = {i ? wide - 0.1 : 0.1, from[1], from[2]};
        strl__plant_bar(plant, "DOWNCOMER", STRL__INSULATION, to, from, 0.2, 20);
        strl__plant_bar(plant, "DOWNCOMER", STRL__INSULATION, side, from, 0.2, 20);
    }
}

/* Fills its spot, floor to roof, inside the frame. */
void strl__plant_item_boiler(strl__plant *plant, const void *what)
{
    const strl__plant_spot *spot = what;
    double wide = spot->wide - 3, deep = spot->deep - 2.4, high = spot->high - 2.6;
    const strl__affine place = strl__affine_move(spot->x + 1.5, spot->y + 1.2, spot->z);
    strl__plant_open(plant, "BOILER", &place);
    for (int side = 0; side < 4; side++) {
        const double corners[4][2] = {{0, 0}, {wide, 0}, {wide, deep}, {0, deep}};
        const strl__affine wall = strl__affine_turn(0.25 * side, corners[side][0], corners[side][1], 0);
        put_tube_wall(plant, &wall, side & 1 ? deep : wide, high, side & 1 ? 0 : deep * 0.3);
    }
    put_superheater(plant, wide, deep, high);
    put_steam_drum(plant, wide, deep, high);
    for (int level = 0; level < (int)(high / 2.5); level++)
        for (int side = 0; side < 2; side++) {
            double z = 3.5 + 2.5 * level, y = side ? deep + 0.15 : -0.15;
            const double low[3] = {-0.2, y - 0.1, z}, up[3] = {wide + 0.2, y + 0.1, z + 0.25};
            if (z < high - 0.5)
                strl__plant_box(plant, "BUCKSTAY", STRL__PRIMER, low, up);
        }
    const double steam[3] = {wide * 0.5, deep * 0.3 - 0.74, high + 1.1}, front[3] = {0, -1, 0};
    strl__plant_add_nozzle(plant, steam, front, 0.162);
    strl__plant_close(plant);
}

/* ---- cooling tower and stack ---- */

static double tower_radius(double base, double t)
{
    double u = (t - 0.75) * 1.25; /* the waist lies at three quarters of the height */
    return base * 0.6 * sqrt(1 + u * u * 2.02);
}

static void put_fill(strl__plant *plant, double radius)
{
    strl__part_mesh *mesh = strl__plant_mesh(plant);
    const strl__affine place = strl__affine_move(0, 0, 3);
    for (int layer = 0; layer < 3; layer++)
        for (double at = -radius; at < radius; at += 0.18) {
            double half = sqrt(fmax(0, radius * radius - at * at));
            for (double x = -half; x + 1 < half; x += 1.0) {
                const double low[3] = {layer & 1 ? at : x, layer & 1 ? x : at, 0.35 * layer};
                const double high[3] = {low[0] + (layer & 1 ? 0.02 : 0.95), low[1] + (layer & 1 ? 0.95 : 0.02),
                                        low[2] + 0.3};
                strl__part_box(mesh, low, high);
            }
        }
    strl__plant_part(plant, "FILL", STRL__PIPE_WATER, &place);
}

void strl__plant_item_cooling_tower(strl__plant *plant, const void *what)
{
    enum { STEPS = 36 };
    const strl__plant_spot *spot = what;
    double radius = fmin(spot->wide, spot->deep) * 0.5 - 0.8, high = radius * 2.6;
    const strl__affine place = strl__affine_move(spot->x + spot->wide / 2, spot->y + spot->deep / 2, spot->z);
    const strl__affine here = strl__affine_identity();
    strl__turn_point points[2 * STEPS];
    for (int i = 0; i < STEPS; i++) {
        double t = (double)i / (STEPS - 1), r = tower_radius(radius, t), z = 4 + (high - 4) * t;
        points[i] = (strl__turn_point){r, z, i > 0 && i < STEPS - 1};
        points[2 * STEPS - 1 - i] = (strl__turn_point){r - 0.15, z, i > 0 && i < STEPS - 1};
    }
    strl__plant_open(plant, "TOWER", &place);
    strl__part_turned(strl__plant_mesh(plant), points, 2 * STEPS, true, 96);
    strl__plant_part(plant, "SHELL", STRL__CONCRETE, &here);
    double foot = radius * 1.04, top = tower_radius(radius, 0) - 0.08;
    for (int i = 0; i < 48; i++) {
        double c, s, c2, s2;
        strl__circle_step(i / 2 * 2, 48, &c, &s);
        strl__circle_step(i / 2 * 2 + (i & 1 ? 2 : 46), 48, &c2, &s2);
        const double from[3] = {foot * c, foot * s, 0}, to[3] = {top * (c + c2) / 2, top * (s + s2) / 2, 4.2};
        strl__plant_bar(plant, "LEG", STRL__CONCRETE, from, to, 0.16, 8);
    }
    put_fill(plant, top * 0.93);
    strl__part_ring(strl__plant_mesh(plant), radius * 1.06, radius * 1.1, 0, 0.9, 72);
    strl__plant_part(plant, "BASIN", STRL__CONCRETE, &here);
    const double side[3] = {0, -radius * 1.1, 0.6}, front[3] = {0, -1, 0};
    strl__plant_add_nozzle(plant, side, front, 0.162);
    strl__plant_close(plant);
}

void strl__plant_item_stack(strl__plant *plant, const void *what)
{
    const strl__plant_spot *spot = what;
    double radius = fmin(spot->wide, spot->deep) * 0.5 - 1.4, high = 45;
    const strl__affine place = strl__affine_move(spot->x + spot->wide / 2, spot->y + spot->deep / 2, spot->z);
    const strl__affine here = strl__affine_identity();
    strl__plant_open(plant, "STACK", &place);
    for (int i = 0; i < 9; i++) {
        double low = high * i / 9, top = high * (i + 1) / 9, r = radius * (1 - 0.05 * i),
               next = radius * (0.95 - 0.05 * i);
        const strl__turn_point points[] = {
            {r - 0.12, low, false}, {r, low, false}, {next, top, false}, {next - 0.12, top, false}};
        strl__part_turned(strl__plant_mesh(plant), points, 4, true, 48);
        strl__plant_part(plant, "CAN", i < 5 ? STRL__CONCRETE : i & 1 ? STRL__PIPE_FIRE : STRL__TANK_WHITE, &here);
    }
    const strl__affine ladder = strl__affine_move(-0.25, -radius - 0.2, 0);
    strl__plant_ladder(plant, &ladder, 18);
    strl__plant_close(plant);
}
