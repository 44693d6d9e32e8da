/* Second pass over the inputs: onto the lattice and into buckets, each a range of the curve that fits in memory. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"
#include "build/ingest/internal.h"
#include "geometry/octahedral.h"

/* Buckets decide where cells are cut, so their size must not depend on the number of threads, or the output would. Sorting takes
 * some three times a bucket: with this share up to 32 threads stay within the budget. */
#define SHARES_OF_MEMORY 96u

uint64_t strl__bucket_bytes(const strl_build_context *context)
{
    return context->memory_bytes / SHARES_OF_MEMORY;
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

/* Splitters at the quantiles of the sample. */
static strl_status open_buckets(strl_build_context *context, const model_survey *survey, const strl_ingest *ingest,
                                bucket_set *buckets, strl_error *err)
{
    uint64_t bytes = survey->triangles * strl__soup_bucket_bytes(ingest), each = strl__bucket_bytes(context) * 2 / 3;
    uint64_t wanted = bytes / (each ? each : 1) + 1;
    buckets->count = wanted > MAX_BUCKETS ? MAX_BUCKETS : (uint32_t)wanted;
    uint64_t *keys = strl__alloc(survey->sample_count, sizeof *keys);
    buckets->splitter = strl__alloc(buckets->count, sizeof *buckets->splitter);
    buckets->spill = strl__alloc_zero(buckets->count, sizeof(strl_spill *));
    strl_status status = STRL_OK;
    if (!keys || !buckets->splitter || !buckets->spill) {
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for %u buckets", buckets->count);
        goto done;
    }
    for (uint32_t i = 0; i < survey->sample_count; i++) {
        uint32_t cell[3];
        quantise(ingest, survey->sample[i], cell);
        keys[i] = strl__curve_key(ingest, cell);
    }
    qsort(keys, survey->sample_count, sizeof *keys, compare_keys);
    for (uint32_t i = 0; i + 1 < buckets->count; i++)
        buckets->splitter[i] = keys[(uint64_t)(i + 1) * survey->sample_count / buckets->count];
    for (uint32_t i = 0; i < buckets->count && !status; i++) {
        char name[32];
        snprintf(name, sizeof name, "bucket-%03u", i);
        status = strl_spill_open(context->spills, name, 64u << 10, &buckets->spill[i], err);
    }
done:
    strl__free(keys);
    return status;
}

void strl__buckets_deinit(bucket_set *buckets)
{
    for (uint32_t i = 0; buckets->spill && i < buckets->count; i++)
        strl_spill_close_and_delete(buckets->spill[i], NULL);
    strl__free(buckets->splitter);
    strl__free(buckets->spill);
    *buckets = (bucket_set){0};
}

static uint32_t bucket_of(const bucket_set *buckets, uint64_t key)
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
        if (!strl__grow(&ingest->palette, &ingest->palette_capacity, ingest->palette_count + 1, sizeof *ingest->palette))
            return false;
        ingest->palette[ingest->palette_count++] = (strl_palette_entry){part, material, 0xffffffffu};
        table->slots[at] = (uint32_t)ingest->palette_count;
    }
    *id = table->last = table->slots[at] - 1;
    return true;
}

static bool same_cell(const uint32_t a[3], const uint32_t b[3])
{
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

/* False where two corners fall into one lattice cell. */
static bool to_lattice(const strl_ingest *ingest, const strl_triangle *in, strl_soup_triangle *out, bool *lacks_normals)
{
    for (int c = 0; c < 3; c++) {
        strl_soup_corner *corner = &out->corner[c];
        const float *n = in->normal[c];
        quantise(ingest, in->position[c], corner->position);
        corner->colour = in->flags & STRL_TRIANGLE_HAS_COLOUR ? in->colour[c] : 0xffffffffu;
        corner->normal[0] = corner->normal[1] = STRL_NORMAL_MISSING;
        float length2 = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
        if ((in->flags & STRL_TRIANGLE_HAS_NORMAL) && length2 > 0 && length2 < INFINITY)
            strl_oct_encode(n, corner->normal);
        else
            *lacks_normals = true;
    }
    return !same_cell(out->corner[0].position, out->corner[1].position) &&
           !same_cell(out->corner[1].position, out->corner[2].position) &&
           !same_cell(out->corner[2].position, out->corner[0].position);
}

static void widen_box(strl_ingest *ingest, const strl_soup_triangle *triangle)
{
    for (int c = 0; c < 3; c++)
        for (int k = 0; k < 3; k++) {
            uint32_t value = triangle->corner[c].position[k];
            ingest->box_min[k] = value < ingest->box_min[k] ? value : ingest->box_min[k];
            ingest->box_max[k] = value > ingest->box_max[k] ? value : ingest->box_max[k];
        }
}

typedef struct distribution {
    strl_build_context *context;
    strl_ingest *ingest;
    bucket_set *buckets;
    palette_table table;
    uint32_t part_base, material_base;
    strl_triangle *batch; /* [READ_BATCH] */
} distribution;

static strl_status take_batch(distribution *d, size_t count, strl_error *err)
{
    strl_ingest *ingest = d->ingest;
    for (size_t i = 0; i < count; i++) {
        strl_soup_triangle triangle;
        uint8_t bytes[64];
        if (!to_lattice(ingest, &d->batch[i], &triangle, &ingest->lacks_normals)) {
            d->context->result->dropped_degenerate++;
            continue;
        }
        if (!palette_id(&d->table, ingest, d->part_base + d->batch[i].part, d->material_base + d->batch[i].material,
                        &triangle.palette))
            return strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu part and material pairs", ingest->palette_count);
        widen_box(ingest, &triangle);
        strl__soup_pack(ingest, &triangle, bytes);
        uint32_t to = bucket_of(d->buckets, strl__curve_key_of_triangle(ingest, &triangle));
        strl_status status = strl_spill_append(d->buckets->spill[to], bytes, strl__soup_bucket_bytes(ingest), err);
        if (status)
            return status;
        ingest->triangle_count++;
    }
    return STRL_OK;
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
static strl_status add_names(distribution *d, const strl_reader *reader, uint32_t input, strl_error *err)
{
    const strl_build_desc *desc = d->context->desc;
    const char *slash = strrchr(desc->inputs[input], '/'), *file = slash ? slash + 1 : desc->inputs[input];
    bool good = true;
    for (uint32_t i = 0; i < strl_reader_part_count(reader) && good; i++)
        good = add_name(&d->ingest->parts, desc->input_count > 1 ? file : "", strl_reader_part_name(reader, i), 0, false);
    for (uint32_t i = 0; i < strl_reader_material_count(reader) && good; i++) {
        uint32_t rgba;
        const char *name = strl_reader_material(reader, i, &rgba);
        good = add_name(&d->ingest->materials, "", name, rgba, true);
    }
    return good ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "no memory for the names of %s", desc->inputs[input]);
}

static strl_status distribute_input(distribution *d, strl_reader *reader, uint32_t input, strl_error *err)
{
    size_t count;
    strl_status status = strl_reader_rewind(reader, err);
    while (!status) {
        status = strl_reader_next(reader, d->batch, READ_BATCH, &count, err);
        if (status || !count)
            break;
        status = take_batch(d, count, err);
        if (!status)
            status = strl__build_report(d->context, d->ingest->triangle_count, d->context->result->triangles_in, err);
    }
    return status ? status : add_names(d, reader, input, err);
}

strl_status strl__distribute(strl_build_context *context, strl_reader *const *readers, const model_survey *survey,
                             strl_ingest *ingest, bucket_set *buckets, strl_error *err)
{
    distribution d = {.context = context, .ingest = ingest, .buckets = buckets};
    for (int k = 0; k < 3; k++) {
        ingest->box_min[k] = UINT32_MAX;
        ingest->box_max[k] = 0;
    }
    strl_status status = open_buckets(context, survey, ingest, buckets, err);
    d.batch = strl__alloc(READ_BATCH, sizeof *d.batch);
    if (!status && !d.batch)
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory to read the input");
    for (uint32_t i = 0; i < context->desc->input_count && !status; i++) {
        d.part_base = (uint32_t)ingest->parts.count;
        d.material_base = (uint32_t)ingest->materials.count;
        status = distribute_input(&d, readers[i], i, err);
    }
    for (size_t i = 0; i < ingest->palette_count && !status; i++)
        ingest->palette[i].rgba = ingest->materials.rgba[ingest->palette[i].material];
    if (!status && ingest->triangle_count == 0)
        status = strl__ingest_refuse_collapsed(context, ingest, survey->triangles, err);
    strl__free(d.batch);
    strl__free(d.table.slots);
    return status;
}
