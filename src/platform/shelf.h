/* A folder of small files of one user that several processes share without a lock: a file appears under its name when
 * it is whole, and not before. The time of its last change is the time of its last use. */
#ifndef STRL_PLATFORM_SHELF_H
#define STRL_PLATFORM_SHELF_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "stroll/error.h"

typedef struct strl_shelf strl_shelf; /* one that is looked through */

typedef struct strl_shelf_entry {
    const char *name; /* borrowed until the next call */
    uint64_t bytes;
    uint64_t used_ns; /* since the epoch of the system's clock */
} strl_shelf_entry;

/* What strl_shelf_entry.used_ns is compared with. */
uint64_t strl_shelf_now_ns(void);

/* Looks through the folder: every regular file, in no order; links are none. */
strl_status strl_shelf_open(const char *path, strl_shelf **shelf, strl_error *err);
void strl_shelf_close(strl_shelf *shelf); /* NULL is legal */
/* The next entry; its name is NULL at the end, and "" where it is no file. */
strl_status strl_shelf_next(strl_shelf *shelf, strl_shelf_entry *entry, strl_error *err);

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
