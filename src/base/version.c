#include "stroll/version.h"

const char *strl_version(void)
{
    return STRL_VERSION;
}
