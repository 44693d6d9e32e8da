/* Scene `plant`: a plant of units on a grid of plots, each with a pipe rack, a steel frame with floors, vessels, tanks,
 * machines and the pipe lines between them. Parts are many and tiny, a few are large, as in the models of GigaWalk
 * (Baxter et al. 2002, section 3: "a large pipe structure" beside "a relatively small bolt with 20 polygons").
 *
 * A unit is made of about half a million triangles; more triangles are more units, not finer ones. Units in odd rows
 * are turned round, so that two rows share a road, and some are mirrored, as twin units are. */
#include <math.h>
#include <stdio.h>

#include "base/hash.h"
#include "scenes/plant/unit.h"

#define UNIT_TRIANGLES 480000.0
#define ROAD (2 * STRL__PLANT_REACH) /* between plots */

/* The same for all units of a plant. */
typedef struct site_plan {
    unsigned units, columns;
    int bays_x, bays_y, levels;
    double length, depth;
} site_plan;

/* Bays by what a bay of a floor takes, with a quarter of the budget for the frame. */
static site_plan make_plan(uint64_t triangles)
{
    site_plan plan = {.units = (unsigned)lround(fmax(1, (double)triangles / UNIT_TRIANGLES))};
    double budget = (double)triangles / plan.units, bays = fmax(1, budget * 0.26 / 2600);
    plan.columns = (unsigned)ceil(sqrt(plan.units * 0.75));
    plan.levels = bays < 4 ? 1 : bays < 10 ? 2 : bays < 30 ? 3 : bays < 55 ? 4 : 5;
    bays /= plan.levels;
    plan.bays_y = bays < 2 ? 1 : bays < 6 ? 2 : bays < 12 ? 3 : 4;
    plan.bays_x = (int)lround(bays / plan.bays_y);
    plan.bays_x = plan.bays_x < 1 ? 1 : plan.bays_x > STRL__PLANT_BAYS ? STRL__PLANT_BAYS : plan.bays_x;
    double beside = budget < 30000 ? 6 : budget < 120000 ? 12 : budget < 300000 ? 20 : 34;
    plan.length = STRL__PLANT_BAY * ceil((4 + STRL__PLANT_BAY * plan.bays_x + beside) / STRL__PLANT_BAY);
    plan.depth = 12 + STRL__PLANT_BAY * plan.bays_y +
                 (budget < 30000    ? 2
                  : budget < 120000 ? 6
                  : budget < 300000 ? 12
                                    : 22);
    return plan;
}

/* Headers go on through all units of a row: they depend on the row, not on the unit. */
static void plan_headers(strl__plant *plant, unsigned row)
{
    static const double radii[] = {0.044, 0.057, 0.057, 0.084, 0.084, 0.11, 0.137, 0.162};
    static const strl__plant_material services[] = {STRL__PIPE_WATER, STRL__PIPE_STEAM, STRL__PIPE_GAS, STRL__PIPE_AIR,
                                                    STRL__PIPE_OIL,   STRL__PIPE_ACID,  STRL__PIPE_FIRE};
    plant->state.random = strl__mix64(plant->run->desc->seed ^ 0x517cc1b727220a95u * (row + 1));
    for (int tier = 0; tier < STRL__PLANT_TIERS; tier++)
        for (int lane = 0; lane < STRL__PLANT_LANES; lane++) {
            strl__header *header = &plant->unit.headers[tier][lane];
            header->radius = radii[strl__plant_choice(plant, 8)];
            header->material = services[strl__plant_choice(plant, 7)];
            if (strl__plant_chance(plant, 0.18))
                header->radius = 0;
        }
}

static strl__affine unit_place(const site_plan *plan, unsigned column, unsigned row, bool mirrored)
{
    double x = (plan->length + ROAD) * column, y = (plan->depth + ROAD) * row;
    strl__affine place = strl__affine_move(x, y, 0);
    if (row & 1) { /* turned round: its rack lies at the back */
        place = strl__affine_move(x + plan->length, y + plan->depth, 0);
        place.axis[0][0] = place.axis[1][1] = -1;
    }
    if (mirrored) {
        place.origin[0] += place.axis[0][0] * plan->length;
        place.axis[0][0] = -place.axis[0][0];
    }
    return place;
}

static void begin_unit(strl__plant *plant, const site_plan *plan, unsigned number)
{
    unsigned row = number / plan->columns;
    plant->unit = (strl__plant_unit){.number = number,
                                     .bays_x = plan->bays_x,
                                     .bays_y = plan->bays_y,
                                     .levels = plan->levels,
                                     .length = plan->length,
                                     .depth = plan->depth,
                                     .frame_x = 4,
                                     .frame_y = 12};
    plant->state = (strl__plant_state){0};
    plan_headers(plant, row);
    plant->state.random = strl__mix64(strl__mix64(plant->run->desc->seed + 1) + number);
    uint64_t wanted = plant->run->desc->triangles;
    plant->left = (wanted - plant->made) / (plan->units - number);
    plant->unit.budget = plant->left;
    plant->is_last_unit = number + 1 == plan->units;
}

static void make_unit(strl__plant *plant, const site_plan *plan, unsigned number)
{
    char name[STRL__PART_NAME_BYTES];
    begin_unit(plant, plan, number);
    static const strl__plant_unit_kind first[] = {UNIT_PROCESS, UNIT_POWER, UNIT_COOLING, UNIT_STORAGE};
    strl__plant_unit_kind kind = first[number < 4 ? (int)number : strl__plant_choice(plant, 4)];
    if (number >= 4 && strl__plant_chance(plant, 0.2))
        kind = UNIT_POWER;
    bool mirrored = number % 3 == 1 || (number > 0 && strl__plant_chance(plant, 0.3));
    const strl__affine place = unit_place(plan, number % plan->columns, number / plan->columns, mirrored);
    snprintf(name, sizeof name, "UNIT-%02u", number + 1);
    strl__plant_open_named(plant, name, &place);
    strl__plant_make_unit(plant, kind);
    strl__plant_close(plant);
}

strl_status strl__scene_plant(strl__scene_run *run, strl_error *err)
{
    strl__plant plant = {.run = run, .err = err};
    const site_plan plan = make_plan(run->desc->triangles);
    /* glTF and OBJ have y up. */
    const strl__affine upright = {.axis = {{1, 0, 0}, {0, 0, -1}, {0, 1, 0}}};
    strl__plant_open_named(&plant, "PLANT", &upright);
    for (unsigned number = 0; number < plan.units && plant.status == STRL_OK; number++)
        make_unit(&plant, &plan, number);
    strl__plant_close(&plant);
    strl__part_mesh_deinit(&plant.mesh);
    return plant.status;
}
