/* The builder `samples`: stages in order. */
#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "build/model.h"
#include "build/samples/chunk.h"

/* A front of 10,000 nodes is then right with more than 0.99 (Klein et al. 2005, 4.3). */
#define PROBABILITY (1 - 1e-6)

static strl_status begin(strl_sample_stage *stage, strl_ingest *ingest, strl_error *err)
{
    if (stage->context->resumed.size)
        return strl_samples_restore(stage, ingest, err);
    strl_status status = strl_ingest_begin(stage->context, true, ingest, stage->buckets, err);
    return status || ingest->triangle_count == 0 ? status : strl_samples_begin(stage, err);
}

strl_status strl__samples_run(strl_build_context *context, strl_error *err)
{
    strl_ingest ingest = {0};
    strl_buckets buckets = {0};
    double probability = context->desc->probability > 0 ? context->desc->probability : PROBABILITY;
    strl_sample_stage stage = {
        .context = context, .ingest = &ingest, .buckets = &buckets, .coupons = -log(-log(probability))};
    strl_status status = begin(&stage, &ingest, err);
    if (!status && ingest.triangle_count == 0) {
        status = strl__model_empty_tree(context, &ingest, STRL_STRUCTURE_SAMPLES, err);
    } else if (!status) {
        strl__build_stage(context, "sort");
        status = strl_chunks_make(&stage, err);
        if (!status) {
            strl__build_stage(context, "write");
            status = strl_samples_write(&stage, err);
        }
    }
    if (!status)
        status = strl__model_end_tree(context, &ingest, err);
    strl_spill_close(stage.bricks);
    strl_spill_close(stage.pieces);
    strl_chunks_deinit(&stage.chunks);
    strl__buckets_deinit(&buckets);
    strl_ingest_deinit(&ingest);
    return status;
}
