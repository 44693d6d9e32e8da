/* Opening a container: header and trees section, nothing more. */
#include "container/container.h"

#include <inttypes.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "container/opened.h"

static strl_status read_header(strl_container *container, strl_error *err)
{
    uint8_t bytes[STRL__HEADER_BYTES];
    uint64_t source_bytes = container->source->bytes;
    if (source_bytes < STRL__HEADER_BYTES)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "the file has %" PRIu64 " bytes, expected at least the %u of a container's header",
                          source_bytes, STRL__HEADER_BYTES);
    strl_status status;
    unsigned attempt = 1;
    do {
        status = strl_source_read(container->source, 0, bytes, sizeof bytes, err);
        if (status == STRL_OK)
            status = strl__header_decode(bytes, source_bytes, &container->header, err);
    } while (status == STRL_ERR_FORMAT && strl_source_ask_again(container->source, &attempt, 0, sizeof bytes));
    return status;
}

static strl_status decode_trees(strl_container *container, const uint8_t *bytes, strl_error *err)
{
    uint32_t count = container->header.info.tree_count;
    container->trees = strl__alloc_zero(count, sizeof *container->trees);
    if (!container->trees)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %" PRIu32 " trees", count);
    strl_status status = STRL_OK;
    for (uint32_t i = 0; status == STRL_OK && i < count; i++)
        status = strl__tree_decode(bytes + (size_t)i * STRL__TREE_BYTES, i, container->header.info.file_bytes,
                                   &container->trees[i].facts, &container->trees[i].root, err);
    return status;
}

static strl_status read_trees(strl_container *container, strl_error *err)
{
    const strl_treelet_ref *ref = &container->header.sections[STRL__SECTION_TREES - 1].ref;
    uint8_t *bytes = strl__alloc(ref->bytes, 1); /* the header's check bounds it by 512 records */
    if (!bytes)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the %" PRIu32 " bytes of the trees section", ref->bytes);
    const strl_source_span span = {ref->offset, ref->bytes, bytes, ref->checksum};
    strl_status status = strl_source_read_known(container->source, &span, err);
    uint64_t found = status == STRL_OK ? strl__checksum(bytes, ref->bytes) : 0;
    if (status == STRL_OK && found != ref->checksum) {
        strl_source_doubt(container->source, ref->offset, ref->bytes);
        status = strl__fail(err, STRL_ERR_FORMAT,
                            "section trees at byte %" PRIu64 ": checksum is %016" PRIx64 ", expected %016" PRIx64,
                            ref->offset, found, ref->checksum);
    }
    if (status == STRL_OK)
        status = decode_trees(container, bytes, err);
    strl__free(bytes);
    return status;
}

strl_status strl_container_open(strl_source *source, strl_container **container, strl_error *err)
{
    *container = NULL;
    strl_container *made = strl__alloc_zero(1, sizeof *made);
    if (!made) {
        strl_source_close(source);
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to open a container");
    }
    made->source = source;
    strl_status status = read_header(made, err);
    if (status == STRL_OK)
        status = read_trees(made, err);
    if (status != STRL_OK) {
        strl_source_fail(source, status, err);
        strl_container_close(made);
        return status;
    }
    const strl__section *sections = made->header.sections;
    made->placements = (strl__table){.name = "placements", .section = sections[STRL__SECTION_PLACEMENTS - 1]};
    made->parts = (strl__table){.name = "parts", .section = sections[STRL__SECTION_PARTS - 1]};
    made->materials = (strl__table){.name = "materials", .section = sections[STRL__SECTION_MATERIALS - 1]};
    made->images = (strl__table){.name = "images", .section = sections[STRL__SECTION_IMAGES - 1]};
    made->runs = (strl__table){.name = "runs", .section = sections[STRL__SECTION_RUNS - 1]};
    *container = made;
    return STRL_OK;
}

strl_status strl_container_open_path(const char *path, strl_container **container, strl_error *err)
{
    strl_source *source;
    *container = NULL;
    strl_status status = strl_source_open_file(path, 0, &source, err);
    return status == STRL_OK ? strl_container_open(source, container, err) : status;
}

void strl_container_close(strl_container *container)
{
    if (!container)
        return;
    strl__opened_forget_nodes(container);
    strl__page_table_deinit(&container->placements);
    strl__page_table_deinit(&container->parts);
    strl__page_table_deinit(&container->materials);
    strl__page_table_deinit(&container->images);
    strl__page_table_deinit(&container->runs);
    strl__free(container->trees);
    strl__opened_forget_meshes(container);
    strl_source_close(container->source);
    strl__free(container);
}

const strl_container_info *strl_container_get_info(const strl_container *container)
{
    return &container->header.info;
}

uint64_t strl_container_triangle_count(const strl_container *container)
{
    uint64_t triangles = 0;
    for (uint32_t i = 0; i < container->header.info.tree_count; i++)
        triangles += container->trees[i].facts.triangle_count;
    return triangles;
}

const strl_tree *strl_container_tree(const strl_container *container, uint32_t tree)
{
    return tree < container->header.info.tree_count ? &container->trees[tree].facts : NULL;
}

strl_source *strl_container_source(strl_container *container)
{
    return container->source;
}

strl_status strl_container_root_treelet(const strl_container *container, uint32_t tree, strl_treelet_ref *ref,
                                        strl_error *err)
{
    *ref = (strl_treelet_ref){0};
    if (tree >= container->header.info.tree_count)
        return strl__fail(err, STRL_ERR_ARGUMENT, "there is no tree %" PRIu32 ", expected less than %" PRIu32, tree,
                          container->header.info.tree_count);
    *ref = container->trees[tree].root;
    return STRL_OK;
}
