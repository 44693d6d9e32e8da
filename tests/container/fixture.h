/* Small containers made by hand: a tree of strips whose records and meshes are functions of the node's id. */
#ifndef STRL_TESTS_CONTAINER_FIXTURE_H
#define STRL_TESTS_CONTAINER_FIXTURE_H

#include <dirent.h>
#include <setjmp.h>
#include <stdarg.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "base/hash.h"
#include "container/treelet.h"
#include "container/writer.h"
#include "geometry/payload.h"
#include "geometry/payload_streams.h"
#include "platform/file.h"

#define FIXTURE_PARTS 5u
#define FIXTURE_MATERIALS 3u

typedef struct fixture {
    char folder[64];
    char path[128];
    uint32_t node_count;
    strl_node *nodes; /* page fields unset */
    uint32_t copies;  /* placed besides the one that is always there */
} fixture;

/* A strip of steps + 1 triangles; each step adds one vertex and one triangle at its end. */
static inline void fixture_mesh(const strl_node *node, uint32_t id, strl_arena *arena, strl_pm *pm)
{
    uint32_t vertices = node->vertex_count, states = node->step_count + 1;
    *pm = (strl_pm){vertices,
                    node->triangle_count,
                    node->step_count,
                    1 + id % 2,
                    NULL,
                    NULL,
                    NULL,
                    NULL,
                    NULL,
                    NULL,
                    NULL,
                    NULL,
                    NULL,
                    NULL,
                    NULL,
                    NULL};
    pm->position = strl_arena_alloc_zero(arena, vertices, sizeof *pm->position);
    pm->normal = strl_arena_alloc_zero(arena, vertices, sizeof *pm->normal);
    pm->colour = id % 3 == 0 ? strl_arena_alloc_zero(arena, vertices, 4) : NULL;
    pm->palette_index = id % 2 ? strl_arena_alloc_zero(arena, vertices, 2) : NULL;
    pm->parent = strl_arena_alloc_zero(arena, vertices, 2);
    pm->triangle = strl_arena_alloc_zero(arena, pm->triangle_count, sizeof *pm->triangle);
    pm->vertex_end = strl_arena_alloc_zero(arena, states, 4);
    pm->triangle_end = strl_arena_alloc_zero(arena, states, 4);
    pm->geometric_error = strl_arena_alloc_zero(arena, states, sizeof(float));
    pm->appearance_error = strl_arena_alloc_zero(arena, states, sizeof(float));
    pm->palette = strl_arena_alloc_zero(arena, pm->palette_count, sizeof *pm->palette);
    for (uint32_t v = 0; v < vertices; v++) {
        pm->position[v][0] = (int32_t)(v / 2 * 8);
        pm->position[v][1] = (int32_t)(v % 2 * 8);
        pm->position[v][2] = (int32_t)((v + id) % 3);
        pm->normal[v][0] = (uint16_t)((id + v) % 1024);
        pm->normal[v][1] = 512;
        if (pm->colour)
            pm->colour[v] = 0xff000000u | (uint32_t)strl__mix64(id * 100u + v) >> 8;
        if (pm->palette_index)
            pm->palette_index[v] = (uint16_t)(v % 2);
        pm->parent[v] = v < 3 ? 0 : (uint16_t)(v - 1);
    }
    for (uint32_t t = 0; t < pm->triangle_count; t++)
        for (uint32_t k = 0; k < 3; k++)
            pm->triangle[t][k] = (uint16_t)(t + k);
    for (uint32_t s = 0; s < states; s++) {
        pm->vertex_end[s] = 3 + s;
        pm->triangle_end[s] = 1 + s;
        pm->geometric_error[s] = s + 1 == states ? node->geometric_min : node->geometric_max;
        pm->appearance_error[s] = s + 1 == states ? node->appearance_min : node->appearance_max;
    }
    for (uint32_t i = 0; i < pm->palette_count; i++)
        pm->palette[i] = (strl_palette_entry){(id + i) % FIXTURE_PARTS, i % FIXTURE_MATERIALS, 0xff0000ffu + (i << 8)};
}

/* On the scale of the payload's errors, to which the writer would round it. */
static inline float fixture_error(float error)
{
    return strl__error_of_code(strl__code_of_error(error));
}

static inline void fixture_fill(strl_node *node, uint32_t id, uint32_t level)
{
    uint32_t steps = 2 + id % 4;
    node->level = level;
    node->group = id / 2;
    node->group_size = 2;
    node->anchor[0] = (int64_t)id * 64 - 1000;
    node->anchor[1] = -7;
    node->anchor[2] = (int64_t)1 << 40;
    for (int axis = 0; axis < 3; axis++) {
        node->box_min[axis] = node->group_box_min[axis] = node->anchor[axis];
        node->box_max[axis] = node->group_box_max[axis] = node->anchor[axis] + 48;
    }
    node->geometric_min = fixture_error((float)(level * 2) + 0.5f);
    node->geometric_max = fixture_error((float)(level * 2) + 1.5f);
    node->appearance_min = 0;
    node->appearance_max = fixture_error(0.75f);
    node->group_geometric = node->geometric_min;
    node->group_appearance = node->appearance_max;
    node->vertex_count = 3 + steps;
    node->base_vertex_count = 3;
    node->triangle_count = 1 + steps;
    node->base_triangle_count = 1;
    node->step_count = steps;
    node->boundary_steps = id % 7;
    node->shared_vertices = id % 3;
    node->rung = id % 4;
    node->decode_parent = STRL_NONE;
}

/* levels of nodes below the root, each with 1 to `fan` children. Returns malloc'ed records. */
static inline strl_node *fixture_records(uint32_t levels, uint32_t fan, uint32_t *count)
{
    size_t capacity = 1;
    for (uint32_t i = 0, width = 1; i < levels; i++, capacity += width)
        width *= fan;
    strl_node *nodes = calloc(capacity, sizeof *nodes);
    assert_non_null(nodes);
    nodes[0].parent = STRL_NONE;
    uint32_t used = 1, first = 0;
    for (uint32_t level = levels + 1; level-- > 0;) {
        uint32_t end = used;
        for (uint32_t id = first; id < end; id++) {
            fixture_fill(&nodes[id], id, level);
            nodes[id].child_count = level ? 1 + (uint32_t)(strl__mix64(id + 6) % fan) : 0;
            nodes[id].first_child = level ? used : STRL_NONE;
            for (uint32_t i = 0; i < nodes[id].child_count; i++)
                nodes[used++].parent = id;
            if (id && id % 2 == 0 && nodes[id].parent == 0)
                nodes[id].decode_parent = 0;
        }
        first = end;
    }
    *count = used;
    return nodes;
}

static inline void fixture_setup(fixture *self, uint32_t levels, uint32_t fan)
{
    strcpy(self->folder, "/tmp/strl-container-XXXXXX");
    assert_non_null(mkdtemp(self->folder));
    snprintf(self->path, sizeof self->path, "%s/model.stroll", self->folder);
    self->nodes = fixture_records(levels, fan, &self->node_count);
    self->copies = 0;
}

static inline void fixture_teardown(fixture *self)
{
    assert_int_equal(strl_path_remove_directory(self->folder, NULL), STRL_OK);
    free(self->nodes);
}

static inline unsigned fixture_files(const fixture *self)
{
    unsigned count = 0;
    DIR *folder = opendir(self->folder);
    assert_non_null(folder);
    while (readdir(folder))
        count++;
    closedir(folder);
    return count - 2;
}

static inline strl_tree fixture_tree(uint32_t node_count)
{
    return (strl_tree){.structure = STRL_STRUCTURE_CLUSTERS,
                       .origin = {10, 20, 30},
                       .step = 0.25,
                       .node_count = node_count,
                       .leaf_geometric = 0.5f};
}

/* Copy i of the tree: here and there, turned and mirrored. */
static inline strl_placement fixture_copy(uint32_t i)
{
    return (strl_placement){
        .transform = {i % 2 ? 1 : -1, 0, 0, 5 + 100. * (i % 16), 0, 0, -1, 0.5 * i, 0, 1 + i % 3, 0, i}};
}

/* The mesh of node 0 as a reader will have it, by which others are told. */
static inline strl_status fixture_root(const strl_node *root, const strl_node *node, strl_arena *arena,
                                       strl_payload_reference *reference, strl_error *err)
{
    strl_pm mesh, decoded;
    strl_writer payload = {0};
    fixture_mesh(root, 0, arena, &mesh);
    strl_status status = strl_payload_encode(&mesh, NULL, arena, &payload, NULL, err);
    if (status == STRL_OK)
        status = strl_payload_decode(payload.data, payload.size, NULL, arena, &decoded, err);
    if (status == STRL_OK) {
        *reference = strl_payload_reference_of(&decoded);
        strl_page_place(reference, root->anchor, node);
    }
    strl__free(payload.data);
    return status;
}

/* root: node 0, by which others are told. */
static inline strl_status fixture_add_node(strl_container_writer *writer, const strl_node *root, const strl_node *node,
                                           uint32_t id, strl_error *err)
{
    strl_payload_reference reference, *told = node->decode_parent == STRL_NONE ? NULL : &reference;
    strl_arena arena;
    strl_arena_init(&arena, 0);
    strl_pm mesh;
    strl_writer payload = {0};
    strl_status status = STRL_ERR_MEMORY;
    /* One block in advance: the arrays below it cannot fail then. */
    void *block = strl_arena_alloc(&arena, 1 << 16, 1);
    if (block) {
        strl_arena_rewind(&arena, (strl_arena_mark){arena.head, 0});
        fixture_mesh(node, id, &arena, &mesh);
        status = told ? fixture_root(root, node, &arena, told, err) : STRL_OK;
        if (status == STRL_OK)
            status = strl_payload_encode(&mesh, told, &arena, &payload, NULL, err);
    } else if (err) {
        *err = (strl_error){STRL_ERR_MEMORY, "no memory for the fixture"};
    }
    if (status == STRL_OK)
        status = strl_container_writer_add_node(writer, node, payload.data, (uint32_t)payload.size, err);
    strl__free(payload.data);
    strl_arena_deinit(&arena);
    return status;
}

static inline strl_status fixture_add_all(const fixture *self, strl_container_writer *writer, strl_error *err)
{
    const strl_tree tree = fixture_tree(self->node_count);
    strl_status status = strl_container_writer_begin_tree(writer, &tree, err);
    for (uint32_t id = 0; status == STRL_OK && id < self->node_count; id++)
        status = fixture_add_node(writer, &self->nodes[0], &self->nodes[id], id, err);
    if (status == STRL_OK)
        status = strl_container_writer_end_tree(writer, err);
    const strl_placement placement = {.transform = {1, 0, 0, 5, 0, 0, -1, 0, 0, 1, 0, 0}};
    if (status == STRL_OK)
        status = strl_container_writer_add_placement(writer, &placement, err);
    for (uint32_t i = 0; status == STRL_OK && i < self->copies; i++) {
        const strl_placement copy = fixture_copy(i);
        status = strl_container_writer_add_placement(writer, &copy, err);
    }
    for (uint32_t i = 0; status == STRL_OK && i < FIXTURE_PARTS; i++) {
        char name[32];
        snprintf(name, sizeof name, "part %u of the façade", i);
        status = strl_container_writer_add_part(writer, name, err);
    }
    for (uint32_t i = 0; status == STRL_OK && i < FIXTURE_MATERIALS; i++)
        status = strl_container_writer_add_material(writer, i ? "steel" : "", 0xff112233u + i, err);
    return status;
}

static inline strl_container_writer_desc fixture_desc(const fixture *self)
{
    return (strl_container_writer_desc){
        .path = self->path,
        .scratch_dir = self->folder,
        .info = {.unit = "mm",
                 .up_axis = 2,
                 .has_colour = true,
                 .triangles_in = 1234,
                 .dropped_degenerate = 3,
                 .closed_hint = 1},
    };
}

static inline strl_status fixture_write(const fixture *self, strl_error *err)
{
    const strl_container_writer_desc desc = fixture_desc(self);
    strl_container_writer *writer;
    uint64_t bytes = 0;
    strl_status status = strl_container_writer_create(&desc, &writer, err);
    if (status == STRL_OK)
        status = fixture_add_all(self, writer, err);
    if (status == STRL_OK)
        status = strl_container_writer_finish(writer, &bytes, err);
    strl_container_writer_destroy(writer);
    return status;
}

/* The whole file, malloc'ed. */
static inline uint8_t *fixture_load(const char *path, size_t *size)
{
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    assert_int_equal(fseek(file, 0, SEEK_END), 0);
    *size = (size_t)ftell(file);
    rewind(file);
    uint8_t *bytes = malloc(*size);
    assert_non_null(bytes);
    assert_int_equal(fread(bytes, 1, *size, file), *size);
    fclose(file);
    return bytes;
}

/* Every run and its page, as who walks reads them: placements are those of the table. */
static inline strl_status fixture_read_runs(strl_container *container, uint64_t *digest, strl_error *err)
{
    const strl_container_info *info = strl_container_get_info(container);
    strl_status status = STRL_OK;
    for (uint32_t run = 0; status == STRL_OK && run < strl_container_run_count(container); run++) {
        strl_run facts;
        status = strl_container_run(container, run, &facts, err);
        if (status != STRL_OK)
            break;
        uint8_t *page = malloc(facts.page.bytes);
        assert_non_null(page);
        status = strl_source_read(strl_container_source(container), facts.page.offset, page, facts.page.bytes, err);
        if (status == STRL_OK)
            status = strl_run_check(container, run, &facts, page, facts.page.bytes, err);
        for (uint64_t i = (uint64_t)run * STRL_RUN_PLACEMENTS;
             status == STRL_OK && i < info->placement_count && i / STRL_RUN_PLACEMENTS == run; i++) {
            strl_placement placement;
            status = strl_run_placement(container, i, page, &placement, err);
            *digest =
                strl__mix64(*digest ^ strl__checksum(placement.transform, sizeof placement.transform) ^ placement.tree);
        }
        free(page);
        *digest = strl__mix64(*digest ^ strl__checksum(facts.box_min, sizeof facts.box_min) ^ facts.far.rgba ^
                              facts.far.normal[0]);
        *digest = strl__mix64(*digest ^ facts.far.spread);
        *digest =
            strl__mix64(*digest ^ strl__checksum(facts.box_max, sizeof facts.box_max) ^ (uint64_t)(facts.far.area * 4));
    }
    return status;
}

/* Reads everything there is; *digest depends on all of it. */
static inline strl_status fixture_read_all(strl_container *container, uint64_t *digest, strl_error *err)
{
    const strl_container_info *info = strl_container_get_info(container);
    strl_status status = STRL_OK;
    strl_arena arena;
    strl_arena_init(&arena, 0);
    *digest = 0;
    for (uint32_t t = 0; status == STRL_OK && t < info->tree_count; t++)
        for (uint32_t id = 0; status == STRL_OK && id < strl_container_tree(container, t)->node_count; id++) {
            strl_node node;
            strl_pm mesh;
            status = strl_container_node(container, t, id, &node, err);
            if (status != STRL_OK)
                break;
            strl_arena_mark mark = strl_arena_get_mark(&arena);
            status = strl_container_mesh(container, t, &node, &arena, &mesh, err);
            *digest = strl__mix64(*digest ^ node.page.checksum ^ node.payload_offset ^ mesh.vertex_count);
            strl_arena_rewind(&arena, mark);
        }
    strl_arena_deinit(&arena);
    for (uint64_t i = 0; status == STRL_OK && i < info->placement_count; i++) {
        strl_placement placement;
        status = strl_container_placement(container, i, &placement, err);
        *digest = strl__mix64(*digest ^ strl__checksum(placement.transform, sizeof placement.transform));
    }
    if (status == STRL_OK)
        status = fixture_read_runs(container, digest, err);
    char name[64];
    for (uint32_t i = 0; status == STRL_OK && i < info->part_count; i++) {
        status = strl_container_part(container, i, name, sizeof name, err);
        *digest = strl__mix64(*digest ^ strl__checksum(name, strlen(name)));
    }
    for (uint32_t i = 0; status == STRL_OK && i < info->material_count; i++) {
        uint32_t rgba;
        status = strl_container_material(container, i, name, sizeof name, &rgba, err);
        *digest = strl__mix64(*digest ^ rgba ^ strl__checksum(name, strlen(name)));
    }
    return status;
}

/* Opens from memory and reads all. */
static inline strl_status fixture_try(const uint8_t *bytes, size_t size, uint64_t *digest, strl_error *err)
{
    strl_source *source;
    strl_container *container = NULL;
    *digest = 0;
    strl_status status = strl_source_open_memory(bytes, size, &source, err);
    if (status == STRL_OK)
        status = strl_container_open(source, &container, err);
    if (status == STRL_OK)
        status = fixture_read_all(container, digest, err);
    strl_container_close(container);
    return status;
}

#endif
