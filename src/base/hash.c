#include "base/hash.h"

#include <xxhash.h>

uint64_t strl__checksum(const void *data, size_t size)
{
    return XXH3_64bits(data, size);
}
