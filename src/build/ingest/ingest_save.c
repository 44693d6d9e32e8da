/* What ingest has found, in the streams of a checkpoint. Sizes that follow from others are not told twice. */
#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "build/ingest/internal.h"
#include "build/saved.h"

#define EDGE_BYTES 12u
#define CELL_BYTES 4u
#define PALETTE_BYTES 8u
#define NUMBER_BYTES 91u /* what write_numbers writes */
#define IMAGE_BYTES 28u
#define MOST_CURVE_SHIFT 10u /* of positions below 2^31 the curve has 21 bits */

/* ---- writing ---- */

static void write_numbers(const strl_ingest *ingest, strl_writer *writer)
{
    for (int k = 0; k < 3; k++)
        strl_writer_f64(writer, ingest->origin[k]);
    strl_writer_f64(writer, ingest->step);
    strl_writer_f32(writer, ingest->leaf_error);
    strl_writer_u8(writer, (uint8_t)ingest->curve_shift);
    strl_writer_u8(writer, (uint8_t)ingest->curve_spare);
    strl_writer_u8(writer, (uint8_t)ingest->up);
    strl_writer_bytes(writer, ingest->unit, sizeof ingest->unit);
    strl_writer_u8(writer, (uint8_t)(ingest->has_normals | ingest->has_colours << 1 | ingest->lacks_normals << 2 |
                                     ingest->has_texcoords << 3));
    strl_writer_u64(writer, ingest->triangle_count);
    strl_writer_u32(writer, ingest->cell_count);
    strl_writer_u64(writer, ingest->palette_count);
    strl_writer_u64(writer, ingest->parts.count);
    strl_writer_u64(writer, ingest->materials.count);
}

static strl_status write_names(const strl_names *names, strl_saved_writer *saved, strl_error *err)
{
    strl_status status = STRL_OK;
    for (size_t i = 0; i < names->count && !status; i++) {
        size_t length = strlen(names->items[i]);
        strl_writer_u32(&saved->bytes, (uint32_t)length);
        strl_writer_u32(&saved->bytes, names->rgba ? names->rgba[i] : 0);
        strl_writer_bytes(&saved->bytes, names->items[i], length);
        status = strl_saved_put(saved, err);
    }
    return status;
}

/* Each with its material. */
static strl_status write_images(const strl_names *materials, strl_saved_writer *saved, strl_error *err)
{
    strl_status status = STRL_OK;
    for (size_t i = 0; materials->images && i < materials->count && !status; i++) {
        const strl_material_image *image = &materials->images[i];
        if (!image->reference)
            continue;
        strl_writer_u32(&saved->bytes, (uint32_t)i);
        strl_writer_u32(&saved->bytes, (uint32_t)image->wrap[0] | (uint32_t)image->wrap[1] << 8);
        for (int k = 0; k < 2; k++) {
            strl_writer_f32(&saved->bytes, image->texcoord_min[k]);
            strl_writer_f32(&saved->bytes, image->texcoord_extent[k]);
        }
        strl_writer_u32(&saved->bytes, (uint32_t)strlen(image->reference));
        strl_writer_bytes(&saved->bytes, image->reference, strlen(image->reference));
        status = strl_saved_put(saved, err);
    }
    return status;
}

static strl_status write_ingest(const strl_ingest *ingest, strl_saved_writer *saved, strl_error *err)
{
    strl_status status = STRL_OK;
    write_numbers(ingest, &saved->bytes);
    for (uint32_t i = 0; i < ingest->cell_count && !status; i++) {
        strl_writer_u32(&saved->bytes, ingest->cells[i].count);
        status = strl_saved_put(saved, err);
    }
    for (size_t i = 0; i < ingest->palette_count && !status; i++) {
        strl_writer_u32(&saved->bytes, ingest->palette[i].part);
        strl_writer_u32(&saved->bytes, ingest->palette[i].material);
        status = strl_saved_put(saved, err);
    }
    if (!status)
        status = write_names(&ingest->parts, saved, err);
    if (!status)
        status = write_names(&ingest->materials, saved, err);
    return status ? status : write_images(&ingest->materials, saved, err);
}

static strl_status write_edges(const strl_ingest *ingest, strl_saved_writer *saved, strl_error *err)
{
    strl_status status = STRL_OK;
    for (size_t i = 0; i < ingest->edge_count && !status; i++) {
        strl_writer_u32(&saved->bytes, ingest->edges[i].a);
        strl_writer_u32(&saved->bytes, ingest->edges[i].b);
        strl_writer_u32(&saved->bytes, ingest->edges[i].weight);
        status = strl_saved_put(saved, err);
    }
    return status;
}

strl_status strl__ingest_save_facts(strl_build_context *context, const strl_ingest *ingest, strl_error *err)
{
    strl_saved_writer saved = {0};
    strl_status status = strl__build_open_stream(context, "ingest", &saved.spill, err);
    return status ? status : strl_saved_finish(&saved, write_ingest(ingest, &saved, err), err);
}

strl_status strl_ingest_save(strl_build_context *context, const strl_ingest *ingest, strl_spill **graph,
                             strl_error *err)
{
    strl_saved_writer saved = {0};
    *graph = NULL;
    strl_status status = strl__ingest_save_facts(context, ingest, err);
    if (!status)
        status = strl__build_open_stream(context, "graph", graph, err);
    saved.spill = *graph;
    return status ? status : strl_saved_finish(&saved, write_edges(ingest, &saved, err), err);
}

/* ---- reading ---- */

static bool read_numbers(strl_cursor *cursor, strl_ingest *ingest)
{
    for (int k = 0; k < 3; k++)
        ingest->origin[k] = strl_cursor_f64(cursor);
    ingest->step = strl_cursor_f64(cursor);
    ingest->leaf_error = strl_cursor_f32(cursor);
    ingest->curve_shift = strl_cursor_u8(cursor);
    ingest->curve_spare = strl_cursor_u8(cursor);
    unsigned up = strl_cursor_u8(cursor);
    const uint8_t *unit = strl_cursor_take(cursor, sizeof ingest->unit);
    unsigned flags = strl_cursor_u8(cursor);
    ingest->up = (strl_axis)(up % 3);
    if (unit)
        memcpy(ingest->unit, unit, sizeof ingest->unit - 1);
    ingest->has_normals = flags & 1;
    ingest->has_colours = flags >> 1 & 1;
    ingest->lacks_normals = flags >> 2 & 1;
    ingest->has_texcoords = flags >> 3 & 1;
    ingest->triangle_count = strl_cursor_u64(cursor);
    ingest->cell_count = strl_cursor_u32(cursor);
    ingest->palette_count = (size_t)strl_cursor_u64(cursor);
    ingest->parts.count = ingest->materials.count = 0; /* grow with the names */
    bool finite = isfinite(ingest->origin[0]) && isfinite(ingest->origin[1]) && isfinite(ingest->origin[2]);
    return finite && ingest->step > 0 && isfinite(ingest->step) && ingest->leaf_error > 0 &&
           isfinite(ingest->leaf_error) && ingest->curve_shift <= MOST_CURVE_SHIFT && ingest->curve_spare <= 20 &&
           up < 3 && flags < 16;
}

static strl_status read_cells(strl_saved_reader *saved, strl_ingest *ingest, strl_error *err)
{
    uint64_t first = 0;
    strl_status status = STRL_OK;
    if (!ingest->cell_count || ingest->cell_count > strl_saved_left(saved) / CELL_BYTES)
        return strl_saved_fail("the number of cells", err);
    ingest->cells = strl__alloc(ingest->cell_count, sizeof *ingest->cells);
    if (!ingest->cells)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %u cells", ingest->cell_count);
    for (uint32_t i = 0; i < ingest->cell_count && !status; i++) {
        status = strl_saved_get(saved, CELL_BYTES, err);
        ingest->cells[i] = (strl_cell){first, status ? 0 : strl_cursor_u32(&saved->cursor)};
        first += ingest->cells[i].count;
    }
    return status || first == ingest->triangle_count ? status : strl_saved_fail("the triangles of the cells", err);
}

static strl_status read_palette(strl_saved_reader *saved, strl_ingest *ingest, strl_error *err)
{
    size_t count = ingest->palette_count;
    strl_status status = STRL_OK;
    if (!count || count > strl_saved_left(saved) / PALETTE_BYTES)
        return strl_saved_fail("the number of parts and materials", err);
    ingest->palette = strl__alloc_zero(count, sizeof *ingest->palette);
    ingest->palette_capacity = count;
    if (!ingest->palette)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu part and material pairs", count);
    for (size_t i = 0; i < count && !status; i++) {
        status = strl_saved_get(saved, PALETTE_BYTES, err);
        if (!status) {
            ingest->palette[i].part = strl_cursor_u32(&saved->cursor);
            ingest->palette[i].material = strl_cursor_u32(&saved->cursor);
        }
    }
    return status;
}

static strl_status read_name(strl_saved_reader *saved, strl_names *names, bool is_material, strl_error *err)
{
    strl_status status = strl_saved_get(saved, 8, err);
    if (status)
        return status;
    uint32_t length = strl_cursor_u32(&saved->cursor), rgba = strl_cursor_u32(&saved->cursor);
    status = strl_saved_get(saved, length, err);
    if (status)
        return status;
    const uint8_t *text = strl_cursor_take(&saved->cursor, length);
    char *copy = NULL;
    if (strl__grow(&names->items, &names->capacity, names->count + 1, sizeof *names->items) &&
        (!is_material || strl__grow(&names->rgba, &names->rgba_capacity, names->count + 1, sizeof *names->rgba)))
        copy = strl__alloc((size_t)length + 1, 1);
    if (!copy)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the names of the parts");
    if (length)
        memcpy(copy, text, length);
    copy[length] = 0;
    if (is_material)
        names->rgba[names->count] = rgba;
    names->items[names->count++] = copy;
    return strlen(copy) == length ? STRL_OK : strl_saved_fail("a name", err);
}

static strl_status read_names(strl_saved_reader *saved, strl_ingest *ingest, uint64_t parts, uint64_t materials,
                              strl_error *err)
{
    strl_status status = STRL_OK;
    for (uint64_t i = 0; i < parts && !status; i++)
        status = read_name(saved, &ingest->parts, false, err);
    for (uint64_t i = 0; i < materials && !status; i++)
        status = read_name(saved, &ingest->materials, true, err);
    for (size_t i = 0; i < ingest->palette_count && !status; i++) {
        strl_palette_entry *entry = &ingest->palette[i];
        if (entry->part >= parts || entry->material >= materials)
            return strl_saved_fail("a part or material", err);
        entry->rgba = ingest->materials.rgba[entry->material];
    }
    return status;
}

static strl_status read_image(strl_saved_reader *saved, strl_names *materials, strl_error *err)
{
    strl_material_image image = {0};
    char reference[1024];
    strl_status status = strl_saved_get(saved, IMAGE_BYTES, err);
    if (status)
        return status;
    uint32_t material = strl_cursor_u32(&saved->cursor), wrap = strl_cursor_u32(&saved->cursor);
    for (int k = 0; k < 2; k++) {
        image.wrap[k] = (strl_wrap)(wrap >> 8 * k & 255);
        image.texcoord_min[k] = strl_cursor_f32(&saved->cursor);
        image.texcoord_extent[k] = strl_cursor_f32(&saved->cursor);
    }
    uint32_t length = strl_cursor_u32(&saved->cursor);
    if (material >= materials->count || length >= sizeof reference || (wrap & 0xff) > STRL_WRAP_MIRROR ||
        wrap >> 8 > STRL_WRAP_MIRROR ||
        (materials->images && material < materials->image_capacity && materials->images[material].reference))
        return strl_saved_fail("the image of a material", err);
    status = strl_saved_get(saved, length, err);
    if (status)
        return status;
    memcpy(reference, strl_cursor_take(&saved->cursor, length), length);
    reference[length] = 0;
    image.reference = reference;
    return strl__ingest_add_image(materials, material, &image)
               ? STRL_OK
               : strl__fail(err, STRL_ERR_MEMORY, "no memory for the images of the materials");
}

static strl_status read_ingest(strl_saved_reader *saved, bool with_cells, strl_ingest *ingest, strl_error *err)
{
    strl_status status = strl_saved_get(saved, NUMBER_BYTES, err);
    if (status)
        return status;
    if (!read_numbers(&saved->cursor, ingest))
        return strl_saved_fail("the numbers of the lattice", err);
    uint64_t parts = strl_cursor_u64(&saved->cursor), materials = strl_cursor_u64(&saved->cursor);
    if (with_cells)
        status = read_cells(saved, ingest, err);
    else if (ingest->cell_count)
        status = strl_saved_fail("the number of cells", err);
    if (!status)
        status = read_palette(saved, ingest, err);
    if (!status)
        status = read_names(saved, ingest, parts, materials, err);
    while (!status && strl_saved_left(saved))
        status = read_image(saved, &ingest->materials, err);
    if (!status && !strl__ingest_fill_images(&ingest->materials))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for the images of the materials");
    return status;
}

static strl_status read_edges(strl_saved_reader *saved, strl_ingest *ingest, strl_error *err)
{
    uint64_t count = strl_saved_left(saved) / EDGE_BYTES;
    strl_status status = STRL_OK;
    if (strl_saved_left(saved) % EDGE_BYTES || count > INT32_MAX / 2) /* METIS counts both directions */
        return strl_saved_fail("the graph of the cells", err);
    ingest->edges = strl__alloc((size_t)count, sizeof *ingest->edges);
    if (!ingest->edges)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the graph of %u cells", ingest->cell_count);
    for (uint64_t i = 0; i < count && !status; i++) {
        status = strl_saved_get(saved, EDGE_BYTES, err);
        if (status)
            break;
        strl_cell_edge *edge = &ingest->edges[ingest->edge_count++];
        edge->a = strl_cursor_u32(&saved->cursor);
        edge->b = strl_cursor_u32(&saved->cursor);
        edge->weight = strl_cursor_u32(&saved->cursor);
        if (edge->a >= edge->b || edge->b >= ingest->cell_count || !edge->weight || edge->weight > INT32_MAX)
            status = strl_saved_fail("the graph of the cells", err);
    }
    return status;
}

static strl_status take_soup(strl_build_context *context, strl_ingest *ingest, strl_error *err)
{
    strl_status status = strl_spill_take(context->spills, "soup", &ingest->soup, err);
    if (!status)
        status = strl_spill_take(context->spills, "shared", &ingest->shared, err);
    uint64_t bytes = status ? 0 : strl_spill_bytes(ingest->soup), each = strl_soup_bytes(ingest);
    if (!status && (bytes % each != 0 || bytes / each != ingest->triangle_count))
        status = strl_saved_fail("the number of triangles", err);
    return status;
}

strl_status strl__ingest_restore_facts(strl_build_context *context, bool with_cells, strl_ingest *ingest,
                                       strl_error *err)
{
    strl_saved_reader saved = {0};
    *ingest = (strl_ingest){0};
    strl_status status = strl_spill_take(context->spills, "ingest", &saved.spill, err);
    if (!status)
        status = read_ingest(&saved, with_cells, ingest, err);
    strl_saved_reader_deinit(&saved);
    return status;
}

strl_status strl_ingest_restore(strl_build_context *context, bool with_edges, bool with_soup, strl_ingest *ingest,
                                strl_spill **graph, strl_error *err)
{
    strl_saved_reader saved = {0};
    *graph = NULL;
    strl_status status = strl__ingest_restore_facts(context, true, ingest, err);
    if (!status && with_soup)
        status = take_soup(context, ingest, err);
    if (!status && with_edges)
        status = strl_spill_take(context->spills, "graph", graph, err);
    saved.spill = *graph;
    if (!status && with_edges)
        status = read_edges(&saved, ingest, err);
    strl_saved_reader_deinit(&saved);
    return status;
}
