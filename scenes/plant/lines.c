/* Where pipe lines go: headers along the rack, lines from nozzles to headers and between nozzles, and banks under
 * floors. Every line has heights and offsets of its own, told by its number, so that few pipes meet. */
#include "scenes/plant/plant.h"

#include <math.h>

#define OVER_RACK 8.7 /* lowest height of lines that cross the rack */

void strl__plant_lane(int tier, int lane, double *y, double *z)
{
    *y = STRL__PLANT_RACK_LOW + 0.36 + 0.44 * lane;
    *z = 4.65 + 1.5 * tier; /* top of the tier's beams */
}

static double header_outer(const strl__header *header)
{
    return header->material == STRL__PIPE_STEAM ? header->radius * 1.2 + 0.025 : header->radius;
}

static double header_z(const strl__header *header, int tier, int lane)
{
    double y, z;
    strl__plant_lane(tier, lane, &y, &z);
    return z + 0.1 + header_outer(header);
}

static void put_shoes(strl__plant *plant, const strl__header *header)
{
    for (double x = 0; x <= plant->unit.length; x += STRL__PLANT_BAY) {
        const double low[3] = {x - 0.12, -0.05, -header_outer(header) - 0.1};
        const double high[3] = {x + 0.12, 0.05, -header_outer(header) * 0.8};
        strl__plant_box(plant, "SHOE", STRL__STEEL, low, high);
    }
}

static void add_point(strl__route *route, double x, double y, double z)
{
    if (route->count < STRL__ROUTE_MOST) {
        const double point[3] = {x, y, z};
        for (int k = 0; k < 3; k++)
            route->points[route->count][k] = point[k];
        route->count++;
    }
}

/* Every second line of the top tier has a loop that takes up its expansion. */
static void add_loop(strl__plant *plant, strl__route *route, double radius)
{
    double middle = plant->unit.length / 2, half = 0.8 + 4 * radius, up = 0.7 + 7 * radius;
    const double *start = route->points[0];
    const double loop[4][2] = {{middle - half, 0}, {middle - half, up}, {middle + half, up}, {middle + half, 0}};
    for (int i = 0; i < 4; i++)
        add_point(route, loop[i][0], start[1], start[2] + loop[i][1]);
}

void strl__plant_item_header(strl__plant *plant, const void *what)
{
    const strl__plant_bay *at = what;
    const strl__header *header = &plant->unit.headers[at->x][at->y];
    double y, z = header_z(header, at->x, at->y);
    strl__plant_lane(at->x, at->y, &y, &(double){0});
    strl__line line = {
        .radius = header->radius, .material = header->material, .insulated = header->material == STRL__PIPE_STEAM};
    strl__route *route = &line.route;
    add_point(route, -STRL__PLANT_REACH, y, z);
    if (at->x == STRL__PLANT_TIERS - 1 && at->y % 2 && plant->unit.length > 24)
        add_loop(plant, route, header->radius);
    add_point(route, plant->unit.length + STRL__PLANT_REACH, y, z);
    const strl__affine place = strl__affine_move(0, y, z);
    if (!strl__route_tidy(route, 3 * header->radius))
        return;
    strl__plant_line(plant, &line);
    strl__plant_open(plant, "SUPPORTS", &place);
    put_shoes(plant, header);
    strl__plant_close(plant);
}

/* ---- lines that end in a header ---- */

static strl__header *find_header(strl__plant *plant, double least_radius, int *tier, int *lane)
{
    for (int tries = 0; tries < 40; tries++) {
        *tier = strl__plant_choice(plant, STRL__PLANT_TIERS);
        *lane = strl__plant_choice(plant, STRL__PLANT_LANES);
        strl__header *header = &plant->unit.headers[*tier][*lane];
        if (header->radius >= least_radius)
            return header;
    }
    return NULL;
}

/* From `last` above the rack's level, or below it, down into the header: all tiers below the top one are met from the
 * side of the road, between the tiers. */
static void add_way_to_header(strl__plant *plant, strl__route *route, double radius, int tier, int lane)
{
    const double *last = route->points[route->count - 1];
    double x = last[0], y, z, over, end = header_z(&plant->unit.headers[tier][lane], tier, lane);
    strl__plant_lane(tier, lane, &y, &z);
    over =
        tier == STRL__PLANT_TIERS - 1 ? OVER_RACK + 0.22 * (plant->state.line_count % 9) : z + 0.75 + 3 * radius * 0.5;
    add_point(route, x, last[1], over);
    add_point(route, x, y, over);
    add_point(route, x, y, end);
}

static bool choose_nozzle(strl__plant *plant, strl__nozzle **nozzle)
{
    unsigned count = plant->state.nozzle_count;
    for (int tries = 0; count > 0 && tries < 30; tries++) {
        *nozzle = &plant->state.nozzles[strl__plant_choice(plant, (int)count)];
        if (!(*nozzle)->taken)
            return true;
    }
    return false;
}

static void leave_nozzle(strl__route *route, const strl__nozzle *nozzle, double ahead)
{
    const double *p = nozzle->position, *d = nozzle->direction;
    add_point(route, p[0], p[1], p[2]);
    add_point(route, p[0] + d[0] * ahead, p[1] + d[1] * ahead, p[2] + d[2] * ahead);
}

void strl__plant_item_nozzle_line(strl__plant *plant, const void *what)
{
    (void)what;
    strl__nozzle *nozzle;
    int tier, lane;
    if (!choose_nozzle(plant, &nozzle))
        return;
    strl__header *header = find_header(plant, nozzle->radius * 0.8, &tier, &lane);
    if (!header)
        return;
    unsigned number = plant->state.line_count++;
    strl__line line = {.radius = nozzle->radius,
                       .material = header->material,
                       .insulated = header->material == STRL__PIPE_STEAM && nozzle->radius > 0.03,
                       .flange_first = true,
                       .valves = true};
    double ahead = 7 * nozzle->radius + 0.3 + 0.12 * (number % 5), front = 10.4 + 0.13 * (number % 11);
    leave_nozzle(&line.route, nozzle, ahead);
    const double *last = line.route.points[1];
    if (nozzle->direction[2] > 0.5 || last[1] > front)
        add_point(&line.route, last[0], front, last[2]);
    add_way_to_header(plant, &line.route, nozzle->radius, tier, lane);
    if (!strl__route_tidy(&line.route, 3 * line.radius))
        return;
    nozzle->taken = true;
    strl__plant_line(plant, &line);
}

static strl__plant_material random_service(strl__plant *plant)
{
    static const strl__plant_material services[] = {STRL__PIPE_WATER, STRL__PIPE_WATER, STRL__PIPE_STEAM,
                                                    STRL__PIPE_GAS,   STRL__PIPE_AIR,   STRL__PIPE_OIL,
                                                    STRL__PIPE_ACID,  STRL__PIPE_FIRE,  STRL__STEEL};
    return services[strl__plant_choice(plant, (int)(sizeof services / sizeof services[0]))];
}

void strl__plant_item_joining_line(strl__plant *plant, const void *what)
{
    (void)what;
    strl__nozzle *a, *b;
    if (!choose_nozzle(plant, &a) || !choose_nozzle(plant, &b) || a == b)
        return;
    unsigned number = plant->state.line_count++;
    double radius = fmin(a->radius, b->radius), ahead = 7 * radius + 0.3 + 0.12 * (number % 5);
    strl__line line = {
        .radius = radius, .material = random_service(plant), .flange_first = true, .flange_last = true, .valves = true};
    leave_nozzle(&line.route, a, ahead);
    const double *from = line.route.points[1],
                 to[3] = {b->position[0] + b->direction[0] * ahead, b->position[1] + b->direction[1] * ahead,
                          b->position[2] + b->direction[2] * ahead};
    double z = fmax(from[2], to[2]) + 0.7 + 0.11 * (number % 7);
    add_point(&line.route, from[0], from[1], z);
    add_point(&line.route, to[0], from[1], z);
    add_point(&line.route, to[0], to[1], z);
    add_point(&line.route, to[0], to[1], to[2]);
    add_point(&line.route, b->position[0], b->position[1], b->position[2]);
    if (fabs(from[0] - to[0]) + fabs(from[1] - to[1]) > 30 || !strl__route_tidy(&line.route, 3 * radius))
        return;
    a->taken = true;
    b->taken = true;
    strl__plant_line(plant, &line);
}

/* ---- banks under the floors ---- */

/* From a header along a floor's underside to a station: the filling of the last of a budget, of any length. */
void strl__plant_item_bank_line(strl__plant *plant, const void *what)
{
    (void)what;
    static const double radii[] = {0.017, 0.017, 0.024, 0.024, 0.03, 0.038, 0.044, 0.057, 0.084, 0.11};
    const strl__plant_unit *unit = &plant->unit;
    strl__line line = {.radius = radii[strl__plant_choice(plant, 10)], .flange_last = true, .valves = true};
    int tier, lane, level = 1 + strl__plant_choice(plant, unit->levels);
    strl__header *header = find_header(plant, line.radius, &tier, &lane);
    if (!header)
        return;
    unsigned number = plant->state.line_count++;
    double wide = STRL__PLANT_BAY * unit->bays_x, deep = STRL__PLANT_BAY * unit->bays_y;
    double x = unit->frame_x + 0.35 + (wide - 0.7) * strl__plant_random(plant), y, z;
    double lane_y = unit->frame_y + 0.4 + (deep - 0.8) * strl__plant_random(plant);
    double bank = STRL__PLANT_STOREY * level - 0.75 - 0.17 * (number % 5), front = 10.4 + 0.13 * (number % 11);
    double run = strl__plant_between(plant, 1.5, wide * 0.7);
    double end = x + run < unit->frame_x + wide - 0.4 ? x + run : x - run;
    end = end < unit->frame_x + 0.4 ? unit->frame_x + 0.4 : end;
    strl__plant_lane(tier, lane, &y, &z);
    line.material = header->material;
    line.insulated = header->material == STRL__PIPE_STEAM && line.radius > 0.03;
    line.hangers = 0.45;
    double over = tier == STRL__PLANT_TIERS - 1 ? OVER_RACK + 0.22 * (number % 9) : z + 0.75 + 1.5 * line.radius;
    add_point(&line.route, x, y, header_z(header, tier, lane));
    add_point(&line.route, x, y, over);
    add_point(&line.route, x, front, over);
    add_point(&line.route, x, front, bank);
    add_point(&line.route, x, lane_y, bank);
    add_point(&line.route, end, lane_y, bank);
    add_point(&line.route, end, lane_y, STRL__PLANT_STOREY * (level - 1) + 0.9 + 0.1 * (number % 6));
    if (strl__route_tidy(&line.route, 3 * line.radius))
        strl__plant_line(plant, &line);
}
