/* Treelets: docs/format.md, "Treelets: pages of node records". Nothing of a treelet is used before its checksum was
 * right. */
#include "container/treelet.h"

#include <inttypes.h>
#include <stdio.h>

#include "base/fail.h"
#include "base/hash.h"
#include "container/record.h"

static strl_status check_page(const strl_node *node, uint32_t id, uint64_t file_bytes, strl_error *err)
{
    char what[48];
    snprintf(what, sizeof what, "page of node %" PRIu32, id);
    const strl_treelet_ref ref = {.offset = node->page.offset, .bytes = node->page.bytes};
    strl_status status = strl__ref_check(&ref, file_bytes, what, err);
    if (status != STRL_OK)
        return status;
    if (node->page.bytes > STRL__MAX_PAGE_BYTES)
        return strl__fail(err, STRL_ERR_FORMAT, "%s: %" PRIu32 " bytes, expected at most %u", what, node->page.bytes,
                          STRL__MAX_PAGE_BYTES);
    if (node->payload_bytes == 0 || node->payload_offset > node->page.bytes ||
        node->payload_bytes > node->page.bytes - node->payload_offset)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "node %" PRIu32 ": payload of %" PRIu32 " bytes at byte %" PRIu32
                          " of its page, expected within its %" PRIu32 " bytes",
                          id, node->payload_bytes, node->payload_offset, node->page.bytes);
    if (node->page.decoded_bytes < strl_node_decoded_bytes(node))
        return strl__fail(err, STRL_ERR_FORMAT,
                          "node %" PRIu32 ": its page decodes to %" PRIu32 " bytes, expected at least its own %" PRIu64,
                          id, node->page.decoded_bytes, strl_node_decoded_bytes(node));
    return STRL_OK;
}

/* Breadth-first order, as far as one treelet shows it: it is what makes a child's treelet findable. */
static strl_status check_order(const strl_treelet *treelet, uint32_t i, uint64_t *next_child, strl_error *err)
{
    const strl_node *node = &treelet->nodes[i];
    uint32_t id = treelet->first_node + i;
    if (i > 0 && (node->level > node[-1].level || (id > 1 && node->parent < node[-1].parent)))
        return strl__fail(err, STRL_ERR_FORMAT,
                          "node %" PRIu32 ": level %" PRIu32 " and parent %" PRIu32
                          " are not in breadth-first order after level %" PRIu32 " and parent %" PRIu32,
                          id, node->level, node->parent, node[-1].level, node[-1].parent);
    if (id > 0 && node->parent >= treelet->first_node) {
        const strl_node *parent = &treelet->nodes[node->parent - treelet->first_node];
        if (parent->child_count == 0 || id < parent->first_child || id - parent->first_child >= parent->child_count ||
            parent->level != node->level + 1)
            return strl__fail(err, STRL_ERR_FORMAT,
                              "node %" PRIu32 ": its parent %" PRIu32 " does not name it as a child of the level below",
                              id, node->parent);
    }
    if (node->child_count == 0)
        return STRL_OK;
    if (*next_child && node->first_child != *next_child)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "node %" PRIu32 ": first child is %" PRIu32 ", expected %" PRIu64
                          ", right after the children before",
                          id, node->first_child, *next_child);
    *next_child = (uint64_t)node->first_child + node->child_count;
    return STRL_OK;
}

static strl_status decode_nodes(strl_cursor *in, const strl_tree *tree, uint64_t file_bytes, strl_treelet *treelet,
                                uint64_t children[2], strl_error *err)
{
    children[0] = children[1] = 0;
    for (uint32_t i = 0; i < treelet->node_count; i++) {
        strl_node *node = &treelet->nodes[i];
        uint32_t id = treelet->first_node + i;
        strl_status status = strl__node_decode(strl_cursor_take(in, STRL__NODE_BYTES), id, node, err);
        if (status == STRL_OK)
            status = strl__node_check(node, id, tree, err);
        if (status == STRL_OK)
            status = check_page(node, id, file_bytes, err);
        if (status == STRL_OK)
            status = check_order(treelet, i, &children[1], err);
        if (status != STRL_OK)
            return status;
        if (node->child_count && !children[0])
            children[0] = node->first_child;
    }
    return STRL_OK;
}

static strl_status decode_child_refs(strl_cursor *in, uint64_t file_bytes, uint32_t index, strl_treelet *treelet,
                                     strl_error *err)
{
    if (treelet->child_ref_count == 0)
        return STRL_OK;
    treelet->child_refs = strl__alloc(treelet->child_ref_count, sizeof *treelet->child_refs);
    if (!treelet->child_refs)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the references of treelet %" PRIu32, index);
    for (uint32_t i = 0; i < treelet->child_ref_count; i++) {
        strl_treelet_ref *ref = &treelet->child_refs[i];
        char what[64];
        snprintf(what, sizeof what, "treelet %" PRIu32 ", child treelet %" PRIu32, index,
                 treelet->first_child_treelet + i);
        ref->offset = strl_cursor_u64(in);
        ref->bytes = strl_cursor_u32(in);
        uint32_t reserved = strl_cursor_u32(in);
        ref->checksum = strl_cursor_u64(in);
        if (reserved || ref->bytes < STRL__MIN_TREELET_BYTES || ref->bytes > STRL__MAX_TREELET_BYTES)
            return strl__fail(err, STRL_ERR_FORMAT, "%s: %" PRIu32 " bytes, expected %u to %u", what, ref->bytes,
                              STRL__MIN_TREELET_BYTES, STRL__MAX_TREELET_BYTES);
        strl_status status = strl__ref_check(ref, file_bytes, what, err);
        if (status != STRL_OK)
            return status;
    }
    return STRL_OK;
}

static strl_status decode_head(strl_cursor *in, const strl_tree *tree, uint32_t index, strl_treelet *treelet,
                               strl_error *err)
{
    treelet->first_node = strl_cursor_u32(in);
    treelet->node_count = strl_cursor_u32(in);
    treelet->first_child_treelet = strl_cursor_u32(in);
    treelet->child_ref_count = strl_cursor_u32(in);
    uint64_t first = (uint64_t)index * STRL_TREELET_NODES;
    uint64_t count = first < tree->node_count ? tree->node_count - first : 0;
    if (count > STRL_TREELET_NODES)
        count = STRL_TREELET_NODES;
    if (count == 0 || treelet->first_node != first || treelet->node_count != count)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "treelet %" PRIu32 ": %" PRIu32 " nodes from %" PRIu32 " on, expected %" PRIu64
                          " from %" PRIu64 " on",
                          index, treelet->node_count, treelet->first_node, count, first);
    uint64_t bytes = STRL__TREELET_HEAD_BYTES + count * STRL__NODE_BYTES +
                     (uint64_t)treelet->child_ref_count * STRL__CHILD_REF_BYTES;
    if (treelet->child_ref_count > STRL__MAX_CHILD_REFS || in->size != bytes)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "treelet %" PRIu32 ": %zu bytes for %" PRIu64 " nodes and %" PRIu32
                          " child treelets, expected %" PRIu64 " and at most %u",
                          index, in->size, count, treelet->child_ref_count, bytes, STRL__MAX_CHILD_REFS);
    return STRL_OK;
}

static strl_status decode(const strl_tree *tree, uint64_t file_bytes, uint32_t index, strl_cursor *in,
                          strl_treelet *treelet, strl_error *err)
{
    strl_status status = decode_head(in, tree, index, treelet, err);
    uint64_t children[2];
    if (status == STRL_OK)
        status = decode_nodes(in, tree, file_bytes, treelet, children, err);
    if (status != STRL_OK)
        return status;
    uint32_t first, count;
    strl__child_treelets(index, children[0], children[1], &first, &count);
    if (treelet->first_child_treelet != first || treelet->child_ref_count != count)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "treelet %" PRIu32 ": names %" PRIu32 " child treelets from %" PRIu32 " on, expected %" PRIu32
                          " from %" PRIu32 " on",
                          index, treelet->child_ref_count, treelet->first_child_treelet, count, first);
    return decode_child_refs(in, file_bytes, index, treelet, err);
}

strl_status strl_treelet_decode(const strl_container *container, uint32_t tree, uint32_t index,
                                const strl_treelet_ref *ref, const void *data, size_t size, strl_treelet *treelet,
                                strl_error *err)
{
    treelet->child_refs = NULL;
    treelet->child_ref_count = treelet->node_count = 0;
    const strl_tree *facts = strl_container_tree(container, tree);
    if (!facts)
        return strl__fail(err, STRL_ERR_ARGUMENT, "there is no tree %" PRIu32, tree);
    uint64_t found = size == ref->bytes ? strl__checksum(data, size) : 0;
    if (size != ref->bytes || found != ref->checksum)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "treelet %" PRIu32 " at byte %" PRIu64 ": checksum of %zu bytes is %016" PRIx64
                          ", expected %016" PRIx64 " of %" PRIu32,
                          index, ref->offset, size, found, ref->checksum, ref->bytes);
    strl_cursor in = strl_cursor_make(data, size);
    strl_status status = decode(facts, strl_container_get_info(container)->file_bytes, index, &in, treelet, err);
    if (status != STRL_OK)
        strl_treelet_deinit(treelet);
    return status;
}

void strl_treelet_deinit(strl_treelet *treelet)
{
    strl__free(treelet->child_refs);
    treelet->child_refs = NULL;
    treelet->child_ref_count = treelet->node_count = 0;
}
