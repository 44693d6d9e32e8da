/* What needs more than one record: boxes nest, errors grow to the root, groups are what their members say,
 * sums, pages. */
#include <inttypes.h>

#include "base/fail.h"
#include "base/memory.h"
#include "verify/model.h"

#define MOST_PAGE_NODES 1024u

/* Counts one look and, where condition is false, one flaw. */
#define RULE(kind, condition, node, ...)                                                                               \
    do {                                                                                                               \
        strl__v_checked(model->checks, STRL_VERIFY_##kind, 1);                                                         \
        if (!(condition))                                                                                              \
            strl__v_flaw(model->checks, STRL_VERIFY_##kind, strl__key(tree, (node)), __VA_ARGS__);                     \
    } while (0)

static bool inside(const int64_t inner[2][3], const int64_t outer[2][3])
{
    for (unsigned k = 0; k < 3; k++)
        if (inner[0][k] < outer[0][k] || inner[1][k] > outer[1][k])
            return false;
    return true;
}

static void check_boxes(strl__model *model, const strl__vtree *tree, uint32_t id)
{
    const strl__vnode *n = &tree->nodes[id];
    RULE(BOXES, inside(n->box, n->group_box), id, "tree %u node %u: its box is not inside the box of its group %u",
         tree->index, id, n->group);
    if (id == 0)
        return;
    const strl__vnode *p = &tree->nodes[n->parent];
    RULE(BOXES, inside(n->box, p->box), id, "tree %u node %u: its box is not inside the box of its parent %u",
         tree->index, id, n->parent);
    RULE(BOXES, inside(n->group_box, p->group_box), id,
         "tree %u node %u: the box of its group %u is not inside that of its parent's group %u", tree->index, id,
         n->group, p->group);
}

static void check_errors(strl__model *model, const strl__vtree *tree, uint32_t id)
{
    const strl__vnode *n = &tree->nodes[id];
    RULE(ERRORS, n->group_geometric >= n->geometric_min && n->group_appearance >= n->appearance_min, id,
         "tree %u node %u: errors %g and %g are above those of its group %u (%g and %g)", tree->index, id,
         (double)n->geometric_min, (double)n->appearance_min, n->group, (double)n->group_geometric,
         (double)n->group_appearance);
    if (n->child_count == 0)
        RULE(ERRORS, n->geometric_min >= tree->leaf_geometric, id,
             "tree %u node %u: a leaf claims %g, less than quantisation (%g)", tree->index, id,
             (double)n->geometric_min, (double)tree->leaf_geometric);
    if (tree->structure == 3)
        RULE(
            ERRORS,
            n->geometric_min == n->geometric_max && n->geometric_max == n->group_geometric && n->step_count == 0 &&
                n->group_size == 1,
            id,
            "tree %u node %u: a brick has the sizes %g, %g and %g, %u steps and %u members, expected one size, no step and no other member",
            tree->index, id, (double)n->geometric_min, (double)n->geometric_max, (double)n->group_geometric,
            n->step_count, n->group_size);
    if (id == 0)
        return;
    const strl__vnode *p = &tree->nodes[n->parent];
    RULE(ERRORS, n->geometric_max <= p->geometric_min && n->appearance_max <= p->appearance_min, id,
         "tree %u node %u: its base errs by %g and %g, more than the finest state of its parent %u (%g and %g)",
         tree->index, id, (double)n->geometric_max, (double)n->appearance_max, n->parent, (double)p->geometric_min,
         (double)p->appearance_min);
    RULE(ERRORS, n->group_geometric <= p->group_geometric && n->group_appearance <= p->group_appearance, id,
         "tree %u node %u: its group %u errs by %g and %g, more than group %u of its parent (%g and %g)", tree->index,
         id, n->group, (double)n->group_geometric, (double)n->group_appearance, p->group, (double)p->group_geometric,
         (double)p->group_appearance);
}

static bool same_group_facts(const strl__vnode *a, const strl__vnode *b)
{
    bool same = a->group_size == b->group_size && a->level == b->level && a->group_geometric == b->group_geometric &&
                a->group_appearance == b->group_appearance;
    for (unsigned i = 0; same && i < 6; i++)
        same = a->group_box[i / 3][i % 3] == b->group_box[i / 3][i % 3];
    return same;
}

static strl_status check_groups(strl__model *model, strl__vtree *tree, strl_error *err)
{
    uint32_t *members = strl__alloc_zero(tree->group_count, sizeof *members);
    tree->group_first = strl__alloc(tree->group_count, sizeof *tree->group_first);
    if (!members || !tree->group_first) {
        strl__free(members);
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %u groups", tree->group_count);
    }
    for (uint32_t g = 0; g < tree->group_count; g++)
        tree->group_first[g] = STRL__NO_NODE;
    for (uint32_t id = 0; id < tree->node_count; id++) {
        const strl__vnode *n = &tree->nodes[id];
        if (members[n->group]++ == 0)
            tree->group_first[n->group] = id;
        uint32_t first = tree->group_first[n->group];
        RULE(GROUPS, same_group_facts(n, &tree->nodes[first]), id,
             "tree %u node %u: says of its group %u (level, size, box or errors) what node %u does not", tree->index,
             id, n->group, first);
    }
    for (uint32_t g = 0; g < tree->group_count; g++) {
        uint32_t first = tree->group_first[g];
        RULE(GROUPS, members[g] > 0 && members[g] == tree->nodes[first].group_size, members[g] ? first : 0,
             "tree %u group %u: it has %u members, its records say %u", tree->index, g, members[g],
             members[g] ? tree->nodes[first].group_size : 0);
    }
    strl__free(members);
    return STRL_OK;
}

static void check_counts(strl__model *model, const strl__vtree *tree)
{
    uint64_t triangles = 0, vertices = 0;
    int64_t box[2][3];
    bool first = true;
    for (uint32_t id = 0; id < tree->node_count; id++) {
        const strl__vnode *n = &tree->nodes[id];
        if (!strl__holds_input(tree, id))
            continue;
        triangles += n->triangle_count;
        vertices += n->vertex_count;
        for (unsigned k = 0; k < 3; k++) {
            box[0][k] = first || n->box[0][k] < box[0][k] ? n->box[0][k] : box[0][k];
            box[1][k] = first || n->box[1][k] > box[1][k] ? n->box[1][k] : box[1][k];
        }
        first = false;
    }
    RULE(COUNTS, triangles == tree->triangle_count && vertices == tree->vertex_count, 0,
         "tree %u: its leaves have %" PRIu64 " triangles and %" PRIu64 " vertices, the trees section says %" PRIu64
         " and %" PRIu64,
         tree->index, triangles, vertices, tree->triangle_count, tree->vertex_count);
    RULE(COUNTS, tree->root_triangles == tree->nodes[0].base_triangle_count, 0,
         "tree %u: the root has %u triangles, the trees section says %u", tree->index,
         tree->nodes[0].base_triangle_count, tree->root_triangles);
    RULE(BOXES, !first && inside(box, tree->box) && inside(tree->box, box), 0,
         "tree %u: its box is not that of its leaves", tree->index);
    RULE(ROOT, tree->nodes[0].base_triangle_count <= STRL_VERIFY_ROOT_TRIANGLES, 0,
         "tree %u: the root has %u triangles, expected at most %u", tree->index, tree->nodes[0].base_triangle_count,
         STRL_VERIFY_ROOT_TRIANGLES);
}

static uint64_t decoded_bytes(const strl__vnode *n)
{
    return 26 * (uint64_t)n->vertex_count + 24 * (uint64_t)n->triangle_count + 16 * ((uint64_t)n->step_count + 1) +
           4 * ((uint64_t)n->vertex_count + 1);
}

static bool same_page(const strl__vnode *a, const strl__vnode *b)
{
    return a->page.offset == b->page.offset && a->page.bytes == b->page.bytes && a->page.checksum == b->page.checksum &&
           a->page_decoded == b->page_decoded;
}

/* Payloads from `first` on that share a page. Returns the id behind them. */
static uint32_t check_page(strl__model *model, const strl__vtree *tree, uint32_t first)
{
    const strl__vnode *head = &tree->nodes[first];
    uint32_t id = first, at = 0;
    uint64_t decoded = 0;
    for (; id < tree->node_count && tree->nodes[id].page.offset == head->page.offset; id++) {
        const strl__vnode *n = &tree->nodes[id];
        RULE(PAGES, same_page(n, head) && n->payload_offset == at, id,
             "tree %u node %u: its payload is at byte %u of its page, expected %u, or it "
             "says otherwise of the page than node %u",
             tree->index, id, n->payload_offset, at, first);
        at = n->payload_offset + n->payload_bytes;
        decoded += decoded_bytes(n);
    }
    RULE(PAGES, at == head->page.bytes && decoded == head->page_decoded && id - first <= MOST_PAGE_NODES, first,
         "tree %u: the page of nodes %u to %u has %u bytes and %" PRIu64 " decoded, its records say %u and %u",
         tree->index, first, id - 1, at, decoded, head->page.bytes, head->page_decoded);
    return id;
}

static strl_status list_pages(strl__model *model, strl__vtree *tree, strl_error *err)
{
    tree->page_first = strl__alloc((size_t)tree->node_count + 1, sizeof *tree->page_first);
    if (!tree->page_first)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the pages of %u nodes", tree->node_count);
    for (uint32_t id = 0; id < tree->node_count;) {
        tree->page_first[tree->page_count++] = id;
        id = check_page(model, tree, id);
    }
    tree->page_first[tree->page_count] = tree->node_count;
    return STRL_OK;
}

strl_status strl__v_check_structure(strl__model *model, strl__vtree *tree, strl_error *err)
{
    for (uint32_t id = 0; id < tree->node_count; id++) {
        check_boxes(model, tree, id);
        check_errors(model, tree, id);
    }
    check_counts(model, tree);
    strl_status status = check_groups(model, tree, err);
    return status == STRL_OK ? list_pages(model, tree, err) : status;
}
