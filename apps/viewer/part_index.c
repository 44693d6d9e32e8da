#include "viewer/part_index.h"

#include <math.h>
#include <stdatomic.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "container/container.h"
#include "platform/thread.h"

/* Any node within the limits of the format decodes in less. */
#define SCRATCH_BYTES ((size_t)128 << 20)
#define PERMILLE 1000u

struct strl_part_index {
    strl_thread *thread;
    strl_location location; /* of copies: */
    char *path, *cache;
    uint32_t part_count;
    double (*bounds)[6];  /* [part_count], world; the thread's until done */
    double (*of_tree)[6]; /* the same in model units, of the tree at work */
    atomic_bool cancelled, done;
    atomic_uint permille;
    strl_status status;
    strl_error error;
};

static void clear(double (*bounds)[6], uint32_t count)
{
    for (uint32_t part = 0; part < count; part++)
        for (int i = 0; i < 3; i++)
            bounds[part][i] = INFINITY, bounds[part][3 + i] = -INFINITY;
}

static void widen(double bounds[6], const double point[3])
{
    for (int i = 0; i < 3; i++) {
        bounds[i] = fmin(bounds[i], point[i]);
        bounds[3 + i] = fmax(bounds[3 + i], point[i]);
    }
}

/* ---- reading */

static void add_mesh(strl_part_index *index, const strl_tree *tree, const strl_node *node, const strl_pm *mesh)
{
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        for (int c = 0; c < 3; c++) {
            uint32_t v = mesh->triangle[t][c];
            uint32_t part = mesh->palette[mesh->palette_index ? mesh->palette_index[v] : 0].part;
            double point[3];
            for (int i = 0; i < 3; i++)
                point[i] = tree->origin[i] + tree->step * (double)(node->anchor[i] + mesh->position[v][i]);
            if (part < index->part_count)
                widen(index->of_tree[part], point);
        }
}

static strl_status read_leaf(strl_part_index *index, strl_container *container, uint32_t tree, const strl_node *node,
                             strl_error *err)
{
    strl_arena arena;
    strl_pm mesh;
    strl_arena_init(&arena, SCRATCH_BYTES);
    strl_status status = strl_container_mesh(container, tree, node, &arena, &mesh, err);
    if (status == STRL_OK)
        add_mesh(index, strl_container_tree(container, tree), node, &mesh);
    strl_arena_deinit(&arena);
    return status;
}

static strl_status read_tree(strl_part_index *index, strl_container *container, uint32_t tree, strl_error *err)
{
    uint32_t count = strl_container_tree(container, tree)->node_count;
    strl_status status = STRL_OK;
    for (uint32_t n = 0; status == STRL_OK && n < count; n++) {
        strl_node node;
        if (atomic_load(&index->cancelled))
            return strl__fail(err, STRL_ERR_CANCELLED, "looking for parts was cancelled");
        status = strl_container_node(container, tree, n, &node, err);
        if (status == STRL_OK && node.child_count == 0)
            status = read_leaf(index, container, tree, &node, err);
        atomic_store(&index->permille, (unsigned)((uint64_t)n * PERMILLE / count));
    }
    return status;
}

/* Boxes of the tree's parts to the world, by one of its placements. */
static void place_parts(strl_part_index *index, const double m[12])
{
    for (uint32_t part = 0; part < index->part_count; part++) {
        const double *box = index->of_tree[part];
        for (int corner = 0; corner < 8 && box[0] <= box[3]; corner++) {
            double world[3];
            for (int i = 0; i < 3; i++) {
                world[i] = m[4 * i + 3];
                for (int k = 0; k < 3; k++)
                    world[i] += m[4 * i + k] * box[k + (corner >> k & 1 ? 3 : 0)];
            }
            widen(index->bounds[part], world);
        }
    }
}

static strl_status read_all(strl_part_index *index, strl_container *container, strl_error *err)
{
    const strl_container_info *info = strl_container_get_info(container);
    strl_status status = STRL_OK;
    clear(index->bounds, index->part_count);
    for (uint32_t tree = 0; status == STRL_OK && tree < info->tree_count; tree++) {
        clear(index->of_tree, index->part_count);
        status = read_tree(index, container, tree, err);
        for (uint64_t p = 0; status == STRL_OK && p < info->placement_count; p++) {
            strl_placement placement;
            status = strl_container_placement(container, p, &placement, err);
            if (status == STRL_OK && placement.tree == tree)
                place_parts(index, placement.transform);
        }
    }
    return status;
}

static void run(void *context)
{
    strl_part_index *index = context;
    strl_container *container = NULL;
    index->status = strl_location_open_container(&index->location, &container, &index->error);
    if (index->status == STRL_OK)
        index->status = read_all(index, container, &index->error);
    strl_container_close(container);
    atomic_store(&index->done, true);
}

/* ---- life */

strl_status strl_part_index_create(const strl_location *location, uint32_t part_count, strl_part_index **out, strl_error *err)
{
    strl_part_index *index = strl__alloc_zero(1, sizeof *index);
    *out = NULL;
    if (!index)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to look for parts");
    index->part_count = part_count;
    index->location = *location;
    index->location.name = index->path = strl__strdup(location->name);
    index->location.cache = index->cache = location->cache ? strl__strdup(location->cache) : NULL;
    index->bounds = strl__alloc(part_count, sizeof *index->bounds);
    index->of_tree = strl__alloc(part_count, sizeof *index->of_tree);
    strl_status status = index->path && !location->cache == !index->cache && index->bounds && index->of_tree
                             ? strl_thread_start(&index->thread, run, index, err)
                             : strl__fail(err, STRL_ERR_MEMORY, "no memory to look for %u parts", part_count);
    if (status == STRL_OK)
        *out = index;
    else
        strl_part_index_destroy(index);
    return status;
}

void strl_part_index_destroy(strl_part_index *index)
{
    if (!index)
        return;
    atomic_store(&index->cancelled, true);
    strl_thread_join(index->thread);
    strl__free(index->path);
    strl__free(index->cache);
    strl__free(index->bounds);
    strl__free(index->of_tree);
    strl__free(index);
}

/* ---- asking */

bool strl_part_index_is_done(const strl_part_index *index, double *share)
{
    *share = atomic_load(&index->permille) / (double)PERMILLE;
    return atomic_load(&index->done);
}

strl_status strl_part_index_status(const strl_part_index *index, strl_error *err)
{
    if (err)
        *err = index->error;
    return index->status;
}

bool strl_part_index_widen(const strl_part_index *index, uint32_t part, double bounds[6])
{
    if (index->status != STRL_OK || part >= index->part_count || !(index->bounds[part][0] <= index->bounds[part][3]))
        return false;
    widen(bounds, index->bounds[part]);
    widen(bounds, index->bounds[part] + 3);
    return true;
}
