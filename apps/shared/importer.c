#include "shared/importer.h"

#include <stddef.h>
#include <stdlib.h>

const char *strl_importer(void)
{
    const char *named = getenv("STROLL_IMPORT");
    return named && *named ? named : NULL;
}
