#include "base/cursor.h"

#include "base/memory.h"

void strl_writer_bytes(strl_writer *writer, const void *data, size_t size)
{
    if (writer->failed || size > SIZE_MAX - writer->size ||
        !strl__grow(&writer->data, &writer->capacity, writer->size + size, 1)) {
        writer->failed = true;
        return;
    }
    if (size)
        memcpy(writer->data + writer->size, data, size);
    writer->size += size;
}

void strl_writer_f32(strl_writer *writer, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    strl_writer_le(writer, 4, bits);
}

void strl_writer_f64(strl_writer *writer, double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    strl_writer_le(writer, 8, bits);
}
