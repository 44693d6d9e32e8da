/* Node records: docs/format.md, "Node record". */
#include <inttypes.h>

#include "base/fail.h"
#include "container/record.h"

static void put_cell(strl_writer *out, const int64_t cell[3])
{
    for (int axis = 0; axis < 3; axis++)
        strl_writer_i64(out, cell[axis]);
}

static void get_cell(strl_cursor *in, int64_t cell[3])
{
    for (int axis = 0; axis < 3; axis++)
        cell[axis] = strl_cursor_i64(in);
}

void strl__node_encode(const strl_node *node, uint8_t bytes[STRL__NODE_BYTES])
{
    /* The buffer is large enough from the start, so the writer never allocates. */
    strl_writer out = {.data = bytes, .capacity = STRL__NODE_BYTES};
    strl_writer_u32(&out, node->parent);
    strl_writer_u32(&out, node->first_child);
    strl_writer_u8(&out, (uint8_t)node->child_count);
    strl_writer_u8(&out, (uint8_t)node->rung);
    strl_writer_u16(&out, (uint16_t)node->level);
    strl_writer_u32(&out, node->group);
    strl_writer_u32(&out, node->group_size);
    strl_writer_u32(&out, node->decode_parent);
    put_cell(&out, node->anchor);
    put_cell(&out, node->box_min);
    put_cell(&out, node->box_max);
    put_cell(&out, node->group_box_min);
    put_cell(&out, node->group_box_max);
    const float errors[] = {node->geometric_min,  node->geometric_max,   node->appearance_min,
                            node->appearance_max, node->group_geometric, node->group_appearance};
    for (unsigned i = 0; i < sizeof errors / sizeof *errors; i++)
        strl_writer_f32(&out, errors[i]);
    const uint32_t counts[] = {node->vertex_count,    node->base_vertex_count,
                               node->triangle_count,  node->base_triangle_count,
                               node->step_count,      node->boundary_steps,
                               node->shared_vertices, node->payload_offset,
                               node->payload_bytes,   0};
    for (unsigned i = 0; i < sizeof counts / sizeof *counts; i++)
        strl_writer_u32(&out, counts[i]);
    strl_writer_u64(&out, node->page.offset);
    strl_writer_u32(&out, node->page.bytes);
    strl_writer_u32(&out, node->page.decoded_bytes);
    strl_writer_u64(&out, node->page.checksum);
    for (int axis = 0; axis < 3; axis++)
        strl_writer_u16(&out, (uint16_t)node->cone.axis[axis]);
    strl_writer_u16(&out, node->cone.cosine);
}

strl_status strl__node_decode(const uint8_t bytes[STRL__NODE_BYTES], uint32_t id, strl_node *node, strl_error *err)
{
    strl_cursor in = strl_cursor_make(bytes, STRL__NODE_BYTES);
    node->parent = strl_cursor_u32(&in);
    node->first_child = strl_cursor_u32(&in);
    node->child_count = strl_cursor_u8(&in);
    node->rung = strl_cursor_u8(&in);
    node->level = strl_cursor_u16(&in);
    node->group = strl_cursor_u32(&in);
    node->group_size = strl_cursor_u32(&in);
    node->decode_parent = strl_cursor_u32(&in);
    get_cell(&in, node->anchor);
    get_cell(&in, node->box_min);
    get_cell(&in, node->box_max);
    get_cell(&in, node->group_box_min);
    get_cell(&in, node->group_box_max);
    float *const errors[] = {&node->geometric_min,  &node->geometric_max,   &node->appearance_min,
                             &node->appearance_max, &node->group_geometric, &node->group_appearance};
    for (unsigned i = 0; i < sizeof errors / sizeof *errors; i++)
        *errors[i] = strl_cursor_f32(&in);
    uint32_t *const counts[] = {&node->vertex_count,        &node->base_vertex_count, &node->triangle_count,
                                &node->base_triangle_count, &node->step_count,        &node->boundary_steps,
                                &node->shared_vertices,     &node->payload_offset,    &node->payload_bytes};
    for (unsigned i = 0; i < sizeof counts / sizeof *counts; i++)
        *counts[i] = strl_cursor_u32(&in);
    uint32_t reserved = strl_cursor_u32(&in);
    node->page.offset = strl_cursor_u64(&in);
    node->page.bytes = strl_cursor_u32(&in);
    node->page.decoded_bytes = strl_cursor_u32(&in);
    node->page.checksum = strl_cursor_u64(&in);
    for (int axis = 0; axis < 3; axis++)
        node->cone.axis[axis] = (int16_t)strl_cursor_u16(&in);
    node->cone.cosine = strl_cursor_u16(&in);
    if (reserved)
        return strl__fail(err, STRL_ERR_FORMAT, "node %" PRIu32 ": a reserved field is not zero", id);
    return STRL_OK;
}

static strl_status check_at_most(uint32_t id, const char *what, uint64_t value, uint64_t most, strl_error *err)
{
    if (value <= most)
        return STRL_OK;
    return strl__fail(err, STRL_ERR_FORMAT, "node %" PRIu32 ": %s is %" PRIu64 ", expected at most %" PRIu64, id, what,
                      value, most);
}

static strl_status check_kinship(const strl_node *node, uint32_t id, const strl_tree *tree, strl_error *err)
{
    bool root = id == 0;
    if (root ? node->parent != STRL_NONE : node->parent >= id)
        return strl__fail(err, STRL_ERR_FORMAT, "node %" PRIu32 ": parent is %" PRIu32 ", expected %s", id,
                          node->parent, root ? "none for the root" : "a lower id");
    if (root && node->level != tree->level_count - 1)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "node 0: level is %" PRIu32 ", expected %" PRIu32 " for the root of %" PRIu32 " levels",
                          node->level, tree->level_count - 1, tree->level_count);
    if (node->child_count == 0)
        return node->first_child == STRL_NONE
                   ? STRL_OK
                   : strl__fail(err, STRL_ERR_FORMAT,
                                "node %" PRIu32 ": first child is %" PRIu32 ", expected none for a leaf", id,
                                node->first_child);
    strl_status status = check_at_most(id, "the number of children", node->child_count, STRL_NODE_MAX_CHILDREN, err);
    if (status != STRL_OK)
        return status;
    if (node->level == 0)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "node %" PRIu32 ": level is 0, expected at least 1 for a node with children", id);
    if (node->first_child <= id || (uint64_t)node->first_child + node->child_count > tree->node_count)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "node %" PRIu32 ": children are %" PRIu32 " to %" PRIu64
                          ", expected ids above its own and below %" PRIu32,
                          id, node->first_child, (uint64_t)node->first_child + node->child_count - 1, tree->node_count);
    return STRL_OK;
}

static bool box_is_legal(const int64_t low[3], const int64_t high[3])
{
    for (int axis = 0; axis < 3; axis++)
        if (low[axis] > high[axis] || low[axis] < -STRL__LATTICE_LIMIT || high[axis] > STRL__LATTICE_LIMIT)
            return false;
    return true;
}

static bool range_is_legal(float least, float most)
{
    return least >= 0 && least <= most && most <= STRL_PM_MAX_ERROR; /* false for NaN and infinity too */
}

static strl_status check_errors(const strl_node *node, uint32_t id, strl_error *err)
{
    if (!range_is_legal(node->geometric_min, node->geometric_max))
        return strl__fail(err, STRL_ERR_FORMAT,
                          "node %" PRIu32 ": geometric errors are %g to %g, expected 0 <= min <= max", id,
                          (double)node->geometric_min, (double)node->geometric_max);
    if (!range_is_legal(node->appearance_min, node->appearance_max))
        return strl__fail(err, STRL_ERR_FORMAT,
                          "node %" PRIu32 ": appearance errors are %g to %g, expected 0 <= min <= max", id,
                          (double)node->appearance_min, (double)node->appearance_max);
    if (!range_is_legal(node->geometric_min, node->group_geometric))
        return strl__fail(err, STRL_ERR_FORMAT,
                          "node %" PRIu32 ": its group's geometric error is %g, expected at least its own, %g", id,
                          (double)node->group_geometric, (double)node->geometric_min);
    if (!range_is_legal(node->appearance_min, node->group_appearance))
        return strl__fail(err, STRL_ERR_FORMAT,
                          "node %" PRIu32 ": its group's appearance error is %g, expected at least its own, %g", id,
                          (double)node->group_appearance, (double)node->appearance_min);
    return STRL_OK;
}

static strl_status check_counts(const strl_node *node, uint32_t id, const strl_tree *tree, strl_error *err)
{
    const struct {
        const char *what;
        uint64_t value, most;
    } rules[] = {
        {"the level", node->level, tree->level_count - 1},
        {"the group", node->group, tree->group_count - 1},
        {"the group's size", node->group_size, tree->node_count},
        {"the rung", node->rung, STRL_RUNG_SAMPLED},
        {"the number of vertices", node->vertex_count, STRL_PM_MAX_VERTICES},
        {"the number of vertices of the base mesh", node->base_vertex_count, node->vertex_count},
        {"the number of triangles", node->triangle_count, STRL_PM_MAX_TRIANGLES},
        {"the number of triangles of the base mesh", node->base_triangle_count, node->triangle_count},
        {"the number of steps", node->step_count, (uint64_t)node->vertex_count - node->base_vertex_count},
        {"the number of shared vertices", node->shared_vertices, node->base_vertex_count},
    };
    /* In order: a later rule's bound may depend on an earlier rule. */
    for (unsigned i = 0; i < sizeof rules / sizeof *rules; i++) {
        strl_status status = check_at_most(id, rules[i].what, rules[i].value, rules[i].most, err);
        if (status != STRL_OK)
            return status;
    }
    if ((node->rung == STRL_RUNG_SAMPLED) != (tree->structure == STRL_STRUCTURE_SAMPLES))
        return strl__fail(err, STRL_ERR_FORMAT,
                          "node %" PRIu32 ": the rung is %" PRIu32 ", expected %d %s in a tree of structure %d", id,
                          node->rung, STRL_RUNG_SAMPLED, tree->structure == STRL_STRUCTURE_SAMPLES ? "alone" : "never",
                          (int)tree->structure);
    if (tree->structure == STRL_STRUCTURE_SAMPLES && node->decode_parent != STRL_NONE)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "node %" PRIu32 ": decode parent is %" PRIu32 ", expected none in a sample tree", id,
                          node->decode_parent);
    if (node->group_size == 0)
        return strl__fail(err, STRL_ERR_FORMAT, "node %" PRIu32 ": the group's size is 0, expected at least 1", id);
    if (node->decode_parent != STRL_NONE && node->decode_parent != node->parent)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "node %" PRIu32 ": decode parent is %" PRIu32 ", expected none or the parent, %" PRIu32, id,
                          node->decode_parent, node->parent);
    return STRL_OK;
}

/* In a tree that replaces, states that have fewer triangles would need one too. */
static strl_status check_cone(const strl_node *node, uint32_t id, const strl_tree *tree, strl_error *err)
{
    const strl_cone *cone = &node->cone;
    bool has_axis = cone->axis[0] || cone->axis[1] || cone->axis[2], has_cosine = cone->cosine > 0;
    if (has_axis == has_cosine && (!has_axis || tree->structure == STRL_STRUCTURE_SAMPLES))
        return STRL_OK;
    return strl__fail(err, STRL_ERR_FORMAT,
                      "node %" PRIu32
                      ": its cone has the axis %d %d %d and the cosine %u, expected %s in a tree of structure %d",
                      id, cone->axis[0], cone->axis[1], cone->axis[2], cone->cosine,
                      tree->structure == STRL_STRUCTURE_SAMPLES ? "both or neither" : "none", (int)tree->structure);
}

strl_status strl__node_check(const strl_node *node, uint32_t id, const strl_tree *tree, strl_error *err)
{
    strl_status status = check_kinship(node, id, tree, err);
    if (status == STRL_OK)
        status = check_counts(node, id, tree, err);
    if (status == STRL_OK)
        status = check_errors(node, id, err);
    if (status == STRL_OK)
        status = check_cone(node, id, tree, err);
    if (status != STRL_OK)
        return status;
    if (!box_is_legal(node->box_min, node->box_max) || !box_is_legal(node->group_box_min, node->group_box_max) ||
        !box_is_legal(node->anchor, node->anchor))
        return strl__fail(err, STRL_ERR_FORMAT,
                          "node %" PRIu32 ": a box or the anchor is out of order or beyond 2^62 cells", id);
    return STRL_OK;
}

void strl__child_treelets(uint32_t index, uint64_t first, uint64_t end, uint32_t *first_treelet, uint32_t *count)
{
    *first_treelet = STRL_NONE;
    *count = 0;
    if (first >= end)
        return;
    uint64_t low = first / STRL_TREELET_NODES, high = (end - 1) / STRL_TREELET_NODES;
    if (low <= index)
        low = (uint64_t)index + 1; /* a treelet cannot hold its own checksum */
    if (low > high)
        return;
    *first_treelet = (uint32_t)low;
    *count = (uint32_t)(high - low + 1);
}

uint64_t strl_node_decoded_bytes(const strl_node *record)
{
    return 26 * (uint64_t)record->vertex_count + 24 * (uint64_t)record->triangle_count +
           16 * ((uint64_t)record->step_count + 1) + 4 * ((uint64_t)record->vertex_count + 1);
}
