/* What all stages of one build share. */
#ifndef STRL_BUILD_CONTEXT_H
#define STRL_BUILD_CONTEXT_H

#include "base/cursor.h"
#include "build/progress.h"
#include "geometry/progressive.h"
#include "jobs/pool.h"
#include "readers/reader.h"
#include "store/spill.h"
#include "stroll/build.h"

struct strl_build_model;

typedef struct strl_build_context {
    const strl_build_desc *desc;
    strl_build_result *result;
    strl_status (*run)(struct strl_build_context *context, strl_error *err); /* the builder's stages, of one tree */
    struct strl_build_model *model;                                          /* of which the tree is (model.h) */
    strl_pool *pool;
    strl_spill_set *spills;
    const char *scratch_dir;
    const char *part_dir;  /* for the unfinished container: beside the output */
    uint64_t memory_bytes; /* what the output may depend on; of a resumed build, the first one's */
    bool keep;             /* checkpoints are made (checkpoint.h); settled when the survey is done */
    bool has_checkpoint;   /* there is one in the scratch folder */
    strl_writer resumed;   /* the builder's words in the checkpoint to go on with; empty = from the beginning */
    uint64_t spool_bytes;  /* of scratch that readers hold now */
    strl_writer beside;    /* files that inputs name and that were read, as in a checkpoint; empty = none */
    uint32_t beside_count;
    strl_build_progress progress;
    strl_estimate estimate;
    uint64_t stage_ns, stage_cpu_ns; /* when the stage under way began, by the clock and by the processor */
} strl_build_context;

/* Reports progress; STRL_ERR_CANCELLED where the callback says so. */
strl_status strl__build_report(strl_build_context *context, uint64_t done, uint64_t total, strl_error *err);
/* Starts the next stage. Its share of the time stands in progress.c. */
void strl__build_stage(strl_build_context *context, const char *stage);
/* How many triangles there will be, as far as is known. */
void strl__build_expect(strl_build_context *context, uint64_t triangles);

/* A stream that a checkpoint needs: one that is kept where checkpoints are made. */
strl_status strl__build_open_stream(strl_build_context *context, const char *name, strl_spill **spill, strl_error *err);

/* So much scratch was taken at once until now, what readers hold included. */
void strl__build_note_scratch(strl_build_context *context);

/* The stages of each builder, for the tree context->model->tree. */
strl_status strl__clusters_run(strl_build_context *context, strl_error *err);
strl_status strl__samples_run(strl_build_context *context, strl_error *err);

#endif
