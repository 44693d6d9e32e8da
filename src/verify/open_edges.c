/* Open edges of a set of nodes, one by one, within the memory budget: edges that a node's own triangles leave
 * open are collected and sorted; where they are too many, only those of one residue of their hash in each of
 * several passes. */
#include <stdlib.h>

#include "base/fail.h"
#include "verify/cracks.h"

/* An edge between vertices of one node. */
typedef struct slot {
    strl__hash128 hash;
    uint32_t a, b;
    uint32_t uses; /* 0 = free */
} slot;

typedef struct collector {
    const strl__edge_query *query;
    strl__worker *workers;
    uint64_t pass, passes;
    uint64_t limit;   /* edges that fit */
    strl_mutex mutex; /* guards what follows */
    strl__open_edge *edges;
    size_t count, capacity;
    bool overflow;
} collector;

static void use_edge(slot *table, size_t mask, strl__hash128 hash, uint32_t a, uint32_t b)
{
    size_t at = hash.low & mask;
    while (table[at].uses && !strl__hash_same(table[at].hash, hash))
        at = (at + 1) & mask;
    if (!table[at].uses)
        table[at] = (slot){hash, a, b, 0};
    /* 1 and 2 stand for odd and even, so that an entry never becomes free again. */
    table[at].uses = table[at].uses == 1 ? 2 : 1;
}

static void absolute(const strl__vmesh *mesh, const int64_t anchor[3], uint32_t v, int64_t out[3])
{
    for (unsigned k = 0; k < 3; k++)
        out[k] = anchor[k] + mesh->position[v][k];
}

static strl_status emit(collector *self, const strl__vmesh *mesh, const int64_t anchor[3], const slot *edge,
                        strl_error *err)
{
    if (self->count >= self->limit) {
        self->overflow = true;
        return STRL_OK;
    }
    if (!strl__grow(&self->edges, &self->capacity, self->count + 1, sizeof *self->edges))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu open edges", self->count);
    strl__open_edge *open = &self->edges[self->count++];
    open->hash = edge->hash;
    absolute(mesh, anchor, edge->a, open->end[0]);
    absolute(mesh, anchor, edge->b, open->end[1]);
    return STRL_OK;
}

/* Leaves out what the query leaves out. */
static bool counts(const collector *self, const strl__vmesh *mesh, const int64_t anchor[3], const strl__hash128 *points,
                   const slot *edge, const uint32_t *near, uint32_t near_count)
{
    const strl__edge_query *query = self->query;
    if (edge->uses != 1 || edge->hash.high % self->passes != self->pass)
        return false;
    if (query->boundary && strl__v_boundary_has(query->boundary, points[edge->a]) &&
        strl__v_boundary_has(query->boundary, points[edge->b]))
        return false;
    int64_t a[3], b[3];
    absolute(mesh, anchor, edge->a, a);
    absolute(mesh, anchor, edge->b, b);
    return !strl__v_clustered_holds(query->tree, near, near_count, a, b);
}

static strl_status collect_mesh(collector *self, uint32_t id, const strl__vmesh *mesh, strl__worker *worker,
                                strl_error *err)
{
    const strl__edge_query *query = self->query;
    const strl__vnode *node = &query->tree->nodes[id];
    uint32_t state = query->view ? strl__v_view_state(query->view, node, id, mesh) : mesh->step_count, near_count = 0;
    uint32_t triangles = mesh->triangle_end[state], slots = 16;
    while (slots < 6 * triangles)
        slots *= 2;
    uint32_t *near = strl_arena_alloc(&worker->scratch, query->clustered ? query->clustered->count : 0, sizeof *near);
    uint16_t *map = strl_arena_alloc(&worker->scratch, mesh->vertex_count, sizeof *map);
    strl__hash128 *points = strl_arena_alloc(&worker->scratch, mesh->vertex_count, sizeof *points);
    slot *table = strl_arena_alloc_zero(&worker->scratch, slots, sizeof *table);
    if (!near || !map || !points || !table)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the edges of %u triangles", triangles);
    if (query->clustered)
        near_count = strl__v_clustered_near(query->clustered, query->tree, query->active, id, near);
    strl__v_mesh_hash_points(mesh, node->anchor, points);
    strl__v_mesh_resolve(mesh, state, map);
    for (uint32_t t = 0; t < triangles; t++)
        for (unsigned k = 0; k < 3; k++) {
            uint32_t a = map[mesh->triangle[t][k]], b = map[mesh->triangle[t][k == 2 ? 0 : k + 1]];
            use_edge(table, slots - 1, strl__hash_edge(points[a], points[b]), a, b);
        }
    strl_status status = STRL_OK;
    strl_mutex_lock(&self->mutex);
    for (uint32_t i = 0; status == STRL_OK && i < slots && !self->overflow; i++)
        if (counts(self, mesh, node->anchor, points, &table[i], near, near_count))
            status = emit(self, mesh, node->anchor, &table[i], err);
    strl_mutex_unlock(&self->mutex);
    return status;
}

static bool takes_part(const strl__edge_query *query, uint32_t id)
{
    const strl__vnode *node = &query->tree->nodes[id];
    if (!query->active)
        return node->child_count == 0;
    return strl__bit(query->active, id) && node->rung < 3;
}

static strl_status collect_page(void *context, uint64_t page, unsigned worker_index, strl_error *err)
{
    collector *self = context;
    const strl__vtree *tree = self->query->tree;
    strl__worker *worker = &self->workers[worker_index];
    strl_status status = STRL_OK;
    for (uint32_t id = tree->page_first[page]; status == STRL_OK && id < tree->page_first[page + 1]; id++) {
        strl__vmesh mesh;
        if (!takes_part(self->query, id))
            continue;
        status = strl__v_load_mesh(self->query->model, tree, id, worker, &mesh, err);
        if (status == STRL_OK)
            status = collect_mesh(self, id, &mesh, worker, err);
    }
    return status;
}

static int compare_edges(const void *a, const void *b)
{
    const strl__open_edge *x = a, *y = b;
    return strl__hash_less(x->hash, y->hash) ? -1 : strl__hash_less(y->hash, x->hash);
}

static void visit_odd(collector *self, uint64_t *count)
{
    if (self->count > 0)
        qsort(self->edges, self->count, sizeof *self->edges, compare_edges);
    for (size_t i = 0, end; i < self->count; i = end) {
        for (end = i + 1; end < self->count && strl__hash_same(self->edges[i].hash, self->edges[end].hash);)
            end++;
        if ((end - i) % 2 == 0)
            continue;
        ++*count;
        if (self->query->visit)
            self->query->visit(self->query->context, &self->edges[i]);
    }
}

strl_status strl__v_open_edges(const strl__edge_query *query, uint64_t *count, strl_error *err)
{
    collector self = {.query = query,
                      .workers = strl__v_workers_create(query->model),
                      .passes = 1,
                      .limit = query->model->memory_bytes / 5 / sizeof(strl__open_edge)};
    strl_status status = self.workers ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "no memory for the workers");
    strl_mutex_init(&self.mutex);
    *count = 0;
    while (status == STRL_OK && self.pass < self.passes) {
        self.count = 0;
        self.overflow = false;
        status = strl_pool_for(query->model->pool, query->tree->page_count, collect_page, &self, NULL, err);
        if (status == STRL_OK && self.overflow && self.pass == 0) {
            self.passes *= 4; /* nothing was visited yet: begin again with fewer at a time */
            continue;
        }
        if (status == STRL_OK && self.overflow)
            status = strl__fail(err, STRL_ERR_MEMORY, "more than %zu open edges in one of %llu passes", self.count,
                                (unsigned long long)self.passes);
        if (status == STRL_OK)
            visit_odd(&self, count);
        self.pass++;
    }
    strl_mutex_deinit(&self.mutex);
    strl__free(self.edges);
    strl__v_workers_destroy(query->model, self.workers);
    return status;
}
