/* docs/format-payload.md, "Streams". */
#include <inttypes.h>
#include <string.h>

#include "base/fail.h"
#include "verify/payload.h"

#define PROBABILITY 2048u
#define MOST_SYMBOLS 72u
#define RENORM 65536u
#define ITEMS_A_BYTE 256u
#define PADDING 8u

typedef struct rans_coder {
    const uint8_t *words;
    uint32_t word_count, word_at;
    const uint8_t *bits; /* with PADDING bytes behind */
    uint64_t bit_at, bit_end;
    uint32_t state[4];
    bool failed;
    uint8_t symbol[PROBABILITY];
    uint16_t start[MOST_SYMBOLS], frequency[MOST_SYMBOLS];
} rans_coder;

static uint32_t read_bits(rans_coder *self, unsigned count)
{
    if (self->bit_at + count > self->bit_end) {
        self->failed = true;
        return 0;
    }
    uint64_t word = strl__load_le(self->bits + self->bit_at / 8, 8) >> (self->bit_at % 8);
    self->bit_at += count;
    return (uint32_t)(word & (((uint64_t)1 << count) - 1));
}

static bool read_table(rans_coder *self)
{
    uint32_t symbols = read_bits(self, 7), start = 0;
    if (symbols < 1 || symbols > MOST_SYMBOLS)
        return false;
    for (uint32_t s = 0; s < symbols; s++) {
        uint32_t frequency = PROBABILITY - start;
        if (s + 1 < symbols) {
            uint32_t length = read_bits(self, 4);
            uint32_t coded = length == 0   ? 0
                             : length > 12 ? PROBABILITY + 1
                                           : (1u << (length - 1)) + read_bits(self, length - 1);
            if (coded > frequency)
                return false;
            frequency = coded;
        }
        if (s + 1 == symbols && frequency == 0)
            return false;
        self->start[s] = (uint16_t)start;
        self->frequency[s] = (uint16_t)frequency;
        memset(self->symbol + start, (int)s, frequency);
        start += frequency;
    }
    return !self->failed;
}

static inline uint32_t next_symbol(rans_coder *self, uint32_t number)
{
    uint32_t *x = &self->state[number % 4], slot = *x % PROBABILITY, symbol = self->symbol[slot];
    *x = self->frequency[symbol] * (*x / PROBABILITY) + slot - self->start[symbol];
    if (*x < RENORM) {
        if (self->word_at == self->word_count) {
            self->failed = true;
            return 0;
        }
        *x = *x * RENORM + (uint32_t)strl__load_le(self->words + 2 * (size_t)self->word_at++, 2);
    }
    return symbol;
}

static void read_coded(rans_coder *self, uint32_t *values, uint32_t count)
{
    for (uint32_t i = 0; i < count && !self->failed; i++) {
        uint32_t symbol = next_symbol(self, i);
        if (symbol < 16) {
            values[i] = symbol;
            continue;
        }
        unsigned raw = (symbol - 16) / 2 + 3;
        values[i] = ((2 + symbol % 2) << raw) + read_bits(self, raw);
    }
}

static strl_status read_stream(strl__v_payload *self, rans_coder *coder, unsigned number, uint64_t most)
{
    unsigned length = read_bits(coder, 5);
    uint32_t count = length ? (1u << (length - 1)) + read_bits(coder, length - 1) : 0;
    if (count > most)
        return strl__fail(self->err, STRL_ERR_FORMAT,
                          "stream %u of the payload has %" PRIu32 " values, its size allows %" PRIu64, number, count,
                          most);
    unsigned mode = count ? read_bits(coder, 6) : 0;
    uint32_t *values = strl_arena_alloc_zero(self->arena, count, sizeof *values);
    if (!values)
        return strl__fail(self->err, STRL_ERR_MEMORY, "no memory for %" PRIu32 " values", count);
    bool good = mode <= 33 && (mode < 33 || read_table(coder));
    if (good && mode == 33)
        read_coded(coder, values, count);
    for (uint32_t i = 0; good && mode > 0 && mode < 33 && i < count && !coder->failed; i++)
        values[i] = read_bits(coder, mode);
    self->stream[number] = (strl__v_stream){values, count, 0};
    return good && !coder->failed
               ? STRL_OK
               : strl__fail(self->err, STRL_ERR_FORMAT,
                            "stream %u of the payload has a bad mode or table, or ends early", number);
}

/* All is used: words, coders, bits; zero bytes behind only where the limit on items asked for each of them. */
static bool ended(const rans_coder *coder, size_t payload_bytes, uint64_t items)
{
    bool good = coder->word_at == coder->word_count;
    for (unsigned i = 0; i < 4; i++)
        good = good && coder->state[i] == RENORM;
    uint64_t used = (coder->bit_at + 7) / 8, there = coder->bit_end / 8;
    for (uint64_t bit = coder->bit_at; good && bit < used * 8; bit++)
        good = (coder->bits[bit / 8] >> (bit % 8) & 1) == 0;
    for (uint64_t at = used; good && at < there; at++)
        good = coder->bits[at] == 0;
    return good && (there == used || items > ITEMS_A_BYTE * (uint64_t)(payload_bytes - 1));
}

static strl_status read_streams(strl__v_payload *self, rans_coder *coder, size_t payload_bytes, unsigned stream_count)
{
    uint64_t items = (uint64_t)self->vertices + self->triangles + self->entries,
             most = ITEMS_A_BYTE * (uint64_t)payload_bytes;
    if (items > most)
        return strl__fail(self->err, STRL_ERR_FORMAT, "%" PRIu64 " items cannot stand in a payload of %zu bytes", items,
                          payload_bytes);
    for (unsigned number = 0; number < stream_count; number++) {
        strl_status status = read_stream(self, coder, number, most - items);
        if (status != STRL_OK)
            return status;
        items += self->stream[number].count;
    }
    return ended(coder, payload_bytes, items)
               ? STRL_OK
               : strl__fail(self->err, STRL_ERR_FORMAT, "the payload does not end where its streams do");
}

strl_status strl__v_payload_streams(strl__v_payload *self, strl_cursor *cursor, size_t payload_bytes,
                                    unsigned stream_count)
{
    if (self->words > strl_cursor_left(cursor) / 2)
        return strl__fail(self->err, STRL_ERR_FORMAT, "%" PRIu32 " words do not stand in the payload's last %zu bytes",
                          self->words, strl_cursor_left(cursor));
    rans_coder *coder = strl_arena_alloc_zero(self->arena, 1, sizeof *coder);
    const uint8_t *words = strl_cursor_take(cursor, 2 * (size_t)self->words);
    size_t bit_bytes = strl_cursor_left(cursor);
    uint8_t *bits = strl_arena_alloc_zero(self->arena, bit_bytes + PADDING, 1);
    if (!coder || !bits)
        return strl__fail(self->err, STRL_ERR_MEMORY, "no memory for a payload of %zu bytes", payload_bytes);
    memcpy(bits, strl_cursor_take(cursor, bit_bytes), bit_bytes);
    coder->words = words;
    coder->word_count = self->words;
    coder->bits = bits;
    coder->bit_end = 8 * (uint64_t)bit_bytes;
    memcpy(coder->state, self->coder, sizeof coder->state);
    return read_streams(self, coder, payload_bytes, stream_count);
}
