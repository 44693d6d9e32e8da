/* Length units by their names: what `build --unit` takes and a walker's height is measured in. */
#ifndef STRL_CLI_UNITS_H
#define STRL_CLI_UNITS_H

/* As the words of an option, in the order of their numbers. */
#define STRL_CLI_UNITS "um|mm|cm|dm|m|km|in|ft|yd|mi"

/* The name of a number of STRL_CLI_UNITS. */
const char *strl_cli_unit_name(int number);
/* How long one is; 0 = no such unit: containers made by others may name any. */
double strl_cli_unit_metres(const char *name);

#endif
