/* Unit normals as points of an octahedron unfolded into a square (Meyer et al. 2010), 10 bits a coordinate. */
#ifndef STRL_GEOMETRY_OCTAHEDRAL_H
#define STRL_GEOMETRY_OCTAHEDRAL_H

#include <math.h>
#include <stdint.h>

#define STRL_OCT_MAX 1023

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
    out[0] = (uint16_t)lrintf((x * 0.5f + 0.5f) * STRL_OCT_MAX);
    out[1] = (uint16_t)lrintf((y * 0.5f + 0.5f) * STRL_OCT_MAX);
}

/* The nearest coordinate that a payload can hold in 8 bits. */
static inline uint16_t strl_oct_coarsen(uint16_t coordinate)
{
    uint32_t coarse = (coordinate * 255u + STRL_OCT_MAX / 2) / STRL_OCT_MAX;
    return (uint16_t)((coarse * STRL_OCT_MAX + 127) / 255);
}

static inline void strl_oct_decode(const uint16_t in[2], float normal[3])
{
    float x = (float)in[0] * (2.f / STRL_OCT_MAX) - 1, y = (float)in[1] * (2.f / STRL_OCT_MAX) - 1;
    float z = 1 - fabsf(x) - fabsf(y);
    float fold = z < 0 ? -z : 0;
    x += x >= 0 ? -fold : fold;
    y += y >= 0 ? -fold : fold;
    float scale = 1 / sqrtf(x * x + y * y + z * z);
    normal[0] = x * scale, normal[1] = y * scale, normal[2] = z * scale;
}

#endif
