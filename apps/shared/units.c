#include "shared/units.h"

#include <string.h>

typedef struct unit {
    const char *name;
    double metres;
} unit;

static const unit units[] = {{"um", 1e-6}, {"mm", 0.001},  {"cm", 0.01},   {"dm", 0.1},    {"m", 1},
                             {"km", 1000}, {"in", 0.0254}, {"ft", 0.3048}, {"yd", 0.9144}, {"mi", 1609.344}};

const char *strl_unit_name(int number)
{
    return units[number].name;
}

double strl_unit_metres(const char *name)
{
    for (size_t u = 0; u < sizeof units / sizeof *units; u++)
        if (!strcmp(units[u].name, name))
            return units[u].metres;
    return 0;
}
