/* Unit normals as points of an octahedron unfolded into a square (Meyer et al. 2010), 10 bits a coordinate: 0 to 511
 * are -1 to 0, and 512 to 1023 are 0 to 1. With both zeros exact, so are the axes, which most of what is built has as
 * normals: a hundredth of a degree off, a cube placed as a plate shows. */
#ifndef STRL_GEOMETRY_OCTAHEDRAL_H
#define STRL_GEOMETRY_OCTAHEDRAL_H

#include <math.h>
#include <stdint.h>

#define STRL_OCT_MAX 1023
#define STRL_OCT_HALF 511 /* steps from 0 to 1 */

/* at: -1 to 1. */
static inline uint16_t strl_oct_code(float at)
{
    long steps = lrintf(fabsf(at) * STRL_OCT_HALF);
    return (uint16_t)(at < 0 ? STRL_OCT_HALF - steps : STRL_OCT_HALF + 1 + steps);
}
static inline float strl_oct_value(uint16_t code)
{
    return (float)(code - STRL_OCT_HALF - (code > STRL_OCT_HALF)) / STRL_OCT_HALF;
}

/* normal need not have unit length; a zero vector becomes +z. */
static inline void strl_oct_encode(const float normal[3], uint16_t out[2])
{
    float sum = fabsf(normal[0]) + fabsf(normal[1]) + fabsf(normal[2]);
    float x = sum > 0 ? normal[0] / sum : 0, y = sum > 0 ? normal[1] / sum : 0;
    if (normal[2] < 0) {
        float fold_x = (1 - fabsf(y)) * (x >= 0 ? 1.f : -1.f);
        float fold_y = (1 - fabsf(x)) * (y >= 0 ? 1.f : -1.f);
        x = fold_x, y = fold_y;
    }
    out[0] = strl_oct_code(x);
    out[1] = strl_oct_code(y);
}

/* A coordinate in 8 bits and back: each half on its own, so that zeros stay zeros. */
static inline uint32_t strl_oct_narrow(uint32_t coordinate)
{
    return (coordinate >> 9 << 7) + ((coordinate & 511) * 127 + 255) / 511;
}
static inline uint32_t strl_oct_widen(uint32_t narrow)
{
    return (narrow >> 7 << 9) + ((narrow & 127) * 511 + 63) / 127;
}
/* The nearest coordinate that a payload can hold in 8 bits. */
static inline uint16_t strl_oct_coarsen(uint16_t coordinate)
{
    return (uint16_t)strl_oct_widen(strl_oct_narrow(coordinate));
}

static inline void strl_oct_decode(const uint16_t in[2], float normal[3])
{
    float x = strl_oct_value(in[0]), y = strl_oct_value(in[1]);
    float z = 1 - fabsf(x) - fabsf(y);
    float fold = z < 0 ? -z : 0;
    x += x >= 0 ? -fold : fold;
    y += y >= 0 ? -fold : fold;
    float scale = 1 / sqrtf(x * x + y * y + z * z);
    normal[0] = x * scale, normal[1] = y * scale, normal[2] = z * scale;
}

#endif
