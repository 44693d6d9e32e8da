/* First pass over the inputs: bounds, edge lengths, a sample of centroids. Constant memory for each worker. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"
#include "build/ingest/batches.h"
#include "build/ingest/internal.h"
#include "build/model.h"

#define SAMPLE_CAPACITY 65536u
/* Bins of a squared length by the top bits of its pattern: 8 bins an octave of the square, 16 an octave of length. */
#define EDGE_BIN_SHIFT 49
#define EDGE_BINS (1u << (63 - EDGE_BIN_SHIFT))
/* Lattice steps across the extent, at most: positions are 32-bit, and their differences must be too. */
#define STEPS_EXPONENT 30
/* Of a compact lattice: to the median edge, which half a diagonal then is at most a 37th of. */
#define COMPACT_STEPS 32
#define LEAST_EXTENT 1e-140   /* steps below 2^-512 are not of the container's format */
#define MOST_COORDINATE 1e150 /* nor those above 2^512; and squares of lengths stay finite */

/* What one worker has seen: no order in it. */
typedef struct tally {
    double min[3], max[3];
    bool any_normal, any_colour, any_texcoord;
    uint64_t *edge_histogram; /* [EDGE_BINS] */
} tally;

typedef struct surveying {
    strl_build_context *context;
    model_survey *survey;
    tally *tallies;                     /* [workers] */
    uint64_t bytes_before, bytes_total; /* of the inputs before the one at hand, and of all */
} surveying;

static void count_edges(uint64_t *histogram, const strl_triangle *triangle)
{
    for (int c = 0; c < 3; c++) {
        const double *a = triangle->position[c], *b = triangle->position[c == 2 ? 0 : c + 1];
        double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2], length2 = x * x + y * y + z * z;
        uint64_t bits;
        memcpy(&bits, &length2, sizeof bits);
        if (length2 > 0)
            histogram[bits >> EDGE_BIN_SHIFT]++;
    }
}

/* One of sample_stride triangles, a power of two: of those that are for one stride, half are for the next. */
static bool is_sampled(const model_survey *survey, uint64_t index)
{
    return ((survey->is_scattered ? strl__mix64(index) : index) & (survey->sample_stride - 1)) == 0;
}

/* When the table is full, those of the next stride stay. index: of all triangles. */
static void take_sample(model_survey *survey, const strl_triangle *triangle, uint64_t index)
{
    while (survey->sample_count == SAMPLE_CAPACITY) {
        survey->sample_count = 0;
        survey->sample_stride *= 2;
        for (uint32_t i = 0; i < SAMPLE_CAPACITY; i++)
            if (is_sampled(survey, survey->sample[i].index))
                survey->sample[survey->sample_count++] = survey->sample[i];
    }
    if (!is_sampled(survey, index))
        return;
    survey_sample *sample = &survey->sample[survey->sample_count++];
    memcpy(sample->position, triangle->position, sizeof sample->position);
    sample->index = index;
}

static void look_at(tally *s, const strl_triangle *triangle)
{
    for (int c = 0; c < 3; c++)
        for (int k = 0; k < 3; k++) {
            double value = triangle->position[c][k];
            s->min[k] = value < s->min[k] ? value : s->min[k];
            s->max[k] = value > s->max[k] ? value : s->max[k];
        }
    s->any_normal |= (triangle->flags & STRL_TRIANGLE_HAS_NORMAL) != 0;
    s->any_colour |= (triangle->flags & STRL_TRIANGLE_HAS_COLOUR) != 0;
    s->any_texcoord |= (triangle->flags & STRL_TRIANGLE_HAS_TEXCOORD) != 0;
    count_edges(s->edge_histogram, triangle);
}

static strl_status look_at_batch(void *user, const strl_triangle_batch *batch, unsigned slot, unsigned worker,
                                 strl_error *err)
{
    surveying *s = user;
    (void)slot;
    (void)err;
    for (size_t t = 0; t < batch->count; t++)
        look_at(&s->tallies[worker], &batch->triangle[t]);
    return STRL_OK;
}

/* Samples go by a triangle's place in the order of the input. */
static strl_status sample_batch(void *user, const strl_triangle_batch *batch, unsigned slot, strl_error *err)
{
    surveying *s = user;
    model_survey *survey = s->survey;
    (void)slot;
    for (size_t i = 0; i < batch->count; i++)
        if (is_sampled(survey, survey->triangles + i))
            take_sample(survey, &batch->triangle[i], survey->triangles + i);
    survey->triangles += batch->count;
    return strl__build_report(s->context, s->bytes_before + batch->bytes_done, s->bytes_total, err);
}

static bool make_tallies(surveying *s, unsigned workers)
{
    s->tallies = strl__alloc_zero(workers, sizeof *s->tallies);
    bool good = s->tallies != NULL;
    for (unsigned w = 0; w < workers && good; w++) {
        s->tallies[w] = (tally){.min = {INFINITY, INFINITY, INFINITY}, .max = {-INFINITY, -INFINITY, -INFINITY}};
        s->tallies[w].edge_histogram = strl__alloc_zero(EDGE_BINS, sizeof *s->tallies[w].edge_histogram);
        good = s->tallies[w].edge_histogram != NULL;
    }
    return good;
}

static void gather_tallies(const surveying *s, unsigned workers)
{
    model_survey *survey = s->survey;
    for (unsigned w = 0; w < workers; w++) {
        const tally *one = &s->tallies[w];
        for (int k = 0; k < 3; k++) {
            survey->min[k] = fmin(survey->min[k], one->min[k]) + 0.; /* zeros get one sign, whoever met which */
            survey->max[k] = fmax(survey->max[k], one->max[k]) + 0.;
        }
        survey->any_normal |= one->any_normal;
        survey->any_colour |= one->any_colour;
        survey->any_texcoord |= one->any_texcoord;
        for (uint32_t i = 0; i < EDGE_BINS; i++)
            survey->edge_histogram[i] += one->edge_histogram[i];
    }
}

static uint64_t bytes_of(const strl_reader *reader)
{
    strl_reader_info info;
    strl_reader_info_get(reader, &info);
    return info.file_bytes;
}

strl_status strl__survey_run(strl_build_context *context, strl_reader *const *readers, bool octree,
                             model_survey *survey, strl_error *err)
{
    surveying s = {.context = context, .survey = survey};
    unsigned workers = strl_pool_workers(context->pool);
    strl_batch_pass pass;
    strl_status status = strl__batch_pass_create(context, 0, &pass, err);
    pass.work = look_at_batch;
    pass.finish = sample_batch;
    pass.user = &s;
    *survey = (model_survey){.min = {INFINITY, INFINITY, INFINITY},
                             .max = {-INFINITY, -INFINITY, -INFINITY},
                             .is_scattered = octree,
                             .sample_stride = 1};
    survey->edge_histogram = strl__alloc_zero(EDGE_BINS, sizeof *survey->edge_histogram);
    survey->sample = strl__alloc(SAMPLE_CAPACITY, sizeof *survey->sample);
    if (!status && (!make_tallies(&s, workers) || !survey->edge_histogram || !survey->sample))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory to read the input");
    for (uint32_t i = 0; i < context->desc->input_count; i++)
        s.bytes_total += strl__model_reads(context, i) ? bytes_of(readers[i]) : 0;
    for (uint32_t i = 0; i < context->desc->input_count && !status; i++) {
        if (!strl__model_reads(context, i))
            continue;
        status = strl__model_rewind(context, i, err);
        if (!status)
            status = strl__batch_pass_run(&pass, readers[i], err);
        if (context->desc->input_count > 1)
            strl_reader_rest(readers[i]);
        s.bytes_before += bytes_of(readers[i]);
    }
    if (!status)
        gather_tallies(&s, workers);
    for (unsigned w = 0; s.tallies && w < workers; w++)
        strl__free(s.tallies[w].edge_histogram);
    strl__free(s.tallies);
    strl__batch_pass_deinit(&pass);
    return status;
}

void strl__survey_deinit(model_survey *survey)
{
    strl__free(survey->edge_histogram);
    strl__free(survey->sample);
    *survey = (model_survey){0};
}

/* A length that this share of the edges does not reach: the lower end of the bin where it is passed. */
static double edge_at(const model_survey *survey, double share)
{
    uint64_t total = 0, seen = 0;
    for (uint32_t i = 0; i < EDGE_BINS; i++)
        total += survey->edge_histogram[i];
    for (uint32_t i = 0; i < EDGE_BINS; i++) {
        seen += survey->edge_histogram[i];
        if ((double)seen > (double)total * share) {
            uint64_t bits = (uint64_t)i << EDGE_BIN_SHIFT;
            double value;
            memcpy(&value, &bits, sizeof value);
            return sqrt(value);
        }
    }
    return 0;
}

static double power_of_two_below(double value)
{
    int exponent;
    frexp(value, &exponent);
    return ldexp(1, exponent - 1);
}

/* What no lattice can hold, or doubles cannot tell apart. */
static strl_status check_extent(const strl_build_context *context, const model_survey *survey, double extent,
                                double largest, strl_error *err)
{
    char inputs[STRL_INPUTS_NAME_BYTES];
    strl__ingest_name_inputs(context->desc, inputs, sizeof inputs);
    if (largest > MOST_COORDINATE)
        return strl__fail(err, STRL_ERR_FORMAT, "%s: expected coordinates of at most %g, found %g", inputs,
                          MOST_COORDINATE, largest);
    if (!(extent > 0))
        return strl__fail(err, STRL_ERR_FORMAT,
                          "%s: expected a model with an extent, found all corners at one point, %.9g %.9g %.9g", inputs,
                          survey->min[0], survey->min[1], survey->min[2]);
    if (extent < LEAST_EXTENT)
        return strl__fail(err, STRL_ERR_FORMAT, "%s: expected an extent of at least %g, found %g", inputs, LEAST_EXTENT,
                          extent);
    if (!(extent > largest * 1e-13))
        return strl__fail(err, STRL_ERR_FORMAT,
                          "%s: the extent of %g is lost in the rounding of coordinates as large as %g: "
                          "move the model towards the origin",
                          inputs, extent, largest);
    return STRL_OK;
}

/* A step that was asked for is kept or refused; the chosen one may have to be coarser than it should. */
static strl_status choose_step(const strl_build_context *context, const model_survey *survey, double extent,
                               strl_ingest *ingest, strl_error *err)
{
    const double asked = strl__model_grid(context);
    ingest->finest_step = 2 * power_of_two_below(ldexp(extent, -STEPS_EXPONENT));
    if (asked > 0) {
        ingest->step = power_of_two_below(asked);
        if (ingest->step >= ingest->finest_step)
            return STRL_OK;
        char inputs[STRL_INPUTS_NAME_BYTES];
        strl__ingest_name_inputs(context->desc, inputs, sizeof inputs);
        return strl__fail(err, STRL_ERR_LIMIT,
                          "%s: --grid %g asks for a lattice step of %g, finer than the %g that the extent of %g "
                          "allows: ask for %g or more, or build what lies far apart into files of its own",
                          inputs, asked, ingest->step, ingest->finest_step, extent, ingest->finest_step);
    }
    double wanted = ldexp(extent, -20);
    if (ingest->short_edge > 0)
        wanted = fmin(wanted, ingest->short_edge / 16);
    if (context->desc->compact && ingest->short_edge > 0)
        wanted = fmax(wanted, fmin(edge_at(survey, 0.5) / COMPACT_STEPS, ingest->short_edge));
    ingest->step = fmax(power_of_two_below(wanted), ingest->finest_step);
    ingest->is_coarse = !context->desc->compact && ingest->short_edge > 0 && ingest->step * 16 > ingest->short_edge;
    return STRL_OK;
}

strl_status strl__survey_choose_lattice(const strl_build_context *context, const model_survey *survey,
                                        strl_ingest *ingest, strl_error *err)
{
    double extent = 0, largest = 0;
    for (int k = 0; k < 3; k++) {
        extent = fmax(extent, survey->max[k] - survey->min[k]);
        largest = fmax(largest, fmax(fabs(survey->min[k]), fabs(survey->max[k])));
    }
    ingest->short_edge = edge_at(survey, 0.01);
    strl_status status = check_extent(context, survey, extent, largest, err);
    if (!status)
        status = choose_step(context, survey, extent, ingest, err);
    if (status)
        return status;
    for (int k = 0; k < 3; k++) {
        ingest->centre[k] = survey->min[k] / 2 + survey->max[k] / 2;
        ingest->longest = fmax(ingest->longest, survey->max[k] - survey->min[k]);
    }
    for (int k = 0; k < 3; k++)
        ingest->origin[k] = floor(survey->min[k] / ingest->step) * ingest->step;
    while (extent / ingest->step + 2 >= ldexp(1, 21 + (int)ingest->curve_shift))
        ingest->curve_shift++;
    while (ingest->curve_spare < 20 &&
           extent / ingest->step + 2 < ldexp(1, 20 + (int)ingest->curve_shift - (int)ingest->curve_spare))
        ingest->curve_spare++;
    double rounding = (largest + extent) * 4 * DBL_EPSILON / ingest->step;
    ingest->leaf_error = nextafterf((float)(0.5 * sqrt(3.) + 2 * rounding), INFINITY);
    return STRL_OK;
}
