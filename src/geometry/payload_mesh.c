#include "geometry/payload_mesh.h"

bool strl__mesh_init(struct strl__mesh *mesh, uint32_t vertices, uint32_t triangles, int32_t (*position)[3],
                     strl_arena *scratch)
{
    *mesh = (struct strl__mesh){.position = position, .heads = triangles * 4};
    mesh->corner = strl_arena_alloc(scratch, (size_t)triangles * 4 + vertices, sizeof *mesh->corner);
    mesh->twin = strl_arena_alloc(scratch, vertices, sizeof *mesh->twin);
    if (!mesh->corner || !mesh->twin)
        return false;
    for (uint32_t v = 0; v < vertices; v++) {
        uint32_t head = mesh->heads + v;
        mesh->corner[head] = (struct strl__corner){.next = head, .previous = head};
        mesh->twin[v] = (uint16_t)v;
    }
    return true;
}

bool strl__star_init(struct strl__star *star, uint32_t vertices, uint32_t triangles, strl_arena *scratch)
{
    *star = (struct strl__star){0};
    star->corner = strl_arena_alloc(scratch, triangles, sizeof *star->corner);
    star->wing = strl_arena_alloc(scratch, triangles, sizeof *star->wing);
    star->moves = strl_arena_alloc_zero(scratch, triangles, sizeof *star->moves);
    star->begins = strl_arena_alloc_zero(scratch, vertices, sizeof *star->begins);
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
    if (sum[2] >> 63) { /* fold the lower half outward */
        int32_t folded = length - y;
        y = length - x;
        x = folded;
    }
    x = sum[0] >> 63 ? -x : x;
    y = sum[1] >> 63 ? -y : y;
    predicted[0] = ((uint32_t)(x + length) * most + (uint32_t)length) / (2 * (uint32_t)length);
    predicted[1] = ((uint32_t)(y + length) * most + (uint32_t)length) / (2 * (uint32_t)length);
}
