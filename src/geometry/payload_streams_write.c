/* Number streams to bytes: histogram, table, raw bits, and static rANS (Duda 2013) with four interleaved states. A
 * decoder runs forward, so the symbols are coded backward, last stream first. */
#include "geometry/payload_streams.h"

#include <math.h>
#include <string.h>

#include "base/fail.h"

void strl__push_growing(struct strl__streams_out *streams, unsigned id, uint32_t value)
{
    struct strl__stream_out *stream = &streams->stream[id];
    if (!strl__grow(&stream->values, &stream->capacity, stream->count + 1, sizeof *stream->values)) {
        streams->failed = true;
        return;
    }
    stream->values[stream->count++] = value;
}

void strl__streams_deinit(struct strl__streams_out *streams)
{
    for (unsigned id = 0; id < STRL__STREAM_COUNT; id++)
        strl__free(streams->stream[id].values);
    *streams = (struct strl__streams_out){0};
}

struct table {
    unsigned mode;     /* raw bits, or STRL__MODE_TABLE */
    unsigned alphabet; /* symbols 0..alphabet-1 */
    uint16_t frequency[STRL__SYMBOLS];
    uint16_t start[STRL__SYMBOLS];
};

struct bit_writer {
    strl_writer out;
    uint64_t pending;
    unsigned count; /* bits pending, below 32 between calls */
};

static void put_bits(struct bit_writer *bits, unsigned count, uint32_t value)
{
    bits->pending |= (uint64_t)value << bits->count;
    bits->count += count;
    if (bits->count >= 32) {
        strl_writer_u32(&bits->out, (uint32_t)bits->pending);
        bits->pending >>= 32;
        bits->count -= 32;
    }
}

static unsigned bit_length(uint32_t value)
{
    return value ? 32 - (unsigned)__builtin_clz(value) : 0;
}

/* Scales counts to frequencies that sum to STRL__PROBABILITY_ONE, each present symbol at least 1. */
static void normalise(const uint32_t *count, uint32_t total, struct table *table)
{
    int32_t left = (int32_t)STRL__PROBABILITY_ONE;
    unsigned largest = 0;
    for (unsigned s = 0; s < table->alphabet; s++) {
        uint32_t scaled = (uint32_t)(((uint64_t)count[s] * STRL__PROBABILITY_ONE + total / 2) / total);
        table->frequency[s] = (uint16_t)(count[s] && !scaled ? 1 : scaled);
        left -= table->frequency[s];
        if (count[s] > count[largest])
            largest = s;
    }
    if (left > 0)
        table->frequency[largest] = (uint16_t)(table->frequency[largest] + left);
    while (left < 0) { /* at most 72 too many: taken one by one from whatever is largest now */
        for (unsigned s = 0; s < table->alphabet; s++)
            if (table->frequency[s] > table->frequency[largest])
                largest = s;
        table->frequency[largest]--;
        left++;
    }
    for (unsigned s = 0, start = 0; s < table->alphabet; start += table->frequency[s++])
        table->start[s] = (uint16_t)start;
}

/* The bits that the stream costs with its table, table included; the choice between the modes needs no more precision.
 */
static double table_bits(const struct table *table, const uint32_t *count)
{
    double bits = 7;
    for (unsigned s = 0; s < table->alphabet; s++) {
        bits += 4 + (table->frequency[s] > 1 ? bit_length(table->frequency[s]) - 1 : 0);
        if (count[s])
            bits += count[s] * (STRL__PROBABILITY_BITS - log2(table->frequency[s]) + strl__symbol_raw_bits(s));
    }
    return bits;
}

static void choose_table(const struct strl__stream_out *stream, uint32_t count[STRL__SYMBOLS], struct table *table)
{
    uint32_t all = 0;
    memset(count, 0, STRL__SYMBOLS * sizeof *count);
    for (size_t i = 0; i < stream->count; i++) {
        count[strl__symbol_of(stream->values[i])]++;
        all |= stream->values[i];
    }
    *table = (struct table){.mode = bit_length(all)};
    for (unsigned s = 0; s < STRL__SYMBOLS; s++)
        if (count[s])
            table->alphabet = s + 1;
    if (!table->mode)
        return;
    normalise(count, (uint32_t)stream->count, table);
    if (table_bits(table, count) < (double)table->mode * (double)stream->count)
        table->mode = STRL__MODE_TABLE;
}

void strl__streams_bits(const struct strl__streams_out *streams, double bits[STRL__STREAM_COUNT])
{
    for (unsigned id = 0; id < STRL__STREAM_COUNT; id++) {
        const struct strl__stream_out *stream = &streams->stream[id];
        struct table table;
        uint32_t count[STRL__SYMBOLS];
        choose_table(stream, count, &table);
        bits[id] = 5;
        if (stream->count)
            bits[id] += bit_length((uint32_t)stream->count) + 5.;
        bits[id] +=
            table.mode == STRL__MODE_TABLE ? table_bits(&table, count) : (double)table.mode * (double)stream->count;
    }
}

static void write_raw(const struct strl__stream_out *stream, const struct table *table, struct bit_writer *bits)
{
    unsigned length = bit_length((uint32_t)stream->count);
    put_bits(bits, 5, length);
    if (!length)
        return;
    put_bits(bits, length - 1, (uint32_t)stream->count & ((1u << (length - 1)) - 1));
    put_bits(bits, 6, table->mode);
    if (table->mode < STRL__MODE_TABLE) {
        for (size_t i = 0; i < stream->count; i++)
            put_bits(bits, table->mode, stream->values[i]);
        return;
    }
    put_bits(bits, 7, table->alphabet);
    for (unsigned s = 0; s + 1 < table->alphabet; s++) {
        unsigned frequency_length = bit_length(table->frequency[s]);
        put_bits(bits, 4, frequency_length);
        if (frequency_length > 1)
            put_bits(bits, frequency_length - 1, table->frequency[s] & ((1u << (frequency_length - 1)) - 1));
    }
    for (size_t i = 0; i < stream->count; i++) {
        unsigned raw = strl__symbol_raw_bits(strl__symbol_of(stream->values[i]));
        put_bits(bits, raw, stream->values[i] & ((1u << raw) - 1));
    }
}

struct rans_writer {
    uint8_t *words;         /* filled from the end, two bytes a word */
    size_t first, capacity; /* bytes */
    uint32_t state[STRL__RANS_STATES];
};

static void code_stream(const struct strl__stream_out *stream, const struct table *table, struct rans_writer *rans)
{
    for (size_t i = stream->count; i-- > 0;) {
        unsigned symbol = strl__symbol_of(stream->values[i]);
        uint32_t frequency = table->frequency[symbol], x = rans->state[i % STRL__RANS_STATES];
        if (x >= (uint64_t)frequency << (32 - STRL__PROBABILITY_BITS)) {
            rans->first -= 2;
            strl__store_le(rans->words + rans->first, 2, x & 0xffff);
            x >>= 16;
        }
        rans->state[i % STRL__RANS_STATES] =
            ((x / frequency) << STRL__PROBABILITY_BITS) + x % frequency + table->start[symbol];
    }
}

static void write_padding(strl_writer *writer, size_t start, uint64_t items)
{
    while (!writer->failed && (uint64_t)(writer->size - start) * STRL__MAX_ITEMS_A_BYTE < items)
        strl_writer_u8(writer, 0);
}

static void write_sections(const struct rans_writer *rans, struct bit_writer *bits, strl_writer *writer)
{
    strl_writer_le(&bits->out, (bits->count + 7) / 8, bits->pending);
    strl_writer_u32(writer, (uint32_t)((rans->capacity - rans->first) / 2));
    for (unsigned i = 0; i < STRL__RANS_STATES; i++)
        strl_writer_u32(writer, rans->state[i]);
    strl_writer_bytes(writer, rans->words + rans->first, rans->capacity - rans->first);
    strl_writer_bytes(writer, bits->out.data, bits->out.size);
}

strl_status strl__streams_write(const struct strl__streams_out *streams, unsigned stream_count, size_t start,
                                uint64_t item_count, strl_writer *writer, strl_error *err)
{
    struct table table[STRL__STREAM_COUNT];
    uint32_t count[STRL__SYMBOLS];
    struct bit_writer bits = {0};
    struct rans_writer rans = {.state = {STRL__RANS_LOW, STRL__RANS_LOW, STRL__RANS_LOW, STRL__RANS_LOW}};
    for (unsigned id = 0; id < stream_count; id++) {
        choose_table(&streams->stream[id], count, &table[id]);
        write_raw(&streams->stream[id], &table[id], &bits);
        item_count += streams->stream[id].count;
        rans.capacity += table[id].mode == STRL__MODE_TABLE ? 2 * streams->stream[id].count : 0;
    }
    rans.first = rans.capacity; /* a symbol shifts out at most one word */
    rans.words = strl__alloc(rans.capacity, 1);
    bool failed = streams->failed || !rans.words;
    if (!failed) {
        for (unsigned id = stream_count; id-- > 0;)
            if (table[id].mode == STRL__MODE_TABLE)
                code_stream(&streams->stream[id], &table[id], &rans);
        write_sections(&rans, &bits, writer);
        write_padding(writer, start, item_count);
        failed = bits.out.failed || writer->failed;
    }
    strl__free(rans.words);
    strl__free(bits.out.data);
    return failed ? strl__fail(err, STRL_ERR_MEMORY, "no memory to encode a node payload") : STRL_OK;
}
