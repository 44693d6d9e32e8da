/* Packed triangle records and their order along the curve. */
#include <inttypes.h>
#include <string.h>

#include "base/fail.h"
#include "build/ingest/internal.h"

/* Positions 36 bytes, normals 8, colours 12, texture coordinates 12, the palette last: the sorted soup goes without it
 * where there is but one. */
size_t strl__soup_bucket_bytes(const strl_ingest *ingest)
{
    return 40u + (ingest->has_normals ? 8u : 0) + (ingest->has_colours ? 12u : 0) + (ingest->has_texcoords ? 12u : 0);
}

size_t strl_soup_bytes(const strl_ingest *ingest)
{
    return strl__soup_bucket_bytes(ingest) - (ingest->palette_count > 1 ? 0 : 4);
}

/* 21 bits a corner: two coordinates of 10, or the highest bit where the normal is missing. */
static uint64_t pack_normals(const strl_soup_triangle *triangle)
{
    uint64_t word = 0;
    for (int c = 0; c < 3; c++) {
        const uint16_t *n = triangle->corner[c].normal;
        word |= (n[0] == STRL_NORMAL_MISSING ? (uint64_t)1 << 20 : (uint64_t)n[0] << 10 | n[1]) << (21 * c);
    }
    return word;
}

static void unpack_normals(uint64_t word, strl_soup_triangle *triangle)
{
    for (int c = 0; c < 3; c++, word >>= 21) {
        bool missing = word >> 20 & 1;
        triangle->corner[c].normal[0] = missing ? STRL_NORMAL_MISSING : (uint16_t)(word >> 10 & 1023);
        triangle->corner[c].normal[1] = missing ? STRL_NORMAL_MISSING : (uint16_t)(word & 1023);
    }
}

void strl__soup_pack(const strl_ingest *ingest, const strl_soup_triangle *triangle, uint8_t *bytes)
{
    for (int c = 0; c < 3; c++, bytes += 12)
        memcpy(bytes, triangle->corner[c].position, 12);
    if (ingest->has_normals) {
        uint64_t word = pack_normals(triangle);
        memcpy(bytes, &word, 8);
        bytes += 8;
    }
    for (int c = 0; c < 3 && ingest->has_colours; c++, bytes += 4)
        memcpy(bytes, &triangle->corner[c].colour, 4);
    for (int c = 0; c < 3 && ingest->has_texcoords; c++, bytes += 4)
        memcpy(bytes, &triangle->corner[c].texcoord, 4);
    memcpy(bytes, &triangle->palette, 4);
}

void strl__soup_set_palette(const strl_ingest *ingest, uint32_t palette, uint8_t *bytes)
{
    memcpy(bytes + strl__soup_bucket_bytes(ingest) - sizeof palette, &palette, sizeof palette);
}

/* Leaves the palette out. */
static const uint8_t *unpack_corners(const strl_ingest *ingest, const uint8_t *bytes, strl_soup_triangle *triangle)
{
    uint64_t word = UINT64_MAX; /* all missing */
    for (int c = 0; c < 3; c++, bytes += 12)
        memcpy(triangle->corner[c].position, bytes, 12);
    if (ingest->has_normals) {
        memcpy(&word, bytes, 8);
        bytes += 8;
    }
    unpack_normals(word, triangle);
    for (int c = 0; c < 3; c++) {
        triangle->corner[c].colour = 0xffffffffu;
        if (ingest->has_colours) {
            memcpy(&triangle->corner[c].colour, bytes, 4);
            bytes += 4;
        }
    }
    for (int c = 0; c < 3; c++) {
        triangle->corner[c].texcoord = 0;
        if (ingest->has_texcoords) {
            memcpy(&triangle->corner[c].texcoord, bytes, 4);
            bytes += 4;
        }
    }
    return bytes;
}

void strl__soup_unpack(const strl_ingest *ingest, const uint8_t *bytes, strl_soup_triangle *triangle)
{
    bytes = unpack_corners(ingest, bytes, triangle);
    memcpy(&triangle->palette, bytes, 4);
}

strl_status strl_ingest_read(const strl_ingest *ingest, uint64_t first, uint32_t count, void *scratch,
                             strl_soup_triangle *triangles, strl_error *err)
{
    size_t bytes = strl_soup_bytes(ingest);
    strl_status status = strl_spill_read(ingest->soup, first * bytes, scratch, count * bytes, err);
    for (uint32_t i = 0; i < count && !status; i++) {
        const uint8_t *palette = unpack_corners(ingest, (const uint8_t *)scratch + i * bytes, &triangles[i]);
        triangles[i].palette = 0;
        if (ingest->palette_count > 1)
            memcpy(&triangles[i].palette, palette, 4);
        if (triangles[i].palette >= ingest->palette_count)
            status =
                strl__fail(err, STRL_ERR_INTERNAL, "triangle %" PRIu64 " has the part and material %" PRIu32 " of %zu",
                           first + i, triangles[i].palette, ingest->palette_count);
        else if (strl__soup_has_collapsed(&triangles[i]))
            status = strl__fail(err, STRL_ERR_INTERNAL, "triangle %" PRIu64 " has two corners at one place", first + i);
    }
    return status;
}

void strl_ingest_drop_cell(const strl_ingest *ingest, uint32_t cell)
{
    size_t bytes = strl_soup_bytes(ingest);
    strl_spill_drop(ingest->soup, ingest->cells[cell].first * bytes, ingest->cells[cell].count * bytes);
}

static bool same_place(const uint32_t a[3], const uint32_t b[3])
{
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

bool strl__soup_has_collapsed(const strl_soup_triangle *triangle)
{
    const strl_soup_corner *corner = triangle->corner;
    return same_place(corner[0].position, corner[1].position) || same_place(corner[1].position, corner[2].position) ||
           same_place(corner[2].position, corner[0].position);
}

bool strl__soup_is_sound(const strl_ingest *ingest, const strl_soup_triangle *triangle)
{
    uint32_t bits = 0;
    for (int c = 0; c < 3; c++)
        for (int k = 0; k < 3; k++)
            bits |= triangle->corner[c].position[k];
    return bits >> 31 == 0 && triangle->palette < ingest->palette_count && !strl__soup_has_collapsed(triangle);
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
                                triangle->corner[2].position[k]) /
                               3);
    return strl__curve_key(ingest, centre);
}
