/* Meshes for tools that may wait. The last page is kept, and the meshes of one chain of decode parents. */
#include <inttypes.h>

#include "base/fail.h"
#include "container/opened.h"

static bool same_page(const strl_page_ref *a, const strl_page_ref *b)
{
    return a->offset == b->offset && a->bytes == b->bytes && a->checksum == b->checksum;
}

static strl_status load_page(strl_container *container, const strl_page_ref *page, strl_error *err)
{
    if (same_page(&container->page_ref, page) && page->bytes)
        return STRL_OK;
    container->page_ref.bytes = 0;
    const strl_treelet_ref ref = {.offset = page->offset, .bytes = page->bytes};
    strl_status status = strl__ref_check(&ref, container->source->bytes, "page", err);
    if (status == STRL_OK && page->bytes > STRL__MAX_PAGE_BYTES)
        status = strl__fail(err, STRL_ERR_ARGUMENT, "page of %" PRIu32 " bytes, expected at most %u", page->bytes,
                            STRL__MAX_PAGE_BYTES);
    if (status == STRL_OK && !strl__grow(&container->page, &container->page_capacity, page->bytes, 1))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for a page of %" PRIu32 " bytes", page->bytes);
    const strl_source_span span = {page->offset, page->bytes, container->page, page->checksum};
    if (status == STRL_OK)
        status = strl_source_read_known(container->source, &span, err);
    if (status == STRL_OK)
        status = strl_page_check(page, container->page, page->bytes, err);
    if (status == STRL_ERR_FORMAT)
        strl_source_doubt(container->source, page->offset, page->bytes);
    if (status == STRL_OK)
        container->page_ref = *page;
    return status;
}

static strl_status check_palette(const strl_container *container, const strl_node *record, const strl_pm *mesh,
                                 strl_error *err)
{
    const strl_container_info *info = &container->header.info;
    for (uint32_t i = 0; i < mesh->palette_count; i++)
        if (mesh->palette[i].part >= info->part_count || mesh->palette[i].material >= info->material_count)
            return strl__fail(err, STRL_ERR_FORMAT,
                              "page at byte %" PRIu64 ", payload at its byte %" PRIu32 ": palette entry %" PRIu32
                              " names part %" PRIu32 " and material %" PRIu32 ", expected less than %" PRIu32
                              " and %" PRIu32,
                              record->page.offset, record->payload_offset, i, mesh->palette[i].part,
                              mesh->palette[i].material, info->part_count, info->material_count);
    return STRL_OK;
}

static strl_status decode(strl_container *container, const strl_node *record, const strl__kept_mesh *parent,
                          strl_arena *arena, strl_pm *mesh, strl_error *err)
{
    strl_payload_reference reference;
    if (parent) {
        reference = strl_payload_reference_of(&parent->mesh);
        strl_page_place(&reference, parent->record.anchor, record);
    }
    strl_status status = load_page(container, &record->page, err);
    if (status == STRL_OK)
        status = strl_page_mesh(record, container->page, record->page.bytes, parent ? &reference : NULL, arena, NULL,
                                mesh, err);
    return status == STRL_OK ? check_palette(container, record, mesh, err) : status;
}

/* The node by which `record` is decoded, kept; *depth: of it in its chain. */
static strl_status keep_parent(strl_container *container, uint32_t tree, const strl_node *record, unsigned *depth,
                               strl_error *err)
{
    uint32_t ids[STRL_DECODE_CHAIN];
    unsigned count = 0;
    strl_node node = *record;
    strl_status status = STRL_OK;
    while (status == STRL_OK && node.decode_parent != STRL_NONE) {
        if (count == STRL_DECODE_CHAIN - 1)
            return strl__fail(err, STRL_ERR_FORMAT,
                              "node %" PRIu32 " of tree %" PRIu32 " is decoded by more than %u others", ids[0], tree,
                              STRL_DECODE_CHAIN - 1);
        ids[count++] = node.decode_parent;
        status = strl_container_node(container, tree, ids[count - 1], &node, err);
    }
    for (unsigned i = 0; status == STRL_OK && i < count; i++) {
        strl__kept_mesh *kept = &container->kept[i];
        uint32_t id = ids[count - 1 - i];
        *depth = i;
        if (kept->is_whole && kept->tree == tree && kept->node == id)
            continue;
        kept->is_whole = false;
        strl_arena_rewind(&kept->arena, (strl_arena_mark){0});
        status = strl_container_node(container, tree, id, &kept->record, err);
        if (status == STRL_OK)
            status = decode(container, &kept->record, i ? kept - 1 : NULL, &kept->arena, &kept->mesh, err);
        kept->is_whole = status == STRL_OK;
        kept->tree = tree;
        kept->node = id;
    }
    return status;
}

strl_status strl_container_mesh(strl_container *container, uint32_t tree, const strl_node *record, strl_arena *arena,
                                strl_pm *mesh, strl_error *err)
{
    unsigned depth = 0;
    bool alone = record->decode_parent == STRL_NONE;
    *mesh = (strl_pm){0};
    if (!strl_container_tree(container, tree))
        return strl__fail(err, STRL_ERR_ARGUMENT, "there is no tree %" PRIu32, tree);
    strl_status status = alone ? STRL_OK : keep_parent(container, tree, record, &depth, err);
    if (status == STRL_OK)
        status = decode(container, record, alone ? NULL : &container->kept[depth], arena, mesh, err);
    return strl_source_fail(container->source, status, err);
}

void strl__opened_forget_meshes(strl_container *container)
{
    for (unsigned i = 0; i < STRL_DECODE_CHAIN; i++)
        strl_arena_deinit(&container->kept[i].arena);
    strl__free(container->page);
}
