/* See facets.h. */
#include "scenes/facets.h"

#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"

enum { PAGE_VERTICES = 1024 };

strl_status strl__facets_init(strl__facets *facets, uint64_t memory_bytes, const char *path, strl_error *err)
{
    size_t page_bytes = PAGE_VERTICES * facets->vertex_bytes;
    uint64_t pages = (facets->vertex_count + PAGE_VERTICES - 1) / PAGE_VERTICES;
    facets->slots = 1;
    while (facets->slots < pages && 2 * facets->slots * page_bytes <= memory_bytes)
        facets->slots *= 2;
    facets->pages = strl__alloc((size_t)facets->slots, page_bytes);
    facets->page_numbers = strl__alloc_zero((size_t)facets->slots, sizeof *facets->page_numbers);
    return facets->pages && facets->page_numbers ? STRL_OK
                                                 : strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for vertices", path);
}

void strl__facets_deinit(strl__facets *facets)
{
    strl__free(facets->pages);
    strl__free(facets->page_numbers);
    *facets = (strl__facets){0};
}

static strl_status load_page(strl__facets *facets, uint64_t page, uint8_t *into, strl_error *err)
{
    uint64_t first = page * PAGE_VERTICES, left = facets->vertex_count - first;
    uint64_t count = left < PAGE_VERTICES ? left : PAGE_VERTICES;
    return strl_file_read(facets->vertices, first * facets->vertex_bytes, into, (size_t)count * facets->vertex_bytes,
                          err);
}

static strl_status find_position(strl__facets *facets, uint32_t vertex, float position[3], strl_error *err)
{
    uint64_t page = vertex / PAGE_VERTICES, slot = page & (facets->slots - 1);
    uint8_t *records = facets->pages + slot * PAGE_VERTICES * facets->vertex_bytes;
    if (facets->page_numbers[slot] != page + 1) {
        facets->page_numbers[slot] = 0; /* a failed read leaves half a page */
        strl_status status = load_page(facets, page, records, err);
        if (status != STRL_OK)
            return status;
        facets->page_numbers[slot] = page + 1;
    }
    memcpy(position, records + vertex % PAGE_VERTICES * facets->vertex_bytes, 3 * sizeof *position);
    return STRL_OK;
}

static void put_facet(float position[3][3], uint8_t *facet)
{
    double u[3], v[3], normal[3];
    for (int k = 0; k < 3; k++) {
        u[k] = (double)position[1][k] - position[0][k];
        v[k] = (double)position[2][k] - position[0][k];
    }
    for (int k = 0; k < 3; k++)
        normal[k] = u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3];
    double length = sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
    for (int k = 0; k < 3; k++) {
        float part = length > 0 ? (float)(normal[k] / length) : 0.0f;
        memcpy(facet + 4 * k, &part, sizeof part);
    }
    memcpy(facet + 12, position, 36);
    memset(facet + 48, 0, 2);
}

strl_status strl__facets_read(void *context, uint64_t first, size_t count, uint8_t *records, strl_error *err)
{
    strl__facets *facets = context;
    /* The faces fit where their facets will be: read at the end, each is gone before its bytes are overwritten. */
    uint8_t *faces = records + count * (STRL__FACET_BYTES - STRL__FACE_BYTES);
    strl_status status = strl__spilled_read(&facets->faces, first, count, faces, err);
    for (size_t i = 0; status == STRL_OK && i < count; i++) {
        uint32_t corners[3];
        float position[3][3];
        memcpy(corners, faces + i * STRL__FACE_BYTES + 1, sizeof corners);
        for (int k = 0; status == STRL_OK && k < 3; k++)
            status = find_position(facets, corners[k], position[k], err);
        if (status == STRL_OK)
            put_facet(position, records + i * STRL__FACET_BYTES);
    }
    return status;
}
