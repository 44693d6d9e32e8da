/* Nodes' meshes. A payload may be told by the parent's mesh, whose own may be told by its parent's: a worker keeps one
 * such chain, which the nodes of a page share for the most part. */
#include <inttypes.h>

#include "base/fail.h"
#include "verify/mesh.h"

static void rewind_arena(strl_arena *arena)
{
    strl_arena_rewind(arena, (strl_arena_mark){0});
}

static strl_status counts_agree(const strl__vnode *node, const strl__vmesh *mesh, strl_error *err)
{
    if (mesh->vertex_count != node->vertex_count || mesh->triangle_count != node->triangle_count ||
        mesh->step_count != node->step_count || mesh->vertex_end[0] != node->base_vertex_count ||
        mesh->triangle_end[0] != node->base_triangle_count)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "%u vertices, %u triangles, %u steps, base %u and %u; its record says %u, %u, %u, %u and %u",
                          mesh->vertex_count, mesh->triangle_count, mesh->step_count, mesh->vertex_end[0],
                          mesh->triangle_end[0], node->vertex_count, node->triangle_count, node->step_count,
                          node->base_vertex_count, node->base_triangle_count);
    return STRL_OK;
}

/* A payload whose parent's mesh is at hand where it needs that. */
static strl_status decode_one(const strl__vnode *node, const uint8_t *bytes, bool with_looks,
                              const strl__vchain *parent, strl_arena *arena, strl__vmesh *mesh, strl_error *err)
{
    strl__v_told told = {0};
    if (parent) {
        told.mesh = &parent->mesh;
        for (unsigned k = 0; k < 3; k++)
            told.offset[k] = (uint32_t)((uint64_t)parent->anchor[k] - (uint64_t)node->anchor[k]);
    }
    size_t head = 0;
    strl_status status = node->rung == 4 ? strl__v_brick_check(bytes, node, arena, &head, err) : STRL_OK;
    if (status == STRL_OK)
        status = strl__v_payload_decode(bytes + head, node->payload_bytes - head, parent ? &told : NULL, arena,
                                        with_looks, mesh, err);
    if (status == STRL_OK)
        status = counts_agree(node, mesh, err);
    return status == STRL_OK ? strl__v_mesh_check_ranges(mesh, err) : status;
}

static strl_status read_bytes(strl__model *model, const strl__vnode *node, strl__worker *worker, strl_error *err)
{
    if (!strl__grow(&worker->payload, &worker->payload_capacity, node->payload_bytes, 1))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a payload of %u bytes", node->payload_bytes);
    return strl_file_read(model->file, node->page.offset + node->payload_offset, worker->payload, node->payload_bytes,
                          err);
}

static strl_status keep(strl__model *model, const strl__vtree *tree, uint32_t id, bool with_looks, strl__worker *worker,
                        unsigned depth, strl_error *err)
{
    strl__vchain *link = &worker->chain[depth];
    const strl__vnode *node = &tree->nodes[id];
    if (link->is_whole && link->tree == tree && link->node == id && (link->with_looks || !with_looks))
        return STRL_OK;
    *link = (strl__vchain){.tree = tree, .node = id, .with_looks = with_looks, .arena = link->arena};
    for (unsigned k = 0; k < 3; k++)
        link->anchor[k] = node->anchor[k];
    rewind_arena(&link->arena);
    strl_status status = read_bytes(model, node, worker, err);
    if (status == STRL_OK)
        status = decode_one(node, worker->payload, with_looks, depth ? link - 1 : NULL, &link->arena, &link->mesh, err);
    link->is_whole = status == STRL_OK;
    return status == STRL_OK ? STRL_OK
                             : strl__fail_context(err, status, "its parent's mesh is needed, but node %u", id);
}

strl_status strl__v_decode_node(strl__model *model, const strl__vtree *tree, uint32_t id, const uint8_t *bytes,
                                bool with_looks, strl__worker *worker, strl__vmesh *mesh, strl_error *err)
{
    uint32_t above[STRL__V_CHAIN];
    unsigned count = 0;
    strl_status status = STRL_OK;
    rewind_arena(&worker->arena);
    rewind_arena(&worker->scratch);
    for (uint32_t at = id; tree->nodes[at].told_by_parent; at = tree->nodes[at].parent) {
        if (count == STRL__V_CHAIN - 1)
            return strl__fail(err, STRL_ERR_FORMAT, "it is told by more than %u nodes above it", count);
        above[count++] = tree->nodes[at].parent;
    }
    for (unsigned i = 0; i < count && status == STRL_OK; i++)
        status = keep(model, tree, above[count - 1 - i], with_looks, worker, i, err);
    if (status == STRL_OK)
        status = decode_one(&tree->nodes[id], bytes, with_looks, count ? &worker->chain[count - 1] : NULL,
                            &worker->arena, mesh, err);
    return status;
}

strl_status strl__v_load_mesh(strl__model *model, const strl__vtree *tree, uint32_t id, strl__worker *worker,
                              strl__vmesh *mesh, strl_error *err)
{
    const strl__vnode *node = &tree->nodes[id];
    strl_status status = STRL_OK;
    if (!strl__grow(&worker->bytes, &worker->capacity, node->payload_bytes, 1))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for a payload of %u bytes", node->payload_bytes);
    if (status == STRL_OK)
        status = strl_file_read(model->file, node->page.offset + node->payload_offset, worker->bytes,
                                node->payload_bytes, err);
    if (status == STRL_OK)
        status = strl__v_decode_node(model, tree, id, worker->bytes, false, worker, mesh, err);
    return status == STRL_OK ? STRL_OK : strl__fail_context(err, status, "tree %u node %u", tree->index, id);
}
