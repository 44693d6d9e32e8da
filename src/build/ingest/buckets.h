/* Triangles on the lattice in ranges of the space-filling curve: what ingest makes of the inputs, and builders go on
 * with. */
#ifndef STRL_BUILD_INGEST_BUCKETS_H
#define STRL_BUILD_INGEST_BUCKETS_H

#include "build/ingest/ingest.h"

typedef struct strl_buckets {
    uint32_t count;
    uint64_t *splitter; /* [count - 1] first key of bucket i + 1 */
    bool shares_keys;   /* what has the key of equal splitters lies in all buckets between them, and in no other */
    /* [count] packed triangles, in the order of the input; a builder deletes those that it has used up. Of an octree
     * they are kept where the context keeps. */
    strl_spill **spill;
} strl_buckets;

/* From the inputs to buckets: the stages survey and read. octree: splitters are borders of cells of the octree, the
 * largest near by, and where more than a bucket's triangles have one key, several buckets share them. Where there is no
 * triangle, no bucket is made either. */
strl_status strl_ingest_begin(strl_build_context *context, bool octree, strl_ingest *ingest, strl_buckets *buckets,
                              strl_error *err);
/* First and last key of what may be in a bucket, where keys are shared. */
void strl__bucket_range(const strl_buckets *buckets, uint32_t index, uint64_t *low, uint64_t *high);
void strl__buckets_deinit(strl_buckets *buckets);

/* Name of a bucket's stream. */
void strl__bucket_name(uint32_t index, char name[24]);

/* Ingest and buckets into streams of a checkpoint, and back. first: the buckets before it are used up, and stay NULL.
 */
strl_status strl_buckets_save(strl_build_context *context, const strl_ingest *ingest, const strl_buckets *buckets,
                              strl_error *err);
strl_status strl_buckets_restore(strl_build_context *context, uint32_t first, strl_ingest *ingest,
                                 strl_buckets *buckets, strl_error *err);

/* Position on the curve of a lattice point: 21 bits of each axis, three bits a level of an octree, x lowest. */
uint64_t strl__curve_key(const strl_ingest *ingest, const uint32_t position[3]);
uint64_t strl__curve_key_of_triangle(const strl_ingest *ingest, const strl_soup_triangle *triangle);

/* Records of buckets: all that a triangle has. The soup's are the first strl_soup_bytes() of them. */
size_t strl__soup_bucket_bytes(const strl_ingest *ingest);
/* Two corners in one lattice cell. */
bool strl__soup_has_collapsed(const strl_soup_triangle *triangle);
/* Whether a triangle that was read back may be one of the tree's. */
bool strl__soup_is_sound(const strl_ingest *ingest, const strl_soup_triangle *triangle);
void strl__soup_unpack(const strl_ingest *ingest, const uint8_t *bytes, strl_soup_triangle *triangle);

typedef struct strl_keyed {
    uint64_t key;
    uint64_t index;
} strl_keyed;

/* Stable, by key; other: room for as many. */
void strl__sort_keys(strl_keyed *items, strl_keyed *other, uint64_t count);

/* How many items of this size may be under way at once: one a worker and one more where the budget allows, one in any
 * case. Buckets and pair spills are of bounded number, so those of a very large model are larger than
 * strl__bucket_bytes. */
unsigned strl__ingest_window(const strl_build_context *context, uint64_t bytes_each);

#endif
