/* The inputs of a model, and of which of their pieces its trees are made. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "build/checkpoint.h"
#include "build/model.h"
#include "platform/file.h"
#include "platform/thread.h"

#define LEAST_READER_BYTES (8u << 20)
/* Triangles read at once where only their ranges are wanted. */
#define MEASURED_AT_ONCE 1024u

/* ---- opening */

/* Stored, never applied: what inputs say of themselves must agree, unless the caller says it. */
static strl_status take_axes(const strl_build_context *context, const strl_reader_info *info, uint32_t input,
                             strl_error *err)
{
    const strl_build_desc *desc = context->desc;
    strl_build_model *model = context->model;
    const char *unit = desc->unit ? desc->unit : info->default_unit ? info->default_unit : "";
    strl_axis up = desc->up_axis ? (strl_axis)(desc->up_axis - 1) : info->default_up;
    if (input > 0 && up != model->up)
        return strl__fail(err, STRL_ERR_ARGUMENT, "%s and %s disagree about the up axis (%c and %c): say --up",
                          desc->inputs[0], desc->inputs[input], 'x' + (int)model->up, 'x' + (int)up);
    if (input > 0 && strcmp(unit, model->unit) != 0)
        return strl__fail(err, STRL_ERR_ARGUMENT, "%s and %s disagree about the unit (%s and %s): say --unit",
                          desc->inputs[0], desc->inputs[input], *model->unit ? model->unit : "unknown",
                          *unit ? unit : "unknown");
    model->up = up;
    snprintf(model->unit, sizeof model->unit, "%s", unit);
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

static strl_status open_readers(strl_build_context *context, strl_error *err)
{
    strl_reader **readers = context->model->readers;
    strl_status status = STRL_OK;
    uint64_t share = context->memory_bytes / 4; /* one at a time is read */
    for (uint32_t i = 0; i < context->desc->input_count && !status; i++) {
        strl_reader_desc desc = {.path = context->desc->inputs[i],
                                 .scratch_dir = context->scratch_dir,
                                 .memory_bytes = share < LEAST_READER_BYTES ? LEAST_READER_BYTES : share,
                                 .whole_bytes = context->memory_bytes,
                                 .names_bytes = context->memory_bytes / 6,
                                 .most_pieces = STRL_READER_MOST_PIECES / context->desc->input_count,
                                 .child = plan_child(context)};
        strl_reader_info info;
        status = strl_reader_open(&desc, &readers[i], err);
        if (status)
            break;
        strl_reader_rest(readers[i]);
        strl_reader_info_get(readers[i], &info);
        note_costs(context, readers[i]);
        status = take_axes(context, &info, i, err);
    }
    return status;
}

/* ---- trees */

/* Of one input, for sums that do not overflow; no disk holds their scratch. */
#define MOST_TRIANGLES ((uint64_t)1 << 48)

static uint64_t expected_triangles(const strl_reader_info *info, uint64_t announced)
{
    /* A file may announce more than it has room for: nothing tells of a triangle in less than a byte, unless one is
     * read many times over. */
    uint64_t triangles = info->hint_is_exact || announced < info->file_bytes ? announced : info->file_bytes;
    return triangles < MOST_TRIANGLES ? triangles : MOST_TRIANGLES;
}

/* certain: triangles that the files have, as far as they have been checked. */
static strl_status list_trees(strl_build_context *context, uint64_t *certain, strl_error *err)
{
    strl_build_model *model = context->model;
    const uint32_t inputs = context->desc->input_count;
    uint64_t placements = 0;
    strl_model_tree rest = {.input = STRL_EVERY_INPUT, .scale = 1};
    size_t count = 1;
    bool is_empty = true;
    for (uint32_t i = 0; i < inputs; i++)
        count += strl_reader_piece_count(model->readers[i]) - 1;
    model->trees = strl__alloc_zero(count, sizeof *model->trees);
    model->first_tree = strl__alloc_zero(inputs, sizeof *model->first_tree);
    if (!model->trees || !model->first_tree)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu trees", count);
    *certain = 0;
    model->tree_count = 1;
    for (uint32_t i = 0; i < inputs; i++) {
        strl_reader_info info;
        strl_reader_info_get(model->readers[i], &info);
        model->first_tree[i] = model->tree_count;
        for (uint32_t p = 0; p < strl_reader_piece_count(model->readers[i]); p++) {
            strl_reader_piece piece;
            strl_reader_piece_get(model->readers[i], p, &piece);
            uint64_t announced = expected_triangles(&info, piece.triangles), known = info.hint_is_exact ? announced : 0;
            if (p == 0) {
                rest.announced += announced;
                is_empty = is_empty && piece.is_empty;
                *certain += known;
            } else {
                model->trees[model->tree_count++] = (strl_model_tree){.input = i, .piece = p, .announced = announced};
                if (__builtin_add_overflow(placements, piece.placements, &placements))
                    placements = UINT64_MAX;
            }
        }
    }
    rest.placements = 1;
    model->trees[0] = rest;
    if (is_empty && model->tree_count > 1) { /* nothing is used once */
        memmove(model->trees, model->trees + 1, --model->tree_count * sizeof *model->trees);
        for (uint32_t i = 0; i < inputs; i++)
            model->first_tree[i]--;
    }
    if (placements > STRL_MOST_PLACEMENTS)
        return strl__fail(err, STRL_ERR_LIMIT, "%s: its parts are placed %" PRIu64 " times, expected at most %" PRIu64,
                          context->desc->inputs[0], placements, STRL_MOST_PLACEMENTS);
    return STRL_OK;
}

/* An upper bound of the largest singular value, exact where it turns, mirrors and stretches all axes alike. */
static double stretch_of(const double m[12])
{
    double most = 0;
    for (unsigned i = 0; i < 3; i++) {
        double sum = 0;
        for (unsigned j = 0; j < 3; j++)
            sum += fabs(m[i] * m[j] + m[4 + i] * m[4 + j] + m[8 + i] * m[8 + j]);
        most = sum > most ? sum : most;
    }
    return sqrt(most);
}

/* What placements are not finite is counted as triangles that are not. */
static strl_status survey_placements(strl_build_context *context, uint32_t input, strl_error *err)
{
    strl_build_model *model = context->model;
    strl_reader_placement placement;
    strl_reader_drops drops;
    bool found = true;
    strl_status status = strl_reader_begin_placements(model->readers[input], err);
    while (!status && found) {
        status = strl_reader_next_placement(model->readers[input], &placement, &found, err);
        if (status || !found)
            break;
        strl_model_tree *tree = &model->trees[model->first_tree[input] + placement.piece - 1];
        tree->scale = fmax(tree->scale, stretch_of(placement.transform));
        tree->placements++;
    }
    strl_reader_drops_get(model->readers[input], &drops);
    context->result->dropped_nonfinite += drops.nonfinite;
    context->result->triangles_in += drops.nonfinite;
    return status;
}

/* Texture coordinates are told over the range of all triangles of a material, in whatever tree they are: pieces are
 * read once more before the first tree. */
static strl_status measure_pieces(strl_build_context *context, uint32_t input, strl_error *err)
{
    strl_reader *reader = context->model->readers[input];
    strl_triangle *triangles = strl__alloc(MEASURED_AT_ONCE, sizeof *triangles);
    strl_status status = triangles ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "no memory to read the input");
    for (uint32_t p = 1; p < strl_reader_piece_count(reader) && !status; p++) {
        size_t count = 1;
        status = strl_reader_select(reader, p, err);
        while (!status && count) {
            status = strl_reader_next(reader, triangles, MEASURED_AT_ONCE, &count, err);
            if (!status)
                status = strl__build_report(context, 0, 0, err);
        }
    }
    strl__free(triangles);
    return status;
}

static bool has_images(const strl_reader *reader)
{
    bool any = false;
    strl_reader_image image;
    for (uint32_t i = 0; i < strl_reader_material_count(reader) && !any; i++)
        any = strl_reader_material_image(reader, i, &image);
    return any;
}

static strl_status survey_pieces(strl_build_context *context, strl_error *err)
{
    strl_status status = STRL_OK;
    for (uint32_t i = 0; i < context->desc->input_count && !status; i++) {
        strl_reader *reader = context->model->readers[i];
        if (strl_reader_piece_count(reader) == 1)
            continue;
        status = survey_placements(context, i, err);
        if (!status && has_images(reader))
            status = measure_pieces(context, i, err);
        strl_reader_rest(reader);
    }
    return status;
}

/* ---- estimates */

/* Scratch of a build, most of it spilled triangles and base meshes. */
#define SCRATCH_BYTES_OF_TRIANGLE 80u
/* More of it where there are texture coordinates, which is known after the survey. */
#define SCRATCH_BYTES_OF_TEXCOORDS 24u

strl_status strl__model_check_disk(const strl_build_context *context, uint64_t triangles, bool has_texcoords,
                                   strl_error *err)
{
    uint64_t free_bytes,
        needed = triangles * (SCRATCH_BYTES_OF_TRIANGLE + (has_texcoords ? SCRATCH_BYTES_OF_TEXCOORDS : 0));
    strl_status status = strl_path_free_bytes(context->scratch_dir, &free_bytes, err);
    if (!status && free_bytes < needed)
        status = strl__fail(err, STRL_ERR_DISK_FULL,
                            "%s has %" PRIu64 " bytes free, expected %" PRIu64 " for the scratch of %" PRIu64
                            " triangles: name another folder by --scratch",
                            context->scratch_dir, free_bytes, needed, triangles);
    return status;
}

/* Also refuses what is known not to fit the disk: parts that are used again and again can be far more triangles than a
 * reading would end with soon. Scratch is that of one tree at a time. */
static strl_status tell_estimate(strl_build_context *context, uint64_t certain, strl_error *err)
{
    strl_build_model *model = context->model;
    strl_build_estimate estimate = {0};
    uint64_t largest = 0;
    for (uint32_t i = 0; i < model->tree_count; i++) {
        const strl_model_tree *tree = &model->trees[i];
        model->announced += tree->announced;
        largest = tree->announced > largest ? tree->announced : largest;
        if (tree->input != STRL_EVERY_INPUT && tree->announced > certain)
            certain = tree->announced; /* pieces are announced by formats that check them */
    }
    estimate.triangles = model->announced;
    strl__build_expect(context, estimate.triangles);
    estimate.seconds = context->estimate.seconds_left;
    estimate.scratch_bytes = largest * SCRATCH_BYTES_OF_TRIANGLE;
    strl_status status = strl_path_free_bytes(context->scratch_dir, &estimate.scratch_free_bytes, err);
    if (!status && context->desc->estimate)
        context->desc->estimate(context->desc->context, &estimate);
    return status ? status : strl__model_check_disk(context, certain, false, err);
}

strl_status strl__model_open(strl_build_context *context, strl_error *err)
{
    strl_build_model *model = context->model;
    uint64_t certain = 0;
    model->readers = strl__alloc_zero(context->desc->input_count, sizeof *model->readers);
    strl_status status = model->readers
                             ? open_readers(context, err)
                             : strl__fail(err, STRL_ERR_MEMORY, "no memory for %u inputs", context->desc->input_count);
    if (!status)
        status = list_trees(context, &certain, err);
    if (!status)
        status = tell_estimate(context, certain, err);
    if (!status && !strl__model_is_plain(context))
        status = survey_pieces(context, err);
    if (model->announced && !status)
        strl__estimate_tree(&context->estimate, 0, (double)model->trees[0].announced / (double)model->announced);
    return status;
}

/* ---- reading the tree at hand */

bool strl__model_is_plain(const strl_build_context *context)
{
    const strl_build_model *model = context->model;
    return model->tree_count == 1 && (!model->trees || model->trees[0].input == STRL_EVERY_INPUT);
}

bool strl__model_has_placements(const strl_build_context *context)
{
    const strl_build_model *model = context->model;
    return model->trees && model->trees[model->tree].input != STRL_EVERY_INPUT;
}

bool strl__model_is_last_tree(const strl_build_context *context)
{
    return context->model->tree + 1 == context->model->tree_count;
}

bool strl__model_reads(const strl_build_context *context, uint32_t input)
{
    const strl_model_tree *tree = &context->model->trees[context->model->tree];
    return tree->input == STRL_EVERY_INPUT || tree->input == input;
}

strl_status strl__model_rewind(const strl_build_context *context, uint32_t input, strl_error *err)
{
    const strl_build_model *model = context->model;
    return strl_reader_select(model->readers[input], model->trees[model->tree].piece, err);
}

double strl__model_grid(const strl_build_context *context)
{
    const double scale = context->model->trees[context->model->tree].scale;
    return scale > 0 ? context->desc->grid / scale : context->desc->grid;
}

strl_status strl__model_rest(strl_build_context *context, strl_error *err)
{
    strl_build_model *model = context->model;
    strl_status status = STRL_OK;
    for (uint32_t i = 0; i < context->desc->input_count && !status; i++) {
        strl_reader_rest(model->readers[i]);
        if (!strl__model_is_plain(context))
            continue; /* placements are read after the last tree */
        status = strl__request_note_beside(context, model->readers[i], err);
        strl_reader_close(model->readers[i]);
        model->readers[i] = NULL;
    }
    return status;
}

void strl__model_close_readers(strl_build_context *context)
{
    strl_build_model *model = context->model;
    for (uint32_t i = 0; model->readers && i < context->desc->input_count; i++)
        strl_reader_close(model->readers[i]);
    strl__free(model->readers);
    model->readers = NULL;
}
