#include "build/samples/top.h"

#include <string.h>

#include "base/fail.h"

#define CELLS (STRL_OCTANT_MAX_CHILDREN - 1)

typedef struct top {
    const strl_chunks *chunks;
    strl_octree octree;      /* its triangles: the items of all pieces, then those that have risen */
    uint32_t *first;         /* [chunks] the first one of each */
    uint32_t *risen, *spare; /* [risen] triangles, ascending by key within each cell */
} top;

/* Pieces and risen triangles of one cell. */
typedef struct cell_range {
    uint32_t chunk, chunk_end, risen, risen_end;
} cell_range;

static void take(strl_octree *octree, uint32_t at, const strl_risen *risen)
{
    octree->triangle[at] = risen->triangle;
    octree->key[at] = risen->key;
    octree->limit[at] = risen->limit;
    octree->owner[at] = STRL_NO_OCTANT;
}

static strl_status load(const strl_sample_stage *stage, top *t, strl_error *err)
{
    const strl_chunks *chunks = &stage->chunks;
    uint32_t count = 0, at = 0;
    t->chunks = chunks;
    t->octree.has_pieces = true;
    for (size_t i = 0; i < chunks->count; i++)
        count += chunks->chunk[i].item_count;
    strl_status status = strl_octree_prepare(&t->octree, stage, count + (uint32_t)chunks->risen_count, err);
    t->first = strl__alloc(chunks->count, sizeof *t->first);
    t->risen = strl__alloc(chunks->risen_count, sizeof *t->risen);
    t->spare = strl__alloc(chunks->risen_count, sizeof *t->spare);
    if (!status && (!t->first || !t->risen || !t->spare))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu pieces", chunks->count);
    for (size_t i = 0; i < chunks->count && !status; i++) {
        t->first[i] = at;
        for (uint32_t k = 0; k < chunks->chunk[i].item_count; k++)
            take(&t->octree, at++, &chunks->chunk[i].item[k]);
    }
    for (size_t i = 0; i < chunks->risen_count && !status; i++) {
        t->risen[i] = at;
        take(&t->octree, at++, &chunks->risen[i]);
    }
    return status;
}

/* The upper cells of a piece: without items, for the preview alone. */
static strl_status add_below(top *t, const strl_chunk *chunk, strl_octant *root, strl_error *err)
{
    uint32_t first = (uint32_t)t->octree.octant_count, index;
    strl_status status = STRL_OK;
    for (uint32_t i = 0; i < chunk->below_count && !status; i++) {
        strl_octant cell = chunk->below[i];
        cell.first_item = cell.item_count = 0;
        for (uint32_t k = 0; k < cell.child_count; k++)
            cell.child[k] += first;
        status = strl_octree_add(&t->octree, &cell, &index, err);
    }
    for (uint32_t k = 0; k < root->child_count; k++)
        root->child[k] += first;
    return status;
}

static strl_status add_piece(top *t, uint32_t index, uint32_t *octant, strl_error *err)
{
    const strl_chunk *chunk = &t->chunks->chunk[index];
    strl_octree *octree = &t->octree;
    strl_octant root = chunk->root;
    strl_status status = add_below(t, chunk, &root, err);
    root.first_item = (uint32_t)octree->item_count;
    root.chunk = root.is_leaf ? STRL_NO_CHUNK : index;
    for (uint32_t i = 0; i < chunk->item_count && !status; i++) {
        octree->owner[t->first[index] + i] = (uint32_t)octree->octant_count;
        status = strl_octree_add_item(octree, t->first[index] + i, chunk->item[i].weight, err);
    }
    return status ? status : strl_octree_add(octree, &root, octant, err);
}

/* The first and the last key of the cells and triangles of a range. */
static void find_keys(const top *t, const cell_range *range, uint64_t *low, uint64_t *high)
{
    *low = UINT64_MAX;
    *high = 0;
    if (range->chunk < range->chunk_end) {
        const strl_chunk *last = &t->chunks->chunk[range->chunk_end - 1];
        *low = t->chunks->chunk[range->chunk].key;
        *high = last->key + (((uint64_t)1 << 3 * (STRL_OCTREE_DEPTH - last->root.depth)) - 1);
    }
    if (range->risen < range->risen_end) {
        uint64_t first = t->octree.key[t->risen[range->risen]], last = t->octree.key[t->risen[range->risen_end - 1]];
        *low = first < *low ? first : *low;
        *high = last > *high ? last : *high;
    }
}

/* The smallest cell that has all of it. */
static uint32_t own_depth(const top *t, const cell_range *range, uint64_t low, uint64_t high)
{
    uint32_t common = STRL_OCTREE_DEPTH;
    for (uint64_t differ = low ^ high; differ; differ >>= 3)
        common--;
    for (uint32_t i = range->risen; i < range->risen_end; i++)
        common = t->octree.limit[t->risen[i]] < common ? t->octree.limit[t->risen[i]] : common;
    return common;
}

/* What lies in the child cell that the range begins with, of a cell of `depth`; the range begins behind it then. */
static cell_range cut_child(const top *t, cell_range *range, uint32_t depth)
{
    unsigned shift = 3 * (STRL_OCTREE_DEPTH - depth - 1);
    uint64_t low, high;
    cell_range child = *range;
    find_keys(t, range, &low, &high);
    for (child.chunk_end = child.chunk; child.chunk_end < range->chunk_end; child.chunk_end++)
        if (t->chunks->chunk[child.chunk_end].key >> shift != low >> shift)
            break;
    for (child.risen_end = child.risen; child.risen_end < range->risen_end; child.risen_end++)
        if (t->octree.key[t->risen[child.risen_end]] >> shift != low >> shift)
            break;
    range->chunk = child.chunk_end;
    range->risen = child.risen_end;
    return child;
}

/* Pieces of one of the smallest cells, which nothing divides but their number: some of them, that those left may be one
 * of `places`. */
static cell_range cut_share(cell_range *range, uint32_t places)
{
    cell_range share = *range;
    share.chunk_end = share.chunk + (range->chunk_end - range->chunk + places - 1) / places;
    share.risen_end = share.risen;
    range->chunk = share.chunk_end;
    return share;
}

/* Moves those to the front that no smaller cell holds; all keep their order. Returns their end. */
static uint32_t part_large(top *t, const cell_range *range, uint32_t depth)
{
    uint32_t large = range->risen, rest = 0;
    for (uint32_t i = range->risen; i < range->risen_end; i++)
        if (t->octree.limit[t->risen[i]] <= depth)
            t->risen[large++] = t->risen[i];
        else
            t->spare[rest++] = t->risen[i];
    memcpy(t->risen + large, t->spare, rest * sizeof *t->risen);
    return large;
}

static strl_status add_cell(top *t, cell_range range, uint32_t *octant, strl_error *err);

static strl_status add_children(top *t, cell_range range, strl_octant *cell, strl_error *err)
{
    uint32_t large = part_large(t, &range, cell->depth), first = range.risen;
    strl_status status = STRL_OK;
    range.risen = large;
    while (!status && (range.chunk < range.chunk_end || range.risen < range.risen_end)) {
        cell_range child = cell->depth < STRL_OCTREE_DEPTH ? cut_child(t, &range, cell->depth)
                                                           : cut_share(&range, CELLS - cell->child_count);
        status = add_cell(t, child, &cell->child[cell->child_count++], err);
    }
    if (!status && first < large) {
        strl_octant leaf = {.prefix = cell->prefix, .depth = cell->depth, .is_large = true};
        status = strl_octree_add_leaf(&t->octree, t->risen + first, large - first, &leaf,
                                      &cell->child[cell->child_count++], err);
    }
    return status;
}

static strl_status add_cell(top *t, cell_range range, uint32_t *octant, strl_error *err)
{
    uint64_t low, high;
    if (range.chunk_end - range.chunk == 1 && range.risen == range.risen_end)
        return add_piece(t, range.chunk, octant, err);
    find_keys(t, &range, &low, &high);
    strl_octant cell = {.depth = own_depth(t, &range, low, high), .chunk = STRL_NO_CHUNK};
    cell.prefix = low >> 3 * (STRL_OCTREE_DEPTH - cell.depth);
    if (range.chunk == range.chunk_end)
        return strl_octree_add_leaf(&t->octree, t->risen + range.risen, range.risen_end - range.risen, &cell, octant,
                                    err);
    strl_status status = add_children(t, range, &cell, err);
    if (!status)
        status = strl_octree_add(&t->octree, &cell, octant, err);
    return status ? status : strl_octree_sample(&t->octree, *octant, err);
}

static strl_status make_bricks(top *t, uint32_t root, strl_brick_set *set, strl_error *err)
{
    strl_arena arena = {0};
    strl_status status = strl_bricks_add_root(set, &t->octree, root, &arena, err);
    if (!status && !t->octree.octant[root].is_leaf)
        status = strl_bricks_add(set, &t->octree, root, 0, &arena, err);
    for (size_t i = 0; i < set->count; i++)
        if (set->brick[i].chunk != STRL_NO_CHUNK)
            set->brick[i].record = t->chunks->chunk[set->brick[i].chunk].first;
    strl_bricks_close(set);
    strl_arena_deinit(&arena);
    return status;
}

strl_status strl_top_make(const strl_sample_stage *stage, strl_brick_set *set, strl_error *err)
{
    top t = {0};
    uint32_t root;
    strl_status status = load(stage, &t, err);
    if (!status) {
        cell_range all = {0, (uint32_t)stage->chunks.count, 0, (uint32_t)stage->chunks.risen_count};
        status = add_cell(&t, all, &root, err);
    }
    if (!status)
        status = make_bricks(&t, root, set, err);
    strl_octree_deinit(&t.octree);
    strl__free(t.first);
    strl__free(t.risen);
    strl__free(t.spare);
    return status;
}
