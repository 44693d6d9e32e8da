/* The writer's life: an unfinished file and a spill of node records, tables, header last, then the name. */
#include "container/writer.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "container/names.h"
#include "container/writing.h"
#include "platform/file.h"

static strl_status check_desc(const strl_container_writer_desc *desc, strl_error *err)
{
    if (!desc->path || !desc->scratch_dir)
        return strl__fail(err, STRL_ERR_ARGUMENT, "a container's writer needs a path and a scratch folder");
    if (!memchr(desc->info.unit, 0, sizeof desc->info.unit))
        return strl__fail(err, STRL_ERR_ARGUMENT, "the unit's name is not terminated within %zu bytes",
                          sizeof desc->info.unit);
    if (desc->info.up_axis > 2)
        return strl__fail(err, STRL_ERR_ARGUMENT, "up axis is %" PRIu32 ", expected 0 to 2", desc->info.up_axis);
    return STRL_OK;
}

static strl_status open_files(strl_container_writer *writer, const strl_container_writer_desc *desc, strl_error *err)
{
    writer->path = strl__strdup(desc->path);
    if (!writer->path)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to create %s", desc->path);
    strl_status status =
        strl_output_open(desc->path, desc->part_dir ? desc->part_dir : desc->scratch_dir, &writer->output, err);
    if (status != STRL_OK)
        return status;
    writer->sink.file = strl_output_file(writer->output);
    return strl_file_create_nameless(desc->scratch_dir, &writer->spill, err);
}

strl_status strl_container_writer_create(const strl_container_writer_desc *desc, strl_container_writer **writer,
                                         strl_error *err)
{
    *writer = NULL;
    strl_status status = check_desc(desc, err);
    if (status != STRL_OK)
        return status;
    strl_container_writer *made = strl__alloc_zero(1, sizeof *made);
    if (!made)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to create %s", desc->path);
    made->header.info = desc->info;
    made->header.info.tree_count = 0;
    made->sink.end = STRL__HEADER_BYTES;
    /* A unit's bytes after its end are the caller's garbage; the file's are zero. */
    size_t unit_length = strlen(desc->info.unit);
    memset(made->header.info.unit + unit_length, 0, sizeof made->header.info.unit - unit_length);
    status = strl__page_table_writer_create(&made->placements, err);
    if (status == STRL_OK)
        status = strl__page_table_writer_create(&made->parts, err);
    if (status == STRL_OK)
        status = strl__page_table_writer_create(&made->materials, err);
    if (status == STRL_OK)
        status = strl__page_table_writer_create(&made->images, err);
    if (status == STRL_OK)
        status = strl__page_table_writer_create(&made->runs, err);
    if (status == STRL_OK)
        status = open_files(made, desc, err);
    if (status != STRL_OK)
        strl_container_writer_destroy(made);
    else
        *writer = made;
    return status;
}

/* Grows the world's bounds by the tree's box, placed. */
static void add_bounds(strl_container_writer *writer, const strl_placement *placement)
{
    const strl_tree *tree = &writer->trees[placement->tree].facts;
    double *bounds = writer->header.info.bounds;
    for (unsigned corner = 0; corner < 8; corner++) {
        double point[3];
        for (int axis = 0; axis < 3; axis++)
            point[axis] = tree->origin[axis] +
                          tree->step * (double)(corner >> axis & 1 ? tree->box_max[axis] : tree->box_min[axis]);
        for (int axis = 0; axis < 3; axis++) {
            const double *row = placement->transform + (ptrdiff_t)4 * axis;
            double at = row[0] * point[0] + row[1] * point[1] + row[2] * point[2] + row[3];
            if (!writer->bounds_begun || at < bounds[axis])
                bounds[axis] = at;
            if (!writer->bounds_begun || at > bounds[axis + 3])
                bounds[axis + 3] = at;
        }
        writer->bounds_begun = true;
    }
}

static strl_status add_placement(strl_container_writer *writer, const strl_placement *placement, strl_error *err)
{
    if (placement->tree >= writer->header.info.tree_count)
        return strl__fail(err, STRL_ERR_ARGUMENT,
                          "a placement of tree %" PRIu32 ", but %" PRIu32 " trees have ended so far", placement->tree,
                          writer->header.info.tree_count);
    uint8_t bytes[STRL__PLACEMENT_BYTES];
    strl_writer out = {.data = bytes, .capacity = sizeof bytes};
    strl_writer_u32(&out, placement->tree);
    strl_writer_u32(&out, placement->own_part);
    for (int i = 0; i < 12; i++) {
        if (!isfinite(placement->transform[i]))
            return strl__fail(err, STRL_ERR_ARGUMENT, "number %d of a placement's transform is not finite", i);
        strl_writer_f64(&out, placement->transform[i]);
    }
    strl_status status = writer->run_count == STRL_RUN_PLACEMENTS ? strl__writing_end_run(writer, err) : STRL_OK;
    if (status != STRL_OK)
        return status;
    add_bounds(writer, placement);
    writer->run[writer->run_count++] = *placement;
    return strl__page_table_writer_add(writer->placements, &writer->sink, bytes, sizeof bytes, NULL, 0, err);
}

strl_status strl_container_writer_add_placement(strl_container_writer *writer, const strl_placement *placement,
                                                strl_error *err)
{
    strl_status status = add_placement(writer, placement, err);
    writer->failed |= status != STRL_OK;
    return status;
}

/* How many bytes two names begin with alike. */
static uint32_t shared_bytes(const strl__name *last, const uint8_t *name, uint32_t bytes)
{
    uint32_t most = bytes < last->bytes ? bytes : last->bytes, shared = 0;
    while (shared < most && name[shared] == last->text[shared])
        shared++;
    return shared;
}

/* Told by the name before it in its page (docs/format.md, "Part"). head has room for the two bytes behind it. */
static strl_status add_after(strl_container_writer *writer, strl__page_table_writer *table, strl__name *last,
                             uint8_t *head, uint32_t head_bytes, const uint8_t *name, uint32_t bytes, strl_error *err)
{
    uint32_t shared = shared_bytes(last, name, bytes);
    if (strl__page_table_writer_begins(table, head_bytes + 2 + bytes - shared))
        shared = 0;
    strl__store_le(head + head_bytes, 2, shared);
    memcpy(last->text + shared, name + shared, bytes - shared);
    last->bytes = bytes;
    return strl__page_table_writer_add(table, &writer->sink, head, head_bytes + 2, name + shared, bytes - shared, err);
}

static strl_status add_name(strl_container_writer *writer, strl__page_table_writer *table, strl__name *last,
                            uint8_t *head, uint32_t head_bytes, const char *name, strl_error *err)
{
    uint8_t clean[STRL__MAX_NAME_BYTES];
    size_t bytes = 0;
    strl_status status;
    if (name && !strl__utf8_clean(name, clean, sizeof clean, &bytes))
        status = strl__fail(err, STRL_ERR_LIMIT, "the name that begins with \"%.40s\" is longer than %u bytes", name,
                            STRL__MAX_NAME_BYTES);
    else if (strl__page_table_writer_count(table) >= STRL_NONE - 1)
        status =
            strl__fail(err, STRL_ERR_LIMIT, "a container holds at most %" PRIu32 " names of a kind", STRL_NONE - 1);
    else
        status = add_after(writer, table, last, head, head_bytes, clean, (uint32_t)bytes, err);
    writer->failed |= status != STRL_OK;
    return status;
}

strl_status strl_container_writer_add_part(strl_container_writer *writer, const char *name, strl_error *err)
{
    uint8_t head[2];
    return add_name(writer, writer->parts, &writer->last_part, head, 0, name, err);
}

strl_status strl_container_writer_add_material(strl_container_writer *writer, const char *name, uint32_t rgba,
                                               strl_error *err)
{
    uint8_t head[STRL__MATERIAL_HEAD_BYTES + 2];
    strl__store_le(head, STRL__MATERIAL_HEAD_BYTES, rgba);
    return add_name(writer, writer->materials, &writer->last_material, head, STRL__MATERIAL_HEAD_BYTES, name, err);
}

/* References are told whole: there are few. */
static strl_status add_image(strl_container_writer *writer, const uint8_t *head, uint32_t head_bytes,
                             const char *reference, strl_error *err)
{
    uint8_t clean[STRL__MAX_NAME_BYTES];
    size_t bytes = 0;
    strl_status status;
    if (reference && !strl__utf8_clean(reference, clean, sizeof clean, &bytes))
        status = strl__fail(err, STRL_ERR_LIMIT, "the name of the image \"%.40s\" is longer than %u bytes", reference,
                            STRL__MAX_NAME_BYTES);
    else if (strl__page_table_writer_count(writer->images) >= STRL_NONE - 1)
        status = strl__fail(err, STRL_ERR_LIMIT, "a container holds at most %" PRIu32 " images", STRL_NONE - 1);
    else
        status =
            strl__page_table_writer_add(writer->images, &writer->sink, head, head_bytes, clean, (uint32_t)bytes, err);
    writer->failed |= status != STRL_OK;
    return status;
}

strl_status strl_container_writer_add_image(strl_container_writer *writer, const strl_material_image *image,
                                            strl_error *err)
{
    uint8_t head[STRL__IMAGE_HEAD_BYTES];
    strl_writer out = {.data = head, .capacity = sizeof head};
    if (!image->reference)
        return add_image(writer, NULL, 0, NULL, err);
    strl_writer_u8(&out, (uint8_t)image->wrap[0]);
    strl_writer_u8(&out, (uint8_t)image->wrap[1]);
    strl_writer_u16(&out, 0);
    for (int k = 0; k < 2; k++)
        strl_writer_f32(&out, image->texcoord_min[k]);
    for (int k = 0; k < 2; k++)
        strl_writer_f32(&out, image->texcoord_extent[k]);
    return add_image(writer, head, sizeof head, image->reference, err);
}

void strl_container_writer_describe(strl_container_writer *writer, const strl_container_info *info)
{
    strl_container_info *own = &writer->header.info;
    own->has_colour = info->has_colour;
    own->triangles_in = info->triangles_in;
    own->dropped_nonfinite = info->dropped_nonfinite;
    own->dropped_degenerate = info->dropped_degenerate;
    own->dropped_lines = info->dropped_lines;
    own->dropped_points = info->dropped_points;
}

static strl_status add_defaults(strl_container_writer *writer, strl_error *err)
{
    strl_status status = STRL_OK;
    bool none_placed = strl__page_table_writer_count(writer->placements) == 0;
    for (uint32_t tree = 0; status == STRL_OK && none_placed && tree < writer->header.info.tree_count; tree++) {
        const strl_placement as_it_is = {.tree = tree, .transform = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};
        status = add_placement(writer, &as_it_is, err);
    }
    if (status == STRL_OK && strl__page_table_writer_count(writer->parts) == 0)
        status = strl_container_writer_add_part(writer, "", err);
    if (status == STRL_OK && strl__page_table_writer_count(writer->materials) == 0)
        status = strl_container_writer_add_material(writer, "", 0xffffffff, err);
    return status;
}

static strl_status write_trees(strl_container_writer *writer, strl__section *section, strl_error *err)
{
    uint32_t count = writer->header.info.tree_count;
    uint8_t *bytes = strl__alloc(count, STRL__TREE_BYTES);
    if (!bytes)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the records of %" PRIu32 " trees", count);
    for (uint32_t i = 0; i < count; i++)
        strl__tree_encode(&writer->trees[i].facts, &writer->trees[i].root, bytes + (size_t)i * STRL__TREE_BYTES);
    section->item_count = count;
    strl_status status = strl__sink_append(&writer->sink, bytes, count * STRL__TREE_BYTES, &section->ref, err);
    strl__free(bytes);
    return status;
}

static strl_status write_sections(strl_container_writer *writer, strl_error *err)
{
    strl__section *sections = writer->header.sections;
    for (uint32_t i = 0; i < STRL__KNOWN_SECTIONS; i++)
        sections[i] = (strl__section){.kind = i + 1};
    strl__sink *sink = &writer->sink;
    bool has_runs = strl__page_table_writer_count(writer->runs) > 0;
    strl_status status = has_runs ? strl__writing_end_run(writer, err) : STRL_OK;
    if (status == STRL_OK)
        status = strl__page_table_writer_finish(writer->placements, sink, &sections[STRL__SECTION_PLACEMENTS - 1], err);
    if (status == STRL_OK && has_runs)
        status = strl__page_table_writer_finish(writer->runs, sink, &sections[STRL__SECTION_RUNS - 1], err);
    if (status == STRL_OK)
        status = strl__page_table_writer_finish(writer->parts, sink, &sections[STRL__SECTION_PARTS - 1], err);
    if (status == STRL_OK)
        status = strl__page_table_writer_finish(writer->materials, sink, &sections[STRL__SECTION_MATERIALS - 1], err);
    if (status == STRL_OK && strl__page_table_writer_count(writer->images))
        status = strl__page_table_writer_finish(writer->images, sink, &sections[STRL__SECTION_IMAGES - 1], err);
    if (status == STRL_OK)
        status = write_trees(writer, &sections[STRL__SECTION_TREES - 1], err);
    return status;
}

static strl_status check_bounds(const strl_container_info *info, strl_error *err)
{
    for (int i = 0; i < 6; i++)
        if (!isfinite(info->bounds[i]))
            return strl__fail(err, STRL_ERR_LIMIT, "the placed model reaches beyond the numbers of a double on axis %d",
                              i % 3);
    return STRL_OK;
}

static strl_status finish(strl_container_writer *writer, strl_error *err)
{
    if (writer->failed || writer->in_tree || writer->renamed || writer->header.info.tree_count == 0)
        return strl__fail(err, STRL_ERR_ARGUMENT, "%s cannot be finished: %s", writer->path,
                          writer->failed    ? "an earlier call has failed"
                          : writer->in_tree ? "a tree has not ended"
                          : writer->renamed ? "it is already"
                                            : "it has no tree");
    strl_status status = add_defaults(writer, err);
    if (status == STRL_OK)
        status = check_bounds(&writer->header.info, err);
    if (status == STRL_OK)
        status = write_sections(writer, err);
    if (status != STRL_OK)
        return status;
    uint8_t bytes[STRL__HEADER_BYTES];
    writer->header.info.file_bytes = writer->sink.end;
    strl__header_encode(&writer->header, bytes);
    status = strl_file_write(writer->sink.file, 0, bytes, sizeof bytes, err);
    if (status == STRL_OK)
        status = strl_output_finish(writer->output, true, err);
    writer->renamed = status == STRL_OK;
    return status;
}

strl_status strl_container_writer_finish(strl_container_writer *writer, uint64_t *bytes_out, strl_error *err)
{
    strl_status status = finish(writer, err);
    *bytes_out = status == STRL_OK ? writer->header.info.file_bytes : 0;
    writer->failed |= status != STRL_OK;
    return status;
}

void strl_container_writer_destroy(strl_container_writer *writer)
{
    if (!writer)
        return;
    strl_output_close(writer->output);
    strl_file_close(writer->spill, NULL);
    strl__page_table_writer_destroy(writer->placements);
    strl__page_table_writer_destroy(writer->parts);
    strl__page_table_writer_destroy(writer->materials);
    strl__page_table_writer_destroy(writer->images);
    strl__page_table_writer_destroy(writer->runs);
    strl__free(writer->trees);
    strl__free(writer->page.data);
    strl__free(writer->path);
    strl__free(writer);
}
