/* Checkpoints: what lets a build that was stopped, at any moment, be resumed.
 *
 * A checkpoint is one small file in the scratch folder, written beside and renamed into place: which request it is of,
 * the counters of the result, the builder's own words on what is finished, and lengths and checksums of the streams
 * that hold it (store/spill.h). Nothing that the checkpoint in place needs is taken from the disk; what was written
 * after it is cut off again by the run that resumes. It outlives the process. It is on the disk before it has its name,
 * but the streams may not be: after a loss of power their checksums tell. */
#ifndef STRL_BUILD_CHECKPOINT_H
#define STRL_BUILD_CHECKPOINT_H

#include "build/context.h"

#define STRL_CHECKPOINT_NAME "checkpoint"

/* All open kept streams, and words. Nothing where the context keeps none. */
strl_status strl__checkpoint_write(strl_build_context *context, const strl_writer *words, strl_error *err);
/* Without memory to look: true, so that nothing is removed. */
bool strl__checkpoint_exists(const char *scratch_dir);
/* Of a context that has one: checks that it is of this request, restores the streams and compares their checksums, sets
 * the result's counters, and `resumed` to the builder's words. */
strl_status strl__checkpoint_read(strl_build_context *context, strl_error *err);

/* ---- the request (request.c) ---- */
/* All that the output's bytes depend on, but for the memory. */
strl_status strl__request_write(const strl_build_context *context, strl_writer *writer, strl_error *err);
/* Refuses a request that differs from the saved one, with what does. Takes over the files that the inputs name. */
strl_status strl__request_compare(strl_build_context *context, strl_cursor *saved, strl_error *err);
/* Adds the files beside an input that were read for it to what a request tells. */
strl_status strl__request_note_beside(strl_build_context *context, const strl_reader *reader, strl_error *err);

#endif
