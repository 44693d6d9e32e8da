/* The version, in this one place: the build reads it from here. Until 1.0 a new minor version may change
 * any declaration, and the shared library has another soname then; a new patch version changes none. */
#ifndef STROLL_VERSION_H
#define STROLL_VERSION_H

#include "stroll/export.h"

#ifdef __cplusplus
extern "C" {
#endif

#define STRL_VERSION_MAJOR 0
#define STRL_VERSION_MINOR 1
#define STRL_VERSION_PATCH 0
#define STRL_VERSION "0.1.0"

/* STRL_VERSION of the library that is linked, which may be a later patch than the header's. Static. Thread-safe. */
STRL_API const char *strl_version(void);

#ifdef __cplusplus
}
#endif
#endif
