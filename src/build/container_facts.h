/* What every builder says of a model in its container, whatever the structure. */
#ifndef STRL_BUILD_CONTAINER_FACTS_H
#define STRL_BUILD_CONTAINER_FACTS_H

#include "build/ingest/ingest.h"

/* Borrows from both. The counts of triangles are the result's. */
strl_container_writer_desc strl_describe_container(const strl_build_context *context, const strl_ingest *ingest);
/* Parts, materials, images. */
strl_status strl_write_names(const strl_ingest *ingest, strl_container_writer *writer, strl_error *err);
/* Every triangle that came in is stored or was counted when it was dropped. */
strl_status strl_check_counts(const strl_build_result *result, strl_error *err);
/* Whether some vertex or material of the tree is not white. */
bool strl__shows_colour(const strl_ingest *ingest);
/* The tree of a model without a triangle. */
strl_status strl_write_empty_tree(strl_container_writer *writer, strl_structure structure, strl_error *err);

#endif
