/* Length units by their names: what `build --unit` takes and a walker's height is measured in. */
#ifndef STRL_APPS_UNITS_H
#define STRL_APPS_UNITS_H

/* As the words of an option, in the order of their numbers. */
#define STRL_UNITS "um|mm|cm|dm|m|km|in|ft|yd|mi"

/* The name of a number of STRL_UNITS. */
const char *strl_unit_name(int number);
/* How long one is; 0 = no such unit: containers made by others may name any. */
double strl_unit_metres(const char *name);

#endif
