/* Positions that several clusters have, handed to each of them. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "build/clusters/hierarchy.h"

#define CHUNK_WORDS (64u << 10)

/* Buffered reading of a spill of 32-bit words. */
typedef struct word_reader {
    strl_spill *spill;
    uint64_t at, end; /* words */
    uint32_t *buffer;
    uint32_t have, used;
} word_reader;

static strl_status next_word(word_reader *reader, uint32_t *word, strl_error *err)
{
    if (reader->used == reader->have) {
        uint64_t left = reader->end - reader->at;
        reader->have = left < CHUNK_WORDS ? (uint32_t)left : CHUNK_WORDS;
        reader->used = 0;
        if (!reader->have)
            return strl__fail(err, STRL_ERR_INTERNAL, "the list of shared positions is cut off");
        strl_status status =
            strl_spill_read(reader->spill, reader->at * 4, reader->buffer, (size_t)reader->have * 4, err);
        if (status)
            return status;
        reader->at += reader->have;
    }
    *word = reader->buffer[reader->used++];
    return STRL_OK;
}

static strl_status next_cell(word_reader *reader, uint32_t cells, uint32_t *cell, strl_error *err)
{
    strl_status status = next_word(reader, cell, err);
    return status || *cell < cells ? status
                                   : strl__fail(err, STRL_ERR_INTERNAL,
                                                "a shared position is in cell %" PRIu32 " of %" PRIu32, *cell, cells);
}

typedef struct distributor {
    const strl_hierarchy *hierarchy;
    strl_leaf_shares *shares;
    uint32_t *cells, *clusters, *words; /* of the position at hand */
    size_t cell_capacity, cluster_capacity, word_capacity;
    uint32_t cluster_count;
} distributor;

static uint32_t bucket_of_cluster(const strl_leaf_shares *shares, uint32_t cluster)
{
    uint32_t low = 0, high = shares->bucket_count - 1;
    while (low < high) {
        uint32_t middle = (low + high + 1) / 2;
        if (cluster >= shares->bucket_first[middle])
            low = middle;
        else
            high = middle - 1;
    }
    return low;
}

static bool list_clusters(distributor *d, uint32_t cell_count)
{
    d->cluster_count = 0;
    if (!strl__grow(&d->clusters, &d->cluster_capacity, cell_count, sizeof *d->clusters))
        return false;
    for (uint32_t i = 0; i < cell_count; i++) { /* insertion into an ascending list */
        uint32_t cluster = d->hierarchy->partition->cluster[d->cells[i]], at = d->cluster_count;
        while (at > 0 && d->clusters[at - 1] > cluster)
            at--;
        if (at > 0 && d->clusters[at - 1] == cluster)
            continue;
        memmove(d->clusters + at + 1, d->clusters + at, (d->cluster_count - at) * sizeof *d->clusters);
        d->clusters[at] = cluster;
        d->cluster_count++;
    }
    return true;
}

/* Where normals are computed, a cluster reads the cells of others round its positions. */
static void note_readers(distributor *d, uint32_t cell_count)
{
    uint32_t last = d->clusters[d->cluster_count - 1], *last_reader = d->shares->last_reader;
    for (uint32_t i = 0; i < cell_count && d->hierarchy->ingest->lacks_normals; i++)
        if (last_reader[d->cells[i]] < last)
            last_reader[d->cells[i]] = last;
}

/* Returns how many there are; 0 where they are too many. */
static uint32_t list_cells_outside(const distributor *d, uint32_t cluster, uint32_t cell_count,
                                   uint32_t cells[STRL_HALO_CELLS])
{
    uint32_t count = 0;
    for (uint32_t k = 0; k < cell_count; k++) {
        if (d->hierarchy->partition->cluster[d->cells[k]] == cluster)
            continue;
        if (count == STRL_HALO_CELLS)
            return 0;
        cells[count++] = d->cells[k];
    }
    return count;
}

static strl_status hand_out(distributor *d, const uint32_t position[3], uint32_t cell_count, strl_error *err)
{
    strl_status status = STRL_OK;
    for (uint32_t i = 0; i < d->cluster_count && !status; i++) {
        uint32_t cluster = d->clusters[i], size = 0;
        if (!strl__grow(&d->words, &d->word_capacity, 6 + (size_t)d->cluster_count + STRL_HALO_CELLS, sizeof *d->words))
            return strl__fail(err, STRL_ERR_MEMORY, "no memory for a position in %u cells", cell_count);
        d->words[size++] = cluster;
        memcpy(d->words + size, position, 12);
        size += 3;
        d->words[size++] = d->cluster_count - 1;
        for (uint32_t k = 0; k < d->cluster_count; k++)
            if (k != i)
                d->words[size++] = d->clusters[k];
        uint32_t *cells = d->words + size + 1, outside = list_cells_outside(d, cluster, cell_count, cells);
        d->words[size] = outside;
        size += 1 + outside;
        status =
            strl_spill_append(d->shares->spill[bucket_of_cluster(d->shares, cluster)], d->words, (size_t)size * 4, err);
    }
    return status;
}

static strl_status open_buckets(const strl_hierarchy *hierarchy, strl_leaf_shares *shares, strl_error *err)
{
    uint32_t clusters = 1u << hierarchy->partition->depth;
    uint64_t bytes = strl_spill_bytes(hierarchy->ingest->shared) * 3, each = hierarchy->context->memory_bytes / 32;
    uint64_t wanted = bytes / each + 1;
    shares->bucket_count = wanted > 256 ? 256 : (uint32_t)wanted;
    if (shares->bucket_count > clusters)
        shares->bucket_count = clusters;
    shares->bucket_first = strl__alloc((size_t)shares->bucket_count + 1, sizeof *shares->bucket_first);
    shares->spill = strl__alloc_zero(shares->bucket_count, sizeof(strl_spill *));
    if (!shares->bucket_first || !shares->spill)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %u streams", shares->bucket_count);
    strl_status status = STRL_OK;
    for (uint32_t i = 0; i <= shares->bucket_count; i++)
        shares->bucket_first[i] = (uint32_t)((uint64_t)clusters * i / shares->bucket_count);
    for (uint32_t i = 0; i < shares->bucket_count && !status; i++) {
        char name[32];
        snprintf(name, sizeof name, "shares-%03u", i);
        status = strl_spill_open(hierarchy->context->spills, name, 32u << 10, &shares->spill[i], err);
    }
    return status;
}

strl_status strl_leaf_shares_create(const strl_hierarchy *hierarchy, strl_leaf_shares *shares, strl_error *err)
{
    distributor d = {.hierarchy = hierarchy, .shares = shares};
    word_reader reader = {.spill = hierarchy->ingest->shared, .end = strl_spill_bytes(hierarchy->ingest->shared) / 4};
    *shares = (strl_leaf_shares){0};
    reader.buffer = strl__alloc(CHUNK_WORDS, sizeof *reader.buffer);
    shares->last_reader = strl__alloc(hierarchy->ingest->cell_count, sizeof *shares->last_reader);
    strl_status status = reader.buffer && shares->last_reader
                             ? open_buckets(hierarchy, shares, err)
                             : strl__fail(err, STRL_ERR_MEMORY, "no memory to read shared positions");
    if (!status)
        memcpy(shares->last_reader, hierarchy->partition->cluster,
               hierarchy->ingest->cell_count * sizeof *shares->last_reader);
    while (!status && (reader.at < reader.end || reader.used < reader.have)) {
        uint32_t head[4] = {0};
        for (int i = 0; i < 4 && !status; i++)
            status = next_word(&reader, &head[i], err);
        if (!status && head[3] > hierarchy->ingest->cell_count)
            status = strl__fail(err, STRL_ERR_INTERNAL, "a shared position is in %u cells of %u", head[3],
                                hierarchy->ingest->cell_count);
        if (!status && !strl__grow(&d.cells, &d.cell_capacity, head[3], sizeof *d.cells))
            status = strl__fail(err, STRL_ERR_MEMORY, "no memory for a position in %u cells", head[3]);
        for (uint32_t i = 0; i < head[3] && !status; i++)
            status = next_cell(&reader, hierarchy->ingest->cell_count, &d.cells[i], err);
        if (!status && !list_clusters(&d, head[3]))
            status = strl__fail(err, STRL_ERR_MEMORY, "no memory for a position in %u cells", head[3]);
        if (!status && d.cluster_count > 1) {
            note_readers(&d, head[3]);
            status = hand_out(&d, head, head[3], err);
        }
    }
    for (uint32_t i = 0; i < shares->bucket_count && !status; i++)
        status = strl_spill_flush(shares->spill[i], err);
    strl__free(reader.buffer);
    strl__free(d.cells);
    strl__free(d.clusters);
    strl__free(d.words);
    return status;
}

void strl_leaf_shares_deinit(strl_leaf_shares *shares)
{
    for (uint32_t i = 0; shares->spill && i < shares->bucket_count; i++)
        strl_spill_close_and_delete(shares->spill[i], NULL);
    strl__free(shares->bucket_first);
    strl__free(shares->spill);
    strl__free(shares->last_reader);
    *shares = (strl_leaf_shares){0};
}
