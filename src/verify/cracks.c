#include "verify/cracks.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "base/fail.h"

#define BLOOM_PROBES 8u
/* Cracked cuts whose edges are looked at one by one. */
#define CLOSE_LOOKS 4u

/* ---- boundary of the input ---- */

static uint64_t probe(const strl__boundary *boundary, strl__hash128 point, uint64_t i)
{
    return (point.low + i * (point.high | 1)) & boundary->mask;
}

bool strl__v_boundary_has(const strl__boundary *boundary, strl__hash128 point)
{
    for (unsigned i = 0; boundary->bits && i < BLOOM_PROBES; i++) {
        uint64_t bit = probe(boundary, point, i);
        if (!(boundary->bits[bit / 64] >> (bit % 64) & 1))
            return false;
    }
    return boundary->bits != NULL;
}

static void add_ends(void *context, const strl__open_edge *edge)
{
    strl__boundary *boundary = context;
    for (unsigned e = 0; e < 2; e++) {
        strl__hash128 point = strl__hash_point(edge->end[e][0], edge->end[e][1], edge->end[e][2]);
        for (unsigned i = 0; i < BLOOM_PROBES; i++) {
            uint64_t bit = probe(boundary, point, i);
            boundary->bits[bit / 64] |= (uint64_t)1 << (bit % 64);
        }
    }
}

/* Enough bits for every vertex of the leaves, within a sixteenth of the memory. */
static uint64_t bloom_bits(const strl__model *model, const strl__vtree *tree)
{
    uint64_t bits = 1u << 16, most = model->memory_bytes / 16 * 8;
    while (bits < tree->vertex_count * 32 && bits * 2 <= most)
        bits *= 2;
    return bits;
}

strl_status strl__v_boundary_find(strl__model *model, const strl__vtree *tree, strl__boundary *boundary,
                                  strl_error *err)
{
    uint64_t bits = bloom_bits(model, tree);
    *boundary = (strl__boundary){.bits = strl__alloc_zero(bits / 64, 8), .mask = bits - 1};
    if (!boundary->bits)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the boundary of the input");
    const strl__edge_query query = {.model = model, .tree = tree, .visit = add_ends, .context = boundary};
    strl_status status = strl__v_open_edges(&query, &boundary->open_edges, err);
    if (status == STRL_OK && boundary->open_edges == 0) {
        strl__free(boundary->bits);
        boundary->bits = NULL;
    }
    return status;
}

void strl__v_boundary_deinit(strl__boundary *boundary)
{
    strl__free(boundary->bits);
    *boundary = (strl__boundary){0};
}

/* ---- the ladder's last rung ---- */

strl_status strl__v_clustered_find(const strl__vtree *tree, strl__clustered *clustered, strl_error *err)
{
    *clustered = (strl__clustered){0};
    for (uint32_t id = 0; id < tree->node_count; id++)
        clustered->count += tree->nodes[id].rung == 3;
    clustered->nodes = strl__alloc(clustered->count, sizeof *clustered->nodes);
    if (!clustered->nodes)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a list of %u nodes", clustered->count);
    uint32_t count = 0;
    for (uint32_t id = 0; id < tree->node_count; id++)
        if (tree->nodes[id].rung == 3)
            clustered->nodes[count++] = id;
    return STRL_OK;
}

void strl__v_clustered_deinit(strl__clustered *clustered)
{
    strl__free(clustered->nodes);
    *clustered = (strl__clustered){0};
}

static bool boxes_touch(const int64_t a[2][3], const int64_t b[2][3])
{
    for (unsigned k = 0; k < 3; k++)
        if (a[0][k] > b[1][k] || b[0][k] > a[1][k])
            return false;
    return true;
}

uint32_t strl__v_clustered_near(const strl__clustered *clustered, const strl__vtree *tree, const uint64_t *active,
                                uint32_t id, uint32_t *near)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < clustered->count; i++) {
        uint32_t other = clustered->nodes[i];
        if (strl__bit(active, other) && boxes_touch(tree->nodes[id].box, tree->nodes[other].box))
            near[count++] = other;
    }
    return count;
}

static bool box_holds(const int64_t box[2][3], const int64_t p[3])
{
    return p[0] >= box[0][0] && p[0] <= box[1][0] && p[1] >= box[0][1] && p[1] <= box[1][1] && p[2] >= box[0][2] &&
           p[2] <= box[1][2];
}

bool strl__v_clustered_holds(const strl__vtree *tree, const uint32_t *near, uint32_t count, const int64_t a[3],
                             const int64_t b[3])
{
    for (uint32_t i = 0; i < count; i++)
        if (box_holds(tree->nodes[near[i]].box, a) && box_holds(tree->nodes[near[i]].box, b))
            return true;
    return false;
}

/* ---- cuts ---- */

typedef struct cut_sums {
    strl__hash128 parity; /* exclusive or over the uses of all edges that count */
    uint64_t triangles, edges, excluded;
} cut_sums;

typedef struct crack_test {
    strl__model *model;
    const strl__vtree *tree;
    const strl__boundary *boundary;
    strl__clustered clustered;
    uint32_t cut_count;
    strl__vview *views; /* [cut_count] */
    uint64_t *active;   /* [cut_count][words] */
    uint32_t *groups;   /* [workers][group_count] */
    cut_sums *sums;     /* [workers][cut_count] */
    strl__worker *workers;
    uint32_t first_page;
} crack_test;

static uint64_t *active_of(const crack_test *test, uint32_t cut)
{
    return test->active + cut * strl__bit_words(test->tree);
}

static strl_status select_cut(void *context, uint64_t cut, unsigned worker, strl_error *err)
{
    crack_test *test = context;
    (void)err;
    strl__v_view_random(test->tree, test->model->desc->seed, (uint32_t)cut, &test->views[cut]);
    strl__v_cut_view(test->tree, &test->views[cut], test->groups + (size_t)worker * test->tree->group_count,
                     active_of(test, (uint32_t)cut));
    return STRL_OK;
}

/* One node's mesh while all cuts that have it are summed. */
typedef struct node_edges {
    const strl__vmesh *mesh;
    const int64_t *anchor;
    uint16_t *map;
    strl__hash128 *points;
    bool *on_boundary; /* per vertex */
    uint32_t *near;
} node_edges;

static bool excluded(const crack_test *test, const node_edges *node, uint32_t near_count, uint32_t a, uint32_t b)
{
    int64_t p[3], q[3];
    if (near_count == 0)
        return false;
    for (unsigned k = 0; k < 3; k++) {
        p[k] = node->anchor[k] + node->mesh->position[a][k];
        q[k] = node->anchor[k] + node->mesh->position[b][k];
    }
    return strl__v_clustered_holds(test->tree, node->near, near_count, p, q);
}

static void sum_state(const crack_test *test, const node_edges *node, uint32_t state, uint32_t near_count,
                      cut_sums *sums)
{
    const strl__vmesh *mesh = node->mesh;
    strl__v_mesh_resolve(mesh, state, node->map);
    for (uint32_t t = 0; t < mesh->triangle_end[state]; t++)
        for (unsigned k = 0; k < 3; k++) {
            uint32_t a = node->map[mesh->triangle[t][k]], b = node->map[mesh->triangle[t][k == 2 ? 0 : k + 1]];
            if (node->on_boundary[a] && node->on_boundary[b])
                continue;
            if (excluded(test, node, near_count, a, b)) {
                sums->excluded++;
                continue;
            }
            strl__hash128 hash = strl__hash_edge(node->points[a], node->points[b]);
            sums->parity.low ^= hash.low;
            sums->parity.high ^= hash.high;
            sums->edges++;
        }
    sums->triangles += mesh->triangle_end[state];
}

static strl_status prepare_node(const crack_test *test, const strl__vnode *n, const strl__vmesh *mesh,
                                strl__worker *worker, node_edges *node, strl_error *err)
{
    *node = (node_edges){.mesh = mesh, .anchor = n->anchor};
    node->map = strl_arena_alloc(&worker->scratch, mesh->vertex_count, sizeof *node->map);
    node->points = strl_arena_alloc(&worker->scratch, mesh->vertex_count, sizeof *node->points);
    node->on_boundary = strl_arena_alloc(&worker->scratch, mesh->vertex_count, sizeof *node->on_boundary);
    node->near = strl_arena_alloc(&worker->scratch, test->clustered.count, sizeof *node->near);
    if (!node->map || !node->points || !node->on_boundary || !node->near)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the edges of %u triangles", mesh->triangle_count);
    strl__v_mesh_hash_points(mesh, n->anchor, node->points);
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        node->on_boundary[v] = strl__v_boundary_has(test->boundary, node->points[v]);
    return STRL_OK;
}

static strl_status sum_node(const crack_test *test, uint32_t id, strl__worker *worker, cut_sums *sums, strl_error *err)
{
    const strl__vnode *n = &test->tree->nodes[id];
    strl__vmesh mesh;
    node_edges node;
    strl_status status = strl__v_load_mesh(test->model, test->tree, id, worker, &mesh, err);
    if (status == STRL_OK)
        status = prepare_node(test, n, &mesh, worker, &node, err);
    for (uint32_t cut = 0; status == STRL_OK && cut < test->cut_count; cut++) {
        const uint64_t *active = active_of(test, cut);
        if (!strl__bit(active, id))
            continue;
        uint32_t state = strl__v_view_state(&test->views[cut], n, id, &mesh);
        if (n->rung == 3) { /* its own edges are all left out */
            sums[cut].triangles += mesh.triangle_end[state];
            sums[cut].excluded += 3 * (uint64_t)mesh.triangle_end[state];
            continue;
        }
        uint32_t near_count = strl__v_clustered_near(&test->clustered, test->tree, active, id, node.near);
        sum_state(test, &node, state, near_count, &sums[cut]);
    }
    return status;
}

static bool in_any_cut(const crack_test *test, uint32_t id)
{
    for (uint32_t cut = 0; cut < test->cut_count; cut++)
        if (strl__bit(active_of(test, cut), id))
            return true;
    return false;
}

static strl_status sum_page(void *context, uint64_t index, unsigned worker, strl_error *err)
{
    crack_test *test = context;
    const uint32_t *page = &test->tree->page_first[test->first_page + index];
    strl_status status = STRL_OK;
    for (uint32_t id = page[0]; status == STRL_OK && id < page[1]; id++)
        if (in_any_cut(test, id))
            status = sum_node(test, id, &test->workers[worker], test->sums + (size_t)worker * test->cut_count, err);
    return status;
}

static void add_sums(const crack_test *test, uint32_t cut, cut_sums *total)
{
    *total = (cut_sums){0};
    for (unsigned w = 0; w < strl_pool_workers(test->model->pool); w++) {
        const cut_sums *part = &test->sums[(size_t)w * test->cut_count + cut];
        total->parity.low ^= part->parity.low;
        total->parity.high ^= part->parity.high;
        total->triangles += part->triangles;
        total->edges += part->edges;
        total->excluded += part->excluded;
    }
}

static void keep_first(void *context, const strl__open_edge *edge)
{
    strl__open_edge *first = context;
    if ((first->hash.low | first->hash.high) == 0 || strl__hash_less(edge->hash, first->hash))
        *first = *edge;
}

/* Finds the cracks of one cut, for the sentence. */
static strl_status look_closely(crack_test *test, uint32_t cut, strl_verify_report *report, strl_error *err)
{
    const strl__vtree *tree = test->tree;
    const strl__vview *view = &test->views[cut];
    strl__open_edge first = {0};
    uint64_t count = 0;
    const strl__edge_query query = {.model = test->model,
                                    .tree = tree,
                                    .active = active_of(test, cut),
                                    .view = view,
                                    .boundary = test->boundary,
                                    .clustered = &test->clustered,
                                    .visit = keep_first,
                                    .context = &first};
    strl_status status = strl__v_open_edges(&query, &count, err);
    if (status != STRL_OK)
        return status;
    double p[2][3];
    for (unsigned i = 0; i < 6; i++)
        p[i / 3][i % 3] = tree->origin[i % 3] + tree->step * (double)first.end[i / 3][i % 3];
    report->cracks += count;
    strl__v_flaw(test->model->checks, STRL_VERIFY_CRACKS, (uint64_t)tree->index << 32 | cut,
                 "tree %u, view-dependent cut %u: %" PRIu64
                 " edges are open where the input is closed, one from %g %g %g to %g %g %g",
                 tree->index, cut, count, p[0][0], p[0][1], p[0][2], p[1][0], p[1][1], p[1][2]);
    return STRL_OK;
}

static strl_status judge_cuts(crack_test *test, strl_verify_report *report, strl_error *err)
{
    strl_status status = STRL_OK;
    for (uint32_t cut = 0; status == STRL_OK && cut < test->cut_count; cut++) {
        cut_sums total;
        add_sums(test, cut, &total);
        strl__v_checked(test->model->checks, STRL_VERIFY_CRACKS, 1);
        report->cuts++;
        report->cut_triangles += total.triangles;
        report->excluded_edges += total.excluded;
        if ((total.parity.low | total.parity.high) == 0)
            continue;
        if (report->cracked_cuts++ < CLOSE_LOOKS)
            status = look_closely(test, cut, report, err);
        else
            strl__v_flaw(test->model->checks, STRL_VERIFY_CRACKS, (uint64_t)test->tree->index << 32 | cut,
                         "tree %u, view-dependent cut %u has edges that are open where the input is closed",
                         test->tree->index, cut);
    }
    return status;
}

static strl_status sum_cuts(crack_test *test, strl_error *err)
{
    strl_pool *pool = test->model->pool;
    strl_status status = strl_pool_for(pool, test->cut_count, select_cut, test, NULL, err);
    while (status == STRL_OK && test->first_page < test->tree->page_count) {
        uint32_t left = test->tree->page_count - test->first_page, slice = left < 64 ? left : 64;
        status = strl_pool_for(pool, slice, sum_page, test, NULL, err);
        test->first_page += slice;
        if (status == STRL_OK)
            status = strl__v_report(test->model, "cracks", test->first_page, test->tree->page_count, err);
    }
    return status;
}

strl_status strl__v_check_cracks(strl__model *model, const strl__vtree *tree, const strl__boundary *boundary,
                                 strl_verify_report *report, strl_error *err)
{
    uint32_t cuts = model->desc->cuts ? model->desc->cuts : 200;
    unsigned workers = strl_pool_workers(model->pool);
    crack_test test = {.model = model, .tree = tree, .boundary = boundary, .cut_count = cuts};
    test.views = strl__alloc(cuts, sizeof *test.views);
    test.active = strl__alloc((size_t)cuts * strl__bit_words(tree), sizeof *test.active);
    test.groups = strl__alloc((size_t)workers * tree->group_count, sizeof *test.groups);
    test.sums = strl__alloc_zero((size_t)workers * cuts, sizeof *test.sums);
    test.workers = strl__v_workers_create(model);
    strl_status status = strl__v_clustered_find(tree, &test.clustered, err);
    if (status == STRL_OK && (!test.views || !test.active || !test.groups || !test.sums || !test.workers))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for %u cuts of %u nodes", cuts, tree->node_count);
    if (status == STRL_OK)
        status = sum_cuts(&test, err);
    if (status == STRL_OK)
        status = judge_cuts(&test, report, err);
    report->clustered_nodes += test.clustered.count;
    strl__free(test.views);
    strl__free(test.active);
    strl__free(test.groups);
    strl__free(test.sums);
    strl__v_workers_destroy(model, test.workers);
    strl__v_clustered_deinit(&test.clustered);
    return status;
}
