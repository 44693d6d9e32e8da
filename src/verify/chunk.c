#include <math.h>
#include <string.h>

#include "verify/surface.h"

uint64_t strl__v_chunk_bytes(uint32_t vertex_count, uint32_t triangle_count, uint32_t node_count)
{
    return sizeof(strl__chunk) + (uint64_t)vertex_count * sizeof(double[3]) +
           (uint64_t)node_count * sizeof(strl__bvh_node) + (uint64_t)triangle_count * sizeof(uint16_t[3]);
}

void strl__v_chunk_point(strl__chunk *chunk)
{
    chunk->vertex = (double(*)[3])(chunk + 1);
    chunk->nodes = (strl__bvh_node *)(chunk->vertex + chunk->vertex_count);
    chunk->triangle = (uint16_t(*)[3])(chunk->nodes + chunk->node_count);
}

/* Boxes are floats, rounded outward. */
static void enclose(const double (*vertex)[3], const uint32_t corners[3], float box[6])
{
    for (unsigned k = 0; k < 3; k++) {
        double low = vertex[corners[0]][k], high = low;
        for (unsigned c = 1; c < 3; c++) {
            low = fmin(low, vertex[corners[c]][k]);
            high = fmax(high, vertex[corners[c]][k]);
        }
        float down = (float)low, up = (float)high;
        box[k] = (double)down <= low ? down : nextafterf(down, -INFINITY);
        box[3 + k] = (double)up >= high ? up : nextafterf(up, INFINITY);
    }
}

/* Triangles in the order of the tree's leaves, vertices in that of their use. */
static void fill(strl__chunk *chunk, const double (*vertex)[3], const uint32_t (*triangle)[3], const uint32_t *order,
                 uint32_t *number)
{
    uint32_t used = 0;
    for (uint32_t t = 0; t < chunk->triangle_count; t++)
        for (unsigned k = 0; k < 3; k++) {
            uint32_t v = triangle[order[t]][k];
            if (number[v] == UINT32_MAX) {
                memcpy(chunk->vertex[used], vertex[v], sizeof *vertex);
                number[v] = used++;
            }
            chunk->triangle[t][k] = (uint16_t)number[v];
        }
}

static uint32_t count_used(const uint32_t (*triangle)[3], uint32_t triangle_count, uint32_t *number)
{
    uint32_t used = 0;
    for (uint32_t t = 0; t < triangle_count; t++)
        for (unsigned k = 0; k < 3; k++) {
            used += number[triangle[t][k]] != 0;
            number[triangle[t][k]] = 0;
        }
    return used;
}

strl__chunk *strl__v_chunk_build(const double base[3], const double (*vertex)[3], uint32_t vertex_count,
                                 const uint32_t (*triangle)[3], uint32_t triangle_count, strl_arena *scratch)
{
    float(*boxes)[6] = strl_arena_alloc(scratch, triangle_count, sizeof *boxes);
    uint32_t *order = strl_arena_alloc(scratch, triangle_count, sizeof *order);
    uint32_t *number = strl_arena_alloc(scratch, vertex_count, sizeof *number);
    strl__bvh_node *nodes = strl_arena_alloc(scratch, strl__bvh_nodes(triangle_count), sizeof *nodes);
    if (!boxes || !order || !number || !nodes)
        return NULL;
    for (uint32_t t = 0; t < triangle_count; t++)
        enclose(vertex, triangle[t], boxes[t]);
    uint32_t node_count = strl__v_bvh_build((const float(*)[6])boxes, triangle_count, order, nodes);
    memset(number, 0xff, (size_t)vertex_count * sizeof *number);
    uint32_t used = count_used(triangle, triangle_count, number);
    uint64_t bytes = strl__v_chunk_bytes(used, triangle_count, node_count);
    strl__chunk *chunk = strl__alloc((size_t)bytes, 1);
    if (!chunk)
        return NULL;
    *chunk =
        (strl__chunk){.vertex_count = used, .triangle_count = triangle_count, .node_count = node_count, .bytes = bytes};
    memcpy(chunk->base, base, sizeof chunk->base);
    strl__v_chunk_point(chunk);
    memcpy(chunk->nodes, nodes, node_count * sizeof *nodes);
    memset(number, 0xff, (size_t)vertex_count * sizeof *number);
    fill(chunk, vertex, triangle, order, number);
    return chunk;
}
