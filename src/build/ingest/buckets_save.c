/* Buckets in a checkpoint: where they begin; their triangles are streams that are there. */
#include "base/fail.h"
#include "base/memory.h"
#include "build/ingest/internal.h"
#include "build/saved.h"

#define SPLITTER_BYTES 8u

static strl_status write_splitters(const strl_buckets *buckets, strl_saved_writer *saved, strl_error *err)
{
    strl_status status = STRL_OK;
    strl_writer_u32(&saved->bytes, buckets->count);
    for (uint32_t i = 0; i + 1 < buckets->count && !status; i++) {
        strl_writer_u64(&saved->bytes, buckets->splitter[i]);
        status = strl_saved_put(saved, err);
    }
    return status;
}

strl_status strl_buckets_save(strl_build_context *context, const strl_ingest *ingest, const strl_buckets *buckets,
                              strl_error *err)
{
    strl_saved_writer saved = {0};
    strl_status status = strl__ingest_save_facts(context, ingest, err);
    if (!status)
        status = strl__build_open_stream(context, "buckets", &saved.spill, err);
    return status ? status : strl_saved_finish(&saved, write_splitters(buckets, &saved, err), err);
}

static strl_status read_splitters(strl_saved_reader *saved, strl_buckets *buckets, strl_error *err)
{
    strl_status status = strl_saved_get(saved, 4, err);
    uint32_t count = status ? 0 : strl_cursor_u32(&saved->cursor);
    if (!status &&
        (count < 1 || count > MAX_BUCKETS || strl_saved_left(saved) != (uint64_t)(count - 1) * SPLITTER_BYTES))
        status = strl_saved_fail("the number of buckets", err);
    if (!status)
        status = strl_saved_get(saved, (uint64_t)(count - 1) * SPLITTER_BYTES, err);
    if (status)
        return status;
    buckets->splitter = strl__alloc(count, sizeof *buckets->splitter);
    buckets->spill = strl__alloc_zero(count, sizeof(strl_spill *));
    if (!buckets->splitter || !buckets->spill)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %u buckets", count);
    buckets->count = count;
    for (uint32_t i = 0; i + 1 < count; i++) {
        buckets->splitter[i] = strl_cursor_u64(&saved->cursor);
        if (buckets->splitter[i] >> 3 * 21 || (i && buckets->splitter[i] < buckets->splitter[i - 1]))
            return strl_saved_fail("the borders of the buckets", err);
    }
    return STRL_OK;
}

strl_status strl_buckets_restore(strl_build_context *context, uint32_t first, strl_ingest *ingest,
                                 strl_buckets *buckets, strl_error *err)
{
    strl_saved_reader saved = {0};
    uint64_t left = 0;
    *buckets = (strl_buckets){.shares_keys = true};
    strl_status status = strl__ingest_restore_facts(context, false, ingest, err);
    if (!status)
        status = strl_spill_take(context->spills, "buckets", &saved.spill, err);
    if (!status)
        status = read_splitters(&saved, buckets, err);
    strl_saved_reader_deinit(&saved);
    if (!status && first > buckets->count)
        status = strl_saved_fail("how many buckets are used up", err);
    for (uint32_t i = first; i < buckets->count && !status; i++) {
        char name[24];
        strl__bucket_name(i, name);
        status = strl_spill_take(context->spills, name, &buckets->spill[i], err);
        if (!status && strl_spill_bytes(buckets->spill[i]) % strl__soup_bucket_bytes(ingest))
            status = strl_saved_fail("the triangles of a bucket", err);
        left += status ? 0 : strl_spill_bytes(buckets->spill[i]) / strl__soup_bucket_bytes(ingest);
    }
    if (!status && (left > ingest->triangle_count || (first == 0 && left < ingest->triangle_count)))
        status = strl_saved_fail("the number of triangles", err);
    return status;
}
