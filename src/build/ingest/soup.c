/* Packed triangle records and their order along the curve. */
#include <string.h>

#include "base/cursor.h"
#include "build/ingest/internal.h"

size_t strl_soup_bytes(const strl_ingest *ingest)
{
    return 40u + (ingest->has_normals ? 12u : 0) + (ingest->has_colours ? 12u : 0);
}

void strl__soup_pack(const strl_ingest *ingest, const strl_soup_triangle *triangle, uint8_t *bytes)
{
    for (int c = 0; c < 3; c++)
        memcpy(bytes + 12 * c, triangle->corner[c].position, 12);
    memcpy(bytes + 36, &triangle->palette, 4);
    bytes += 40;
    for (int c = 0; c < 3 && ingest->has_normals; c++, bytes += 4)
        memcpy(bytes, triangle->corner[c].normal, 4);
    for (int c = 0; c < 3 && ingest->has_colours; c++, bytes += 4)
        memcpy(bytes, &triangle->corner[c].colour, 4);
}

void strl__soup_unpack(const strl_ingest *ingest, const uint8_t *bytes, strl_soup_triangle *triangle)
{
    for (int c = 0; c < 3; c++)
        memcpy(triangle->corner[c].position, bytes + 12 * c, 12);
    memcpy(&triangle->palette, bytes + 36, 4);
    bytes += 40;
    for (int c = 0; c < 3; c++) {
        triangle->corner[c].normal[0] = triangle->corner[c].normal[1] = STRL_NORMAL_MISSING;
        triangle->corner[c].colour = 0xffffffffu;
    }
    for (int c = 0; c < 3 && ingest->has_normals; c++, bytes += 4)
        memcpy(triangle->corner[c].normal, bytes, 4);
    for (int c = 0; c < 3 && ingest->has_colours; c++, bytes += 4)
        memcpy(&triangle->corner[c].colour, bytes, 4);
}

strl_status strl_ingest_read(const strl_ingest *ingest, uint64_t first, uint32_t count, void *scratch,
                             strl_soup_triangle *triangles, strl_error *err)
{
    size_t bytes = strl_soup_bytes(ingest);
    strl_status status = strl_spill_read(ingest->soup, first * bytes, scratch, count * bytes, err);
    for (uint32_t i = 0; i < count && !status; i++)
        strl__soup_unpack(ingest, (const uint8_t *)scratch + i * bytes, &triangles[i]);
    return status;
}

/* Spreads the low 21 bits so that two zeros stand between any two. */
static uint64_t spread(uint64_t v)
{
    v &= 0x1fffff;
    v = (v | v << 32) & 0x1f00000000ffffu;
    v = (v | v << 16) & 0x1f0000ff0000ffu;
    v = (v | v << 8) & 0x100f00f00f00f00fu;
    v = (v | v << 4) & 0x10c30c30c30c30c3u;
    return (v | v << 2) & 0x1249249249249249u;
}

uint64_t strl__curve_key(const strl_ingest *ingest, const uint32_t position[3])
{
    unsigned shift = ingest->curve_shift;
    return spread(position[0] >> shift) | spread(position[1] >> shift) << 1 | spread(position[2] >> shift) << 2;
}

uint64_t strl__curve_key_of_triangle(const strl_ingest *ingest, const strl_soup_triangle *triangle)
{
    uint32_t centre[3];
    for (int k = 0; k < 3; k++)
        centre[k] = (uint32_t)(((uint64_t)triangle->corner[0].position[k] + triangle->corner[1].position[k] +
                                triangle->corner[2].position[k]) / 3);
    return strl__curve_key(ingest, centre);
}
