/* The main pass: every payload page once, in parallel. */
#include <inttypes.h>
#include <string.h>
#include <xxhash.h>

#include "base/fail.h"
#include "verify/mesh.h"

strl__worker *strl__v_workers_create(const strl__model *model)
{
    strl__worker *workers = strl__alloc_zero(strl_pool_workers(model->pool), sizeof *workers);
    for (unsigned i = 0; workers && i < strl_pool_workers(model->pool); i++) {
        strl_arena_init(&workers[i].arena, 0);
        strl_arena_init(&workers[i].scratch, 0);
    }
    return workers;
}

void strl__v_workers_destroy(const strl__model *model, strl__worker *workers)
{
    for (unsigned i = 0; workers && i < strl_pool_workers(model->pool); i++) {
        strl__free(workers[i].bytes);
        strl__free(workers[i].payload);
        for (unsigned k = 0; k < STRL__V_CHAIN; k++)
            strl_arena_deinit(&workers[i].chain[k].arena);
        strl_arena_deinit(&workers[i].arena);
        strl_arena_deinit(&workers[i].scratch);
    }
    strl__free(workers);
}

static strl_status read_bytes(strl__model *model, uint64_t offset, uint32_t bytes, strl__worker *worker,
                              strl_error *err)
{
    if (!strl__grow(&worker->bytes, &worker->capacity, bytes, 1))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a page of %u bytes", bytes);
    return strl_file_read(model->file, offset, worker->bytes, bytes, err);
}

typedef struct contents {
    strl__model *model;
    strl__vtree *tree;
    strl__worker *workers;
    uint32_t part_count, material_count;
    uint32_t first_page; /* of the slice that is looked at */
} contents;

static void check_box(contents *self, uint32_t id, const strl__vmesh *mesh)
{
    const strl__vnode *n = &self->tree->nodes[id];
    strl__v_checked(self->model->checks, STRL_VERIFY_BOXES, 1);
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        for (unsigned k = 0; k < 3; k++) {
            int64_t at = n->anchor[k] + mesh->position[v][k];
            if (at >= n->box[0][k] && at <= n->box[1][k])
                continue;
            strl__v_flaw(self->model->checks, STRL_VERIFY_BOXES, strl__key(self->tree, id),
                         "tree %u node %u: vertex %u is at %" PRId64 " on axis %u, outside its box (%" PRId64
                         " to %" PRId64 ")",
                         self->tree->index, id, v, at, k, n->box[0][k], n->box[1][k]);
            return;
        }
}

static void check_claims(contents *self, uint32_t id, const strl__vmesh *mesh)
{
    const strl__vnode *n = &self->tree->nodes[id];
    uint32_t last = mesh->step_count;
    strl__v_checked(self->model->checks, STRL_VERIFY_ERRORS, 1);
    if (mesh->geometric_error[last] > n->geometric_min || mesh->geometric_error[0] > n->geometric_max ||
        mesh->appearance_error[last] > n->appearance_min || mesh->appearance_error[0] > n->appearance_max)
        strl__v_flaw(
            self->model->checks, STRL_VERIFY_ERRORS, strl__key(self->tree, id),
            "tree %u node %u: its mesh errs by %g to %g and %g to %g, more than its record says (%g to %g, %g to %g)",
            self->tree->index, id, (double)mesh->geometric_error[last], (double)mesh->geometric_error[0],
            (double)mesh->appearance_error[last], (double)mesh->appearance_error[0], (double)n->geometric_min,
            (double)n->geometric_max, (double)n->appearance_min, (double)n->appearance_max);
    for (uint32_t i = 0; i < mesh->palette_count; i++)
        if (mesh->palette[i][0] >= self->part_count || mesh->palette[i][1] >= self->material_count) {
            strl__v_flaw(self->model->checks, STRL_VERIFY_PAYLOADS, strl__key(self->tree, id),
                         "tree %u node %u: part %u of %u, material %u of %u", self->tree->index, id,
                         mesh->palette[i][0], self->part_count, mesh->palette[i][1], self->material_count);
            break;
        }
}

static strl_status take_hashes(contents *self, uint32_t id, const strl__vmesh *mesh, strl__worker *worker,
                               strl_error *err)
{
    strl__vnode *n = &self->tree->nodes[id];
    uint16_t *map = strl_arena_alloc(&worker->arena, mesh->vertex_count, sizeof *map);
    strl__hash128 *points = strl_arena_alloc(&worker->arena, mesh->vertex_count, sizeof *points);
    if (!map || !points)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the hashes of %u vertices", mesh->vertex_count);
    strl__v_mesh_hash_points(mesh, n->anchor, points);
    strl__v_mesh_resolve(mesh, mesh->step_count, map);
    n->finest = strl__v_mesh_hash(mesh, mesh->step_count, map, points);
    strl__v_mesh_resolve(mesh, 0, map);
    n->base = strl__v_mesh_hash(mesh, 0, map, points);
    return STRL_OK;
}

static strl_status check_node(contents *self, uint32_t id, const uint8_t *bytes, strl__worker *worker, strl_error *err)
{
    strl__vmesh mesh;
    strl_error why = {0};
    strl_status status = strl__v_decode_node(self->model, self->tree, id, bytes, true, worker, &mesh, &why);
    if (status == STRL_OK)
        status = strl__v_mesh_check_states(&mesh, &worker->scratch, &why);
    strl__v_checked(self->model->checks, STRL_VERIFY_PAYLOADS, 1);
    if (status == STRL_ERR_FORMAT) {
        strl__v_flaw(self->model->checks, STRL_VERIFY_PAYLOADS, strl__key(self->tree, id), "tree %u node %u: %s",
                     self->tree->index, id, why.message);
        return STRL_OK;
    }
    if (status != STRL_OK) {
        if (err)
            *err = why;
        return status;
    }
    check_box(self, id, &mesh);
    check_claims(self, id, &mesh);
    status = strl__v_check_cones(self->model, self->tree, id, &mesh, &worker->scratch, err);
    return status != STRL_OK ? status : take_hashes(self, id, &mesh, worker, err);
}

static strl_status check_page(void *context, uint64_t index, unsigned worker_index, strl_error *err)
{
    contents *self = context;
    strl__worker *worker = &self->workers[worker_index];
    uint32_t page = self->first_page + (uint32_t)index, id = self->tree->page_first[page];
    const strl__place *place = &self->tree->nodes[id].page;
    strl_status status = read_bytes(self->model, place->offset, place->bytes, worker, err);
    if (status != STRL_OK)
        return status;
    uint64_t found = XXH3_64bits(worker->bytes, place->bytes);
    strl__v_checked(self->model->checks, STRL_VERIFY_CHECKSUMS, 1);
    if (found != place->checksum) {
        strl__v_flaw(self->model->checks, STRL_VERIFY_CHECKSUMS, strl__key(self->tree, id),
                     "payload page at byte %" PRIu64 " (tree %u, nodes from %u): its checksum is %016" PRIx64
                     ", expected %016" PRIx64,
                     place->offset, self->tree->index, id, found, place->checksum);
        return STRL_OK;
    }
    for (; status == STRL_OK && id < self->tree->page_first[page + 1]; id++)
        status = check_node(self, id, worker->bytes + self->tree->nodes[id].payload_offset, worker, err);
    return status;
}

strl_status strl__v_check_contents(strl__model *model, strl__vtree *tree, strl_error *err)
{
    contents self = {.model = model,
                     .tree = tree,
                     .workers = strl__v_workers_create(model),
                     .part_count = (uint32_t)model->sections[STRL__PARTS].item_count,
                     .material_count = (uint32_t)model->sections[STRL__MATERIALS].item_count};
    strl_status status = self.workers ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "no memory for the workers");
    while (status == STRL_OK && self.first_page < tree->page_count) {
        uint32_t left = tree->page_count - self.first_page, slice = left < 64 ? left : 64;
        status = strl_pool_for(model->pool, slice, check_page, &self, NULL, err);
        self.first_page += slice;
        if (status == STRL_OK)
            status = strl__v_report(model, "contents", self.first_page, tree->page_count, err);
    }
    strl__v_workers_destroy(model, self.workers);
    return status;
}

void strl__v_check_unions(strl__model *model, const strl__vtree *tree, uint64_t *exempt)
{
    for (uint32_t id = 0; id < tree->node_count; id++) {
        const strl__vnode *n = &tree->nodes[id];
        strl__hash128 sum = {0, 0};
        if (n->child_count == 0)
            continue;
        if (n->boundary_steps) {
            ++*exempt;
            continue;
        }
        uint32_t triangles = 0;
        for (uint32_t i = 0; i < n->child_count; i++) {
            strl__hash_add(&sum, tree->nodes[n->first_child + i].base);
            triangles += tree->nodes[n->first_child + i].base_triangle_count;
        }
        strl__v_checked(model->checks, STRL_VERIFY_UNIONS, 1);
        if (!strl__hash_same(sum, n->finest))
            strl__v_flaw(
                model->checks, STRL_VERIFY_UNIONS, strl__key(tree, id),
                "tree %u node %u: its finest state (%u triangles) is not the union of its children's base meshes (%u)",
                tree->index, id, n->triangle_count, triangles);
    }
}
