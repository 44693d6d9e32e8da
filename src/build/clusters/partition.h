/* The cluster hierarchy, top down: the graph of cells is bisected again and again into halves of equal weight with few
 * shared positions between them (Quick-VDR 4.1 and 4.2 in one: the leaves of the bisection are the clusters). */
#ifndef STRL_BUILD_CLUSTERS_PARTITION_H
#define STRL_BUILD_CLUSTERS_PARTITION_H

#include "build/ingest/ingest.h"

#define STRL_CLUSTER_TRIANGLES 5000u /* a cluster has at most about this many, and half of it at least */

typedef struct strl_partition {
    uint32_t depth;          /* 2^depth clusters; the siblings of a level are 2i and 2i + 1 */
    uint32_t *cluster;       /* [cell_count] */
    uint32_t *cell;          /* [cell_count] cells ordered by cluster, ascending within */
    uint32_t *cluster_first; /* [clusters + 1] into cell */
} strl_partition;

/* What strl_partition_create chooses. */
uint32_t strl_partition_depth(const strl_ingest *ingest);
strl_status strl_partition_create(const strl_ingest *ingest, strl_partition *partition, strl_error *err);
/* Into the stream `partition` of a checkpoint, and from it. */
strl_status strl_partition_save(strl_build_context *context, const strl_ingest *ingest, const strl_partition *partition,
                                strl_error *err);
strl_status strl_partition_restore(strl_build_context *context, const strl_ingest *ingest, strl_partition *partition,
                                   strl_error *err);
void strl_partition_deinit(strl_partition *partition);

/* Bisects a weighted graph by METIS. side: [count] receives 0 or 1. METIS keeps global state, so this takes a
 * process-wide lock; the result depends on the arguments alone. False where METIS fails (no memory). Arrays as METIS
 * wants them: first [count + 1], neighbour and weight [first[count]]. */
bool strl__metis_bisect(int32_t count, int32_t *first, int32_t *neighbour, int32_t *vertex_weight, int32_t *edge_weight,
                        int32_t *side);

#endif
