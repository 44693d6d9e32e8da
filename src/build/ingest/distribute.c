/* Second pass over the inputs: onto the lattice and into buckets, each a range of the curve that fits in memory. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"
#include "build/ingest/batches.h"
#include "build/ingest/internal.h"
#include "build/model.h"
#include "geometry/octahedral.h"

/* Buckets decide where cells are cut, so their size must not depend on the number of threads, or the output would.
 * Sorting takes some three times a bucket: with this share up to 32 threads may sort at once (strl__ingest_window). */
#define SHARES_OF_MEMORY 96u

#define BUFFER_BYTES ((size_t)64 << 10)      /* of a bucket */
#define KEPT_BUFFER_BYTES ((size_t)48 << 10) /* and a step of 16 KiB, of which a checksum is made */

uint64_t strl__bucket_bytes(const strl_build_context *context)
{
    return context->memory_bytes / SHARES_OF_MEMORY;
}

unsigned strl__ingest_window(const strl_build_context *context, uint64_t bytes_each)
{
    uint64_t fit = context->memory_bytes * 2 / 3 / (bytes_each ? bytes_each : 1);
    unsigned wanted = strl_pool_workers(context->pool) + 1; /* one waits for its turn while all work */
    return fit < 1 ? 1 : fit < wanted ? (unsigned)fit : wanted;
}

static int compare_keys(const void *a, const void *b)
{
    uint64_t x, y;
    memcpy(&x, a, sizeof x);
    memcpy(&y, b, sizeof y);
    return x < y ? -1 : x > y;
}

static void quantise(const strl_ingest *ingest, const double position[3], uint32_t out[3])
{
    for (int k = 0; k < 3; k++) {
        double cell = nearbyint((position[k] - ingest->origin[k]) / ingest->step);
        out[k] = cell < 0 ? 0 : cell > 2147483647. ? 2147483647u : (uint32_t)cell;
    }
}

static uint64_t key_of_centroid(const strl_ingest *ingest, const survey_sample *sample)
{
    double centroid[3];
    uint32_t cell[3];
    for (int k = 0; k < 3; k++)
        centroid[k] = (sample->position[0][k] + sample->position[1][k] + sample->position[2][k]) / 3;
    quantise(ingest, centroid, cell);
    return strl__curve_key(ingest, cell);
}

/* The very key that the triangle gets: splitters that are equal tell of many triangles that have it. */
static uint64_t key_of_triangle(const strl_ingest *ingest, const survey_sample *sample)
{
    strl_soup_triangle triangle;
    for (int c = 0; c < 3; c++)
        quantise(ingest, sample->position[c], triangle.corner[c].position);
    return strl__curve_key_of_triangle(ingest, &triangle);
}

/* The border of the largest cells between two keys, a < b: b, or what lies before it. */
static uint64_t octree_border(uint64_t a, uint64_t b)
{
    unsigned level = 0;
    while (a >> 3 * (level + 1) != b >> 3 * (level + 1))
        level++;
    return b >> 3 * level << 3 * level;
}

/* Splitters at the quantiles of the sample; of an octree, up to a quarter of a bucket off. */
static void choose_splitters(const uint64_t *keys, uint32_t count, bool octree, strl_buckets *buckets)
{
    for (uint32_t i = 0; i + 1 < buckets->count; i++) {
        uint64_t at = (uint64_t)(i + 1) * count / buckets->count, reach = count / buckets->count / 4;
        uint64_t low = keys[at - (reach < at ? reach : at)], high = keys[at + reach < count ? at + reach : count - 1];
        buckets->splitter[i] = octree && low < high ? octree_border(low, high) : keys[at];
    }
}

void strl__bucket_name(uint32_t index, char name[24])
{
    snprintf(name, 24, "bucket-%03u", index);
}

/* Uses up the sample. */
static strl_status open_buckets(strl_build_context *context, model_survey *survey, const strl_ingest *ingest,
                                bool octree, strl_buckets *buckets, strl_error *err)
{
    uint64_t bytes = survey->triangles * strl__soup_bucket_bytes(ingest), each = strl__bucket_bytes(context) * 2 / 3;
    uint64_t wanted = bytes / (each ? each : 1) + 1;
    buckets->count = wanted > MAX_BUCKETS ? MAX_BUCKETS : (uint32_t)wanted;
    buckets->shares_keys = octree;
    uint64_t *keys = strl__alloc(survey->sample_count, sizeof *keys);
    buckets->splitter = strl__alloc(buckets->count, sizeof *buckets->splitter);
    buckets->spill = strl__alloc_zero(buckets->count, sizeof(strl_spill *));
    strl_status status = STRL_OK;
    if (!keys || !buckets->splitter || !buckets->spill) {
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for %u buckets", buckets->count);
        goto done;
    }
    for (uint32_t i = 0; i < survey->sample_count; i++)
        keys[i] = octree ? key_of_triangle(ingest, &survey->sample[i]) : key_of_centroid(ingest, &survey->sample[i]);
    strl__free(survey->sample); /* it is as large as some bucket buffers */
    survey->sample = NULL;
    qsort(keys, survey->sample_count, sizeof *keys, compare_keys);
    choose_splitters(keys, survey->sample_count, octree, buckets);
    for (uint32_t i = 0; i < buckets->count && !status; i++) {
        char name[24];
        strl__bucket_name(i, name);
        status = octree && context->keep
                     ? strl_spill_open_kept(context->spills, name, KEPT_BUFFER_BYTES, &buckets->spill[i], err)
                     : strl_spill_open(context->spills, name, BUFFER_BYTES, &buckets->spill[i], err);
    }
done:
    strl__free(keys);
    return status;
}

void strl__buckets_deinit(strl_buckets *buckets)
{
    for (uint32_t i = 0; buckets->spill && i < buckets->count; i++)
        strl_spill_close_and_delete(buckets->spill[i], NULL);
    strl__free(buckets->splitter);
    strl__free(buckets->spill);
    *buckets = (strl_buckets){0};
}

/* How many splitters do not come after the key. */
static uint32_t splitters_up_to(const strl_buckets *buckets, uint64_t key)
{
    uint32_t low = 0, high = buckets->count - 1;
    while (low < high) {
        uint32_t middle = (low + high) / 2;
        if (key < buckets->splitter[middle])
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

/* index: of the triangle in its input. */
static uint32_t bucket_of(const strl_buckets *buckets, uint64_t key, uint64_t index)
{
    uint32_t end = splitters_up_to(buckets, key);
    if (!buckets->shares_keys || end < 2 || buckets->splitter[end - 2] != key)
        return end;
    uint32_t first = (key ? splitters_up_to(buckets, key - 1) : 0) + 1;
    return first + (uint32_t)(strl__mix64(index) % (end - first));
}

void strl__bucket_range(const strl_buckets *buckets, uint32_t index, uint64_t *low, uint64_t *high)
{
    const uint64_t *after = index + 1 < buckets->count ? &buckets->splitter[index] : NULL;
    const uint64_t *before = index ? &buckets->splitter[index - 1] : NULL;
    bool is_share = before && after && *before == *after;
    *low = before ? *before + (!is_share && index > 1 && before[-1] == *before) : 0;
    *high = is_share ? *low : after ? *after - 1 : UINT64_MAX;
}

/* Pairs (part, material) to palette ids: a hash table beside ingest->palette. */
typedef struct palette_table {
    uint32_t *slots; /* palette id + 1; 0 = free */
    size_t size;     /* a power of two */
    uint32_t last;   /* the id found last */
} palette_table;

static size_t palette_slot(const palette_table *table, const strl_ingest *ingest, uint32_t part, uint32_t material)
{
    size_t at = strl__mix64((uint64_t)part << 32 | material) & (table->size - 1);
    while (table->slots[at]) {
        const strl_palette_entry *entry = &ingest->palette[table->slots[at] - 1];
        if (entry->part == part && entry->material == material)
            break;
        at = (at + 1) & (table->size - 1);
    }
    return at;
}

static bool palette_table_grow(palette_table *table, const strl_ingest *ingest)
{
    palette_table bigger = {.size = table->size ? table->size * 2 : 64};
    bigger.slots = strl__alloc_zero(bigger.size, sizeof *bigger.slots);
    if (!bigger.slots)
        return false;
    for (uint32_t i = 0; i < ingest->palette_count; i++)
        bigger.slots[palette_slot(&bigger, ingest, ingest->palette[i].part, ingest->palette[i].material)] = i + 1;
    strl__free(table->slots);
    *table = bigger;
    return true;
}

static bool palette_id(palette_table *table, strl_ingest *ingest, uint32_t part, uint32_t material, uint32_t *id)
{
    if (ingest->palette_count && ingest->palette[table->last].part == part &&
        ingest->palette[table->last].material == material) {
        *id = table->last;
        return true;
    }
    if (ingest->palette_count * 2 >= table->size && !palette_table_grow(table, ingest))
        return false;
    size_t at = palette_slot(table, ingest, part, material);
    if (!table->slots[at]) {
        if (!strl__grow(&ingest->palette, &ingest->palette_capacity, ingest->palette_count + 1,
                        sizeof *ingest->palette))
            return false;
        ingest->palette[ingest->palette_count++] = (strl_palette_entry){part, material, 0xffffffffu};
        table->slots[at] = (uint32_t)ingest->palette_count;
    }
    *id = table->last = table->slots[at] - 1;
    return true;
}

/* Over the range that the survey has found for the material. */
static uint32_t texcoord_code(const strl_reader_image *image, const float texcoord[2])
{
    uint32_t code[2];
    for (int k = 0; k < 2; k++) {
        double extent = (double)(image->texcoord_max[k] - image->texcoord_min[k]);
        double at =
            extent > 0 ? ((double)texcoord[k] - (double)image->texcoord_min[k]) / extent * STRL_TEXCOORD_MOST : 0;
        code[k] = (uint32_t)nearbyint(fmin(fmax(at, 0), STRL_TEXCOORD_MOST));
    }
    return code[0] | code[1] << 16;
}

/* False where two corners fall into one lattice cell. */
static bool to_lattice(const strl_ingest *ingest, const strl_reader *reader, const strl_triangle *in,
                       strl_soup_triangle *out, bool *lacks_normals)
{
    strl_reader_image image;
    bool has_texcoord =
        (in->flags & STRL_TRIANGLE_HAS_TEXCOORD) && strl_reader_material_image(reader, in->material, &image);
    for (int c = 0; c < 3; c++) {
        strl_soup_corner *corner = &out->corner[c];
        const float *n = in->normal[c];
        quantise(ingest, in->position[c], corner->position);
        corner->colour = in->flags & STRL_TRIANGLE_HAS_COLOUR ? in->colour[c] : 0xffffffffu;
        corner->texcoord = has_texcoord ? texcoord_code(&image, in->texcoord[c]) : 0;
        corner->normal[0] = corner->normal[1] = STRL_NORMAL_MISSING;
        float length2 = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
        if ((in->flags & STRL_TRIANGLE_HAS_NORMAL) && length2 > 0 && length2 < INFINITY)
            strl_oct_encode(n, corner->normal);
        else
            *lacks_normals = true;
    }
    return !strl__soup_has_collapsed(out);
}

#define COLLAPSED UINT32_MAX

/* A batch on its way to the buckets. */
typedef struct distributed {
    uint8_t *records; /* [capacity] packed, palette 0 */
    uint32_t *bucket; /* [capacity] or COLLAPSED */
    double longest2;  /* squared edge of those that collapsed */
    bool lacks_normals;
} distributed;

typedef struct distribution {
    strl_build_context *context;
    strl_ingest *ingest;
    strl_buckets *buckets;
    palette_table table;
    const strl_reader *reader; /* whose batches come */
    uint32_t part_base, material_base;
    size_t record_bytes;
    distributed *slots; /* [window of the pass] */
} distribution;

static double longest_edge2(const strl_triangle *triangle)
{
    double most = 0;
    for (unsigned c = 0; c < 3; c++) {
        const double *a = triangle->position[c], *b = triangle->position[(c + 1) % 3];
        double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
        most = fmax(most, x * x + y * y + z * z);
    }
    return most;
}

static strl_status place_batch(void *user, const strl_triangle_batch *batch, unsigned slot, unsigned worker,
                               strl_error *err)
{
    const distribution *d = user;
    const strl_ingest *ingest = d->ingest;
    distributed *out = &d->slots[slot];
    (void)worker;
    (void)err;
    out->lacks_normals = false;
    out->longest2 = 0;
    for (size_t i = 0; i < batch->count; i++) {
        strl_soup_triangle triangle = {.palette = 0};
        out->bucket[i] = COLLAPSED;
        if (!to_lattice(ingest, d->reader, &batch->triangle[i], &triangle, &out->lacks_normals)) {
            out->longest2 = fmax(out->longest2, longest_edge2(&batch->triangle[i]));
            continue;
        }
        strl__soup_pack(ingest, &triangle, out->records + i * d->record_bytes);
        out->bucket[i] = bucket_of(d->buckets, strl__curve_key_of_triangle(ingest, &triangle), batch->first + i);
    }
    return STRL_OK;
}

/* Palette ids are given in the order of the input. */
static strl_status put_triangle(distribution *d, const strl_triangle *triangle, uint8_t *record, uint32_t bucket,
                                strl_error *err)
{
    uint32_t palette;
    if (!palette_id(&d->table, d->ingest, d->part_base + triangle->part, d->material_base + triangle->material,
                    &palette))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu part and material pairs", d->ingest->palette_count);
    strl__soup_set_palette(d->ingest, palette, record);
    return strl_spill_append(d->buckets->spill[bucket], record, d->record_bytes, err);
}

static strl_status put_batch(void *user, const strl_triangle_batch *batch, unsigned slot, strl_error *err)
{
    distribution *d = user;
    const distributed *placed = &d->slots[slot];
    strl_ingest *ingest = d->ingest;
    strl_status status = STRL_OK;
    for (size_t i = 0; i < batch->count && !status; i++)
        if (placed->bucket[i] == COLLAPSED) {
            d->context->result->dropped_degenerate++;
        } else {
            status =
                put_triangle(d, &batch->triangle[i], placed->records + i * d->record_bytes, placed->bucket[i], err);
            ingest->triangle_count += !status;
        }
    ingest->lacks_normals |= placed->lacks_normals;
    d->context->result->dropped_longest = fmax(d->context->result->dropped_longest, sqrt(placed->longest2));
    return status ? status
                  : strl__build_report(d->context, ingest->triangle_count, d->context->result->triangles_in, err);
}

bool strl__ingest_add_image(strl_names *materials, size_t material, const strl_material_image *image)
{
    const size_t before = materials->image_capacity;
    if (!strl__grow(&materials->images, &materials->image_capacity, material + 1, sizeof *materials->images))
        return false;
    if (materials->image_capacity > before)
        memset(materials->images + before, 0, (materials->image_capacity - before) * sizeof *materials->images);
    strl_material_image *added = &materials->images[material];
    *added = *image;
    for (int k = 0; k < 2 && !(image->texcoord_extent[k] >= 0); k++) /* no triangle has any */
        added->texcoord_min[0] = added->texcoord_min[1] = added->texcoord_extent[0] = added->texcoord_extent[1] = 0;
    added->reference = strl__strdup(image->reference);
    return added->reference != NULL;
}

/* Materials after the last one with an image have no place among the images. */
bool strl__ingest_fill_images(strl_names *materials)
{
    const size_t before = materials->image_capacity;
    if (!materials->images)
        return true;
    if (!strl__grow(&materials->images, &materials->image_capacity, materials->count, sizeof *materials->images))
        return false;
    if (materials->image_capacity > before)
        memset(materials->images + before, 0, (materials->image_capacity - before) * sizeof *materials->images);
    return true;
}

static bool add_name(strl_names *names, const char *prefix, const char *name, uint32_t rgba, bool material)
{
    if (!strl__grow(&names->items, &names->capacity, names->count + 1, sizeof *names->items) ||
        (material && !strl__grow(&names->rgba, &names->rgba_capacity, names->count + 1, sizeof *names->rgba)))
        return false;
    size_t size = strlen(prefix) + strlen(name) + 2;
    char *text = strl__alloc(size, 1);
    if (!text)
        return false;
    snprintf(text, size, "%s%s%s", prefix, *prefix && *name ? "/" : "", name);
    if (material)
        names->rgba[names->count] = rgba;
    names->items[names->count++] = text;
    return true;
}

/* With several inputs each file is a group: FILE/part. */
static strl_status add_names(const strl_build_desc *desc, strl_ingest *ingest, const strl_reader *reader,
                             uint32_t input, strl_error *err)
{
    const char *slash = strrchr(desc->inputs[input], '/'), *file = slash ? slash + 1 : desc->inputs[input];
    bool good = true;
    for (uint32_t i = 0; i < strl_reader_part_count(reader) && good; i++)
        good = add_name(&ingest->parts, desc->input_count > 1 ? file : "", strl_reader_part_name(reader, i), 0, false);
    for (uint32_t i = 0; i < strl_reader_material_count(reader) && good; i++) {
        uint32_t rgba;
        const char *name = strl_reader_material(reader, i, &rgba);
        good = add_name(&ingest->materials, "", name, rgba, true);
        strl_reader_image image;
        if (good && strl_reader_material_image(reader, i, &image))
            good = strl__ingest_add_image(
                &ingest->materials, ingest->materials.count - 1,
                &(strl_material_image){.reference = image.reference,
                                       .wrap = {(strl_wrap)image.wrap[0], (strl_wrap)image.wrap[1]},
                                       .texcoord_min = {image.texcoord_min[0], image.texcoord_min[1]},
                                       .texcoord_extent = {image.texcoord_max[0] - image.texcoord_min[0],
                                                           image.texcoord_max[1] - image.texcoord_min[1]}});
    }
    return good ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "no memory for the names of %s", desc->inputs[input]);
}

strl_status strl__ingest_add_names(strl_build_context *context, strl_ingest *ingest, strl_error *err)
{
    strl_status status = STRL_OK;
    for (uint32_t i = 0; i < context->desc->input_count && !status; i++)
        status = add_names(context->desc, ingest, context->model->readers[i], i, err);
    if (!status && !strl__ingest_fill_images(&ingest->materials))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for the images of %zu materials", ingest->materials.count);
    return status;
}

static bool make_slots(distribution *d, const strl_batch_pass *pass)
{
    d->slots = strl__alloc_zero(pass->window, sizeof *d->slots);
    bool good = d->slots != NULL;
    for (unsigned i = 0; i < pass->window && good; i++) {
        d->slots[i].records = strl__alloc(pass->capacity, d->record_bytes);
        d->slots[i].bucket = strl__alloc(pass->capacity, sizeof *d->slots[i].bucket);
        good = d->slots[i].records && d->slots[i].bucket;
    }
    return good;
}

static strl_status distribute_inputs(distribution *d, strl_reader *const *readers, strl_error *err)
{
    strl_batch_pass pass;
    d->record_bytes = strl__soup_bucket_bytes(d->ingest);
    strl_status status = strl__batch_pass_create(d->context, d->record_bytes + sizeof *d->slots->bucket, &pass, err);
    pass.work = place_batch;
    pass.finish = put_batch;
    pass.user = d;
    if (!status && !make_slots(d, &pass))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory to read the input");
    for (uint32_t i = 0; i < d->context->desc->input_count && !status; i++) {
        d->reader = readers[i];
        if (strl__model_reads(d->context, i)) {
            status = strl__model_rewind(d->context, i, err);
            if (!status)
                status = strl__batch_pass_run(&pass, readers[i], err);
            if (d->context->desc->input_count > 1)
                strl_reader_rest(readers[i]);
        }
        d->part_base += strl_reader_part_count(readers[i]);
        d->material_base += strl_reader_material_count(readers[i]);
    }
    for (unsigned i = 0; d->slots && i < pass.window; i++) {
        strl__free(d->slots[i].records);
        strl__free(d->slots[i].bucket);
    }
    strl__free(d->slots);
    strl__batch_pass_deinit(&pass);
    return status;
}

strl_status strl__distribute(strl_build_context *context, strl_reader *const *readers, model_survey *survey,
                             bool octree, strl_ingest *ingest, strl_buckets *buckets, strl_error *err)
{
    distribution d = {.context = context, .ingest = ingest, .buckets = buckets};
    strl_status status = open_buckets(context, survey, ingest, octree, buckets, err);
    if (!status)
        status = distribute_inputs(&d, readers, err);
    if (!status)
        status = strl__ingest_add_names(context, ingest, err);
    for (size_t i = 0; i < ingest->palette_count && !status; i++)
        ingest->palette[i].rgba = ingest->materials.rgba[ingest->palette[i].material];
    if (!status && ingest->triangle_count == 0 && strl__model_is_plain(context))
        status = strl__ingest_refuse_collapsed(context, ingest, survey->triangles, err);
    strl__free(d.table.slots);
    return status;
}
