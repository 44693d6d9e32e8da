/* A bumpy square of lattice vertices cut into patches, each a draw item with an anchor of its own: neighbours share the
 * positions of their border and nothing else. */
#ifndef STRL_TESTS_RENDER_PATCHES_H
#define STRL_TESTS_RENDER_PATCHES_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/hash.h"
#include "geometry/octahedral.h"
#include "stroll/frame.h"

#define PATCH_SIDE 24 /* quads along a patch */
#define PATCH_VERTICES ((PATCH_SIDE + 1) * (PATCH_SIDE + 1))
#define PATCH_INDICES (PATCH_SIDE * PATCH_SIDE * 6)

typedef struct patches {
    int side; /* patches along the square */
    uint32_t count;
    strl_draw_item *items;
    strl_vertex *vertices; /* [count * PATCH_VERTICES] */
    uint16_t *indices;     /* [count * PATCH_INDICES] */
    strl_draw_list list;
} patches;

typedef struct patches_desc {
    int side;
    int32_t spacing; /* lattice units between neighbouring vertices; 0 = 1000 */
    int64_t shift;   /* of all cells; the origin moves back by as much */
    double step;     /* 0 = 2^-10 */
    bool flat;       /* z = 0 everywhere */
    uint8_t alpha;   /* 0 = 255 */
} patches_desc;

static int64_t patches_height(const patches_desc *desc, int x, int y)
{
    if (desc->flat)
        return 0;
    return (int64_t)(desc->spacing * 3.0 * (sin(x * 0.21) + cos(y * 0.17))) +
           (int64_t)(strl__mix64((uint64_t)x * 977 + (uint64_t)y) % 200);
}

static void patches_fill_vertices(const patches_desc *desc, strl_draw_item *item, strl_vertex *out, int first_x,
                                  int first_y)
{
    for (int v = 0; v < PATCH_VERTICES; v++) {
        int x = first_x + v % (PATCH_SIDE + 1), y = first_y + v / (PATCH_SIDE + 1);
        int64_t cell[3] = {(int64_t)x * desc->spacing + desc->shift, (int64_t)y * desc->spacing + desc->shift,
                           patches_height(desc, x, y) + desc->shift};
        for (int i = 0; i < 3; i++) {
            out[v].position[i] = (int32_t)(cell[i] - item->anchor[i]);
            item->box_min[i] = v == 0 || cell[i] < item->box_min[i] ? cell[i] : item->box_min[i];
            item->box_max[i] = v == 0 || cell[i] > item->box_max[i] ? cell[i] : item->box_max[i];
        }
        float normal[3] = {desc->flat ? 0 : -(float)cos(x * 0.21) * 0.63f,
                           desc->flat ? 0 : (float)sin(y * 0.17) * 0.51f, 1};
        strl_oct_encode(normal, out[v].normal);
        out[v].rgba[0] = (uint8_t)(60 + 7 * (x % 24)), out[v].rgba[1] = (uint8_t)(80 + 5 * (y % 30)),
        out[v].rgba[2] = 150;
        out[v].rgba[3] = desc->alpha;
    }
}

static void patches_fill_indices(uint16_t *out)
{
    for (int q = 0; q < PATCH_SIDE * PATCH_SIDE; q++) {
        uint16_t a = (uint16_t)(q / PATCH_SIDE * (PATCH_SIDE + 1) + q % PATCH_SIDE), b = (uint16_t)(a + PATCH_SIDE + 1);
        const uint16_t corners[6] = {a, (uint16_t)(a + 1), b, b, (uint16_t)(a + 1), (uint16_t)(b + 1)};
        memcpy(out + 6 * q, corners, sizeof corners);
    }
}

static void patches_init(patches *all, patches_desc desc)
{
    desc.spacing = desc.spacing ? desc.spacing : 1000;
    desc.step = desc.step > 0 ? desc.step : 0x1p-10;
    desc.alpha = desc.alpha ? desc.alpha : 255;
    all->side = desc.side;
    all->count = (uint32_t)(desc.side * desc.side);
    all->items = calloc(all->count, sizeof *all->items);
    all->vertices = calloc(all->count, PATCH_VERTICES * sizeof *all->vertices);
    all->indices = calloc(all->count, PATCH_INDICES * sizeof *all->indices);
    for (uint32_t p = 0; p < all->count; p++) {
        strl_draw_item *item = &all->items[p];
        *item = (strl_draw_item){.key = 100 + p,
                                 .node = p,
                                 .level = p % 3,
                                 .state = 5,
                                 .visible = true,
                                 .vertex_count = PATCH_VERTICES,
                                 .index_count = PATCH_INDICES,
                                 .draw_count = PATCH_INDICES,
                                 .step = desc.step,
                                 .error = 0.01f,
                                 .error_px = (float)p / (float)all->count};
        item->vertices = all->vertices + p * PATCH_VERTICES;
        item->indices = all->indices + p * PATCH_INDICES;
        for (int i = 0; i < 3; i++) {
            item->transform[i * 5] = 1;
            item->origin[i] = -desc.step * (double)desc.shift;
            /* Anchors have nothing to do with the geometry's order: each patch rounds from another place. */
            item->anchor[i] = desc.shift + (int64_t)(strl__mix64(p * 3 + (uint64_t)i) % 2000000) - 1000000;
        }
        patches_fill_vertices(&desc, item, all->vertices + p * PATCH_VERTICES, (int)p % desc.side * PATCH_SIDE,
                              (int)p / desc.side * PATCH_SIDE);
        patches_fill_indices(all->indices + p * PATCH_INDICES);
    }
    all->list = (strl_draw_list){
        .items = all->items, .count = all->count, .near_distance = 0.5, .far_distance = 1000, .frame = 1};
}

static void patches_deinit(patches *all)
{
    free(all->items);
    free(all->vertices);
    free(all->indices);
}

/* Looks at the middle of the square from the height given in widths of the square. */
static strl_camera patches_camera(const patches *all, uint32_t width, uint32_t height, double distance)
{
    double extent = all->side * PATCH_SIDE * 1000 * 0x1p-10;
    strl_camera camera = {.eye = {extent * 0.4, extent * 0.2, extent * distance},
                          .target = {extent / 2, extent / 2, 0},
                          .up = {0, 1, 0},
                          .fov_y_deg = 60,
                          .width = width,
                          .height = height};
    return camera;
}

#endif
