/* Bricks of sample trees as meshes of some states (geometry/sample_payload.h). The states' errors are the sizes of
 * cells, so a state is chosen as that of any mesh (refine.c); from one to the next no vertex moves: triangles come, and
 * other splats stand for what is finer. Seen from afar, of a brick without children only the states are kept that show:
 * a brick that covers some pixels shows a hundredth of itself. Who comes nearer has it decoded anew, with more of them;
 * who goes away has what is too much dropped where room is wanted. */
#include "walk/internal.h"

#include <inttypes.h>
#include <string.h>

/* What a mesh has of the brick, and which of it each state shows: the first vertices and triangles, and splats up to an
 * end. */
typedef struct brick_part {
    uint32_t state, vertices, triangles, splats;
    uint16_t *from, *to; /* numbers of vertices: the brick's by the mesh's, and back; NULL = the same ones */
    uint16_t vertex_end[STRL_BRICK_LEVELS + 1];   /* by state */
    uint32_t triangle_end[STRL_BRICK_LEVELS + 1]; /* the same */
    uint16_t splat_end[STRL_BRICK_LEVELS];        /* but of the last state, which shows none */
} brick_part;

/* The coarsest state whose closed cells are no larger than that; the finest one that there is where it has not twice as
 * much. */
static uint32_t choose_state(const float *errors, const uint32_t *triangle_end, uint32_t finest, float closed_size)
{
    uint32_t state = 0;
    if (!(closed_size > 0))
        return finest;
    while (state < finest && errors[state] > closed_size)
        state++;
    return 2 * (uint64_t)triangle_end[state] > triangle_end[finest] ? finest : state;
}

static void find_triangle_ends(const strl_brick_head *head, brick_part *part)
{
    uint32_t sum = 0;
    for (uint32_t i = 0; i < head->run_count; i++)
        part->triangle_end[head->run[i].level] += head->run[i].count;
    for (uint32_t level = 0; level <= head->level_count; level++)
        part->triangle_end[level] = sum += part->triangle_end[level];
}

static void set_counts(brick_part *part, uint32_t levels)
{
    part->vertices = part->vertex_end[part->state];
    part->triangles = part->triangle_end[part->state];
    part->splats = part->splat_end[part->state < levels ? part->state : levels - 1];
}

/* By the coarsest state that shows them, else as they were: a mesh of fewer states has the first ones. */
static bool number_vertices(const strl_pm *pm, const strl_brick_head *head, strl_arena *arena, brick_part *part)
{
    uint32_t end[STRL_BRICK_LEVELS + 2] = {0};
    part->to = strl_arena_alloc(arena, (size_t)pm->vertex_count + 1, sizeof *part->to);
    part->from = strl_arena_alloc(arena, (size_t)pm->vertex_count + 1, sizeof *part->from);
    uint8_t *level = strl_arena_alloc(arena, (size_t)pm->vertex_count + 1, 1);
    if (!part->to || !part->from || !level)
        return false;
    memset(level, STRL_BRICK_LEVELS + 1, pm->vertex_count);
    for (uint32_t i = 0, t = 0; i < head->run_count; t += head->run[i++].count)
        for (uint32_t corner = 0; corner < 3 * head->run[i].count; corner++) {
            uint8_t *of = &level[pm->triangle[t + corner / 3][corner % 3]];
            *of = head->run[i].level < *of ? (uint8_t)head->run[i].level : *of;
        }
    for (uint32_t v = 0; v < pm->vertex_count; v++)
        if (level[v] <= head->level_count)
            end[level[v] + 1]++;
    for (uint32_t s = 0; s <= head->level_count; s++) {
        end[s + 1] += end[s];
        part->vertex_end[s] = (uint16_t)end[s + 1];
    }
    for (uint32_t v = 0; v < pm->vertex_count; v++) {
        if (level[v] > head->level_count)
            continue;
        part->to[v] = (uint16_t)end[level[v]]++;
        part->from[part->to[v]] = (uint16_t)v;
    }
    return true;
}

/* A brick above others is taken as it is: it has but one level, and all of it is drawn as soon as it is opened. */
static strl_status choose_part(const strl_node *record, const strl_pm *pm, const strl_brick_head *head,
                               float closed_size, strl_arena *arena, brick_part *part, strl_error *err)
{
    bool is_leaf = record->child_count == 0;
    *part = (brick_part){.state = head->level_count};
    find_triangle_ends(head, part);
    if (is_leaf && !number_vertices(pm, head, arena, part))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a brick of %" PRIu32 " vertices", pm->vertex_count);
    if (is_leaf)
        part->state = choose_state(head->error, part->triangle_end, head->level_count, closed_size);
    for (uint32_t s = 0; s <= head->level_count && !is_leaf; s++)
        part->vertex_end[s] = (uint16_t)pm->vertex_count;
    for (uint32_t s = 0; s < head->level_count; s++)
        part->splat_end[s] = (uint16_t)head->splat_end[s];
    set_counts(part, head->level_count);
    return STRL_OK;
}

/* Of the block of a mesh with so many levels. */
static size_t block_bytes(uint32_t vertices, uint32_t triangles, uint32_t splats, uint32_t levels, bool labels)
{
    return (size_t)vertices * (sizeof(strl_vertex) + (labels ? sizeof(strl_vertex_label) : 0)) +
           splats * sizeof(strl_splat) +
           ((size_t)levels + 1) * (sizeof(uint32_t) + sizeof(float) + 2 * sizeof(uint16_t)) +
           3 * (size_t)triangles * sizeof(uint16_t);
}

/* False without memory. */
static bool allocate(const brick_part *part, uint32_t levels, bool labels, strl__mesh *mesh)
{
    size_t states = (size_t)levels + 1;
    uint8_t *block = strl__alloc(1, block_bytes(part->vertices, part->triangles, part->splats, levels, labels));
    if (!block)
        return false;
    *mesh = (strl__mesh){.vertex_count = part->vertices,
                         .base_vertices = part->vertices,
                         .triangle_count = part->triangles,
                         .step_count = levels,
                         .held = part->state};
    mesh->vertices = (strl_vertex *)block;
    mesh->labels = labels ? (strl_vertex_label *)(mesh->vertices + part->vertices) : NULL;
    mesh->splats =
        labels ? (strl_splat *)(mesh->labels + part->vertices) : (strl_splat *)(mesh->vertices + part->vertices);
    mesh->triangle_end = (uint32_t *)(mesh->splats + part->splats);
    mesh->errors = (float *)(mesh->triangle_end + states);
    mesh->vertex_end = (uint16_t *)(mesh->errors + states);
    mesh->splat_end = mesh->vertex_end + states;
    mesh->indices = mesh->splat_end + states;
    return true;
}

/* Of all states; finer ones than the part's have no more than that. */
static void copy_states(const brick_part *part, const float *errors, strl__mesh *mesh)
{
    for (uint32_t s = 0; s <= mesh->step_count; s++) {
        uint32_t shown = s < part->state ? s : part->state;
        mesh->vertex_end[s] = part->vertex_end[shown];
        mesh->triangle_end[s] = part->triangle_end[shown];
        if (s < mesh->step_count) {
            mesh->errors[s] = errors[s];
            mesh->splat_end[s] = part->splat_end[shown];
        }
    }
}

static void put_triangle(const uint16_t corner[3], const uint16_t *to, uint16_t *indices)
{
    for (int c = 0; c < 3; c++)
        indices[c] = to ? to[corner[c]] : corner[c];
}

/* By level, so that those of a state are a run from the front. */
static void order_triangles(const strl_pm *pm, const strl_brick_head *head, const brick_part *part, strl__mesh *mesh)
{
    uint32_t next[STRL_BRICK_LEVELS + 1] = {0};
    for (uint32_t level = 1; level <= head->level_count; level++)
        next[level] = part->triangle_end[level - 1];
    for (uint32_t i = 0, t = 0; i < head->run_count; t += head->run[i++].count)
        for (uint32_t k = 0; k < head->run[i].count && head->run[i].level <= part->state; k++)
            put_triangle(pm->triangle[t + k], part->to, mesh->indices + 3 * (size_t)next[head->run[i].level]++);
}

strl_status strl__brick_create(const strl_node *record, const strl_pm *pm, const strl_brick_head *head, bool labels,
                               float closed_size, strl_arena *arena, strl__mesh *mesh, const uint16_t **from,
                               strl_error *err)
{
    brick_part part;
    if (pm->step_count != 0)
        return strl__fail(err, STRL_ERR_FORMAT, "a brick has %u steps, expected none", pm->step_count);
    strl_status status = choose_part(record, pm, head, closed_size, arena, &part, err);
    if (status != STRL_OK)
        return status;
    size_t bytes = block_bytes(part.vertices, part.triangles, part.splats, head->level_count, labels);
    uint64_t most = strl__node_bytes(record, labels);
    if (bytes > most)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "a brick takes %zu bytes, expected at most %" PRIu64 ": it has too many splats", bytes, most);
    if (!allocate(&part, head->level_count, labels, mesh))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a brick of %" PRIu32 " vertices", part.vertices);
    *from = part.from;
    mesh->spare_bytes = most - bytes;
    memcpy(mesh->splats, head->splat, part.splats * sizeof *mesh->splats);
    order_triangles(pm, head, &part, mesh);
    copy_states(&part, head->error, mesh);
    mesh->errors[head->level_count] = pm->geometric_error[0];
    return STRL_OK;
}

/* ---- less of what is there */

static brick_part part_of(const strl__mesh *mesh, uint32_t state)
{
    brick_part part = {.state = state};
    memcpy(part.vertex_end, mesh->vertex_end, (mesh->step_count + 1) * sizeof *part.vertex_end);
    memcpy(part.triangle_end, mesh->triangle_end, (mesh->step_count + 1) * sizeof *part.triangle_end);
    memcpy(part.splat_end, mesh->splat_end, mesh->step_count * sizeof *part.splat_end);
    set_counts(&part, mesh->step_count);
    return part;
}

static size_t bytes_in(const strl__mesh *mesh, uint32_t state)
{
    const brick_part part = part_of(mesh, state);
    return block_bytes(part.vertices, part.triangles, part.splats, mesh->step_count, mesh->labels != NULL);
}

static uint32_t trimmed_state(const strl__mesh *mesh, float closed_size)
{
    return choose_state(mesh->errors, mesh->triangle_end, mesh->held, closed_size);
}

uint64_t strl__brick_excess(const strl__mesh *mesh, float closed_size)
{
    if (!mesh->splat_end || mesh->shared)
        return 0;
    uint32_t state = trimmed_state(mesh, closed_size);
    return state < mesh->held ? bytes_in(mesh, mesh->held) - bytes_in(mesh, state) : 0;
}

bool strl__brick_trim(strl__mesh *mesh, float closed_size)
{
    const brick_part part = part_of(mesh, trimmed_state(mesh, closed_size));
    strl__mesh less;
    if (part.state < mesh->state || !allocate(&part, mesh->step_count, mesh->labels != NULL, &less))
        return false;
    less.state = mesh->state;
    less.spare_bytes = mesh->spare_bytes + strl__brick_excess(mesh, closed_size);
    memcpy(less.vertices, mesh->vertices, part.vertices * sizeof *less.vertices);
    if (less.labels)
        memcpy(less.labels, mesh->labels, part.vertices * sizeof *less.labels);
    memcpy(less.splats, mesh->splats, part.splats * sizeof *less.splats);
    memcpy(less.indices, mesh->indices, 3 * (size_t)part.triangles * sizeof *less.indices);
    copy_states(&part, mesh->errors, &less);
    less.errors[less.step_count] = mesh->errors[mesh->step_count];
    strl__mesh_deinit(mesh);
    *mesh = less;
    return true;
}
