/* Where a model is: a file, or an address on the web. The one place of the programs that tells them apart. */
#ifndef STRL_APPS_LOCATION_H
#define STRL_APPS_LOCATION_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "stroll/container.h"
#include "stroll/source.h"

/* Strings are borrowed. */
typedef struct strl_location {
    const char *name;     /* a path, or http://... or https://... */
    const char *cache;    /* the folder for what addresses gave; NULL = none */
    uint64_t cache_bytes; /* 0 = the library's default */
} strl_location;

/* Anything with "://" is meant as an address, which not all programs can reach. */
bool strl_location_is_remote(const char *name);
/* As sentences and titles may show it: a path itself, of an address no password and no query. */
const char *strl_location_shown(const char *name, char *shown, size_t size);
/* threads: of a file; an address has its own. STRL_ERR_UNSUPPORTED where it is an address of another kind. */
strl_status strl_location_open_source(const strl_location *location, unsigned threads, strl_source **source,
                                      strl_error *err);
/* For reads that may wait. */
strl_status strl_location_open_container(const strl_location *location, strl_container **container, strl_error *err);
/* By its first bytes. What is behind an address is taken for one: opening it will tell. */
strl_status strl_location_is_container(const strl_location *location, bool *answer, strl_error *err);

#endif
