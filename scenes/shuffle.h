/* Records in a seeded random order, in constant memory.
 *
 * The order is a bijection that is computed, not stored: a Feistel network over the next power of two, walked along its
 * cycle until it is back in range. So the place of a record is known without a table, and a triangle's corners can be
 * renamed wherever it is. */
#ifndef STRL_SCENES_SHUFFLE_H
#define STRL_SCENES_SHUFFLE_H

#include "scenes/records.h"

enum { STRL__PERMUTATION_ROUNDS = 6 };

/* A bijection of 0 .. count - 1. */
typedef struct strl__permutation {
    uint64_t count;
    unsigned low_bits, high_bits;
    uint64_t keys[STRL__PERMUTATION_ROUNDS];
} strl__permutation;

strl__permutation strl__permutation_of(uint64_t count, uint64_t seed);
/* Where `index` goes; both below count. */
uint64_t strl__permutation_at(const strl__permutation *permutation, uint64_t index);

typedef struct strl__shuffle {
    const strl__permutation *order;
    uint64_t memory_bytes;
    strl_file *spill;          /* empty, borrowed: holds all records with their places meanwhile */
    const char *path;          /* of the output, for sentences */
    strl_output_report report; /* bytes done of both passes; may be NULL */
    void *context;
} strl__shuffle;

/* Appends the records to `out`, the i-th of them at place order(i). */
strl_status strl__shuffle_write(const strl__shuffle *shuffle, const strl__records *records, strl__stream *out,
                                strl_error *err);

#endif
