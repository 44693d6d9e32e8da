#include "build/samples/chunk.h"

#include <string.h>

#include "base/fail.h"
#include "build/ingest/normals.h"

#define LEAF_TRIANGLES 256u
/* What is at the top is held in memory, so what a bucket hands up is bounded: triangles too large for it, of which more
 * stay where they are and the cells there count as so large; and what the root of a piece stores. */
#define MOST_RISEN 2048u
#define MOST_OF_ROOT 8192u
#define LEAST_HANDED_UP 64u
#define SHARE_OF_MEMORY 8u  /* for all that is handed up */
#define TIMES_OF_RISEN 2u   /* it is held twice: here and in the octree of the top */
#define PIECES_OF_BUCKET 8u /* mostly fewer */
/* What a bucket takes in memory while it is worked on, in the size of its records: these, triangles, keys twice, cells,
 * payloads. */
#define TIMES_OF_BUCKET 6u

/* One bucket on its way from a worker to the streams. */
typedef struct made_bucket {
    uint32_t most_risen, most_of_root;
    strl_chunks chunks;
    strl_brick_set *sets; /* [chunks.count] */
} made_bucket;

typedef struct chunk_job {
    strl_sample_stage *stage;
    made_bucket *slots;
    uint64_t first; /* bucket */
} chunk_job;

void strl_chunks_deinit(strl_chunks *chunks)
{
    for (size_t i = 0; i < chunks->count; i++) {
        strl__free(chunks->chunk[i].item);
        strl__free(chunks->chunk[i].below);
        strl__free(chunks->chunk[i].run);
    }
    strl__free(chunks->chunk);
    strl__free(chunks->risen);
    *chunks = (strl_chunks){0};
}

static void release(made_bucket *made)
{
    for (size_t i = 0; made->sets && i < made->chunks.count; i++)
        strl_bricks_deinit(&made->sets[i]);
    strl__free(made->sets);
    strl_chunks_deinit(&made->chunks);
    *made = (made_bucket){0};
}

strl_status strl_octree_prepare(strl_octree *octree, const strl_sample_stage *stage, uint32_t triangles,
                                strl_error *err)
{
    octree->leaf_triangles = LEAF_TRIANGLES;
    octree->coupons = stage->coupons;
    return strl_octree_create(octree, stage->ingest, triangles, err);
}

/* ---- from records to triangles in the order of the curve */

static strl_status sort_triangles(const strl_sample_stage *stage, uint32_t index, const uint8_t *records,
                                  strl_octree *octree, strl_error *err)
{
    uint64_t low, high;
    strl__bucket_range(stage->buckets, index, &low, &high);
    uint32_t count = octree->triangle_count;
    size_t bytes = strl__soup_bucket_bytes(stage->ingest);
    strl_keyed *keys = strl__alloc(count, sizeof *keys), *other = strl__alloc(count, sizeof *keys);
    strl_status status =
        keys && other ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "no memory to sort %u triangles", count);
    for (uint32_t i = 0; i < count && !status; i++) {
        strl_soup_triangle triangle;
        strl__soup_unpack(stage->ingest, records + i * bytes, &triangle);
        keys[i] = (strl_keyed){strl__curve_key_of_triangle(stage->ingest, &triangle), i};
    }
    if (!status)
        strl__sort_keys(keys, other, count);
    for (uint32_t i = 0; i < count && !status; i++) {
        strl__soup_unpack(stage->ingest, records + keys[i].index * bytes, &octree->triangle[i]);
        octree->key[i] = keys[i].key;
        octree->limit[i] = strl_octree_limit(stage->ingest, &octree->triangle[i], keys[i].key);
        if (!strl__soup_is_sound(stage->ingest, &octree->triangle[i]) || keys[i].key < low || keys[i].key > high)
            status = strl__fail(err, STRL_ERR_INTERNAL, "a triangle of a bucket is not one that lies there");
    }
    strl__free(keys);
    strl__free(other);
    return status;
}

/* From the faces of the bucket: at its borders those of the next one have no say. */
static strl_status fill_normals(const strl_ingest *ingest, strl_octree *octree, strl_error *err)
{
    strl_arena arena = {0};
    bool good = true;
    if (ingest->lacks_normals) {
        bool *wanted = strl_arena_alloc(&arena, octree->triangle_count, sizeof *wanted);
        if (wanted)
            memset(wanted, true, octree->triangle_count * sizeof *wanted);
        good = wanted && strl__fill_normals(octree->triangle, wanted, octree->triangle_count, &arena);
    }
    strl_arena_deinit(&arena);
    return good ? STRL_OK
                : strl__fail(err, STRL_ERR_MEMORY, "no memory for the normals of %u triangles", octree->triangle_count);
}

static strl_status load_bucket(const strl_sample_stage *stage, uint32_t index, strl_octree *octree, strl_error *err)
{
    strl_spill *spill = stage->buckets->spill[index];
    uint64_t bytes = strl_spill_bytes(spill), count = bytes / strl__soup_bucket_bytes(stage->ingest);
    uint8_t *records = strl__alloc(bytes, 1);
    strl_status status =
        records && count < UINT32_MAX
            ? STRL_OK
            : strl__fail(err, STRL_ERR_MEMORY, "no memory for %llu triangles", (unsigned long long)count);
    if (!status)
        status = strl_octree_prepare(octree, stage, (uint32_t)count, err);
    if (!status)
        status = strl_spill_read(spill, 0, records, bytes, err);
    if (!status)
        status = sort_triangles(stage, index, records, octree, err);
    strl__free(records);
    return status ? status : fill_normals(stage->ingest, octree, err);
}

/* ---- pieces */

static strl_risen rise(const strl_octree *octree, uint32_t triangle, float weight)
{
    return (strl_risen){octree->triangle[triangle], octree->key[triangle], weight, octree->limit[triangle]};
}

/* Those of order[] that are too large for a cell of `depth` go to risen, as long as there is room; *count of them stay.
 * False: no memory. */
static bool let_rise(const strl_octree *octree, uint32_t *order, uint32_t *count, uint32_t depth, uint32_t most,
                     strl_chunks *chunks)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < *count; i++) {
        if (octree->limit[order[i]] >= depth || chunks->risen_count >= most) {
            order[kept++] = order[i];
            continue;
        }
        if (!strl__grow(&chunks->risen, &chunks->risen_capacity, chunks->risen_count + 1, sizeof *chunks->risen))
            return false;
        chunks->risen[chunks->risen_count++] = rise(octree, order[i], 0);
    }
    *count = kept;
    return true;
}

/* What the preview needs: all children of cells above its depth. */
static strl_status hand_up_below(const strl_octree *octree, strl_octant *above, strl_chunk *chunk, strl_error *err)
{
    uint32_t first = chunk->below_count,
             count = above->depth < strl_preview_depth(octree->ingest) ? above->child_count : 0;
    size_t capacity = chunk->below_capacity;
    if (!strl__grow(&chunk->below, &capacity, (size_t)first + count, sizeof *chunk->below))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %u cells", first + count);
    chunk->below_capacity = (uint32_t)capacity;
    for (uint32_t i = 0; i < count; i++) {
        chunk->below[first + i] = octree->octant[above->child[i]];
        above->child[i] = first + i;
    }
    above->child_count = count;
    chunk->below_count += count;
    strl_status status = STRL_OK;
    for (uint32_t i = 0; i < count && !status; i++) {
        strl_octant child = chunk->below[first + i]; /* the array moves */
        status = hand_up_below(octree, &child, chunk, err);
        chunk->below[first + i] = child;
    }
    return status;
}

static strl_status hand_up(const strl_octree *octree, uint32_t root, strl_chunk *chunk, strl_error *err)
{
    chunk->root = octree->octant[root];
    chunk->key = chunk->root.prefix << 3 * (STRL_OCTREE_DEPTH - chunk->root.depth);
    chunk->item_count = chunk->root.item_count;
    chunk->item = strl__alloc(chunk->item_count, sizeof *chunk->item);
    if (!chunk->item)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a root of %u triangles", chunk->item_count);
    for (uint32_t i = 0; i < chunk->item_count; i++) {
        const strl_sample_item *item = &octree->item[chunk->root.first_item + i];
        chunk->item[i] = rise(octree, item->triangle, item->weight);
    }
    return hand_up_below(octree, &chunk->root, chunk, err);
}

/* A root that stores too much gets a cell over it that draws no more than it may. */
static strl_status cover_root(strl_octree *octree, uint32_t most, uint32_t *root, strl_error *err)
{
    const strl_octant *below = &octree->octant[*root];
    if (below->item_count <= most)
        return STRL_OK;
    strl_octant cell = {
        .prefix = below->prefix, .depth = below->depth, .chunk = STRL_NO_CHUNK, .child_count = 1, .child = {*root}};
    strl_status status = strl_octree_add(octree, &cell, root, err);
    octree->most_draws = most;
    if (!status)
        status = strl_octree_sample(octree, *root, err);
    octree->most_draws = 0;
    return status;
}

static strl_status add_chunk(made_bucket *made, strl_octree *octree, uint32_t *order, uint32_t count, uint32_t depth,
                             strl_arena *arena, strl_error *err)
{
    strl_chunks *chunks = &made->chunks;
    uint32_t root;
    size_t room = chunks->count;
    if (!let_rise(octree, order, &count, depth, made->most_risen, chunks))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for large triangles");
    if (!count)
        return STRL_OK;
    strl_status status = strl_octree_build(octree, order, count, depth, &root, err);
    if (!status)
        status = cover_root(octree, made->most_of_root, &root, err);
    if (status)
        return status;
    if (!strl__grow(&made->sets, &room, chunks->count + 1, sizeof *made->sets) ||
        !strl__grow(&chunks->chunk, &chunks->capacity, chunks->count + 1, sizeof *chunks->chunk))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu pieces", chunks->count);
    made->sets[chunks->count] = (strl_brick_set){0};
    chunks->chunk[chunks->count] = (strl_chunk){0};
    strl_chunk *chunk = &chunks->chunk[chunks->count];
    strl_brick_set *set = &made->sets[chunks->count++];
    status = hand_up(octree, root, chunk, err);
    if (!status && !chunk->root.is_leaf)
        status = strl_bricks_add(set, octree, root, STRL_NO_BRICK, arena, err);
    strl_bricks_close(set);
    if (set->count)
        chunk->first = set->brick[0].record;
    return status;
}

/* The largest cells of [low, high] below the cell with this prefix; order[*at ..) are the triangles from there on. */
typedef struct cutting {
    made_bucket *made;
    strl_octree *octree;
    uint32_t *order;
    uint64_t low, high; /* first and last key of the bucket */
    strl_arena *arena;
} cutting;

static strl_status cut(const cutting *c, uint32_t begin, uint32_t end, uint64_t prefix, uint32_t depth, strl_error *err)
{
    unsigned shift = 3 * (STRL_OCTREE_DEPTH - depth);
    uint64_t first = prefix << shift, last = first + ((uint64_t)1 << shift) - 1;
    if (begin == end)
        return STRL_OK;
    if (first >= c->low && last <= c->high)
        return add_chunk(c->made, c->octree, c->order + begin, end - begin, depth, c->arena, err);
    strl_status status = STRL_OK;
    for (uint32_t child = 0; child < 8 && !status; child++) {
        uint32_t at = begin;
        while (at < end && c->octree->key[at] >> (shift - 3) == (prefix << 3 | child))
            at++;
        status = cut(c, begin, at, prefix << 3 | child, depth + 1, err);
        begin = at;
    }
    return status;
}

static uint32_t bounded(uint64_t wanted, uint32_t most)
{
    return wanted < LEAST_HANDED_UP ? LEAST_HANDED_UP : wanted < most ? (uint32_t)wanted : most;
}

/* The same for any number of threads. */
static void bound_what_rises(const strl_sample_stage *stage, made_bucket *made)
{
    uint64_t each =
        stage->context->memory_bytes / SHARE_OF_MEMORY / TIMES_OF_RISEN / sizeof(strl_risen) / stage->buckets->count;
    made->most_risen = bounded(each / 2, MOST_RISEN);
    made->most_of_root = bounded(each / 2 / PIECES_OF_BUCKET, MOST_OF_ROOT);
}

static strl_status work(void *context, uint64_t index, unsigned slot, unsigned worker, strl_error *err)
{
    const chunk_job *job = context;
    strl_octree octree = {0};
    strl_arena arena = {0};
    (void)worker;
    index += job->first;
    release(&job->slots[slot]);
    bound_what_rises(job->stage, &job->slots[slot]);
    strl_status status = load_bucket(job->stage, (uint32_t)index, &octree, err);
    uint32_t *order = status ? NULL : strl__alloc(octree.triangle_count, sizeof *order);
    if (!status && !order)
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory to sample %u triangles", octree.triangle_count);
    for (uint32_t i = 0; i < octree.triangle_count && !status; i++)
        order[i] = i;
    cutting c = {.made = &job->slots[slot], .octree = &octree, .order = order, .arena = &arena};
    strl__bucket_range(job->stage->buckets, (uint32_t)index, &c.low, &c.high);
    if (!status)
        status = cut(&c, 0, octree.triangle_count, 0, 0, err);
    strl__free(order);
    strl_octree_deinit(&octree);
    strl_arena_deinit(&arena);
    return status;
}

/* ---- to the streams */

/* Bricks by depth, each with its number in its run. */
static strl_status append_set(strl_sample_stage *stage, strl_chunk *chunk, const strl_brick_set *set, strl_error *err)
{
    uint32_t depths = 0;
    for (size_t i = 0; i < set->count; i++)
        depths = set->brick[i].depth >= depths ? set->brick[i].depth + 1 : depths;
    chunk->run = strl__alloc_zero(depths, sizeof *chunk->run);
    uint32_t *number = strl__alloc(set->count, sizeof *number), *next = strl__alloc_zero(depths + 1, sizeof *next);
    strl_status status = chunk->run && number && next
                             ? STRL_OK
                             : strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu bricks", set->count);
    chunk->run_count = status ? 0 : depths;
    for (size_t i = 0; i < set->count && !status; i++)
        number[i] = chunk->run[set->brick[i].depth].count++;
    for (uint32_t depth = 0; depth < chunk->run_count && !status; depth++) {
        strl_stored_run *run = &chunk->run[depth];
        run->at = strl_spill_bytes(stage->bricks);
        for (size_t i = 0; i < set->count && !status; i++) {
            const strl_brick *brick = &set->brick[i];
            if (brick->depth != depth)
                continue;
            strl_stored_brick head = {brick->record,
                                      brick->parent == STRL_NO_BRICK ? STRL_NO_BRICK : number[brick->parent],
                                      brick->child_count ? next[depth + 1] : STRL_NO_BRICK, brick->payload_bytes};
            head.record.child_count = brick->child_count;
            next[depth + 1] += brick->child_count;
            status = strl_spill_append(stage->bricks, &head, sizeof head, err);
            if (!status)
                status =
                    strl_spill_append(stage->bricks, set->bytes.data + brick->payload_at, brick->payload_bytes, err);
        }
        run->bytes = strl_spill_bytes(stage->bricks) - run->at;
    }
    strl__free(number);
    strl__free(next);
    return status;
}

static strl_status finish(void *context, uint64_t index, unsigned slot, unsigned worker, strl_error *err)
{
    const chunk_job *job = context;
    strl_sample_stage *stage = job->stage;
    made_bucket *made = &job->slots[slot];
    strl_chunks *all = &stage->chunks;
    size_t pieces = made->chunks.count, risen = made->chunks.risen_count;
    (void)worker;
    index += job->first;
    stage->done += strl_spill_bytes(stage->buckets->spill[index]) / strl__soup_bucket_bytes(stage->ingest);
    strl_status status = strl_spill_close_and_delete(stage->buckets->spill[index], err);
    stage->buckets->spill[index] = NULL;
    for (size_t i = 0; i < made->chunks.count && !status; i++) {
        stage->triangles += made->sets[i].triangles;
        stage->vertices += made->sets[i].vertices;
        status = append_set(stage, &made->chunks.chunk[i], &made->sets[i], err);
    }
    if (!status && (!strl__grow(&all->chunk, &all->capacity, all->count + made->chunks.count, sizeof *all->chunk) ||
                    !strl__grow(&all->risen, &all->risen_capacity, all->risen_count + made->chunks.risen_count,
                                sizeof *all->risen)))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu pieces", all->count);
    if (!status) {
        if (made->chunks.count)
            memcpy(all->chunk + all->count, made->chunks.chunk, made->chunks.count * sizeof *all->chunk);
        if (made->chunks.risen_count)
            memcpy(all->risen + all->risen_count, made->chunks.risen, made->chunks.risen_count * sizeof *all->risen);
        all->count += made->chunks.count;
        all->risen_count += made->chunks.risen_count;
        for (size_t i = 0; i < made->chunks.count; i++)
            strl_bricks_deinit(&made->sets[i]);
        made->chunks.count = 0; /* theirs now */
    }
    release(made);
    if (!status)
        status = strl_samples_note(stage, pieces, risen, err);
    return status ? status : strl__build_report(stage->context, stage->done, stage->ingest->triangle_count, err);
}

strl_status strl_chunks_make(strl_sample_stage *stage, strl_error *err)
{
    uint64_t largest = 0;
    strl_status status = STRL_OK;
    for (uint32_t i = stage->finished; i < stage->buckets->count && !status; i++) {
        uint64_t bytes = strl_spill_bytes(stage->buckets->spill[i]);
        largest = bytes > largest ? bytes : largest;
        status = strl_spill_flush(stage->buckets->spill[i], err);
    }
    unsigned window = strl__ingest_window(stage->context, TIMES_OF_BUCKET * largest);
    unsigned slots = strl_pool_window(stage->context->pool, window);
    chunk_job job = {stage, strl__alloc_zero(slots, sizeof *job.slots), stage->finished};
    if (!status && !job.slots)
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory to sample");
    if (!status)
        status = strl_pool_ordered(stage->context->pool, stage->buckets->count - stage->finished, window, work, finish,
                                   &job, NULL, err);
    for (unsigned i = 0; job.slots && i < slots; i++)
        release(&job.slots[i]);
    strl__free(job.slots);
    return status ? status : strl_spill_flush(stage->bricks, err);
}
