/* What the makers of a plant's pieces share.
 *
 * A unit of the plant is made of items (a floor, a vessel, a pipe line), each of some parts. An item is first made
 * without writing it, to count its triangles, and then in earnest where it fits into what is left of the budget: so the
 * whole has the wanted number of triangles without any list of what there is. Making is a pure function of the state
 * below. Lengths are metres, z is up. After a failure `status` is set and every call does nothing. */
#ifndef STRL_SCENES_PLANT_PLANT_H
#define STRL_SCENES_PLANT_PLANT_H

#include "scenes/generator.h"
#include "scenes/parts/writer.h"

enum {
    STRL__PLANT_PART_LEAST = 12,
    STRL__PLANT_PART_MOST = 100000,
    STRL__PLANT_NOZZLES = 192,
    STRL__PLANT_TIERS = 3,  /* of a pipe rack */
    STRL__PLANT_LANES = 13, /* of a tier */
    STRL__PLANT_BAYS = 8    /* most of a frame, along x and along y */
};

#define STRL__PLANT_BAY 6.0      /* between columns */
#define STRL__PLANT_STOREY 5.0   /* between floors */
#define STRL__PLANT_RACK_LOW 1.0 /* the rack's y, in its unit */
#define STRL__PLANT_RACK_HIGH 7.0
#define STRL__PLANT_REACH 3.0 /* of headers past their plot, to the middle of the road */

/* In the order of strl__plant_materials. */
typedef enum strl__plant_material {
    STRL__STEEL,
    STRL__GALVANISED,
    STRL__INSULATION,
    STRL__CONCRETE,
    STRL__SAFETY_YELLOW,
    STRL__GLASS,
    STRL__PIPE_WATER,
    STRL__PIPE_STEAM,
    STRL__PIPE_GAS,
    STRL__PIPE_AIR,
    STRL__PIPE_OIL,
    STRL__PIPE_ACID,
    STRL__PIPE_FIRE,
    STRL__TANK_WHITE,
    STRL__MACHINE_BLUE,
    STRL__PRIMER,
    STRL__CABLE,
    STRL__FRAME_GREY,
    STRL__PLANT_MATERIALS
} strl__plant_material;

extern const strl__material strl__plant_materials[STRL__PLANT_MATERIALS];

/* Where a line may begin or end, in the unit. */
typedef struct strl__nozzle {
    double position[3], direction[3];
    double radius;
    bool taken;
} strl__nozzle;

/* A pipe that runs along the rack through the whole unit; radius 0: the lane is free. */
typedef struct strl__header {
    double radius;
    strl__plant_material material;
} strl__header;

/* All that making an item reads and changes. */
typedef struct strl__plant_state {
    uint64_t random;
    unsigned part_number;      /* in the innermost group */
    unsigned item_numbers[26]; /* by the first letter of the group's kind */
    unsigned nozzle_count, line_count;
    strl__nozzle nozzles[STRL__PLANT_NOZZLES];
} strl__plant_state;

/* The unit being made: its sizes and what lies where. */
typedef struct strl__plant_unit {
    unsigned number;
    int bays_x, bays_y, levels;
    double length, depth; /* of its plot */
    double frame_x, frame_y;
    bool hollow[STRL__PLANT_BAYS][STRL__PLANT_BAYS]; /* bays taken by something that goes through all floors */
    strl__header headers[STRL__PLANT_TIERS][STRL__PLANT_LANES];
    uint64_t budget;
} strl__plant_unit;

typedef struct strl__plant {
    strl__scene_run *run;
    strl__part_mesh mesh;
    strl__plant_state state;
    strl__plant_unit unit;
    strl__affine group; /* of the open item, in the unit: nozzles are told in the unit's own coordinates */
    uint64_t left;      /* triangles of the unit's budget */
    uint64_t made;      /* triangles written, of all units */
    bool is_last_unit;
    bool counts; /* this is a rehearsal */
    uint64_t counted;
    strl_status status;
    strl_error *err;
} strl__plant;

typedef void (*strl__plant_item)(strl__plant *plant, const void *what);

/* Makes the item where `keep` triangles of the unit's budget are left after it; returns whether. */
bool strl__plant_try(strl__plant *plant, strl__plant_item item, const void *what, uint64_t keep);

double strl__plant_random(strl__plant *plant); /* in [0, 1) */
double strl__plant_between(strl__plant *plant, double low, double high);
int strl__plant_choice(strl__plant *plant, int count); /* 0 .. count - 1 */
bool strl__plant_chance(strl__plant *plant, double share);

/* A group of the unit, named KIND-NUMBER. */
void strl__plant_open(strl__plant *plant, const char *kind, const strl__affine *place);
void strl__plant_open_named(strl__plant *plant, const char *name, const strl__affine *place);
void strl__plant_close(strl__plant *plant);
/* An empty mesh to fill; then part writes it under the name KIND-NUMBER. */
strl__part_mesh *strl__plant_mesh(strl__plant *plant);
void strl__plant_part(strl__plant *plant, const char *kind, strl__plant_material material, const strl__affine *place);
/* Remembers a place where a line may begin, given in the open group. */
void strl__plant_add_nozzle(strl__plant *plant, const double position[3], const double direction[3], double radius);

/* ---- one call for one part, in the open group ---- */
void strl__plant_box(strl__plant *plant, const char *kind, strl__plant_material material, const double low[3],
                     const double high[3]);
void strl__plant_bar(strl__plant *plant, const char *kind, strl__plant_material material, const double from[3],
                     const double to[3], double radius, int sides);
void strl__plant_beam(strl__plant *plant, const char *kind, strl__plant_material material, const double from[3],
                      const double to[3], const strl__outline *outline);
/* Bolts on a circle, through [low, high] along z of the place; one part. */
void strl__plant_bolts(strl__plant *plant, const strl__affine *place, double circle, int count, double radius,
                       double low, double high);
double strl__plant_flange_thickness(double pipe_radius);
/* One flange on z from 0 to its thickness, or two of them face to face; bolts reach through two. */
void strl__plant_flange(strl__plant *plant, const strl__affine *place, double pipe_radius, int count, bool bolts);
int strl__plant_sides(double radius); /* of a pipe */

/* ---- items: `what` is NULL or as stated ---- */
typedef struct strl__plant_bay {
    int x, y, level;
} strl__plant_bay;

/* A plot on the ground or on a floor. */
typedef struct strl__plant_spot {
    double x, y, z;    /* its low corner */
    double wide, deep; /* along x and y */
    double high;       /* room above it */
} strl__plant_spot;

void strl__plant_item_ground(strl__plant *plant, const void *what);
void strl__plant_item_rack_bent(strl__plant *plant, const void *what);   /* strl__plant_bay: x */
void strl__plant_item_column(strl__plant *plant, const void *what);      /* strl__plant_bay: x, y */
void strl__plant_item_floor_steel(strl__plant *plant, const void *what); /* strl__plant_bay: level */
void strl__plant_item_grating(strl__plant *plant, const void *what);     /* strl__plant_bay: level */
void strl__plant_item_rails(strl__plant *plant, const void *what);       /* strl__plant_bay: level */
void strl__plant_item_stair(strl__plant *plant, const void *what);       /* strl__plant_bay: level */
/* strl__plant_spot each */
void strl__plant_item_column_vessel(strl__plant *plant, const void *what);
void strl__plant_item_drum(strl__plant *plant, const void *what);
void strl__plant_item_exchanger(strl__plant *plant, const void *what);
void strl__plant_item_tank(strl__plant *plant, const void *what);
void strl__plant_item_air_cooler(strl__plant *plant, const void *what);
void strl__plant_item_boiler(strl__plant *plant, const void *what);
void strl__plant_item_cooling_tower(strl__plant *plant, const void *what);
void strl__plant_item_stack(strl__plant *plant, const void *what);
void strl__plant_item_skid(strl__plant *plant, const void *what);
void strl__plant_item_cabinets(strl__plant *plant, const void *what);
void strl__plant_item_cabin(strl__plant *plant, const void *what);
/* strl__plant_bay: x the tier, y the lane */
void strl__plant_item_header(strl__plant *plant, const void *what);
void strl__plant_item_nozzle_line(strl__plant *plant, const void *what);
void strl__plant_item_joining_line(strl__plant *plant, const void *what);
void strl__plant_item_bank_line(strl__plant *plant, const void *what);
void strl__plant_item_tray(strl__plant *plant, const void *what); /* strl__plant_bay: level */
void strl__plant_item_lamp(strl__plant *plant, const void *what);
/* const unsigned: the place in the yard */
void strl__plant_item_spool(strl__plant *plant, const void *what);
void strl__plant_item_crate(strl__plant *plant, const void *what);

/* A ladder on x = 0 .. 0.5, climbing z at y = 0, caged towards -y above 2.5 m; one part or two. */
void strl__plant_ladder(strl__plant *plant, const strl__affine *place, double height);

/* ---- pipe lines ---- */
enum { STRL__ROUTE_MOST = 12 };

typedef struct strl__route {
    int count;
    double points[STRL__ROUTE_MOST][3];
} strl__route;

typedef struct strl__line {
    strl__route route; /* axis-aligned legs */
    double radius;
    strl__plant_material material;
    bool insulated;
    bool flange_first, flange_last; /* else the end runs into something */
    bool valves;
    double hangers; /* length of rods above legs along x; 0 = none */
} strl__line;

/* Joins legs of one direction; false where legs are too short for their elbows or turn back. */
bool strl__route_tidy(strl__route *route, double bend);
void strl__plant_line(strl__plant *plant, const strl__line *line);

/* The middle of a lane of the rack. */
void strl__plant_lane(int tier, int lane, double *y, double *z);

#endif
