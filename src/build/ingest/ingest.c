#include "build/ingest/ingest.h"

#include <inttypes.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "build/ingest/internal.h"
#include "build/model.h"

/* Of a few nodes a level, what is used up and waits for a checkpoint is a large share of all. */
#define KEEP_TRIANGLES 65536u

static void note_drops(strl_build_context *context, strl_reader *const *readers)
{
    for (uint32_t i = 0; i < context->desc->input_count; i++) {
        strl_reader_drops drops;
        if (!strl__model_reads(context, i))
            continue;
        strl_reader_drops_get(readers[i], &drops);
        context->result->dropped_nonfinite += drops.nonfinite;
        context->result->dropped_degenerate += drops.degenerate_faces;
        context->result->dropped_lines += drops.lines;
        context->result->dropped_points += drops.points;
        context->result->triangles_in += drops.nonfinite + drops.degenerate_faces;
    }
}

/* Cells are bounded by the budget (sort.c), and a leaf is some cells: with fewer bytes a triangle leaves have more
 * triangles than STRL_CLUSTER_TRIANGLES. */
#define MEMORY_BYTES_OF_TRIANGLE 2u

strl_status strl__ingest_check_memory(const strl_build_context *context, uint64_t triangles, strl_error *err)
{
    uint64_t least = triangles * MEMORY_BYTES_OF_TRIANGLE;
    if (least <= context->memory_bytes)
        return STRL_OK;
    return strl__fail(err, STRL_ERR_ARGUMENT,
                      "--memory %" PRIu64 "M is below the least that a build of %" PRIu64 " triangles needs, %" PRIu64
                      "M",
                      context->memory_bytes >> 20, triangles, (least >> 20) + 1);
}

/* What becomes of a tree without a triangle. Where there are other trees nothing is said: they are the model. */
static strl_status end_empty(strl_build_context *context, strl_ingest *ingest, strl_error *err)
{
    context->keep = false;
    if (strl__model_is_plain(context))
        return strl__ingest_check_empty(context, context->model->readers, err);
    return strl__ingest_add_names(context, ingest, err);
}

/* Of one tree among others all triangles may lie in one point. */
static bool has_no_extent(const strl_build_context *context, const model_survey *survey)
{
    return !strl__model_is_plain(context) && survey->min[0] == survey->max[0] && survey->min[1] == survey->max[1] &&
           survey->min[2] == survey->max[2];
}

static strl_status check_room(strl_build_context *context, const model_survey *survey, strl_error *err)
{
    strl_status status = strl__model_check_disk(context, survey->triangles, survey->any_texcoord, err);
    return status ? status : strl__ingest_check_memory(context, survey->triangles, err);
}

static strl_status read_tree(strl_build_context *context, model_survey *survey, bool octree, strl_ingest *ingest,
                             strl_buckets *buckets, strl_error *err)
{
    ingest->has_normals = survey->any_normal;
    ingest->has_colours = survey->any_colour;
    ingest->has_texcoords = survey->any_texcoord;
    strl_status status = strl__survey_choose_lattice(context, survey, ingest, err);
    if (status)
        return status;
    strl__build_stage(context, "read");
    status = strl__distribute(context, context->model->readers, survey, octree, ingest, buckets, err);
    if (status)
        return status;
    /* not before: of a refused model only the refusal is told */
    strl__ingest_warn(context, context->model->readers, ingest);
    strl__build_note_scratch(context);
    context->spool_bytes = 0;
    return strl__model_rest(context, err);
}

strl_status strl_ingest_begin(strl_build_context *context, bool octree, strl_ingest *ingest, strl_buckets *buckets,
                              strl_error *err)
{
    model_survey survey = {0};
    strl_build_model *model = context->model;
    *ingest = (strl_ingest){0};
    strl__build_stage(context, "survey");
    strl_status status = model->readers ? STRL_OK : strl__model_open(context, err);
    ingest->up = model->up;
    memcpy(ingest->unit, model->unit, sizeof ingest->unit);
    if (!status)
        status = strl__survey_run(context, model->readers, octree, &survey, err);
    if (status)
        goto done;
    context->result->triangles_in += survey.triangles;
    note_drops(context, model->readers);
    if (strl__model_is_plain(context))
        strl__build_expect(context, survey.triangles);
    context->keep &=
        strl__model_is_plain(context) &&
        survey.triangles >= (context->desc->keep_triangles ? context->desc->keep_triangles : KEEP_TRIANGLES);
    if (survey.triangles && has_no_extent(context, &survey)) {
        context->result->dropped_degenerate += survey.triangles;
        survey.triangles = 0;
    }
    if (survey.triangles == 0) {
        status = end_empty(context, ingest, err);
        goto done;
    }
    status = check_room(context, &survey, err);
    if (!status)
        status = read_tree(context, &survey, octree, ingest, buckets, err);
done:
    strl__survey_deinit(&survey);
    return status;
}

strl_status strl_ingest_run(strl_build_context *context, strl_ingest *ingest, strl_error *err)
{
    strl_buckets buckets = {0};
    pair_spills pairs = {0};
    strl_status status = strl_ingest_begin(context, false, ingest, &buckets, err);
    if (!status && ingest->triangle_count) {
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
