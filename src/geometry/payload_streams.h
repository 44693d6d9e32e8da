/* The numbers of a node payload: streams of unsigned 32-bit values, each coded as a symbol (static rANS) and raw low
 * bits. docs/format-payload.md, "Streams" and "Numbers", is normative. Internal to the payload codec. */
#ifndef STRL_GEOMETRY_PAYLOAD_STREAMS_H
#define STRL_GEOMETRY_PAYLOAD_STREAMS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/cursor.h"
#include "base/memory.h"
#include "geometry/progressive.h"
#include "stroll/error.h"

/* In the order in which they lie in a payload. */
enum {
    STRL__STREAM_OPERATION = 0, /* one a gate's context */
    STRL__STREAM_SEED = 6,
    STRL__STREAM_REFERENCE,
    STRL__STREAM_TWIN,
    STRL__STREAM_BASE_POSITION,
    STRL__STREAM_STEP_POSITION = STRL__STREAM_BASE_POSITION + 3,
    STRL__STREAM_PARENT = STRL__STREAM_STEP_POSITION + 3,
    STRL__STREAM_WEDGE_PARENT,
    STRL__STREAM_KIND,
    STRL__STREAM_START,
    STRL__STREAM_ARC,
    STRL__STREAM_GENERAL,
    STRL__STREAM_GEOMETRIC_ERROR,
    STRL__STREAM_APPEARANCE_ERROR,
    STRL__STREAM_NORMAL,
    STRL__STREAM_PALETTE_INDEX = STRL__STREAM_NORMAL + 2,
    STRL__STREAM_COLOUR,
    STRL__STREAM_PALETTE = STRL__STREAM_COLOUR + 4,
    STRL__STREAM_SELECT = STRL__STREAM_PALETTE + 3,       /* one a context */
    STRL__STREAM_COPY_NORMAL = STRL__STREAM_SELECT + 4,   /* STRL__SELECT_CONTEXTS */
    STRL__STREAM_TEXCOORD = STRL__STREAM_COPY_NORMAL + 2, /* only in payloads with texture coordinates */
    STRL__STREAM_COUNT = STRL__STREAM_TEXCOORD + 2
};

/* How many streams a payload has. */
static inline unsigned strl__stream_count(bool has_texcoords)
{
    return has_texcoords ? STRL__STREAM_COUNT : STRL__STREAM_TEXCOORD;
}

#define STRL__OPERATION_CONTEXTS 6u
#define STRL__SELECT_CONTEXTS 4u
#define STRL__SYMBOLS 72u
#define STRL__PROBABILITY_BITS 11
#define STRL__PROBABILITY_ONE (1u << STRL__PROBABILITY_BITS)
#define STRL__RANS_STATES 4u
#define STRL__RANS_LOW (1u << 16)
/* A stream's mode: up to 32 = so many raw bits a value; this = symbols with a table. */
#define STRL__MODE_TABLE 33u
/* Values, vertices and triangles together that one byte of payload may stand for: what bounds the memory of a decoder.
 */
#define STRL__MAX_ITEMS_A_BYTE 256u

/* A value's symbol: itself below 16, then two a power of two, with all but the two leading bits raw. */
static inline unsigned strl__symbol_of(uint32_t value)
{
    if (value < 16)
        return value;
    unsigned bits = 32 - (unsigned)__builtin_clz(value);
    return 16 + 2 * (bits - 5) + ((value >> (bits - 2)) & 1);
}

static inline unsigned strl__symbol_raw_bits(unsigned symbol)
{
    return symbol < 16 ? 0 : (symbol - 16) / 2 + 3;
}

static inline uint32_t strl__symbol_base(unsigned symbol)
{
    return symbol < 16 ? symbol : (2u | (symbol & 1)) << strl__symbol_raw_bits(symbol);
}

static inline uint32_t strl__zigzag(uint32_t difference)
{
    return (difference << 1) ^ (0u - (difference >> 31));
}
static inline uint32_t strl__unzigzag(uint32_t value)
{
    return (value >> 1) ^ (0u - (value & 1));
}

/* ---- writing ---- */
struct strl__stream_out {
    uint32_t *values; /* owned */
    size_t count, capacity;
};

struct strl__streams_out {
    struct strl__stream_out stream[STRL__STREAM_COUNT];
    bool failed; /* no memory */
};

/* Slow path of strl__push. */
void strl__push_growing(struct strl__streams_out *streams, unsigned id, uint32_t value);

static inline void strl__push(struct strl__streams_out *streams, unsigned id, uint32_t value)
{
    struct strl__stream_out *stream = &streams->stream[id];
    if (stream->count < stream->capacity)
        stream->values[stream->count++] = value;
    else
        strl__push_growing(streams, id, value);
}

/* Appends the coded streams to writer: the last part of a payload that starts at byte `start` of writer, padded as the
 * format asks; item_count = vertices + triangles + palette entries. */
strl_status strl__streams_write(const struct strl__streams_out *streams, unsigned stream_count, size_t start,
                                uint64_t item_count, strl_writer *writer, strl_error *err);
/* What each stream costs, its count and its table included. */
void strl__streams_bits(const struct strl__streams_out *streams, double bits[STRL__STREAM_COUNT]);
void strl__streams_deinit(struct strl__streams_out *streams);

/* ---- reading ---- */
struct strl__stream_in {
    const uint32_t *values;
    uint32_t count, at;
};

struct strl__streams_in {
    struct strl__stream_in stream[STRL__STREAM_COUNT];
    bool failed; /* more was pulled than a stream holds */
};

/* Decodes all streams from what is left of cursor, into scratch. payload_bytes: the whole payload's size. */
strl_status strl__streams_read(strl_cursor *cursor, unsigned stream_count, size_t payload_bytes, uint64_t item_count,
                               strl_arena *scratch, struct strl__streams_in *streams, strl_error *err);

static inline uint32_t strl__pull(struct strl__streams_in *streams, unsigned id)
{
    struct strl__stream_in *stream = &streams->stream[id];
    if (stream->at < stream->count)
        return stream->values[stream->at++];
    streams->failed = true;
    return 0;
}

/* The next `count` values of a stream, all of them or NULL. */
static inline const uint32_t *strl__pull_all(struct strl__streams_in *streams, unsigned id, uint32_t count)
{
    struct strl__stream_in *stream = &streams->stream[id];
    if (count > stream->count - stream->at) {
        streams->failed = true;
        return NULL;
    }
    stream->at += count;
    return stream->values + (stream->at - count);
}

/* True when every value was pulled and none was missing. */
bool strl__streams_done(const struct strl__streams_in *streams);

/* The scale of errors: 0 is 0; then sixteen steps an octave from 2^-64 to 2^64. */
#define STRL__ERROR_CODE_MAX 2049u
float strl__error_of_code(uint32_t code);
/* The smallest code whose error is not less. error: 0 to STRL_PM_MAX_ERROR. */
uint32_t strl__code_of_error(float error);

#endif
