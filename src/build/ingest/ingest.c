#include "build/ingest/ingest.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "build/checkpoint.h"
#include "build/ingest/internal.h"
#include "platform/file.h"
#include "platform/thread.h"

#define LEAST_READER_BYTES (8u << 20)
/* Of a few nodes a level, what is used up and waits for a checkpoint is a large share of all. */
#define KEEP_TRIANGLES 65536u

/* Stored, never applied: what inputs say of themselves must agree, unless the caller says it. */
static strl_status take_axes(const strl_build_context *context, const strl_reader_info *info, uint32_t input,
                             strl_ingest *ingest, strl_error *err)
{
    const strl_build_desc *desc = context->desc;
    const char *unit = desc->unit ? desc->unit : info->default_unit ? info->default_unit : "";
    strl_axis up = desc->up_axis ? (strl_axis)(desc->up_axis - 1) : info->default_up;
    if (input > 0 && up != ingest->up)
        return strl__fail(err, STRL_ERR_ARGUMENT, "%s and %s disagree about the up axis (%c and %c): say --up",
                          desc->inputs[0], desc->inputs[input], 'x' + (int)ingest->up, 'x' + (int)up);
    if (input > 0 && strcmp(unit, ingest->unit) != 0)
        return strl__fail(err, STRL_ERR_ARGUMENT, "%s and %s disagree about the unit (%s and %s): say --unit", desc->inputs[0],
                          desc->inputs[input], *ingest->unit ? ingest->unit : "unknown", *unit ? unit : "unknown");
    ingest->up = up;
    snprintf(ingest->unit, sizeof ingest->unit, "%s", unit);
    return STRL_OK;
}

/* For the child that reads a foreign format while this process waits, all of the budget that is left; this process
 * grows by no more than the reserve meanwhile. */
#define CHILD_RESERVE_BYTES (8u << 20)

static bool go_on(void *context)
{
    return strl__build_report(context, 0, 0, NULL) == STRL_OK;
}

static strl_reader_child plan_child(strl_build_context *context)
{
    uint64_t held = strl_process_rss_bytes() + CHILD_RESERVE_BYTES;
    return (strl_reader_child){
        .importer = context->desc->importer,
        .memory_bytes = context->memory_bytes > held ? context->memory_bytes - held : CHILD_RESERVE_BYTES,
        .go_on = go_on,
        .context = context,
    };
}

static void note_costs(strl_build_context *context, const strl_reader *reader)
{
    strl_build_result *result = context->result;
    strl_reader_costs costs;
    strl_reader_costs_get(reader, &costs);
    context->spool_bytes += costs.scratch_bytes;
    if (costs.child_rss_bytes > result->peak_rss_bytes)
        result->peak_rss_bytes = costs.child_rss_bytes;
}

static strl_status open_readers(strl_build_context *context, strl_reader **readers, strl_ingest *ingest, strl_error *err)
{
    strl_status status = STRL_OK;
    uint64_t share = context->memory_bytes / 4; /* one at a time is read */
    for (uint32_t i = 0; i < context->desc->input_count && !status; i++) {
        strl_reader_desc desc = {.path = context->desc->inputs[i],
                                 .scratch_dir = context->scratch_dir,
                                 .memory_bytes = share < LEAST_READER_BYTES ? LEAST_READER_BYTES : share,
                                 .whole_bytes = context->memory_bytes,
                                 .names_bytes = context->memory_bytes / 6,
                                 .child = plan_child(context)};
        strl_reader_info info;
        status = strl_reader_open(&desc, &readers[i], err);
        if (status)
            break;
        strl_reader_rest(readers[i]);
        strl_reader_info_get(readers[i], &info);
        note_costs(context, readers[i]);
        status = take_axes(context, &info, i, ingest, err);
    }
    return status;
}

static void note_drops(strl_build_context *context, strl_reader *const *readers)
{
    for (uint32_t i = 0; i < context->desc->input_count; i++) {
        strl_reader_drops drops;
        strl_reader_drops_get(readers[i], &drops);
        context->result->dropped_nonfinite += drops.nonfinite;
        context->result->dropped_degenerate += drops.degenerate_faces;
        context->result->dropped_lines += drops.lines;
        context->result->dropped_points += drops.points;
        context->result->triangles_in += drops.nonfinite + drops.degenerate_faces;
    }
}

/* Scratch of a build, most of it spilled triangles and base meshes. */
#define SCRATCH_BYTES_OF_TRIANGLE 80u
/* More of it where there are texture coordinates, which is known after the survey. */
#define SCRATCH_BYTES_OF_TEXCOORDS 24u

/* Of one input, for sums that do not overflow; no disk holds their scratch. */
#define MOST_TRIANGLES ((uint64_t)1 << 48)

/* Before anything is written: a build that cannot end should not begin. */
static strl_status check_disk(const strl_build_context *context, uint64_t triangles, bool has_texcoords, strl_error *err)
{
    uint64_t free_bytes,
        needed = triangles * (SCRATCH_BYTES_OF_TRIANGLE + (has_texcoords ? SCRATCH_BYTES_OF_TEXCOORDS : 0));
    strl_status status = strl_path_free_bytes(context->scratch_dir, &free_bytes, err);
    if (!status && free_bytes < needed)
        status = strl__fail(err, STRL_ERR_DISK_FULL, "%s has %" PRIu64 " bytes free, expected %" PRIu64 " for the scratch of %" PRIu64
                            " triangles: name another folder by --scratch", context->scratch_dir, free_bytes, needed, triangles);
    return status;
}

/* Cells are bounded by the budget (sort.c), and a leaf is some cells: with fewer bytes a triangle leaves have more triangles
 * than STRL_CLUSTER_TRIANGLES. */
#define MEMORY_BYTES_OF_TRIANGLE 2u

strl_status strl__ingest_check_memory(const strl_build_context *context, uint64_t triangles, strl_error *err)
{
    uint64_t least = triangles * MEMORY_BYTES_OF_TRIANGLE;
    if (least <= context->memory_bytes)
        return STRL_OK;
    return strl__fail(err, STRL_ERR_ARGUMENT, "--memory %" PRIu64 "M is below the least that a build of %" PRIu64
                      " triangles needs, %" PRIu64 "M", context->memory_bytes >> 20, triangles, (least >> 20) + 1);
}

static uint64_t expected_triangles(const strl_reader_info *info)
{
    /* A file may announce more than it has room for: nothing tells of a triangle in less than a byte, unless one is read
     * many times over. */
    return info->hint_is_exact || info->triangles_hint < info->file_bytes ? info->triangles_hint : info->file_bytes;
}

/* Also refuses what is known not to fit the disk: parts that are used again and again can be far more triangles than a
 * reading would end with soon. */
static strl_status tell_estimate(strl_build_context *context, strl_reader *const *readers, strl_error *err)
{
    strl_build_estimate estimate = {0};
    uint64_t certain = 0;
    for (uint32_t i = 0; i < context->desc->input_count; i++) {
        strl_reader_info info;
        strl_reader_info_get(readers[i], &info);
        uint64_t triangles = expected_triangles(&info);
        triangles = triangles < MOST_TRIANGLES ? triangles : MOST_TRIANGLES;
        estimate.triangles += triangles;
        certain += info.hint_is_exact ? triangles : 0;
    }
    strl__build_expect(context, estimate.triangles);
    estimate.seconds = context->estimate.seconds_left;
    estimate.scratch_bytes = estimate.triangles * SCRATCH_BYTES_OF_TRIANGLE;
    strl_status status = strl_path_free_bytes(context->scratch_dir, &estimate.scratch_free_bytes, err);
    if (!status && context->desc->estimate)
        context->desc->estimate(context->desc->context, &estimate);
    return status ? status : check_disk(context, certain, false, err);
}

static strl_status close_readers(strl_build_context *context, strl_reader **readers, strl_error *err)
{
    strl_status status = STRL_OK;
    for (uint32_t i = 0; i < context->desc->input_count && !status; i++) {
        status = strl__request_note_beside(context, readers[i], err);
        strl_reader_close(readers[i]);
        readers[i] = NULL;
    }
    return status;
}

strl_status strl_ingest_begin(strl_build_context *context, bool octree, strl_ingest *ingest, strl_buckets *buckets, strl_error *err)
{
    model_survey survey = {0};
    *ingest = (strl_ingest){0};
    strl__build_stage(context, "survey");
    strl_reader **readers = strl__alloc_zero(context->desc->input_count, sizeof *readers);
    strl_status status = readers ? open_readers(context, readers, ingest, err)
                                 : strl__fail(err, STRL_ERR_MEMORY, "no memory for %u inputs", context->desc->input_count);
    if (!status)
        status = tell_estimate(context, readers, err);
    if (!status)
        status = strl__survey_run(context, readers, &survey, err);
    if (status)
        goto done;
    context->result->triangles_in = survey.triangles;
    note_drops(context, readers);
    strl__build_expect(context, survey.triangles);
    context->keep &= survey.triangles >= (context->desc->keep_triangles ? context->desc->keep_triangles : KEEP_TRIANGLES);
    if (survey.triangles == 0) {
        status = strl__ingest_check_empty(context, readers, err);
        context->keep = false;
        goto done;
    }
    status = check_disk(context, survey.triangles, survey.any_texcoord, err);
    if (!status)
        status = strl__ingest_check_memory(context, survey.triangles, err);
    if (status)
        goto done;
    ingest->has_normals = survey.any_normal;
    ingest->has_colours = survey.any_colour;
    ingest->has_texcoords = survey.any_texcoord;
    status = strl__survey_choose_lattice(context, &survey, ingest, err);
    if (status)
        goto done;
    strl__build_stage(context, "read");
    status = strl__distribute(context, readers, &survey, octree, ingest, buckets, err);
    if (status)
        goto done;
    strl__ingest_warn(context, readers, ingest); /* not before: of a refused model only the refusal is told */
    strl__build_note_scratch(context);
    context->spool_bytes = 0;
    status = close_readers(context, readers, err);
done:
    for (uint32_t i = 0; readers && i < context->desc->input_count; i++)
        strl_reader_close(readers[i]);
    strl__free(readers);
    strl__survey_deinit(&survey);
    return status;
}

strl_status strl_ingest_run(strl_build_context *context, strl_ingest *ingest, strl_error *err)
{
    strl_buckets buckets = {0};
    pair_spills pairs = {0};
    strl_status status = strl_ingest_begin(context, false, ingest, &buckets, err);
    if (!status && buckets.count) {
        strl__build_stage(context, "sort");
        status = strl__sort_buckets(context, ingest, &buckets, &pairs, err);
        if (!status)
            strl__build_stage(context, "connect");
        if (!status)
            status = strl__connect_cells(context, ingest, &pairs, err);
    }
    strl__buckets_deinit(&buckets);
    strl__pair_spills_deinit(&pairs);
    return status;
}

strl_status strl_ingest_drop(strl_spill **stream, strl_error *err)
{
    strl_spill *spill = *stream;
    *stream = NULL;
    return strl_spill_close_and_delete(spill, err);
}

static void names_deinit(strl_names *names)
{
    for (size_t i = 0; i < names->count; i++) {
        strl__free(names->items[i]);
        if (names->images)
            strl__free((char *)names->images[i].reference);
    }
    strl__free(names->items);
    strl__free(names->images);
    strl__free(names->rgba);
    *names = (strl_names){0};
}

void strl_ingest_deinit(strl_ingest *ingest)
{
    strl_spill_close(ingest->soup);
    strl_spill_close(ingest->shared);
    strl__free(ingest->cells);
    strl__free(ingest->edges);
    strl__free(ingest->palette);
    names_deinit(&ingest->parts);
    names_deinit(&ingest->materials);
    *ingest = (strl_ingest){0};
}
