/* The writer's trees: payload pages as the nodes come, treelets when the last one is there. */
#include <inttypes.h>
#include <string.h>

#include "base/fail.h"
#include "container/writing.h"
#include "geometry/payload_streams.h"

/* Leaves room in a page that already holds a little less than STRL_PAGE_BYTES. */
#define MAX_PAYLOAD_BYTES (STRL__MAX_PAGE_BYTES - STRL_PAGE_BYTES)

strl_status strl__writing_close_page(strl_container_writer *writer, strl_error *err)
{
    if (writer->pending_count == 0)
        return STRL_OK;
    strl_treelet_ref ref;
    strl_status status = strl__sink_append(&writer->sink, writer->page.data, (uint32_t)writer->page.size, &ref, err);
    uint64_t spill_at = (uint64_t)(writer->next_id - writer->pending_count) * STRL__NODE_BYTES;
    /* Encoded in stretches into the page's buffer, which is free now. */
    uint32_t room = (uint32_t)(writer->page.capacity / STRL__NODE_BYTES);
    for (uint32_t i = 0, filled = 0; status == STRL_OK && i < writer->pending_count; i++) {
        strl_node *node = &writer->pending[i];
        node->page = (strl_page_ref){ref.offset, ref.bytes, writer->pending_decoded_bytes, ref.checksum};
        strl__node_encode(node, writer->page.data + (size_t)filled++ * STRL__NODE_BYTES);
        if (filled < room && i + 1 < writer->pending_count)
            continue;
        size_t bytes = (size_t)filled * STRL__NODE_BYTES;
        status = strl_file_write(writer->spill, spill_at, writer->page.data, bytes, err);
        spill_at += bytes;
        filled = 0;
    }
    writer->page.size = 0;
    writer->pending_count = 0;
    writer->pending_decoded_bytes = 0;
    return status;
}

/* Reads records [first, first + count) from the spill into the treelet at `bytes`; children: ids [begin, end) of their
 * children. */
static strl_status gather(strl_container_writer *writer, uint32_t first, uint32_t count, uint8_t *bytes,
                          uint64_t children[2], strl_error *err)
{
    uint8_t *records = bytes + STRL__TREELET_HEAD_BYTES;
    children[0] = children[1] = 0;
    strl_status status = strl_file_read(writer->spill, (uint64_t)first * STRL__NODE_BYTES, records,
                                        (size_t)count * STRL__NODE_BYTES, err);
    for (uint32_t i = 0; status == STRL_OK && i < count; i++) {
        strl_node node;
        status = strl__node_decode(records + (size_t)i * STRL__NODE_BYTES, first + i, &node, err);
        if (status != STRL_OK || node.child_count == 0)
            continue;
        if (!children[0])
            children[0] = node.first_child;
        children[1] = (uint64_t)node.first_child + node.child_count;
    }
    return status;
}

static strl_status write_treelet(strl_container_writer *writer, uint32_t index, uint32_t node_count,
                                 strl_treelet_ref *refs, strl_error *err)
{
    uint8_t bytes[STRL__MAX_TREELET_BYTES];
    uint32_t first = index * STRL_TREELET_NODES, first_child_treelet, ref_count;
    uint32_t count = node_count - first < STRL_TREELET_NODES ? node_count - first : STRL_TREELET_NODES;
    uint64_t children[2];
    strl_status status = gather(writer, first, count, bytes, children, err);
    if (status != STRL_OK)
        return status;
    strl__child_treelets(index, children[0], children[1], &first_child_treelet, &ref_count);
    strl__store_le(bytes, 4, first);
    strl__store_le(bytes + 4, 4, count);
    strl__store_le(bytes + 8, 4, first_child_treelet);
    strl__store_le(bytes + 12, 4, ref_count);
    uint8_t *at = bytes + STRL__TREELET_HEAD_BYTES + (size_t)count * STRL__NODE_BYTES;
    for (uint32_t i = 0; i < ref_count; i++, at += STRL__CHILD_REF_BYTES) {
        const strl_treelet_ref *ref = &refs[first_child_treelet + i];
        strl__store_le(at, 8, ref->offset);
        strl__store_le(at + 8, 4, ref->bytes);
        strl__store_le(at + 12, 4, 0);
        strl__store_le(at + 16, 8, ref->checksum);
    }
    return strl__sink_append(&writer->sink, bytes, (uint32_t)(at - bytes), &refs[index], err);
}

strl_status strl__writing_treelets(strl_container_writer *writer, uint32_t node_count, strl_treelet_ref *root,
                                   strl_error *err)
{
    uint32_t count = (node_count - 1) / STRL_TREELET_NODES + 1;
    strl_treelet_ref *refs = strl__alloc(count, sizeof *refs); /* 24 bytes for 128 nodes */
    if (!refs)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the places of %" PRIu32 " treelets", count);
    /* Backwards, because a treelet holds the checksums of those behind it. */
    strl_status status = STRL_OK;
    for (uint32_t index = count; status == STRL_OK && index-- > 0;)
        status = write_treelet(writer, index, node_count, refs, err);
    *root = refs[0];
    strl__free(refs);
    return status;
}

strl_status strl_container_writer_begin_tree(strl_container_writer *writer, const strl_tree *tree, strl_error *err)
{
    uint32_t index = writer->header.info.tree_count;
    strl_status status = STRL_OK;
    if (writer->in_tree)
        status =
            strl__fail(err, STRL_ERR_ARGUMENT, "tree %" PRIu32 " begins before the one before it has ended", index + 1);
    else if (index == STRL__MAX_TREES)
        status = strl__fail(err, STRL_ERR_LIMIT, "a container holds at most %u trees", STRL__MAX_TREES);
    else if (!strl__grow(&writer->trees, &writer->tree_capacity, (size_t)index + 1, sizeof *writer->trees))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for tree %" PRIu32, index);
    if (status == STRL_OK) {
        strl_tree facts = *tree;
        facts.level_count = facts.group_count = 1; /* until the records say */
        facts.triangle_count = facts.vertex_count = 0;
        facts.root_triangles = 0;
        memset(facts.box_min, 0, sizeof facts.box_min);
        memset(facts.box_max, 0, sizeof facts.box_max);
        status = strl__tree_check(&facts, index, UINT64_MAX, err);
        writer->trees[index] = (strl__written_tree){.facts = facts};
    }
    writer->in_tree = status == STRL_OK;
    writer->next_id = 0;
    writer->next_child = 1;
    writer->failed |= status != STRL_OK;
    return status;
}

/* What strl__node_check cannot see in one record: breadth-first order. */
static strl_status check_order(const strl_container_writer *writer, const strl_node *node, strl_error *err)
{
    uint32_t id = writer->next_id;
    if (id > 0 && (node->level > writer->last_level || (id > 1 && node->parent < writer->last_parent)))
        return strl__fail(err, STRL_ERR_ARGUMENT,
                          "node %" PRIu32 ": level %" PRIu32 " and parent %" PRIu32
                          " are not in breadth-first order after level %" PRIu32 " and parent %" PRIu32,
                          id, node->level, node->parent, writer->last_level, writer->last_parent);
    if (node->child_count && node->first_child != writer->next_child)
        return strl__fail(err, STRL_ERR_ARGUMENT,
                          "node %" PRIu32 ": first child is %" PRIu32 ", expected %" PRIu64 " in breadth-first order",
                          id, node->first_child, writer->next_child);
    return STRL_OK;
}

static strl_status check_node(strl_container_writer *writer, const strl_node *node, uint32_t payload_bytes,
                              strl_error *err)
{
    uint32_t id = writer->next_id;
    if (!writer->in_tree || id >= writer->trees[writer->header.info.tree_count].facts.node_count)
        return strl__fail(err, STRL_ERR_ARGUMENT, "node %" PRIu32 " is one more than its tree has", id);
    strl_tree *facts = &writer->trees[writer->header.info.tree_count].facts;
    if (id == 0) {
        if (node->level >= STRL__MAX_LEVELS || node->level >= facts->node_count)
            return strl__fail(err, STRL_ERR_ARGUMENT,
                              "node 0: level is %" PRIu32 ", expected less than its tree's %" PRIu32 " nodes",
                              node->level, facts->node_count);
        facts->level_count = node->level + 1;
    }
    strl_tree limits = *facts;
    limits.group_count = facts->node_count; /* known when all records are there */
    strl_status status = strl__node_check(node, id, &limits, err);
    if (status == STRL_OK)
        status = check_order(writer, node, err);
    if (status == STRL_OK && (payload_bytes == 0 || payload_bytes > MAX_PAYLOAD_BYTES))
        status = strl__fail(err, STRL_ERR_LIMIT, "node %" PRIu32 ": payload of %" PRIu32 " bytes, expected 1 to %u", id,
                            payload_bytes, MAX_PAYLOAD_BYTES);
    return status;
}

static void count_node(strl_tree *facts, const strl_node *node, uint32_t id)
{
    if (id == 0)
        facts->root_triangles = node->base_triangle_count;
    if (node->group >= facts->group_count)
        facts->group_count = node->group + 1;
    if (node->child_count && facts->structure != STRL_STRUCTURE_SAMPLES) /* whose nodes add up */
        return;
    bool first = facts->triangle_count == 0 && facts->vertex_count == 0;
    facts->triangle_count += node->triangle_count;
    facts->vertex_count += node->vertex_count;
    for (int axis = 0; axis < 3; axis++) {
        if (first || node->box_min[axis] < facts->box_min[axis])
            facts->box_min[axis] = node->box_min[axis];
        if (first || node->box_max[axis] > facts->box_max[axis])
            facts->box_max[axis] = node->box_max[axis];
    }
}

/* The payload's codec has rounded its errors up to its scale; the record's claim must not stay below. */
static void round_errors(strl_node *node)
{
    float *const errors[] = {&node->geometric_min,  &node->geometric_max,   &node->appearance_min,
                             &node->appearance_max, &node->group_geometric, &node->group_appearance};
    for (unsigned i = 0; i < sizeof errors / sizeof *errors; i++)
        *errors[i] = strl__error_of_code(strl__code_of_error(*errors[i]));
}

static strl_status add_node(strl_container_writer *writer, const strl_node *record, const void *payload,
                            uint32_t payload_bytes, strl_error *err)
{
    strl_status status = check_node(writer, record, payload_bytes, err);
    if (status != STRL_OK)
        return status;
    strl_node *node = &writer->pending[writer->pending_count];
    *node = *record;
    node->payload_offset = (uint32_t)writer->page.size;
    node->payload_bytes = payload_bytes;
    round_errors(node);
    strl_writer_bytes(&writer->page, payload, payload_bytes);
    if (writer->page.size < STRL__NODE_BYTES) /* close_page encodes records in it */
        writer->page.failed |= !strl__grow(&writer->page.data, &writer->page.capacity, STRL__NODE_BYTES, 1);
    if (writer->page.failed)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a page of %zu bytes", writer->page.size + payload_bytes);
    /* far below 2^32: see the closing rule */
    writer->pending_decoded_bytes += (uint32_t)strl_node_decoded_bytes(node);
    count_node(&writer->trees[writer->header.info.tree_count].facts, node, writer->next_id);
    writer->next_id++;
    writer->next_child += node->child_count;
    writer->last_level = node->level;
    writer->last_parent = node->parent;
    writer->pending_count++;
    bool is_root = writer->next_id == 1; /* alone in its page: opening reads nothing else */
    if (is_root || writer->page.size >= STRL_PAGE_BYTES || writer->pending_count == STRL__MAX_PAGE_NODES ||
        writer->pending_decoded_bytes >= STRL__PAGE_DECODED_BYTES)
        return strl__writing_close_page(writer, err);
    return STRL_OK;
}

strl_status strl_container_writer_add_node(strl_container_writer *writer, const strl_node *record, const void *payload,
                                           uint32_t payload_bytes, strl_error *err)
{
    strl_status status = add_node(writer, record, payload, payload_bytes, err);
    writer->failed |= status != STRL_OK;
    return status;
}

static strl_status end_tree(strl_container_writer *writer, strl_error *err)
{
    uint32_t index = writer->header.info.tree_count;
    if (!writer->in_tree)
        return strl__fail(err, STRL_ERR_ARGUMENT, "no tree has begun that could end");
    strl__written_tree *tree = &writer->trees[index];
    if (writer->next_id != tree->facts.node_count || writer->next_child != tree->facts.node_count)
        return strl__fail(err, STRL_ERR_ARGUMENT,
                          "tree %" PRIu32 " ends after %" PRIu32 " nodes and %" PRIu64
                          " announced by their parents, expected %" PRIu32,
                          index, writer->next_id, writer->next_child, tree->facts.node_count);
    strl_status status = strl__writing_close_page(writer, err);
    if (status == STRL_OK)
        status = strl__tree_check(&tree->facts, index, UINT64_MAX, err);
    if (status == STRL_OK)
        status = strl__writing_treelets(writer, tree->facts.node_count, &tree->root, err);
    if (status == STRL_OK) {
        writer->in_tree = false;
        writer->header.info.tree_count++;
    }
    return status;
}

strl_status strl_container_writer_end_tree(strl_container_writer *writer, strl_error *err)
{
    strl_status status = end_tree(writer, err);
    writer->failed |= status != STRL_OK;
    return status;
}
