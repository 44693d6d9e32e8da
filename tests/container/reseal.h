/* Makes a damaged container's checksums right again, from the leaves up to the header, so that tests and fuzzers reach
 * the checks behind the checksums. Walks hostile bytes itself: every range is checked, and the work is bounded. */
#ifndef STRL_TESTS_CONTAINER_RESEAL_H
#define STRL_TESTS_CONTAINER_RESEAL_H

#include <stdbool.h>
#include <string.h>
#include <xxhash.h>

#include "base/cursor.h"
#include "base/hash.h"
#include "container/layout.h"

typedef struct reseal {
    uint8_t *data;
    size_t size;
    unsigned budget; /* pieces that may still be visited */
    /* Told of every piece; may be NULL. */
    void (*visit)(void *context, uint64_t offset, uint32_t bytes);
    void *context;
} reseal;

static inline bool reseal__range(reseal *self, uint64_t offset, uint64_t bytes)
{
    if (self->budget == 0 || offset > self->size || bytes > self->size - offset || bytes > UINT32_MAX)
        return false;
    self->budget--;
    if (self->visit)
        self->visit(self->context, offset, (uint32_t)bytes);
    return true;
}

/* The checksum of the piece goes to `at` inside the piece that names it. */
static inline void reseal__store(reseal *self, uint64_t at, uint64_t offset, uint32_t bytes)
{
    strl__store_le(self->data + at, 8, strl__checksum(self->data + offset, bytes));
}

static inline uint64_t reseal__get(const reseal *self, uint64_t at, unsigned count)
{
    return strl__load_le(self->data + at, count);
}

static inline void reseal__treelet(reseal *self, uint64_t offset, uint32_t bytes, uint64_t checksum_at, unsigned depth)
{
    if (depth == 0 || bytes < STRL__TREELET_HEAD_BYTES || !reseal__range(self, offset, bytes))
        return;
    uint64_t end = offset + bytes, at = offset + STRL__TREELET_HEAD_BYTES;
    uint64_t nodes = reseal__get(self, offset + 4, 4);
    for (; nodes && end - at >= STRL__NODE_BYTES; nodes--, at += STRL__NODE_BYTES) {
        uint64_t page = reseal__get(self, at + 208, 8);
        uint32_t page_bytes = (uint32_t)reseal__get(self, at + 216, 4);
        if (reseal__range(self, page, page_bytes))
            reseal__store(self, at + 224, page, page_bytes);
    }
    for (; end - at >= STRL__CHILD_REF_BYTES; at += STRL__CHILD_REF_BYTES)
        reseal__treelet(self, reseal__get(self, at, 8), (uint32_t)reseal__get(self, at + 8, 4), at + 16, depth - 1);
    reseal__store(self, checksum_at, offset, bytes);
}

static inline void reseal__table(reseal *self, uint64_t offset, uint32_t bytes, uint64_t checksum_at, uint32_t depth)
{
    if (!reseal__range(self, offset, bytes))
        return;
    uint64_t end = offset + bytes;
    for (uint64_t at = offset + STRL__INDEX_HEAD_BYTES;
         depth && depth < 4 && at < end && end - at >= STRL__TABLE_REF_BYTES; at += STRL__TABLE_REF_BYTES)
        reseal__table(self, reseal__get(self, at, 8), (uint32_t)reseal__get(self, at + 24, 4), at + 16, depth - 1);
    reseal__store(self, checksum_at, offset, bytes);
}

/* The pages that runs name, of one leaf of their table. */
static inline void reseal__run_pages(reseal *self, uint64_t offset, uint32_t bytes)
{
    uint64_t count = bytes >= 4 ? reseal__get(self, offset, 4) : 0;
    for (uint64_t i = 0; i < count && 4 + 4 * count + (i + 1) * STRL__RUN_BYTES <= bytes; i++) {
        uint64_t at = offset + 4 + 4 * count + i * STRL__RUN_BYTES, page = reseal__get(self, at + 64, 8);
        uint32_t page_bytes = (uint32_t)reseal__get(self, at + 60, 4);
        if (reseal__range(self, page, page_bytes))
            reseal__store(self, at + 72, page, page_bytes);
    }
}

/* Behind the placements, whose index may have changed but not their leaves. */
static inline void reseal__runs(reseal *self, uint64_t offset, uint32_t bytes, uint64_t checksum_at, uint32_t depth)
{
    if (depth == 0 && offset <= self->size && bytes <= self->size - offset)
        reseal__run_pages(self, offset, bytes);
    reseal__table(self, offset, bytes, checksum_at, depth);
}

static inline void reseal__trees(reseal *self, uint64_t offset, uint32_t bytes, uint64_t checksum_at)
{
    if (!reseal__range(self, offset, bytes))
        return;
    for (uint32_t at = 0; bytes - at >= STRL__TREE_BYTES; at += STRL__TREE_BYTES)
        reseal__treelet(self, reseal__get(self, offset + at + 120, 8),
                        (uint32_t)reseal__get(self, offset + at + 128, 4), offset + at + 136, 8);
    reseal__store(self, checksum_at, offset, bytes);
}

/* The header's own: file_bytes is left as it is. */
static inline void reseal_header(uint8_t *data)
{
    XXH128_canonical_t id;
    memset(data + STRL__AT_MODEL_ID, 0, 16);
    memset(data + STRL__AT_CHECKSUM, 0, 8);
    XXH128_canonicalFromHash(&id, XXH3_128bits(data, STRL__HEADER_BYTES));
    memcpy(data + STRL__AT_MODEL_ID, id.digest, 16);
    strl__store_le(data + STRL__AT_CHECKSUM, 8, strl__checksum(data, STRL__HEADER_BYTES));
}

static inline void reseal_all(uint8_t *data, size_t size, void (*visit)(void *, uint64_t, uint32_t), void *context)
{
    if (size < STRL__HEADER_BYTES)
        return;
    reseal self = {data, size, 20000, visit, context};
    uint64_t count = reseal__get(&self, 160, 4);
    for (uint64_t i = 0; i < count && i < STRL__MAX_SECTIONS; i++) {
        uint64_t at = STRL__AT_SECTIONS + i * STRL__SECTION_BYTES, kind = reseal__get(&self, at, 4);
        uint64_t offset = reseal__get(&self, at + 16, 8);
        uint32_t bytes = (uint32_t)reseal__get(&self, at + 24, 4);
        if (kind == STRL__SECTION_TREES)
            reseal__trees(&self, offset, bytes, at + 32);
        else if (kind == STRL__SECTION_RUNS)
            reseal__runs(&self, offset, bytes, at + 32, (uint32_t)reseal__get(&self, at + 4, 4));
        else if (kind <= STRL__KNOWN_SECTIONS)
            reseal__table(&self, offset, bytes, at + 32, (uint32_t)reseal__get(&self, at + 4, 4));
    }
    reseal_header(data);
}

#endif
