#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "verify/distances.h"

static strl_status load_node(void *context, uint32_t index, unsigned worker_index, strl__chunk **chunk, strl_error *err)
{
    strl__cut_surface *cut = context;
    strl__worker *worker = &cut->workers[worker_index];
    const strl__vnode *node = &cut->tree->nodes[cut->nodes[index]];
    strl__vmesh mesh;
    strl_status status = strl__v_load_mesh(cut->model, cut->tree, cut->nodes[index], worker, &mesh, err);
    if (status != STRL_OK)
        return status;
    uint32_t state = cut->base_states ? 0 : strl__v_mesh_state(&mesh, cut->limit, false),
             count = mesh.triangle_end[state];
    uint16_t *map = strl_arena_alloc(&worker->scratch, mesh.vertex_count, sizeof *map);
    double(*vertex)[3] = strl_arena_alloc(&worker->scratch, mesh.vertex_end[state], sizeof *vertex);
    uint32_t(*triangle)[3] = strl_arena_alloc(&worker->scratch, count, sizeof *triangle);
    if (!map || !vertex || !triangle)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %u triangles of a cut", count);
    strl__v_mesh_resolve(&mesh, state, map);
    for (uint32_t v = 0; v < mesh.vertex_end[state]; v++)
        for (unsigned k = 0; k < 3; k++)
            vertex[v][k] = mesh.position[v][k];
    for (uint32_t t = 0; t < count; t++)
        for (unsigned k = 0; k < 3; k++)
            triangle[t][k] = map[mesh.triangle[t][k]];
    double base[3] = {(double)node->anchor[0], (double)node->anchor[1], (double)node->anchor[2]};
    *chunk = strl__v_chunk_build(base, (const double(*)[3])vertex, mesh.vertex_end[state],
                                 (const uint32_t(*)[3])triangle, count, &worker->scratch);
    if (!*chunk)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %u triangles of a cut", count);
    (*chunk)->claimed = mesh.geometric_error[state];
    cut->triangles[index] = count;
    return STRL_OK;
}

static double (*node_boxes(const strl__vtree *tree, const uint32_t *nodes, uint32_t count))[2][3]
{
    double(*box)[2][3] = strl__alloc(count, sizeof *box);
    for (uint32_t i = 0; box && i < count; i++)
        for (unsigned j = 0; j < 6; j++)
            box[i][j / 3][j % 3] = (double)tree->nodes[nodes[i]].box[j / 3][j % 3];
    return box;
}

strl_status strl__v_cut_surface_init(strl__cut_surface *cut, strl__model *model, const strl__vtree *tree,
                                     const uint64_t *active, strl_error *err)
{
    uint32_t count = 0;
    cut->model = model;
    cut->tree = tree;
    for (uint32_t id = 0; id < tree->node_count; id++)
        count += strl__bit(active, id) && tree->nodes[id].triangle_count > 0;
    cut->nodes = strl__alloc(count, sizeof *cut->nodes);
    cut->triangles = strl__alloc_zero(count, sizeof *cut->triangles);
    cut->workers = strl__v_workers_create(model);
    if (!cut->nodes || !cut->triangles || !cut->workers)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a cut of %u nodes", count);
    count = 0;
    for (uint32_t id = 0; id < tree->node_count; id++)
        if (strl__bit(active, id) && tree->nodes[id].triangle_count > 0)
            cut->nodes[count++] = id;
    double(*box)[2][3] = node_boxes(tree, cut->nodes, count);
    if (!box)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a cut of %u nodes", count);
    for (uint32_t i = 0; i < count; i++)
        cut->surface.most_claimed = fmax(cut->surface.most_claimed, (double)tree->nodes[cut->nodes[i]].geometric_max);
    cut->surface.load = load_node;
    cut->surface.context = cut;
    return strl__v_surface_init(&cut->surface, count, box, err);
}

void strl__v_cut_surface_deinit(strl__cut_surface *cut)
{
    strl__v_surface_deinit(&cut->surface);
    strl__free(cut->nodes);
    strl__free(cut->triangles);
    if (cut->model)
        strl__v_workers_destroy(cut->model, cut->workers);
    *cut = (strl__cut_surface){0};
}
