#include "build/model.h"

#include <string.h>

#include "base/fail.h"
#include "base/memory.h"

strl_status strl__model_run(strl_build_context *context, strl_error *err)
{
    strl_build_model model = {.tree_count = 1};
    strl_status status = STRL_OK;
    context->model = &model;
    do {
        if (model.tree && model.announced) {
            model.announced_before += model.trees[model.tree - 1].announced;
            strl__estimate_tree(&context->estimate, (double)model.announced_before / (double)model.announced,
                                (double)model.trees[model.tree].announced / (double)model.announced);
        }
        status = context->run(context, err);
    } while (!status && ++model.tree < model.tree_count);
    strl_container_writer_destroy(model.writer);
    strl__model_close_readers(context);
    strl__free(model.trees);
    strl__free(model.first_tree);
    context->model = NULL;
    return status;
}

strl_status strl__model_writer(strl_build_context *context, const strl_ingest *ingest, strl_container_writer **writer,
                               strl_error *err)
{
    strl_build_model *model = context->model;
    strl_status status = STRL_OK;
    if (!model->writer) {
        const strl_container_writer_desc desc = strl_describe_container(context, ingest);
        status = strl_container_writer_create(&desc, &model->writer, err);
    }
    *writer = model->writer;
    return status;
}

strl_status strl__model_empty_tree(strl_build_context *context, const strl_ingest *ingest, strl_structure structure,
                                   strl_error *err)
{
    strl_build_result *result = context->result;
    strl_container_writer *writer = NULL;
    strl_status status = strl__model_writer(context, ingest, &writer, err);
    if (!status)
        status = strl_write_empty_tree(writer, structure, err);
    result->nodes++;
    result->groups++;
    result->levels += result->levels == 0;
    return status;
}

static void note_lattice(strl_build_context *context, const strl_ingest *ingest)
{
    const strl_build_model *model = context->model;
    strl_build_result *result = context->result;
    double scale = model->trees ? model->trees[model->tree].scale : 1,
           step = ingest->triangle_count ? ingest->step * scale : 0;
    double moved = (double)ingest->leaf_error * step;
    result->step = step > result->step ? step : result->step;
    result->quantisation_error = moved > result->quantisation_error ? moved : result->quantisation_error;
}

static strl_status finish(strl_build_context *context, const strl_ingest *ingest, strl_error *err)
{
    strl_build_model *model = context->model;
    strl_build_result *result = context->result;
    strl_container_writer_desc desc = strl_describe_container(context, ingest);
    desc.info.has_colour = model->has_colour;
    strl_status status = strl__model_place(context, err);
    if (!status)
        status = strl_write_names(ingest, model->writer, err);
    strl_container_writer_describe(model->writer, &desc.info);
    if (!status)
        status = strl_container_writer_finish(model->writer, &result->bytes_out, err);
    result->trees = model->tree_count;
    result->parts = ingest->parts.count ? (uint32_t)ingest->parts.count : 1;
    result->materials = ingest->materials.count ? (uint32_t)ingest->materials.count : 1;
    result->step = result->step > 0 ? result->step : 1; /* of a model without a triangle */
    return status;
}

strl_status strl__model_end_tree(strl_build_context *context, const strl_ingest *ingest, strl_error *err)
{
    strl_build_model *model = context->model;
    model->has_colour |= strl__shows_colour(ingest);
    if (model->trees) {
        model->trees[model->tree].triangles = ingest->triangle_count;
        memcpy(model->trees[model->tree].centre, ingest->centre, sizeof ingest->centre);
        model->trees[model->tree].size = ingest->longest;
    }
    note_lattice(context, ingest);
    strl_status status = strl_check_counts(context->result, err);
    return status || !strl__model_is_last_tree(context) ? status : finish(context, ingest, err);
}
