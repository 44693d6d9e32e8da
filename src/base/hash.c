#include "base/hash.h"

#include <string.h>
#include <xxhash.h>

uint64_t strl__checksum(const void *data, size_t size)
{
    return XXH3_64bits(data, size);
}

void strl__digest(const void *data, size_t size, uint8_t digest[16])
{
    XXH128_canonical_t canonical;
    XXH128_canonicalFromHash(&canonical, XXH3_128bits(data, size));
    memcpy(digest, canonical.digest, 16);
}
