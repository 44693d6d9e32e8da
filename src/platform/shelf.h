/* A folder of small files that several processes share without a lock: a file appears under its name when it is whole,
 * and not before. The time of its last change is the time of its last use. */
#ifndef STRL_PLATFORM_SHELF_H
#define STRL_PLATFORM_SHELF_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "stroll/error.h"

typedef struct strl_shelf_entry {
    const char *name; /* borrowed for the call */
    uint64_t bytes;
    uint64_t used_ns; /* since the epoch of the system's clock */
} strl_shelf_entry;

/* What strl_shelf_entry.used_ns is compared with. */
uint64_t strl_shelf_now_ns(void);

/* Every regular file in the folder, in no order; links are none. visit returns false to end. */
strl_status strl_shelf_visit(const char *path, bool (*visit)(void *context, const strl_shelf_entry *entry),
                              void *context, strl_error *err);

typedef struct strl_shelf_piece {
    const void *data;
    size_t size;
} strl_shelf_piece;

/* Writes the pieces, one after the other, as the file `name`; replaces what has that name, also a link. Until then
 * the bytes are in "name.XXXXXXXX.part", XXXXXXXX being what nothing else is called by, which a kill leaves
 * behind. Not forced to the disk. */
strl_status strl_shelf_put(const char *path, const char *name, const strl_shelf_piece *pieces, size_t count,
                            strl_error *err);
/* Now is its last use. Nothing happens where that cannot be noted. */
void strl_shelf_touch(const char *path, const char *name);

#endif
