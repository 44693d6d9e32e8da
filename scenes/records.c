/* See records.h. */
#include "scenes/records.h"

strl_status strl__spilled_read(void *context, uint64_t first, size_t count, uint8_t *records, strl_error *err)
{
    const strl__spilled *spilled = context;
    strl_status status = strl_file_read(spilled->file, first * spilled->bytes, records, count * spilled->bytes, err);
    strl_file_punch(spilled->file, first * spilled->bytes, count * spilled->bytes);
    return status;
}

strl_status strl__records_write(const strl__records *records, strl__stream *out, strl_output_report report,
                                void *context, strl_error *err)
{
    strl_status status = STRL_OK;
    for (uint64_t first = 0; status == STRL_OK && first < records->count;) {
        uint64_t left = records->count - first;
        size_t count = left < STRL__RECORD_BATCH ? (size_t)left : STRL__RECORD_BATCH;
        status = strl__stream_reserve(out, count * records->bytes, err);
        if (status == STRL_OK)
            status = records->read(records->context, first, count, out->buffer + out->used, err);
        if (status != STRL_OK)
            break;
        out->used += count * records->bytes;
        first += count;
        if (report)
            status = report(context, first * records->bytes, records->count * records->bytes, err);
    }
    return status;
}
