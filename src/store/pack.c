#include "store/pack.h"

#include <string.h>

static unsigned larger(unsigned a, unsigned b)
{
    return a > b ? a : b;
}

void strl_pack_points_init(strl_pack_points *points)
{
    *points = (strl_pack_points){0};
    for (unsigned length = 0; length < STRL_PACK_LENGTHS; length++) {
        for (unsigned before = 0; before < STRL_PACK_LENGTHS; before++)
            points->x[length][before].length = (uint16_t)(length << 8);
        points->y[length].length = points->z[length].length = (uint16_t)(length << 8);
    }
}

static void note_step(strl_pack_points *points, unsigned x, unsigned y, unsigned z)
{
    points->length_before = points->length;
    points->length = larger(x, larger(y, z));
}

void strl_pack_point(strl_packer *packer, strl_pack_points *points, const uint32_t position[3])
{
    uint32_t step[3];
    unsigned length[3];
    for (int k = 0; k < 3; k++) {
        step[k] = strl_pack_zigzag(position[k] - points->last[k]);
        length[k] = strl_pack_length(step[k]);
    }
    strl_pack(packer, &points->x[points->length][points->length_before], step[0]);
    strl_pack(packer, &points->y[length[0]], step[1]);
    strl_pack(packer, &points->z[larger(length[0], length[1])], step[2]);
    memcpy(points->last, position, sizeof points->last);
    note_step(points, length[0], length[1], length[2]);
}

void strl_unpack_point(strl_unpacker *unpacker, strl_pack_points *points, uint32_t position[3])
{
    uint32_t x = strl_unpack(unpacker, &points->x[points->length][points->length_before]);
    uint32_t y = strl_unpack(unpacker, &points->y[strl_pack_length(x)]);
    uint32_t z = strl_unpack(unpacker, &points->z[larger(strl_pack_length(x), strl_pack_length(y))]);
    points->last[0] += strl_unpack_zigzag(x);
    points->last[1] += strl_unpack_zigzag(y);
    points->last[2] += strl_unpack_zigzag(z);
    memcpy(position, points->last, sizeof points->last);
    note_step(points, strl_pack_length(x), strl_pack_length(y), strl_pack_length(z));
}
