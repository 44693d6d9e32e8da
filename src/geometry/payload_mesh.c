#include "geometry/payload_mesh.h"

bool strl__mesh_init(struct strl__mesh *mesh, uint32_t vertices, uint32_t triangles, int32_t (*position)[3],
                     strl_arena *scratch)
{
    *mesh = (struct strl__mesh){.position = position, .chunk_count = vertices, .free_chunk = STRL__NONE};
    /* Older chunks are always full. */
    size_t chunks = (size_t)vertices + (size_t)triangles * 3 / STRL__CHUNK_CORNERS + 1;
    uint8_t *lines = strl_arena_alloc(scratch, chunks + 1, sizeof *mesh->chunk);
    mesh->triangle = strl_arena_alloc_zero(scratch, (size_t)triangles + 1, sizeof *mesh->triangle);
    mesh->twin = strl_arena_alloc(scratch, vertices, sizeof *mesh->twin);
    if (!lines || !mesh->triangle || !mesh->twin)
        return false;
    mesh->chunk = (struct strl__chunk *)(void *)(lines + (0 - (uintptr_t)lines) % sizeof *mesh->chunk);
    for (uint32_t v = 0; v < vertices; v++) {
        mesh->chunk[v].corner[0] = 0;
        mesh->chunk[v].count = 0;
        mesh->chunk[v].older = STRL__NONE;
        mesh->twin[v] = (uint16_t)v;
    }
    return true;
}

void strl__mesh_age_chunk(struct strl__mesh *mesh, uint32_t vertex)
{
    uint32_t aged = mesh->free_chunk;
    if (aged == STRL__NONE)
        aged = mesh->chunk_count++;
    else
        mesh->free_chunk = mesh->chunk[aged].older;
    mesh->chunk[aged] = mesh->chunk[vertex];
    mesh->chunk[vertex].count = 0;
    mesh->chunk[vertex].older = aged;
}

void strl__mesh_clear(struct strl__mesh *mesh, uint32_t vertex)
{
    struct strl__chunk *chunk = &mesh->chunk[vertex];
    while (chunk->older != STRL__NONE) {
        uint32_t freed = chunk->older;
        chunk->older = mesh->chunk[freed].older;
        mesh->chunk[freed].older = mesh->free_chunk;
        mesh->free_chunk = freed;
    }
    chunk->count = 0;
}

bool strl__star_init(struct strl__star *star, uint32_t vertices, uint32_t triangles, strl_arena *scratch)
{
    size_t places = (size_t)triangles + STRL__STAR_SMALL;
    *star = (struct strl__star){.spare = vertices};
    star->corner = strl_arena_alloc(scratch, places, sizeof *star->corner);
    star->wing = strl_arena_alloc(scratch, places, sizeof *star->wing);
    star->moves = strl_arena_alloc_zero(scratch, places, sizeof *star->moves);
    star->begins = strl_arena_alloc_zero(scratch, (size_t)vertices + 1, sizeof *star->begins);
    return star->corner && star->wing && star->moves && star->begins;
}

uint64_t (*strl__normal_sums(const struct strl__mesh *mesh, strl_arena *scratch))[4]
{
    const int32_t(*position)[3] = (const int32_t(*)[3])mesh->position;
    uint64_t(*sum)[4] = strl_arena_alloc_zero(scratch, mesh->vertex_count, sizeof *sum);
    for (uint32_t t = 0; sum && t < mesh->triangle_count; t++) {
        uint16_t corner[3];
        strl__mesh_get_triangle(mesh, t, corner);
        const int32_t *p = position[corner[0]], *q = position[corner[1]], *r = position[corner[2]];
        uint64_t a[3], b[3], n[4] = {0};
        for (unsigned k = 0; k < 3; k++) {
            a[k] = (uint64_t)((int64_t)q[k] - p[k]);
            b[k] = (uint64_t)((int64_t)r[k] - p[k]);
        }
        n[0] = a[1] * b[2] - a[2] * b[1];
        n[1] = a[2] * b[0] - a[0] * b[2];
        n[2] = a[0] * b[1] - a[1] * b[0];
        for (unsigned c = 0; c < 3; c++)
            for (unsigned k = 0; k < 4; k++)
                sum[corner[c]][k] += n[k];
    }
    return sum;
}

/* strl_oct_encode in integers, after scaling the sum to 18 bits. */
void strl__normal_predict(const uint64_t sum[4], uint32_t most, uint32_t predicted[2])
{
    uint64_t magnitude[3], all = 1;
    for (unsigned k = 0; k < 3; k++) {
        magnitude[k] = sum[k] >> 63 ? 0 - sum[k] : sum[k];
        all |= magnitude[k];
    }
    int width = 64 - __builtin_clzll(all), shift = width > 18 ? width - 18 : 0;
    int32_t x = (int32_t)(magnitude[0] >> shift), y = (int32_t)(magnitude[1] >> shift),
            z = (int32_t)(magnitude[2] >> shift);
    int32_t length = x + y + z;
    if (length == 0) {
        predicted[0] = predicted[1] = (most + 1) / 2;
        return;
    }
    /* Signs are masks, all ones for negative: as branches they could not be foreseen. */
    int32_t lower = -(int32_t)(sum[2] >> 63), west = -(int32_t)(sum[0] >> 63), south = -(int32_t)(sum[1] >> 63);
    int32_t folded_x = length - y, folded_y = length - x; /* the lower half is folded outward */
    x ^= (x ^ folded_x) & lower;
    y ^= (y ^ folded_y) & lower;
    x = (x ^ west) - west;
    y = (y ^ south) - south;
    /* One division for both. The quotients are below 2^11 and a multiple of 1 / 2^22 away from the next integer, so
     * that with half a unit added to the dividend no rounding reaches it. */
    double inverse = 0.5 / length;
    predicted[0] = (uint32_t)(((uint32_t)(x + length) * most + (uint32_t)length + 0.5) * inverse);
    predicted[1] = (uint32_t)(((uint32_t)(y + length) * most + (uint32_t)length + 0.5) * inverse);
}
