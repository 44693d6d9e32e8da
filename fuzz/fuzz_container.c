/* Opens a container from memory and reads everything, once as it is and once with its checksums made right, which is
 * how mutations get past them. Properties: whatever is accepted keeps the promises of container.h and progressive.h. */
#include <stdlib.h>
#include <string.h>

#include "../tests/container/reseal.h"
#include "container/container.h"
#include "container/cut.h"
#include "container/treelet.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define MOST_MESHES 64u /* a few bytes of payload may stand for 65,535 vertices */
#define MOST_ITEMS 2000u

static void require(bool promise)
{
    if (!promise)
        abort();
}

static void check_record(const strl_tree *tree, uint32_t id, const strl_node *node)
{
    require(id == 0 ? node->parent == STRL_NONE : node->parent < id);
    require(node->child_count <= STRL_NODE_MAX_CHILDREN && node->level < tree->level_count);
    require(node->child_count ? node->first_child > id && node->first_child + node->child_count <= tree->node_count
                              : node->first_child == STRL_NONE);
    require(node->group < tree->group_count && node->group_size >= 1);
    require(node->geometric_min >= 0 && node->geometric_min <= node->geometric_max);
    require(node->group_geometric >= node->geometric_min && node->group_appearance >= node->appearance_min);
    for (int axis = 0; axis < 3; axis++)
        require(node->box_min[axis] <= node->box_max[axis]);
}

static void check_mesh(const strl_node *node, const strl_pm *mesh)
{
    require(strl_pm_check(mesh, NULL) == STRL_OK);
    require(mesh->vertex_count == node->vertex_count && mesh->triangle_count == node->triangle_count);
    require(mesh->geometric_error[mesh->step_count] <= node->geometric_min);
}

static void read_tree(strl_container *container, uint32_t tree, strl_arena *arena)
{
    const strl_tree *facts = strl_container_tree(container, tree);
    for (uint32_t id = 0, meshes = 0; id < facts->node_count; id++) {
        strl_node node;
        if (strl_container_node(container, tree, id, &node, NULL) != STRL_OK)
            return;
        check_record(facts, id, &node);
        strl_pm mesh;
        strl_arena_mark mark = strl_arena_get_mark(arena);
        if (meshes++ < MOST_MESHES && strl_container_mesh(container, tree, &node, arena, &mesh, NULL) == STRL_OK)
            check_mesh(&node, &mesh);
        strl_arena_rewind(arena, mark);
    }
    strl_cut cut;
    strl_cut_init(&cut, container, tree, facts->step);
    strl_node node;
    for (uint32_t id = 0, last = 0; strl_cut_next(&cut, &id, &node, NULL) == STRL_OK && id != STRL_NONE; last = id)
        require(last == 0 || id > last);
}

/* Where the bytes of a run's page pass, all its placements can be read, or say why not. */
static void read_runs(strl_container *container)
{
    const uint64_t count = strl_container_get_info(container)->placement_count;
    for (uint32_t run = 0; run < strl_container_run_count(container) && run < MOST_ITEMS; run++) {
        strl_run facts;
        if (strl_container_run(container, run, &facts, NULL) != STRL_OK)
            continue;
        require(facts.far.area >= 0 && facts.far.normal[0] < 1024 && facts.far.normal[1] < 1024 &&
                facts.far.spread <= STRL_SPREAD_MOST);
        for (int axis = 0; axis < 3; axis++)
            require(facts.box_min[axis] <= facts.box_max[axis]);
        require(facts.page.bytes >= 112 && facts.page.bytes <= STRL__TABLE_PAGE_BYTES);
        uint8_t *page = malloc(facts.page.bytes);
        require(page != NULL);
        if (strl_source_read(strl_container_source(container), facts.page.offset, page, facts.page.bytes, NULL) ==
                STRL_OK &&
            strl_run_check(container, run, &facts, page, facts.page.bytes, NULL) == STRL_OK)
            for (uint64_t i = (uint64_t)run * STRL_RUN_PLACEMENTS; i < count && i / STRL_RUN_PLACEMENTS == run; i++) {
                strl_placement placement;
                if (strl_run_placement(container, i, page, &placement, NULL) == STRL_OK)
                    require(placement.tree < strl_container_get_info(container)->tree_count);
            }
        free(page);
    }
}

static void read_all(const uint8_t *data, size_t size)
{
    strl_source *source;
    strl_container *container;
    if (strl_source_open_memory(data, size, &source, NULL) != STRL_OK ||
        strl_container_open(source, &container, NULL) != STRL_OK)
        return;
    const strl_container_info *info = strl_container_get_info(container);
    strl_arena arena;
    strl_arena_init(&arena, 64u << 20);
    for (uint32_t tree = 0; tree < info->tree_count; tree++)
        read_tree(container, tree, &arena);
    strl_arena_deinit(&arena);
    char name[128];
    for (uint64_t i = 0; i < info->placement_count && i < MOST_ITEMS; i++) {
        strl_placement placement;
        if (strl_container_placement(container, i, &placement, NULL) == STRL_OK)
            require(placement.tree < info->tree_count);
    }
    read_runs(container);
    for (uint32_t i = 0; i < info->part_count && i < MOST_ITEMS; i++)
        if (strl_container_part(container, i, name, sizeof name, NULL) == STRL_OK)
            require(strlen(name) < sizeof name);
    for (uint32_t i = 0; i < info->material_count && i < MOST_ITEMS; i++) {
        uint32_t rgba;
        strl_container_material(container, i, name, sizeof name, &rgba, NULL);
    }
    strl_container_close(container);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    read_all(data, size);
    uint8_t *copy = malloc(size ? size : 1);
    require(copy != NULL);
    if (size)
        memcpy(copy, data, size);
    if (size >= STRL__HEADER_BYTES)
        strl__store_le(copy + STRL__AT_FILE_BYTES, 8, size);
    reseal_all(copy, size, NULL, NULL);
    read_all(copy, size);
    free(copy);
    return 0;
}
