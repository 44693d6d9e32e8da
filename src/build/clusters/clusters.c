/* The builder `clusters`: stages in order, and the container from what they left. */
#include <inttypes.h>
#include <string.h>

#include "base/fail.h"
#include "build/clusters/hierarchy.h"
#include "build/model.h"
#include "platform/file.h"
#include "platform/thread.h"

/* Errors grow by about this factor where triangles are halved for the first time. */
#define FIRST_GROWTH 2.4f

static strl_status close_meshes(strl_level *level, strl_error *err)
{
    strl_status status = strl_spill_close_and_delete(level->meshes, err);
    level->meshes = NULL;
    strl_status other = strl_spill_close_and_delete(level->anchors, status ? NULL : err);
    level->anchors = NULL;
    return status ? status : other;
}

static strl_status flush_level(strl_level *level, strl_error *err)
{
    strl_status status = strl_spill_flush(level->meshes, err);
    if (!status && level->anchors)
        status = strl_spill_flush(level->anchors, err);
    if (!status)
        status = strl_spill_flush(level->payloads, err);
    return status || !level->states ? status : strl_spill_flush(level->states, err);
}

/* What comes after the last node of a level: the words and meshes of those below are used up. */
static strl_status end_level(strl_hierarchy *hierarchy, uint32_t level, strl_error *err)
{
    strl_status status = flush_level(&hierarchy->levels[level], err);
    if (!status && level > 0)
        status = close_meshes(&hierarchy->levels[level - 1], err);
    if (!status && level == hierarchy->partition->depth)
        status = close_meshes(&hierarchy->levels[level], err);
    if (!status && !strl_choose_even_error(hierarchy, &hierarchy->levels[level]))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for the errors of a level");
    strl_adjacency_deinit(&hierarchy->current);
    hierarchy->current = hierarchy->next;
    hierarchy->next = (strl_adjacency){0};
    const strl_position position = {.finished = STRL_STAGE_PARTITION, .level = level + 1};
    return status ? status : strl_clusters_save(hierarchy, &position, err);
}

static strl_status check_root(const strl_hierarchy *hierarchy, strl_error *err)
{
    const strl_node *root = &hierarchy->levels[hierarchy->partition->depth].nodes[0].record;
    return root->base_triangle_count <= STRL_ROOT_MAX_TRIANGLES
               ? STRL_OK
               : strl__fail(err, STRL_ERR_INTERNAL, "the root has %" PRIu32 " triangles; the bound is %u",
                            root->base_triangle_count, STRL_ROOT_MAX_TRIANGLES);
}

/* Of the root, which has no neighbour whose error it should share. */
static void go_on_to_the_end(strl_hierarchy *hierarchy)
{
    hierarchy->most_target = hierarchy->soft_triangles = STRL_PLACED_ROOT_TRIANGLES;
    hierarchy->even_error = 0;
}

static strl_status simplify_levels(strl_hierarchy *hierarchy, const strl_position *from, strl_error *err)
{
    static const char *const names[] = {"level 0", "level 1", "level 2", "level 3", "level 4",      "level 5",
                                        "level 6", "level 7", "level 8", "level 9", "higher levels"};
    strl_status status = STRL_OK;
    for (uint32_t level = from->level; level <= hierarchy->partition->depth && !status; level++) {
        uint32_t first = level == from->level ? from->done : 0;
        strl__build_stage(hierarchy->context, names[level < 10 ? level : 10]);
        if (level == hierarchy->partition->depth && strl__model_has_placements(hierarchy->context))
            go_on_to_the_end(hierarchy);
        if (first == 0)
            status = strl_level_open(hierarchy, level, err);
        if (!status)
            status =
                level == 0 ? strl_make_leaves(hierarchy, first, err) : strl_make_level(hierarchy, level, first, err);
        if (!status)
            status = end_level(hierarchy, level, err);
    }
    return status ? status : check_root(hierarchy, err);
}

static void hierarchy_deinit(strl_hierarchy *hierarchy)
{
    for (uint32_t i = 0; hierarchy->levels && i <= hierarchy->partition->depth; i++) {
        strl_spill_close(hierarchy->levels[i].payloads);
        strl_spill_close(hierarchy->levels[i].meshes);
        strl_spill_close(hierarchy->levels[i].anchors);
        strl_spill_close(hierarchy->levels[i].states);
        strl__free(hierarchy->levels[i].nodes);
    }
    strl__free(hierarchy->levels);
    strl_adjacency_deinit(&hierarchy->current);
    strl_adjacency_deinit(&hierarchy->next);
}

static strl_status write_tree(const strl_hierarchy *hierarchy, strl_error *err)
{
    strl_build_context *context = hierarchy->context;
    const strl_ingest *ingest = hierarchy->ingest;
    strl_container_writer *writer = NULL;
    strl_tree tree = {.structure = STRL_STRUCTURE_CLUSTERS,
                      .step = ingest->step,
                      .node_count = (uint32_t)((2ull << hierarchy->partition->depth) - 1),
                      .level_count = hierarchy->partition->depth + 1,
                      .leaf_geometric = ingest->leaf_error};
    memcpy(tree.origin, ingest->origin, sizeof tree.origin);
    for (uint32_t i = 0; i <= hierarchy->partition->depth; i++)
        tree.group_count += hierarchy->levels[i].group_count;
    strl_status status = strl__model_writer(context, ingest, &writer, err);
    if (!status)
        status = strl_container_writer_begin_tree(writer, &tree, err);
    if (!status)
        status = strl_write_nodes(hierarchy, writer, err);
    return status ? status : strl_container_writer_end_tree(writer, err);
}

static void fill_result(const strl_hierarchy *hierarchy, strl_build_result *result)
{
    const strl_level *leaves = &hierarchy->levels[0];
    const uint32_t levels = hierarchy->partition->depth + 1;
    for (uint32_t i = 0; i < leaves->count; i++) {
        result->triangles_leaf += leaves->nodes[i].record.triangle_count;
        result->vertices += leaves->nodes[i].record.vertex_count;
    }
    result->nodes += (2ull << hierarchy->partition->depth) - 1;
    result->levels = levels > result->levels ? levels : result->levels;
    result->root_triangles += hierarchy->levels[hierarchy->partition->depth].nodes[0].record.base_triangle_count;
}

static strl_status run_ingest(strl_hierarchy *hierarchy, strl_position *position, strl_spill **graph, strl_error *err)
{
    strl_build_context *context = hierarchy->context;
    strl_status status = strl_ingest_run(context, hierarchy->ingest, err);
    if (!status && context->keep)
        status = strl_ingest_save(context, hierarchy->ingest, graph, err);
    *position = (strl_position){.finished = STRL_STAGE_INGEST};
    return status ? status : strl_clusters_save(hierarchy, position, err);
}

static strl_status run_partition(strl_hierarchy *hierarchy, strl_partition *partition, strl_position *position,
                                 strl_spill **graph, strl_error *err)
{
    strl_build_context *context = hierarchy->context;
    strl__build_stage(context, "partition");
    strl_status status = strl__build_report(context, 0, 0, err);
    if (!status)
        status = strl_partition_create(hierarchy->ingest, partition, err);
    if (!status)
        hierarchy->levels = strl__alloc_zero((size_t)partition->depth + 1, sizeof *hierarchy->levels);
    if (!status && !hierarchy->levels)
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for %u levels", partition->depth + 1);
    if (!status && context->keep)
        status = strl_partition_save(context, hierarchy->ingest, partition, err);
    if (!status)
        status = strl_ingest_drop(graph, err);
    *position = (strl_position){.finished = STRL_STAGE_PARTITION};
    return status ? status : strl_clusters_save(hierarchy, position, err);
}

/* From wherever the checkpoint is, or from the beginning. */
static strl_status run_stages(strl_hierarchy *hierarchy, strl_partition *partition, strl_error *err)
{
    strl_build_context *context = hierarchy->context;
    strl_position position = {.finished = STRL_STAGE_NONE};
    strl_spill *graph = NULL;
    strl_status status = context->resumed.size
                             ? strl_clusters_restore(hierarchy, hierarchy->ingest, partition, &position, &graph, err)
                             : run_ingest(hierarchy, &position, &graph, err);
    if (!status && hierarchy->ingest->triangle_count == 0)
        return STRL_OK; /* nothing to arrange; of such a model nothing was kept */
    if (!status && position.finished == STRL_STAGE_INGEST)
        status = run_partition(hierarchy, partition, &position, &graph, err);
    strl_spill_close(graph);
    return status ? status : simplify_levels(hierarchy, &position, err);
}

strl_status strl__clusters_run(strl_build_context *context, strl_error *err)
{
    strl_ingest ingest = {0};
    strl_partition partition = {0};
    strl_hierarchy hierarchy = {.context = context,
                                .ingest = &ingest,
                                .partition = &partition,
                                .growth = FIRST_GROWTH,
                                .soft_triangles = STRL_SOFT_TRIANGLES,
                                .most_target = UINT32_MAX};
    strl_status status = run_stages(&hierarchy, &partition, err);
    if (!status && ingest.triangle_count) {
        fill_result(&hierarchy, context->result);
        status = write_tree(&hierarchy, err);
    } else if (!status) {
        status = strl__model_empty_tree(context, &ingest, STRL_STRUCTURE_CLUSTERS, err);
    }
    if (!status)
        status = strl__model_end_tree(context, &ingest, err);
    hierarchy_deinit(&hierarchy);
    strl_partition_deinit(&partition);
    strl_ingest_deinit(&ingest);
    return status;
}
