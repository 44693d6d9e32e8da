/* Reading untrusted bytes: explicit little-endian reads with sticky failure. A failed cursor returns zeros and stays
 * failed, so a parser checks once, before it uses what it read. Never overlay a struct on bytes from outside. */
#ifndef STRL_BASE_CURSOR_H
#define STRL_BASE_CURSOR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

typedef struct strl_cursor {
    const uint8_t *data; /* borrowed */
    size_t size;         /* bytes in data */
    size_t at;           /* index of the next byte */
    bool failed;         /* a read went past the end */
} strl_cursor;

static inline strl_cursor strl_cursor_make(const void *data, size_t size)
{
    return (strl_cursor){(const uint8_t *)data, size, 0, false};
}

static inline size_t strl_cursor_left(const strl_cursor *cursor)
{
    return cursor->failed ? 0 : cursor->size - cursor->at;
}

/* Borrows the next `bytes` bytes; NULL (and sticky failure) where fewer are left. */
static inline const uint8_t *strl_cursor_take(strl_cursor *cursor, size_t bytes)
{
    if (cursor->failed || bytes > cursor->size - cursor->at) {
        cursor->failed = true;
        return NULL;
    }
    const uint8_t *start = cursor->data + cursor->at;
    cursor->at += bytes;
    return start;
}

static inline uint64_t strl__load_le(const uint8_t *bytes, unsigned count)
{
    uint64_t value = 0;
    for (unsigned i = 0; i < count; i++)
        value |= (uint64_t)bytes[i] << (8 * i);
    return value;
}

static inline void strl__store_le(uint8_t *bytes, unsigned count, uint64_t value)
{
    for (unsigned i = 0; i < count; i++)
        bytes[i] = (uint8_t)(value >> (8 * i));
}

static inline uint64_t strl__cursor_le(strl_cursor *cursor, unsigned count)
{
    const uint8_t *bytes = strl_cursor_take(cursor, count);
    return bytes ? strl__load_le(bytes, count) : 0;
}

static inline uint8_t strl_cursor_u8(strl_cursor *cursor)
{
    return (uint8_t)strl__cursor_le(cursor, 1);
}
static inline uint16_t strl_cursor_u16(strl_cursor *cursor)
{
    return (uint16_t)strl__cursor_le(cursor, 2);
}
static inline uint32_t strl_cursor_u32(strl_cursor *cursor)
{
    return (uint32_t)strl__cursor_le(cursor, 4);
}
static inline uint64_t strl_cursor_u64(strl_cursor *cursor)
{
    return strl__cursor_le(cursor, 8);
}
static inline int64_t strl_cursor_i64(strl_cursor *cursor)
{
    return (int64_t)strl__cursor_le(cursor, 8);
}

static inline float strl_cursor_f32(strl_cursor *cursor)
{
    uint32_t bits = strl_cursor_u32(cursor);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static inline double strl_cursor_f64(strl_cursor *cursor)
{
    uint64_t bits = strl_cursor_u64(cursor);
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* Writing little-endian bytes into a growing buffer with sticky failure (no memory). Zero-initialise; release data with
 * strl__free. */
typedef struct strl_writer {
    uint8_t *data; /* owned */
    size_t size;
    size_t capacity;
    bool failed;
} strl_writer;

void strl_writer_bytes(strl_writer *writer, const void *data, size_t size);

/* The low bytes of a number, at most 8. */
static inline void strl_writer_le(strl_writer *writer, unsigned count, uint64_t value)
{
    uint8_t bytes[8];
    strl__store_le(bytes, 8, value);
    if (writer->capacity - writer->size < 8 || writer->failed) {
        strl_writer_bytes(writer, bytes, count);
        return;
    }
    memcpy(writer->data + writer->size, bytes, 8); /* what is too much is written over */
    writer->size += count;
}

static inline void strl_writer_u8(strl_writer *writer, uint8_t value)
{
    strl_writer_le(writer, 1, value);
}
static inline void strl_writer_u16(strl_writer *writer, uint16_t value)
{
    strl_writer_le(writer, 2, value);
}
static inline void strl_writer_u32(strl_writer *writer, uint32_t value)
{
    strl_writer_le(writer, 4, value);
}
static inline void strl_writer_u64(strl_writer *writer, uint64_t value)
{
    strl_writer_le(writer, 8, value);
}
static inline void strl_writer_i64(strl_writer *writer, int64_t value)
{
    strl_writer_le(writer, 8, (uint64_t)value);
}
void strl_writer_f32(strl_writer *writer, float value);
void strl_writer_f64(strl_writer *writer, double value);

#endif
