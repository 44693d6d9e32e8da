/* Checkpoints of the builder `clusters`: which stages are finished, and the streams of each. */
#include <math.h>
#include <stdio.h>

#include "base/fail.h"
#include "build/checkpoint.h"
#include "build/clusters/hierarchy.h"
#include "build/saved.h"
#include "platform/thread.h"

/* A level is saved after so many parts of it: what it has used up waits on disk for that. */
#define PARTS_OF_LEVEL 32u
/* Nor does more work than this get lost. */
#define MOST_NS (UINT64_C(20) * 1000000000u)

strl_status strl_clusters_save(strl_hierarchy *hierarchy, const strl_position *position, strl_error *err)
{
    strl_writer words = {0};
    strl_writer_u32(&words, (uint32_t)position->finished);
    strl_writer_u32(&words, position->level);
    strl_writer_u32(&words, position->done);
    strl_writer_f32(&words, hierarchy->even_error);
    strl_writer_f32(&words, hierarchy->growth);
    for (uint32_t i = 0; i < position->level; i++)
        strl_writer_u32(&words, hierarchy->levels[i].group_count);
    strl_status status = strl__checkpoint_write(hierarchy->context, &words, err);
    strl__free(words.data);
    hierarchy->saved_done = position->done;
    hierarchy->saved_at_ns = strl_clock_ns();
    return status;
}

strl_status strl_clusters_note(strl_hierarchy *hierarchy, uint32_t level, uint32_t done, strl_error *err)
{
    uint32_t groups = hierarchy->levels[level].group_count, part = groups / PARTS_OF_LEVEL;
    uint32_t since = done - hierarchy->saved_done;
    if (!hierarchy->context->keep || done == groups)
        return STRL_OK; /* the end of the level is saved with what follows from it */
    if (since < part && strl_clock_ns() - hierarchy->saved_at_ns < MOST_NS)
        return STRL_OK;
    const strl_position position = {.finished = STRL_STAGE_PARTITION, .level = level, .done = done};
    return strl_clusters_save(hierarchy, &position, err);
}

typedef strl_status (*open_fn)(strl_build_context *context, const char *name, strl_spill **spill, strl_error *err);

static strl_status take_stream(strl_build_context *context, const char *name, strl_spill **spill, strl_error *err)
{
    return strl_spill_take(context->spills, name, spill, err);
}

static strl_status open_level(strl_hierarchy *hierarchy, uint32_t index, bool with_meshes, open_fn open,
                              strl_error *err)
{
    strl_level *level = &hierarchy->levels[index];
    char name[32];
    strl_status status = STRL_OK;
    hierarchy->anchor_plan = strl_hierarchy_anchor_plan(hierarchy, index);
    level->count = 1u << (hierarchy->partition->depth - index);
    level->nodes = strl__alloc_zero(level->count, sizeof *level->nodes);
    if (!level->nodes)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %u nodes", level->count);
    snprintf(name, sizeof name, "payload-%02u", index);
    status = open(hierarchy->context, name, &level->payloads, err);
    snprintf(name, sizeof name, "mesh-%02u", index);
    if (!status && with_meshes)
        status = open(hierarchy->context, name, &level->meshes, err);
    snprintf(name, sizeof name, "anchors-%02u", index);
    if (!status && with_meshes && (hierarchy->anchor_plan.measures || hierarchy->anchor_plan.begins))
        status = open(hierarchy->context, name, &level->anchors, err);
    snprintf(name, sizeof name, "nodes-%02u", index);
    if (!status && hierarchy->context->keep)
        status = open(hierarchy->context, name, &level->states, err);
    return status;
}

strl_status strl_level_open(strl_hierarchy *hierarchy, uint32_t index, strl_error *err)
{
    return open_level(hierarchy, index, true, strl__build_open_stream, err);
}

/* Of the levels below, all nodes; of the one that was being made, those that were taken. */
static strl_status restore_level(strl_hierarchy *hierarchy, const strl_position *position, uint32_t index,
                                 strl_error *err)
{
    strl_level *level = &hierarchy->levels[index];
    bool is_last = index == position->level, was_last = index + 1 == position->level;
    bool with_meshes = is_last || (was_last && index < hierarchy->partition->depth);
    uint32_t count = 0, groups = is_last ? position->done : level->group_count;
    strl_adjacency *next = is_last ? &hierarchy->next : was_last ? &hierarchy->current : NULL;
    strl_status status = open_level(hierarchy, index, with_meshes, take_stream, err);
    if (!status && (groups == 0 || groups > level->count))
        status = strl_saved_fail("the groups of a level", err);
    if (!status)
        status = strl_node_states_restore(level, groups, next, &count, err);
    if (!status && is_last && index == 0)
        level->group_count = level->count;
    return status || is_last || count == level->count ? status : strl_saved_fail("the nodes of a level", err);
}

static strl_status read_position(strl_hierarchy *hierarchy, strl_cursor *words, strl_position *position,
                                 strl_error *err)
{
    uint32_t finished = strl_cursor_u32(words);
    position->level = strl_cursor_u32(words);
    position->done = strl_cursor_u32(words);
    hierarchy->even_error = strl_cursor_f32(words);
    hierarchy->growth = strl_cursor_f32(words);
    position->finished = finished == STRL_STAGE_INGEST ? STRL_STAGE_INGEST : STRL_STAGE_PARTITION;
    bool good = !words->failed && (finished == STRL_STAGE_INGEST || finished == STRL_STAGE_PARTITION) &&
                hierarchy->even_error >= 0 && isfinite(hierarchy->even_error) && hierarchy->growth > 0 &&
                isfinite(hierarchy->growth);
    return good ? STRL_OK : strl_saved_fail("how far it had come", err);
}

static strl_status restore_levels(strl_hierarchy *hierarchy, strl_cursor *words, const strl_position *position,
                                  strl_error *err)
{
    uint32_t depth = hierarchy->partition->depth;
    if (position->level > depth + 1 || (position->level > depth && position->done))
        return strl_saved_fail("the number of levels", err);
    hierarchy->levels = strl__alloc_zero((size_t)depth + 1, sizeof *hierarchy->levels);
    strl_status status =
        hierarchy->levels ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "no memory for %u levels", depth + 1);
    for (uint32_t i = 0; i < position->level && !status; i++) {
        hierarchy->levels[i].group_count = strl_cursor_u32(words);
        status = restore_level(hierarchy, position, i, err);
    }
    if (!status && position->done)
        status = restore_level(hierarchy, position, position->level, err);
    hierarchy->saved_done = position->done;
    hierarchy->saved_at_ns = strl_clock_ns();
    return status;
}

strl_status strl_clusters_restore(strl_hierarchy *hierarchy, strl_ingest *ingest, strl_partition *partition,
                                  strl_position *position, strl_spill **graph, strl_error *err)
{
    strl_build_context *context = hierarchy->context;
    strl_cursor words = strl_cursor_make(context->resumed.data, context->resumed.size);
    *graph = NULL;
    strl_status status = read_position(hierarchy, &words, position, err);
    bool is_partitioned = position->finished == STRL_STAGE_PARTITION;
    if (!status)
        status = strl_ingest_restore(context, !is_partitioned, position->level == 0, ingest, graph, err);
    if (!status && is_partitioned)
        status = strl_partition_restore(context, ingest, partition, err);
    if (!status && is_partitioned)
        status = restore_levels(hierarchy, &words, position, err);
    return status || !strl_cursor_left(&words) ? status : strl_saved_fail("how far it had come", err);
}
