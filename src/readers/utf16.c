#include "readers/utf16.h"

#include "base/fail.h"
#include "base/memory.h"

#define UNITS ((size_t)16384)
#define BYTES_A_UNIT 3u /* of UTF-8, at most; a pair of units has four */
#define REPLACEMENT 0xfffdu

typedef struct decoder {
    strl_file *from, *to;
    uint64_t bytes, at, written;
    bool big_endian;
    uint32_t high; /* a first surrogate that waits for its second; 0 = none */
    uint8_t units[2 * UNITS];
    uint8_t text[BYTES_A_UNIT * (UNITS + 2)];
    size_t length; /* of the text */
} decoder;

static void put(decoder *d, uint32_t code)
{
    uint8_t *out = d->text + d->length;
    if (code < 0x80) {
        out[0] = (uint8_t)code;
        d->length += 1;
    } else if (code < 0x800) {
        out[0] = (uint8_t)(0xc0 | code >> 6);
        out[1] = (uint8_t)(0x80 | (code & 0x3f));
        d->length += 2;
    } else if (code < 0x10000) {
        out[0] = (uint8_t)(0xe0 | code >> 12);
        out[1] = (uint8_t)(0x80 | (code >> 6 & 0x3f));
        out[2] = (uint8_t)(0x80 | (code & 0x3f));
        d->length += 3;
    } else {
        out[0] = (uint8_t)(0xf0 | code >> 18);
        out[1] = (uint8_t)(0x80 | (code >> 12 & 0x3f));
        out[2] = (uint8_t)(0x80 | (code >> 6 & 0x3f));
        out[3] = (uint8_t)(0x80 | (code & 0x3f));
        d->length += 4;
    }
}

static void take_unit(decoder *d, uint32_t unit)
{
    const bool is_high = unit >= 0xd800 && unit < 0xdc00, is_low = unit >= 0xdc00 && unit < 0xe000;
    if (d->high && is_low) {
        put(d, 0x10000 + ((d->high - 0xd800) << 10) + (unit - 0xdc00));
        d->high = 0;
        return;
    }
    if (d->high)
        put(d, REPLACEMENT);
    d->high = is_high ? unit : 0;
    if (!is_high)
        put(d, is_low ? REPLACEMENT : unit);
}

static strl_status decode_some(decoder *d, strl_error *err)
{
    uint64_t left = d->bytes - d->at;
    size_t size = left < sizeof d->units ? (size_t)left : sizeof d->units;
    strl_status status = strl_file_read(d->from, d->at, d->units, size, err);
    d->length = 0;
    for (size_t i = 0; i + 1 < size && !status; i += 2)
        take_unit(d, d->big_endian ? (uint32_t)d->units[i] << 8 | d->units[i + 1]
                                   : (uint32_t)d->units[i + 1] << 8 | d->units[i]);
    d->at += size;
    if (d->at == d->bytes && (d->high || size % 2 != 0))
        put(d, REPLACEMENT);
    if (!status)
        status = strl_file_write(d->to, d->written, d->text, d->length, err);
    d->written += d->length;
    return status;
}

static strl_status decode(strl_reader *reader, bool big_endian, strl_file *to, strl_error *err)
{
    decoder *d = strl__alloc_zero(1, sizeof *d);
    if (!d)
        return strl__fail(err, STRL_ERR_MEMORY, "%s: no memory to decode UTF-16", reader->path);
    d->from = reader->file;
    d->to = to;
    d->bytes = reader->opened.bytes;
    d->at = 2;
    d->big_endian = big_endian;
    strl_status status = STRL_OK;
    while (!status && d->at < d->bytes)
        status = decode_some(d, err);
    strl__free(d);
    return status;
}

strl_status strl__utf16_decode(strl_reader *reader, strl_file **decoded, strl_error *err)
{
    strl__input *input = &reader->input;
    *decoded = NULL;
    strl__input_want(input, 2);
    if (input->end - input->at < 2)
        return STRL_OK;
    const uint8_t first = (uint8_t)input->at[0], second = (uint8_t)input->at[1];
    if (!(first == 0xff && second == 0xfe) && !(first == 0xfe && second == 0xff))
        return STRL_OK;
    if (!reader->scratch_dir)
        return strl__fail(err, STRL_ERR_ARGUMENT,
                          "%s: its text is in UTF-16, which needs a scratch folder to be decoded, and none was given",
                          reader->path);
    strl_file *file = NULL;
    strl_status status = strl_file_create_nameless(reader->scratch_dir, &file, err);
    if (!status)
        status = decode(reader, first == 0xfe, file, err);
    if (status) {
        strl_file_close(file, NULL);
        return status;
    }
    input->file = *decoded = file;
    strl__input_seek(input, 0, 1);
    return STRL_OK;
}
