/* Machines and small things: pump skids, cabinets, a control cabin, cable trays, lamps, and what lies in the yard. */
#include "scenes/plant/plant.h"

#include <math.h>

/* ---- pump skids ---- */

/* A maker's model in millimetres under a scale: x along the shaft. */
static strl__affine laid(double x, double y, double z)
{
    return (strl__affine){.axis = {{0, 1, 0}, {0, 0, 1}, {1, 0, 0}}, .origin = {x, y, z}};
}

static void put_motor(strl__plant *plant, double r, double length, double z)
{
    const strl__affine place = laid(1150, 500, z);
    strl__part_mesh *mesh = strl__plant_mesh(plant);
    strl__part_disc(mesh, r, 0, length, 32);
    strl__part_disc(mesh, r * 1.02, length, length + 120, 32);
    strl__part_disc(mesh, 28, -160, 0, 12);
    for (int i = 0; i < 28; i++) {
        mesh->place = strl__affine_turn(i / 28.0, 0, 0, 0);
        const double low[3] = {r * 0.97, -3, 30}, high[3] = {r + 26, 3, length - 20};
        strl__part_box(mesh, low, high);
    }
    strl__plant_part(plant, "MOTOR", STRL__MACHINE_BLUE, &place);
    const double box_low[3] = {1250, 420, z + r}, box_high[3] = {1450, 580, z + r + 110};
    strl__plant_box(plant, "TERMINAL-BOX", STRL__MACHINE_BLUE, box_low, box_high);
}

static void put_volute(strl__plant *plant, double r, double z)
{
    const strl__affine place = laid(500, 500, z);
    const strl__turn_point shape[] = {{0, -110, false},       {r * 0.8, -110, false}, {r * 1.1, -60, true},
                                      {r * 1.2, 0, true},     {r * 1.1, 60, true},    {r * 0.8, 110, false},
                                      {r * 0.35, 130, false}, {r * 0.35, 420, false}, {0, 420, false}};
    strl__part_turned(strl__plant_mesh(plant), shape, 9, false, 36);
    strl__plant_part(plant, "VOLUTE", STRL__PIPE_WATER, &place);
    strl__plant_bolts(plant, &place, r * 0.62, 12, 9, -118, 118);
    const double low[3] = {940, 420, z - 90}, high[3] = {1080, 580, z + 95};
    strl__plant_box(plant, "GUARD", STRL__SAFETY_YELLOW, low, high);
    for (int i = 0; i < 2; i++) {
        const double foot_low[3] = {i ? 1200 : 440, 330, 200}, foot_high[3] = {foot_low[0] + 120, 670, z - r * 0.8};
        strl__plant_box(plant, "FOOT", STRL__PRIMER, foot_low, foot_high);
    }
}

static void put_pump_nozzle(strl__plant *plant, const double from[3], const double way[3], double r, double reach)
{
    double to[3];
    for (int k = 0; k < 3; k++)
        to[k] = from[k] + way[k] * reach;
    strl__plant_bar(plant, "NECK", STRL__PIPE_WATER, from, to, r, 16);
    const strl__affine place = strl__affine_along(to, way);
    strl__part_ring(strl__plant_mesh(plant), r * 0.9, r * 1.5 + 40, -22, 0, 18);
    strl__plant_part(plant, "FLANGE", STRL__STEEL, &place);
    strl__plant_bolts(plant, &place, r * 1.2 + 22, 8, 8, -30, 10);
    strl__plant_add_nozzle(plant, to, way, r * 0.001);
}

void strl__plant_item_skid(strl__plant *plant, const void *what)
{
    const strl__plant_spot *spot = what;
    const strl__outline channel = strl__outline_channel(120, 80, 8);
    strl__affine place = strl__affine_move(spot->x + 0.6, spot->y + spot->deep / 2 - 0.5, spot->z + 0.1);
    for (int i = 0; i < 3; i++)
        place.axis[i][i] = 0.001;
    double r = strl__plant_between(plant, 140, 220), z = 540, pipe = strl__plant_chance(plant, 0.5) ? 57 : 84;
    strl__plant_open(plant, "PUMP", &place);
    const double base_low[3] = {-100, -50, -150}, base_high[3] = {2100, 1050, 0};
    const double plate_low[3] = {0, 0, 120}, plate_high[3] = {2000, 1000, 140};
    strl__plant_box(plant, "PLINTH", STRL__CONCRETE, base_low, base_high);
    strl__plant_box(plant, "BASEPLATE", STRL__PRIMER, plate_low, plate_high);
    for (int i = 0; i < 2; i++) {
        const double from[3] = {0, i ? 920 : 80, 0}, to[3] = {2000, from[1], 0};
        strl__plant_beam(plant, "CHANNEL", STRL__PRIMER, from, to, &channel);
    }
    put_volute(plant, r, z);
    put_motor(plant, r * 1.05, 620, z);
    const double top[3] = {500, 500, z + r}, up[3] = {0, 0, 1}, side[3] = {400, 500, z}, left[3] = {-1, 0, 0};
    put_pump_nozzle(plant, top, up, pipe, 180);
    put_pump_nozzle(plant, side, left, pipe, 420);
    strl__plant_close(plant);
}

/* ---- cabinets and the control cabin ---- */

void strl__plant_item_cabinets(strl__plant *plant, const void *what)
{
    const strl__plant_spot *spot = what;
    const strl__affine place = strl__affine_move(spot->x + 0.6, spot->y + spot->deep / 2, spot->z);
    int count = (int)((spot->wide - 1.2) / 0.82);
    strl__plant_open(plant, "SWITCHBOARD", &place);
    for (int i = 0; i < count; i++) {
        double x = 0.82 * i;
        const double low[3] = {x, 0, 0.1}, high[3] = {x + 0.8, 0.6, 2.1}, door_low[3] = {x + 0.03, -0.02, 0.15};
        const double door_high[3] = {x + 0.77, 0, 2.05}, foot_low[3] = {x, 0, 0}, foot_high[3] = {x + 0.8, 0.6, 0.1};
        const double glass_low[3] = {x + 0.15, -0.035, 1.5}, glass_high[3] = {x + 0.65, -0.02, 1.8};
        const double handle_from[3] = {x + 0.7, -0.05, 0.95}, handle_to[3] = {x + 0.7, -0.05, 1.2};
        strl__plant_box(plant, "PLINTH", STRL__CABLE, foot_low, foot_high);
        strl__plant_box(plant, "CABINET", STRL__TANK_WHITE, low, high);
        strl__plant_box(plant, "DOOR", STRL__TANK_WHITE, door_low, door_high);
        strl__plant_bar(plant, "HANDLE", STRL__CABLE, handle_from, handle_to, 0.015, 6);
        if (i % 2)
            strl__plant_box(plant, "WINDOW", STRL__GLASS, glass_low, glass_high);
        for (int lamp = 0; lamp < 3; lamp++) {
            static const strl__plant_material colours[] = {STRL__PIPE_FIRE, STRL__SAFETY_YELLOW, STRL__PIPE_WATER};
            const double from[3] = {x + 0.2 + 0.1 * lamp, -0.02, 1.35}, to[3] = {from[0], -0.045, 1.35};
            strl__plant_bar(plant, "LAMP", colours[lamp], from, to, 0.02, 8);
        }
    }
    strl__plant_close(plant);
}

/* Walls with a band of windows towards the rack. */
void strl__plant_item_cabin(strl__plant *plant, const void *what)
{
    const strl__plant_spot *spot = what;
    double wide = fmin(spot->wide - 1, 12), deep = fmin(spot->deep - 1, 6), high = 3.2;
    const strl__affine place = strl__affine_move(spot->x + 0.5, spot->y + 0.5, spot->z);
    strl__plant_open(plant, "CONTROLROOM", &place);
    const double walls[][6] = {{0, 0, 0, wide, 0.2, 1},
                               {0, 0, 2.3, wide, 0.2, high},
                               {0, deep - 0.2, 0, wide, deep, high},
                               {0, 0.2, 0, 0.2, deep - 0.2, high},
                               {wide - 0.2, 0.2, 0, wide, deep - 0.2, high},
                               {-0.4, -0.4, high, wide + 0.4, deep + 0.4, high + 0.25},
                               {0, 0, -0.05, wide, deep, 0}};
    for (int i = 0; i < 7; i++)
        strl__plant_box(plant, i == 5 ? "ROOF" : "WALL", i > 4 ? STRL__CONCRETE : STRL__TANK_WHITE, walls[i],
                        walls[i] + 3);
    int panes = (int)(wide / 1.2);
    for (int i = 0; i < panes; i++) {
        double x = wide * i / panes, step = wide / panes;
        const double low[3] = {x + 0.06, 0.09, 1}, high_corner[3] = {x + step - 0.06, 0.11, 2.3};
        const double post_low[3] = {x - 0.06 + (i == 0) * 0.06, 0.05, 1}, post_high[3] = {x + 0.06, 0.15, 2.3};
        strl__plant_box(plant, "PANE", STRL__GLASS, low, high_corner);
        strl__plant_box(plant, "MULLION", STRL__CABLE, post_low, post_high);
    }
    const double door_low[3] = {wide, deep * 0.4, 0}, door_high[3] = {wide + 0.05, deep * 0.4 + 1, 2.1};
    strl__plant_box(plant, "DOOR", STRL__MACHINE_BLUE, door_low, door_high);
    for (int i = 0; i < 2; i++) {
        const double low[3] = {1 + 2.5 * i, deep * 0.4, high + 0.25}, top[3] = {low[0] + 1.4, low[1] + 1.1, high + 1.2};
        const strl__affine fan = strl__affine_move(low[0] + 0.7, low[1] + 0.55, high + 1.2);
        strl__plant_box(plant, "AIR-UNIT", STRL__GALVANISED, low, top);
        strl__part_ring(strl__plant_mesh(plant), 0.4, 0.45, 0, 0.1, 24);
        strl__plant_part(plant, "GRILLE", STRL__CABLE, &fan);
    }
    strl__plant_close(plant);
}

/* ---- cable trays ---- */

static void put_tray_piece(strl__plant *plant, double x, double length)
{
    const strl__affine place = strl__affine_move(x, 0, 0);
    strl__part_mesh *mesh = strl__plant_mesh(plant);
    for (int side = 0; side < 2; side++) {
        const double low[3] = {0, side ? 0.44 : 0, 0}, high[3] = {length, side ? 0.45 : 0.01, 0.1};
        strl__part_box(mesh, low, high);
    }
    for (double at = 0.15; at < length; at += 0.3) {
        const double low[3] = {at, 0.01, 0.005}, high[3] = {at + 0.03, 0.44, 0.02};
        strl__part_box(mesh, low, high);
    }
    strl__plant_part(plant, "TRAY", STRL__GALVANISED, &place);
    mesh = strl__plant_mesh(plant);
    int cables = 3 + strl__plant_choice(plant, 7);
    for (int i = 0; i < cables; i++) {
        double r = strl__plant_between(plant, 0.008, 0.018), y = 0.03 + 0.38 * (i + 0.5) / cables;
        const double from[3] = {0, y, 0.02 + r}, to[3] = {length, y, 0.02 + r};
        strl__part_bar(mesh, from, to, r, 6);
    }
    strl__plant_part(plant, "CABLES", STRL__CABLE, &place);
    for (int i = 0; i < 2; i++) {
        const strl__affine hung = strl__affine_move(x + length * (i + 0.5) / 2, 0, 0);
        const double low[3] = {0, -0.05, -0.05}, high[3] = {0.05, 0.5, 0}, from[3] = {0.02, -0.03, 0};
        const double to[3] = {0.02, -0.03, 0.5};
        mesh = strl__plant_mesh(plant);
        strl__part_box(mesh, low, high);
        strl__part_bar(mesh, from, to, 0.006, 5);
        strl__plant_part(plant, "BRACKET", STRL__GALVANISED, &hung);
    }
}

/* Under a floor, along x, with drops to junction boxes. */
void strl__plant_item_tray(strl__plant *plant, const void *what)
{
    const strl__plant_bay *at = what;
    const strl__plant_unit *unit = &plant->unit;
    double y = unit->frame_y + STRL__PLANT_BAY * at->y + 5.2 - 0.6 * at->x;
    const strl__affine place = strl__affine_move(unit->frame_x, y, STRL__PLANT_STOREY * at->level - 0.95);
    strl__plant_open(plant, "TRAY", &place);
    for (int i = 0; i < 2 * unit->bays_x; i++) {
        double x = STRL__PLANT_BAY / 2 * i;
        put_tray_piece(plant, x + 0.01, STRL__PLANT_BAY / 2 - 0.02);
        if (i % 3 == 1) {
            const double low[3] = {x + 0.5, 0.5, -2}, high[3] = {x + 0.8, 0.65, -1.6};
            const double from[3] = {x + 0.65, 0.57, -1.6}, to[3] = {x + 0.65, 0.57, 0.05};
            strl__plant_box(plant, "JUNCTION-BOX", STRL__GALVANISED, low, high);
            strl__plant_bar(plant, "CONDUIT", STRL__GALVANISED, from, to, 0.013, 8);
        }
    }
    strl__plant_close(plant);
}

/* ---- lamps, and the yard ---- */

void strl__plant_item_lamp(strl__plant *plant, const void *what)
{
    const unsigned number = *(const unsigned *)what;
    const strl__affine place = strl__affine_move(2.5 + 6.0 * number, 11.8, 0);
    strl__plant_open(plant, "LIGHT", &place);
    const double foot_low[3] = {-0.2, -0.2, -0.05}, foot_high[3] = {0.2, 0.2, 0.3}, low[3] = {0, 0, 0.3};
    const double high[3] = {0, 0, 6}, out[3] = {0, -1.2, 6.2}, head_low[3] = {-0.12, -1.7, 6.15};
    const double head_high[3] = {0.12, -1.1, 6.27}, glass_low[3] = {-0.1, -1.65, 6.13},
                 glass_high[3] = {0.1, -1.2, 6.15};
    strl__plant_box(plant, "FOOT", STRL__CONCRETE, foot_low, foot_high);
    strl__plant_bar(plant, "MAST", STRL__GALVANISED, low, high, 0.06, 10);
    strl__plant_bar(plant, "ARM", STRL__GALVANISED, high, out, 0.03, 8);
    strl__plant_box(plant, "HEAD", STRL__GALVANISED, head_low, head_high);
    strl__plant_box(plant, "GLASS", STRL__GLASS, glass_low, glass_high);
    strl__plant_close(plant);
}

/* The yard is the strip behind the rack: piles of five rows. */
static strl__affine yard_place(const strl__plant *plant, unsigned number, double wide)
{
    unsigned columns = (unsigned)((plant->unit.length - 4) / wide);
    columns = columns ? columns : 1;
    double x = 2 + wide * (number % columns), y = 8.35 + 0.6 * (number / columns % 4), z = 0.6 * (number / columns / 4);
    return strl__affine_move(x, y, z);
}

/* A length of pipe on two sleepers. */
void strl__plant_item_spool(strl__plant *plant, const void *what)
{
    const strl__affine place = yard_place(plant, *(const unsigned *)what, 3.2);
    const double from[3] = {0, 0.25, 0.3}, to[3] = {3, 0.25, 0.3};
    strl__plant_open(plant, "SPOOL", &place);
    for (int i = 0; i < 2; i++) {
        const double low[3] = {0.5 + 1.9 * i, 0, 0}, high[3] = {0.6 + 1.9 * i, 0.5, 0.12};
        strl__plant_box(plant, "SLEEPER", STRL__PRIMER, low, high);
    }
    strl__plant_bar(plant, "PIPE", STRL__PRIMER, from, to, 0.18, 16);
    strl__plant_close(plant);
}

void strl__plant_item_crate(strl__plant *plant, const void *what)
{
    const strl__affine place = yard_place(plant, *(const unsigned *)what, 0.6);
    const double low[3] = {0.03, 0.03, 0}, high[3] = {0.5, 0.5, 0.5};
    strl__plant_open(plant, "CRATE", &place);
    strl__plant_box(plant, "BOX", STRL__PRIMER, low, high);
    strl__plant_close(plant);
}
