#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/fail.h"
#include "verify/input.h"

/* ---- dividing space ---- */

typedef struct weighted {
    double centre[3];
    uint64_t weight;
} weighted;

static int compare_x(const void *a, const void *b)
{
    const weighted *p = a, *q = b;
    return p->centre[0] < q->centre[0] ? -1 : p->centre[0] > q->centre[0];
}

static int compare_y(const void *a, const void *b)
{
    const weighted *p = a, *q = b;
    return p->centre[1] < q->centre[1] ? -1 : p->centre[1] > q->centre[1];
}

static int compare_z(const void *a, const void *b)
{
    const weighted *p = a, *q = b;
    return p->centre[2] < q->centre[2] ? -1 : p->centre[2] > q->centre[2];
}

static unsigned longest_axis(const weighted *items, size_t count)
{
    double length[3];
    for (unsigned k = 0; k < 3; k++) {
        double low = items[0].centre[k], high = low;
        for (size_t i = 1; i < count; i++) {
            low = items[i].centre[k] < low ? items[i].centre[k] : low;
            high = items[i].centre[k] > high ? items[i].centre[k] : high;
        }
        length[k] = high - low;
    }
    unsigned axis = length[1] > length[0] ? 1 : 0;
    return length[2] > length[axis] ? 2 : axis;
}

/* Regions [first, first + count) for the items; returns the child word. */
static uint32_t divide(strl__regions *regions, weighted *items, size_t item_count, uint32_t first, uint32_t count)
{
    static int (*const compare[3])(const void *, const void *) = {compare_x, compare_y, compare_z};
    if (count == 1 || item_count < 2)
        return first | STRL__REGION;
    unsigned axis = longest_axis(items, item_count);
    qsort(items, item_count, sizeof *items, compare[axis]);
    uint64_t total = 0, left = 0;
    uint32_t half = count / 2;
    for (size_t i = 0; i < item_count; i++)
        total += items[i].weight;
    size_t middle = 0;
    while (middle + 1 < item_count && (middle == 0 || left * count < total * half))
        left += items[middle++].weight;
    uint32_t at = regions->split_count++;
    regions->splits[at].axis = axis;
    regions->splits[at].at = (items[middle - 1].centre[axis] + items[middle].centre[axis]) / 2;
    uint32_t low = divide(regions, items, middle, first, half);
    uint32_t high = divide(regions, items + middle, item_count - middle, first + half, count - half);
    regions->splits[at].child[0] = low;
    regions->splits[at].child[1] = high;
    return at;
}

static weighted *leaf_centres(const strl__vtree *tree, size_t *count)
{
    weighted *items = strl__alloc(tree->node_count, sizeof *items);
    *count = 0;
    for (uint32_t id = 0; items && id < tree->node_count; id++) {
        const strl__vnode *n = &tree->nodes[id];
        if (n->child_count)
            continue;
        weighted *item = &items[(*count)++];
        item->weight = n->triangle_count;
        for (unsigned k = 0; k < 3; k++)
            item->centre[k] = ((double)n->box[0][k] + (double)n->box[1][k]) / 2;
    }
    return items;
}

static uint32_t region_of(const strl__regions *regions, const double corners[9])
{
    uint32_t at = 0;
    while (!(at & STRL__REGION)) {
        const strl__region_split *split = &regions->splits[at];
        double centre = (corners[split->axis] + corners[3 + split->axis] + corners[6 + split->axis]) / 3;
        at = split->child[centre >= split->at];
    }
    return at & ~STRL__REGION;
}

/* ---- blocks on disk ---- */

strl_status strl__v_regions_create(const strl__model *model, const strl__vtree *tree, uint32_t count,
                                   strl__regions *regions, strl_error *err)
{
    size_t leaf_count = 0;
    weighted *items = leaf_centres(tree, &leaf_count);
    uint64_t block = model->memory_bytes / 16 / count / STRL__SOUP_BYTES;
    *regions = (strl__regions){.count = count,
                               .block_triangles = block < 56    ? 56
                                                  : block > 900 ? 900
                                                                : (uint32_t)block};
    regions->splits = strl__alloc(count, sizeof *regions->splits);
    regions->items = strl__alloc_zero(count, sizeof *regions->items);
    strl_status status = STRL_OK;
    if (!items || !regions->splits || !regions->items)
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for %u regions", count);
    if (status == STRL_OK)
        status = strl_file_create_nameless(model->desc->scratch_dir, &regions->file, err);
    if (status == STRL_OK) {
        uint32_t top = divide(regions, items, leaf_count, 0, count);
        if (top & STRL__REGION) /* nothing to divide: both sides are that region */
            regions->splits[0] = (strl__region_split){0, {top, top}, 0};
    }
    strl__free(items);
    return status;
}

static strl_status write_block(strl__regions *regions, strl__region *region, strl_error *err)
{
    if (!strl__grow(&region->blocks, &region->block_capacity, region->block_count + 1, sizeof *region->blocks))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %u blocks of triangles", regions->blocks);
    uint64_t bytes = (uint64_t)regions->block_triangles * STRL__SOUP_BYTES;
    strl_status status =
        strl_file_write(regions->file, regions->blocks * bytes, region->buffer, region->fill * STRL__SOUP_BYTES, err);
    region->blocks[region->block_count++] = regions->blocks++;
    region->last = region->fill;
    region->fill = 0;
    return status;
}

strl_status strl__v_regions_add(strl__regions *regions, const double corners[9], strl_error *err)
{
    strl__region *region = &regions->items[region_of(regions, corners)];
    if (!region->buffer) {
        region->buffer = strl__alloc(regions->block_triangles, STRL__SOUP_BYTES);
        if (!region->buffer)
            return strl__fail(err, STRL_ERR_MEMORY, "no memory for a block of triangles");
    }
    memcpy(region->buffer + region->fill++ * STRL__SOUP_BYTES, corners, STRL__SOUP_BYTES);
    return region->fill == regions->block_triangles ? write_block(regions, region, err) : STRL_OK;
}

strl_status strl__v_regions_flush(strl__regions *regions, strl_error *err)
{
    strl_status status = STRL_OK;
    for (uint32_t i = 0; status == STRL_OK && i < regions->count; i++) {
        if (regions->items[i].fill)
            status = write_block(regions, &regions->items[i], err);
        strl__free(regions->items[i].buffer);
        regions->items[i].buffer = NULL;
    }
    return status;
}

void strl__v_regions_destroy(strl__regions *regions)
{
    for (uint32_t i = 0; regions->items && i < regions->count; i++) {
        strl__free(regions->items[i].blocks);
        strl__free(regions->items[i].buffer);
    }
    strl__free(regions->items);
    strl__free(regions->splits);
    strl_file_close(regions->file, NULL);
    *regions = (strl__regions){0};
}
