/* Pressure vessels, exchangers and tanks, with their nozzles, saddles, platforms and ladders. */
#include "scenes/plant/plant.h"

#include <math.h>

enum { HEAD_STEPS = 6 };

static int vessel_sides(double radius)
{
    return radius < 0.5 ? 24 : radius < 1.2 ? 36 : radius < 3 ? 48 : 72;
}

/* A cylinder about z from 0 to `high` between two elliptical heads half as deep as wide. */
static void add_shell(strl__part_mesh *mesh, double radius, double high)
{
    strl__turn_point points[2 * HEAD_STEPS + 2];
    int count = 0;
    for (int i = 0; i <= 2 * HEAD_STEPS + 1; i++) {
        bool top = i > HEAD_STEPS;
        double c, s;
        strl__circle(0.25 * (top ? 2 * HEAD_STEPS + 1 - i : i) / HEAD_STEPS, &c, &s);
        points[count++] = (strl__turn_point){i == 0 || i == 2 * HEAD_STEPS + 1 ? 0 : radius * s,
                                             top ? high + radius * 0.5 * c : -radius * 0.5 * c, true};
    }
    strl__part_turned(mesh, points, count, false, vessel_sides(radius));
}

/* A neck with its flange, `reach` long, and the place where a line may begin. */
static void put_nozzle(strl__plant *plant, const double from[3], const double way[3], double radius, double reach)
{
    double to[3];
    const double thick = strl__plant_flange_thickness(radius);
    for (int k = 0; k < 3; k++)
        to[k] = from[k] + way[k] * (reach - thick);
    strl__plant_bar(plant, "NECK", STRL__STEEL, from, to, radius, strl__plant_sides(radius));
    const strl__affine flange = strl__affine_along(to, way);
    strl__plant_flange(plant, &flange, radius, 1, true);
    for (int k = 0; k < 3; k++)
        to[k] += way[k] * thick;
    strl__plant_add_nozzle(plant, to, way, radius);
}

static double nozzle_radius(strl__plant *plant, double vessel_radius)
{
    static const double radii[] = {0.03, 0.045, 0.057, 0.084, 0.084, 0.11, 0.137, 0.162};
    double radius = radii[strl__plant_choice(plant, 8)];
    return fmin(radius, vessel_radius * 0.3);
}

static void put_manway(strl__plant *plant, const double at[3], const double way[3])
{
    const strl__affine place = strl__affine_along(at, way);
    strl__part_mesh *mesh = strl__plant_mesh(plant);
    strl__part_disc(mesh, 0.28, -0.2, 0.2, 24);
    strl__part_disc(mesh, 0.36, 0.2, 0.25, 24);
    strl__part_disc(mesh, 0.36, 0.255, 0.31, 24);
    strl__plant_part(plant, "MANWAY", STRL__STEEL, &place);
    strl__plant_bolts(plant, &place, 0.32, 16, 0.013, 0.19, 0.32);
}

static void put_gauge(strl__plant *plant, const double at[3], const double way[3])
{
    const strl__affine place = strl__affine_along(at, way);
    strl__part_mesh *mesh = strl__plant_mesh(plant);
    strl__part_disc(mesh, 0.012, -0.05, 0.15, 6);
    strl__part_disc(mesh, 0.075, 0.15, 0.2, 16);
    strl__plant_part(plant, "GAUGE", STRL__CABLE, &place);
    strl__part_disc(strl__plant_mesh(plant), 0.068, 0.2, 0.205, 16);
    strl__plant_part(plant, "GLASS", STRL__GLASS, &place);
}

static void put_plate(strl__plant *plant, const double at[3])
{
    const double low[3] = {at[0] - 0.15, at[1] - 0.01, at[2]}, high[3] = {at[0] + 0.15, at[1] + 0.01, at[2] + 0.2};
    strl__plant_box(plant, "NAMEPLATE", STRL__TANK_WHITE, low, high);
}

/* ---- upright vessels ---- */

/* A ring of grating round a column, with its rail on brackets. */
static void put_platform(strl__plant *plant, double radius, double z)
{
    const strl__affine place = strl__affine_move(0, 0, z);
    double outer = radius + 1.0;
    int bars = (int)(outer * 6.283 / 0.12);
    strl__part_mesh *mesh = strl__plant_mesh(plant);
    for (int i = 0; i < bars; i++) {
        mesh->place = strl__affine_turn((double)i / bars, 0, 0, 0);
        const double low[3] = {radius + 0.06, -0.004, -0.035}, high[3] = {outer, 0.004, 0};
        strl__part_box(mesh, low, high);
    }
    mesh->place = strl__affine_identity();
    for (int i = 0; i < 3; i++)
        strl__part_ring(mesh, radius + 0.06 + 0.45 * i, radius + 0.09 + 0.45 * i, -0.06, -0.01, 32);
    strl__plant_part(plant, "PLATFORM", STRL__GALVANISED, &place);
    mesh = strl__plant_mesh(plant);
    for (int i = 0; i < 16; i++) {
        double c, s;
        strl__circle_step(i, 16, &c, &s);
        const double low[3] = {outer * c, outer * s, -0.05}, high[3] = {outer * c, outer * s, 1.1};
        strl__part_bar(mesh, low, high, 0.02, 6);
    }
    for (int i = 0; i < 2; i++)
        strl__part_ring(mesh, outer - 0.02, outer + 0.02, i ? 1.08 : 0.55, i ? 1.12 : 0.59, 32);
    strl__plant_part(plant, "HANDRAIL", STRL__SAFETY_YELLOW, &place);
}

static void put_skirt(strl__plant *plant, double radius, double high)
{
    const strl__affine here = strl__affine_identity();
    int sides = vessel_sides(radius);
    strl__part_mesh *mesh = strl__plant_mesh(plant);
    strl__part_ring(mesh, radius * 0.97, radius, 0.03, high, sides);
    strl__part_ring(mesh, radius * 0.9, radius + 0.15, 0, 0.03, sides);
    strl__part_ring(mesh, radius, radius + 0.15, 0.25, 0.28, sides);
    strl__plant_part(plant, "SKIRT", STRL__PRIMER, &here);
    strl__plant_bolts(plant, &here, radius + 0.09, radius < 1 ? 12 : 20, 0.018, 0.0, 0.29);
}

static void put_bands(strl__plant *plant, double radius, double low, double high, double step)
{
    const strl__affine here = strl__affine_identity();
    int count = (int)((high - low) / step);
    strl__part_mesh *mesh = strl__plant_mesh(plant);
    for (int i = 0; i < count; i++)
        strl__part_ring(mesh, radius * 0.99, radius + 0.03, low + step * (i + 0.5), low + step * (i + 0.5) + 0.06,
                        vessel_sides(radius));
    if (count > 0)
        strl__plant_part(plant, "BANDS", STRL__STEEL, &here);
}

/* Nozzles to the rack's side and to left and right. */
static void put_side_nozzles(strl__plant *plant, double radius, double low, double high, int count)
{
    for (int i = 0; i < count; i++) {
        const double way[3] = {i % 3 == 1 ? -1 : i % 3 == 2, i % 3 ? 0 : -1, 0};
        double r = nozzle_radius(plant, radius), z = low + (high - low) * (i + 0.4) / count;
        const double from[3] = {way[0] * radius * 0.9, way[1] * radius * 0.9, z};
        put_nozzle(plant, from, way, r, radius * 0.1 + 0.2 + r);
    }
}

void strl__plant_item_column_vessel(strl__plant *plant, const void *what)
{
    const strl__plant_spot *spot = what;
    double radius = fmin(spot->wide, spot->deep) * 0.5 - 1.15;
    bool tall = spot->high > 10;
    radius = tall ? radius : fmin(radius, 1.3);
    double total = tall ? strl__plant_between(plant, 0.5, 1) * spot->high : spot->high - 0.5, skirt = tall ? 2.5 : 0.9;
    double shell = total - skirt - radius * 0.5;
    const strl__affine place = strl__affine_move(spot->x + spot->wide / 2, spot->y + spot->deep / 2, spot->z);
    const strl__affine at = strl__affine_move(0, 0, skirt);
    strl__plant_open(plant, tall ? "COLUMN" : "VESSEL", &place);
    put_skirt(plant, radius, skirt);
    add_shell(strl__plant_mesh(plant), radius, shell);
    strl__plant_part(plant, "SHELL", strl__plant_chance(plant, 0.6) ? STRL__INSULATION : STRL__TANK_WHITE, &at);
    put_bands(plant, radius, skirt, skirt + shell, tall ? 2 : 1);
    put_side_nozzles(plant, radius, skirt + 0.2, skirt + shell, tall ? 9 : 5);
    const double top[3] = {0, 0, skirt + shell + radius * 0.4}, up[3] = {0, 0, 1};
    put_nozzle(plant, top, up, nozzle_radius(plant, radius), radius * 0.1 + 0.35);
    const double door[3] = {0, radius, skirt + 0.8}, back[3] = {0, 1, 0};
    put_manway(plant, door, back);
    const double plate[3] = {radius * 0.35, -radius * 0.95, skirt + 0.5};
    put_plate(plant, plate);
    const double gauge[3] = {radius * 0.7, radius * 0.7, skirt + 0.4}, out[3] = {1, 1, 0};
    put_gauge(plant, gauge, out);
    for (int i = 1; tall && 6 * i < total - 1; i++) {
        const strl__affine ladder = strl__affine_turn(0.5, i & 1 ? 0.85 : 0.25, radius + 0.5, 6 * (i - 1));
        put_platform(plant, radius, 6 * i);
        strl__plant_ladder(plant, &ladder, 6);
    }
    strl__plant_close(plant);
}

/* ---- lying vessels ---- */

/* The group's x runs along the vessel: its shell is made about z and laid down. */
static strl__affine lying(double x, double z)
{
    return (strl__affine){.axis = {{0, 1, 0}, {0, 0, 1}, {1, 0, 0}}, .origin = {x, 0, z}};
}

static void put_saddles(strl__plant *plant, double radius, double from, double to, double axis_z)
{
    for (int i = 0; i < 2; i++) {
        double x = i ? to : from;
        const double low[3] = {x - 0.12, -radius * 0.85, 0},
                     high[3] = {x + 0.12, radius * 0.85, axis_z - radius * 0.55};
        const double foot_low[3] = {x - 0.2, -radius * 0.95, -0.02}, foot_high[3] = {x + 0.2, radius * 0.95, 0.03};
        strl__plant_box(plant, "SADDLE", STRL__PRIMER, low, high);
        strl__plant_box(plant, "FOOT", STRL__STEEL, foot_low, foot_high);
        for (int bolt = 0; bolt < 2; bolt++) {
            const strl__outline hexagon = strl__outline_round(6, 0.03);
            const strl__affine place = strl__affine_move(x + 0.16, (bolt ? 0.85 : -0.85) * radius, 0.03);
            strl__part_prism(strl__plant_mesh(plant), &hexagon, 0.035);
            strl__plant_part(plant, "ANCHOR", STRL__GALVANISED, &place);
        }
    }
}

static void put_top_nozzles(strl__plant *plant, double radius, double from, double to, double axis_z, int count)
{
    for (int i = 0; i < count; i++) {
        double r = nozzle_radius(plant, radius), x = from + (to - from) * (i + 0.5) / count;
        const double up[3] = {0, 0, 1}, front[3] = {0, -1, 0};
        const double top[3] = {x, 0, axis_z + radius * 0.9}, side[3] = {x, -radius * 0.9, axis_z};
        put_nozzle(plant, i % 2 ? side : top, i % 2 ? front : up, r, radius * 0.1 + 0.2 + r);
    }
}

void strl__plant_item_drum(strl__plant *plant, const void *what)
{
    const strl__plant_spot *spot = what;
    double radius = fmin(fmin(spot->deep * 0.5 - 0.6, 1.6), (spot->high - 1.2) * 0.4);
    double length = spot->wide - radius - 1.4, axis_z = radius + 0.7;
    const strl__affine place =
        strl__affine_move(spot->x + 0.7 + radius * 0.5, spot->y + spot->deep / 2, spot->z + 0.02);
    const strl__affine shell = lying(0, axis_z);
    strl__plant_open(plant, "DRUM", &place);
    add_shell(strl__plant_mesh(plant), radius, length);
    strl__plant_part(plant, "SHELL", strl__plant_chance(plant, 0.5) ? STRL__INSULATION : STRL__TANK_WHITE, &shell);
    put_saddles(plant, radius, length * 0.18, length * 0.82, axis_z);
    put_top_nozzles(plant, radius, length * 0.1, length * 0.9, axis_z, 5);
    const double door[3] = {length + radius * 0.45, 0, axis_z}, ahead[3] = {1, 0, 0};
    put_manway(plant, door, ahead);
    const double plate[3] = {length * 0.5, -radius, axis_z};
    put_plate(plant, plate);
    strl__plant_close(plant);
}

/* ---- heat exchangers ---- */

/* Tubes on a hexagonal grid inside a circle, along z. */
static void put_bundle(strl__plant *plant, const strl__affine *place, double radius, double length, double pitch)
{
    strl__part_mesh *mesh = strl__plant_mesh(plant);
    int reach = (int)(radius / pitch) + 1;
    for (int row = -reach; row <= reach; row++)
        for (int i = -reach; i <= reach; i++) {
            double x = (i + (row & 1) * 0.5) * pitch, y = row * pitch * 0.866;
            const double from[3] = {x, y, 0}, to[3] = {x, y, length};
            if (x * x + y * y < (radius - pitch * 0.5) * (radius - pitch * 0.5))
                strl__part_bar(mesh, from, to, pitch * 0.36, 8);
        }
    for (int i = 0; i < 5; i++)
        strl__part_disc(mesh, radius, length * (i + 0.3) / 5, length * (i + 0.3) / 5 + 0.015, 24);
    strl__plant_part(plant, "TUBE-BUNDLE", STRL__STEEL, place);
}

static void put_girth_joint(strl__plant *plant, double x, double radius, double axis_z)
{
    const strl__affine place = lying(x, axis_z);
    strl__part_mesh *mesh = strl__plant_mesh(plant);
    strl__part_ring(mesh, radius * 0.9, radius + 0.13, -0.07, -0.002, 36);
    strl__part_ring(mesh, radius * 0.9, radius + 0.13, 0.002, 0.07, 36);
    strl__plant_part(plant, "GIRTH-FLANGE", STRL__STEEL, &place);
    strl__plant_bolts(plant, &place, radius + 0.075, 24, 0.014, -0.09, 0.09);
}

/* One in four stands open, its bundle drawn. */
void strl__plant_item_exchanger(strl__plant *plant, const void *what)
{
    const strl__plant_spot *spot = what;
    double radius = fmin(strl__plant_between(plant, 0.3, 0.62), spot->deep * 0.5 - 0.5), length = spot->wide - 1.6;
    double axis_z = radius + 0.6, channel = 0.9;
    bool open = strl__plant_chance(plant, 0.25);
    const strl__affine place = strl__affine_move(spot->x + 0.8, spot->y + spot->deep / 2, spot->z + 0.02);
    strl__plant_open(plant, "EXCHANGER", &place);
    const strl__affine shell = lying(channel, axis_z), head = lying(0.05, axis_z);
    if (open) {
        put_bundle(plant, &shell, radius * 0.95, length - channel, 0.042);
    } else {
        add_shell(strl__plant_mesh(plant), radius, length - channel - radius * 0.5);
        strl__plant_part(plant, "SHELL", STRL__INSULATION, &shell);
        put_top_nozzles(plant, radius, channel + 0.3, length - radius, axis_z, 3);
    }
    strl__part_disc(strl__plant_mesh(plant), radius, 0, channel - 0.1, 36);
    strl__plant_part(plant, "CHANNEL", STRL__MACHINE_BLUE, &head);
    put_girth_joint(plant, channel, radius, axis_z);
    put_girth_joint(plant, 0.1, radius, axis_z);
    put_saddles(plant, radius, length * 0.35, length * 0.8, axis_z);
    put_top_nozzles(plant, radius, 0.2, channel - 0.15, axis_z, 2);
    const double plate[3] = {length * 0.55, -radius, axis_z - 0.1};
    put_plate(plant, plate);
    strl__plant_close(plant);
}

/* ---- tanks ---- */

static void put_tank_shell(strl__plant *plant, double radius, double high)
{
    const strl__affine here = strl__affine_identity();
    const strl__turn_point points[] = {{0, 0, false},
                                       {radius, 0, false},
                                       {radius, high, false},
                                       {radius * 0.5, high + radius * 0.09, true},
                                       {0, high + radius * 0.16, false}};
    strl__part_turned(strl__plant_mesh(plant), points, 5, false, 72);
    strl__plant_part(plant, "SHELL", STRL__TANK_WHITE, &here);
    strl__part_mesh *mesh = strl__plant_mesh(plant);
    for (int i = 0; i < 4; i++)
        strl__part_ring(mesh, radius * 0.995, radius + (i ? 0.03 : 0.12), high * i / 4, high * i / 4 + 0.05, 72);
    strl__part_ring(mesh, radius * 0.995, radius + 0.2, high - 0.15, high - 0.1, 72);
    strl__plant_part(plant, "COURSES", STRL__STEEL, &here);
}

/* A stair that winds up the tank's side: treads, and a rail along the outer edge. */
static void put_winding_stair(strl__plant *plant, double radius, double high)
{
    const strl__affine here = strl__affine_identity();
    int steps = (int)(high / 0.2);
    double turn = 0.28 / (6.2832 * radius);
    strl__part_mesh *mesh = strl__plant_mesh(plant);
    for (int i = 0; i < steps; i++) {
        mesh->place = strl__affine_turn(0.6 + turn * i, 0, 0, high * (i + 1) / steps);
        const double low[3] = {radius, -0.13, -0.03}, high_corner[3] = {radius + 0.8, 0.13, 0};
        strl__part_box(mesh, low, high_corner);
    }
    strl__plant_part(plant, "TREADS", STRL__GALVANISED, &here);
    mesh = strl__plant_mesh(plant);
    for (int i = 0; i + 2 < steps; i += 2) {
        double points[2][3];
        for (int end = 0; end < 2; end++) {
            double c, s;
            strl__circle(0.6 + turn * (i + 2 * end), &c, &s);
            points[end][0] = (radius + 0.78) * c;
            points[end][1] = (radius + 0.78) * s;
            points[end][2] = high * (i + 2 * end + 1) / steps;
        }
        const double top[3] = {points[0][0], points[0][1], points[0][2] + 1};
        points[1][2] += 1;
        strl__part_bar(mesh, points[0], top, 0.018, 6);
        strl__part_bar(mesh, top, points[1], 0.02, 6);
    }
    strl__plant_part(plant, "HANDRAIL", STRL__SAFETY_YELLOW, &here);
}

static void put_roof_rail(strl__plant *plant, double radius, double high)
{
    const strl__affine place = strl__affine_move(0, 0, high);
    strl__part_mesh *mesh = strl__plant_mesh(plant);
    for (int i = 0; i < 36; i++) {
        double c, s;
        strl__circle_step(i, 36, &c, &s);
        const double low[3] = {radius * 0.985 * c, radius * 0.985 * s, 0}, up[3] = {low[0], low[1], 1.1};
        strl__part_bar(mesh, low, up, 0.02, 6);
    }
    strl__part_ring(mesh, radius * 0.985 - 0.02, radius * 0.985 + 0.02, 1.08, 1.12, 72);
    strl__part_ring(mesh, radius * 0.985 - 0.02, radius * 0.985 + 0.02, 0.55, 0.58, 72);
    strl__plant_part(plant, "ROOF-RAIL", STRL__SAFETY_YELLOW, &place);
}

void strl__plant_item_tank(strl__plant *plant, const void *what)
{
    const strl__plant_spot *spot = what;
    double radius = fmin(spot->wide, spot->deep) * 0.5 - 1.6;
    double high = fmin(strl__plant_between(plant, 1.2, 2) * radius, 13);
    const strl__affine place = strl__affine_move(spot->x + spot->wide / 2, spot->y + spot->deep / 2, spot->z);
    strl__plant_open(plant, "TANK", &place);
    put_tank_shell(plant, radius, high);
    put_winding_stair(plant, radius, high);
    put_roof_rail(plant, radius, high);
    put_side_nozzles(plant, radius, 0.6, 1.9, 4);
    const double door[3] = {0.6 * radius, 0.8 * radius, 0.8}, out[3] = {0.6, 0.8, 0};
    put_manway(plant, door, out);
    const double plate[3] = {-radius * 0.3, -radius * 0.97, 1.5};
    put_plate(plant, plate);
    strl__plant_close(plant);
}
