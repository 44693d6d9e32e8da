/* Internal to store: what spill.c and spill_keep.c know of a stream. */
#ifndef STRL_STORE_SPILL_INTERNAL_H
#define STRL_STORE_SPILL_INTERNAL_H

#include <stdatomic.h>
#include <stdbool.h>

#include "platform/file.h"
#include "platform/thread.h"
#include "store/spill.h"

/* A multiple of every common block size, and large enough to keep punching off the profile. */
#define STRL__SPILL_STEP ((uint64_t)16 << 10)
#define STRL__SPILL_GONE 0xffffu /* in place of a step's dropped bytes: given back */
#define STRL__SPILL_NAME_BYTES 200

struct strl_spill_set {
    char *directory; /* owned */
    uint64_t limit_bytes;

    strl_mutex mutex;    /* guards all below */
    strl_spill *open;    /* list of open streams; owned */
    strl_spill *retired; /* kept streams to be deleted when a save without them is in place; owned */
    uint64_t bytes;
    uint64_t peak_bytes;
};

struct strl_spill {
    strl_spill_set *set;
    strl_spill *next; /* in the set's list, under its mutex */
    char *name;       /* owned */
    strl_file *file;  /* owned; NULL until created */
    bool kept;        /* a later run may go on with it */
    bool waits;       /* restored, and not taken yet */
    uint8_t *buffer;  /* owned; NULL between flush and append */
    size_t buffer_bytes;
    size_t buffered;
    _Atomic uint64_t flushed; /* bytes that may be read */

    /* of kept streams, the appending thread's: */
    uint64_t *sums; /* [sum_count] checksum of each whole step; owned */
    size_t sum_count, sum_capacity;
    uint8_t *tail; /* [STRL__SPILL_STEP] flushed bytes after the last whole step; owned */
    size_t tail_bytes;

    /* under the set's mutex: */
    uint16_t *dropped; /* [dropped_capacity] of each step, bytes that will not be read any more; owned */
    size_t dropped_capacity;
    size_t postponed_first, postponed_end; /* steps among which are those to be given back */
    uint64_t given_back;                   /* of the dropped bytes, those off the count */
};

void strl__spill_release(strl_spill *spill);
/* Before bytes are written, so that streams of several threads cannot pass the limit together. */
strl_status strl__spill_reserve(strl_spill_set *set, uint64_t size, strl_error *err);
/* After it: they were written, or go off the count. */
void strl__spill_count(strl_spill_set *set, uint64_t size, bool written);
/* A linked stream without a file yet; its name is taken from then on. */
strl_status strl__spill_new(strl_spill_set *set, const char *name, strl_spill **spill, strl_error *err);
void strl__spill_unlink(strl_spill_set *set, const strl_spill *spill);
strl_status strl__spill_with_path(strl_spill *spill,
                                  strl_status (*call)(strl_spill *spill, const char *path, strl_error *err),
                                  strl_error *err);
/* Removes the file of an unlinked stream, and the stream. */
strl_status strl__spill_delete(strl_spill *spill, strl_error *err);

/* Room for the checksums of `bytes` bytes. */
bool strl__spill_reach_sums(strl_spill *spill, uint64_t bytes);
void strl__spill_add_sums(strl_spill *spill, const void *data, size_t size);

/* With the mutex held: */
bool strl__spill_reach_step(strl_spill *spill, uint64_t steps);
void strl__spill_punch(strl_spill *spill, uint64_t step);
void strl__spill_postpone(strl_spill *spill, uint64_t step);

#endif
