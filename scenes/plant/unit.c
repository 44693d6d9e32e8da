/* One unit of the plant within a budget of triangles: first what carries, then what stands, then what runs between. */
#include "scenes/plant/unit.h"

#include <math.h>

/* Shares of the budget that must be left when a phase ends, so that every phase gets its own. */
#define KEEP_STEEL 0.45
#define KEEP_LANDMARK 0.32
#define KEEP_FLOOR_PLOTS 0.42
#define KEEP_GROUND_PLOTS 0.3
#define KEEP_HEADERS 0.25
#define KEEP_NOZZLE_LINES 0.15
#define KEEP_TRAYS 0.12

enum { FAILURES_MOST = 60, LAMPS_MOST = 12, SPOOLS_MOST = 400 };

static uint64_t keep(const strl__plant *plant, double share)
{
    return (uint64_t)((double)plant->unit.budget * share);
}

/* ---- what carries ---- */

static void make_steel(strl__plant *plant)
{
    const strl__plant_unit *unit = &plant->unit;
    uint64_t kept = keep(plant, KEEP_STEEL);
    strl__plant_try(plant, strl__plant_item_ground, NULL, 0);
    for (int x = 0; x * STRL__PLANT_BAY <= unit->length + 0.01; x++)
        strl__plant_try(plant, strl__plant_item_rack_bent, &(strl__plant_bay){x, 0, 0}, kept);
    for (int y = 0; y <= unit->bays_y; y++)
        for (int x = 0; x <= unit->bays_x; x++)
            strl__plant_try(plant, strl__plant_item_column, &(strl__plant_bay){x, y, 0}, kept);
    for (int level = 1; level <= unit->levels; level++) {
        const strl__plant_bay at = {0, 0, level};
        strl__plant_try(plant, strl__plant_item_floor_steel, &at, kept);
        strl__plant_try(plant, strl__plant_item_grating, &at, kept);
        strl__plant_try(plant, strl__plant_item_rails, &at, kept);
        strl__plant_try(plant, strl__plant_item_stair, &at, kept);
    }
}

/* ---- what stands ---- */

typedef struct plot_item {
    strl__plant_item item;
    double wide, deep, high, wide_most; /* of its spot; as deep as wide where both are one number */
    int weights[4];                     /* how often it is drawn, by the unit's kind */
} plot_item;

/* Kinds of unit: process, storage, cooling, power. */
static const plot_item plots[] = {
    {strl__plant_item_column_vessel, 5.0, 5.0, 26, 7.0, {5, 1, 1, 2}},
    {strl__plant_item_drum, 7.0, 3.6, 5, 11.0, {3, 2, 2, 2}},
    {strl__plant_item_tank, 11.0, 11.0, 14, 17.0, {1, 6, 1, 1}},
    {strl__plant_item_cooling_tower, 17.0, 17.0, 40, 21.0, {0, 0, 1, 0}},
    {strl__plant_item_stack, 6.0, 6.0, 50, 7.5, {1, 0, 0, 2}},
    {strl__plant_item_skid, 3.6, 2.4, 3, 4.0, {3, 4, 4, 3}},
    {strl__plant_item_air_cooler, 7.0, 6.0, 5, 12.0, {2, 0, 3, 1}},
    {strl__plant_item_cabin, 8.0, 6.0, 4, 11.0, {1, 1, 1, 1}},
};

enum { PLOTS = sizeof plots / sizeof plots[0] };

static const plot_item *draw_plot(strl__plant *plant, int kind)
{
    int total = 0;
    for (int i = 0; i < PLOTS; i++)
        total += plots[i].weights[kind];
    int drawn = strl__plant_choice(plant, total);
    for (int i = 0; i < PLOTS; i++) {
        drawn -= plots[i].weights[kind];
        if (drawn < 0)
            return &plots[i];
    }
    return &plots[0];
}

/* Fills a rectangle of the ground row by row. */
static void fill_ground(strl__plant *plant, double x, double y, double wide, double deep, int kind)
{
    const double left = x, right = x + wide, end = y + deep;
    uint64_t kept = keep(plant, KEEP_GROUND_PLOTS);
    double row = 0;
    for (int tries = 0; tries < FAILURES_MOST && plant->status == STRL_OK; tries++) {
        const plot_item *plot = draw_plot(plant, kind);
        strl__plant_spot spot = {x,          y,         0, strl__plant_between(plant, plot->wide, plot->wide_most),
                                 plot->deep, plot->high};
        spot.deep = plot->deep == plot->wide ? spot.wide : plot->deep;
        if (x + spot.wide > right) {
            x = left;
            y += row + 1;
            row = 0;
            spot.x = x;
            spot.y = y;
        }
        if (y >= end)
            return;
        if (x + spot.wide > right || y + spot.deep > end || !strl__plant_try(plant, plot->item, &spot, kept))
            continue;
        x += spot.wide + 0.8;
        row = fmax(row, spot.deep);
    }
}

static void fill_bay(strl__plant *plant, int x, int y, int level)
{
    const strl__plant_unit *unit = &plant->unit;
    uint64_t kept = keep(plant, KEEP_FLOOR_PLOTS);
    bool roof = level == unit->levels;
    strl__plant_spot spot = {unit->frame_x + STRL__PLANT_BAY * x + 0.3,
                             unit->frame_y + STRL__PLANT_BAY * y + 0.8,
                             STRL__PLANT_STOREY * level,
                             STRL__PLANT_BAY - 0.6,
                             3.4,
                             STRL__PLANT_STOREY - 1.2};
    static const strl__plant_item items[] = {strl__plant_item_exchanger, strl__plant_item_column_vessel,
                                             strl__plant_item_skid, strl__plant_item_drum, strl__plant_item_cabinets};
    double drawn = strl__plant_random(plant);
    if (drawn >= 0.8 || unit->hollow[x][y])
        return;
    strl__plant_item item = items[(int)fmin(drawn * 6.25, 4)];
    if (roof && drawn < 0.35) {
        spot.deep = STRL__PLANT_BAY - 1;
        item = strl__plant_item_air_cooler;
    }
    strl__plant_try(plant, item, &spot, kept);
}

/* A boiler takes two by two bays through all floors where the frame is large enough. */
static void plan_hollow(strl__plant *plant, int kind)
{
    strl__plant_unit *unit = &plant->unit;
    if (kind != UNIT_POWER || unit->bays_x < 3 || unit->bays_y < 3 || unit->levels < 3)
        return;
    for (int x = 1; x < 3; x++)
        for (int y = 1; y < 3; y++)
            unit->hollow[x][y] = true;
}

/* What makes a kind of unit: a boiler inside the frame, or a cooling tower beside it. Returns the width that it takes
 * of the ground on the right of the frame. */
static double make_landmark(strl__plant *plant, strl__plant_unit_kind kind, double right)
{
    const strl__plant_unit *unit = &plant->unit;
    uint64_t kept = keep(plant, KEEP_LANDMARK);
    const double bay = STRL__PLANT_BAY, size = fmin(20, unit->depth - unit->frame_y - 1);
    const strl__plant_spot inside = {
        unit->frame_x + bay, unit->frame_y + bay, 0, 2 * bay, 2 * bay, STRL__PLANT_STOREY * unit->levels + 1};
    const strl__plant_spot beside = {right, unit->frame_y, 0, size, size, 60};
    if (unit->hollow[1][1])
        strl__plant_try(plant, strl__plant_item_boiler, &inside, kept);
    if (kind == UNIT_COOLING && size > 12 && right + size < unit->length &&
        strl__plant_try(plant, strl__plant_item_cooling_tower, &beside, kept))
        return size + 1;
    return 0;
}

static void make_equipment(strl__plant *plant, strl__plant_unit_kind kind)
{
    const strl__plant_unit *unit = &plant->unit;
    double right = unit->frame_x + STRL__PLANT_BAY * unit->bays_x + 2.5,
           back = unit->frame_y + STRL__PLANT_BAY * unit->bays_y + 2;
    double taken = make_landmark(plant, kind, right);
    for (int level = unit->levels; level >= 0; level--)
        for (int y = 0; y < unit->bays_y; y++)
            for (int x = 0; x < unit->bays_x; x++)
                fill_bay(plant, x, y, level);
    fill_ground(plant, right + taken, unit->frame_y, unit->length - right - taken - 1, unit->depth - unit->frame_y - 1,
                kind);
    fill_ground(plant, unit->frame_x - 2.5, back, right - unit->frame_x, unit->depth - back - 1, kind);
}

/* ---- what runs between ---- */

/* Makes such items until that many tries in a row have failed, or nothing more fits. */
static void repeat(strl__plant *plant, strl__plant_item item, double share, int failures_most)
{
    uint64_t kept = keep(plant, share);
    for (int failures = 0; failures < failures_most && plant->left > kept && plant->status == STRL_OK;)
        failures = strl__plant_try(plant, item, NULL, kept) ? 0 : failures + 1;
}

static void make_lines(strl__plant *plant)
{
    const strl__plant_unit *unit = &plant->unit;
    uint64_t kept = keep(plant, KEEP_HEADERS);
    for (int i = 0; i < STRL__PLANT_TIERS * STRL__PLANT_LANES; i++) {
        /* Lanes far from each other first, so that a small unit's few headers are spread. */
        int lane = i / STRL__PLANT_TIERS * 5 % STRL__PLANT_LANES, tier = i % STRL__PLANT_TIERS;
        if (unit->headers[tier][lane].radius > 0 &&
            !strl__plant_try(plant, strl__plant_item_header, &(strl__plant_bay){tier, lane, 0}, kept))
            plant->unit.headers[tier][lane].radius = 0;
    }
    repeat(plant, strl__plant_item_nozzle_line, KEEP_NOZZLE_LINES, FAILURES_MOST);
    repeat(plant, strl__plant_item_joining_line, KEEP_NOZZLE_LINES, FAILURES_MOST);
    for (int level = 1; level <= unit->levels; level++)
        for (int y = 0; y < unit->bays_y; y++)
            strl__plant_try(plant, strl__plant_item_tray, &(strl__plant_bay){y % 2, y, level}, keep(plant, KEEP_TRAYS));
}

/* What is left after the last line goes into lamps, and into a yard that takes anything to the last dozen. */
static void make_rest(strl__plant *plant)
{
    unsigned lamps = (unsigned)(plant->unit.length / 6);
    for (unsigned i = 0; i < lamps && i < LAMPS_MOST; i++)
        strl__plant_try(plant, strl__plant_item_lamp, &i, keep(plant, 0.01));
    repeat(plant, strl__plant_item_bank_line, 0, 4 * FAILURES_MOST);
    if (!plant->is_last_unit)
        return; /* the next unit gets the rest */
    unsigned spools = 0;
    while (spools < SPOOLS_MOST && strl__plant_try(plant, strl__plant_item_spool, &spools, 0))
        spools++;
    unsigned crates = 40 * (spools / 10 + 1);
    while (strl__plant_try(plant, strl__plant_item_crate, &crates, 0))
        crates++;
}

void strl__plant_make_unit(strl__plant *plant, strl__plant_unit_kind kind)
{
    plan_hollow(plant, kind);
    make_steel(plant);
    make_equipment(plant, kind);
    make_lines(plant);
    make_rest(plant);
}
