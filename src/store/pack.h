/* Numbers packed for scratch, not for exchange: how many bits a number has is told against what such
 * numbers had so far, then come the bits. Numbers of one kind share a model; both sides must use the
 * same models in the same order. */
#ifndef STRL_STORE_PACK_H
#define STRL_STORE_PACK_H

#include <string.h>

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

/* A number that is mostly the same as another, which both sides know. */
typedef struct strl_pack_same {
    strl_pack_model differs, step;
} strl_pack_same;

static inline void strl_pack_beside(strl_packer *packer, strl_pack_same *model, uint32_t value, uint32_t guide)
{
    strl_pack(packer, &model->differs, value != guide);
    if (value != guide)
        strl_pack(packer, &model->step, strl_pack_zigzag(value - guide));
}

static inline uint32_t strl_unpack_beside(strl_unpacker *unpacker, strl_pack_same *model, uint32_t guide)
{
    return strl_unpack(unpacker, &model->differs) ? guide + strl_unpack_zigzag(strl_unpack(unpacker, &model->step))
                                                  : guide;
}

/* A colour, four bytes, that is mostly the same as another. */
typedef struct strl_pack_rgba {
    strl_pack_model differs, channel[4];
} strl_pack_rgba;

static inline void strl_pack_colour(strl_packer *packer, strl_pack_rgba *model, uint32_t colour, uint32_t guide)
{
    strl_pack(packer, &model->differs, colour != guide);
    for (unsigned c = 0; c < 32 && colour != guide; c += 8)
        strl_pack(packer, &model->channel[c / 8], strl_pack_zigzag((colour >> c & 255) - (guide >> c & 255)));
}

static inline uint32_t strl_unpack_colour(strl_unpacker *unpacker, strl_pack_rgba *model, uint32_t guide)
{
    uint32_t colour = 0;
    if (!strl_unpack(unpacker, &model->differs))
        return guide;
    for (unsigned c = 0; c < 32; c += 8)
        colour |= (((guide >> c) + strl_unpack_zigzag(strl_unpack(unpacker, &model->channel[c / 8]))) & 255) << c;
    return colour;
}

/* A corner of a triangle: most often the first vertex that no corner named yet, *next, or one named lately. */
static inline void strl_pack_corner(strl_packer *packer, strl_pack_model *model, uint32_t corner, uint32_t *next)
{
    strl_pack(packer, model, strl_pack_zigzag(*next - corner));
    *next = corner >= *next ? corner + 1 : *next;
}

static inline uint32_t strl_unpack_corner(strl_unpacker *unpacker, strl_pack_model *model, uint32_t *next)
{
    uint32_t corner = *next - strl_unpack_zigzag(strl_unpack(unpacker, model));
    *next = corner >= *next ? corner + 1 : *next;
    return corner;
}

#define STRL_PACK_LENGTHS 33u /* of 32-bit numbers */

/* One component of normals, as steps; the length of one says what to expect of the next. */
typedef struct strl_pack_steps {
    strl_pack_model model[STRL_PACK_LENGTHS];
    unsigned length; /* of the last one */
} strl_pack_steps;

static inline void strl_pack_step(strl_packer *packer, strl_pack_steps *steps, uint32_t value, uint32_t guide)
{
    uint32_t step = strl_pack_zigzag(value - guide);
    strl_pack(packer, &steps->model[steps->length], step);
    steps->length = strl_pack_length(step);
}

static inline uint32_t strl_unpack_step(strl_unpacker *unpacker, strl_pack_steps *steps, uint32_t guide)
{
    uint32_t step = strl_unpack(unpacker, &steps->model[steps->length]);
    steps->length = strl_pack_length(step);
    return guide + strl_unpack_zigzag(step);
}

/* Floats that mostly repeat the one before. */
static inline void strl_pack_floats(strl_packer *packer, strl_pack_same *model, const float *values, size_t count)
{
    uint32_t last = 0, bits;
    for (size_t i = 0; i < count; i++, last = bits) {
        memcpy(&bits, &values[i], sizeof bits);
        strl_pack_beside(packer, model, bits, last);
    }
}

static inline void strl_unpack_floats(strl_unpacker *unpacker, strl_pack_same *model, float *values, size_t count)
{
    uint32_t bits = 0;
    for (size_t i = 0; i < count; i++) {
        bits = strl_unpack_beside(unpacker, model, bits);
        memcpy(&values[i], &bits, sizeof bits);
    }
}

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
