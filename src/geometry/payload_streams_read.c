/* Bytes to number streams. Both sections are copied with zeros behind them, so that the inner loop loads words without
 * a check for each: it checks once a group of four values, before the next group can pass the zeros. */
#include "geometry/payload_streams.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "base/fail.h"

enum {
    GROUP = STRL__RANS_STATES,
    PADDING_BYTES = 32
}; /* a group reads at most 8 bytes of words and 16 of bits, loads 8 */

struct reader {
    const uint8_t *words; /* the next word's bytes, with padding behind words_end */
    const uint8_t *words_end;
    const uint8_t *bits; /* padded */
    uint64_t bit_at, bit_end;
    uint32_t state[STRL__RANS_STATES];
};

/* symbol | frequency << 8 | slot - start << 20; filled in runs of SLOT_RUN, which may pass the end. */
enum { SLOT_RUN = 8 };
typedef uint32_t slot_table[STRL__PROBABILITY_ONE + SLOT_RUN];

static inline uint64_t load_u64(const uint8_t *bytes)
{
    uint64_t value;
    memcpy(&value, bytes, sizeof value);
#if __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
    value = __builtin_bswap64(value);
#endif
    return value;
}

/* Up to 32 bits. Past the end it returns zeros and lets bit_at run on, for the caller to see. */
static inline uint32_t take_bits(struct reader *reader, unsigned count)
{
    if (reader->bit_at > reader->bit_end)
        return 0;
    uint64_t word = load_u64(reader->bits + (reader->bit_at >> 3)) >> (reader->bit_at & 7);
    reader->bit_at += count;
    return (uint32_t)(word & (((uint64_t)1 << count) - 1));
}

/* Returns the number of symbols, or 0 where the table is bad. */
static unsigned read_table(struct reader *reader, slot_table slots)
{
    unsigned alphabet = take_bits(reader, 7);
    if (alphabet > STRL__SYMBOLS)
        return 0;
    uint32_t start = 0;
    for (unsigned s = 0; s < alphabet; s++) {
        uint32_t frequency = STRL__PROBABILITY_ONE - start; /* the last symbol's: what is left */
        if (s + 1 < alphabet) {
            unsigned length = take_bits(reader, 4);
            if (length > STRL__PROBABILITY_BITS + 1)
                return 0;
            frequency = length ? 1u << (length - 1) | take_bits(reader, length - 1) : 0;
            if (frequency > STRL__PROBABILITY_ONE - start)
                return 0;
        } else if (!frequency) {
            return 0;
        }
        uint32_t *run = slots + start, slot = s | frequency << 8;
        for (uint32_t *end = run + frequency; run < end; run += SLOT_RUN, slot += SLOT_RUN << 20)
            for (size_t k = 0; k < SLOT_RUN; k++)
                run[k] = slot + (uint32_t)(k << 20);
        start += frequency;
    }
    return alphabet;
}

static const struct {
    uint32_t base, bits;
} symbols[STRL__SYMBOLS] = {
#define DIRECT(v)                                                                                                      \
    {                                                                                                                  \
        v, 0                                                                                                           \
    }
#define OCTAVE(raw)                                                                                                    \
    {2u << (raw), raw},                                                                                                \
    {                                                                                                                  \
        3u << (raw), raw                                                                                               \
    }
    DIRECT(0),  DIRECT(1),  DIRECT(2),  DIRECT(3),  DIRECT(4),  DIRECT(5),  DIRECT(6),  DIRECT(7),  DIRECT(8),
    DIRECT(9),  DIRECT(10), DIRECT(11), DIRECT(12), DIRECT(13), DIRECT(14), DIRECT(15), OCTAVE(3),  OCTAVE(4),
    OCTAVE(5),  OCTAVE(6),  OCTAVE(7),  OCTAVE(8),  OCTAVE(9),  OCTAVE(10), OCTAVE(11), OCTAVE(12), OCTAVE(13),
    OCTAVE(14), OCTAVE(15), OCTAVE(16), OCTAVE(17), OCTAVE(18), OCTAVE(19), OCTAVE(20), OCTAVE(21), OCTAVE(22),
    OCTAVE(23), OCTAVE(24), OCTAVE(25), OCTAVE(26), OCTAVE(27), OCTAVE(28), OCTAVE(29), OCTAVE(30),
#undef DIRECT
#undef OCTAVE
};

/* One step of a state: returns the symbol. */
static inline uint32_t next_symbol(const uint32_t *slots, const uint8_t **words, uint32_t *state)
{
    uint32_t x = *state, slot = slots[x & (STRL__PROBABILITY_ONE - 1)];
    uint16_t word;
    memcpy(&word, *words, sizeof word);
#if __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
    word = __builtin_bswap16(word);
#endif
    x = (slot >> 8 & 0xfff) * (x >> STRL__PROBABILITY_BITS) + (slot >> 20);
    uint32_t low = x < STRL__RANS_LOW; /* no branch: it cannot be foreseen */
    *words += 2 * low;
    *state = x << (16 * low) | (word & (0u - low));
    return slot & 0xff;
}

static inline uint32_t finish_value(uint32_t symbol, const uint8_t *bits, uint64_t *bit_at)
{
    uint32_t raw_bits = symbols[symbol].bits;
    uint32_t raw = (uint32_t)(load_u64(bits + (*bit_at >> 3)) >> (*bit_at & 7));
    *bit_at += raw_bits;
    return symbols[symbol].base + (raw & ((1u << raw_bits) - 1));
}

/* The symbols of `count` values, in groups of one from each state: the states are independent, so their latencies
 * overlap. */
static bool read_symbols(struct reader *reader, const uint32_t *slots, uint32_t *values, uint32_t count)
{
    const uint8_t *words = reader->words, *end = reader->words_end;
    uint32_t a = reader->state[0], b = reader->state[1], c = reader->state[2], d = reader->state[3], i = 0;
    for (; count - i >= GROUP && words <= end; i += GROUP) {
        values[i] = next_symbol(slots, &words, &a);
        values[i + 1] = next_symbol(slots, &words, &b);
        values[i + 2] = next_symbol(slots, &words, &c);
        values[i + 3] = next_symbol(slots, &words, &d);
    }
    if (words > end)
        return false;
    if (i < count)
        values[i++] = next_symbol(slots, &words, &a);
    if (i < count)
        values[i++] = next_symbol(slots, &words, &b);
    if (i < count)
        values[i++] = next_symbol(slots, &words, &c);
    reader->words = words;
    memcpy(reader->state, (uint32_t[GROUP]){a, b, c, d}, sizeof reader->state);
    return words <= end;
}

/* Puts the raw low bits to symbols that have some. */
static bool read_raw_bits(struct reader *reader, uint32_t *values, uint32_t count)
{
    const uint8_t *bits = reader->bits;
    uint64_t bit_at = reader->bit_at, end = reader->bit_end;
    uint32_t i = 0;
    for (; count - i >= GROUP && bit_at <= end; i += GROUP)
        for (unsigned k = 0; k < GROUP; k++)
            values[i + k] = finish_value(values[i + k], bits, &bit_at);
    for (; i < count && bit_at <= end; i++)
        values[i] = finish_value(values[i], bits, &bit_at);
    reader->bit_at = bit_at;
    return bit_at <= end;
}

static bool read_coded(struct reader *reader, slot_table slots, uint32_t *values, uint32_t count)
{
    unsigned alphabet = read_table(reader, slots);
    return alphabet && read_symbols(reader, slots, values, count) &&
           (alphabet <= 16 || read_raw_bits(reader, values, count));
}

static strl_status read_stream(struct reader *reader, uint64_t *item_limit, slot_table slots, strl_arena *scratch,
                               struct strl__stream_in *stream, strl_error *err)
{
    unsigned length = take_bits(reader, 5);
    uint32_t count = length ? 1u << (length - 1) | take_bits(reader, length - 1) : 0;
    if (count > *item_limit)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "node payload has a stream of %" PRIu32 " values where its size allows %" PRIu64, count,
                          *item_limit);
    *item_limit -= count;
    unsigned mode = count ? take_bits(reader, 6) : 0;
    uint32_t *values = strl_arena_alloc(scratch, count, sizeof *values);
    if (!values)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to decode a node payload");
    bool sound = mode <= STRL__MODE_TABLE;
    if (sound && mode == STRL__MODE_TABLE)
        sound = read_coded(reader, slots, values, count);
    else if (mode == 0)
        memset(values, 0, (size_t)count * sizeof *values);
    else
        for (uint32_t i = 0; sound && i < count; i++)
            values[i] = take_bits(reader, mode);
    if (!sound || reader->bit_at > reader->bit_end)
        return strl__fail(err, STRL_ERR_FORMAT, "node payload has a stream with a bad table, or ends inside it");
    *stream = (struct strl__stream_in){values, count, 0};
    return STRL_OK;
}

/* All was used, and nothing more: the coder came back to where its encoder began, and the bits are padded with zeros as
 * far as needed and no further. */
static bool ended_well(const struct reader *reader, size_t payload_bytes, uint64_t items)
{
    for (unsigned i = 0; i < STRL__RANS_STATES; i++)
        if (reader->state[i] != STRL__RANS_LOW)
            return false;
    uint64_t used = (reader->bit_at + 7) / 8, there = reader->bit_end / 8;
    if (reader->words != reader->words_end ||
        (used < there && (uint64_t)(payload_bytes - 1) * STRL__MAX_ITEMS_A_BYTE >= items))
        return false;
    if (reader->bit_at % 8 && reader->bits[reader->bit_at / 8] >> (reader->bit_at % 8))
        return false;
    for (uint64_t i = used; i < there; i++)
        if (reader->bits[i])
            return false;
    return true;
}

static uint8_t *padded_copy(strl_cursor *cursor, size_t bytes, strl_arena *scratch)
{
    const uint8_t *from = strl_cursor_take(cursor, bytes);
    uint8_t *copy = from ? strl_arena_alloc(scratch, bytes + PADDING_BYTES, 1) : NULL;
    if (copy) {
        memcpy(copy, from, bytes);
        memset(copy + bytes, 0, PADDING_BYTES);
    }
    return copy;
}

strl_status strl__streams_read(strl_cursor *cursor, unsigned stream_count, size_t payload_bytes, uint64_t item_count,
                               strl_arena *scratch, struct strl__streams_in *streams, strl_error *err)
{
    *streams = (struct strl__streams_in){0};
    uint64_t item_limit = (uint64_t)payload_bytes * STRL__MAX_ITEMS_A_BYTE;
    struct reader reader = {0};
    uint32_t word_count = strl_cursor_u32(cursor);
    for (unsigned i = 0; i < STRL__RANS_STATES; i++)
        reader.state[i] = strl_cursor_u32(cursor);
    if (cursor->failed || word_count > strl_cursor_left(cursor) / 2 || item_count > item_limit)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "node payload announces %" PRIu32 " words and %" PRIu64
                          " items, more than its %zu bytes can hold",
                          word_count, item_count, payload_bytes);
    size_t bit_bytes = strl_cursor_left(cursor) - (size_t)word_count * 2;
    reader.words = padded_copy(cursor, (size_t)word_count * 2, scratch);
    reader.bits = padded_copy(cursor, bit_bytes, scratch);
    uint32_t *slots = strl_arena_alloc(scratch, 1, sizeof(slot_table));
    if (!reader.words || !reader.bits || !slots)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to decode a node payload");
    reader.words_end = reader.words + (size_t)word_count * 2;
    reader.bit_end = (uint64_t)bit_bytes * 8;
    uint64_t values_left = item_limit - item_count;
    for (unsigned id = 0; id < stream_count; id++) {
        strl_status status = read_stream(&reader, &values_left, slots, scratch, &streams->stream[id], err);
        if (status)
            return status;
    }
    if (!ended_well(&reader, payload_bytes, item_limit - values_left))
        return strl__fail(err, STRL_ERR_FORMAT, "node payload does not end where its numbers do");
    return STRL_OK;
}

bool strl__streams_done(const struct strl__streams_in *streams)
{
    for (unsigned id = 0; id < STRL__STREAM_COUNT; id++)
        if (streams->stream[id].at != streams->stream[id].count)
            return false;
    return !streams->failed;
}

/* ceil(2^(23 + i/16)): with 24 bits the scale is exact in floats, whatever the machine's mathematical library. */
static const uint32_t sixteenth[16] = {8388608,  8760004,  9147842,  9552852,  9975793,  10417459, 10878679, 11360319,
                                       11863284, 12388516, 12937003, 13509773, 14107901, 14732511, 15384775, 16065918};

float strl__error_of_code(uint32_t code)
{
    uint32_t bits = code ? (((code - 1) / 16 + 127 - 64) << 23) + (sixteenth[(code - 1) % 16] - (1u << 23)) : 0;
    float error;
    memcpy(&error, &bits, sizeof error);
    return error;
}

uint32_t strl__code_of_error(float error)
{
    if (!(error > 0))
        return 0;
    int exponent;
    frexpf(error, &exponent); /* error in [2^(exponent-1), 2^exponent) */
    int octave = exponent - 1 + 64;
    if (octave < 0)
        return 1;
    uint32_t code = 1 + 16 * (uint32_t)octave;
    while (strl__error_of_code(code) < error)
        code++;
    return code;
}
