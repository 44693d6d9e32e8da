/* Pipe lines: a route of axis-aligned legs becomes straight runs, elbows, flanges with bolts, valves, straps and
 * hangers. */
#include "scenes/plant/plant.h"

#include <math.h>

#define SPOOL 9.0 /* longest run without a joint */

static double leg_length(const double a[3], const double b[3], double way[3])
{
    for (int k = 0; k < 3; k++)
        way[k] = b[k] - a[k];
    return strl__normalise(way);
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

bool strl__route_tidy(strl__route *route, double bend)
{
    strl__route made = {0};
    for (int i = 0; i < route->count; i++) {
        double here[3], before[3], *last = made.points[made.count - (made.count > 0)];
        if (made.count > 0 && leg_length(last, route->points[i], here) < 1e-6)
            continue;
        if (made.count > 1) {
            leg_length(made.points[made.count - 2], last, before);
            double cosine = dot(before, here);
            if (cosine < -0.5)
                return false;
            made.count -= cosine > 0.5;
        }
        for (int k = 0; k < 3; k++)
            made.points[made.count][k] = route->points[i][k];
        made.count++;
    }
    *route = made;
    double way[3];
    for (int i = 0; i + 1 < made.count; i++) {
        int bends = (i > 0) + (i + 2 < made.count);
        if (leg_length(made.points[i], made.points[i + 1], way) < bends * bend + 0.12)
            return false;
    }
    return made.count > 1;
}

/* What the pieces of a line have in common. */
typedef struct line_run {
    strl__plant *plant;
    const strl__line *line;
    double outer, bend;
    int sides;
    strl__plant_material skin;
} line_run;

/* z runs along the leg from its first point. */
static strl__affine at_run(const strl__affine *leg, double s)
{
    const strl__affine move = strl__affine_move(0, 0, s);
    return strl__affine_of(leg, &move);
}

static void put_straps(const line_run *run, const strl__affine *leg, double from, double to)
{
    const strl__affine place = at_run(leg, from);
    strl__part_mesh *mesh = strl__plant_mesh(run->plant);
    int count = (int)((to - from) / 1.1);
    for (int i = 0; i < count; i++) {
        double z = (to - from) * (i + 0.5) / count;
        strl__part_ring(mesh, run->outer * 0.98, run->outer * 1.01 + 0.003, z, z + 0.02, run->sides);
    }
    if (count > 0)
        strl__plant_part(run->plant, "STRAPS", STRL__STEEL, &place);
}

static void put_pipe(const line_run *run, const strl__affine *leg, double from, double to)
{
    if (to - from < 1e-4)
        return;
    const strl__affine place = at_run(leg, from);
    const double low[3] = {0}, high[3] = {0, 0, to - from};
    strl__part_bar(strl__plant_mesh(run->plant), low, high, run->outer, run->sides);
    strl__plant_part(run->plant, "PIPE", run->skin, &place);
    if (run->line->insulated && to - from > 1.5)
        put_straps(run, leg, from, to);
}

static void put_elbow(const line_run *run, const double corner[3], const double in[3], const double out[3])
{
    strl__affine place;
    for (int k = 0; k < 3; k++) {
        place.axis[0][k] = out[k];
        place.axis[2][k] = in[k];
        place.origin[k] = corner[k] - in[k] * run->bend;
    }
    strl__cross(place.axis[2], place.axis[0], place.axis[1]);
    int steps = run->outer < 0.05 ? 4 : run->outer < 0.15 ? 6 : 8;
    strl__part_bend(strl__plant_mesh(run->plant), run->bend, 0.25, run->outer, run->sides, steps);
    strl__plant_part(run->plant, "ELBOW", run->skin, &place);
}

/* Two flanges face to face and their bolts; returns the length. */
static double put_joint(const line_run *run, const strl__affine *leg, double s)
{
    const strl__affine place = at_run(leg, s);
    strl__plant_flange(run->plant, &place, run->line->radius, 2, true);
    return 2 * strl__plant_flange_thickness(run->line->radius);
}

static void put_wheel(const line_run *run, const strl__affine *body, double r)
{
    strl__part_mesh *mesh = strl__plant_mesh(run->plant);
    const strl__affine upright = {.axis = {{1, 0, 0}, {0, 0, -1}, {0, 1, 0}}, .origin = {0, 4.6 * r + 0.1, 0}};
    double size = 1.5 * r + 0.06;
    mesh->place = upright;
    strl__part_torus(mesh, size, 0.012 + 0.04 * r, 6, 18);
    for (int i = 0; i < 4; i++) {
        double c, s;
        strl__circle_step(i, 4, &c, &s);
        const double hub[3] = {0, 0, 0}, rim[3] = {size * c, size * s, 0};
        strl__part_bar(mesh, hub, rim, 0.008 + 0.03 * r, 5);
    }
    strl__plant_part(run->plant, "HANDWHEEL", STRL__PIPE_FIRE, body);
}

/* A gate valve between its two joints; returns the length of all. */
static double put_valve(const line_run *run, const strl__affine *leg, double s)
{
    double r = run->line->radius, length = 4 * r + 0.08, from = s;
    s += put_joint(run, leg, s);
    const strl__affine body = at_run(leg, s + length / 2);
    double h = length / 2;
    const strl__turn_point shape[] = {{0, -h, false},
                                      {r, -h, false},
                                      {r * 1.1, -h * 0.7, true},
                                      {r * 1.5, -h * 0.3, true},
                                      {r * 1.5, h * 0.3, true},
                                      {r * 1.1, h * 0.7, true},
                                      {r, h, false},
                                      {0, h, false}};
    strl__part_turned(strl__plant_mesh(run->plant), shape, 8, false, run->sides);
    strl__plant_part(run->plant, "VALVE", run->line->material, &body);
    strl__part_mesh *mesh = strl__plant_mesh(run->plant);
    const double foot[3] = {0}, neck[3] = {0, 2.4 * r, 0}, top[3] = {0, 2.4 * r + 0.03 + 0.2 * r, 0},
                 tip[3] = {0, 4.6 * r + 0.13, 0};
    strl__part_bar(mesh, foot, neck, r * 0.8, 10);
    strl__part_bar(mesh, neck, top, r * 1.3, 12);
    strl__part_bar(mesh, top, tip, 0.01 + 0.1 * r, 6);
    strl__plant_part(run->plant, "BONNET", run->line->material, &body);
    put_wheel(run, &body, r);
    s += length;
    return s + put_joint(run, leg, s) - from;
}

/* Clamps with rods up to the steel above. */
static void put_hangers(const line_run *run, const strl__affine *leg, double from, double to)
{
    const double up = run->line->hangers;
    int count = (int)((to - from) / 2.8);
    for (int i = 0; i < count; i++) {
        const strl__affine place = at_run(leg, from + (to - from) * (i + 0.5) / count);
        strl__part_mesh *mesh = strl__plant_mesh(run->plant);
        const double low[3] = {0, run->outer * 0.9, 0}, high[3] = {0, up, 0};
        strl__part_ring(mesh, run->outer * 0.97, run->outer + 0.008, -0.02, 0.02, run->sides);
        strl__part_bar(mesh, low, high, 0.008, 5);
        strl__plant_part(run->plant, "HANGER", STRL__GALVANISED, &place);
    }
}

/* A leg between its elbows or ends: a valve where there is room, and spools of pipe with joints or welds. */
static void put_leg(const line_run *run, const strl__affine *leg, double from, double to, bool hung)
{
    strl__plant *plant = run->plant;
    double valve = 4 * strl__plant_flange_thickness(run->line->radius) + 4 * run->line->radius + 0.08;
    if (hung)
        put_hangers(run, leg, from, to);
    if (run->line->valves && to - from > valve + 0.6 && strl__plant_chance(plant, 0.4)) {
        double at = strl__plant_between(plant, from + 0.2, to - valve - 0.2);
        put_pipe(run, leg, from, at);
        from = at + put_valve(run, leg, at);
    }
    while (to - from > SPOOL + 1) {
        put_pipe(run, leg, from, from + SPOOL);
        from += SPOOL;
        if (strl__plant_chance(plant, 0.35))
            from += put_joint(run, leg, from);
    }
    put_pipe(run, leg, from, to);
}

static void put_legs(const line_run *run)
{
    const strl__line *line = run->line;
    const strl__route *route = &line->route;
    const double thick = strl__plant_flange_thickness(line->radius);
    double way[3], next[3], points[2][3];
    for (int i = 0; i + 1 < route->count; i++) {
        for (int k = 0; k < 3; k++) {
            points[0][k] = route->points[i][k] - route->points[0][k];
            points[1][k] = route->points[i + 1][k] - route->points[0][k];
        }
        double length = leg_length(points[0], points[1], way);
        bool first = i == 0, last = i + 2 == route->count;
        const strl__affine leg = strl__affine_along(points[0], way);
        double from = first ? 0 : run->bend, to = last ? length : length - run->bend;
        if (first && line->flange_first) {
            strl__plant_flange(run->plant, &leg, line->radius, 1, false);
            from = thick;
        }
        if (last && line->flange_last) {
            to -= thick;
            const strl__affine end = at_run(&leg, to);
            strl__plant_flange(run->plant, &end, line->radius, 1, true);
        }
        put_leg(run, &leg, from, to, line->hangers > 0 && fabs(way[0]) > 0.5);
        if (!last) {
            leg_length(route->points[i + 1], route->points[i + 2], next);
            put_elbow(run, points[1], way, next);
        }
    }
}

void strl__plant_line(strl__plant *plant, const strl__line *line)
{
    const double *start = line->route.points[0];
    const strl__affine place = strl__affine_move(start[0], start[1], start[2]);
    line_run run = {.plant = plant,
                    .line = line,
                    .outer = line->insulated ? line->radius * 1.2 + 0.025 : line->radius,
                    .bend = 3 * line->radius,
                    .skin = line->insulated ? STRL__INSULATION : line->material};
    run.sides = strl__plant_sides(run.outer);
    strl__plant_open(plant, "LINE", &place);
    put_legs(&run);
    strl__plant_close(plant);
}
