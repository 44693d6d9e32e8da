/* Tree records and references: docs/format.md, "Trees section" and "Conventions". */
#include <inttypes.h>
#include <math.h>

#include "base/fail.h"
#include "container/record.h"

strl_status strl__ref_check(const strl_treelet_ref *ref, uint64_t file_bytes, const char *what, strl_error *err)
{
    if (ref->bytes == 0 || ref->offset < STRL__HEADER_BYTES || ref->offset % STRL__ALIGNMENT ||
        ref->offset > file_bytes || ref->bytes > file_bytes - ref->offset)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "%s: reference to %" PRIu32 " bytes at byte %" PRIu64
                          ", expected a multiple of %u from %u on that ends within the file (%" PRIu64 ")",
                          what, ref->bytes, ref->offset, STRL__ALIGNMENT, STRL__HEADER_BYTES, file_bytes);
    return STRL_OK;
}

void strl__tree_encode(const strl_tree *tree, const strl_treelet_ref *root, uint8_t bytes[STRL__TREE_BYTES])
{
    strl_writer out = {.data = bytes, .capacity = STRL__TREE_BYTES};
    strl_writer_u32(&out, (uint32_t)tree->structure);
    strl_writer_u32(&out, tree->level_count);
    strl_writer_u32(&out, tree->node_count);
    strl_writer_u32(&out, tree->group_count);
    for (int axis = 0; axis < 3; axis++)
        strl_writer_f64(&out, tree->origin[axis]);
    strl_writer_f64(&out, tree->step);
    for (int axis = 0; axis < 3; axis++)
        strl_writer_i64(&out, tree->box_min[axis]);
    for (int axis = 0; axis < 3; axis++)
        strl_writer_i64(&out, tree->box_max[axis]);
    strl_writer_u64(&out, tree->triangle_count);
    strl_writer_u64(&out, tree->vertex_count);
    strl_writer_u32(&out, tree->root_triangles);
    strl_writer_f32(&out, tree->leaf_geometric);
    strl_writer_u64(&out, root->offset);
    strl_writer_u32(&out, root->bytes);
    strl_writer_u32(&out, 0);
    strl_writer_u64(&out, root->checksum);
}

static bool step_is_legal(double step)
{
    int exponent;
    return isfinite(step) && step > 0 && frexp(step, &exponent) == 0.5 && exponent - 1 >= -STRL__MAX_STEP_EXPONENT &&
           exponent - 1 <= STRL__MAX_STEP_EXPONENT;
}

static strl_status check_lattice(const strl_tree *tree, uint32_t index, strl_error *err)
{
    if (!step_is_legal(tree->step))
        return strl__fail(err, STRL_ERR_FORMAT,
                          "tree %" PRIu32 ": the lattice step is %g, expected a power of two from 2^-%d to 2^%d", index,
                          tree->step, STRL__MAX_STEP_EXPONENT, STRL__MAX_STEP_EXPONENT);
    for (int axis = 0; axis < 3; axis++) {
        if (!isfinite(tree->origin[axis]))
            return strl__fail(err, STRL_ERR_FORMAT, "tree %" PRIu32 ": the origin on axis %d is not finite", index,
                              axis);
        if (tree->box_min[axis] > tree->box_max[axis] || tree->box_min[axis] < -STRL__LATTICE_LIMIT ||
            tree->box_max[axis] > STRL__LATTICE_LIMIT)
            return strl__fail(err, STRL_ERR_FORMAT,
                              "tree %" PRIu32 ": the box on axis %d is %" PRId64 " to %" PRId64
                              ", expected min <= max within 2^62",
                              index, axis, tree->box_min[axis], tree->box_max[axis]);
    }
    if (!isfinite(tree->leaf_geometric) || tree->leaf_geometric < 0)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "tree %" PRIu32 ": the leaves' geometric error is %g, expected finite and >= 0", index,
                          (double)tree->leaf_geometric);
    return STRL_OK;
}

strl_status strl__tree_check(const strl_tree *tree, uint32_t index, uint64_t file_bytes, strl_error *err)
{
    if (tree->structure < STRL_STRUCTURE_CLUSTERS || tree->structure > STRL_STRUCTURE_SAMPLES)
        return strl__fail(err, STRL_ERR_FORMAT, "tree %" PRIu32 ": structure is %u, expected 1 to 3", index,
                          (unsigned)tree->structure);
    uint64_t most_nodes = file_bytes / STRL__NODE_BYTES;
    if (most_nodes > STRL_NONE - 1)
        most_nodes = STRL_NONE - 1;
    if (tree->node_count < 1 || tree->node_count > most_nodes)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "tree %" PRIu32 ": %" PRIu32 " nodes, expected 1 to %" PRIu64 " in a file of its size", index,
                          tree->node_count, most_nodes);
    if (tree->level_count < 1 || tree->level_count > tree->node_count || tree->level_count > STRL__MAX_LEVELS)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "tree %" PRIu32 ": %" PRIu32 " levels, expected 1 to %" PRIu32 " for its nodes", index,
                          tree->level_count, tree->node_count < STRL__MAX_LEVELS ? tree->node_count : STRL__MAX_LEVELS);
    if (tree->group_count < 1 || tree->group_count > tree->node_count)
        return strl__fail(err, STRL_ERR_FORMAT, "tree %" PRIu32 ": %" PRIu32 " groups, expected 1 to %" PRIu32, index,
                          tree->group_count, tree->node_count);
    return check_lattice(tree, index, err);
}

strl_status strl__tree_decode(const uint8_t bytes[STRL__TREE_BYTES], uint32_t index, uint64_t file_bytes,
                              strl_tree *tree, strl_treelet_ref *root, strl_error *err)
{
    strl_cursor in = strl_cursor_make(bytes, STRL__TREE_BYTES);
    tree->structure = (strl_structure)strl_cursor_u32(&in);
    tree->level_count = strl_cursor_u32(&in);
    tree->node_count = strl_cursor_u32(&in);
    tree->group_count = strl_cursor_u32(&in);
    for (int axis = 0; axis < 3; axis++)
        tree->origin[axis] = strl_cursor_f64(&in);
    tree->step = strl_cursor_f64(&in);
    for (int axis = 0; axis < 3; axis++)
        tree->box_min[axis] = strl_cursor_i64(&in);
    for (int axis = 0; axis < 3; axis++)
        tree->box_max[axis] = strl_cursor_i64(&in);
    tree->triangle_count = strl_cursor_u64(&in);
    tree->vertex_count = strl_cursor_u64(&in);
    tree->root_triangles = strl_cursor_u32(&in);
    tree->leaf_geometric = strl_cursor_f32(&in);
    root->offset = strl_cursor_u64(&in);
    root->bytes = strl_cursor_u32(&in);
    uint32_t reserved = strl_cursor_u32(&in);
    root->checksum = strl_cursor_u64(&in);
    strl_status status = strl__tree_check(tree, index, file_bytes, err);
    if (status != STRL_OK)
        return status;
    if (reserved)
        return strl__fail(err, STRL_ERR_FORMAT, "tree %" PRIu32 ": a reserved field is not zero", index);
    if (root->bytes < STRL__MIN_TREELET_BYTES || root->bytes > STRL__MAX_TREELET_BYTES)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "tree %" PRIu32 ": its first treelet has %" PRIu32 " bytes, expected %u to %u", index,
                          root->bytes, STRL__MIN_TREELET_BYTES, STRL__MAX_TREELET_BYTES);
    return strl__ref_check(root, file_bytes, "first treelet", err);
}
