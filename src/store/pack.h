/* Numbers packed for scratch, not for exchange: how many bits a number has is told against what such
 * numbers had so far, then come the bits. Numbers of one kind share a model; both sides must use the
 * same models in the same order. */
#ifndef STRL_STORE_PACK_H
#define STRL_STORE_PACK_H

#include "base/cursor.h"

/* What is expected of numbers of one kind. Zero-initialise, or say how many bits the first ones may have. */
typedef struct strl_pack_model {
    uint16_t length; /* mean of the bits that they have, in 256ths */
} strl_pack_model;

typedef struct strl_packer {
    strl_writer *out; /* borrowed; says whether memory ran out */
    uint64_t pending;
    unsigned count; /* bits pending, below 32 between calls */
} strl_packer;

typedef struct strl_unpacker {
    const uint8_t *data; /* borrowed */
    uint64_t at, end;    /* bits */
    bool failed;         /* more was asked for than there is; zeros follow */
} strl_unpacker;

static inline uint32_t strl_pack_zigzag(uint32_t difference)
{
    return (difference << 1) ^ (0u - (difference >> 31));
}
static inline uint32_t strl_unpack_zigzag(uint32_t value)
{
    return (value >> 1) ^ (0u - (value & 1));
}

static inline unsigned strl_pack_length(uint32_t value)
{
    return value ? 32 - (unsigned)__builtin_clz(value) : 0;
}

static inline unsigned strl__pack_expected(const strl_pack_model *model)
{
    return (model->length + 128u) >> 8;
}

static inline void strl__pack_learn(strl_pack_model *model, unsigned length)
{
    model->length = (uint16_t)(model->length + ((int)(length << 8) - (int)model->length) / 8);
}

static inline void strl__pack_bits(strl_packer *packer, unsigned count, uint32_t bits) /* at most 32 */
{
    packer->pending |= (uint64_t)bits << packer->count;
    packer->count += count;
    if (packer->count >= 32) {
        strl_writer_u32(packer->out, (uint32_t)packer->pending);
        packer->pending >>= 32;
        packer->count -= 32;
    }
}

/* The distance of the length from the expected one comes first, in unary: above, below, above, ... */
static inline void strl_pack(strl_packer *packer, strl_pack_model *model, uint32_t value)
{
    unsigned length = strl_pack_length(value);
    unsigned distance = strl_pack_zigzag(length - strl__pack_expected(model)), rest = length > 1 ? length - 1 : 0;
    uint32_t low = value & (uint32_t)((UINT64_C(1) << rest) - 1);
    if (distance + 1 + rest <= 32) /* nearly always */
        strl__pack_bits(packer, distance + 1 + rest, (uint32_t)((uint64_t)low << (distance + 1)) | 1u << distance);
    else {
        for (; distance >= 31; distance -= 31)
            strl__pack_bits(packer, 31, 0);
        strl__pack_bits(packer, distance + 1, 1u << distance);
        strl__pack_bits(packer, rest, low);
    }
    strl__pack_learn(model, length);
}

/* Writes the bits that are pending, filled up to a byte. */
static inline void strl_pack_finish(strl_packer *packer)
{
    strl_writer_le(packer->out, (packer->count + 7) / 8, packer->pending);
    packer->pending = packer->count = 0;
}

static inline strl_unpacker strl_unpacker_make(const void *data, size_t size)
{
    return (strl_unpacker){.data = data, .end = (uint64_t)size * 8};
}

/* The next 32 bits at least, zeros behind the end. */
static inline uint64_t strl__unpack_peek(const strl_unpacker *unpacker)
{
    const uint8_t *from = unpacker->data + (unpacker->at >> 3);
    uint64_t left = (unpacker->end >> 3) - (unpacker->at >> 3);
    return (left >= 8 ? strl__load_le(from, 8) : strl__load_le(from, (unsigned)left)) >> (unpacker->at & 7);
}

static inline uint32_t strl__unpack_bits(strl_unpacker *unpacker, unsigned count)
{
    if (count > unpacker->end - unpacker->at) {
        unpacker->failed = true;
        return 0;
    }
    uint32_t bits = (uint32_t)(strl__unpack_peek(unpacker) & (((uint64_t)1 << count) - 1));
    unpacker->at += count;
    return bits;
}

/* The distance of a length from the expected one; 64 or more in damaged data only. */
static inline unsigned strl__unpack_distance(strl_unpacker *unpacker)
{
    unsigned distance = 0;
    for (bool more = true; more && distance <= 64 && !unpacker->failed;) {
        uint32_t bits = (uint32_t)strl__unpack_peek(unpacker);
        unsigned zeros = bits ? (unsigned)__builtin_ctz(bits) : 31;
        more = bits == 0;
        strl__unpack_bits(unpacker, more ? zeros : zeros + 1);
        distance += zeros;
    }
    return distance;
}

static inline uint32_t strl_unpack(strl_unpacker *unpacker, strl_pack_model *model)
{
    uint64_t bits = unpacker->end - unpacker->at >= 64 ? strl__unpack_peek(unpacker) : 0; /* 57 of them at least */
    unsigned zeros = (uint32_t)bits ? (unsigned)__builtin_ctz((uint32_t)bits) : 32;
    unsigned length = strl__pack_expected(model) + strl_unpack_zigzag(zeros), rest = length > 1 ? length - 1 : 0;
    if (zeros < 24 && length <= 32) { /* nearly always: both parts are in these bits */
        uint32_t low = (uint32_t)(bits >> (zeros + 1) & ((UINT64_C(1) << rest) - 1));
        unpacker->at += zeros + 1 + rest;
        strl__pack_learn(model, length);
        return length > 1 ? 1u << rest | low : length;
    }
    length = strl__pack_expected(model) + strl_unpack_zigzag(strl__unpack_distance(unpacker));
    if (unpacker->failed || length > 32) {
        unpacker->failed = true;
        return 0;
    }
    uint32_t value = length > 1 ? 1u << (length - 1) | strl__unpack_bits(unpacker, length - 1) : length;
    strl__pack_learn(model, length);
    return value;
}

#define STRL_PACK_LENGTHS 33u /* of 32-bit numbers */

/* Lattice positions, as steps from one to the next. The steps are of one length mostly, or short and
 * long in turn: the lengths of the last two say what to expect of x, x what to expect of y, and both
 * of z. */
typedef struct strl_pack_points {
    strl_pack_model x[STRL_PACK_LENGTHS][STRL_PACK_LENGTHS], y[STRL_PACK_LENGTHS], z[STRL_PACK_LENGTHS];
    uint32_t last[3];
    unsigned length, length_before;
} strl_pack_points;

void strl_pack_points_init(strl_pack_points *points);
void strl_pack_point(strl_packer *packer, strl_pack_points *points, const uint32_t position[3]);
void strl_unpack_point(strl_unpacker *unpacker, strl_pack_points *points, uint32_t position[3]);

#endif
