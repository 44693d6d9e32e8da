/* The partition in a checkpoint: where clusters begin, then their cells. */
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "build/clusters/partition.h"
#include "build/saved.h"

static strl_status write_words(strl_saved_writer *saved, const uint32_t *words, size_t count, strl_error *err)
{
    strl_status status = STRL_OK;
    for (size_t i = 0; i < count && !status; i++) {
        strl_writer_u32(&saved->bytes, words[i]);
        status = strl_saved_put(saved, err);
    }
    return status;
}

strl_status strl_partition_save(strl_build_context *context, const strl_ingest *ingest, const strl_partition *partition,
                                strl_error *err)
{
    strl_saved_writer saved = {0};
    strl_status status = strl__build_open_stream(context, "partition", &saved.spill, err);
    if (status)
        return status;
    strl_writer_u32(&saved.bytes, partition->depth);
    status = write_words(&saved, partition->cluster_first, ((size_t)1 << partition->depth) + 1, err);
    if (!status)
        status = write_words(&saved, partition->cell, ingest->cell_count, err);
    return strl_saved_finish(&saved, status, err);
}

static strl_status read_words(strl_saved_reader *saved, uint32_t *words, size_t count, strl_error *err)
{
    strl_status status = STRL_OK;
    for (size_t i = 0; i < count && !status; i++) {
        status = strl_saved_get(saved, 4, err);
        words[i] = status ? 0 : strl_cursor_u32(&saved->cursor);
    }
    return status;
}

/* Fills cluster[]; every cell must be in one cluster, and a cluster must fit a node. */
static bool name_clusters(const strl_ingest *ingest, strl_partition *partition)
{
    uint32_t clusters = 1u << partition->depth, cells = ingest->cell_count;
    if (partition->cluster_first[0] != 0 || partition->cluster_first[clusters] != cells)
        return false;
    for (uint32_t i = 0; i < clusters; i++)
        if (partition->cluster_first[i] > partition->cluster_first[i + 1])
            return false;
    memset(partition->cluster, 0xff, cells * sizeof *partition->cluster);
    for (uint32_t i = 0; i < clusters; i++) {
        uint64_t triangles = 0;
        for (uint32_t c = partition->cluster_first[i]; c < partition->cluster_first[i + 1]; c++) {
            uint32_t cell = partition->cell[c];
            if (cell >= cells || partition->cluster[cell] != UINT32_MAX)
                return false;
            partition->cluster[cell] = i;
            triangles += ingest->cells[cell].count;
        }
        if (triangles == 0 || triangles > STRL_PM_MAX_TRIANGLES)
            return false;
    }
    return true;
}

static strl_status read_partition(strl_saved_reader *saved, const strl_ingest *ingest, strl_partition *partition,
                                  strl_error *err)
{
    uint32_t cells = ingest->cell_count;
    strl_status status = strl_saved_get(saved, 4, err);
    partition->depth = status ? 0 : strl_cursor_u32(&saved->cursor);
    bool fits = partition->depth == strl_partition_depth(ingest);
    uint64_t firsts = fits ? (UINT64_C(1) << partition->depth) + 1 : 0;
    if (!status && (!fits || strl_saved_left(saved) != (firsts + cells) * 4))
        status = strl_saved_fail("the number of clusters", err);
    if (status)
        return status;
    partition->cluster_first = strl__alloc((size_t)firsts, sizeof *partition->cluster_first);
    partition->cell = strl__alloc(cells, sizeof *partition->cell);
    partition->cluster = strl__alloc(cells, sizeof *partition->cluster);
    if (!partition->cluster_first || !partition->cell || !partition->cluster)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the clusters of %u cells", cells);
    status = read_words(saved, partition->cluster_first, (size_t)firsts, err);
    if (!status)
        status = read_words(saved, partition->cell, cells, err);
    return status || name_clusters(ingest, partition) ? status : strl_saved_fail("the cells of the clusters", err);
}

strl_status strl_partition_restore(strl_build_context *context, const strl_ingest *ingest, strl_partition *partition,
                                   strl_error *err)
{
    strl_saved_reader saved = {0};
    *partition = (strl_partition){0};
    strl_status status = strl_spill_take(context->spills, "partition", &saved.spill, err);
    if (!status)
        status = read_partition(&saved, ingest, partition, err);
    strl_saved_reader_deinit(&saved);
    return status;
}
