/* Checkpoints of the builder `samples`: which buckets are finished, and what they have handed up. Their bricks are in a
 * stream. */
#include <math.h>

#include "base/fail.h"
#include "build/checkpoint.h"
#include "build/samples/chunk.h"
#include "build/saved.h"
#include "platform/thread.h"

/* Saved after so many parts of the buckets, or as much time: what is used up waits on disk for that. */
#define PARTS_OF_BUCKETS 32u
#define MOST_NS (UINT64_C(20) * 1000000000u)

#define CORNER_BYTES 24u
#define RISEN_BYTES (3 * CORNER_BYTES + 8)
#define CELL_BYTES 111u
#define RUN_BYTES 20u
#define MOST_RUNS 4096u
#define MOST_BELOW 64u /* cells over each other */

/* ---- writing ---- */

static strl_status save(strl_sample_stage *stage, strl_error *err)
{
    strl_writer words = {0};
    strl_writer_u32(&words, stage->finished);
    strl_writer_u64(&words, stage->triangles);
    strl_writer_u64(&words, stage->vertices);
    strl_status status = strl__checkpoint_write(stage->context, &words, err);
    strl__free(words.data);
    stage->saved = stage->finished;
    stage->saved_at_ns = strl_clock_ns();
    return status;
}

strl_status strl_samples_begin(strl_sample_stage *stage, strl_error *err)
{
    strl_build_context *context = stage->context;
    strl_status status = strl__build_open_stream(context, "bricks", &stage->bricks, err);
    if (status || !context->keep)
        return status;
    status = strl_buckets_save(context, stage->ingest, stage->buckets, err);
    if (!status)
        status = strl__build_open_stream(context, "pieces", &stage->pieces, err);
    return status ? status : save(stage, err);
}

static void write_risen(const strl_risen *risen, strl_writer *writer)
{
    for (int c = 0; c < 3; c++) {
        const strl_soup_corner *corner = &risen->triangle.corner[c];
        for (int k = 0; k < 3; k++)
            strl_writer_u32(writer, corner->position[k]);
        strl_writer_u16(writer, corner->normal[0]);
        strl_writer_u16(writer, corner->normal[1]);
        strl_writer_u32(writer, corner->colour);
        strl_writer_u32(writer, corner->texcoord);
    }
    strl_writer_u32(writer, risen->triangle.palette);
    strl_writer_f32(writer, risen->weight);
}

/* Which its children are follows from the order of all. */
static void write_cell(const strl_octant *cell, strl_writer *writer)
{
    strl_writer_u64(writer, cell->prefix);
    strl_writer_u8(writer, (uint8_t)cell->depth);
    strl_writer_u8(writer, (uint8_t)(cell->is_leaf | cell->is_large << 1));
    strl_writer_u8(writer, (uint8_t)cell->child_count);
    strl_writer_f32(writer, cell->extent);
    strl_writer_u32(writer, cell->total);
    strl_writer_u32(writer, cell->item_count);
    strl_writer_f64(writer, cell->sums.area);
    for (int k = 0; k < 4; k++)
        strl_writer_f64(writer, cell->sums.linear[k]);
    for (int k = 0; k < 3; k++)
        strl_writer_f64(writer, cell->sums.normal[k]);
    for (int k = 0; k < 3; k++)
        strl_writer_f64(writer, cell->sums.centre[k]);
}

static strl_status write_piece(const strl_chunk *piece, strl_saved_writer *saved, strl_error *err)
{
    strl_status status = STRL_OK;
    write_cell(&piece->root, &saved->bytes);
    strl_writer_u32(&saved->bytes, piece->below_count);
    for (uint32_t i = 0; i < piece->below_count && !status; i++) {
        write_cell(&piece->below[i], &saved->bytes);
        status = strl_saved_put(saved, err);
    }
    strl_writer_u32(&saved->bytes, piece->run_count);
    for (uint32_t i = 0; i < piece->run_count; i++) {
        strl_writer_u64(&saved->bytes, piece->run[i].at);
        strl_writer_u64(&saved->bytes, piece->run[i].bytes);
        strl_writer_u32(&saved->bytes, piece->run[i].count);
    }
    for (uint32_t i = 0; i < piece->item_count && !status; i++) {
        write_risen(&piece->item[i], &saved->bytes);
        status = strl_saved_put(saved, err);
    }
    return status;
}

static strl_status write_bucket(const strl_sample_stage *stage, size_t pieces, size_t risen, strl_error *err)
{
    const strl_chunks *all = &stage->chunks;
    strl_saved_writer saved = {.spill = stage->pieces};
    strl_status status = STRL_OK;
    strl_writer_u32(&saved.bytes, (uint32_t)pieces);
    strl_writer_u32(&saved.bytes, (uint32_t)risen);
    for (size_t i = all->count - pieces; i < all->count && !status; i++)
        status = write_piece(&all->chunk[i], &saved, err);
    for (size_t i = all->risen_count - risen; i < all->risen_count && !status; i++) {
        write_risen(&all->risen[i], &saved.bytes);
        status = strl_saved_put(&saved, err);
    }
    return strl_saved_finish(&saved, status, err);
}

strl_status strl_samples_note(strl_sample_stage *stage, size_t pieces, size_t risen, strl_error *err)
{
    stage->finished++;
    if (!stage->pieces)
        return STRL_OK;
    strl_status status = write_bucket(stage, pieces, risen, err);
    bool is_due = stage->finished == stage->buckets->count ||
                  stage->finished - stage->saved > stage->buckets->count / PARTS_OF_BUCKETS ||
                  strl_clock_ns() - stage->saved_at_ns >= MOST_NS;
    return status || !is_due ? status : save(stage, err);
}

/* ---- reading ---- */

static strl_status read_risen(const strl_sample_stage *stage, strl_saved_reader *saved, strl_risen *risen,
                              strl_error *err)
{
    strl_status status = strl_saved_get(saved, RISEN_BYTES, err);
    if (status)
        return status;
    for (int c = 0; c < 3; c++) {
        strl_soup_corner *corner = &risen->triangle.corner[c];
        for (int k = 0; k < 3; k++)
            corner->position[k] = strl_cursor_u32(&saved->cursor);
        corner->normal[0] = strl_cursor_u16(&saved->cursor);
        corner->normal[1] = strl_cursor_u16(&saved->cursor);
        corner->colour = strl_cursor_u32(&saved->cursor);
        corner->texcoord = strl_cursor_u32(&saved->cursor);
    }
    risen->triangle.palette = strl_cursor_u32(&saved->cursor);
    risen->weight = strl_cursor_f32(&saved->cursor);
    if (!strl__soup_is_sound(stage->ingest, &risen->triangle) || !(risen->weight >= 0 && isfinite(risen->weight)))
        return strl_saved_fail("a triangle of a piece", err);
    risen->key = strl__curve_key_of_triangle(stage->ingest, &risen->triangle);
    risen->limit = strl_octree_limit(stage->ingest, &risen->triangle, risen->key);
    return STRL_OK;
}

/* Means of a splat are numbers: colours from 0 on, and a place among those of the lattice. */
static bool read_sums(strl_cursor *cursor, strl_splat_sums *sums)
{
    sums->area = strl_cursor_f64(cursor);
    bool good = sums->area >= 0 && isfinite(sums->area);
    for (int k = 0; k < 4; k++) {
        sums->linear[k] = strl_cursor_f64(cursor);
        good &= sums->linear[k] >= 0 && isfinite(sums->linear[k]);
    }
    for (int k = 0; k < 3; k++) {
        sums->normal[k] = strl_cursor_f64(cursor);
        good &= isfinite(sums->normal[k]) != 0;
    }
    for (int k = 0; k < 3; k++) {
        sums->centre[k] = strl_cursor_f64(cursor);
        good &= sums->centre[k] >= 0 && sums->centre[k] <= ldexp(sums->area, 32);
    }
    return good;
}

static strl_status read_cell(strl_saved_reader *saved, strl_octant *cell, strl_error *err)
{
    *cell = (strl_octant){.chunk = STRL_NO_CHUNK};
    strl_status status = strl_saved_get(saved, CELL_BYTES, err);
    if (status)
        return status;
    cell->prefix = strl_cursor_u64(&saved->cursor);
    cell->depth = strl_cursor_u8(&saved->cursor);
    unsigned flags = strl_cursor_u8(&saved->cursor);
    cell->child_count = strl_cursor_u8(&saved->cursor);
    cell->extent = strl_cursor_f32(&saved->cursor);
    cell->total = strl_cursor_u32(&saved->cursor);
    cell->item_count = strl_cursor_u32(&saved->cursor);
    cell->is_leaf = flags & 1;
    cell->is_large = flags >> 1 & 1;
    bool good = read_sums(&saved->cursor, &cell->sums) && cell->depth <= STRL_OCTREE_DEPTH &&
                cell->prefix >> 3 * cell->depth == 0 && flags < 4 &&
                cell->child_count <= (cell->is_leaf ? 0 : STRL_OCTANT_MAX_CHILDREN) && cell->extent >= 0 &&
                isfinite(cell->extent);
    return good ? STRL_OK : strl_saved_fail("a cell of a piece", err);
}

/* As they were handed up: children side by side, then what is below the first of them. False where there are not so
 * many. */
static bool find_children(strl_chunk *piece, strl_octant *above, uint32_t level, uint32_t *next)
{
    uint32_t first = *next, count = above->child_count;
    if (count > piece->below_count - first || level > MOST_BELOW)
        return false;
    *next += count;
    bool good = true;
    for (uint32_t i = 0; i < count && good; i++) {
        above->child[i] = first + i;
        good = find_children(piece, &piece->below[first + i], level + 1, next);
    }
    return good;
}

static strl_status read_below(strl_saved_reader *saved, strl_chunk *piece, strl_error *err)
{
    strl_status status = strl_saved_get(saved, 4, err);
    uint32_t count = status ? 0 : strl_cursor_u32(&saved->cursor), next = 0;
    if (!status && count > strl_saved_left(saved) / CELL_BYTES)
        status = strl_saved_fail("the cells of a piece", err);
    if (status)
        return status;
    piece->below = strl__alloc(count, sizeof *piece->below);
    if (!piece->below)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %u cells", count);
    piece->below_capacity = count;
    for (; piece->below_count < count && !status; piece->below_count++)
        status = read_cell(saved, &piece->below[piece->below_count], err);
    if (!status && (!find_children(piece, &piece->root, 0, &next) || next != count))
        status = strl_saved_fail("the cells of a piece", err);
    return status;
}

static strl_status read_root(strl_saved_reader *saved, strl_chunk *piece, strl_error *err)
{
    const strl_octant *root = &piece->root;
    strl_status status = read_cell(saved, &piece->root, err);
    if (!status)
        status = read_below(saved, piece, err);
    if (!status)
        status = strl_saved_get(saved, 4, err);
    if (status)
        return status;
    piece->run_count = strl_cursor_u32(&saved->cursor);
    piece->key = root->prefix << 3 * (STRL_OCTREE_DEPTH - root->depth);
    return (piece->run_count == 0) == root->is_leaf && piece->run_count <= MOST_RUNS
               ? STRL_OK
               : strl_saved_fail("the root of a piece", err);
}

/* And the record of the first brick, which is one alone. */
static strl_status read_runs(const strl_sample_stage *stage, strl_saved_reader *saved, strl_chunk *piece,
                             strl_error *err)
{
    uint64_t bricks = strl_spill_bytes(stage->bricks);
    strl_stored_brick first;
    strl_status status = strl_saved_get(saved, (uint64_t)piece->run_count * RUN_BYTES, err);
    if (status || !piece->run_count)
        return status;
    piece->run = strl__alloc(piece->run_count, sizeof *piece->run);
    if (!piece->run)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for bricks of %u depths", piece->run_count);
    for (uint32_t i = 0; i < piece->run_count; i++) {
        strl_stored_run *run = &piece->run[i];
        run->at = strl_cursor_u64(&saved->cursor);
        run->bytes = strl_cursor_u64(&saved->cursor);
        run->count = strl_cursor_u32(&saved->cursor);
        if (run->at > bricks || run->bytes > bricks - run->at || run->count == 0 ||
            run->count > run->bytes / sizeof first || (i == 0 && run->count > 1))
            return strl_saved_fail("the bricks of a piece", err);
    }
    status = strl_spill_read(stage->bricks, piece->run[0].at, &first, sizeof first, err);
    piece->first = first.record;
    return status;
}

static strl_status read_piece(strl_sample_stage *stage, strl_saved_reader *saved, strl_error *err)
{
    strl_chunks *all = &stage->chunks;
    if (!strl__grow(&all->chunk, &all->capacity, all->count + 1, sizeof *all->chunk))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu pieces", all->count);
    strl_chunk *piece = &all->chunk[all->count++];
    *piece = (strl_chunk){0};
    strl_status status = read_root(saved, piece, err);
    if (!status)
        status = read_runs(stage, saved, piece, err);
    if (!status && piece->root.item_count > strl_saved_left(saved) / RISEN_BYTES)
        status = strl_saved_fail("the triangles of a piece", err);
    if (status)
        return status;
    piece->item = strl__alloc(piece->root.item_count, sizeof *piece->item);
    if (!piece->item)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a root of %u triangles", piece->root.item_count);
    for (; piece->item_count < piece->root.item_count && !status; piece->item_count++)
        status = read_risen(stage, saved, &piece->item[piece->item_count], err);
    return status;
}

static strl_status read_bucket(strl_sample_stage *stage, strl_saved_reader *saved, strl_error *err)
{
    strl_chunks *all = &stage->chunks;
    strl_status status = strl_saved_get(saved, 8, err);
    uint32_t pieces = status ? 0 : strl_cursor_u32(&saved->cursor),
             risen = status ? 0 : strl_cursor_u32(&saved->cursor);
    for (uint32_t i = 0; i < pieces && !status; i++)
        status = read_piece(stage, saved, err);
    if (!status && risen > strl_saved_left(saved) / RISEN_BYTES)
        status = strl_saved_fail("the large triangles", err);
    if (!status && !strl__grow(&all->risen, &all->risen_capacity, all->risen_count + risen, sizeof *all->risen))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for %u large triangles", risen);
    for (uint32_t i = 0; i < risen && !status; i++)
        status = read_risen(stage, saved, &all->risen[all->risen_count++], err);
    return status;
}

static uint64_t last_key(const strl_chunk *piece)
{
    return piece->key + (((uint64_t)1 << 3 * (STRL_OCTREE_DEPTH - piece->root.depth)) - 1);
}

/* Pieces lie one after the other, but for those of one smallest cell; risen triangles in the order of the curve, and
 * where they lie in a piece's cell, it does not hold them. The top of the tree ends for no other. */
static bool are_in_order(const strl_chunks *all)
{
    for (size_t i = 1; i < all->count; i++) {
        const strl_chunk *before = &all->chunk[i - 1], *piece = &all->chunk[i];
        bool is_share = piece->key == before->key && piece->root.depth == STRL_OCTREE_DEPTH &&
                        before->root.depth == STRL_OCTREE_DEPTH;
        if (!is_share && piece->key <= last_key(before))
            return false;
    }
    for (size_t i = 0, c = 0; i < all->risen_count; i++) {
        const strl_risen *risen = &all->risen[i];
        while (c < all->count && last_key(&all->chunk[c]) < risen->key)
            c++;
        if ((i && risen->key < risen[-1].key) ||
            (c < all->count && all->chunk[c].key <= risen->key && risen->limit >= all->chunk[c].root.depth))
            return false;
    }
    return true;
}

/* No triangle is lost or told twice; so there is something to make a tree of once all buckets are finished. */
static bool are_all_there(const strl_sample_stage *stage)
{
    const strl_chunks *all = &stage->chunks;
    uint64_t count = all->risen_count;
    for (size_t i = 0; i < all->count; i++)
        count += all->chunk[i].root.total;
    return count == stage->done;
}

static strl_status read_pieces(strl_sample_stage *stage, strl_error *err)
{
    strl_saved_reader saved = {.spill = stage->pieces};
    strl_status status = STRL_OK;
    for (uint32_t i = 0; i < stage->finished && !status; i++)
        status = read_bucket(stage, &saved, err);
    if (!status && (strl_saved_left(&saved) || !are_all_there(stage) || !are_in_order(&stage->chunks)))
        status = strl_saved_fail("the pieces of the tree", err);
    strl_saved_reader_deinit(&saved);
    return status;
}

strl_status strl_samples_restore(strl_sample_stage *stage, strl_ingest *ingest, strl_error *err)
{
    strl_build_context *context = stage->context;
    strl_cursor words = strl_cursor_make(context->resumed.data, context->resumed.size);
    uint32_t finished = strl_cursor_u32(&words);
    stage->triangles = strl_cursor_u64(&words);
    stage->vertices = strl_cursor_u64(&words);
    strl_status status =
        words.failed || strl_cursor_left(&words) ? strl_saved_fail("how far it had come", err) : STRL_OK;
    if (!status)
        status = strl_buckets_restore(context, finished, ingest, stage->buckets, err);
    if (status)
        return status;
    stage->finished = stage->saved = finished;
    stage->saved_at_ns = strl_clock_ns();
    stage->done = ingest->triangle_count;
    for (uint32_t i = finished; i < stage->buckets->count; i++)
        stage->done -= strl_spill_bytes(stage->buckets->spill[i]) / strl__soup_bucket_bytes(ingest);
    status = strl_spill_take(context->spills, "bricks", &stage->bricks, err);
    if (!status)
        status = strl_spill_take(context->spills, "pieces", &stage->pieces, err);
    return status ? status : read_pieces(stage, err);
}
