/* One unit of a plant. */
#ifndef STRL_SCENES_PLANT_UNIT_H
#define STRL_SCENES_PLANT_UNIT_H

#include "scenes/plant/plant.h"

typedef enum strl__plant_unit_kind { UNIT_PROCESS, UNIT_STORAGE, UNIT_COOLING, UNIT_POWER } strl__plant_unit_kind;

/* plant->unit, left and state are set. */
void strl__plant_make_unit(strl__plant *plant, strl__plant_unit_kind kind);

#endif
