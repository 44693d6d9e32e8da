/* The builder `samples`: stages in order. */
#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "build/model.h"
#include "build/samples/chunk.h"

/* A front of 10,000 nodes is then right with more than 0.99 (Klein et al. 2005, 4.3). */
#define PROBABILITY (1 - 1e-6)

strl_status strl__samples_run(strl_build_context *context, strl_error *err)
{
    strl_ingest ingest = {0};
    strl_buckets buckets = {0};
    double probability = context->desc->probability > 0 ? context->desc->probability : PROBABILITY;
    strl_sample_stage stage = {.context = context, .ingest = &ingest, .buckets = &buckets, .coupons = -log(-log(probability))};
    strl_status status = strl_ingest_begin(context, true, &ingest, &buckets, err);
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
    strl_spill_close_and_delete(stage.bricks, NULL);
    strl_chunks_deinit(&stage.chunks);
    strl__buckets_deinit(&buckets);
    strl_ingest_deinit(&ingest);
    return status;
}
