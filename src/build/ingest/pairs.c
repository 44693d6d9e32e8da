/* Pairs (position, cell) in scratch, until all cells of a position are known. */
#include <stdio.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"
#include "build/ingest/internal.h"
#include "store/pack.h"

#define PIECE_BYTES 512u /* appended to a stream at once */
/* In memory; a connected surface has about 7 pairs for 8 triangles. */
#define PAIR_BYTES_OF_TRIANGLE (sizeof(pair) * 7 / 8)

typedef struct pair_models {
    strl_pack_points position;
    strl_pack_model cell;
    uint32_t last_cell;
} pair_models;

struct pair_packing {
    pair_models models;
    strl_packer packer;
    strl_writer bytes; /* not appended yet */
};

strl_status strl__pair_spills_open(strl_build_context *context, uint64_t triangles, pair_spills *pairs, strl_error *err)
{
    uint64_t bytes = triangles * PAIR_BYTES_OF_TRIANGLE, each = strl__bucket_bytes(context) / 4;
    pairs->count = 1;
    while (pairs->count < 256 && bytes / pairs->count > each)
        pairs->count *= 2;
    pairs->stream = strl__alloc_zero(pairs->count, sizeof *pairs->stream);
    if (!pairs->stream)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %u spills", pairs->count);
    strl_status status = STRL_OK;
    for (uint32_t i = 0; i < pairs->count && !status; i++) {
        pair_spill *stream = &pairs->stream[i];
        char name[32];
        snprintf(name, sizeof name, "pairs-%03u", i);
        stream->packing = strl__alloc_zero(1, sizeof *stream->packing);
        if (!stream->packing)
            return strl__fail(err, STRL_ERR_MEMORY, "no memory for %u spills", pairs->count);
        strl_pack_points_init(&stream->packing->models.position);
        stream->packing->packer.out = &stream->packing->bytes;
        status = strl_spill_open(context->spills, name, 32u << 10, &stream->spill, err);
    }
    return status;
}

static strl_status append_bytes(pair_spill *stream, strl_error *err)
{
    strl_writer *bytes = &stream->packing->bytes;
    if (bytes->failed)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to pack positions");
    strl_status status = strl_spill_append(stream->spill, bytes->data, bytes->size, err);
    bytes->size = 0;
    return status;
}

strl_status strl__pair_spills_append(pair_spills *pairs, const pair *added, strl_error *err)
{
    const uint32_t *position = added->position;
    uint64_t hash = strl__mix64(((uint64_t)position[0] << 32 | position[1]) ^ strl__mix64(position[2] + 1));
    pair_spill *stream = &pairs->stream[(uint32_t)(hash >> 40) & (pairs->count - 1)];
    pair_models *models = &stream->packing->models;
    strl_pack(&stream->packing->packer, &models->cell, added->cell - models->last_cell);
    strl_pack_point(&stream->packing->packer, &models->position, position);
    models->last_cell = added->cell;
    stream->count++;
    const strl_writer *bytes = &stream->packing->bytes;
    return bytes->size < PIECE_BYTES && !bytes->failed ? STRL_OK : append_bytes(stream, err);
}

static void packing_destroy(struct pair_packing *packing)
{
    if (packing)
        strl__free(packing->bytes.data);
    strl__free(packing);
}

strl_status strl__pair_spills_flush(pair_spills *pairs, strl_error *err)
{
    strl_status status = STRL_OK;
    for (uint32_t i = 0; i < pairs->count && !status; i++) {
        pair_spill *stream = &pairs->stream[i];
        strl_pack_finish(&stream->packing->packer);
        status = append_bytes(stream, err);
        if (!status)
            status = strl_spill_flush(stream->spill, err);
        packing_destroy(stream->packing);
        stream->packing = NULL;
    }
    return status;
}

static bool unpack(const uint8_t *bytes, size_t size, pair *read, uint64_t count)
{
    strl_unpacker unpacker = strl_unpacker_make(bytes, size);
    pair_models models = {0};
    strl_pack_points_init(&models.position);
    for (uint64_t i = 0; i < count; i++) {
        models.last_cell += strl_unpack(&unpacker, &models.cell);
        strl_unpack_point(&unpacker, &models.position, read[i].position);
        read[i].cell = models.last_cell;
    }
    return !unpacker.failed;
}

strl_status strl__pair_spills_read(const pair_spills *pairs, uint32_t index, pair **read, size_t *count,
                                   strl_error *err)
{
    const pair_spill *stream = &pairs->stream[index];
    size_t size = (size_t)strl_spill_bytes(stream->spill);
    uint8_t *bytes = strl__alloc(size, 1);
    *count = (size_t)stream->count;
    *read = strl__alloc(*count, sizeof **read);
    strl_status status = bytes && *read
                             ? strl_spill_read(stream->spill, 0, bytes, size, err)
                             : strl__fail(err, STRL_ERR_MEMORY, "no memory to connect %zu positions", *count);
    if (!status && !unpack(bytes, size, *read, *count))
        status = strl__fail(err, STRL_ERR_INTERNAL, "a list of positions in scratch is damaged");
    strl__free(bytes);
    if (status) {
        strl__free(*read);
        *read = NULL;
    }
    return status;
}

strl_status strl__pair_spills_delete(pair_spills *pairs, uint32_t index, strl_error *err)
{
    strl_spill *spill = pairs->stream[index].spill;
    pairs->stream[index].spill = NULL; /* closed in any case */
    return strl_spill_close_and_delete(spill, err);
}

void strl__pair_spills_deinit(pair_spills *pairs)
{
    for (uint32_t i = 0; pairs->stream && i < pairs->count; i++) {
        strl_spill_close_and_delete(pairs->stream[i].spill, NULL);
        packing_destroy(pairs->stream[i].packing);
    }
    strl__free(pairs->stream);
    *pairs = (pair_spills){0};
}
