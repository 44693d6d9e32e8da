/* The steel: pipe rack, columns, floors of beams and gratings, rails, stairs, and the ground under all. */
#include "scenes/plant/plant.h"

#define BAY STRL__PLANT_BAY
#define STOREY STRL__PLANT_STOREY

static strl__affine frame_place(const strl__plant *plant, double z)
{
    return strl__affine_move(plant->unit.frame_x, plant->unit.frame_y, z);
}

void strl__plant_item_ground(strl__plant *plant, const void *what)
{
    (void)what;
    const strl__affine place = strl__affine_identity();
    const strl__plant_unit *unit = &plant->unit;
    strl__plant_open_named(plant, "GROUND", &place);
    const double reach = STRL__PLANT_REACH; /* to the middle of the road round the plot */
    const double low[3] = {-reach, -reach, -0.3}, high[3] = {unit->length + reach, unit->depth + reach, -0.05};
    strl__plant_box(plant, "SLAB", STRL__CONCRETE, low, high);
    const double pad_low[3] = {unit->frame_x - 0.8, unit->frame_y - 0.8, -0.05};
    const double pad_high[3] = {unit->frame_x + BAY * unit->bays_x + 0.8, unit->frame_y + BAY * unit->bays_y + 0.8, 0};
    strl__plant_box(plant, "PAD", STRL__CONCRETE, pad_low, pad_high);
    for (int side = 0; side < 2; side++) {
        const double kerb_low[3] = {0, side ? 11.4 : 8.0, -0.05}, kerb_high[3] = {unit->length, kerb_low[1] + 0.2, 0.1};
        strl__plant_box(plant, "KERB", STRL__CONCRETE, kerb_low, kerb_high);
    }
    strl__plant_close(plant);
}

/* Four anchors and a plate under a post. */
static void put_foot(strl__plant *plant, double x, double y, double half)
{
    const double pad_low[3] = {x - half - 0.1, y - half - 0.1, -0.05},
                 pad_high[3] = {x + half + 0.1, y + half + 0.1, 0.12};
    const double low[3] = {x - half, y - half, 0.12}, high[3] = {x + half, y + half, 0.15};
    strl__plant_box(plant, "PLINTH", STRL__CONCRETE, pad_low, pad_high);
    strl__plant_box(plant, "PLATE", STRL__STEEL, low, high);
    for (int i = 0; i < 4; i++) {
        const strl__outline hexagon = strl__outline_round(6, 0.03);
        const strl__affine place =
            strl__affine_move(x + (i & 1 ? 0.75 : -0.75) * half, y + (i & 2 ? 0.75 : -0.75) * half, 0.15);
        strl__part_prism(strl__plant_mesh(plant), &hexagon, 0.04);
        strl__plant_part(plant, "ANCHOR", STRL__GALVANISED, &place);
    }
}

/* A portal across the rack and the beams to the next one. */
void strl__plant_item_rack_bent(strl__plant *plant, const void *what)
{
    const strl__plant_bay *at = what;
    const strl__outline post = strl__outline_i(0.24, 0.24, 0.017, 0.012),
                        beam = strl__outline_i(0.18, 0.3, 0.014, 0.01);
    const strl__affine place = strl__affine_move(BAY * at->x, 0, 0);
    double low_y = STRL__PLANT_RACK_LOW, high_y = STRL__PLANT_RACK_HIGH;
    bool next = BAY * (at->x + 1) <= plant->unit.length + 0.01;
    strl__plant_open(plant, "RACK", &place);
    for (int side = 0; side < 2; side++) {
        double y = side ? high_y : low_y;
        const double foot[3] = {0, y, 0.15}, top[3] = {0, y, 7.8};
        put_foot(plant, 0, y, 0.2);
        strl__plant_beam(plant, "POST", STRL__FRAME_GREY, foot, top, &post);
        for (int tier = 0; tier < STRL__PLANT_TIERS && next; tier++) {
            double z = 4.0 + 1.5 * tier;
            const double from[3] = {0.12, y, z}, to[3] = {BAY - 0.12, y, z};
            strl__plant_beam(plant, "BEAM", STRL__FRAME_GREY, from, to, &beam);
        }
    }
    for (int tier = 0; tier < STRL__PLANT_TIERS; tier++) {
        double y, z;
        strl__plant_lane(tier, 0, &y, &z);
        const double from[3] = {0, low_y + 0.12, z - 0.15}, to[3] = {0, high_y - 0.12, z - 0.15};
        strl__plant_beam(plant, "BEAM", STRL__FRAME_GREY, from, to, &beam);
    }
    strl__plant_close(plant);
}

void strl__plant_item_column(strl__plant *plant, const void *what)
{
    const strl__plant_bay *at = what;
    const strl__outline post = strl__outline_i(0.3, 0.3, 0.02, 0.014);
    const strl__affine place =
        strl__affine_move(plant->unit.frame_x + BAY * at->x, plant->unit.frame_y + BAY * at->y, 0);
    strl__plant_open(plant, "COLUMN", &place);
    put_foot(plant, 0, 0, 0.28);
    for (int level = 0; level < plant->unit.levels; level++) {
        const double low[3] = {0, 0, level ? STOREY * level : 0.15}, high[3] = {0, 0, STOREY * (level + 1)};
        strl__plant_beam(plant, "POST", STRL__FRAME_GREY, low, high, &post);
    }
    strl__plant_close(plant);
}

/* ---- floors ---- */

/* Two bolts through each end of a beam, the beam's bolts as one part. */
static void put_beam_bolts(strl__plant *plant, double x, double y, double dx, double dy)
{
    const double way[3] = {dy, dx, 0}, zero[3] = {0};
    const strl__affine place = strl__affine_move(x, y, -0.24), across = strl__affine_along(zero, way);
    strl__part_mesh *mesh = strl__plant_mesh(plant);
    for (int i = 0; i < 4; i++) {
        double s = i & 2 ? BAY - 0.26 : 0.26;
        mesh->place = across;
        mesh->place.origin[0] = s * dx;
        mesh->place.origin[1] = s * dy;
        mesh->place.origin[2] = i & 1 ? 0.08 : -0.08;
        strl__part_bolt(mesh, 0.01, -0.03, 0.03);
    }
    strl__plant_part(plant, "BOLTS", STRL__GALVANISED, &place);
}

/* A main beam with a gusset and bolts at each end; along x or y. */
static void put_main_beam(strl__plant *plant, double x, double y, bool along_y)
{
    const strl__outline beam = strl__outline_i(0.2, 0.4, 0.016, 0.01);
    const double dx = along_y ? 0 : 1, dy = along_y ? 1 : 0;
    const double from[3] = {x + 0.16 * dx, y + 0.16 * dy, -0.24};
    const double to[3] = {x + (BAY - 0.16) * dx, y + (BAY - 0.16) * dy, -0.24};
    strl__plant_beam(plant, "BEAM", STRL__FRAME_GREY, from, to, &beam);
    const strl__affine place = strl__affine_move(x, y, -0.24);
    strl__part_mesh *mesh = strl__plant_mesh(plant);
    for (int end = 0; end < 2; end++) {
        double s = end ? BAY - 0.26 : 0.26;
        const double middle[3] = {s * dx, s * dy, 0};
        strl__part_block(mesh, middle, 0.2 * dx + 0.04 * dy, 0.2 * dy + 0.04 * dx, 0.28);
    }
    strl__plant_part(plant, "GUSSETS", STRL__FRAME_GREY, &place);
    put_beam_bolts(plant, x, y, dx, dy);
}

static void put_brace(strl__plant *plant, const double from[3], const double to[3])
{
    const strl__outline angle = strl__outline_angle(0.12, 0.012);
    strl__plant_beam(plant, "BRACE", STRL__PRIMER, from, to, &angle);
}

static void put_joists(strl__plant *plant, double x, double y)
{
    const strl__outline joist = strl__outline_i(0.12, 0.2, 0.01, 0.007);
    const double way[3] = {1, 0, 0}, zero[3] = {0};
    const strl__affine place = strl__affine_move(x + 0.1, y, -0.14), along = strl__affine_along(zero, way);
    strl__part_mesh *mesh = strl__plant_mesh(plant);
    for (int i = 1; i < 4; i++) {
        mesh->place = along;
        mesh->place.origin[1] = 1.5 * i;
        strl__part_prism(mesh, &joist, BAY - 0.2);
    }
    strl__plant_part(plant, "JOISTS", STRL__FRAME_GREY, &place);
}

static void put_bay_steel(strl__plant *plant, int x, int y, int level)
{
    const strl__plant_unit *unit = &plant->unit;
    double left = BAY * x, front = BAY * y;
    if (x < unit->bays_x)
        put_main_beam(plant, left, front, false);
    if (y < unit->bays_y)
        put_main_beam(plant, left, front, true);
    if (x == unit->bays_x || y == unit->bays_y)
        return;
    if (!unit->hollow[x][y])
        put_joists(plant, left, front);
    if (y == 0 && (x + level) % 3 == 0) {
        const double low[3] = {left + 0.2, 0, -STOREY + 0.2}, high[3] = {left + BAY - 0.2, 0, -0.5};
        const double low_right[3] = {high[0], 0.1, low[2]}, high_left[3] = {low[0], 0.1, high[2]};
        put_brace(plant, low, high);
        put_brace(plant, low_right, high_left);
    }
}

void strl__plant_item_floor_steel(strl__plant *plant, const void *what)
{
    const strl__plant_bay *at = what;
    const strl__affine place = frame_place(plant, STOREY * at->level);
    strl__plant_open(plant, "FLOOR", &place);
    for (int y = 0; y <= plant->unit.bays_y; y++)
        for (int x = 0; x <= plant->unit.bays_x; x++)
            put_bay_steel(plant, x, y, at->level);
    strl__plant_close(plant);
}

/* Bearing bars along x and thinner ones across, over [x, x + wide] x [y, y + deep]. */
static void add_grating(strl__part_mesh *mesh, double x, double y, double wide, double deep, double pitch)
{
    for (int i = 0; i * pitch < deep - 0.01; i++) {
        const double low[3] = {x, y + pitch * i, -0.035}, high[3] = {x + wide, low[1] + 0.006, 0};
        strl__part_box(mesh, low, high);
    }
    for (double at = 0.1; at < wide; at += 5 * pitch) {
        const double low[3] = {x + at, y, -0.03}, high[3] = {x + at + 0.006, y + deep, -0.004};
        strl__part_box(mesh, low, high);
    }
}

static void put_bay_panels(strl__plant *plant, int x, int y, double pitch)
{
    for (int panel = 0; panel < 6; panel++) {
        const strl__affine place = strl__affine_move(BAY * x, BAY * y + panel, 0);
        add_grating(strl__plant_mesh(plant), 0.01, 0.01, BAY - 0.02, 0.98, pitch);
        strl__plant_part(plant, "GRATING", STRL__GALVANISED, &place);
    }
}

/* Half of the floors are one large part each, the others one for each panel of a metre. */
void strl__plant_item_grating(strl__plant *plant, const void *what)
{
    const strl__plant_bay *at = what;
    const strl__plant_unit *unit = &plant->unit;
    const strl__affine place = frame_place(plant, STOREY * at->level), here = strl__affine_identity();
    bool whole = strl__plant_chance(plant, 0.5) || unit->bays_x * unit->bays_y > 8;
    double pitch = unit->bays_x * unit->bays_y > 30 ? 0.08 : 0.05;
    strl__plant_open(plant, "DECK", &place);
    if (whole)
        strl__plant_mesh(plant);
    for (int y = 0; y < unit->bays_y; y++)
        for (int x = 0; x < unit->bays_x; x++) {
            if (!unit->hollow[x][y] && whole)
                add_grating(&plant->mesh, BAY * x + 0.01, BAY * y + 0.01, BAY - 0.02, BAY - 0.02, pitch);
            else if (!unit->hollow[x][y])
                put_bay_panels(plant, x, y, pitch * 1.2);
        }
    if (whole && plant->mesh.triangle_count > 0)
        strl__plant_part(plant, "GRATING", STRL__GALVANISED, &here);
    strl__plant_close(plant);
}

/* ---- rails and stairs ---- */

/* Posts, two rails and a kick plate along x, `long_m` long. */
static void put_rail(strl__plant *plant, const strl__affine *place, double long_m)
{
    strl__part_mesh *mesh = strl__plant_mesh(plant);
    for (int i = 0; i < 3; i++) {
        double x = 0.05 + (long_m - 0.1) * i / 2;
        const double low[3] = {x, 0, 0}, high[3] = {x, 0, 1.08};
        strl__part_bar(mesh, low, high, 0.022, 6);
    }
    for (int i = 0; i < 2; i++) {
        const double from[3] = {0, 0, i ? 1.1 : 0.6}, to[3] = {long_m, 0, from[2]};
        strl__part_bar(mesh, from, to, 0.022, 6);
    }
    const double low[3] = {0, -0.01, 0}, high[3] = {long_m, 0.01, 0.12};
    strl__part_box(mesh, low, high);
    strl__plant_part(plant, "HANDRAIL", STRL__SAFETY_YELLOW, place);
}

void strl__plant_item_rails(strl__plant *plant, const void *what)
{
    const strl__plant_bay *at = what;
    const strl__plant_unit *unit = &plant->unit;
    const strl__affine place = frame_place(plant, STOREY * at->level);
    strl__plant_open(plant, "RAILS", &place);
    for (int side = 0; side < 2; side++) {
        for (int x = 0; x < 2 * unit->bays_x; x++) {
            const strl__affine rail = strl__affine_move(BAY / 2 * x, side ? BAY * unit->bays_y : 0, 0);
            put_rail(plant, &rail, BAY / 2);
        }
        for (int y = 0; y < 2 * unit->bays_y; y++) {
            const strl__affine rail = strl__affine_turn(0.25, side ? BAY * unit->bays_x : 0, BAY / 2 * y, 0);
            put_rail(plant, &rail, BAY / 2);
        }
    }
    strl__plant_close(plant);
}

static void put_treads(strl__plant *plant, const strl__affine *place, double run)
{
    strl__part_mesh *mesh = strl__plant_mesh(plant);
    for (int i = 1; i < 25; i++) {
        double x = run * i / 25, z = STOREY * i / 25;
        for (int bar = 0; bar < 5; bar++) {
            const double low[3] = {x + 0.05 * bar, 0.03, z - 0.03}, high[3] = {low[0] + 0.012, 0.87, z};
            strl__part_box(mesh, low, high);
        }
    }
    strl__plant_part(plant, "TREADS", STRL__GALVANISED, place);
}

/* One flight on the left side of the frame, up to the level. */
void strl__plant_item_stair(strl__plant *plant, const void *what)
{
    const strl__plant_bay *at = what;
    const strl__outline stringer = strl__outline_i(0.08, 0.22, 0.01, 0.008);
    const strl__affine here = strl__affine_identity();
    double z = STOREY * (at->level - 1), run = BAY - 0.6;
    strl__affine place = strl__affine_turn(0.25, plant->unit.frame_x - 0.2, plant->unit.frame_y + 0.3, z);
    if (at->level % 2 == 0) /* the next flight climbs the other way beside it */
        place = strl__affine_turn(-0.25, plant->unit.frame_x - 2.2, plant->unit.frame_y + BAY - 0.3, z);
    strl__plant_open(plant, "STAIR", &place);
    for (int side = 0; side < 2; side++) {
        const double y = 0.9 * side, from[3] = {0, y, 0}, to[3] = {run, y, STOREY - 0.02};
        const double rail_from[3] = {0, y, 1}, rail_to[3] = {run, y, STOREY + 1};
        strl__plant_beam(plant, "STRINGER", STRL__FRAME_GREY, from, to, &stringer);
        strl__plant_bar(plant, "HANDRAIL", STRL__SAFETY_YELLOW, rail_from, rail_to, 0.022, 6);
        for (int i = 0; i < 5; i++) {
            const double low[3] = {run * i / 4, y, STOREY * i / 4}, high[3] = {run * i / 4, y, STOREY * i / 4 + 1};
            strl__plant_bar(plant, "BALUSTER", STRL__SAFETY_YELLOW, low, high, 0.018, 6);
        }
    }
    put_treads(plant, &here, run);
    const double low[3] = {run, -0.1, STOREY - 0.05}, high[3] = {run + 0.5, 2.1, STOREY};
    strl__plant_box(plant, "LANDING", STRL__GALVANISED, low, high);
    strl__plant_close(plant);
}
