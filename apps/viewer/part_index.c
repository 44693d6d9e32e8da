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

/* A part that occurs in a tree. */
typedef struct tree_part {
    uint32_t part;
    double box[6]; /* model units */
} tree_part;

struct strl_part_index {
    strl_thread *thread;
    strl_location location; /* of copies: */
    char *path, *cache;
    uint32_t part_count;
    double (*bounds)[6]; /* [part_count], world; the thread's until done, as all below */
    /* [part_count]: of the tree at work: its newest place in parts, if that is of the part and tree */
    uint32_t *slots;
    tree_part *parts; /* of all trees, one tree after the other */
    size_t capacity, count;
    size_t *ends;               /* [tree_count]: where each tree's parts end */
    size_t first;               /* of the tree at work */
    uint64_t steps_done, steps; /* nodes and placements */
    atomic_bool cancelled, done;
    atomic_uint permille;
    strl_status status;
    strl_error error;
};

static void clear(double bounds[6])
{
    for (int i = 0; i < 3; i++)
        bounds[i] = INFINITY, bounds[3 + i] = -INFINITY;
}

static void widen(double bounds[6], const double point[3])
{
    for (int i = 0; i < 3; i++) {
        bounds[i] = fmin(bounds[i], point[i]);
        bounds[3 + i] = fmax(bounds[3 + i], point[i]);
    }
}

/* By a box's corners, placed. */
static void widen_by_box(double bounds[6], const double m[12], const double box[6])
{
    for (int corner = 0; corner < 8; corner++) {
        double world[3];
        for (int i = 0; i < 3; i++) {
            world[i] = m[4 * i + 3];
            for (int k = 0; k < 3; k++)
                world[i] += m[4 * i + k] * box[k + (corner >> k & 1 ? 3 : 0)];
        }
        widen(bounds, world);
    }
}

/* ---- reading */

/* Of the tree at work. NULL without memory. */
static tree_part *find_part(strl_part_index *index, uint32_t part)
{
    size_t slot = index->slots[part];
    if (slot >= index->first && slot < index->count && index->parts[slot].part == part)
        return &index->parts[slot];
    if (index->count >= UINT32_MAX ||
        !strl__grow(&index->parts, &index->capacity, index->count + 1, sizeof *index->parts))
        return NULL;
    tree_part *made = &index->parts[index->count];
    index->slots[part] = (uint32_t)index->count++;
    made->part = part;
    clear(made->box);
    return made;
}

static bool add_mesh(strl_part_index *index, const strl_tree *tree, const strl_node *node, const strl_pm *mesh)
{
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        for (int c = 0; c < 3; c++) {
            uint32_t v = mesh->triangle[t][c];
            uint32_t part = mesh->palette[mesh->palette_index ? mesh->palette_index[v] : 0].part;
            double point[3];
            if (part >= index->part_count)
                continue;
            tree_part *found = find_part(index, part);
            if (!found)
                return false;
            for (int i = 0; i < 3; i++)
                point[i] = tree->origin[i] + tree->step * (double)(node->anchor[i] + mesh->position[v][i]);
            widen(found->box, point);
        }
    return true;
}

static strl_status read_node(strl_part_index *index, strl_container *container, uint32_t tree, const strl_node *node,
                             strl_error *err)
{
    strl_arena arena;
    strl_pm mesh;
    strl_arena_init(&arena, SCRATCH_BYTES);
    strl_status status = strl_container_mesh(container, tree, node, &arena, &mesh, err);
    if (status == STRL_OK && !add_mesh(index, strl_container_tree(container, tree), node, &mesh))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory to look for %u parts", index->part_count);
    strl_arena_deinit(&arena);
    return status;
}

static strl_status step(strl_part_index *index, strl_error *err)
{
    index->steps_done++;
    atomic_store(&index->permille, (unsigned)((double)index->steps_done / (double)index->steps * PERMILLE));
    return atomic_load(&index->cancelled) ? strl__fail(err, STRL_ERR_CANCELLED, "looking for parts was cancelled")
                                          : STRL_OK;
}

/* In a tree of samples each triangle is in one node, at any level; in others the leaves have them all. */
static strl_status read_tree(strl_part_index *index, strl_container *container, uint32_t tree, strl_error *err)
{
    const strl_tree *facts = strl_container_tree(container, tree);
    strl_status status = STRL_OK;
    index->first = index->count;
    for (uint32_t n = 0; status == STRL_OK && n < facts->node_count; n++) {
        strl_node node;
        status = strl_container_node(container, tree, n, &node, err);
        if (status == STRL_OK && (node.child_count == 0 || facts->structure == STRL_STRUCTURE_SAMPLES))
            status = read_node(index, container, tree, &node, err);
        if (status == STRL_OK)
            status = step(index, err);
    }
    index->ends[tree] = index->count;
    return status;
}

/* What a placement is as a whole, and what its tree's vertices are of. */
static void place_tree(strl_part_index *index, const strl_tree *tree, const strl_placement *placement)
{
    const double *m = placement->transform;
    uint32_t own = placement->own_part - 1; /* of none: more than any count */
    double box[6];
    for (int i = 0; i < 3; i++) {
        box[i] = tree->origin[i] + tree->step * (double)tree->box_min[i];
        box[3 + i] = tree->origin[i] + tree->step * (double)tree->box_max[i];
    }
    if (own < index->part_count && tree->triangle_count > 0)
        widen_by_box(index->bounds[own], m, box);
    size_t first = placement->tree > 0 ? index->ends[placement->tree - 1] : 0;
    for (size_t p = first; p < index->ends[placement->tree]; p++)
        widen_by_box(index->bounds[index->parts[p].part], m, index->parts[p].box);
}

static strl_status read_all(strl_part_index *index, strl_container *container, strl_error *err)
{
    const strl_container_info *info = strl_container_get_info(container);
    strl_status status = STRL_OK;
    index->steps = info->placement_count + 1;
    index->ends = strl__alloc_zero(info->tree_count, sizeof *index->ends);
    if (!index->ends)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to look for parts in %u trees", info->tree_count);
    for (uint32_t tree = 0; tree < info->tree_count; tree++)
        index->steps += strl_container_tree(container, tree)->node_count;
    for (uint32_t part = 0; part < index->part_count; part++)
        clear(index->bounds[part]);
    for (uint32_t tree = 0; status == STRL_OK && tree < info->tree_count; tree++)
        status = read_tree(index, container, tree, err);
    for (uint64_t p = 0; status == STRL_OK && p < info->placement_count; p++) {
        strl_placement placement;
        status = strl_container_placement(container, p, &placement, err);
        if (status == STRL_OK) {
            place_tree(index, strl_container_tree(container, placement.tree), &placement);
            status = step(index, err);
        }
    }
    return status;
}

/* Once every part has its box. */
static void drop_parts(strl_part_index *index)
{
    strl__free(index->parts);
    strl__free(index->ends);
    strl__free(index->slots);
    index->parts = NULL, index->ends = NULL, index->slots = NULL;
}

static void run(void *context)
{
    strl_part_index *index = context;
    strl_container *container = NULL;
    index->status = strl_location_open_container(&index->location, &container, &index->error);
    if (index->status == STRL_OK)
        index->status = read_all(index, container, &index->error);
    strl_container_close(container);
    drop_parts(index);
    atomic_store(&index->done, true);
}

/* ---- life */

strl_status strl_part_index_create(const strl_location *location, uint32_t part_count, strl_part_index **out,
                                   strl_error *err)
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
    index->slots = strl__alloc_zero(part_count, sizeof *index->slots);
    strl_status status = index->path && !location->cache == !index->cache && index->bounds && index->slots
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
    drop_parts(index);
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
