/* Records of fixed size that hold the attributes of a corner as fields of any scalar type and byte
 * order. */
#ifndef STRL_READERS_RECORD_H
#define STRL_READERS_RECORD_H

#include <endian.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

typedef enum strl__scalar {
    STRL__I8,
    STRL__U8,
    STRL__I16,
    STRL__U16,
    STRL__I32,
    STRL__U32,
    STRL__F32,
    STRL__F64
} strl__scalar;

static inline unsigned strl__scalar_bytes(strl__scalar type)
{
    static const uint8_t bytes[] = {1, 1, 2, 2, 4, 4, 4, 8};
    return bytes[type];
}

static inline uint16_t strl__load_16(const void *bytes, bool big_endian)
{
    uint16_t value;
    memcpy(&value, bytes, sizeof value);
    return big_endian ? be16toh(value) : le16toh(value);
}

static inline uint32_t strl__load_32(const void *bytes, bool big_endian)
{
    uint32_t value;
    memcpy(&value, bytes, sizeof value);
    return big_endian ? be32toh(value) : le32toh(value);
}

static inline float strl__load_f32(const void *bytes, bool big_endian)
{
    uint32_t bits = strl__load_32(bytes, big_endian);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static inline double strl__load_f64(const void *bytes, bool big_endian)
{
    uint64_t bits;
    memcpy(&bits, bytes, sizeof bits);
    bits = big_endian ? be64toh(bits) : le64toh(bits);
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* Every scalar type is exact as a double. */
static inline double strl__scalar_load(strl__scalar type, const void *bytes, bool big_endian)
{
    switch (type) {
    case STRL__I8:
        return *(const int8_t *)bytes;
    case STRL__U8:
        return *(const uint8_t *)bytes;
    case STRL__I16:
        return (int16_t)strl__load_16(bytes, big_endian);
    case STRL__U16:
        return strl__load_16(bytes, big_endian);
    case STRL__I32:
        return (int32_t)strl__load_32(bytes, big_endian);
    case STRL__U32:
        return strl__load_32(bytes, big_endian);
    case STRL__F32:
        return (double)strl__load_f32(bytes, big_endian);
    case STRL__F64:
        break;
    }
    return strl__load_f64(bytes, big_endian);
}

/* A colour channel as 0..255: reals are 0..1, 16-bit integers 0..65535, other integers 0..255. Not
 * a number: 255. */
uint8_t strl__colour_channel(strl__scalar type, double value);

static inline uint32_t strl__pack_colour(uint8_t red, uint8_t green, uint8_t blue, uint8_t alpha)
{
    return red | (uint32_t)green << 8 | (uint32_t)blue << 16 | (uint32_t)alpha << 24;
}

/* A corner with all its attributes looked up. */
typedef struct strl__corner {
    double position[3];
    float normal[3];   /* zero where absent or not finite */
    uint32_t colour;   /* sRGB-encoded RGBA8; 0xffffffff where absent */
    float texcoord[2]; /* where there are any */
} strl__corner;

typedef struct strl__field {
    uint32_t offset; /* bytes from the start of the record */
    strl__scalar type;
} strl__field;

/* Which fields a record has. Attributes it lacks are left as they are in the corner. */
typedef struct strl__layout {
    uint32_t stride; /* bytes of a record, > 0 */
    bool big_endian;
    bool has_position, has_normal, has_colour, has_alpha, has_texcoord;
    strl__field position[3];
    strl__field normal[3];
    strl__field colour[4];
    strl__field texcoord[2];
} strl__layout;

/* Thread-safe. */
void strl__layout_decode(const strl__layout *layout, const uint8_t *record, strl__corner *corner);

#endif
