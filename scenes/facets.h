/* From spilled corners and spilled vertices to the facets of a binary STL file. */
#ifndef STRL_SCENES_FACETS_H
#define STRL_SCENES_FACETS_H

#include "scenes/records.h"

enum { STRL__FACET_BYTES = 50, STRL__FACE_BYTES = 13 };

/* Vertices lie page by page in a cache: scenes name again what they have just written. */
typedef struct strl__facets {
    strl__spilled faces; /* as PLY has them: 3, then three indices; given back to the disk as they are read */
    strl_file *vertices; /* borrowed; each record begins with its position */
    size_t vertex_bytes; /* of a record */
    uint64_t vertex_count;
    uint8_t *pages;         /* owned */
    uint64_t *page_numbers; /* owned; number + 1 of the page in each slot */
    uint64_t slots;         /* a power of two */
} strl__facets;

strl_status strl__facets_init(strl__facets *facets, uint64_t memory_bytes, const char *path, strl_error *err);
void strl__facets_deinit(strl__facets *facets);
/* A strl__records.read; the context is a strl__facets. */
strl_status strl__facets_read(void *context, uint64_t first, size_t count, uint8_t *records, strl_error *err);

#endif
