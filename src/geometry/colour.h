/* Stored colours are sRGB-encoded RGBA8, R in the lowest byte; products are made in linear light. */
#ifndef STRL_GEOMETRY_COLOUR_H
#define STRL_GEOMETRY_COLOUR_H

#include <math.h>
#include <stdint.h>

static inline float strl_srgb_decode(unsigned code)
{
    float value = (float)code / 255;
    return value <= 0.04045f ? value / 12.92f : powf((value + 0.055f) / 1.055f, 2.4f);
}

static inline unsigned strl_srgb_encode(float linear)
{
    float value = linear <= 0.0031308f ? linear * 12.92f : 1.055f * powf(linear, 1 / 2.4f) - 0.055f;
    return (unsigned)lrintf(value * 255);
}

/* Vertex colour times material colour. */
static inline uint32_t strl_rgba_multiply(uint32_t a, uint32_t b)
{
    if (a == UINT32_MAX || b == UINT32_MAX)
        return a & b;
    uint32_t product = ((a >> 24) * (b >> 24) + 127) / 255 << 24;
    for (unsigned shift = 0; shift < 24; shift += 8) {
        unsigned one = a >> shift & 255, other = b >> shift & 255;
        unsigned code = one == 255     ? other
                        : other == 255 ? one
                                       : strl_srgb_encode(strl_srgb_decode(one) * strl_srgb_decode(other));
        product |= code << shift;
    }
    return product;
}

#endif
