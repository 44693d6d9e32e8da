/* The container of a sample tree: bricks breadth first, those of the top from memory, those of the pieces from scratch.
 */
#include <inttypes.h>
#include <string.h>

#include "base/fail.h"
#include "build/model.h"
#include "build/samples/top.h"

typedef struct numbering {
    uint32_t *top;    /* [bricks of the top] their ids */
    uint32_t **piece; /* [chunks][runs] id of the first brick of each run */
    uint32_t depths, nodes;
} numbering;

/* Where an entry of the top stands for a piece, its bricks begin at the entry's depth. */
static uint32_t bricks_at(const strl_sample_stage *stage, const strl_brick *entry, uint32_t depth)
{
    if (entry->chunk == STRL_NO_CHUNK)
        return entry->depth == depth;
    const strl_chunk *chunk = &stage->chunks.chunk[entry->chunk];
    return depth >= entry->depth && depth - entry->depth < chunk->run_count ? chunk->run[depth - entry->depth].count
                                                                            : 0;
}

static void number_depth(const strl_sample_stage *stage, const strl_brick_set *set, uint32_t depth, numbering *ids)
{
    for (size_t i = 0; i < set->count; i++) {
        const strl_brick *entry = &set->brick[i];
        uint32_t count = bricks_at(stage, entry, depth);
        if (count && entry->chunk != STRL_NO_CHUNK)
            ids->piece[entry->chunk][depth - entry->depth] = ids->nodes;
        if (count && (entry->chunk == STRL_NO_CHUNK || depth == entry->depth))
            ids->top[i] = ids->nodes;
        ids->nodes += count;
    }
}

static strl_status number(const strl_sample_stage *stage, const strl_brick_set *set, numbering *ids, strl_error *err)
{
    size_t chunks = stage->chunks.count;
    ids->top = strl__alloc_zero(set->count, sizeof *ids->top);
    ids->piece = strl__alloc_zero(chunks, sizeof *ids->piece);
    bool good = ids->top && ids->piece;
    for (size_t i = 0; i < chunks && good; i++) {
        ids->piece[i] = strl__alloc_zero(stage->chunks.chunk[i].run_count, sizeof *ids->piece[i]);
        good = ids->piece[i] != NULL;
    }
    if (!good)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the numbers of %zu pieces", chunks);
    for (;; ids->depths++) {
        uint32_t before = ids->nodes;
        number_depth(stage, set, ids->depths, ids);
        if (ids->nodes == before)
            break;
    }
    return STRL_OK;
}

static void numbering_deinit(numbering *ids, size_t chunks)
{
    for (size_t i = 0; ids->piece && i < chunks; i++)
        strl__free(ids->piece[i]);
    strl__free(ids->piece);
    strl__free(ids->top);
}

typedef struct writing {
    const strl_sample_stage *stage;
    const strl_brick_set *set;
    const numbering *ids;
    strl_container_writer *writer;
    uint32_t *first_child; /* [bricks of the top] id, STRL_NONE where there is none */
    uint8_t *buffer;       /* of a run */
    size_t capacity;
    uint32_t next; /* id */
} writing;

static strl_status add_node(writing *w, strl_node *record, uint32_t depth, const void *payload, uint32_t bytes,
                            strl_error *err)
{
    record->level = w->ids->depths - 1 - depth;
    record->group = w->next++;
    if (strl_cone_is_empty(&record->cone)) /* it has no face, and the format no word for that */
        record->cone = (strl_cone){0};
    strl_status status = strl_container_writer_add_node(w->writer, record, payload, bytes, err);
    return status ? status : strl__build_report(w->stage->context, w->next, w->ids->nodes, err);
}

static strl_status write_top(writing *w, size_t index, strl_error *err)
{
    const strl_brick *brick = &w->set->brick[index];
    strl_node record = brick->record;
    record.parent = brick->parent == STRL_NO_BRICK ? STRL_NONE : w->ids->top[brick->parent];
    record.child_count = brick->child_count;
    record.first_child = w->first_child[index];
    return add_node(w, &record, brick->depth, w->set->bytes.data + brick->payload_at, brick->payload_bytes, err);
}

static strl_status write_head(writing *w, const strl_brick *entry, uint32_t run, const strl_stored_brick *head,
                              const void *payload, strl_error *err)
{
    const uint32_t *piece = w->ids->piece[entry->chunk];
    strl_node record = head->record;
    record.parent = run ? piece[run - 1] + head->parent : w->ids->top[entry->parent];
    record.first_child = record.child_count ? piece[run + 1] + head->first_child : STRL_NONE;
    return add_node(w, &record, entry->depth + run, payload, head->payload_bytes, err);
}

/* What comes from scratch names only what is there. */
static bool fits_runs(const strl_chunk *chunk, uint32_t run, const strl_stored_brick *head)
{
    uint32_t below = run + 1 < chunk->run_count ? chunk->run[run + 1].count : 0, children = head->record.child_count;
    return (run == 0 || head->parent < chunk->run[run - 1].count) &&
           (children == 0 || (children <= below && head->first_child <= below - children));
}

static strl_status write_run(writing *w, const strl_brick *entry, uint32_t index, strl_error *err)
{
    const strl_chunk *chunk = &w->stage->chunks.chunk[entry->chunk];
    const strl_stored_run *run = &chunk->run[index];
    if (!strl__grow(&w->buffer, &w->capacity, run->bytes, 1))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for bricks of %" PRIu64 " bytes", run->bytes);
    strl_status status = strl_spill_read(w->stage->bricks, run->at, w->buffer, run->bytes, err);
    strl_cursor cursor = strl_cursor_make(w->buffer, run->bytes);
    for (uint32_t i = 0; i < run->count && !status; i++) {
        strl_stored_brick head = {0};
        const uint8_t *bytes = strl_cursor_take(&cursor, sizeof head);
        if (bytes)
            memcpy(&head, bytes, sizeof head);
        const uint8_t *payload = strl_cursor_take(&cursor, head.payload_bytes);
        status =
            payload && fits_runs(chunk, index, &head)
                ? write_head(w, entry, index, &head, payload, err)
                : strl__fail(err, STRL_ERR_INTERNAL, "a brick of %u bytes does not fit its piece", head.payload_bytes);
    }
    strl_spill_drop(w->stage->bricks, run->at, run->bytes);
    return status;
}

/* Children of a brick lie next to each other; the first one of the set is the first to say so. */
static void find_first_children(writing *w)
{
    for (size_t i = w->set->count; i-- > 0;)
        w->first_child[i] = STRL_NONE;
    for (size_t i = w->set->count; i-- > 1;)
        w->first_child[w->set->brick[i].parent] = w->ids->top[i];
}

static strl_status write_bricks(writing *w, strl_error *err)
{
    strl_status status = STRL_OK;
    find_first_children(w);
    for (uint32_t depth = 0; depth < w->ids->depths && !status; depth++)
        for (size_t i = 0; i < w->set->count && !status; i++) {
            const strl_brick *entry = &w->set->brick[i];
            if (!bricks_at(w->stage, entry, depth))
                continue;
            status =
                entry->chunk == STRL_NO_CHUNK ? write_top(w, i, err) : write_run(w, entry, depth - entry->depth, err);
        }
    return status;
}

static strl_status write_tree(writing *w, strl_error *err)
{
    const strl_ingest *ingest = w->stage->ingest;
    strl_tree tree = {.structure = STRL_STRUCTURE_SAMPLES,
                      .step = ingest->step,
                      .node_count = w->ids->nodes,
                      .level_count = w->ids->depths,
                      .leaf_geometric = ingest->leaf_error};
    memcpy(tree.origin, ingest->origin, sizeof tree.origin);
    w->first_child = strl__alloc(w->set->count, sizeof *w->first_child);
    strl_status status = w->first_child ? strl_container_writer_begin_tree(w->writer, &tree, err)
                                        : strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu bricks", w->set->count);
    if (!status)
        status = write_bricks(w, err);
    if (!status)
        status = strl_container_writer_end_tree(w->writer, err);
    strl__free(w->first_child);
    strl__free(w->buffer);
    return status;
}

static strl_status write_into(strl_sample_stage *stage, const strl_brick_set *set, const numbering *ids,
                              strl_error *err)
{
    strl_container_writer *writer = NULL;
    strl_status status = strl__model_writer(stage->context, stage->ingest, &writer, err);
    return status ? status : write_tree(&(writing){.stage = stage, .set = set, .ids = ids, .writer = writer}, err);
}

static void fill_result(const strl_sample_stage *stage, const strl_brick_set *set, const numbering *ids)
{
    strl_build_result *result = stage->context->result;
    result->triangles_leaf += stage->triangles + set->triangles;
    result->vertices += stage->vertices + set->vertices;
    result->nodes += ids->nodes;
    result->groups += ids->nodes;
    result->levels = ids->depths > result->levels ? ids->depths : result->levels;
    result->root_triangles += set->brick[0].record.base_triangle_count;
}

strl_status strl_samples_write(strl_sample_stage *stage, strl_error *err)
{
    strl_brick_set set = {0};
    numbering ids = {0};
    strl_status status = strl_top_make(stage, &set, err);
    if (!status)
        status = number(stage, &set, &ids, err);
    if (!status) {
        fill_result(stage, &set, &ids);
        status = write_into(stage, &set, &ids, err);
    }
    numbering_deinit(&ids, stage->chunks.count);
    strl_bricks_deinit(&set);
    return status;
}
