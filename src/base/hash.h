/* Checksums and hash mixing. */
#ifndef STRL_BASE_HASH_H
#define STRL_BASE_HASH_H

#include <stddef.h>
#include <stdint.h>

/* XXH3 (64 bits, seed 0) of size bytes: the checksum of the container. Thread-safe. */
uint64_t strl__checksum(const void *data, size_t size);

/* XXH3 (128 bits, seed 0, canonical form) of size bytes: tells contents apart. Thread-safe. */
void strl__digest(const void *data, size_t size, uint8_t digest[16]);

/* A bijective mixing of 64 bits (the finaliser of splitmix64), for hash tables and seeded choices. */
static inline uint64_t strl__mix64(uint64_t value)
{
    value ^= value >> 30;
    value *= 0xbf58476d1ce4e5b9u;
    value ^= value >> 27;
    value *= 0x94d049bb133111ebu;
    return value ^ (value >> 31);
}

#endif
